//! The sky around the camera, and the light that it and the sun give to the clouds.

use super::weather::bake_map;
use super::{Baked, Bindings, Context};
use crate::error::Result;
use crate::frame::Frame;
use crate::params::{self, Params};

/// Texels of the sky map: azimuth from the sun, angle from the horizon.
const SIZE: [u32; 3] = [128, 160, 1];

/// What the sky is made from: sun, air, where the eye is, and where the clouds are that it lights.
type Key = (params::Sun, params::Atmosphere, f32, [f32; 3], [f32; 3]);

/// The sky on the GPU.
pub(crate) struct Sky {
    made: Baked<Key, (wgpu::TextureView, wgpu::Buffer)>,
}

impl Sky {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params, frame: &Frame) -> Result<Bindings<'_>> {
        let layers = [params.clouds.base, params.clouds.top, params.high_clouds.altitude];
        let key = (params.sun.clone(), params.atmosphere.clone(), frame.altitude, frame.zenith, layers);
        let (map, light) = self.made.get(key, || {
            let map = ctx.gpu.texture("sky", SIZE, 1);
            bake_map(ctx, "sky", "sky_map_bake", &map)?;
            let light = ctx.gpu.buffer("sky_light", 64);
            let mut bindings = ctx.uniforms.bindings();
            bindings.push(("sky_light", (&light).into()));
            let mut work = ctx.gpu.work();
            work.dispatch(&*ctx.gpu.kernel("sky", "sky_light_bake", ctx.variant)?, &bindings, [64, 1, 1])?;
            work.submit(ctx.timings, ctx.interrupt)?;
            Ok((map.create_view(&wgpu::TextureViewDescriptor::default()), light))
        })?;
        Ok(vec![("sky_map", map.into()), ("sky_light", light.into()), ("sky_light_uniform", light.into())])
    }
}
