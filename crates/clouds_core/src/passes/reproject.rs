//! Temporal reprojection: one pixel in sixteen is marched, the others come from the history. At low resolution, where
//! one pixel in sixteen holds a sample, one sample in four is marched.

use super::clouds::CloudBuffers;
use super::march;
use super::refine::{self, RayList};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::gpu::Recorder;
use crate::gpu::{Binding, Bindings};
use crate::params::Quality;
use crate::scene_depth::SceneTextures;
use crate::uniforms::Dispatch;

/// Maximum fraction of the samples of a frame in the ray list. Beyond it a still, which lists an eighth to a fifth of
/// them, is more accurate and takes no longer.
const MAX_LISTED: f32 = 1.0 / 12.0;

/// Clouds of a frame and their history lengths.
pub(crate) struct HistoryBuffers {
    pub cloud_buffers: CloudBuffers,
    /// History length by sample: number of frames since it was interpolated, or a whole cycle once it has been marched.
    pub length: wgpu::Buffer,
}

impl HistoryBuffers {
    /// Buffers of `samples` samples and `lengths` history lengths. A still has no history lengths.
    pub fn new(gpu: &Gpu, samples: u64, lengths: u64) -> Self {
        Self { cloud_buffers: CloudBuffers::new(gpu, samples), length: gpu.buffer("followed", 4 * lengths) }
    }

    pub fn bindings(&self) -> Bindings {
        [self.cloud_buffers.bindings(), vec![("followed", (&self.length).into())]].concat()
    }

    /// Bindings as the history of the next frame.
    fn past(&self) -> Bindings {
        vec![
            ("history", (&self.cloud_buffers.clouds).into()),
            ("history_depth", (&self.cloud_buffers.depth).into()),
            ("history_length", (&self.length).into()),
        ]
    }
}

/// Current rays, one per cell, and their predictions from the history.
pub(crate) struct Current {
    cloud_buffers: CloudBuffers,
    cells: wgpu::Buffer,
    /// Votes for a still minus votes against it.
    votes: wgpu::Buffer,
    /// Other than 0 if the frame is a still.
    still: wgpu::Buffer,
}

/// Size of `CellPast` of bindings.wgsl in bytes.
const CELL_BYTES: u64 = 64;

impl Current {
    pub fn new(gpu: &Gpu, cells: u64) -> Self {
        Self {
            cloud_buffers: CloudBuffers::new(gpu, cells),
            cells: gpu.buffer("cells", CELL_BYTES * cells),
            votes: gpu.buffer("votes", 4),
            still: gpu.buffer("is_still", 4),
        }
    }

    /// Bindings as targets of the march, and of the predictions.
    pub fn bindings(&self) -> Bindings {
        [self.cloud_buffers.bindings(), self.own()].concat()
    }

    /// Bindings of predictions and votes.
    fn own(&self) -> Bindings {
        vec![("cells", (&self.cells).into()), ("votes", (&self.votes).into()), ("is_still", (&self.still).into())]
    }

    /// Bindings as inputs of reprojection.
    fn read(&self) -> Bindings {
        let rays = vec![
            ("current", (&self.cloud_buffers.clouds).into()),
            ("current_depth", (&self.cloud_buffers.depth).into()),
        ];
        [rays, self.own()].concat()
    }
}

/// Buffers of a frame of an animation.
pub(crate) struct Buffers<'a> {
    pub ray_list: &'a RayList,
    pub current: &'a Current,
    /// Clouds of the previous frame.
    pub before: &'a HistoryBuffers,
    /// Clouds of the previous frame on another sample grid, if it has changed.
    pub resized: Option<&'a HistoryBuffers>,
    /// User's scene in the previous frame.
    pub scene_before: &'a SceneTextures,
    /// Clouds of this frame.
    pub now: &'a HistoryBuffers,
}

/// Records a frame of an animation. `previous` is the index of the previous frame since the last cut. Without one the
/// frame is a still, the history of the frames after it.
pub(crate) fn record(
    rec: &mut Recorder<'_>,
    frame: &Frame,
    quality: &Quality,
    previous: Option<u32>,
    buffers: &Buffers<'_>,
) {
    if let Some(old) = buffers.resized {
        rescale(rec, frame, old, buffers.before);
    }
    let Some(previous) = previous else {
        rec.compile_ahead(|rec| reproject(rec, frame, quality, 0, buffers));
        return still(rec, frame, quality, buffers.ray_list, buffers.now);
    };
    reproject(rec, frame, quality, previous + 1, buffers);
}

/// Records a frame from one ray per cell and the history, or a still if the history is invalid in too many samples.
/// `index` counts frames since the last cut.
fn reproject(rec: &mut Recorder<'_>, frame: &Frame, quality: &Quality, index: u32, buffers: &Buffers<'_>) {
    let gpu = rec.gpu;
    let Buffers { ray_list, current, before, now, .. } = *buffers;
    let stride = frame.grid.stride();
    let [width, height] = frame.grid.samples();
    let rays = frame.at_rays(index);
    march::record(rec, &rays, quality, ray_list, &current.cloud_buffers);

    // Predictions of these rays from the history, and their validation.
    let block = rays.dispatch.binding(gpu);
    let grid = [rays.dispatch.march_width, rays.dispatch.strip_rows, 1];
    let read = [before.past(), current.read(), vec![block.clone()]].concat();
    rec.clear(&current.votes);
    rec.dispatch(("reproject", "predict"), read.clone(), grid);
    rec.dispatch(("reproject", "validate"), read.clone(), grid);

    // Samples are reprojected or interpolated. Those without valid history between rays of high contrast are listed.
    let scene_before = vec![("scene_before", buffers.scene_before.depth())];
    let read = [before.past(), current.read(), scene_before, now.bindings(), ray_list.bindings()].concat();
    let [columns, rows] = [rays.dispatch.march_width, height.div_ceil(stride)];
    rec.clear(&ray_list.count);
    rec.dispatch_rows(("reproject", "reproject"), &read, [columns, rows], |slice| {
        let (first_row, rows) = (stride * slice.start, stride * slice.len() as u32);
        let rows = rows.min(height - first_row);
        Dispatch { first_row, rows, ..rays.dispatch.clone() }.binding(gpu)
    });

    // The frame is a still if more than a fourth of the predictions fail, or if more samples are listed than a still
    // marches.
    let listed = frame.at_samples();
    let pixels = width * height;
    let most = if refine::is_needed(&listed, quality) { MAX_LISTED * pixels as f32 } else { f32::MAX };
    let ours = [current.own(), ray_list.bindings(), vec![("most_listed", Binding::block(&[most.to_bits(), 0, 0, 0]))]];
    rec.dispatch(("reproject", "choose"), ours.concat(), [1; 3]);
    march::list(rec, &listed, pixels, MAX_LISTED.into(), ray_list, &now.cloud_buffers);
    rec.when(&current.still, |rec| still(rec, frame, quality, ray_list, now));
}

/// Records a still that is the history of the frames after it.
fn still(rec: &mut Recorder<'_>, frame: &Frame, quality: &Quality, ray_list: &RayList, out: &HistoryBuffers) {
    let mut frame = frame.at_samples();
    march::record(rec, &frame, quality, ray_list, &out.cloud_buffers);
    frame.dispatch.grid_spacing = refine::coarsest(&frame, quality);
    let bindings = [vec![frame.dispatch.binding(rec.gpu)], out.bindings()].concat();
    let [width, height] = frame.grid.samples();
    rec.dispatch(("reproject", "begin"), bindings, [width, height, 1]);
}

/// Resamples the history `before` of another size or sample spacing to the sample grid of `frame`.
fn rescale(rec: &mut Recorder<'_>, frame: &Frame, before: &HistoryBuffers, out: &HistoryBuffers) {
    let bindings = [vec![frame.dispatch.binding(rec.gpu)], out.bindings(), before.past()].concat();
    let [width, height] = frame.grid.samples();
    rec.dispatch(("reproject", "rescale"), bindings, [width, height, 1]);
}
