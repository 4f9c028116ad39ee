// Reference integrator: integrates the field and light of `march` until each pixel's ray has converged. Panels are
// halved until the result is stable; sun rays reach to the end of the clouds (docs/accuracy.md).
//
// One loop, whose every iteration reads one panel, of the view ray or of a sun ray. No ray waits for another, and a ray
// can stop after any iteration and continue in the next dispatch.
#import bindings
#import camera
#import panels
#import light
#import scene_depth

// Stages of a ray.
const START = 0u;
const VIEW = 1u; // panel of the view ray
const SUN = 2u; // panel of a sun ray, from one of the two points of the view panel
const DONE = 3u;

// Largest optical depth of a view panel at level 0, before any halving.
const THICKEST = 0.5;
// Largest difference, at level 0, of the optical depths toward the sun from the two points of a panel: behind a steep
// edge light varies within a panel.
const UNEVEN = 0.5;
// Largest numbers of panels per ray at level 0, whatever the size of features: long rays through small features end,
// too.
const VIEW_PANELS = 4096.0;
const SUN_PANELS = 1024.0;
// Limits of halvings and evaluations, at which a ray counts as converged; `uncertainty` has its error.
const MOST_HALVINGS = 5u;
const MOST_EVALUATIONS = 1u << 24u;
// Radiance, as a fraction of the sun's irradiance, below which errors are negligible.
const DARK = 1e-6;

@compute @workgroup_size(64)
fn reference(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= dispatch.active_rays {
        return;
    }
    let index = active_rays[id.x];
    let pixel = vec2u(index % frame.view.width, dispatch.strip_row + index / frame.view.width);
    let view = view_direction(vec2f(pixel) + 0.5);
    let direction = view.xyz;
    let segments = segments_before(cloud_segments(direction), scene_distance(pixel));
    let length = select(0.0, segments.first + segments.second, view.w > 0.0);
    let empty = length <= 0.0 || (!VOLUME && !UPPER && params.clouds.coverage <= 0.0);
    let turned = seen_turn(direction, vec2f(pixel));
    let sunlit = is_sunlit();
    let nodes = aerial_points(segments.start, stretch_distance(segments, length) - segments.start);
    let opaque = dark_depth();
    let pixel_size = pixel_width(direction);

    var ray = reference_rays[index];
    evaluations = ray.evaluations;
    var turns = 0u;
    for (; turns < dispatch.budget && ray.stage != DONE; turns++) {
        let finer = exp2(-f32(ray.level));
        if ray.stage == START {
            ray.x = 0.0;
            ray.longest = 1e30;
            ray.optical_depth = 0.0;
            ray.sun = vec4f(0.0);
            ray.above = vec4f(0.0);
            ray.below = vec4f(0.0);
            ray.weight = vec4f(0.0);
            ray.distance = 0.0;
            ray.stage = VIEW;
        }

        // Current panel, of either ray.
        let toward_sun = ray.stage == SUN;
        let view_panel = Panel(ray.x, ray.end);
        let from_point = panel_points(view_panel)[ray.point];
        let t = stretch_distance(segments, select(ray.x, from_point, toward_sun));
        let width = t * pixel_size;
        let origin = select(vec3f(0.0), t * direction, toward_sun);
        let along = select(direction, frame.sky.sun_direction, toward_sun);
        var s = segments;
        if toward_sun {
            s = Segments(ray.sun_start, ray.sun_first, ray.sun_gap, ray.sun_second);
        }
        let x = select(ray.x, ray.sun_x, toward_sun);
        let left = select(length, s.first + s.second, toward_sun) - x;
        let fair = (x + left) / select(VIEW_PANELS, SUN_PANELS, toward_sun);
        var longest = finer * max(clamp(width, 2.0 * finest_feature(), coarsest_panel()), fair);
        if VOLUME {
            // Sun panels end at the grid's cells. View panels are also halved, as light along the view ray is no cubic.
            longest = select(finer * frame.sky.voxel, 1e30, toward_sun);
        }
        // Sun panels are halved once. Further halvings change pictures by less than 0.12 % and take five to ten times
        // as long.
        longest = select(min(longest, ray.longest), longest * max(1.0, 0.5 / finer), toward_sun);
        let panel = panel_from(origin, along, s, x, min(longest, left));
        let reading = read_panel(panel, origin, along, s, width);
        let depth = panel_depth(panel, reading.density);

        var add = false; // whether the view panel is complete
        var next_sun = false; // whether a sun ray starts
        if toward_sun {
            ray.sun_depth += depth;
            ray.sun_x = panel.end;
            if panel.end >= s.first + s.second || ray.sun_depth > opaque {
                if ray.point == 0u {
                    ray.first_depth = ray.sun_depth;
                    ray.point = 1u;
                    next_sun = true;
                } else {
                    add = true;
                }
            }
        } else if depth > finer * THICKEST && panel.end - panel.begin > 1.5 * shortest_panel(s, x) {
            ray.longest = (panel.end - panel.begin) * max(0.9 * finer * THICKEST / depth, 0.1);
        } else {
            ray.end = panel.end;
            ray.density = reading.density;
            ray.share = vec2f(sky_share(reading.first), sky_share(reading.second));
            ray.precipitation = vec2f(reading.first.precipitation, reading.second.precipitation);
            ray.longest = 2.0 * (panel.end - panel.begin);
            ray.point = 0u;
            ray.sun_depth = 0.0;
            ray.first_depth = 0.0;
            if depth <= 0.0 {
                ray.x = panel.end;
            } else if sunlit {
                next_sun = true;
            } else {
                add = true;
            }
        }
        if next_sun {
            ray.stage = SUN;
            ray.sun_x = 0.0;
            ray.sun_depth = 0.0;
            let from_here = panel_points(Panel(ray.x, ray.end))[ray.point];
            let sun = cloud_stretches_from(stretch_distance(segments, from_here) * direction, frame.sky.sun_direction);
            ray.sun_start = sun.start;
            ray.sun_first = sun.first;
            ray.sun_gap = sun.gap;
            ray.sun_second = sun.second;
        }
        if add {
            let whole = Panel(ray.x, ray.end);
            let points = panel_points(whole);
            let x = panel_depth(whole, ray.density);
            let transmittance = transmittance_of(ray.optical_depth);
            let weight = transmittance * x * one_minus_exp_over(x);
            let first = first_share(x, ray.density);
            let weights = sample_weight(transmittance, ray.optical_depth, x) * vec2f(first, 1.0 - first);
            let distances = vec2f(stretch_distance(segments, points.x), stretch_distance(segments, points.y));
            let part = x * ray.density / max(ray.density.x + ray.density.y, 1e-30);
            let near = Span(
                ray.optical_depth, part.x, weights.x, ray.first_depth, ray.precipitation.x, ray.share.x, distances.x,
                false);
            let far = Span(
                ray.optical_depth + part.x, part.y, weights.y, ray.sun_depth, ray.precipitation.y, ray.share.y,
                distances.y, false);
            let a = lit_span(near, near.distance * direction, direction, turned);
            let b = lit_span(far, far.distance * direction, direction, turned);
            let uneven = abs(ray.sun_depth - ray.first_depth) > finer * UNEVEN
                && weight * abs(a.sun - b.sun) > 0.1 * params.quality.tolerance * (dot(ray.sun, vec4f(1.0)) + DARK);
            ray.stage = VIEW;
            if uneven && ray.end - ray.x > 1.5 * shortest_panel(segments, ray.x) {
                ray.longest = 0.5 * (ray.end - ray.x);
            } else {
                var sum = Gathered(ray.sun, ray.above, ray.below, ray.weight);
                sum = gather(sum, nodes, a);
                sum = gather(sum, nodes, b);
                ray.sun = sum.sun;
                ray.above = sum.above;
                ray.below = sum.below;
                ray.weight = sum.weight;
                ray.distance += weight * dot(vec2f(first, 1.0 - first), distances);
                ray.optical_depth += x;
                ray.x = ray.end;
            }
        }
        if empty || (ray.stage == VIEW && (ray.x >= length || ray.optical_depth > opaque_depth())) {
            ray = finished(ray, index, nodes, direction, empty);
        }
    }
    ray.evaluations = evaluations;
    reference_rays[index] = ray;
    progress[id.x] = vec2u(turns, select(0u, 1u, ray.stage == DONE));
}

// End of a ray: it has converged, or restarts with panels half as long.
fn finished(given: ReferenceRay, index: u32, nodes: AerialPoints, direction: vec3f, empty: bool) -> ReferenceRay {
    var ray = given;
    let sum = Gathered(ray.sun, ray.above, ray.below, ray.weight);
    let transmittance = transmittance_of(ray.optical_depth);
    let whole = ray.optical_depth * one_minus_exp_over(ray.optical_depth); // 1 - exp(-x)
    let radiance = gathered_radiance(sum, nodes, direction);
    let result = vec4f(radiance + forward_background(direction, transmittance, ray.optical_depth), transmittance);
    let change = abs(result - ray.previous);
    let dark = DARK * sky_light[2].rgb;
    let tolerance = params.quality.tolerance;
    let steady = all(change.rgb <= tolerance * (result.rgb + dark)) && change.a <= 0.1 * tolerance;
    if empty || (ray.level > 0u && steady) || ray.level >= MOST_HALVINGS
        || (ray.level > 0u && evaluations > MOST_EVALUATIONS) {
        clouds[index] = select(result, vec4f(0.0, 0.0, 0.0, 1.0), empty);
        cloud_depth[index] = select(-1.0, ray.distance / whole, !empty && whole > 0.0);
        samples[index] = evaluations;
        uncertainty[index] = select(vec4f(change.rgb, 0.0), vec4f(0.0), empty);
        ray.stage = DONE;
    } else {
        ray.previous = result;
        ray.level += 1u;
        ray.stage = START;
    }
    return ray;
}
