//! The phase function of droplets by angle, as a texture.

use std::f64::consts::PI;

use super::{Baked, Bindings, Context};
use crate::cache;
use crate::error::Result;
use crate::mie;
use crate::params::{Params, Phase};

/// Angles of the table: pi sin^2 of equal steps, dense where peak and glory are. 0.14 degrees apart in the middle.
const ENTRIES: usize = 2048;

/// The table on the GPU: the phase function, 1/sr, and its integral from the forward direction, at each angle.
pub(crate) struct PhaseTable {
    table: Baked<Option<f32>, wgpu::TextureView>,
}

impl PhaseTable {
    pub const fn new() -> Self {
        Self { table: Baked::new() }
    }

    pub fn run(&mut self, ctx: &Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let diameter = (params.light.phase == Phase::Mie).then_some(params.light.droplet_diameter);
        let view = self.table.get(diameter, || {
            // A kernel that could read a texture must be given one.
            let texels = diameter.map_or_else(|| vec![[0.0; 2]; 2], kept);
            let texture = ctx.gpu.flat("phase_table", [texels.len() as u32, 1], wgpu::TextureFormat::Rg32Float);
            ctx.gpu.write_texture(&texture, &texels);
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("phase_table", view.into())])
    }
}

/// The table, from disk where an earlier process has made it: a second of work for the largest droplets.
fn kept(diameter: f32) -> Vec<[f32; 2]> {
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
    // By the rule of trapezoids over 1 - cos, exact for what is linear between entries.
    let cosine: Vec<_> = angles.iter().map(|angle| 2.0 * (0.5 * angle).sin().powi(2)).collect();
    let mut integral = vec![0.0];
    for i in 1..ENTRIES {
        let mean = 0.5 * (phase[i - 1] + phase[i]);
        integral.push(integral[i - 1] + 2.0 * PI * mean * (cosine[i] - cosine[i - 1]));
    }
    let whole = integral[ENTRIES - 1];
    (0..ENTRIES).map(|i| [(phase[i] / whole) as f32, (integral[i] / whole) as f32]).collect()
}
