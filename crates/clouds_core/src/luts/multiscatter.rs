//! Multiscattering LUT: light scattered by air and ground, order by order, by altitude and elevation of the sun.

use super::lut::{Inputs, Lut, MIXED, load_or_bake, view};
use super::transmittance;
use crate::error::Result;
use crate::gpu::Bindings;
use crate::gpu::Recorder;
use crate::params;
use crate::shared::constants;

constants! {
    /// Number of tables of scattered light, stacked vertically (`SCATTERED` to `FLUX_SUNWARD`).
    const TABLES: u32 = 6;
    /// Width of a table in texels: cosine of the sun's zenith angle.
    const TABLE_COSINES: u32 = 64;
    /// Height of a table in texels: altitude.
    const TABLE_ALTITUDES: u32 = 24;
}

/// Texels of all tables.
const SIZE: [u32; 3] = [TABLE_COSINES, TABLES * TABLE_ALTITUDES, 1];

/// Multiscattering LUT on the GPU.
#[derive(Default)]
pub(crate) struct Multiscatter {
    lut: Lut<params::Atmosphere>,
}

impl Multiscatter {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let from = transmittance::air(inputs.params);
        let key = format!("{from:?}");
        let tables = self.lut.update(rec, from, |rec| {
            let texture = rec.gpu.texture("multiscattering_lut", SIZE, 1);
            load_or_bake(rec, "multiscatter", "multiscatter", &key, &[&texture], |rec| bake(rec, &texture))?;
            Ok(view(&texture))
        })?;
        rec.bind([("multiscattering_lut", (&tables).into())]);
        Ok(())
    }
}

fn bake(rec: &mut Recorder<'_>, sum: &wgpu::Texture) {
    // One texture per order of scattering; the last order stands for all further ones.
    let orders = MIXED.map(|_| view(&rec.gpu.texture("multiscattering_order", SIZE, 1)));
    let table = [TABLE_COSINES, TABLE_ALTITUDES, 1];
    let next = |before: &wgpu::TextureView, out: &wgpu::TextureView| -> Bindings {
        vec![("mix_a", before.into()), ("map_out", out.into())]
    };
    // The first order has no predecessor. It shares the kernel body of the others, so its input is bound and not read.
    rec.dispatch(("multiscatter", "first_order"), next(&orders[1], &orders[0]), table);
    for (before, out) in orders.iter().zip(&orders[1..]) {
        rec.dispatch(("multiscatter", "next_order"), next(before, out), table);
    }
    let mut bindings: Bindings = MIXED.into_iter().zip(&orders).map(|(name, order)| (name, order.into())).collect();
    bindings.push(("map_out", (&view(sum)).into()));
    rec.dispatch(("multiscatter", "sum_orders"), bindings, SIZE);
}
