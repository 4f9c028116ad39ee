//! Transmittance LUT: optical depth of the atmosphere to space, by altitude and direction.

use super::lut::{Inputs, Lut, bake_map, load_or_bake, view};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::params::{self, Params};

/// Size in texels: distance to the top of the atmosphere, altitude (Hillaire 2020).
const SIZE: [u32; 3] = [256, 64, 1];

/// Transmittance LUT on the GPU.
#[derive(Default)]
pub(crate) struct Transmittance {
    lut: Lut<params::Atmosphere>,
}

impl Transmittance {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let from = air(inputs.params);
        let key = format!("{from:?}");
        let table = self.lut.update(rec, from, |rec| {
            let texture = rec.gpu.texture("transmittance_lut", SIZE, 1);
            load_or_bake(rec, "transmittance", "transmittance", &key, &[&texture], |rec| {
                bake_map(rec, ("transmittance", "transmittance_bake"), None, &texture);
            })?;
            Ok(view(&texture))
        })?;
        rec.bind([("transmittance_lut", (&table).into())]);
        Ok(())
    }
}

/// Atmosphere reduced to the properties of the air. The strength of the aerial perspective and the night sky, which do
/// not affect the air, are set to constants.
pub(super) fn air(params: &Params) -> params::Atmosphere {
    params::Atmosphere { aerial_perspective: 1.0, night: [0.0; 3], ..params.atmosphere.clone() }
}
