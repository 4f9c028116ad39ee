//! Which pixels are marched: a coarse lattice, then those between rays that do not look alike.

use super::{Bindings, Scene};
use super::march::Marched;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Gpu, Work};

/// Distance of the pixels that are marched first.
pub(crate) const COARSEST: u32 = 4;

/// The pixels to be marched next.
pub(crate) struct Refined {
    /// Their numbers in the sheet.
    pub list: wgpu::Buffer,
    /// How many there are.
    pub count: wgpu::Buffer,
    /// Between which distances the ray of each pixel of the sheet meets cloud.
    pub span: wgpu::Buffer,
}

impl Refined {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self { list: gpu.buffer("active_rays", 4 * pixels), count: gpu.buffer("ray_count", 4), span: gpu.buffer("cloud_span", 8 * pixels) }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        vec![
            ("active_rays", (&self.list).into()),
            ("ray_count", (&self.count).into()),
            ("cloud_span", (&self.span).into()),
        ]
    }

    /// Begins with the lattice, of which the last column and row are a part. Returns how many pixels it has.
    pub fn begin(&self, gpu: &Gpu, frame: &Frame) -> u32 {
        let along = |size: u32| {
            let last = size - 1;
            (0..last).step_by(COARSEST as usize).chain([last])
        };
        let lattice: Vec<u32> =
            along(frame.sheet_rows).flat_map(|y| along(frame.march_width).map(move |x| y * frame.march_width + x)).collect();
        gpu.queue.write_buffer(&self.list, 0, bytemuck::cast_slice(&lattice));
        lattice.len() as u32
    }
}

/// Halves the distance `frame.lattice` of the lattice: interpolates `out`, or lists pixels to be marched.
pub(crate) fn run(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    refined: &Refined,
    out: &Marched,
) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &out.bindings(), &refined.bindings()].concat();
    let [width, height] = [frame.march_width, frame.sheet_rows].map(|size| (size - 1).div_ceil(frame.lattice) + 1);
    work.clear(&refined.count);
    work.dispatch(&*gpu.kernel("refine", "refine", scene.variant)?, &bindings, [width, height, 1])
}
