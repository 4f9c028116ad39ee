// The chart of weather, noises and high clouds: where on a plane a point lies, beside where the eye does. It is stereographic
// about the origin of the world, so that vertical columns stand on one place and shapes keep their proportions anywhere:
// along any level direction a metre is `chart_scale` metres of the chart, 1 at the origin, 1.33 at 60 degrees from it, 2 at 90.
//
// A point is at 2R / (r + z) times its place beside the planet's axis, with r its distance to the planet's centre and z the part
// of that along the axis through the origin. The eye's own place comes from f64 (frame.rs); the difference of the two factors
// is written as one product, so that nothing cancels however far the eye is from the origin.
#import bindings

fn chart_rise(p: vec3f, altitude: f32) -> f32 {
    return altitude - frame.view.altitude + p.z;
}

// Metres of the chart for each level metre at a point.
fn chart_scale(p: vec3f, altitude: f32) -> f32 {
    let radius = params.atmosphere.planet_radius;
    return 2.0 * radius / max(frame.view.chart_reach + chart_rise(p, altitude), CHART_END * radius);
}

// Where a point, relative to the eye, lies on the chart, relative to the eye, m east and north.
fn on_chart(p: vec3f, altitude: f32) -> vec2f {
    return chart_scale(p, altitude) * (p.xy - chart_rise(p, altitude) * frame.view.chart_slope);
}
