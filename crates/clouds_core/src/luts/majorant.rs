//! Majorants of the density for delta tracking, baked for path tracing.

use super::lut::{Inputs, Lut, view};
use super::volume::Grid;
use super::weather;
use crate::error::Result;
use crate::gpu::Recorder;
use crate::params::{self, BroadShares, Edge, Integrator};
use crate::shared::constants;

constants! {
    /// Side of a majorant cell in voxels of the user's grid.
    const BRICK: usize = 4;
}

/// Maximum number of cells along a side of the weather map, and the height of a cell in m between the lowest and the
/// highest clouds.
const MAX_CELLS: u32 = 64;
const CELL_HEIGHT: f32 = 125.0;
/// Side of a majorant cell in texels of the weather map.
const CELL_TEXELS: u32 = 8;

/// Key of the majorants: grid, or weather and decks.
type Key = (Grid, (Vec<(params::Weather, f32)>, Edge, BroadShares), params::Clouds, params::UpperClouds);

/// Majorants on the GPU.
#[derive(Default)]
pub(crate) struct Majorants {
    lut: Lut<Key>,
}

impl Majorants {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let params = inputs.params;
        if inputs.quality.integrator_of(params) != Integrator::Path {
            return Ok(());
        }
        let grid = Grid(params.volume.clone());
        let weather = (params.weather_shares(), params.weather.edge, params.broad_shares());
        let key = (grid, weather, params.clouds.clone(), params.upper_clouds.clone());
        let majorants = self.lut.update(rec, key, |rec| {
            let (entry, size) = match &params.volume {
                Some(grid) => ("majorant_grid", grid.size().map(|n| n.div_ceil(BRICK) as u32)),
                None => {
                    let across = weather::size(params).map(|n| n.div_ceil(CELL_TEXELS).clamp(1, MAX_CELLS));
                    let [base, top] = params.shell();
                    let up = (((top - base) / CELL_HEIGHT) as u32).clamp(16, 64);
                    ("majorant_weather", [across[0], across[1], up])
                }
            };
            let [from, to] = ["bounds", "majorants"].map(|label| view(&rec.gpu.texture_3d(label, size)));
            rec.dispatch(("majorant", entry), vec![("volume_out", (&from).into())], size);
            let bindings = vec![("volume_in", (&from).into()), ("volume_out", (&to).into())];
            rec.dispatch(("majorant", "majorant_dilate"), bindings, size);
            Ok(to)
        })?;
        rec.bind([("majorants", (&majorants).into())]);
        Ok(())
    }
}
