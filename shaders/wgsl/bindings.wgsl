// Every resource that a shader can name, numbered once. A kernel binds only those that it uses.
#import params
#import frame

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<uniform> frame: Frame;
@group(0) @binding(28) var<uniform> quality: Quality;
@group(0) @binding(2) var repeat_sampler: sampler; // linear, nearest mip, repeats
@group(0) @binding(3) var clamp_sampler: sampler; // linear, clamps

// Baked. All half floats: lavapipe filters those exactly and 8-bit ones to 256 levels only.
@group(0) @binding(4) var shape_noise: texture_3d<f32>; // base shape: Perlin-Worley, three Worley FBMs (passes/noise)
@group(0) @binding(5) var detail_noise: texture_3d<f32>; // three Worley FBMs (passes/noise)
@group(0) @binding(6) var curl_noise: texture_2d<f32>; // a divergence-free vector in xy (passes/noise)
@group(0) @binding(7) var weather_map: texture_2d<f32>; // coverage, type, precipitation (passes/weather)
@group(0) @binding(8) var high_map: texture_2d<f32>; // density of the high clouds (passes/high_clouds)
@group(0) @binding(9) var sky_map: texture_2d<f32>; // the sky by direction, see SKY_MAP_SCALE (passes/sky)
@group(0) @binding(10) var<storage, read_write> sky_light: array<vec4f, 4>; // what the sky gives to clouds (passes/sky)
@group(0) @binding(11) var blue_noise: texture_2d<f32>; // 64 x 64 ranks in [0, 1), void and cluster

// One entry a pixel, row by row.
@group(0) @binding(12) var<storage, read_write> clouds: array<vec4f>; // premultiplied radiance, transmittance
@group(0) @binding(13) var<storage, read_write> cloud_depth: array<f32>; // m to the mean scattering point, -1 where none
@group(0) @binding(14) var<storage, read_write> samples: array<u32>; // density evaluations
@group(0) @binding(15) var<storage, read_write> image: array<vec4f>; // what the caller gets
@group(0) @binding(16) var<storage, read_write> sky: array<vec4f>; // radiance without clouds
@group(0) @binding(29) var<storage, read_write> depth: array<f32>; // of all clouds together, -1 where none

// Temporal reprojection: the marched subset, and the frame before.
@group(0) @binding(17) var<storage, read_write> fresh: array<vec4f>;
@group(0) @binding(18) var<storage, read_write> fresh_depth: array<f32>;
@group(0) @binding(19) var<storage, read_write> history: array<vec4f>;
@group(0) @binding(20) var<storage, read_write> history_depth: array<f32>;
@group(0) @binding(21) var<storage, read_write> history_known: array<u32>; // 1 where marched since the cut, 0 where guessed
@group(0) @binding(22) var<storage, read_write> known: array<u32>;

// Outputs of the bakes.
@group(0) @binding(23) var volume_in: texture_3d<f32>;
@group(0) @binding(24) var volume_out: texture_storage_3d<rgba16float, write>;
@group(0) @binding(25) var map_out: texture_storage_2d<rgba16float, write>;

// Queries at points, and probes of shader functions.
@group(0) @binding(26) var<storage, read_write> points: array<vec4f>;
@group(0) @binding(27) var<storage, read_write> results: array<vec4f>;
