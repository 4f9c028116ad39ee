//! The optical depth of the air to space, by altitude and direction.

use super::weather::bake_map;
use super::{Baked, Bindings, Context, kept};
use crate::error::Result;
use crate::params::{self, Params};

/// Texels: distance to the top of the air, altitude (Hillaire 2020).
const SIZE: [u32; 3] = [256, 64, 1];

/// The table on the GPU.
pub(crate) struct Transmittance {
    made: Baked<params::Atmosphere, wgpu::TextureView>,
}

impl Transmittance {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let from = air(params);
        let key = format!("{from:?}");
        let view = self.made.get(from, || {
            let texture = ctx.gpu.texture("air_depth", SIZE, 1);
            kept(ctx, "transmittance", "transmittance", &key, &[&texture], |ctx| {
                bake_map(ctx, "transmittance", "transmittance_bake", &texture)
            })?;
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("air_depth", view.into())])
    }
}

/// What the air alone is made from: how much of it is seen between eye and clouds does not matter, nor the night behind it.
pub(super) fn air(params: &Params) -> params::Atmosphere {
    params::Atmosphere { aerial_perspective: 1.0, night: [0.0; 3], ..params.atmosphere.clone() }
}
