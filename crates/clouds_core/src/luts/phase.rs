//! Mie phase function of droplets by scattering angle, as a texture.

use std::f64::consts::PI;

use super::lut::{Inputs, Lut, view};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::gpu::disk_cache as cache;
use crate::mie;
use crate::params::Phase;

/// Number of angles: pi sin^2 of equal steps, dense at the forward peak and at the glory, 0.14 degrees apart in the
/// middle.
const ENTRIES: usize = 2048;

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
            let texels = load_or_bake(light.droplet_diameter);
            let texture = rec.gpu.flat("phase_table", [texels.len() as u32, 1], wgpu::TextureFormat::Rg32Float);
            rec.gpu.write_texture(&texture, &texels);
            Ok(view(&texture))
        })?;
        rec.bind([("phase_table", (&table).into())]);
        Ok(())
    }
}

/// Table for a droplet diameter in µm, from the disk cache if possible: the largest droplets take a second.
fn load_or_bake(diameter: f32) -> Vec<[f32; 2]> {
    let key = format!("{diameter} {ENTRIES} {}", mie::VERSION);
    if let Some(stored) = cache::load("phase", &key).filter(|stored| stored.len() == 8 * ENTRIES) {
        return bytemuck::pod_collect_to_vec(&stored);
    }
    let table = table(diameter);
    cache::store("phase", &key, &[bytemuck::cast_slice(&table)]);
    table
}

fn table(diameter: f32) -> Vec<[f32; 2]> {
    let angles: Vec<_> =
        (0..ENTRIES).map(|i| PI * (0.5 * PI * i as f64 / (ENTRIES - 1) as f64).sin().powi(2)).collect();
    let phase = mie::phase(f64::from(diameter), &angles);
    // Trapezoidal rule over 1 - cos: exact for linear interpolation between entries.
    let cosine: Vec<_> = angles.iter().map(|angle| 2.0 * (0.5 * angle).sin().powi(2)).collect();
    let mut integral = vec![0.0];
    for i in 1..ENTRIES {
        let mean = 0.5 * (phase[i - 1] + phase[i]);
        integral.push(integral[i - 1] + 2.0 * PI * mean * (cosine[i] - cosine[i - 1]));
    }
    let whole = integral[ENTRIES - 1];
    (0..ENTRIES).map(|i| [(phase[i] / whole) as f32, (integral[i] / whole) as f32]).collect()
}
