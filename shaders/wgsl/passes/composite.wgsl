// Puts the clouds, seen through the air, before the sky: what the caller gets.
#import bindings
#import camera
#import atmosphere
#import light
#import high_layer

// The sun's angular radius, 0.2666 degrees (IAU: 695 700 km at 1 au).
const SUN_RADIUS = 0.004654;

// Height above or below the high clouds at which an eye sees all of them, m. Short, as a place in the sky without them is
// wrong too, and long enough that a level ray, which meets 50 times the layer, changes by 25 % a metre at the default.
const HIGH_FADE = 100.0;

// A sheet of light and shade at a distance.
struct Layer {
    radiance: vec3f, // premultiplied
    transmittance: f32,
    distance: f32,
}

@compute @workgroup_size(8, 8)
fn composite(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.width || id.y >= frame.rows {
        return;
    }
    let index = (frame.first_row + id.y - frame.sheet_row) * frame.width + id.x;
    let view = view_direction(vec2f(f32(id.x), f32(frame.first_row + id.y)) + 0.5);
    if view.w == 0.0 {
        image[index] = vec4f(0.0);
        sky[index] = vec4f(0.0);
        depth[index] = -1.0;
        return;
    }
    let direction = view.xyz;
    let air = sky_radiance(direction);
    let ground = hit_sphere(direction, frame.power_ground);
    let meets_ground = ground.enters;
    let air_beyond = whole_air(direction, ground.near, meets_ground);

    // Three layers at most: the high clouds where the ray enters their sphere, the clouds, the high clouds where it
    // leaves it. Front to back.
    let high = hit_sphere(direction, frame.power_high);
    let near_high = high_layer(direction, high.near, high.hit && high.near > 0.0, ground.near, meets_ground);
    let far_high = high_layer(direction, high.far, high.hit, ground.near, meets_ground);
    let cloud = Layer(clouds[index].rgb, clouds[index].a, max(cloud_depth[index], 0.0));
    var layers = array<Layer, 3>(near_high, cloud, far_high);
    if cloud.distance < near_high.distance {
        layers = array<Layer, 3>(cloud, near_high, far_high);
    } else if cloud.distance > far_high.distance {
        layers = array<Layer, 3>(near_high, far_high, cloud);
    }

    var radiance = vec3f(0.0);
    var transmittance = 1.0;
    var weight_sum = 0.0;
    var distance_sum = 0.0;
    for (var i = 0; i < 3; i++) {
        let layer = layers[i];
        let opacity = 1.0 - layer.transmittance;
        // Thinner than f32 tells from nothing, a layer may still shine.
        if opacity > 0.0 || any(layer.radiance > vec3f(0.0)) {
            let seen = aerial_transmittance(altitude_at(layer.distance * direction), layer.distance);
            // The air in front holds its share of the light of all the air along the ray.
            let share = (1.0 - seen) / max(1.0 - air_beyond, 1.0 - seen + vec3f(1e-6));
            radiance += transmittance * (layer.radiance * seen + opacity * air * share);
            weight_sum += transmittance * opacity;
            distance_sum += transmittance * opacity * layer.distance;
            transmittance *= layer.transmittance;
        }
    }

    var behind = air;
    if meets_ground {
        let p = ground.near * direction;
        let lit = select(vec3f(0.0), ground_radiance(cos_zenith_at(p, frame.sun_direction)), params.atmosphere.enabled > 0u);
        behind += air_beyond * lit;
    } else if params.sun.visible > 0u {
        behind += sun_disc(direction) * air_beyond;
    }

    sky[index] = vec4f(behind, 1.0);
    depth[index] = select(-1.0, distance_sum / weight_sum, weight_sum > 0.0);
    if frame.background > 0u {
        image[index] = vec4f(radiance + transmittance * behind, 1.0);
    } else {
        image[index] = vec4f(radiance, 1.0 - transmittance);
    }
}

// Transmittance of all the air along a ray.
fn whole_air(direction: vec3f, ground_distance: f32, meets_ground: bool) -> vec3f {
    if meets_ground {
        return aerial_transmittance(0.0, ground_distance);
    }
    let air = hit_sphere(direction, frame.power_air);
    if !air.hit {
        return vec3f(1.0);
    }
    // From above the air, start where the ray enters it.
    let p = air.near * direction;
    return air_transmittance(max(altitude_at(p), 0.0), cos_zenith_at(p, direction));
}

fn high_layer(direction: vec3f, distance: f32, hit: bool, ground_distance: f32, meets_ground: bool) -> Layer {
    let hidden = meets_ground && distance > ground_distance;
    if !hit || hidden || params.high_clouds.coverage <= 0.0 {
        return Layer(vec3f(0.0), 1.0, distance);
    }
    let p = distance * direction;
    let slant = max(abs(cos_zenith_at(p, direction)), 0.02);
    // An eye that climbs through a layer without thickness would see it jump from above to below: near it, it fades.
    let fade = saturate(abs(frame.altitude - params.high_clouds.altitude) / HIGH_FADE);
    let optical_depth = fade * high_optical_depth(p);
    let transmittance = transmittance_of(optical_depth / slant);
    let sun = sun_scattering(optical_depth, 0.0, one_minus_cos(direction, frame.sun_direction));
    var radiance = sun * sky_light[3].rgb;
    if MODEL != MODEL_SINGLE {
        radiance += ambient_above();
    }
    return Layer((1.0 - transmittance) * radiance, transmittance, distance);
}

// Radiance of the sun's disc before the air, its edge one pixel soft.
fn sun_disc(direction: vec3f) -> vec3f {
    let angle = sqrt(2.0 * one_minus_cos(direction, frame.sun_direction));
    let edge = max(pixel_width(), 1e-4);
    let cover = saturate((SUN_RADIUS - angle) / edge + 0.5);
    return cover * params.sun.irradiance / (PI * SUN_RADIUS * SUN_RADIUS);
}
