// Bakes the sky around the camera, and what it and the sun give to the clouds.
#import bindings
#import atmosphere

// The radiance of the sky by azimuth from the sun and angle from the horizon.
@compute @workgroup_size(8, 8)
fn sky_map_bake(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(map_out);
    if any(id.xy >= size) {
        return;
    }
    // The inverse of sky_coordinates, for texel centres.
    let azimuth = f32(id.x) / f32(size.x - 1u) * PI;
    let v = (f32(id.y) + 0.5) / f32(size.y);
    let above = (1.0 - 2.0 * v) * (1.0 - 2.0 * v) * (0.5 * PI + frame.horizon_dip);
    let below = (2.0 * v - 1.0) * (2.0 * v - 1.0) * (0.5 * PI - frame.horizon_dip);
    let elevation = select(-below, above, v < 0.5) - frame.horizon_dip;
    textureStore(map_out, id.xy, vec4f(SKY_MAP_SCALE * air_radiance(sky_direction(azimuth, elevation)), 1.0));
}

// The direction at an azimuth from the sun and an angle above the horizontal plane.
fn sky_direction(azimuth: f32, elevation: f32) -> vec3f {
    var toward = frame.sun_direction - dot(frame.sun_direction, frame.zenith) * frame.zenith;
    if length(toward) < 1e-4 {
        // The sun at the zenith: all azimuths are alike.
        toward = cross(frame.zenith, vec3f(0.6, 0.8, 0.0));
    }
    toward = normalize(toward);
    let side = cross(frame.zenith, toward);
    let level = cos(azimuth) * toward + sin(azimuth) * side;
    return cos(elevation) * level + sin(elevation) * frame.zenith;
}

var<workgroup> partial: array<vec3f, 64>;

// Four colours: ambient radiance from above and from below the clouds, irradiance of the sun at the middle of the
// clouds and at the high clouds. One workgroup; each thread takes a slice of azimuth.
@compute @workgroup_size(64)
fn sky_light_bake(@builtin(local_invocation_index) thread: u32) {
    const ROWS = 16u;
    let azimuth = (f32(thread) + 0.5) / 64.0 * PI;
    var sum = vec3f(0.0);
    for (var row = 0u; row < ROWS; row++) {
        // Equal shares of the cosine-weighted hemisphere.
        let sine = sqrt((f32(row) + 0.5) / f32(ROWS));
        sum += air_radiance(sky_direction(azimuth, asin(sine))) / f32(ROWS);
    }
    partial[thread] = sum;
    workgroupBarrier();
    if thread > 0u {
        return;
    }
    var above = vec3f(0.0);
    for (var i = 0u; i < 64u; i++) {
        above += partial[i] / 64.0;
    }
    above *= params.sun.irradiance;
    let middle = 0.5 * (params.clouds.base + params.clouds.top);
    let mu = dot(frame.zenith, frame.sun_direction);
    let ground = select(vec3f(0.0), ground_radiance(mu), params.atmosphere.enabled > 0u);
    // Much of what a cloud sees is other clouds, which are as bright as the sky but white; more so at its base, where
    // half is the ground, and the rest is sky between clouds.
    let white = vec3f(dot(above, vec3f(0.2126, 0.7152, 0.0722)));
    sky_light[0] = vec4f(mix(above, white, 0.4), 1.0);
    sky_light[1] = vec4f(0.5 * ground + 0.35 * mix(above, white, 0.7), 1.0);
    sky_light[2] = vec4f(sun_irradiance(middle, mu), 1.0);
    sky_light[3] = vec4f(sun_irradiance(params.high_clouds.altitude, mu), 1.0);
}
