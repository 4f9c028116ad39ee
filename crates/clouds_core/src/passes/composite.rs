//! Compositing: clouds, seen through the air, over the background.

use super::clouds::CloudBuffers;
use super::refine::RayList;
use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::gpu::Recorder;
use crate::grid::{TILE, WIDEST};
use crate::params::{Params, Quality};
use crate::uniforms::Dispatch;

/// Typical fraction of cells that are not smooth, whose pixels are evaluated one by one.
const TYPICAL_LISTED: f64 = 0.3;

/// Buffers of the composite pass.
pub(crate) struct Parts<'a> {
    pub cloud_buffers: &'a CloudBuffers,
    pub background_corners: &'a Background,
    pub ray_list: &'a RayList,
    pub out: &'a Output,
}

/// Output of a strip.
pub(crate) struct Output {
    /// Radiance and alpha, four numbers per pixel.
    pub image: wgpu::Buffer,
    /// Radiance of the background without clouds, four numbers per pixel.
    pub sky: wgpu::Buffer,
    /// Distance to the mean scattering point of all clouds in m, -1 without clouds.
    pub depth: wgpu::Buffer,
}

impl Output {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self {
            image: gpu.picture_buffer("image", 16 * pixels),
            sky: gpu.picture_buffer("sky", 16 * pixels),
            depth: gpu.picture_buffer("depth", 4 * pixels),
        }
    }

    pub fn bindings(&self) -> Bindings {
        vec![("image", (&self.image).into()), ("sky", (&self.sky).into()), ("depth", (&self.depth).into())]
    }
}

/// Background of the marched clouds at the corners of the cells of a strip and of the cells around it.
pub(crate) struct Background {
    pub corners: wgpu::Buffer,
}

impl Background {
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        Self { corners: gpu.buffer("corners", 64 * corners(size).map(u64::from).iter().product::<u64>()) }
    }

    pub fn bindings(&self) -> Bindings {
        vec![("corners", (&self.corners).into())]
    }
}

/// Number of corners, across and down: one more than cells, and one more on either side.
fn corners(size: [u32; 2]) -> [u32; 2] {
    size.map(|pixels| pixels.div_ceil(TILE) + 3)
}

/// Whether the background is evaluated at corners of cells and interpolated: with adaptive sampling, if cells are no
/// wider than its largest spacing of samples. The high clouds must be a single layer, which they are from below.
pub(crate) fn by_cells(frame: &Frame, quality: &Quality) -> bool {
    let single = !frame.high_clouds || frame.view.power_high <= 0.0;
    quality.adaptive_threshold > 0.0
        && single
        && TILE as f32 * frame.marched_angle() / frame.dispatch.stride as f32 <= WIDEST
}

/// Composites the strip of `frame`. With `by_cells` smooth cells are interpolated, and the pixels of the others are
/// listed and evaluated. Otherwise all pixels are evaluated. Pixels with a disc of sun or moon follow in dispatches of
/// their own.
pub(crate) fn record(rec: &mut Recorder<'_>, frame: &Frame, params: &Params, parts: &Parts<'_>, by_cells: bool) {
    let gpu = rec.gpu;
    let Parts { cloud_buffers, background_corners, ray_list, out } = parts;
    let whole = Dispatch { first_row: frame.dispatch.strip_row, ..frame.dispatch.clone() };
    let ours = [cloud_buffers.bindings(), out.bindings()].concat();
    if by_cells {
        let block = vec![whole.binding(gpu)];
        let size = [frame.view.width, frame.dispatch.rows];
        let [columns, rows] = corners(size);
        rec.dispatch(
            ("composite", "background_corners"),
            [block.clone(), background_corners.bindings()].concat(),
            [columns, rows, 1],
        );
        let [columns, rows] = size.map(|pixels| pixels.div_ceil(TILE));
        let ours = [ours.clone(), ray_list.bindings()].concat();
        rec.clear(&ray_list.count);
        let cells = [block, background_corners.bindings(), ours.clone()].concat();
        rec.dispatch(("composite", "composite_cells"), cells, [columns, rows, 1]);
        let list = ray_list.list(columns * rows, TILE * TILE, TYPICAL_LISTED);
        rec.dispatch_list(("composite", "composite_list"), &ours, &list, |first_ray| {
            Dispatch { first_ray, ..whole.clone() }.binding(gpu)
        });
    } else {
        rec.dispatch_rows(("composite", "composite"), &ours, [frame.view.width, frame.dispatch.rows], |rows| {
            let (first_row, rows) = (frame.dispatch.strip_row + rows.start, rows.len() as u32);
            Dispatch { first_row, rows, ..whole.clone() }.binding(gpu)
        });
    }
    for [first_column, first_row, columns, rows] in frame.disc_pixels(params) {
        let pixels = Dispatch { first_column, first_row, columns, rows, ..whole.clone() };
        let previous = rec.specialize_with(&[("DISCS", 1.0)]);
        let bindings = [vec![pixels.binding(gpu)], ours.clone()].concat();
        rec.dispatch(("discs", "discs"), bindings.clone(), [columns, rows, 1]);
        rec.dispatch(("composite", "composite_discs"), bindings, [columns, rows, 1]);
        rec.specialize(previous);
    }
}
