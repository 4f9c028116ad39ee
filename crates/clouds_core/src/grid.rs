//! Sample grid: the pixels of a picture that hold a sample of the clouds, and those that a frame marches.

use std::f32::consts::PI;

use crate::shared::constants;

constants! {
    /// Spacing of samples at low resolution, and maximum spacing of the initial grid of adaptive sampling, in pixels.
    pub(crate) const TILE: u32 = 4;
}
/// Maximum angle between samples in radians. Clouds between rays farther apart are missed: the error of `fair_weather`
/// is 11 % at 1.3 degrees, and 3 % at a third of a degree (contrast 0.1).
pub(crate) const WIDEST: f32 = 0.5 * PI / 180.0;

/// Number of frames in which an animation at full resolution marches every sample once.
pub(crate) const CYCLE: u32 = SampleGrid { size: [1; 2], low_resolution: false }.cycle();

/// Sample grid of a picture or of a strip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SampleGrid {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Whether only the corners of cells of [`TILE`] x [`TILE`] pixels hold a sample. Otherwise all pixels do.
    pub low_resolution: bool,
}

impl SampleGrid {
    /// Spacing of samples in pixels.
    pub fn spacing(&self) -> u32 {
        if self.low_resolution { TILE } else { 1 }
    }

    /// Number of samples, across and down. At low resolution samples extend up to a cell beyond the right and lower
    /// edges, so that each pixel lies between four.
    pub fn samples(&self) -> [u32; 2] {
        if self.low_resolution { self.size.map(|pixels| pixels.div_ceil(TILE) + 1) } else { self.size }
    }

    /// Number of samples along each side of a cell of temporal reprojection. A frame marches one sample of each cell.
    pub const fn stride(&self) -> u32 {
        if self.low_resolution { 2 } else { 4 }
    }

    /// Number of frames in which every sample is marched once.
    pub const fn cycle(&self) -> u32 {
        self.stride() * self.stride()
    }

    /// Number of cells of temporal reprojection, across and down.
    pub fn cells(&self) -> [u32; 2] {
        self.samples().map(|samples| samples.div_ceil(self.stride()))
    }

    /// Offset in pixels of the sample of a cell that frame `index` marches.
    pub fn subpixel(&self, index: u32) -> [u32; 2] {
        // The first four entries are the corners of the cell's quarters: a cell at low resolution has these four
        // samples alone, TILE pixels apart.
        let scale = if self.low_resolution { 2 } else { 1 };
        ORDER[(index % self.cycle()) as usize].map(|place| scale * place)
    }

    /// Grid of a strip of `rows` rows.
    pub fn strip(&self, rows: u32) -> Self {
        Self { size: [self.size[0], rows], ..*self }
    }
}

/// Order in which the sixteen samples of a cell are marched, as offsets in the cell: a Bayer matrix, so that
/// consecutive samples are distributed over the cell.
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
