//! Temporal reprojection: one pixel in sixteen is marched, the others come from the frame before.

use super::march::Marched;
use super::{Bindings, Scene};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Gpu, Work};

/// One of this many pixels is marched in a frame, in each direction.
pub(crate) const STRIDE: u32 = 4;

/// The order in which the sixteen pixels of a cell are marched: a Bayer matrix, so that any few of them in a row are
/// spread over the cell.
pub(crate) const ORDER: [[u32; 2]; 16] = [
    [0, 0],
    [2, 2],
    [2, 0],
    [0, 2],
    [1, 1],
    [3, 3],
    [3, 1],
    [1, 3],
    [1, 0],
    [3, 2],
    [3, 0],
    [1, 2],
    [0, 1],
    [2, 3],
    [2, 1],
    [0, 3],
];

/// What is known of each pixel from the frames so far.
pub(crate) struct History {
    pub marched: Marched,
    /// 1 where a pixel has been marched since the cut, 0 where it is a guess.
    pub known: wgpu::Buffer,
}

impl History {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self { marched: Marched::new(gpu, pixels), known: gpu.buffer("known", 4 * pixels) }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        [self.marched.bindings(), vec![("known", (&self.known).into())]].concat()
    }
}

/// Fills `out` from the `fresh` subset and from the history `before`, for the band of `frame`.
pub(crate) fn run(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    fresh: &Marched,
    before: &History,
    out: &History,
) -> Result<()> {
    let ours = [
        ("fresh", (&fresh.clouds).into()),
        ("fresh_depth", (&fresh.depth).into()),
        ("history", (&before.marched.clouds).into()),
        ("history_depth", (&before.marched.depth).into()),
        ("history_known", (&before.known).into()),
        ("known", (&out.known).into()),
    ];
    let bindings = [scene.bindings.as_slice(), &out.marched.bindings(), &ours].concat();
    work.dispatch(&*gpu.kernel("reproject", "reproject", scene.variant)?, &bindings, [frame.width, frame.rows, 1])
}
