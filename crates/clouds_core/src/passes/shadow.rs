//! Sunlight through the clouds to the ground: a map for the user, and levels around the eye for pictures of the ground and of
//! shaded air, baked when sun or clouds have changed, or when wind or eye have gone far.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use super::{Baked, Bindings, Context, Scene};
use crate::camera::Camera;
use crate::clipmap::{Casters, Origin, casters};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::kernel::{Variant, Wanted};
use crate::params::Params;
use crate::wind::Carried;

/// Texels across a level, and levels (as in ground_shadow.wgsl).
const SIDE: u32 = 88;
const LEVELS: u32 = 5;
/// The side of a texel of the finest level, m, for eyes up to so high; twice as long for each doubling of the altitude, as
/// pixels are. The sun's half degree blurs shadows of clouds 3 km up by 28 m.
const TEXEL: f32 = 64.0;
const TEXEL_ALTITUDE: f32 = 12_000.0;

/// The clouds may move so far while the shadows stay, m: half a texel, and a power of two, so that where winds have come
/// round after times that are powers of two, shadows have too.
const CLOUD_STEP: f64 = 32.0;

/// What the shadows are made from: whether they are wanted, sun, clouds, weather, wind, planet and grid, and for where, how
/// fine and when.
pub(crate) type Key = (bool, Casters, (f32, usize), [i64; 3], f32);

/// The same for a picture.
pub(crate) fn key(params: &Params, frame: &Frame, (eye, time): (DVec3, f64)) -> Key {
    let grid = params.volume.as_ref().map_or(0, |grid| Arc::as_ptr(grid) as usize);
    let planet = (params.atmosphere.planet_radius, grid);
    (wanted(frame), casters(params), planet, origin(eye, params, time).steps, frame.shadow_texel)
}

/// The levels on the GPU.
pub(crate) struct GroundShadow {
    made: Baked<Key, wgpu::TextureView>,
}

/// From where and when a picture's shadows are baked: the user's grid stays where it is.
fn origin(eye: DVec3, params: &Params, time: f64) -> Origin {
    Origin::new(eye, params, if params.volume.is_some() { 0.0 } else { time }, CLOUD_STEP)
}

/// Where the eye is in the levels of its picture.
pub(crate) fn eye_in(eye: DVec3, params: &Params, time: f64) -> [f32; 2] {
    let origin = origin(eye, params, time);
    let drift = match params.volume {
        Some(_) => DVec2::ZERO,
        None => Carried::new(params, origin.time, time).drift().truncate(),
    };
    (eye.truncate() - origin.place - drift).as_vec2().to_array()
}

/// The side of a texel of the finest level for an eye at an altitude, m.
pub(crate) fn texel(altitude: f32) -> f32 {
    TEXEL * (altitude / TEXEL_ALTITUDE).max(1.0).log2().floor().exp2()
}

/// The kernels of the bake.
const BAKES: [&str; 3] = ["shadow_ground", "shadow_mean", "shadow_blend"];

/// What they are made for: no camera, and no scene in sight.
fn bake_variant(of: Variant) -> Variant {
    Variant { camera: 0, scene: false, beams: false, ..of }
}

/// Whether a picture bakes them.
fn wanted(frame: &Frame) -> bool {
    frame.beams > 0 || frame.ground_shadow > 0 && frame.cloudless == 0
}

/// The kernels that a picture asks for.
pub(crate) fn kernels(frame: &Frame, of: Variant) -> impl Iterator<Item = Wanted> {
    BAKES.into_iter().filter(|_| wanted(frame)).map(move |entry| ("shadow", entry, bake_variant(of)))
}

impl GroundShadow {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    /// `world` holds the uniforms, the noises, the weather map and the grid.
    pub fn run(
        &mut self,
        ctx: &mut Context<'_>,
        params: &Params,
        frame: &Frame,
        (eye, time): (DVec3, f64),
        world: &Bindings<'_>,
    ) -> Result<Bindings<'_>> {
        let wanted = wanted(frame);
        let origin = origin(eye, params, time);
        let view = self.made.get(key(params, frame, (eye, time)), || {
            let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
            let size = if wanted { [SIDE, SIDE * LEVELS, 1] } else { [1; 3] };
            let [single, mean, levels] = [("", size), ("ground_shadow_mean", [1; 3]), ("ground_shadow", size)]
                .map(|(label, size)| view(&ctx.gpu.texture(label, size, 1)));
            if wanted {
                let camera = Camera::equirect(origin.place.extend(0.0))?;
                let there = Frame::new(&camera, params, origin.time, [1, 1]);
                let shadow_texel = frame.shadow_texel;
                ctx.uniforms.upload_frame(ctx.gpu, &Frame { shadow_texel, ..there });
                let mut work = ctx.gpu.work();
                let mut bake = |entry, ours: &Bindings<'_>, size| {
                    let bindings = [world.as_slice(), ours].concat();
                    work.dispatch(&*ctx.gpu.kernel("shadow", entry, bake_variant(ctx.variant))?, &bindings, size)
                };
                let made = ("ground_shadow", (&single).into());
                bake("shadow_ground", &vec![("map_out", (&single).into())], size)?;
                bake("shadow_mean", &vec![made, ("map_out", (&mean).into())], [SIDE, 1, 1])?;
                let of_all = ("ground_shadow_mean", (&mean).into());
                bake("shadow_blend", &vec![made, of_all, ("map_out", (&levels).into())], size)?;
                work.submit(ctx.timings, ctx.interrupt)?;
                ctx.uniforms.upload_frame(ctx.gpu, frame);
            }
            Ok(levels)
        })?;
        Ok(vec![("ground_shadow", view.into())])
    }
}

/// The band of `frame` of the user's map, which is `frame.width` texels wide.
pub(crate) fn map(ctx: &mut Context<'_>, scene: &Scene<'_>, frame: &Frame, out: &wgpu::Buffer) -> Result<Vec<f32>> {
    let bindings = [scene.bindings.as_slice(), &[("shadow_out", out.into())]].concat();
    let kernel = ctx.gpu.kernel("shadow", "shadow_map", scene.variant)?;
    let mut work = ctx.gpu.work();
    work.dispatch(&kernel, &bindings, [frame.width, frame.rows, 1])?;
    let row = 4 * u64::from(frame.width);
    work.download(out, row * u64::from(frame.first_row), row * u64::from(frame.rows));
    Ok(work.submit(ctx.timings, ctx.interrupt)?[0].numbers().to_vec())
}

/// Room for a map.
pub(crate) fn room(gpu: &Gpu, size: u32) -> wgpu::Buffer {
    gpu.buffer("shadow_out", 4 * u64::from(size) * u64::from(size))
}
