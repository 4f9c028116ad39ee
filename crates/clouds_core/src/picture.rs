//! Picture in memory, and its readback.

use crate::frame::Frame;
use crate::gpu::{Download, Recorder};
use crate::grid::{SampleGrid, TILE};
use crate::targets::{Targets, count};

/// Layers of a picture, row by row from the top.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Radiance and alpha, four numbers per pixel ([`Renderer::render`](crate::Renderer::render)).
    pub image: Vec<f32>,
    /// Radiance of the background without clouds, and 1, four numbers per pixel.
    pub sky: Vec<f32>,
    /// Distance to the mean scattering point in m, -1 without clouds.
    pub depth: Vec<f32>,
    /// Number of density evaluations, of view and light samples together.
    pub samples: Vec<u32>,
    /// Uncertainty of the radiance of the clouds, and 0, four numbers per pixel: the standard error of path tracing, or
    /// the change by the last halving of the reference integrator's steps. Empty for marched pictures.
    pub uncertainty: Vec<f32>,
}

/// Records the readback of a strip.
pub(crate) fn download(rec: &mut Recorder<'_>, frame: &Frame, targets: &Targets, layers: bool) {
    let Targets { output, rays, .. } = targets;
    let pixels = count([frame.view.width, frame.dispatch.rows]);
    rec.download(&output.image, 0, 16 * pixels);
    if layers {
        rec.download(&output.sky, 0, 16 * pixels);
        rec.download(&output.depth, 0, 4 * pixels);
        let samples = frame.grid.strip(frame.dispatch.rows).samples();
        rec.download(&targets.clouds().samples, 0, 4 * count(samples));
        if let Some(rays) = rays {
            rec.download(&rays.uncertainty, 0, 16 * pixels);
        }
    }
}

impl Picture {
    /// Appends the readback of a strip; there is none of a frame on a screen.
    pub(crate) fn append(&mut self, downloads: &[Download], frame: &Frame, layers: bool) {
        let Some(image) = downloads.first() else { return };
        self.image.extend_from_slice(image.numbers());
        if !layers {
            return;
        }
        self.sky.extend_from_slice(downloads[1].numbers());
        self.depth.extend_from_slice(downloads[2].numbers());
        let samples: &[u32] = downloads[3].numbers();
        if frame.grid.low_resolution {
            self.samples.extend(at_pixels(samples, frame.grid.strip(frame.dispatch.rows)));
        } else {
            self.samples.extend_from_slice(samples);
        }
        if let Some(uncertainty) = downloads.get(4) {
            self.uncertainty.extend_from_slice(uncertainty.numbers());
        }
    }
}

/// Value of each pixel of a grid at low resolution: that of its sample, or 0 between samples.
fn at_pixels(numbers: &[u32], grid: SampleGrid) -> impl Iterator<Item = u32> {
    let [columns, _] = grid.samples();
    let [width, height] = grid.size;
    let index = move |x: u32, y: u32| (y / TILE * columns + x / TILE) as usize;
    let sampled = |x: u32, y: u32| x.is_multiple_of(TILE) && y.is_multiple_of(TILE);
    (0..height).flat_map(move |y| (0..width).map(move |x| if sampled(x, y) { numbers[index(x, y)] } else { 0 }))
}
