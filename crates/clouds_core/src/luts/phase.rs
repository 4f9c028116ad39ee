//! Mie phase function of droplets by scattering angle, as a texture.

use super::lut::{Inputs, Lut, view};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::params::Phase;
use crate::scattering::mie_table;

/// Phase-function LUT on the GPU: the phase function in 1/sr and its integral from the forward direction, by angle.
#[derive(Default)]
pub(crate) struct PhaseTable {
    lut: Lut<f32>,
}

impl PhaseTable {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let light = &inputs.params.light;
        if light.phase != Phase::Mie {
            return Ok(());
        }
        let table = self.lut.update(rec, light.droplet_diameter, |rec| {
            let texels = mie_table(light.droplet_diameter);
            let texture = rec.gpu.flat("phase_table", [texels.len() as u32, 1], wgpu::TextureFormat::Rg32Float);
            rec.gpu.write_texture(&texture, &texels);
            Ok(view(&texture))
        })?;
        rec.bind([("phase_table", (&table).into())]);
        Ok(())
    }
}
