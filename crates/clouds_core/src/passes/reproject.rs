//! Temporal reprojection: one pixel in sixteen is marched, the others come from the frame before. Of a sparse picture, whose
//! clouds are known at one pixel in sixteen, one in four of those is.

use super::march::Marched;
use super::refine::Refined;
use super::{Bindings, Scene};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Gpu, Work};
use crate::scene_depth::SceneTextures;

/// One of this many pixels that are known is marched in a frame, in each direction.
pub(crate) const fn stride(sparse: bool) -> u32 {
    if sparse { 2 } else { 4 }
}

/// The order in which the sixteen pixels of a cell are marched: a Bayer matrix, so that any few of them in a row are
/// spread over the cell.
const ORDER: [[u32; 2]; 16] = [
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

/// Frames in which every pixel that is known is marched once.
pub(crate) const fn round(sparse: bool) -> u32 {
    stride(sparse) * stride(sparse)
}

/// Cells of a picture of so many known pixels.
pub(crate) fn cells(known: [u32; 2], sparse: bool) -> [u32; 2] {
    known.map(|pixels| pixels.div_ceil(stride(sparse)))
}

/// The pixel of a cell that a frame marches.
pub(crate) fn subpixel(index: u32, sparse: bool) -> [u32; 2] {
    // The first four are the corners of quarters of the cell, and sparse cells twice as wide.
    let scale = if sparse { 2 } else { 1 };
    ORDER[(index % round(sparse)) as usize].map(|place| scale * place)
}

/// A frame, and what it rests on.
pub(crate) struct Followed {
    pub marched: Marched,
    /// Frames that each pixel has been followed since it was interpolated, or all of a round once it has had a ray of its own.
    pub length: wgpu::Buffer,
}

impl Followed {
    pub fn new(gpu: &Gpu, pixels: u64) -> Self {
        Self { marched: Marched::new(gpu, pixels), length: gpu.buffer("followed", 4 * pixels) }
    }

    pub fn bindings(&self) -> Bindings<'_> {
        [self.marched.bindings(), vec![("followed", (&self.length).into())]].concat()
    }

    /// As the frame before.
    fn past(&self) -> Bindings<'_> {
        vec![
            ("history", (&self.marched.clouds).into()),
            ("history_depth", (&self.marched.depth).into()),
            ("history_length", (&self.length).into()),
        ]
    }
}

/// The rays of a frame, one in each cell, and what the frame before says of them.
pub(crate) struct Current {
    pub marched: Marched,
    cells: wgpu::Buffer,
}

/// Bytes of `CellPast` (bindings.wgsl).
const CELL_BYTES: u64 = 64;

impl Current {
    pub fn new(gpu: &Gpu, cells: u64) -> Self {
        Self { marched: Marched::new(gpu, cells), cells: gpu.buffer("cells", CELL_BYTES * cells) }
    }

    /// What is kept of them on the device.
    pub fn bindings(&self) -> Bindings<'_> {
        [self.marched.bindings(), vec![("cells", (&self.cells).into())]].concat()
    }

    fn read(&self) -> Bindings<'_> {
        vec![
            ("fresh", (&self.marched.clouds).into()),
            ("fresh_depth", (&self.marched.depth).into()),
            ("cells", (&self.cells).into()),
        ]
    }
}

/// The frame before.
pub(crate) struct History<'a> {
    /// Its clouds.
    pub clouds: &'a Followed,
    /// The user's scene in it.
    pub scene: &'a SceneTextures,
}

/// Makes `out`, a still, the history of the frames after it.
pub(crate) fn begin(gpu: &Gpu, work: &mut Work<'_>, scene: &Scene<'_>, frame: &Frame, out: &Followed) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &out.bindings()].concat();
    let [width, height] = frame.known();
    work.dispatch(&*gpu.kernel("reproject", "begin", scene.variant)?, &bindings, [width, height, 1])
}

/// Asks the frame `before` for the rays of this one, and compares: `refined` counts votes for a still, less those for going on.
pub(crate) fn validate(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    current: &Current,
    before: &History<'_>,
    refined: &Refined,
) -> Result<()> {
    let ours = [before.clouds.past(), current.read(), refined.bindings()].concat();
    let bindings = [scene.bindings.as_slice(), &ours].concat();
    for entry in ["predict", "validate"] {
        let kernel = gpu.kernel("reproject", entry, scene.variant)?;
        work.dispatch(&kernel, &bindings, [frame.march_width, frame.sheet_rows, 1])?;
    }
    Ok(())
}

/// Fills `out` from the `current` rays and from the frame `before`, for the band of `frame`; lists in `refined` the pixels
/// that are to be marched, as neither says anything about them.
#[expect(clippy::too_many_arguments, reason = "what fills a frame")]
pub(crate) fn run(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    current: &Current,
    before: &History<'_>,
    refined: &Refined,
    out: &Followed,
) -> Result<()> {
    let past = [before.clouds.past(), vec![("scene_before", before.scene.depth())]].concat();
    let ours = [past, out.bindings(), refined.bindings(), current.read()].concat();
    let bindings = [scene.bindings.as_slice(), &ours].concat();
    work.dispatch(
        &*gpu.kernel("reproject", "reproject", scene.variant)?,
        &bindings,
        [frame.march_width, frame.rows.div_ceil(stride(frame.sparse > 0)), 1],
    )
}

/// Makes of the frame `before`, which had another size or was known at other pixels, one like `frame`.
pub(crate) fn rescale(
    gpu: &Gpu,
    work: &mut Work<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    before: &Followed,
    out: &Followed,
) -> Result<()> {
    let bindings = [scene.bindings.as_slice(), &out.bindings(), &before.past()].concat();
    let [width, height] = frame.known();
    work.dispatch(&*gpu.kernel("reproject", "rescale", scene.variant)?, &bindings, [width, height, 1])
}
