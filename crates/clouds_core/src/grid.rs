//! Which pixels hold a sample: those of a whole picture, or the corners of cells of one that is sparse; and which of them a
//! frame marches.

use std::f32::consts::PI;

use crate::shared::constants;

constants! {
    /// Pixels from one corner of a cell to the next: the distance of the pixels that are marched first, at most.
    pub(crate) const TILE: u32 = 4;
}
/// The same distance as an angle, radians. Clouds are lost between rays farther apart: at 1.3 degrees `fair_weather`
/// errs by 11 %, at a third of one by 3 % (contrast 0.1).
pub(crate) const WIDEST: f32 = 0.5 * PI / 180.0;

/// How many pixels of a picture, or of a sheet, the clouds are known at.
pub(crate) fn known(size: [u32; 2], sparse: bool) -> [u32; 2] {
    if sparse { size.map(|pixels| pixels.div_ceil(TILE) + 1) } else { size }
}

/// Pixels from one of those to the next.
pub(crate) fn spacing(sparse: bool) -> u32 {
    if sparse { TILE } else { 1 }
}

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
pub(crate) const fn cycle(sparse: bool) -> u32 {
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
    ORDER[(index % cycle(sparse)) as usize].map(|place| scale * place)
}
