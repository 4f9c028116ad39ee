//! What a picture needs: which integrator, which pixels hold a sample, in which strips. It follows from the picture alone.

use std::ops::Range;
use std::sync::Arc;

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
    /// Whether a sky has no clouds to march.
    pub(crate) fn is_cloudless(self, params: &Params) -> bool {
        self == Self::March && !params.has_clouds()
    }
}

/// What a frame is for.
#[derive(Clone, Copy)]
pub(crate) enum Target<'a> {
    /// A still, with its layers or without. The path of each pixel that is traced first has that number.
    Still { layers: bool, first_sample: u32 },
    /// The next frame of an animation: onto a screen or, without one, to memory.
    Animation(Option<&'a Screen>),
}

impl Target<'_> {
    /// Whether the frame has a history.
    pub fn is_animation(self) -> bool {
        matches!(self, Self::Animation(_))
    }

    /// Whether the sky and the depth are asked for too.
    pub fn layers(self) -> bool {
        matches!(self, Self::Still { layers: true, .. })
    }
}

/// Most pixels of a strip, which is as much of a still as the device holds: 64 bytes each.
const STRIP_PIXELS: u32 = 1 << 20;
/// Most rays that are on their way together where they take many dispatches.
const STRIP_RAYS: u32 = 1 << 14;

/// What a picture needs.
pub(crate) struct Plan {
    pub integrator: Integrator,
    /// Whether what is behind the clouds is worked out by cells.
    pub by_cells: bool,
    /// Whether pixels between marched ones are interpolated where they look alike (passes/refine).
    adaptive: bool,
    height: u32,
    /// Rows of each strip.
    pub strips: Vec<Range<u32>>,
    pub specialization: Arc<Specialization>,
}

impl Plan {
    /// The plan of a picture for a target, which completes its `frame`. Frames of an animation have one strip.
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

    /// What its LUTs are made from, of a shot whose sky has its values at that time.
    pub fn inputs<'a>(
        &self,
        shot: &Shot<'_>,
        params: &'a Params,
        quality: &'a Quality,
        frame: &'a Frame,
    ) -> Inputs<'a> {
        let specialization = self.specialization.clone();
        Inputs { params, quality, frame, eye: shot.camera.eye, time: shot.time, specialization }
    }

    /// Rows that the buffers of a strip hold: its own, and, where samples are shared between strips, the first of the next.
    fn rows(&self, strip: &Range<u32>) -> u32 {
        strip.len() as u32 + u32::from(self.adaptive && strip.end < self.height)
    }

    /// Sets the rows of a strip.
    pub fn set_strip(&self, frame: &mut Frame, strip: &Range<u32>) {
        frame.dispatch.strip_row = strip.start;
        frame.dispatch.rows = strip.len() as u32;
        frame.dispatch.strip_rows = self.rows(strip);
    }

    /// Most rows that the buffers of a strip hold.
    pub fn most_rows(&self) -> u32 {
        self.strips.iter().map(|strip| self.rows(strip)).max().unwrap_or(1)
    }
}
