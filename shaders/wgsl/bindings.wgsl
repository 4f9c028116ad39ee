// Every resource that a shader can name, numbered once. A kernel binds only those that it uses.
#import constants
#import params
#import uniforms

// What a pipeline is made for; the rest is compiled out (crates/clouds_core/src/gpu/kernel.rs).
override MODEL: u32 = 0u; // light.model
override PHASE: u32 = 0u; // light.phase
override VOLUME: bool = false; // the clouds are the user's grid, not procedural
override KEEP_CLEAR: bool = false; // there is a spot without clouds
override CAMERA: u32 = 0u; // the projection, see camera.wgsl
override PRECISE: bool = false; // that grid is read by loads and in f32, not filtered by the hardware in half floats
override AIR: bool = true; // there is air
override SUNLIT: bool = true; // the sun can reach the clouds
override RAINY: bool = true; // it may rain: cumulonimbus grow
override RAIN_SHAFTS: bool = true; // rain is seen below the clouds
override UPPER: bool = true; // there is a second deck
override LARGE_SCALE_WEATHER: bool = true; // a larger map shifts the weather
override PROFILE_TABLE: bool = false; // the profile by height is the user's table
override LIGHT_SHAFTS: bool = false; // clouds cast shadows on the air
override SCENE: bool = false; // there is a scene of the user's among the clouds
override SUBRAYS: bool = false; // pixels may be wider than clouds, see subrays.wgsl
override LOW_RESOLUTION: bool = false; // the clouds are known at the corners of cells of pixels alone, see sample_grid.wgsl
override WIDE_PHASE: bool = false; // the phase function varies within a pixel
override LIGHT_DETAIL: bool = true; // there are light samples that see the detail
override LIGHT_CHEAP: bool = true; // there are light samples that do not

// By how long they hold: what the user sets; what follows from that for a frame; which pixels a dispatch is for. No
// other block may decide a branch by itself: of the fourth and later ones of a kernel, by number, lavapipe (Mesa 22.3)
// notes that beyond the end of a table, and crashes.
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(28) var<uniform> dispatch: Dispatch;
@group(0) @binding(2) var repeat_sampler: sampler; // linear, nearest mip, repeats
@group(0) @binding(3) var clamp_sampler: sampler; // linear, clamps
@group(0) @binding(42) var weather_sampler: sampler; // linear, beyond the map as weather.edge says

// Baked. All half floats: lavapipe filters those exactly and 8-bit ones to 256 levels only.
@group(0) @binding(4) var shape_noise: texture_3d<f32>; // base shape (passes/noise)
@group(0) @binding(5) var detail_noise: texture_3d<f32>; // of the edges (passes/noise)
@group(0) @binding(6) var curl_noise: texture_2d<f32>; // a divergence-free vector in xy (passes/noise)
@group(0) @binding(7) var weather_map: texture_2d<f32>; // coverage, type, precipitation (passes/weather)
@group(0) @binding(48) var broad_map: texture_2d<f32>; // shifts of those, and what bends the smaller map (passes/large_scale_weather)
@group(0) @binding(49) var profile_table: texture_2d<f32>; // density by type and height (passes/profile)
@group(0) @binding(50) var phase_table: texture_2d<f32>; // phase function and its integral by angle (passes/phase)
@group(0) @binding(8) var high_map: texture_2d<f32>; // density of the high clouds (passes/high_clouds)
@group(0) @binding(9) var sky_view_lut: texture_2d<f32>; // the sky by direction, times frame.sky.sky_scale (passes/sky)
@group(0) @binding(60) var transmittance_lut: texture_2d<f32>; // of the air to space, by altitude and direction (passes/transmittance)
@group(0) @binding(61) var multiscattering_lut: texture_2d<f32>; // scattered light by altitude and sun, see SCATTERED (passes/multiscatter)
@group(0) @binding(62) var aerial_perspective_lut: texture_3d<f32>; // share of the sky before a distance, by direction (passes/sky)
@group(0) @binding(10) var<storage, read_write> sky_light: array<vec4f, 4>; // what the sky gives to clouds (passes/sky)
// The same for where it decides no branch: a load from storage costs lavapipe a loop over the lanes.
@group(0) @binding(41) var<uniform> sky_light_uniform: array<vec4f, 4>;
@group(0) @binding(11) var blue_noise: texture_2d<f32>; // 64 x 64 ranks in [0, 1), void and cluster

@group(0) @binding(30) var volume: texture_3d<f32>; // the user's grid, 1 at its largest extinction, in half floats
@group(0) @binding(31) var volume_exact: texture_3d<f32>; // the same in f32, which cannot be filtered everywhere
@group(0) @binding(32) var majorants: texture_3d<f32>; // what the density nearby never exceeds (passes/majorant)

// The user's scene, a texel for each pixel of the sheet, row after row (scene_depth.wgsl).
@group(0) @binding(70) var scene_depth: texture_2d<f32>; // m along the ray
@group(0) @binding(54) var scene_before: texture_2d<f32>; // m along the ray in the frame before (passes/reproject)
@group(0) @binding(71) var scene_color: texture_2d<f32>; // its radiance

// Direct sun on the ground around the eye: levels in a stack, and, while they are baked, the mean of the last (passes/shadow).
@group(0) @binding(72) var ground_shadow: texture_2d<f32>;
@group(0) @binding(73) var ground_shadow_mean: texture_2d<f32>;
// Light that the air before a distance lacks in those shadows, by place in the picture, times sky_scale (passes/light_shafts).
@group(0) @binding(51) var light_shafts: texture_3d<f32>;

// One entry a pixel, row by row; of the clouds one for each that they are known at (sample_grid.wgsl).
@group(0) @binding(12) var<storage, read_write> clouds: array<vec4f>; // premultiplied radiance, transmittance
@group(0) @binding(13) var<storage, read_write> cloud_depth: array<f32>; // m to the mean scattering point, -1 where none
@group(0) @binding(14) var<storage, read_write> samples: array<u32>; // density evaluations
@group(0) @binding(15) var<storage, read_write> image: array<vec4f>; // what the caller gets
@group(0) @binding(16) var<storage, read_write> sky: array<vec4f>; // radiance without clouds
@group(0) @binding(29) var<storage, read_write> depth: array<f32>; // of all clouds together, -1 where none

// What is behind the marched clouds at the corners of cells (passes/composite): the high clouds as `clouds`; the radiance
// behind them, with their distance times their opacity, m; transmittance of the air before them, with the brightness of
// all together; radiance of that air, with the brightness behind them. On the ground, where the distance is less than 0, the
// same of shadows: the light they lack as radiance, the ground without them, and what one of no sun at all would lack.
@group(0) @binding(55) var<storage, read_write> corners: array<mat4x4f>;

// Temporal reprojection: the marched subset, and the frame before.
@group(0) @binding(17) var<storage, read_write> current: array<vec4f>;
@group(0) @binding(18) var<storage, read_write> current_depth: array<f32>;
@group(0) @binding(19) var<storage, read_write> history: array<vec4f>;
@group(0) @binding(20) var<storage, read_write> history_depth: array<f32>;
@group(0) @binding(58) var<storage, read_write> cells: array<CellPast>;
// How much each pixel rests on, in frames (passes/reproject): in the frame before, and in this one.
@group(0) @binding(56) var<storage, read_write> history_length: array<u32>;
@group(0) @binding(57) var<storage, read_write> followed: array<u32>;

// Pixels that are marched one by one: how many are in `active_rays`, and between which distances from the start of its
// march each pixel's ray meets cloud (passes/refine).
@group(0) @binding(38) var<storage, read_write> ray_count: atomic<u32>;
@group(0) @binding(39) var<storage, read_write> cloud_span: array<vec2f>;

// Indirect dispatches (passes/arrange): what is arranged, how many entries the list has, the arguments, and, in `w`,
// how many invocations the whole list has.
@group(0) @binding(74) var<uniform> arrangement: vec4u;
@group(0) @binding(75) var<storage, read_write> list_count: u32;
@group(0) @binding(76) var<storage, read_write> arguments: array<u32>;
@group(0) @binding(77) var<uniform> listed: vec4u;

// Whether a frame is a still (passes/reproject): votes for that less those for going on; how many pixels may be marched
// one by one, as an f32; and the decision.
@group(0) @binding(78) var<storage, read_write> votes: atomic<i32>;
@group(0) @binding(79) var<uniform> most_listed: vec4f;
@group(0) @binding(80) var<storage, read_write> is_still: u32;

// Rays that take more steps than one dispatch may: what each remembers, which are not done, and how far each got.
@group(0) @binding(33) var<storage, read_write> reference_rays: array<ReferenceRay>;
@group(0) @binding(34) var<storage, read_write> path_rays: array<PathRay>;
@group(0) @binding(35) var<storage, read_write> active_rays: array<u32>;
@group(0) @binding(36) var<storage, read_write> progress: array<vec2u>; // iterations in this dispatch, 1 when done
@group(0) @binding(37) var<storage, read_write> uncertainty: array<vec4f>; // of the radiance of each pixel

// What the frame before says of the ray of a cell (passes/reproject).
struct CellPast {
    predicted: vec4f, // as `clouds`
    gain: vec3f, // by how much the clouds around have become brighter
    error: f32, // contrast between ray and prediction
    motion: vec2f, // pixels to where the cell was
    distance: f32, // m to its nearest cloud, -1 if there is none
    ray_distance: f32, // m to that of its ray, -1 if there is none
    approach: f32, // m that this has come nearer
    glare: f32, // relative change of the light that is scattered toward the eye
    source: u32, // what the prediction rests on
    width: f32, // between known pixels at distance 1
}

// A ray on its way to convergence (passes/reference).
struct ReferenceRay {
    previous: vec4f, // radiance and transmittance with panels twice as long
    // As `Gathered`.
    sun: vec4f,
    above: vec4f,
    weight: vec4f,
    stage: u32,
    level: u32, // how many times the panels have been halved
    evaluations: u32,
    x: f32, // m into the segments
    longest: f32, // length that the next panel may have, m
    optical_depth: f32,
    // The panel at hand, and what is known of its two points.
    end: f32,
    point: u32,
    density: vec2f,
    share: vec2f, // of the ambient light from above
    precipitation: vec2f,
    first_depth: f32, // toward the sun, from the first of them
    // The ray from a point toward the sun.
    sun_start: f32,
    sun_first: f32,
    sun_gap: f32,
    sun_second: f32,
    sun_x: f32,
    sun_depth: f32,
    distance: f32, // as in `Gathered`
}

// A pixel whose paths are traced one after another (passes/path).
struct PathRay {
    radiance: vec3f, // sums over the paths so far
    done: u32, // paths
    squares: vec3f,
    seen: f32, // paths that met no cloud
    throughput: vec3f,
    distance: f32, // to first scatterings
    light: vec3f, // of the path at hand
    stage: u32,
    origin: vec3f, // of the flight at hand
    scatterings: u32,
    direction: vec3f,
    x: f32, // m into the segments of the flight
    flight: vec4f, // as `Segments`
    shadow: f32, // transmittance toward the sun so far
    width: f32, // footprint, m
    random_dimension: u32, // random numbers used by the path
    evaluations: u32,
    sunlight: vec3f, // what the sun adds to the path if nothing shadows it
}

// Outputs of the bakes.
@group(0) @binding(23) var volume_in: texture_3d<f32>;
@group(0) @binding(24) var volume_out: texture_storage_3d<rgba16float, write>;
@group(0) @binding(22) var<storage, read_write> texels_out: array<u32>; // of one channel, two half floats in each

// Words of a row of so many of those: padded, as copies to a texture ask for.
fn packed_row(texels: u32) -> u32 {
    return (texels + (COPIED / 2u - 1u)) / (COPIED / 2u) * (COPIED / 4u);
}

@group(0) @binding(43) var mix_a: texture_2d<f32>; // weather maps, or orders of scattering, that are mixed
@group(0) @binding(44) var mix_b: texture_2d<f32>;
@group(0) @binding(45) var mix_c: texture_2d<f32>;
@group(0) @binding(46) var mix_d: texture_2d<f32>;
@group(0) @binding(47) var<uniform> mix_shares: vec4f;
@group(0) @binding(64) var<storage, read_write> shadow_out: array<f32>; // the user's shadow map, row by row
@group(0) @binding(25) var map_out: texture_storage_2d<rgba16float, write>;

// What is shown in a window (passes/display).
@group(0) @binding(52) var screen: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(53) var<uniform> shown: vec4f; // exposure as a factor, tone map

// Queries at points, and probes of shader functions.
@group(0) @binding(26) var<storage, read_write> points: array<vec4f>;
@group(0) @binding(27) var<storage, read_write> results: array<vec4f>;
