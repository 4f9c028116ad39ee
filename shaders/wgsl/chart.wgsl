// The chart: a stereographic projection of the planet about the origin of the world. Weather, noises and high clouds
// are read in its coordinates. Every vertical column projects to one point, and the projection is conformal, so that
// shapes keep their proportions everywhere. A horizontal metre is `chart_scale` metres of the chart: 1 at the origin,
// 1.33 at 60 degrees from it, 2 at 90 degrees.
//
// A point projects to 2R / (r + z) times its offset from the planet's axis through the origin, where r is its distance
// to the planet's centre and z the component of that along the axis. Results are relative to the eye, whose own
// projection comes from f64 (frame.rs). The difference of the two factors is written as one product; a subtraction of
// two projections would cancel for an eye far from the origin.
#import bindings

fn chart_rise(p: vec3f, altitude: f32) -> f32 {
    return altitude - frame.view.altitude + p.z;
}

// Metres of the chart per horizontal metre at a point.
fn chart_scale(p: vec3f, altitude: f32) -> f32 {
    let radius = params.atmosphere.planet_radius;
    return 2.0 * radius / max(frame.view.chart_reach + chart_rise(p, altitude), CHART_END * radius);
}

// Projection of a point `p`, relative to the eye, to the chart, relative to the eye's projection: east and north, m.
fn on_chart(p: vec3f, altitude: f32) -> vec2f {
    return chart_scale(p, altitude) * (p.xy - chart_rise(p, altitude) * frame.view.chart_slope);
}
