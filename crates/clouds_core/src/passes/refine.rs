//! Which pixels are marched: a coarse lattice, then those between rays that do not look alike.

use super::clouds::CloudBuffers;
use crate::camera::Camera;
use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::gpu::{List, Recorder};
use crate::grid::{TILE, WIDEST};
use crate::params::{Integrator, Quality};

/// Whether the pixels of that lattice are all that is ever marched: where no contrast is too large to interpolate, and no scene of the
/// user's has edges. The rest of the picture is interpolated where it is composed (composite.wgsl), cell by cell.
pub(crate) fn is_low_resolution(frame: &Frame, quality: &Quality) -> bool {
    quality.contrast >= 1.0 && !frame.scene && coarsest(frame, quality) == TILE
}

impl Quality {
    /// Whether one in sixteen is all that is marched of a picture of so many pixels, and that an animation follows: with a `contrast` of 1,
    /// where pixels are less than an eighth of a degree wide. A scene of the user's has all its pixels.
    pub fn is_low_resolution(&self, camera: &Camera, size: [u32; 2]) -> bool {
        self.integrator == Integrator::March && is_low_resolution(&Frame::seen_by(camera, size), self)
    }
}

/// The pixels to be marched next.
pub(crate) struct RayList {
    /// Their numbers in the sheet.
    entries: wgpu::Buffer,
    /// How many there are.
    pub count: wgpu::Buffer,
    /// Between which distances the ray of each pixel of the sheet meets cloud.
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

    /// The list, of at most so many entries with so many invocations each, and as a rule a share of them.
    pub fn list(&self, most: u32, each: u32, likely: f64) -> List<'_> {
        List { count: &self.count, most, each, likely }
    }
}

/// Columns and rows of the lattice of `frame`, of which the last column and row are a part.
fn lattice(frame: &Frame) -> [u32; 2] {
    [frame.dispatch.march_width, frame.dispatch.strip_rows].map(|size| (size - 1).div_ceil(frame.dispatch.lattice) + 1)
}

/// How many pixels it has.
pub(crate) fn pixels(frame: &Frame) -> u32 {
    lattice(frame).iter().product()
}

/// Whether pixels between marched ones are looked at.
pub(crate) fn is_needed(frame: &Frame, quality: &Quality) -> bool {
    !frame.grid.low_resolution && coarsest(frame, quality) > 1
}

/// The distance to begin with; 1 marches every pixel.
pub(crate) fn coarsest(frame: &Frame, quality: &Quality) -> u32 {
    let fits = |n: &u32| quality.contrast > 0.0 && *n as f32 * frame.marched_angle() <= WIDEST;
    [TILE, 2].into_iter().find(fits).unwrap_or(1)
}

/// Lists the pixels of the lattice of `frame`.
pub(crate) fn begin(rec: &mut Recorder<'_>, frame: &Frame, ray_list: &RayList) {
    let [columns, rows] = lattice(frame);
    let bindings = [vec![frame.dispatch.binding(rec.gpu)], ray_list.bindings()].concat();
    rec.clear(&ray_list.count);
    rec.dispatch(("refine", "list_grid"), bindings, [columns, rows, 1]);
}

/// Halves the distance `frame.dispatch.lattice` of the lattice: interpolates `out`, or lists pixels to be marched.
pub(crate) fn record(rec: &mut Recorder<'_>, frame: &Frame, ray_list: &RayList, out: &CloudBuffers) {
    let bindings = [vec![frame.dispatch.binding(rec.gpu)], out.bindings(), ray_list.bindings()].concat();
    let [columns, rows] = lattice(frame);
    rec.dispatch(("refine", "refine"), bindings, [columns, rows, 1]);
}
