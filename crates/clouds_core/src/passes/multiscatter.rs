//! The light that air and ground have scattered, by altitude and the height of the sun.

use super::{Baked, Bindings, Context, kept, transmittance};
use crate::error::Result;
use crate::params::{self, Params};

/// Texels: cosine of the sun's angle with the zenith, altitude in each of six tables (as in atmosphere.wgsl).
const SIZE: [u32; 3] = [64, 6 * 24, 1];
/// Orders of scattering; the last stands for all that follow (as in passes/multiscatter.wgsl).
const ORDERS: usize = 4;

/// The tables on the GPU.
pub(crate) struct Multiscatter {
    made: Baked<params::Atmosphere, wgpu::TextureView>,
}

impl Multiscatter {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    /// `air` holds what `transmittance` has baked.
    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params, air: &Bindings<'_>) -> Result<Bindings<'_>> {
        let from = transmittance::air(params);
        let key = format!("{from:?}");
        let view = self.made.get(from, || {
            let texture = ctx.gpu.texture("air_light", SIZE, 1);
            kept(ctx, "multiscatter", "multiscatter", &key, &[&texture], |ctx| bake(ctx, &texture, air))?;
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("air_light", view.into())])
    }
}

fn bake(ctx: &mut Context<'_>, sum: &wgpu::Texture, air: &Bindings<'_>) -> Result<()> {
    let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
    let textures: Vec<_> = (0..ORDERS).map(|_| ctx.gpu.texture("air_light_order", SIZE, 1)).collect();
    let orders: Vec<_> = textures.iter().map(view).collect();
    let mut work = ctx.gpu.work();
    let mut dispatch = |entry, size, ours: &[_]| {
        let bindings = [ctx.uniforms.bindings().as_slice(), air, ours].concat();
        work.dispatch(&*ctx.gpu.kernel("multiscatter", entry, ctx.variant)?, &bindings, size)
    };
    let table = [SIZE[0], SIZE[1] / 6, 1];
    // The first has none before it, but one kernel body with the others: what is bound is not read.
    dispatch("first_order", table, &[("mix_a", (&orders[1]).into()), ("map_out", (&orders[0]).into())])?;
    for (before, next) in orders.iter().zip(&orders[1..]) {
        dispatch("next_order", table, &[("mix_a", before.into()), ("map_out", next.into())])?;
    }
    let sum = view(sum);
    let [a, b, c, d] = [0, 1, 2, 3].map(|order: usize| (&orders[order]).into());
    dispatch(
        "sum_orders",
        SIZE,
        &[("mix_a", a), ("mix_b", b), ("mix_c", c), ("mix_d", d), ("map_out", (&sum).into())],
    )?;
    work.submit(ctx.timings, ctx.interrupt).map(drop)
}
