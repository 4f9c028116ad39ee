//! The shadows of clouds on the air of a picture: crepuscular rays.

use glam::{DVec2, DVec3};

use super::sky::near;
use super::{Baked, Bindings, Context, shadow};
use crate::error::Result;
use crate::frame::Frame;
use crate::kernel::{Variant, Wanted};
use crate::params::{self, Params};

/// Angle between rays in the middle of the picture, radians, most of them along a side (393 go around a panorama), and slices
/// of their distance.
const ANGLE: f32 = 0.016;
const MOST: u32 = 400;
const SLICES: u32 = 32;

/// Eye and shadows may move so far while the volume stays, m: a quarter of a texel of the shadows. What the air lacks is seen
/// from the middle of such a step, so that it follows from the picture alone, not from those before.
const STEP: f64 = 16.0;

/// What the volume is made from: its size, the camera's axes, its fields of view and the sky's scale, sun, air and shadows, from
/// where, and where those are.
type Key = ([u32; 3], [[f32; 3]; 3], [f32; 3], params::Sun, params::Atmosphere, shadow::Key, [f64; 3], [f64; 2]);

/// The volume on the GPU.
pub(crate) struct Beams {
    made: Baked<Key, wgpu::TextureView>,
}

/// Texels for a picture.
fn size(frame: &Frame) -> [u32; 3] {
    if frame.beams == 0 {
        return [1; 3];
    }
    let pixel = frame.marched_angle() / frame.stride as f32;
    // At least a pixel apart.
    let along = |pixels: u32| (pixels.min((pixels as f32 * pixel / ANGLE) as u32) + 1).clamp(2, MOST);
    [along(frame.width), along(frame.height), SLICES]
}

/// The kernel that a picture asks for.
pub(crate) fn kernel(of: Variant) -> Option<Wanted> {
    of.beams.then_some(("beams", "beams_bake", of))
}

impl Beams {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    /// `world` holds the uniforms, the air and the shadows on the ground.
    pub fn run(
        &mut self,
        ctx: &mut Context<'_>,
        params: &Params,
        frame: &Frame,
        at: (DVec3, f64),
        world: &Bindings<'_>,
    ) -> Result<Bindings<'_>> {
        let size = size(frame);
        let axes = [frame.right, frame.up, frame.forward];
        let scales = [frame.tan_half_fov, frame.half_fov, frame.sky_scale];
        let from = near(at.0, params, STEP);
        let place = DVec2::from_array(frame.shadow_eye.map(f64::from)) + from.truncate() - at.0.truncate();
        let place = ((place / STEP).round() * STEP).to_array();
        let (sun, air, shadows) = (params.sun.clone(), params.atmosphere.clone(), shadow::key(params, frame, at));
        let key = (size, axes, scales, sun, air, shadows, from.to_array(), place);
        let view = self.made.get(key, || {
            let view = ctx.gpu.texture_3d("beams", size).create_view(&wgpu::TextureViewDescriptor::default());
            if let Some((pass, entry, variant)) = kernel(ctx.variant) {
                let mut there = Frame { shadow_eye: place.map(|v| v as f32), ..frame.clone() };
                there.set_planet(from, params);
                ctx.uniforms.upload_frame(ctx.gpu, &there);
                let bindings = [world.as_slice(), &[("volume_out", (&view).into())]].concat();
                let mut work = ctx.gpu.work();
                work.dispatch(&*ctx.gpu.kernel(pass, entry, variant)?, &bindings, [size[0], size[1], 1])?;
                work.submit(ctx.timings, ctx.interrupt)?;
                ctx.uniforms.upload_frame(ctx.gpu, frame);
            }
            Ok(view)
        })?;
        Ok(vec![("beams", view.into())])
    }
}
