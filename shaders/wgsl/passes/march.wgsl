// Marches each pixel's ray through the cloud shell: radiance, transmittance, depth, samples (nubis2015, "march").
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

// Marches the pixels of a list (passes/refine).
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
    let known = select(EVERYWHERE, cloud_span[index], dispatch.spans > 0u);
    cloud_span[index] = march_cell(index, known);
}

// The weight up to which a ray has met nothing: of decks without extinction (`LEAST` in frame.rs).
const NOTHING = 1e-15;

const EVERYWHERE = vec2f(0.0, 1e30);
const NOWHERE = vec2f(1e30, 0.0);

// Marches the ray of a cell of the sheet within a span, and returns the span of its clouds.
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
    depth: f32, // m, -1 where there is none
    span: vec2f, // from the first to the last cloud, m from the start of the march; without end behind an opaque one
}

// Of several rays the mean, which share the steps and the light that one has.
fn march_pixel(pixel: vec2u, view: vec3f, within: vec2f) -> Cloud {
    let limit = scene_distance(pixel);
    let offset = ray_offset(pixel);
    let rays = rays_through(view);
    let turned = seen_turn(view, vec2f(pixel));
    if !SUBRAYS {
        return march_ray(view, turned, limit, offset, within, rays);
    }
    // Low-discrepancy sequences (R2, golden ratio) from where blue noise has it.
    let shift = vec2f(offset, ray_offset(pixel + vec2u(29u, 13u)));
    var sum = Cloud(vec3f(0.0), 0.0, 0.0, NOWHERE);
    var opacity = 0.0;
    var k = 0.0;
    loop {
        let place = ray_place(pixel, fract(shift + k * vec2f(0.7548776662, 0.5698402910)), rays);
        let direction = view_direction(place).xyz;
        let known = select(EVERYWHERE, within, rays <= 1.0);
        let cloud = march_ray(direction, turned, limit, fract(offset + 0.6180339887 * k), known, rays);
        let weight = depth_weight(cloud.transmittance, cloud.depth);
        // Under a condition that differs by pixel: else lavapipe adds to those that are done what the others' next turn finds
        // (docs/numerics.md).
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
    // Neighbours of several rays say nothing of where those meet cloud.
    sum.span = select(EVERYWHERE, sum.span, rays <= 1.0);
    return sum;
}

// One blue-noise offset of up to a step for the whole ray: it turns bands into fine noise at no cost in error, where
// an offset for each step would cost twenty times the error (docs/numerics.md).
fn ray_offset(pixel: vec2u) -> f32 {
    let rank = textureLoad(blue_noise, pixel % BLUE_SIZE, 0).r;
    // The largest rank is 1 as a half float.
    return select(0.5, fract(rank), params.quality.jitter > 0u);
}

// The steps of a ray: `count` of them over `length` metres, growing with distance by `growth` per metre.
struct Steps {
    count: u32,
    length: f32,
    growth: f32,
    scale: f32, // log2 of the ratio of a step to the one before
    ratio: f32, // of a step to its distance, where they grow, plus 1 / growth
    equal: f32, // all of them, where they do not, m
}

// How many times the steps a ray through two decks gets, within the twice that the longest get.
const TWO_DECKS = 1.5;

// Of several rays through a pixel each gets its share of them, but no less than that of what one alone gets: toward the limb from
// 402 km, in a picture of 32x32, `draft` finds a cover of 0.563 with a tenth, 0.591 with a third and 0.596 with all.
const SHARED_STEPS = 0.5;

fn ray_steps(start: f32, length: f32, direction: vec3f, rays: f32) -> Steps {
    let slant = 1.0 - abs(dot(direction, frame.view.zenith));
    let count = mix(f32(params.quality.steps_zenith), f32(params.quality.steps_horizon), slant);
    // At full growth a step is a fixed share of its distance plus 300 m: rays that start in the cloud have fine steps
    // near the eye (10 m, where 1 km would give 25 and show them as grain), rays that start far away nearly equal ones.
    var growth = params.quality.step_growth / (start + 300.0);
    growth = select(growth, 0.0, growth * length < 1e-3);
    // A ray from inside the clouds, or from just above them, has to cover many more distances than one from the ground:
    // it gets up to twice the steps, or its far clouds are grain.
    let reach = log(1.0 + growth * length);
    // So does one through two decks: with as many steps as through one, those of `two_decks` err by a half more.
    let decks = select(1.0, mix(1.0, TWO_DECKS, frame.sky.upper_shown), UPPER && growth > 0.0);
    let whole = round(count * clamp(decks * sqrt(reach), 1.0, 2.0));
    let steps = max(round(whole * max(1.0 / rays, SHARED_STEPS)), 1.0);
    let each = reach / steps;
    // exp(each) - 1 with all its digits.
    let ratio = each * exp(each) * one_minus_exp_over(each);
    return Steps(u32(steps), length, growth, each / log(2.0), ratio, select(0.0, length / steps, growth == 0.0));
}

// Distance from the start of the march to a step boundary.
fn step_distance(steps: Steps, i: f32) -> f32 {
    if steps.growth == 0.0 {
        return steps.equal * i;
    }
    return (exp2(steps.scale * i) - 1.0) / steps.growth;
}

// A place on the ray.
struct Sample {
    p: vec3f,
    t: f32,
    altitude: f32,
    begin: f32, // of the step it stands for, m from the start of the march
    length: f32, // of that step
    width: f32, // a pixel across, or a good part of the step along the ray, whichever is more
}

fn march_sample(s: Segments, steps: Steps, direction: vec3f, offset: f32, i: u32, pixel_size: f32) -> Sample {
    let begin = step_distance(steps, f32(i));
    let length = select((1.0 / steps.growth + begin) * steps.ratio, steps.equal, steps.growth == 0.0);
    let from_start = begin + offset * length;
    let t = stretch_distance(s, from_start);
    let p = t * direction;
    return Sample(p, t, altitude_at(p), begin, length, max(t * pixel_size, 0.3 * length));
}

// Samples in a row that are lit as one.
struct Group {
    weight: f32, // of all of them: what they take from the transmittance
    distance: f32, // mean by weight, m from the eye
    precipitation: f32, // mean by weight
    above: f32, // share of the ambient light, mean by weight
    width: f32, // of the last
    opacity: f32, // of what is before the last
}

// Their place is where most of them is: a sample that outweighs all before it has its own, or a veil before a cloud would
// move it into the gap between.
fn with_sample(group: Group, weight: f32, opacity: f32, at: Sample, column: WeatherSample) -> Group {
    let here = vec3f(at.t, column.precipitation, ambient_share(column));
    let before = vec3f(group.distance, group.precipitation, group.above);
    let total = group.weight + weight;
    let mean = select(mix(before, here, weight / total), here, weight > group.weight);
    return Group(total, mean.x, mean.y, mean.z, at.width, opacity);
}

// Rain is so thin that a tenth of a pixel of it is kilometres long, in sun and shadow: it is lit by so much less at a time.
// Measured in docs/clouds.md's `rain`: with 0.3 shafts have edges and clouds behind them dots, with 0.05 neither.
const RAIN_SHARE = 0.05;

// Most groups that wait for their light: with the default share of light a ray has no more.
const GROUPS = 12u;

// At which step a distance is reached.
fn step_index(steps: Steps, distance: f32) -> f32 {
    if steps.growth == 0.0 {
        return distance / steps.length * f32(steps.count);
    }
    return log2(1.0 + steps.growth * distance) / steps.scale;
}

// How many steps take a way, the first of them of a given length.
fn steps_over(steps: Steps, way: f32, length: f32) -> f32 {
    if steps.growth == 0.0 {
        return way / length;
    }
    return log2(1.0 + way / length * steps.ratio) / steps.scale;
}

// How far a ray may leap through clear air for each unit that the base shape lacks of being cloud.
struct Leaps {
    reach: f32, // m
    rise: f32, // by how much less along the ray, as its heights pass through the profile
}

// The profile of heights, from base to top, rises and falls within an eighth of them. Measured: a fourth leaps past stratus
// in `above`; a sixteenth takes as many samples as an eighth.
const PROFILE_SLOPE = 8.0;

fn ray_leaps(direction: vec3f, medium: u32) -> Leaps {
    var reach = params.quality.leap * frame.sky.leap_scale;
    var thickness = params.clouds.top - params.clouds.base;
    if UPPER && medium == UPPER_CLOUD {
        reach *= params.upper_clouds.scale;
        thickness = params.upper_clouds.top - params.upper_clouds.base;
    }
    return Leaps(reach, 1.0 + PROFILE_SLOPE * abs(dot(direction, frame.view.zenith)) * reach / thickness);
}

// The steps from a point without cloud to where to look next: `big_step` of them, or more the more the shape lacks, as the
// noise changes no faster than so much in a metre (Hart 1996, "sphere tracing", with a slope that is measured, not a bound).
// Its threshold is what the profile lets through, here and, with none, at any height. Not to where another medium may be.
fn steps_to_next(steps: Steps, direction: vec3f, column: WeatherSample, noise: f32, at: Sample) -> u32 {
    let big = f32(params.quality.big_step);
    if VOLUME {
        return params.quality.big_step;
    }
    let leaps = ray_leaps(direction, column.medium);
    // By the chart, on which noise and cover change as fast everywhere.
    let lacks = 1.0 - column.coverage - noise * vec2f(1.0, column.profile);
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

// Rays bend away from the ground: by less than this within a leap.
const BEND_OF_LEAP = 1e-3;

// No leap goes into the rain, nor any in it.
fn way_to_rain(direction: vec3f, at: Sample) -> f32 {
    let mu = cos_zenith_along(direction, at.t, at.altitude);
    let over = max(at.altitude - params.clouds.base, 0.0);
    return select(over / (abs(mu) + BEND_OF_LEAP), 1e30, mu > 0.0 && over > 0.0);
}

// Where a spot is kept clear there is no more than without it, and leaps from outside hold; within it, to where the cover
// begins, and in its rim none.
fn way_to_rim(at: Sample) -> f32 {
    let away = length(on_chart(at.p, at.altitude) - frame.sky.clear_at);
    return select(max(frame.sky.clear_radius - away, 0.0), 1e30, away >= 1.5 * frame.sky.clear_radius);
}

// A leap within a deck, no farther than to the other one; between both, all the way there.
fn way_to_decks(direction: vec3f, leap: f32, at: Sample) -> f32 {
    let over = at.altitude - frame.sky.lower_top;
    let under = params.upper_clouds.base - at.altitude;
    let mu = cos_zenith_along(direction, at.t, at.altitude);
    let way = max(select(over, under, mu > 0.0), 0.0) / (abs(mu) + BEND_OF_LEAP);
    if over > 0.0 && under > 0.0 {
        return way;
    }
    // Towers may reach into the deck above: there neither is alone, as soon as that shows.
    let alone = leap * select(1.0, 1.0 - frame.sky.upper_shown, over <= 0.0 && under <= 0.0);
    return select(alone, min(alone, way), way > 0.0);
}

// Steps for each that a big step leaps over: where those leap over none, nothing does.
const LONGEST_LEAP = 16.0;

fn march_ray(direction: vec3f, turned: Turn, limit: f32, offset: f32, within: vec2f, rays: f32) -> Cloud {
    let segments = segments_before(cloud_segments(direction), limit);
    let length = segments.first + segments.second;
    // The optical depth is summed, not the transmittance multiplied: a thousand factors of almost 1 are all 1, or all
    // 6e-8 less.
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

    let big = params.quality.big_step;
    // Measured on `fair_weather`: one big step of slack errs by 6 %, 4 by 2 %, 8 as little as all of the ray, in 3 % more time.
    let slack = f32(8u * big);
    let end = u32(clamp(step_index(steps, within.y) + slack, 0.0, f32(steps.count)));
    var i = u32(clamp(step_index(steps, within.x) - slack, 0.0, f32(steps.count))); // the step at hand
    var span = NOWHERE;
    var seen = i; // steps below this one have had their full sample
    var leapt = big; // steps before this one that have been leapt over, and one
    // The way to the first cloud has a loop of its own, without what is for clouds: that is a third of a turn.
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
    var empty = 0u; // full samples of zero in a row; from so many on, samples are cheap
    var reached = 0.0; // distance by weight, m
    var group = Group();
    var groups: array<Group, GROUPS>;
    var count = 0u;
    // First the ray, then the light: lavapipe runs both sides of every branch, and eight rays together. Each goes on through
    // gaps and clouds of its own, and none waits for another's light. Measured at 1280x720, night included: 35 samples a ray of
    // `fair_weather` in `draft` take 45 turns, and light 3; where light was looked for at each sample, 86 and 16.
    loop {
        loop {
            let at = march_sample(segments, steps, direction, offset, i, pixel_size);
            let column = cloud_column(at.p, at.altitude);
            let noise = base_noise(column);
            let shape = shape_in(column, noise);
            // Leaps outside clouds; on a hit back by what was leapt over.
            let searching = empty >= params.quality.empty_samples;
            let hit = !(shape <= 0.0); // not "shape > 0": with that, a NaN would stand still for ever
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
                let weight = transmittance * x * one_minus_exp_over(x);
                group = with_sample(group, weight, 1.0 - transmittance, at, column);
                reached += weight * at.t;
                span = vec2f(min(span.x, at.begin), at.begin + at.length);
                optical_depth += x;
                transmittance = transmittance_of(optical_depth);
                i = select(i, end, transmittance < params.quality.min_transmittance);
            }
            let of_rain = select(1.0, RAIN_SHARE, RAIN_SHAFTS && column.medium == RAIN);
            let share = rays * params.quality.light_share * of_rain;
            if group.weight > select(share, 0.0, i >= end) {
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
                var depth_to_sun = 0.0;
                if SUNLIT && sunlit {
                    depth_to_sun = optical_depth_to_sun(lit.distance * direction, lit.opacity, lit.width);
                }
                let sun = seen_scattering(depth_to_sun, lit.precipitation, turned);
                sum = gather(sum, nodes, lit.weight, sun, lit.above, lit.distance);
                if count == 0u {
                    break;
                }
            }
        }
        // Tested at their end, loops run once less on lavapipe: a fifth of the time.
        if i >= end {
            break;
        }
    }
    let weight = gathered_weight(sum);
    if weight <= NOTHING {
        return Cloud(vec3f(0.0), 1.0, -1.0, NOWHERE);
    }

    var scale = 1.0;
    if transmittance < params.quality.min_transmittance {
        // What the rest of the ray would have added is taken to be like what was seen.
        scale = 1.0 / (1.0 - transmittance);
        transmittance = 0.0;
        span.y = EVERYWHERE.y;
    }
    return Cloud(scale * gathered_radiance(sum, nodes, direction), transmittance, reached / weight, span);
}
