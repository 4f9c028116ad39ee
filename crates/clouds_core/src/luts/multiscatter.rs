//! The light that air and ground have scattered, by altitude and the height of the sun.

use super::{Inputs, Lut, load_or_bake, transmittance, view};
use crate::error::Result;
use crate::kernel::Bindings;
use crate::params;
use crate::recorder::Recorder;

/// Texels: cosine of the sun's angle with the zenith, altitude in each of six tables (as in atmosphere.wgsl).
const SIZE: [u32; 3] = [64, 6 * 24, 1];
/// Orders of scattering; the last stands for all that follow (as in passes/multiscatter.wgsl).
const ORDERS: usize = 4;

/// The tables on the GPU.
#[derive(Default)]
pub(crate) struct Multiscatter {
    lut: Lut<params::Atmosphere>,
}

impl Multiscatter {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let from = transmittance::air(inputs.params);
        let key = format!("{from:?}");
        let tables = self.lut.update(rec, from, |rec| {
            let texture = rec.gpu.texture("air_light", SIZE, 1);
            load_or_bake(rec, "multiscatter", "multiscatter", &key, &[&texture], |rec| bake(rec, &texture))?;
            Ok(view(&texture))
        })?;
        rec.bind([("air_light", (&tables).into())]);
        Ok(())
    }
}

fn bake(rec: &mut Recorder<'_>, sum: &wgpu::Texture) {
    let orders: Vec<_> = (0..ORDERS).map(|_| view(&rec.gpu.texture("air_light_order", SIZE, 1))).collect();
    let table = [SIZE[0], SIZE[1] / 6, 1];
    let next = |before: &wgpu::TextureView, out: &wgpu::TextureView| -> Bindings {
        vec![("mix_a", before.into()), ("map_out", out.into())]
    };
    // The first has none before it, but one kernel body with the others: what is bound is not read.
    rec.dispatch(("multiscatter", "first_order"), next(&orders[1], &orders[0]), table);
    for (before, out) in orders.iter().zip(&orders[1..]) {
        rec.dispatch(("multiscatter", "next_order"), next(before, out), table);
    }
    let [a, b, c, d] = [0, 1, 2, 3].map(|order: usize| (&orders[order]).into());
    let bindings = vec![("mix_a", a), ("mix_b", b), ("mix_c", c), ("mix_d", d), ("map_out", (&view(sum)).into())];
    rec.dispatch(("multiscatter", "sum_orders"), bindings, SIZE);
}
