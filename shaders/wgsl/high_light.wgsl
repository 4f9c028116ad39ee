// How the high clouds are lit, as a layer that a ray crosses at once.
#import high_layer
#import light
#import atmosphere

override HIGH_EMBOSS: bool = false; // they are embossed, and the sun shines on them
override HIGH_LOW_SUN: bool = true; // the sun is so low that it shines on each of them in its own way

// A sheet of light and shade at a distance, or several as one.
struct Layer {
    radiance: vec3f, // premultiplied
    transmittance: f32,
    distance: f32, // times opacity once it is seen
}

// Height above or below the high clouds at which an eye sees all of them, m. Short, as a place in the sky without them is
// wrong too, and long enough that a level ray, which meets 50 times the layer, changes by 25 % a metre at the default.
const HIGH_FADE = 100.0;

// Smallest cosine that counts for the way of sunlight through the high clouds: they are 300 m thick (thesis2018: 200 to
// 400 m) and some 1500 m wide, so that light that comes in at their sides never goes more than five times their thickness.
const HIGH_GRAZING = 0.2;
// Sine of the sun's height above their plane, up or down, within which its light comes in at their sides: 3 degrees.
const HIGH_SIDE = 0.05;
// How much of the light from above a cloud of optical depth 1 turns back: 3/4 (1 - g), two streams, with g = 0.85 of
// droplets (Hansen 1971).
const HIGH_ALBEDO = 0.11;
// How much brighter, or darker, what is embossed is at most, and the relief that gives half of that.
const EMBOSS_GAIN = 0.9;
const EMBOSS_HALF = 0.15;

// The high clouds where a ray crosses their sphere, or nothing.
fn high_layer(direction: vec3f, distance: f32, visible: bool, turned: Turn) -> Layer {
    // What is not seen reads the texture in one place, from the cache.
    let p = select(vec3f(0.0), distance * direction, visible);
    let cosine = cos_zenith_along(direction, distance, params.high_clouds.altitude);
    // An eye that climbs through a layer without thickness would see it jump from above to below: near it, it fades.
    let fade = saturate(abs(frame.view.altitude - params.high_clouds.altitude) / HIGH_FADE);
    let high = high_cloud_at(p, HIGH_EMBOSS);
    let optical_depth = select(0.0, fade * high.optical_depth, visible);
    let along = optical_depth / max(abs(cosine), 0.02);
    let transmittance = transmittance_of(along);

    let mu_sun = cos_zenith_at(p, frame.sky.sun_direction);
    let depth = depth_to_sun(along, optical_depth / max(abs(mu_sun), HIGH_GRAZING), select(-mu_sun, mu_sun, cosine > 0.0));
    var sun = seen_scattering(depth, 0.0, turned) * high_sun(mu_sun);
    if HIGH_EMBOSS {
        sun *= 1.0 + params.high_clouds.emboss * EMBOSS_GAIN * high.relief / (abs(high.relief) + EMBOSS_HALF);
    }
    var radiance = sun;
    if MODEL != MODEL_SINGLE {
        // Overcast is grey: from below, only what it lets through comes from above.
        let through = select(1.0, 1.0 / (1.0 + HIGH_ALBEDO * optical_depth), cosine > 0.0);
        // The ground has what they and those under them let through.
        let ground = ground_share() * mix(1.0, 1.0 / (1.0 + HIGH_ALBEDO * optical_depth), params.high_clouds.coverage);
        radiance += mix(ambient_below(ground * sky_light_uniform[1].rgb), ambient_above(sky_light_uniform[0].rgb), through);
    }
    return Layer((1.0 - transmittance) * radiance, transmittance, distance);
}

// Optical depth to the sun of what is seen of a uniform layer of optical depth `view` along the ray and `light` along the
// sun's: that of the mean transmittance toward the sun, by single scattering, over what the eye sees. With a sine of the
// sun's height `behind` the layer, negative in front of it, as seen from the eye.
fn depth_to_sun(view: f32, light: f32, behind: f32) -> f32 {
    let seen = log_mean_transmittance(view);
    let front = seen - log_mean_transmittance(view + light);
    let back = light + seen - log_mean_transmittance(view - light);
    return mix(front, back, smoothstep(-HIGH_SIDE, HIGH_SIDE, behind));
}

// Logarithm of (1 - exp(-x)) / x, for negative x too.
fn log_mean_transmittance(x: f32) -> f32 {
    return max(-x, 0.0) + log(one_minus_exp_over(abs(x)));
}

// Sunlight at the high clouds for its cosine with their zenith.
fn high_sun(mu_sun: f32) -> vec3f {
    if !HIGH_LOW_SUN {
        return sky_light_uniform[3].rgb;
    }
    // Hundreds of kilometres away it stands degrees higher or lower, and has set or not.
    let here = dot(frame.view.zenith, frame.sky.sun_direction);
    return sun_irradiance(params.high_clouds.altitude, mix(mu_sun, here, smoothstep(LOW_SUN.x, LOW_SUN.y, here)));
}
