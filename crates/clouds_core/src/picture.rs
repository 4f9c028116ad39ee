//! A picture that has come back from the device.

use crate::frame::Frame;
use crate::gpu::{Download, Recorder};
use crate::grid::{SampleGrid, TILE};
use crate::targets::{Targets, count};

/// A picture, row by row.
#[derive(Clone, Debug, Default)]
pub struct Picture {
    /// Four numbers a pixel: radiance and alpha (see [`Renderer::render`]).
    pub image: Vec<f32>,
    /// Four numbers a pixel: radiance of the sky without clouds, and 1.
    pub sky: Vec<f32>,
    /// Metres to the mean scattering point, -1 where there is none.
    pub depth: Vec<f32>,
    /// Density evaluations, primary and light together.
    pub samples: Vec<u32>,
    /// Four numbers a pixel: how sure the radiance of the clouds is, and 0. A standard error where paths are traced, the
    /// change by the last halving where rays converge, nothing where they are marched.
    pub uncertainty: Vec<f32>,
}

/// Brings a strip of a still back.
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
    /// Adds a strip.
    pub(crate) fn append(&mut self, downloads: &[Download], frame: &Frame, layers: bool) {
        self.image.extend_from_slice(downloads[0].numbers());
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

/// A number for each pixel of a picture at low resolution: that of its sample, or 0 where it has none.
fn at_pixels(numbers: &[u32], grid: SampleGrid) -> impl Iterator<Item = u32> {
    let [columns, _] = grid.samples();
    let [width, height] = grid.size;
    let place = move |x: u32, y: u32| (y / TILE * columns + x / TILE) as usize;
    let sampled = |x: u32, y: u32| x.is_multiple_of(TILE) && y.is_multiple_of(TILE);
    (0..height).flat_map(move |y| (0..width).map(move |x| if sampled(x, y) { numbers[place(x, y)] } else { 0 }))
}
