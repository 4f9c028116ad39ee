//! The light that air and ground have scattered, by altitude and the height of the sun.

use super::lut::{Inputs, Lut, MIXED, load_or_bake, view};
use super::transmittance;
use crate::error::Result;
use crate::gpu::Bindings;
use crate::gpu::Recorder;
use crate::params;
use crate::shared::constants;

constants! {
    /// Tables of the light that has been scattered, one below the other (`SCATTERED` to `FLUX_SUNWARD`).
    const TABLES: u32 = 6;
    /// Texels across one of these tables: the cosine of the sun's angle with the zenith.
    const TABLE_COSINES: u32 = 64;
    /// Texels down one of these tables: altitude.
    const TABLE_ALTITUDES: u32 = 24;
}

/// Texels of all tables.
const SIZE: [u32; 3] = [TABLE_COSINES, TABLES * TABLE_ALTITUDES, 1];

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
            let texture = rec.gpu.texture("multiscattering_lut", SIZE, 1);
            load_or_bake(rec, "multiscatter", "multiscatter", &key, &[&texture], |rec| bake(rec, &texture))?;
            Ok(view(&texture))
        })?;
        rec.bind([("multiscattering_lut", (&tables).into())]);
        Ok(())
    }
}

fn bake(rec: &mut Recorder<'_>, sum: &wgpu::Texture) {
    // Of as many orders as are added up; the last stands for all that follow.
    let orders = MIXED.map(|_| view(&rec.gpu.texture("air_light_order", SIZE, 1)));
    let table = [TABLE_COSINES, TABLE_ALTITUDES, 1];
    let next = |before: &wgpu::TextureView, out: &wgpu::TextureView| -> Bindings {
        vec![("mix_a", before.into()), ("map_out", out.into())]
    };
    // The first has none before it, but one kernel body with the others: what is bound is not read.
    rec.dispatch(("multiscatter", "first_order"), next(&orders[1], &orders[0]), table);
    for (before, out) in orders.iter().zip(&orders[1..]) {
        rec.dispatch(("multiscatter", "next_order"), next(before, out), table);
    }
    let mut bindings: Bindings = MIXED.into_iter().zip(&orders).map(|(name, order)| (name, order.into())).collect();
    bindings.push(("map_out", (&view(sum)).into()));
    rec.dispatch(("multiscatter", "sum_orders"), bindings, SIZE);
}
