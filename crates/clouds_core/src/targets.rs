//! What a picture is made in: buffers kept from one to the next.

use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::grid::SampleGrid;
use crate::passes::clouds::CloudBuffers;
use crate::passes::composite::{Background, Output};
use crate::passes::rays::Rays;
use crate::passes::refine::RayList;
use crate::passes::reproject::{Current, HistoryBuffers};
use crate::passes::{path, reference};
use crate::plan::Integrator;
use crate::scene_depth::SceneTextures;

/// Buffers of the strips of a still.
pub(crate) struct StillTargets {
    grid: SampleGrid,
    integrator: Integrator,
    pub ray_list: RayList,
    pub cloud_buffers: CloudBuffers,
    pub output: Output,
    pub background_corners: Background,
    pub rays: Option<Rays>,
}

impl StillTargets {
    fn new(gpu: &Gpu, grid: SampleGrid, integrator: Integrator) -> Self {
        let [pixels, samples] = [grid.size, grid.samples()].map(count);
        let ray_bytes = match integrator {
            Integrator::March => None,
            Integrator::Reference => Some(reference::RAY_BYTES),
            Integrator::Path => Some(path::RAY_BYTES),
        };
        Self {
            grid,
            integrator,
            ray_list: RayList::new(gpu, samples),
            cloud_buffers: CloudBuffers::new(gpu, samples),
            output: Output::new(gpu, pixels),
            background_corners: Background::new(gpu, grid.size),
            rays: ray_bytes.map(|bytes| Rays::new(gpu, pixels, bytes)),
        }
    }

    /// Those of a strip: the same as before where it has room in them.
    pub fn fit<'a>(kept: &'a mut Option<Self>, gpu: &Gpu, frame: &Frame, integrator: Integrator) -> &'a Self {
        let grid = frame.grid.strip(frame.dispatch.strip_rows);
        let fits = |old: &Self| {
            let same = old.grid.strip(0) == grid.strip(0) && old.integrator == integrator;
            same && old.grid.size[1] >= grid.size[1]
        };
        if !kept.as_ref().is_some_and(fits) {
            *kept = None;
        }
        kept.get_or_insert_with(|| Self::new(gpu, grid, integrator))
    }

    /// What is kept on the device.
    pub fn bindings(&self) -> Bindings {
        let rays = self.rays.as_ref().map_or(Vec::new(), |rays| rays.bindings("rays"));
        let Self { cloud_buffers, ray_list, output, background_corners, .. } = self;
        [cloud_buffers.bindings(), ray_list.bindings(), output.bindings(), background_corners.bindings(), rays].concat()
    }
}

/// Buffers of whole pictures, and what the frame before has left in them.
pub(crate) struct TemporalTargets {
    pub grid: SampleGrid,
    pub ray_list: RayList,
    pub current: Current,
    pub before: HistoryBuffers,
    pub now: HistoryBuffers,
    pub output: Output,
    pub background_corners: Background,
    /// The user's scene in the frame before.
    pub scene_before: SceneTextures,
}

impl TemporalTargets {
    pub fn new(gpu: &Gpu, grid: SampleGrid) -> Self {
        let [samples, cells] = [grid.samples(), grid.cells()].map(count);
        Self {
            grid,
            ray_list: RayList::new(gpu, samples),
            current: Current::new(gpu, cells),
            before: HistoryBuffers::new(gpu, samples),
            now: HistoryBuffers::new(gpu, samples),
            output: Output::new(gpu, count(grid.size)),
            background_corners: Background::new(gpu, grid.size),
            scene_before: SceneTextures::new(gpu, 0, false),
        }
    }

    /// What is kept on the device.
    pub fn bindings(&self) -> Bindings {
        let Self { ray_list, current, before, now, output, background_corners, scene_before, .. } = self;
        let scene = vec![("scene_before", scene_before.depth())];
        let ours = [current.bindings(), ray_list.bindings(), output.bindings(), background_corners.bindings(), scene];
        [ours.concat(), before.bindings(), now.bindings()].concat()
    }
}

/// Buffers for a frame, and those of the frame before where it had another size or was known at other pixels.
pub(crate) fn fit_temporal<'a>(
    kept: &'a mut Option<TemporalTargets>,
    gpu: &Gpu,
    frame: &Frame,
) -> (&'a mut TemporalTargets, Option<TemporalTargets>) {
    let old = kept.take_if(|old| old.grid != frame.grid);
    (kept.get_or_insert_with(|| TemporalTargets::new(gpu, frame.grid)), old)
}

pub(crate) fn count(size: [u32; 2]) -> u64 {
    size.map(u64::from).iter().product()
}
