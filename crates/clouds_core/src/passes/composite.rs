//! The clouds before the sky: what the caller gets.

use super::clouds::CloudBuffers;
use super::refine::RayList;
use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::gpu::Recorder;
use crate::grid::{TILE, WIDEST};
use crate::params::{Params, Quality};
use crate::uniforms::Dispatch;

/// Share of the cells that are not smooth as a rule.
const ROUGH: f64 = 0.3;

/// What a picture is composed of, and into.
pub(crate) struct Parts<'a> {
    pub cloud_buffers: &'a CloudBuffers,
    pub background_corners: &'a Background,
    pub ray_list: &'a RayList,
    pub out: &'a Output,
}

/// The picture, of a band or whole.
pub(crate) struct Output {
    /// Radiance and alpha.
    pub image: wgpu::Buffer,
    /// Radiance of the sky without clouds.
    pub sky: wgpu::Buffer,
    /// Depth of all clouds, -1 where there is none.
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

/// What is behind the marched clouds at the corners of the cells of a sheet, and of those around it.
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

fn corners(size: [u32; 2]) -> [u32; 2] {
    size.map(|pixels| pixels.div_ceil(TILE) + 3)
}

/// Whether what is behind the clouds is worked out by cells: where clouds are marched so, and cells as narrow as theirs. The
/// high clouds are a single layer then, as they are from below.
pub(crate) fn by_cells(frame: &Frame, quality: &Quality) -> bool {
    let single = !frame.high_clouds || frame.view.power_high <= 0.0;
    quality.contrast > 0.0 && single && TILE as f32 * frame.marched_angle() / frame.dispatch.stride as f32 <= WIDEST
}

/// Composes the sheet of `frame`: cells, then the pixels of those that are not smooth, or all of them; then those in which a disc
/// of light is seen.
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
        let list = ray_list.list(columns * rows, TILE * TILE, ROUGH);
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
        let usual = rec.specialize_with(&[("DISCS", 1.0)]);
        let bindings = [vec![pixels.binding(gpu)], ours.clone()].concat();
        rec.dispatch(("discs", "discs"), bindings.clone(), [columns, rows, 1]);
        rec.dispatch(("composite", "composite_discs"), bindings, [columns, rows, 1]);
        rec.specialize(usual);
    }
}
