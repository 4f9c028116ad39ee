//! What the density nearby never exceeds, for delta tracking: baked when paths are traced.

use std::sync::Arc;

use super::{Baked, Bindings, Context, weather};
use crate::error::Result;
use crate::params::{self, BroadShares, Edge, Model, Params};

/// Voxels along the side of a cell (as in majorant.wgsl).
const BRICK: usize = 4;
/// Most cells along a side of the weather map, and their height between the lowest and the highest clouds, m.
const CELLS: u32 = 64;
const CELL_HEIGHT: f32 = 125.0;
/// Texels of the weather map's side for each cell.
const TEXELS: u32 = 8;

/// What the majorants are made from: the grid by its address, or weather and cover.
type Key = (bool, usize, (Vec<(params::Weather, f32)>, Edge, BroadShares), params::Clouds, params::UpperClouds);

/// The majorants on the GPU.
pub(crate) struct Majorants {
    made: Baked<Key, wgpu::TextureView>,
}

impl Majorants {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    /// `world` holds the uniforms, the grid and the weather map.
    pub fn run(&mut self, ctx: &mut Context<'_>, params: &Params, world: &Bindings<'_>) -> Result<Bindings<'_>> {
        let wanted = ctx.variant.model == Model::Path;
        let grid = params.volume.as_ref().map_or(0, |grid| Arc::as_ptr(grid) as usize);
        let weather = (params.weather_shares(), params.weather.edge, params.broad_shares());
        let key = (wanted, grid, weather, params.clouds.clone(), params.upper_clouds.clone());
        let view = self.made.get(key, || {
            let (entry, size) = match &params.volume {
                _ if !wanted => ("", [1; 3]),
                Some(grid) => ("majorant_grid", grid.size().map(|n| n.div_ceil(BRICK) as u32)),
                None => {
                    let across = weather::size(params).map(|n| n.div_ceil(TEXELS).clamp(1, CELLS));
                    let [base, top] = params.shell();
                    let up = (((top - base) / CELL_HEIGHT) as u32).clamp(16, 64);
                    ("majorant_weather", [across[0], across[1], up])
                }
            };
            let [bounds, dilated] = ["bounds", "majorants"].map(|label| ctx.gpu.texture_3d(label, size));
            let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
            if wanted {
                let mut work = ctx.gpu.work();
                let (from, to) = (view(&bounds), view(&dilated));
                let bindings = [world.as_slice(), &[("volume_out", (&from).into())]].concat();
                work.dispatch(&*ctx.gpu.kernel("majorant", entry, ctx.variant)?, &bindings, size)?;
                let bindings =
                    [world.as_slice(), &[("volume_in", (&from).into()), ("volume_out", (&to).into())]].concat();
                work.dispatch(&*ctx.gpu.kernel("majorant", "majorant_dilate", ctx.variant)?, &bindings, size)?;
                work.submit(ctx.timings, ctx.interrupt)?;
            }
            Ok(view(&dilated))
        })?;
        Ok(vec![("majorants", view.into())])
    }
}
