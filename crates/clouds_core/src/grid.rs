//! The sample grid: which pixels of a picture hold a sample of the clouds, and which of those a frame marches.

use std::f32::consts::PI;

use crate::shared::constants;

constants! {
    /// Pixels from one sample to the next at low resolution, and the largest spacing that adaptive sampling begins with.
    pub(crate) const TILE: u32 = 4;
}
/// Largest angle between samples, radians. Clouds are lost between rays farther apart: at 1.3 degrees `fair_weather`
/// errs by 11 %, at a third of one by 3 % (contrast 0.1).
pub(crate) const WIDEST: f32 = 0.5 * PI / 180.0;

/// Frames in which an animation at full resolution marches every sample once.
pub(crate) const CYCLE: u32 = SampleGrid { size: [1; 2], low_resolution: false }.cycle();

/// Samples of a picture, or of a strip of one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SampleGrid {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// The corners of cells of [`TILE`] x [`TILE`] pixels hold a sample, not all pixels.
    pub low_resolution: bool,
}

impl SampleGrid {
    /// Pixels from one sample to the next.
    pub fn spacing(&self) -> u32 {
        if self.low_resolution { TILE } else { 1 }
    }

    /// Columns and rows of samples. At low resolution they reach a cell beyond the right and lower edges, so that each pixel
    /// lies between four.
    pub fn samples(&self) -> [u32; 2] {
        if self.low_resolution { self.size.map(|pixels| pixels.div_ceil(TILE) + 1) } else { self.size }
    }

    /// Samples along each side of a cell of temporal reprojection, of which a frame marches one.
    pub const fn stride(&self) -> u32 {
        if self.low_resolution { 2 } else { 4 }
    }

    /// Frames in which every sample is marched once.
    pub const fn cycle(&self) -> u32 {
        self.stride() * self.stride()
    }

    /// Columns and rows of those cells.
    pub fn cells(&self) -> [u32; 2] {
        self.samples().map(|samples| samples.div_ceil(self.stride()))
    }

    /// The pixel of a cell that the frame of a number marches.
    pub fn subpixel(&self, index: u32) -> [u32; 2] {
        // The first four are the corners of quarters of the cell; cells of low resolution are twice as wide.
        let scale = if self.low_resolution { 2 } else { 1 };
        ORDER[(index % self.cycle()) as usize].map(|place| scale * place)
    }

    /// The grid of a strip of so many rows.
    pub fn strip(&self, rows: u32) -> Self {
        Self { size: [self.size[0], rows], ..*self }
    }
}

/// Order in which the sixteen samples of a cell are marched: a Bayer matrix, so that any few consecutive ones are spread over
/// the cell.
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
