//! Render targets: buffers that a picture is rendered to, reused by the pictures after it.

use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::grid::SampleGrid;
use crate::params::Integrator;
use crate::passes::clouds::CloudBuffers;
use crate::passes::composite::{Background, Output, Parts};
use crate::passes::rays::Rays;
use crate::passes::refine::RayList;
use crate::passes::reproject::{self, Current, HistoryBuffers};
use crate::passes::{path, reference};
use crate::plan::Plan;
use crate::scene_depth::SceneTextures;

/// Buffers of the strips of a still, or of the frames of an animation.
pub(crate) struct Targets {
    pub grid: SampleGrid,
    integrator: Integrator,
    pub ray_list: RayList,
    /// Clouds of this picture; in an animation with history lengths.
    pub now: HistoryBuffers,
    pub background: Background,
    pub output: Output,
    /// Ray states of the reference integrator and of path tracing.
    pub rays: Option<Rays>,
    pub temporal: Option<Temporal>,
}

/// Buffers of temporal reprojection.
pub(crate) struct Temporal {
    pub current: Current,
    /// Clouds of the previous frame.
    pub before: HistoryBuffers,
    /// User's scene in the previous frame.
    pub scene_before: SceneTextures,
}

impl Targets {
    fn new(gpu: &Gpu, grid: SampleGrid, integrator: Integrator, animated: bool) -> Self {
        let [pixels, samples, cells] = [grid.size, grid.samples(), grid.cells()].map(count);
        let ray_bytes = match integrator {
            Integrator::March => None,
            Integrator::Reference => Some(reference::RAY_BYTES),
            Integrator::Path => Some(path::RAY_BYTES),
        };
        let temporal = || Temporal {
            current: Current::new(gpu, cells),
            before: HistoryBuffers::new(gpu, samples, samples),
            scene_before: SceneTextures::new(gpu, 0, false),
        };
        Self {
            grid,
            integrator,
            ray_list: RayList::new(gpu, samples),
            now: HistoryBuffers::new(gpu, samples, if animated { samples } else { 0 }),
            background: Background::new(gpu, grid.size),
            output: Output::new(gpu, pixels),
            rays: ray_bytes.map(|bytes| Rays::new(gpu, pixels, bytes)),
            temporal: animated.then(temporal),
        }
    }

    /// Buffers for the strips of a plan: the stored ones if they fit, else new ones. The second result has the buffers
    /// of the previous frame of an animation whose sample grid has changed.
    pub fn fit<'a>(
        stored: &'a mut Option<Self>,
        gpu: &Gpu,
        frame: &Frame,
        plan: &Plan,
        animated: bool,
    ) -> (&'a mut Self, Option<Self>) {
        let grid = frame.grid.strip(plan.max_rows());
        let fits = |old: &Self| {
            let same = old.grid.strip(0) == grid.strip(0) && old.integrator == plan.integrator;
            same && if animated { old.grid == grid } else { old.grid.size[1] >= grid.size[1] }
        };
        let old = stored.take_if(|old| !fits(old)).filter(|_| animated);
        (stored.get_or_insert_with(|| Self::new(gpu, grid, plan.integrator, animated)), old)
    }

    /// Buffers of the marched clouds.
    pub fn clouds(&self) -> &CloudBuffers {
        &self.now.cloud_buffers
    }

    /// Buffers of the composite pass.
    pub fn parts(&self) -> Parts<'_> {
        let Self { now, background, ray_list, output, .. } = self;
        Parts { cloud_buffers: &now.cloud_buffers, background_corners: background, ray_list, out: output }
    }

    /// Buffers of temporal reprojection; None for a still. `resized` has those of a previous frame on another grid.
    pub fn reprojection<'a>(&'a self, resized: Option<&'a Self>) -> Option<reproject::Buffers<'a>> {
        let Self { ray_list, now, temporal, .. } = self;
        let Temporal { current, before, scene_before } = temporal.as_ref()?;
        let resized = resized.and_then(|old| old.temporal.as_ref()).map(|old| &old.before);
        Some(reproject::Buffers { ray_list, current, before, resized, scene_before, now })
    }

    /// Bindings of all buffers, by name.
    pub fn bindings(&self) -> Bindings {
        let Self { ray_list, now, background, output, rays, temporal, .. } = self;
        let rays = rays.as_ref().map_or(Vec::new(), |rays| rays.bindings("rays"));
        let shared = [ray_list.bindings(), output.bindings(), background.bindings(), rays].concat();
        let Some(Temporal { current, before, scene_before }) = temporal else {
            return [now.cloud_buffers.bindings(), shared].concat();
        };
        let scene = vec![("scene_before", scene_before.depth())];
        [current.bindings(), shared, scene, before.bindings(), now.bindings()].concat()
    }
}

/// Number of elements of a 2D grid.
pub(crate) fn count(size: [u32; 2]) -> u64 {
    size.map(u64::from).iter().product()
}
