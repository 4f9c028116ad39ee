// Light of the high clouds: a layer that a ray crosses in one point.
#import high_layer
#import light
#import atmosphere

override HIGH_EMBOSS: bool = false; // embossed and sunlit
override HIGH_LOW_SUN: bool = true; // low sun, whose light differs between the high clouds in sight

// Layer of clouds at a distance: one, or the composite of several.
struct Layer {
    radiance: vec3f, // premultiplied
    transmittance: f32,
    distance: f32, // m; premultiplied by opacity in composites
}

// Fade distance of the layer around the altitude of the eye, m. A layer without thickness would jump from above to
// below as the eye climbs through it. The distance is short, as a sky without high clouds is wrong too. It is long
// enough that a horizontal ray, whose path through the layer is 50 times as long, changes by 25 % per metre at the
// default.
const HIGH_FADE = 100.0;

// Smallest cosine for the path of sunlight through the high clouds. They are 300 m thick (thesis2018: 200 to 400 m) and
// about 1500 m wide, so that light which enters through their sides crosses at most five times their thickness.
const HIGH_GRAZING = 0.2;
// Two-stream reflectance per unit of optical depth: 3/4 (1 - g) with g = 0.85 of droplets (Hansen 1971).
const HIGH_ALBEDO = 0.11;
// Largest relative change of brightness by the emboss, and the relief at which half of it is reached.
const EMBOSS_GAIN = 0.9;
const EMBOSS_HALF = 0.15;

// High clouds where a ray crosses their sphere; none if not `visible`.
fn high_layer(direction: vec3f, distance: f32, visible: bool, turned: Turn) -> Layer {
    // Invisible pixels read one point of the texture, from the cache.
    let p = select(vec3f(0.0), distance * direction, visible);
    let cosine = cos_zenith_along(direction, distance, params.high_clouds.altitude);
    // Fade near the altitude of the eye, against a jump as the eye passes the layer.
    let fade = saturate(abs(frame.view.altitude - params.high_clouds.altitude) / HIGH_FADE);
    let high = high_cloud_at(p, HIGH_EMBOSS);
    let optical_depth = select(0.0, fade * high.optical_depth, visible);
    let steep = max(abs(cosine), 0.02);
    let transmittance = transmittance_of(optical_depth / steep);

    let mu_sun = cos_zenith_at(p, frame.sky.sun_direction);
    let behind = select(-mu_sun, mu_sun, cosine > 0.0);
    var sun = layer_light(optical_depth, max(abs(mu_sun), HIGH_GRAZING), steep, behind, turned) * high_sun(mu_sun);
    if HIGH_EMBOSS {
        sun *= 1.0 + params.high_clouds.emboss * EMBOSS_GAIN * high.relief / (abs(high.relief) + EMBOSS_HALF);
    }
    var radiance = sun;
    if AMBIENT {
        // Overcast is grey: seen from below, only the transmitted part of the light from above reaches the eye.
        let through = select(1.0, 1.0 / (1.0 + HIGH_ALBEDO * optical_depth), cosine > 0.0);
        // The ground below receives the light that high clouds and lower clouds transmit.
        let under = mix(1.0, 1.0 / (1.0 + HIGH_ALBEDO * optical_depth), params.high_clouds.coverage);
        let ground = under * ground_factor(p, mu_sun);
        radiance += (1.0 - transmittance) * mix(
            ambient_below(ground * sky_light_uniform[1].rgb),
            ambient_above(sky_light_uniform[0].rgb),
            through,
        );
    }
    return Layer(radiance, transmittance, distance);
}

// Irradiance of the sun at the high clouds, where its zenith cosine is `mu_sun`.
fn high_sun(mu_sun: f32) -> vec3f {
    if !HIGH_LOW_SUN {
        return sky_light_uniform[3].rgb;
    }
    // Over hundreds of kilometres the sun's elevation changes by degrees, up to sunset. A high sun is the same
    // everywhere.
    let here = dot(frame.view.zenith, frame.sky.sun_direction);
    return sun_irradiance(params.high_clouds.altitude, mix(mu_sun, here, smoothstep(LOW_SUN.x, LOW_SUN.y, here)));
}
