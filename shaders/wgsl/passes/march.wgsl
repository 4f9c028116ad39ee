// Ray march through the cloud shell: radiance, transmittance, depth and number of density evaluations of each pixel
// (nubis2015, "march").
#import bindings
#import workgroups
#import camera
#import shell
#import density
#import light
#import scene_depth
#import subrays

@compute @workgroup_size(GRID_GROUP, GRID_GROUP)
fn march(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
) {
    let id = GRID_GROUP * spread_over(group.xy, groups.xy) + local.xy;
    if id.x >= dispatch.march_width || id.y >= dispatch.rows {
        return;
    }
    march_cell((dispatch.first_row - dispatch.strip_row + id.y) * dispatch.march_width + id.x, EVERYWHERE);
}

// March of the ray list (passes/refine).
@compute @workgroup_size(LIST_GROUP)
fn march_list(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_id) local: vec3u,
) {
    let number = dispatch.first_ray + LIST_GROUP * swizzle_workgroup(group.x, groups.x) + local.x;
    if number >= listed.w {
        return;
    }
    let index = active_rays[number];
    let within = select(EVERYWHERE, cloud_span[index], dispatch.spans > 0u);
    cloud_span[index] = march_cell(index, within);
}

// Weight up to which a ray counts as having met no cloud. A deck without extinction has a weight too: its share of the
// extinction is `LEAST` in frame.rs instead of 0.
const NOTHING = 1e-15;

const EVERYWHERE = vec2f(0.0, 1e30);
const NOWHERE = vec2f(1e30, 0.0);

// Marches the ray of a cell of the strip within a range of distances. Returns the range of distances with cloud.
fn march_cell(index: u32, within: vec2f) -> vec2f {
    let cell = vec2u(index % dispatch.march_width, dispatch.strip_row + index / dispatch.march_width);
    let pixel = marched_pixel(cell);
    let view = view_direction(vec2f(pixel) + 0.5);
    var cloud = Cloud(vec3f(0.0), 1.0, -1.0, NOWHERE);
    if view.w > 0.0 {
        cloud = march_pixel(pixel, view.xyz, within);
    }
    clouds[index] = vec4f(cloud.radiance, cloud.transmittance);
    cloud_depth[index] = cloud.depth;
    samples[index] = evaluations;
    return cloud.span;
}

struct Cloud {
    radiance: vec3f, // premultiplied
    transmittance: f32,
    depth: f32, // m, -1 if there is no cloud
    span: vec2f, // from the first to the last cloud, m from the start of the march; unbounded behind opaque cloud
}

// Mean of the rays through a pixel. They share the view steps and light samples of a single ray.
fn march_pixel(pixel: vec2u, view: vec3f, within: vec2f) -> Cloud {
    let limit = scene_distance(pixel);
    let offset = ray_offset(pixel);
    let rays = rays_through(view);
    let turned = seen_turn(view, vec2f(pixel));
    if !SUBRAYS {
        return march_ray(view, turned, limit, offset, within, rays);
    }
    // Low-discrepancy sequences (R2, golden ratio), shifted by blue noise.
    let shift = vec2f(offset, ray_offset(pixel + vec2u(29u, 13u)));
    var sum = Cloud(vec3f(0.0), 0.0, 0.0, NOWHERE);
    var opacity = 0.0;
    var k = 0.0;
    loop {
        let place = ray_place(pixel, fract(shift + k * vec2f(0.7548776662, 0.5698402910)), rays);
        let direction = view_direction(place).xyz;
        let ray_span = select(EVERYWHERE, within, rays <= 1.0);
        let cloud = march_ray(direction, turned, limit, fract(offset + 0.6180339887 * k), ray_span, rays);
        let weight = depth_weight(cloud.transmittance, cloud.depth);
        // The condition differs between pixels. Without it, lavapipe adds to finished pixels the values of the other
        // pixels' next iteration (docs/numerics.md).
        if k < rays {
            sum.radiance += cloud.radiance / rays;
            sum.transmittance += cloud.transmittance / rays;
            sum.depth += weight * cloud.depth;
            sum.span = vec2f(min(sum.span.x, cloud.span.x), max(sum.span.y, cloud.span.y));
            opacity += weight;
        }
        k += 1.0;
        if k >= rays {
            break;
        }
    }
    sum.depth = select(-1.0, sum.depth / opacity, opacity > 0.0);
    // With several rays per pixel, the ranges of neighbouring pixels carry no information about a ray.
    sum.span = select(EVERYWHERE, sum.span, rays <= 1.0);
    return sum;
}

// Jitter: one blue-noise offset of up to a step for all steps of a ray. It turns banding into fine noise without
// additional error. An offset for each step has twenty times the error (docs/numerics.md).
fn ray_offset(pixel: vec2u) -> f32 {
    let rank = textureLoad(blue_noise, pixel % BLUE_SIZE, 0).r;
    // As a half float, the largest rank is 1.
    return select(0.5, fract(rank), params.quality.jitter > 0u);
}

// View steps of a ray: `count` steps over `length` metres. Steps grow by `growth` per metre of distance.
struct Steps {
    count: u32,
    length: f32,
    growth: f32,
    scale: f32, // log2 of the ratio of consecutive steps
    ratio: f32, // ratio of a step to its distance plus 1 / growth, for growing steps
    equal: f32, // length of each step without growth, m
}

// Factor on the number of view steps for rays through two decks. The product with the factor for long rays is at most
// 2.
const TWO_DECKS = 1.5;

// Lower bound on the number of steps of each of several rays through a pixel, relative to a single ray. Toward the limb
// from 402 km, in a picture of 32x32, `draft` has a cover of 0.563 with a tenth, 0.591 with a third and 0.596 with all
// steps.
const SHARED_STEPS = 0.5;

fn ray_steps(start: f32, length: f32, direction: vec3f, rays: f32) -> Steps {
    let slant = 1.0 - abs(dot(direction, frame.view.zenith));
    let count = mix(f32(params.quality.steps_zenith), f32(params.quality.steps_horizon), slant);
    // At full growth a step is a fixed fraction of its distance plus 300 m. Rays that start in cloud have fine steps
    // near the eye: 10 m; with 1 km in place of 300 m they have 25 m, which is visible as grain. Rays that start far
    // away have nearly equal steps.
    var growth = params.quality.step_growth / (start + 300.0);
    growth = select(growth, 0.0, growth * length < 1e-3);
    // Rays from inside the clouds, or from just above them, cover a larger range of distances than rays from the
    // ground. They have up to twice the steps; otherwise distant clouds are grainy.
    let reach = log(1.0 + growth * length);
    // Rays through two decks have more steps. With the steps of one deck, the error of `two_decks` is half as large
    // again.
    let decks = select(1.0, mix(1.0, TWO_DECKS, frame.sky.upper_shown), UPPER && growth > 0.0);
    let whole = round(count * clamp(decks * sqrt(reach), 1.0, 2.0));
    let steps = max(round(whole * max(1.0 / rays, SHARED_STEPS)), 1.0);
    let each = reach / steps;
    // exp(each) - 1 without cancellation.
    let ratio = each * exp(each) * one_minus_exp_over(each);
    return Steps(u32(steps), length, growth, each / log(2.0), ratio, select(0.0, length / steps, growth == 0.0));
}

// Distance from the start of the march to the start of step `i`, m.
fn step_distance(steps: Steps, i: f32) -> f32 {
    if steps.growth == 0.0 {
        return steps.equal * i;
    }
    return (exp2(steps.scale * i) - 1.0) / steps.growth;
}

// Sample on a ray.
struct Sample {
    p: vec3f,
    t: f32,
    altitude: f32,
    begin: f32, // start of its step, m from the start of the march
    length: f32, // length of its step, m
    width: f32, // footprint, m: the larger of the pixel's width and a fraction of the step
}

fn march_sample(s: Segments, steps: Steps, direction: vec3f, offset: f32, i: u32, pixel_size: f32) -> Sample {
    let begin = step_distance(steps, f32(i));
    let length = select((1.0 / steps.growth + begin) * steps.ratio, steps.equal, steps.growth == 0.0);
    let from_start = begin + offset * length;
    let t = stretch_distance(s, from_start);
    let p = t * direction;
    return Sample(p, t, altitude_at(p), begin, length, max(t * pixel_size, 0.3 * length));
}

// Light group: consecutive samples that share their light samples.
struct Group {
    span: Span,
    width: f32, // footprint of the last sample, m
    opacity: f32, // opacity in front of the last sample
}

// Adds a sample of optical depth `x` to a group. The group's distance is the mean by weight, or that of the sample if
// it outweighs all before it: otherwise a veil in front of a cloud would move the group into the gap between them.
fn with_sample(
    given: Group,
    weight: f32,
    depth: f32,
    x: f32,
    opacity: f32,
    at: Sample,
    column: WeatherSample,
) -> Group {
    var group = given;
    let here = vec3f(at.t, column.precipitation, sky_share(column));
    let before = vec3f(group.span.distance, group.span.precipitation, group.span.above);
    let total = group.span.weight + weight;
    let mean = select(mix(before, here, weight / total), here, weight > group.span.weight);
    group.span.start = select(group.span.start, depth, group.span.weight <= 0.0);
    group.span.thick += x;
    group.span.weight = total;
    group.span.distance = mean.x;
    group.span.precipitation = mean.y;
    group.span.above = mean.z;
    group.width = at.width;
    group.opacity = opacity;
    return group;
}

// Factor on the light-group weight in rain. Rain is so thin that a tenth of a pixel's opacity extends over kilometres,
// in sun and shadow. In `rain` of docs/clouds.md, shafts have visible edges and clouds behind them dots with 0.3; with
// 0.05 neither.
const RAIN_SHARE = 0.05;

// Maximum number of groups that wait for their light. With the default light-group weight no ray has more.
const GROUPS = 12u;

// Index of the step at a distance.
fn step_index(steps: Steps, distance: f32) -> f32 {
    if steps.growth == 0.0 {
        return distance / steps.length * f32(steps.count);
    }
    return log2(1.0 + steps.growth * distance) / steps.scale;
}

// Number of steps over a distance, if the first of them has the given length.
fn steps_over(steps: Steps, way: f32, length: f32) -> f32 {
    if steps.growth == 0.0 {
        return way / length;
    }
    return log2(1.0 + way / length * steps.ratio) / steps.scale;
}

// Sphere-tracing factor for steps through clear air.
struct Leaps {
    reach: f32, // step per unit by which the base shape falls short of cloud, m
    rise: f32, // divisor of `reach` along the ray, due to the change of the height profile
}

// Slope of the height profile, per thickness of the clouds: it rises and falls within an eighth of the thickness.
// Measured: with a slope of 4, steps skip stratus in `above`; 16 takes as many samples as 8.
const PROFILE_SLOPE = 8.0;

fn ray_leaps(direction: vec3f, medium: u32) -> Leaps {
    var reach = params.quality.sphere_tracing * frame.sky.leap_scale;
    var thickness = params.clouds.top - params.clouds.base;
    if UPPER && medium == UPPER_CLOUD {
        reach *= params.upper_clouds.scale;
        thickness = params.upper_clouds.top - params.upper_clouds.base;
    }
    return Leaps(reach, 1.0 + PROFILE_SLOPE * abs(dot(direction, frame.view.zenith)) * reach / thickness);
}

// Number of view steps from a point without cloud to the next sample. It is at least `coarse_step`, and grows with the
// amount by which the base shape falls short of cloud, as the slope of the noise is limited (Hart 1996, "sphere
// tracing"; the slope used here is measured, not a bound). The threshold of cloud is evaluated for the profile at the
// point, and for a profile of 1, which holds at any height. Longer steps never enter another medium.
fn steps_to_next(steps: Steps, direction: vec3f, column: WeatherSample, noise: f32, at: Sample) -> u32 {
    let big = f32(params.quality.coarse_step);
    if VOLUME {
        return params.quality.coarse_step;
    }
    let leaps = ray_leaps(direction, column.medium);
    // Distances on the chart: noise and coverage have the same slope everywhere on it.
    let lacks = lacks_of(column, noise);
    var way = leaps.reach * max(lacks.x, lacks.y / leaps.rise);
    if KEEP_CLEAR {
        way = min(way, way_to_rim(at));
    }
    way /= max(chart_scale(at.p, at.altitude), 1.0);
    if UPPER {
        way = way_to_decks(direction, way, at);
    }
    if RAIN_SHAFTS {
        way = min(way, way_to_rain(direction, at));
    }
    return u32(clamp(steps_over(steps, way, at.length), big, 1.0 + LONGEST_LEAP * (big - 1.0)));
}

// Upper bound of the change of a ray's zenith cosine within a step through clear air, due to the planet's curvature.
const BEND_OF_LEAP = 1e-3;

// Distance to the rain, m; 0 inside it. Steps longer than a coarse step neither enter rain nor occur in it.
fn way_to_rain(direction: vec3f, at: Sample) -> f32 {
    let mu = cos_zenith_along(direction, at.t, at.altitude);
    let over = max(at.altitude - params.clouds.base, 0.0);
    return select(over / (abs(mu) + BEND_OF_LEAP), 1e30, mu > 0.0 && over > 0.0);
}

// Limit of a step at the region kept clear, m. Outside its rim there is none, as the region only removes clouds. Inside
// it steps end where coverage begins. In the rim the limit is 0.
fn way_to_rim(at: Sample) -> f32 {
    let away = length(on_chart(at.p, at.altitude) - frame.sky.clear_at);
    return select(max(frame.sky.clear_radius - away, 0.0), 1e30, away >= 1.5 * frame.sky.clear_radius);
}

// Length of a step with two decks, m. Within a deck it ends at the other deck at the latest. Between the decks it is
// the whole way to the next one.
fn way_to_decks(direction: vec3f, leap: f32, at: Sample) -> f32 {
    let over = at.altitude - frame.sky.lower_top;
    let under = params.upper_clouds.base - at.altitude;
    let mu = cos_zenith_along(direction, at.t, at.altitude);
    let way = max(select(over, under, mu > 0.0), 0.0) / (abs(mu) + BEND_OF_LEAP);
    if over > 0.0 && under > 0.0 {
        return way;
    }
    // Where towers reach into the upper deck, both decks overlap. Steps there shrink to coarse steps as the upper deck
    // appears.
    let alone = leap * select(1.0, 1.0 - frame.sky.upper_shown, over <= 0.0 && under <= 0.0);
    return select(alone, min(alone, way), way > 0.0);
}

// Maximum length of a step through clear air, as a multiple of the view steps that a coarse step skips. A coarse step
// of 1 skips none, and disables longer steps.
const LONGEST_LEAP = 16.0;

fn march_ray(direction: vec3f, turned: Turn, limit: f32, offset: f32, within: vec2f, rays: f32) -> Cloud {
    let segments = segments_before(cloud_segments(direction), limit);
    let length = segments.first + segments.second;
    // The optical depth is summed. A product of a thousand transmittances of almost 1 is 1, or loses 6e-8 per factor
    // (docs/numerics.md).
    var optical_depth = 0.0;
    var transmittance = 1.0;
    if length <= 0.0 || (!VOLUME && !UPPER && params.clouds.coverage <= 0.0) {
        return Cloud(vec3f(0.0), 1.0, -1.0, NOWHERE);
    }
    let steps = ray_steps(segments.start, length, direction, rays);
    let pixel_size = pixel_width(direction);
    let sunlit = is_sunlit();
    let nodes = aerial_points(segments.start, stretch_distance(segments, length) - segments.start);

    var sum = Gathered();

    let big = params.quality.coarse_step;
    // Error on `fair_weather`: 6 % with a slack of one coarse step, 2 % with 4, and with 8 no more than for a march of
    // the whole ray. 8 take 3 % more time.
    let slack = f32(8u * big);
    let end = u32(clamp(step_index(steps, within.y) + slack, 0.0, f32(steps.count)));
    var i = u32(clamp(step_index(steps, within.x) - slack, 0.0, f32(steps.count))); // index of the current step
    var span = NOWHERE;
    var seen = i; // steps below this index have been sampled in full
    var leapt = big; // length of the last step in view steps; all but one of them were skipped
    // The search for the first cloud has a loop of its own, without the code for clouds, which is a third of an
    // iteration.
    loop {
        let at = march_sample(segments, steps, direction, offset, i, pixel_size);
        let column = cloud_column(at.p, at.altitude);
        let noise = base_noise(column);
        if !(shape_in(column, noise) <= 0.0) {
            i = max(i - min(i, leapt - 1u), seen);
            break;
        }
        leapt = steps_to_next(steps, direction, column, noise, at);
        i += leapt;
        if i >= end {
            break;
        }
    }
    if i >= end {
        return Cloud(vec3f(0.0), 1.0, -1.0, NOWHERE);
    }
    // Consecutive full samples of zero density; from `empty_before_coarse` on, the march takes coarse steps.
    var empty = 0u;
    var reached = 0.0; // sum of distances by opacity, m
    var ends = false; // whether what lies behind is negligible
    var group = Group();
    var groups: array<Group, GROUPS>;
    var count = 0u;
    // The ray is marched first and lit after: lavapipe runs both sides of every branch for eight rays together. Each
    // ray continues through its own gaps and clouds and waits for no other ray's light. Measured at 1280x720, night
    // included: 35 samples per ray of `fair_weather` in `draft` take 45 iterations of the march and 3 of the light;
    // with light at each sample, 86 and 16.
    loop {
        loop {
            let at = march_sample(segments, steps, direction, offset, i, pixel_size);
            let column = cloud_column(at.p, at.altitude);
            let noise = base_noise(column);
            let shape = shape_in(column, noise);
            // Outside clouds samples are coarse. On a hit the march goes back over the skipped steps.
            let searching = empty >= params.quality.empty_before_coarse;
            let hit = !(shape <= 0.0); // not "shape > 0", with which a NaN would never advance
            let back = select(i, max(i - min(i, leapt - 1u), seen), searching);
            let full = hit && back == i;
            var density = 0.0;
            if full {
                density = cloud_density(column, shape, at.width);
            }
            leapt = steps_to_next(steps, direction, column, noise, at);
            empty = select(empty + 1u, 0u, density > 0.0 || (hit && searching));
            i = select(i + select(1u, leapt, searching && !hit), back, hit && !full);
            seen = select(seen, i, full || !searching);
            if density > 0.0 {
                let x = density * frame.sky.extinction * at.length;
                let weight = sample_weight(transmittance, optical_depth, x);
                group = with_sample(group, weight, optical_depth, x, 1.0 - transmittance, at, column);
                reached += transmittance * x * one_minus_exp_over(x) * at.t;
                span = vec2f(min(span.x, at.begin), at.begin + at.length);
                optical_depth += x;
                transmittance = transmittance_of(optical_depth);
                ends = is_opaque(transmittance, optical_depth);
                i = select(i, end, ends);
            }
            let of_rain = select(1.0, RAIN_SHARE, RAIN_SHAFTS && column.medium == RAIN);
            let share = rays * params.quality.light_group_weight * of_rain;
            // A veil before a gap has light of its own. Lit with the clouds behind, it had dots where a little more or
            // less of it decided where the group was lit (`storm`). It takes 3 % of the time.
            let parted = empty >= params.quality.empty_before_coarse;
            if group.span.weight > select(share, 0.0, i >= end || parted) {
                group.span.is_last = ends;
                groups[count] = group;
                count += 1u;
                group = Group();
            }
            if i >= end || count == GROUPS {
                break;
            }
        }
        if count > 0u {
            loop {
                count -= 1u;
                let lit = groups[count];
                var span = lit.span;
                let p = span.distance * direction;
                if SUNLIT && sunlit {
                    span.depth_to_sun = depth_toward_sun(p, lit.opacity, lit.width);
                }
                sum = gather(sum, nodes, lit_span(span, p, direction, turned));
                if count == 0u {
                    break;
                }
            }
        }
        // Loops that test at their end run one iteration less on lavapipe: a fifth of the time.
        if i >= end {
            break;
        }
    }
    let weight = gathered_weight(sum);
    if weight <= NOTHING {
        return Cloud(vec3f(0.0), 1.0, -1.0, NOWHERE);
    }

    // 1 - exp(-x) without cancellation.
    let distance = reached / (optical_depth * one_minus_exp_over(optical_depth));
    var radiance = gathered_radiance(sum, nodes, direction);
    if ends {
        radiance *= tail_scale(transmittance);
        transmittance = 0.0;
        span.y = EVERYWHERE.y;
    } else {
        radiance += forward_background(direction, transmittance, optical_depth);
    }
    return Cloud(radiance, transmittance, distance, span);
}
