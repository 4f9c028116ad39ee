// Majorants of the density, by which delta tracking samples its steps (Woodcock et al. 1965).
#import bindings
#import density

struct Majorant {
    density: f32, // upper bound within `reach` of the point
    reach: f32, // m
}

// Addressing of the weather map's sampler: position in [0, 1] for any `uv`.
fn within_map(uv: vec2f) -> vec2f {
    let twice = uv - 2.0 * floor(0.5 * uv);
    let inside = select(uv - floor(uv), min(twice, 2.0 - twice), params.weather.edge == EDGE_MIRROR);
    return select(inside, saturate(uv), params.weather.edge == EDGE_CLAMP);
}

// Majorant at a point between base and top of the clouds, or in the box of the user's grid.
fn majorant_at(p: vec3f, altitude: f32) -> Majorant {
    let size = vec3f(textureDimensions(majorants));
    var cell: vec3f;
    var reach: f32;
    if VOLUME {
        cell = (volume_cell(p) + 0.5) / f32(BRICK);
        reach = f32(BRICK) * frame.sky.voxel;
    } else {
        let thickness = frame.sky.shell_top - frame.sky.shell_base;
        let height = (altitude - frame.sky.shell_base) / thickness;
        let at = sheared(on_chart(p, altitude), altitude);
        let uv = weather_uv(frame.sky.weather_origin, at, large_scale_weather(at));
        cell = vec3f(within_map(uv), height) * size;
        // A vertical metre is also a horizontal one in the map: wind shear displaces it, and the large-scale map
        // stretches that.
        let lean = abs(params.wind.shear) / (params.clouds.top - params.clouds.base);
        let bend = select(0.0, frame.sky.broad_stretch, LARGE_SCALE_WEATHER);
        // Within a step the chart's scale changes by less than a hundredth.
        let scale = 1.01 * max(chart_scale(p, altitude), 1.0);
        let across = params.weather.extent / max(size.x, size.y) / (1.0 + lean) / (1.0 + bend) / scale;
        reach = min(across, thickness / size.z);
    }
    let texel = vec3i(clamp(floor(cell), vec3f(0.0), size - 1.0));
    return Majorant(textureLoad(majorants, texel, 0).r, reach);
}
