// What one filtered read of a texture takes: loops of nothing but reads along a ray, for `python -m benchmarks.profile`.
#import bindings

// Texels between two reads of a ray, about as far as one step of a march goes through the base shape.
const STRIDE = 0.7;

// Where the `i`-th read of the ray through `start` is, in texels of a texture `side` wide. It goes ahead along all axes, at
// speeds that never meet the same texels again.
fn read_at(start: vec3f, i: u32, side: f32) -> vec3f {
    return (start + STRIDE * f32(i) * vec3f(0.77, 0.55, 0.32)) / side;
}

// A level of detail that the compiler does not know, as those of a march; the sampler takes the nearest mip, the finest.
fn read_lod(i: u32) -> f32 {
    return 0.01 * f32(i % 8u);
}

// The loop of the others without the read: what is to be subtracted.
fn no_reads(start: vec3f, count: u32) -> f32 {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += vec4f(read_at(start, i, f32(SHAPE_SIZE)), read_lod(i));
    }
    return dot(sum, vec4f(1.0));
}

fn reads_of_profile_table(start: vec3f, count: u32) -> f32 {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += textureSampleLevel(profile_table, clamp_sampler, read_at(start, i, 64.0).xy, 0.0);
    }
    return dot(sum, vec4f(1.0));
}

fn reads_of_broad_map(start: vec3f, count: u32) -> f32 {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += textureSampleLevel(broad_map, repeat_sampler, read_at(start, i, f32(BROAD_SIZE)).xy, 0.0);
    }
    return dot(sum, vec4f(1.0));
}

fn reads_of_weather_map(start: vec3f, count: u32) -> f32 {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += textureSampleLevel(weather_map, repeat_sampler, read_at(start, i, f32(WEATHER_SIZE)).xy, 0.0);
    }
    return dot(sum, vec4f(1.0));
}

fn reads_of_shape_noise(start: vec3f, count: u32) -> f32 {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += textureSampleLevel(shape_noise, repeat_sampler, read_at(start, i, f32(SHAPE_SIZE)), read_lod(i));
    }
    return dot(sum, vec4f(1.0));
}

fn reads_of_curl_noise(start: vec3f, count: u32) -> f32 {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        sum += textureSampleLevel(curl_noise, repeat_sampler, read_at(start, i, f32(CURL_SIZE)).xy, 0.0);
    }
    return dot(sum, vec4f(1.0));
}

fn reads_of_detail_noise(start: vec3f, count: u32) -> f32 {
    var sum = vec4f(0.0);
    for (var i = 0u; i < count; i++) {
        let at = read_at(start, i, f32(DETAIL_SIZE * FINER));
        sum += textureSampleLevel(detail_noise, repeat_sampler, at, read_lod(i));
    }
    return dot(sum, vec4f(1.0));
}
