//! The texture of the high clouds, made again when its shapes have evolved.

use super::{Baked, Bindings, Context};
use crate::error::Result;
use crate::frame::Frame;
use crate::params::{self, Params};

/// What the texture is made from: seed, octaves, stretch, type, size, and the ages and numbers of its updates.
type Key = (u32, u32, f32, f32, u32, [[f32; 4]; 4]);

/// The kernel that bakes a type: a pattern that it has nothing of is compiled out.
pub(crate) fn kernel(high: &params::HighClouds) -> &'static str {
    match high.r#type {
        0.0 => "high_clouds",
        1.0 => "high_clouds_cells",
        _ => "high_clouds_mixed",
    }
}

/// The texture of the high clouds on the GPU.
pub(crate) struct HighClouds {
    map: Baked<Key, wgpu::TextureView>,
}

impl HighClouds {
    pub const fn new() -> Self {
        Self { map: Baked::new() }
    }

    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params, frame: &Frame) -> Result<Bindings<'_>> {
        let high = &params.high_clouds;
        let updates = [frame.high_age, frame.high_age_small, frame.high_update, frame.high_update_small];
        // A sky without high clouds reads no texture, but a kernel that could must be given one.
        let size = if params.has_high_clouds() { high.texture_size } else { 1 };
        let key = (high.seed, high.octaves, high.stretch, high.r#type, size, updates);
        let view = self.map.get(key, || {
            // One channel: with four, three of them for nothing, it drops out of the cache of a core (reading it took
            // composite 24 ms at 1080p on a busy machine, not 16). Such a texture cannot be stored to, so it is filled
            // from a buffer.
            let texture = ctx.gpu.flat("high_clouds", [size; 2], wgpu::TextureFormat::R16Float);
            let texels = ctx.gpu.buffer("high_clouds", u64::from(2 * size.next_multiple_of(128) * size));
            let mut work = ctx.gpu.work();
            if high.coverage > 0.0 {
                let bindings = [ctx.uniforms.bindings(), vec![("texels_out", (&texels).into())]].concat();
                let kernel = ctx.gpu.kernel("high_clouds", kernel(high), ctx.variant)?;
                work.dispatch(&kernel, &bindings, [size.div_ceil(2), size, 1])?;
            }
            work.fill(&texture, 0, &texels);
            work.submit(ctx.timings, ctx.interrupt)?;
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("high_map", view.into())])
    }
}
