//! The shadows of clouds on the air of a picture: crepuscular rays.

use super::{Baked, Bindings, Context};
use crate::error::Result;
use crate::frame::Frame;
use crate::kernel::{Variant, Wanted};

/// Angle between rays in the middle of the picture, radians, most of them along a side (393 go around a panorama), and slices
/// of their distance.
const ANGLE: f32 = 0.016;
const MOST: u32 = 400;
const SLICES: u32 = 32;

/// The volume on the GPU, for pictures of one kind after another.
pub(crate) struct Beams {
    made: Baked<[u32; 3], wgpu::TextureView>,
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
    pub fn run(&mut self, ctx: &mut Context<'_>, frame: &Frame, world: &Bindings<'_>) -> Result<Bindings<'_>> {
        let size = size(frame);
        let texture = || ctx.gpu.texture_3d("beams", size);
        let view = self.made.get(size, || Ok(texture().create_view(&wgpu::TextureViewDescriptor::default())))?;
        // They depend on the camera, and so are new with every picture.
        if let Some((pass, entry, variant)) = kernel(ctx.variant) {
            let bindings = [world.as_slice(), &[("volume_out", view.into())]].concat();
            let mut work = ctx.gpu.work();
            work.dispatch(&*ctx.gpu.kernel(pass, entry, variant)?, &bindings, [size[0], size[1], 1])?;
            work.submit(ctx.timings, ctx.interrupt)?;
        }
        Ok(vec![("beams", view.into())])
    }
}
