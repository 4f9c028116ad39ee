// Cost of one filtered texture read: loops of reads along a ray and nothing else, for `python -m benchmarks.profile`.
#import bindings

// Texels between two reads of a ray: about one step of the march through the base shape.
const STRIDE = 0.7;

// Position of read `i` on the ray through `start`, in a texture `side` texels wide. Unequal speeds along the axes keep
// a ray from meeting the same texels again.
fn read_at(start: vec3f, i: u32, side: f32) -> vec3f {
    return (start + STRIDE * f32(i) * vec3f(0.77, 0.55, 0.32)) / side;
}

// Level of detail that is not constant to the compiler, as in the march. The sampler rounds it to the finest mip.
fn read_lod(i: u32) -> f32 {
    return 0.01 * f32(i % 8u);
}

// Loop without a read: the overhead to subtract.
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
