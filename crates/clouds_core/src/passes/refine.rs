//! Adaptive sampling: an initial grid is marched. Pixels between samples of low contrast are interpolated, the others
//! are marched.

use super::clouds::CloudBuffers;
use crate::camera::Camera;
use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::gpu::{List, Recorder};
use crate::grid::{TILE, WIDEST};
use crate::params::{Integrator, Quality};

/// Whether only the initial grid is marched: at a threshold of 1, without a user's scene, which may have edges. The
/// composite pass upsamples it cell by cell (composite.wgsl).
pub(crate) fn is_low_resolution(frame: &Frame, quality: &Quality) -> bool {
    quality.adaptive_threshold >= 1.0 && !frame.scene && coarsest(frame, quality) == TILE
}

impl Quality {
    /// Whether a picture of `size` pixels is rendered at low resolution: only one pixel in sixteen is marched, and
    /// reprojected in an animation. The conditions are a `adaptive_threshold` of 1 and pixels narrower than an eighth of a
    /// degree. Pictures with a user's scene are always rendered at full resolution.
    pub fn is_low_resolution(&self, camera: &Camera, size: [u32; 2]) -> bool {
        self.integrator == Integrator::March && is_low_resolution(&Frame::seen_by(camera, size), self)
    }
}

/// Ray list: the samples to be marched next.
pub(crate) struct RayList {
    /// Indices of the samples in the strip.
    entries: wgpu::Buffer,
    /// Number of entries.
    pub count: wgpu::Buffer,
    /// Range of distances in m in which the ray of each sample of the strip meets cloud, from the start of the march.
    pub span: wgpu::Buffer,
}

impl RayList {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self {
            entries: gpu.buffer("active_rays", 4 * pixels),
            count: gpu.buffer("ray_count", 4),
            span: gpu.buffer("cloud_span", 8 * pixels),
        }
    }

    pub fn bindings(&self) -> Bindings {
        vec![
            ("active_rays", (&self.entries).into()),
            ("ray_count", (&self.count).into()),
            ("cloud_span", (&self.span).into()),
        ]
    }

    /// List of at most `most` entries with `each` invocations per entry. `likely` is the typical number of entries as a
    /// fraction of `most`.
    pub fn list(&self, most: u32, each: u32, likely: f64) -> List<'_> {
        List { count: &self.count, most, each, likely }
    }
}

/// Number of samples of the grid of spacing `frame.dispatch.grid_spacing`, across and down. The last column and row belong
/// to it.
fn grid_size(frame: &Frame) -> [u32; 2] {
    [frame.dispatch.march_width, frame.dispatch.strip_rows]
        .map(|size| (size - 1).div_ceil(frame.dispatch.grid_spacing) + 1)
}

/// Total number of samples of the grid of spacing `frame.dispatch.grid_spacing`.
pub(crate) fn grid_samples(frame: &Frame) -> u32 {
    grid_size(frame).iter().product()
}

/// Whether the initial grid is refined.
pub(crate) fn is_needed(frame: &Frame, quality: &Quality) -> bool {
    !frame.grid.low_resolution && coarsest(frame, quality) > 1
}

/// Spacing of the initial grid in samples. At 1 every sample is marched.
pub(crate) fn coarsest(frame: &Frame, quality: &Quality) -> u32 {
    let fits = |n: &u32| quality.adaptive_threshold > 0.0 && *n as f32 * frame.marched_angle() <= WIDEST;
    [TILE, 2].into_iter().find(fits).unwrap_or(1)
}

/// Lists the samples of the grid of `frame`.
pub(crate) fn list_grid(rec: &mut Recorder<'_>, frame: &Frame, ray_list: &RayList) {
    let [columns, rows] = grid_size(frame);
    let bindings = [vec![frame.dispatch.binding(rec.gpu)], ray_list.bindings()].concat();
    rec.clear(&ray_list.count);
    rec.dispatch(("refine", "list_grid"), bindings, [columns, rows, 1]);
}

/// Halves the grid spacing `frame.dispatch.grid_spacing`: new samples are interpolated to `out` or listed.
pub(crate) fn record(rec: &mut Recorder<'_>, frame: &Frame, ray_list: &RayList, out: &CloudBuffers) {
    let bindings = [vec![frame.dispatch.binding(rec.gpu)], out.bindings(), ray_list.bindings()].concat();
    let [columns, rows] = grid_size(frame);
    rec.dispatch(("refine", "refine"), bindings, [columns, rows, 1]);
}
