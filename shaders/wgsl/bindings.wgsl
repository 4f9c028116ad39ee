// Resources of all shaders, each with one number. A kernel binds only those that it uses.
#import constants
#import params
#import uniforms

// Specialization: a pipeline is compiled for these values, without the code that they switch off
// (crates/clouds_core/src/specialization.rs).
override PHASE: u32 = 0u; // light.phase
override VOLUME: bool = false; // clouds from the user's grid instead of procedural ones
override KEEP_CLEAR: bool = false; // a region kept clear of clouds
override CAMERA: u32 = 0u; // projection (camera.wgsl)
override PRECISE: bool = false; // the user's grid read by loads in f32, not by hardware filters in half floats
override AIR: bool = true; // atmosphere
override SUNLIT: bool = true; // sunlight can reach the clouds
override RAINY: bool = true; // rain, and with it cumulonimbus
override RAIN_SHAFTS: bool = true; // visible rain below the clouds
override UPPER: bool = true; // a second deck
override LARGE_SCALE_WEATHER: bool = true; // a larger map offsets the weather map
override PROFILE_TABLE: bool = false; // height profile from the user's table
override LIGHT_SHAFTS: bool = false; // cloud shadows on the air
override SCENE: bool = false; // a user's scene among the clouds
override SUBRAYS: bool = false; // pixels may be wider than clouds (subrays.wgsl)
override LOW_RESOLUTION: bool = false; // samples of the clouds only at corners of cells of pixels (sample_grid.wgsl)
override LIGHT_DETAIL: bool = true; // light samples with detail noise
override LIGHT_CHEAP: bool = true; // light samples without detail noise

// Uniform blocks by lifetime: the user's settings, quantities derived from them for a frame, range of pixels of a
// dispatch. No other block may decide a branch by itself: lavapipe (Mesa 22.3) records such use of the fourth and later
// blocks of a kernel, by number, beyond the end of a table, and crashes.
@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(28) var<uniform> dispatch: Dispatch;
@group(0) @binding(2) var repeat_sampler: sampler; // linear, nearest mip, repeats
@group(0) @binding(3) var clamp_sampler: sampler; // linear, clamps
@group(0) @binding(42) var weather_sampler: sampler; // linear; `weather.edge` sets the values beyond the map

// Baked textures, all in half floats: lavapipe filters half floats exactly, 8-bit formats in 256 levels.
@group(0) @binding(4) var shape_noise: texture_3d<f32>; // base shape (passes/noise)
@group(0) @binding(5) var detail_noise: texture_3d<f32>; // noise that erodes the edges (passes/noise)
@group(0) @binding(6) var curl_noise: texture_2d<f32>; // divergence-free vector in xy (passes/noise)
@group(0) @binding(7) var weather_map: texture_2d<f32>; // coverage, type, precipitation (passes/weather)
// Large-scale weather: offsets to the values of the weather map, and the displacement of that map
// (passes/large_scale_weather).
@group(0) @binding(48) var broad_map: texture_2d<f32>;
@group(0) @binding(49) var profile_table: texture_2d<f32>; // density by type and height (passes/profile)
@group(0) @binding(50) var phase_table: texture_2d<f32>; // phase function and its integral by angle (passes/phase)
@group(0) @binding(8) var high_map: texture_2d<f32>; // density of the high clouds (passes/high_clouds)
@group(0) @binding(9) var sky_view_lut: texture_2d<f32>; // sky radiance by direction, times sky_scale (passes/sky)
// Optical depth of the air to space, by altitude and direction (passes/transmittance).
@group(0) @binding(60) var transmittance_lut: texture_2d<f32>;
// Scattered light by altitude and elevation of the sun; tables from SCATTERED on (passes/multiscatter).
@group(0) @binding(61) var multiscattering_lut: texture_2d<f32>;
// Fraction of the sky's radiance from before a distance, by direction (passes/sky).
@group(0) @binding(62) var aerial_perspective_lut: texture_3d<f32>;
@group(0) @binding(10) var<storage, read_write> sky_light: array<vec4f, 4>; // sun and sky on the clouds (passes/sky)
// `sky_light` for reads that decide no branch: a load from storage costs lavapipe a loop over the lanes.
@group(0) @binding(41) var<uniform> sky_light_uniform: array<vec4f, 4>;
@group(0) @binding(11) var blue_noise: texture_2d<f32>; // 64 x 64 ranks in [0, 1), void and cluster

@group(0) @binding(30) var volume: texture_3d<f32>; // user's grid, 1 at its largest extinction, in half floats
@group(0) @binding(31) var volume_exact: texture_3d<f32>; // user's grid in f32, which not all adapters can filter
@group(0) @binding(32) var majorants: texture_3d<f32>; // upper bound of the density in a cell (passes/majorant)

// User's scene: a texel for each pixel of the strip, row by row (scene_depth.wgsl).
@group(0) @binding(70) var scene_depth: texture_2d<f32>; // distance along the ray, m
@group(0) @binding(54) var scene_before: texture_2d<f32>; // `scene_depth` of the previous frame (passes/reproject)
@group(0) @binding(71) var scene_color: texture_2d<f32>; // radiance

// Shadow clipmap: transmittance toward the sun around the eye, levels stacked in one texture; and, while the clipmap is
// baked, the mean of its last level (passes/shadow).
@group(0) @binding(72) var ground_shadow: texture_2d<f32>;
@group(0) @binding(73) var ground_shadow_mean: texture_2d<f32>;
// Light shafts: radiance that the air before a distance lacks in those shadows, by position in the picture, times
// sky_scale (passes/light_shafts).
@group(0) @binding(51) var light_shafts: texture_3d<f32>;

// Light field (light_field.wgsl), levels stacked along the third axis: density (r) and optical depth toward the sun
// (g); fluence (r) and flux of the sun's light and of the sky's. Forward chains of scattering by angle and optical
// depth.
@group(0) @binding(81) var field_optics: texture_3d<f32>;
@group(0) @binding(82) var field_sun: texture_3d<f32>;
@group(0) @binding(83) var field_sky: texture_3d<f32>;
@group(0) @binding(84) var forward_table: texture_2d<f32>;

// Level of the light field while it is solved (passes/light_field). Cells are stored row by row.
@group(0) @binding(85) var<uniform> level: FieldLevel;
// As `field_optics`, with the largest density (b), `field_sun` and `field_sky`.
@group(0) @binding(86) var level_optics: texture_3d<f32>;
@group(0) @binding(94) var level_sun: texture_3d<f32>;
@group(0) @binding(101) var level_sky: texture_3d<f32>;
// Those of the level around it.
@group(0) @binding(87) var coarser_optics: texture_3d<f32>;
@group(0) @binding(90) var coarser_sun: texture_3d<f32>;
@group(0) @binding(102) var coarser_sky: texture_3d<f32>;
// Fluence and flux: of the sun's light, then of the sky's.
@group(0) @binding(88) var<storage, read_write> moments_now: array<vec4f>;
// A grid that corrects them (passes/light_solver): what it has to correct; the same and the correction of the coarser.
@group(0) @binding(89) var<storage, read_write> residuals: array<vec4f>;
@group(0) @binding(104) var<storage, read_write> coarser_residuals: array<vec4f>;
@group(0) @binding(105) var<storage, read_write> coarser_correction: array<vec4f>;
// Source functions of sun and sky, in pairs of half floats. A texture, since lavapipe loads each word of a buffer for
// each lane by itself.
@group(0) @binding(91) var sources: texture_3d<u32>;
@group(0) @binding(103) var sources_out: texture_storage_3d<rgba32uint, write>;
@group(0) @binding(92) var<storage, read_write> deposits: array<vec2f>; // scaled extinction, 1/m; scaled sunlight
// Radiance by direction, of sun and sky: mean in each cell, and what enters at the sides, in pairs of half floats.
@group(0) @binding(93) var<storage, read_write> radiances: array<u32>;
@group(0) @binding(95) var<storage, read_write> entering: array<u32>;
@group(0) @binding(96) var<storage, read_write> balance: array<f32>; // `field_balance`
@group(0) @binding(97) var sun_out: texture_storage_3d<rgba16float, write>;
@group(0) @binding(98) var sky_out: texture_storage_3d<rgba16float, write>;
// Light on the ground by place, levels stacked: diffuse irradiance of a sun of irradiance 1; irradiance of a uniform
// sky relative to that without clouds; scaled and true transmittance toward the sun.
@group(0) @binding(99) var field_ground: texture_2d<f32>;

// Buffers with an entry for each pixel, row by row. Those of the clouds have an entry for each sample of the sample
// grid (sample_grid.wgsl).
@group(0) @binding(12) var<storage, read_write> clouds: array<vec4f>; // premultiplied radiance, transmittance
@group(0) @binding(13) var<storage, read_write> cloud_depth: array<f32>; // m to the mean scattering point, -1 if none
@group(0) @binding(14) var<storage, read_write> samples: array<u32>; // density evaluations
@group(0) @binding(15) var<storage, read_write> image: array<vec4f>; // picture returned to the caller
@group(0) @binding(16) var<storage, read_write> sky: array<vec4f>; // radiance without clouds
@group(0) @binding(29) var<storage, read_write> depth: array<f32>; // of all clouds together, m, -1 if none

// Background of the marched clouds at the corners of cells (passes/composite), in columns:
// 0: high clouds: premultiplied radiance, transmittance.
// 1: radiance behind the high clouds; distance times opacity of the high clouds, m.
// 2: transmittance of the air before the high clouds; brightness of high clouds and background together.
// 3: radiance of that air; brightness of the background alone.
// Corners on the ground have a negative distance, and in place of high clouds the shadows on the ground: minus the
// radiance that shadows remove; radiance of the unshadowed ground; radiance that full shadow would remove.
@group(0) @binding(55) var<storage, read_write> corners: array<mat4x4f>;

// Temporal reprojection: rays of this frame, one in each cell, and the previous frame.
@group(0) @binding(17) var<storage, read_write> current: array<vec4f>;
@group(0) @binding(18) var<storage, read_write> current_depth: array<f32>;
@group(0) @binding(19) var<storage, read_write> history: array<vec4f>;
@group(0) @binding(20) var<storage, read_write> history_depth: array<f32>;
@group(0) @binding(58) var<storage, read_write> cells: array<CellPast>;
// History lengths of the previous frame (`history_length`) and of this one (`followed`), in frames (passes/reproject).
@group(0) @binding(56) var<storage, read_write> history_length: array<u32>;
@group(0) @binding(57) var<storage, read_write> followed: array<u32>;

// Ray list `active_rays`: its length, and the range of distances from the start of the march in which each pixel's ray
// meets cloud (passes/refine).
@group(0) @binding(38) var<storage, read_write> ray_count: atomic<u32>;
@group(0) @binding(39) var<storage, read_write> cloud_span: array<vec2f>;

// Indirect dispatches (passes/arrange): size of the dispatch, length of the list, arguments. `listed` has the number of
// invocations of the whole list in `w`.
@group(0) @binding(74) var<uniform> arrangement: vec4u;
@group(0) @binding(75) var<storage, read_write> list_count: u32;
@group(0) @binding(76) var<storage, read_write> arguments: array<u32>;
@group(0) @binding(77) var<uniform> listed: vec4u;

// Decision whether a frame is a still (passes/reproject): votes for a still minus votes against it; maximum length of
// the ray list, as an f32; result.
@group(0) @binding(78) var<storage, read_write> votes: atomic<i32>;
@group(0) @binding(79) var<uniform> most_listed: vec4f;
@group(0) @binding(80) var<storage, read_write> is_still: u32;

// Rays that take more steps than one dispatch allows: their states, the list of unfinished rays, their progress.
@group(0) @binding(33) var<storage, read_write> reference_rays: array<ReferenceRay>;
@group(0) @binding(34) var<storage, read_write> path_rays: array<PathRay>;
@group(0) @binding(35) var<storage, read_write> active_rays: array<u32>;
@group(0) @binding(36) var<storage, read_write> progress: array<vec2u>; // iterations in this dispatch; 1 if done
@group(0) @binding(37) var<storage, read_write> uncertainty: array<vec4f>; // of each pixel's radiance

// Prediction of the ray of a cell from the history (passes/reproject).
struct CellPast {
    predicted: vec4f, // premultiplied radiance, transmittance
    gain: vec3f, // ratio of brightness to the previous frame, of the clouds around
    error: f32, // contrast between ray and prediction
    motion: vec2f, // offset to the cell's position in the previous frame, samples
    distance: f32, // m to the nearest cloud of the cell, -1 if there is none
    ray_distance: f32, // m to the cloud of the cell's ray, -1 if there is none
    approach: f32, // m by which the cloud has come nearer
    glare: f32, // relative change of the light scattered toward the eye
    source: u32, // origin of the prediction: UNSEEN, INTERPOLATED or MARCHED
    width: f32, // spacing of samples at distance 1
}

// State of a ray that is integrated to convergence (passes/reference).
struct ReferenceRay {
    previous: vec4f, // radiance and transmittance for panels of twice the length
    // Sums of the scattering (`Gathered`).
    sun: vec4f,
    above: vec4f,
    below: vec4f,
    weight: vec4f,
    stage: u32,
    level: u32, // number of halvings of the panels
    evaluations: u32,
    x: f32, // m into the segments
    longest: f32, // maximum length of the next panel, m
    optical_depth: f32,
    // Current panel, and the values at its two points.
    end: f32,
    point: u32,
    density: vec2f,
    share: vec2f, // share of the ambient light from above
    precipitation: vec2f,
    first_depth: f32, // optical depth toward the sun from the first point
    // Current ray from a point toward the sun.
    sun_start: f32,
    sun_first: f32,
    sun_gap: f32,
    sun_second: f32,
    sun_x: f32,
    sun_depth: f32,
    distance: f32, // mean distance by weight, unnormalised, m
}

// State of a pixel whose paths are traced one after another (passes/path).
struct PathRay {
    radiance: vec3f, // sum over the paths so far
    done: u32, // number of paths so far
    squares: vec3f,
    seen: f32, // number of paths that met no cloud
    throughput: vec3f,
    distance: f32, // to first scatterings, m
    light: vec3f, // of the current path
    stage: u32,
    origin: vec3f, // of the current flight
    scatterings: u32,
    direction: vec3f,
    x: f32, // m into the segments of the flight
    flight: vec4f, // `Segments`
    shadow: f32, // transmittance toward the sun so far
    width: f32, // footprint, m
    random_dimension: u32, // number of random numbers used by the path
    evaluations: u32,
    sunlight: vec3f, // light that the sun adds to the path without shadow
}

// Outputs of bakes.
@group(0) @binding(23) var volume_in: texture_3d<f32>;
@group(0) @binding(24) var volume_out: texture_storage_3d<rgba16float, write>;
@group(0) @binding(22) var<storage, read_write> texels_out: array<u32>; // one channel, two half floats in each word

// Words per row of `texels_out` for a number of texels: padded to the row alignment of copies to textures.
fn packed_row(texels: u32) -> u32 {
    return (texels + (COPIED / 2u - 1u)) / (COPIED / 2u) * (COPIED / 4u);
}

@group(0) @binding(43) var mix_a: texture_2d<f32>; // inputs of mixtures: weather maps, or orders of scattering
@group(0) @binding(44) var mix_b: texture_2d<f32>;
@group(0) @binding(45) var mix_c: texture_2d<f32>;
@group(0) @binding(46) var mix_d: texture_2d<f32>;
@group(0) @binding(47) var<uniform> mix_shares: vec4f;
@group(0) @binding(64) var<storage, read_write> shadow_out: array<f32>; // user's shadow map, row by row
@group(0) @binding(25) var map_out: texture_storage_2d<rgba16float, write>;

// Picture in a window (passes/display).
@group(0) @binding(52) var screen: texture_storage_2d<rgba8unorm, write>;
@group(0) @binding(53) var<uniform> shown: vec4f; // exposure as a factor, tone map

// Queries at points; probes of shader functions.
@group(0) @binding(26) var<storage, read_write> points: array<vec4f>;
@group(0) @binding(27) var<storage, read_write> results: array<vec4f>;
