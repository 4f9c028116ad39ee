//! Plan of a picture: integrator, sample grid, strips and specialization. It depends on shot, quality and target alone.

use std::ops::Range;
use std::sync::Arc;

use crate::field::Due;
use crate::frame::Frame;
use crate::gpu::Specialization;
use crate::grid::TILE;
use crate::luts::Inputs;
use crate::params::{Integrator, Params, Quality};
use crate::passes::display::Screen;
use crate::passes::{composite, refine};
use crate::shot::Shot;
use crate::specialization;

impl Integrator {
    /// Whether nothing is integrated: a sky without clouds, by the march. The other integrators run on every sky.
    pub(crate) fn is_cloudless(self, params: &Params) -> bool {
        self == Self::March && !params.has_clouds()
    }
}

/// Target of a frame.
#[derive(Clone, Copy)]
pub(crate) enum Target<'a> {
    /// Still. `layers`: background, depth and statistics are outputs too. `first_sample`: index of the first path of
    /// each pixel.
    Still { layers: bool, first_sample: u32 },
    /// Next frame of an animation, to a screen or, without one, to memory.
    Animation(Option<&'a Screen>),
}

impl Target<'_> {
    /// Whether the target is an animation, whose frames have a history.
    pub fn is_animation(self) -> bool {
        matches!(self, Self::Animation(_))
    }

    /// Whether the layers besides the image are outputs.
    pub fn layers(self) -> bool {
        matches!(self, Self::Still { layers: true, .. })
    }
}

/// Maximum number of pixels of a strip of a still: it limits the buffers, of 64 bytes per pixel.
const STRIP_PIXELS: u32 = 1 << 20;
/// Maximum number of rays of a strip for integrators whose rays take many dispatches.
const STRIP_RAYS: u32 = 1 << 14;

/// Plan of a picture.
pub(crate) struct Plan {
    pub integrator: Integrator,
    /// Whether the background is evaluated at the corners of cells and interpolated where it is smooth.
    pub by_cells: bool,
    /// Adaptive sampling: whether pixels between samples of low contrast are interpolated (passes/refine).
    adaptive: bool,
    height: u32,
    /// Range of rows of each strip.
    pub strips: Vec<Range<u32>>,
    pub specialization: Arc<Specialization>,
}

impl Plan {
    /// Plan of a picture for a target. Sets `cloudless` and the sample grid of `frame`. An animation has one strip.
    pub fn new(frame: &mut Frame, params: &Params, quality: &Quality, target: Target<'_>) -> Self {
        let integrator = quality.integrator_of(params);
        let march = integrator == Integrator::March;
        frame.cloudless = integrator.is_cloudless(params);
        frame.grid.low_resolution = march && refine::is_low_resolution(frame, quality);
        let rows = match integrator {
            _ if target.is_animation() => frame.view.height,
            Integrator::March => (STRIP_PIXELS / frame.view.width).next_multiple_of(TILE),
            Integrator::Reference | Integrator::Path => STRIP_RAYS / frame.view.width,
        };
        let rows = rows.clamp(1, frame.view.height);
        let strips = (0..frame.view.height).step_by(rows as usize).map(|row| row..(row + rows).min(frame.view.height));
        Self {
            integrator,
            by_cells: march && composite::by_cells(frame, quality),
            adaptive: march && refine::is_needed(frame, quality),
            height: frame.view.height,
            strips: strips.collect(),
            specialization: specialization::of_picture(params, quality, frame, target.layers()),
        }
    }

    /// Inputs of the LUTs. `params` has the values at the time of the shot.
    pub fn inputs<'a>(
        &self,
        shot: &Shot<'_>,
        params: &'a Params,
        quality: &'a Quality,
        frame: &'a Frame,
        field: Due,
    ) -> Inputs<'a> {
        let specialization = self.specialization.clone();
        Inputs { params, quality, frame, eye: shot.camera.eye, time: shot.time, specialization, field }
    }

    /// Number of rows in the buffers of a strip: its own and, with adaptive sampling, the first row of the next strip,
    /// whose samples both strips use.
    fn rows(&self, strip: &Range<u32>) -> u32 {
        strip.len() as u32 + u32::from(self.adaptive && strip.end < self.height)
    }

    /// Sets the range of rows of a strip.
    pub fn set_strip(&self, frame: &mut Frame, strip: &Range<u32>) {
        frame.dispatch.strip_row = strip.start;
        frame.dispatch.rows = strip.len() as u32;
        frame.dispatch.strip_rows = self.rows(strip);
    }

    /// Maximum number of rows in the buffers of a strip.
    pub fn max_rows(&self) -> u32 {
        self.strips.iter().map(|strip| self.rows(strip)).max().unwrap_or(1)
    }
}
