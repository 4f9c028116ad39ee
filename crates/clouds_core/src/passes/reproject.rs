//! Temporal reprojection: one pixel in sixteen is marched, the others come from the frame before. Of a sparse picture, whose
//! clouds are known at one pixel in sixteen, one in four of those is.

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

/// Largest share of the pixels of a frame that are marched one by one: a still, which marches an eighth to a fifth of them, is
/// nearer to the truth then and takes no longer.
const MOST_LISTED: f32 = 1.0 / 12.0;

/// A frame, and what it rests on.
pub(crate) struct HistoryBuffers {
    pub cloud_buffers: CloudBuffers,
    /// Frames that each pixel has been followed since it was interpolated, or all of a round once it has had a ray of its own.
    pub length: wgpu::Buffer,
}

impl HistoryBuffers {
    /// Buffers of so many samples, and of so many history lengths: a still has none.
    pub fn new(gpu: &Gpu, samples: u64, lengths: u64) -> Self {
        Self { cloud_buffers: CloudBuffers::new(gpu, samples), length: gpu.buffer("followed", 4 * lengths) }
    }

    pub fn bindings(&self) -> Bindings {
        [self.cloud_buffers.bindings(), vec![("followed", (&self.length).into())]].concat()
    }

    /// As the frame before.
    fn past(&self) -> Bindings {
        vec![
            ("history", (&self.cloud_buffers.clouds).into()),
            ("history_depth", (&self.cloud_buffers.depth).into()),
            ("history_length", (&self.length).into()),
        ]
    }
}

/// The rays of a frame, one in each cell, and what the frame before says of them.
pub(crate) struct Current {
    cloud_buffers: CloudBuffers,
    cells: wgpu::Buffer,
    /// Votes for a still less those for going on.
    votes: wgpu::Buffer,
    /// Not 0 where the frame is a still.
    still: wgpu::Buffer,
}

/// Bytes of `CellPast` (bindings.wgsl).
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

    /// What is kept of them on the device.
    pub fn bindings(&self) -> Bindings {
        [self.cloud_buffers.bindings(), self.own()].concat()
    }

    fn own(&self) -> Bindings {
        vec![("cells", (&self.cells).into()), ("votes", (&self.votes).into()), ("is_still", (&self.still).into())]
    }

    fn read(&self) -> Bindings {
        let rays = vec![
            ("current", (&self.cloud_buffers.clouds).into()),
            ("current_depth", (&self.cloud_buffers.depth).into()),
        ];
        [rays, self.own()].concat()
    }
}

/// What a frame is made in, and from.
pub(crate) struct Buffers<'a> {
    pub ray_list: &'a RayList,
    pub current: &'a Current,
    /// The clouds of the frame before.
    pub before: &'a HistoryBuffers,
    /// Clouds of the frame before where its sample grid was another.
    pub resized: Option<&'a HistoryBuffers>,
    /// The user's scene in the frame before.
    pub scene_before: &'a SceneTextures,
    pub now: &'a HistoryBuffers,
}

/// Records a frame: the first one, a still that is the history of those after it, or the one after a frame `previous`, by
/// its number since the last cut.
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
        rec.compile_ahead(|rec| follow(rec, frame, quality, 0, buffers));
        return begin(rec, frame, quality, buffers.ray_list, buffers.now);
    };
    follow(rec, frame, quality, previous + 1, buffers);
}

/// Records a frame of one ray in each cell and of the history; or a still, where the history is invalid in too many pixels.
/// `index` counts frames since the last cut.
fn follow(rec: &mut Recorder<'_>, frame: &Frame, quality: &Quality, index: u32, buffers: &Buffers<'_>) {
    let gpu = rec.gpu;
    let Buffers { ray_list, current, before, now, .. } = *buffers;
    let stride = frame.grid.stride();
    let [width, height] = frame.grid.samples();
    let rays = frame.at_rays(index);
    march::record(rec, &rays, quality, ray_list, &current.cloud_buffers);

    // Asks the frame before for these rays, and compares.
    let block = rays.dispatch.binding(gpu);
    let grid = [rays.dispatch.march_width, rays.dispatch.strip_rows, 1];
    let read = [before.past(), current.read(), vec![block.clone()]].concat();
    rec.clear(&current.votes);
    rec.dispatch(("reproject", "predict"), read.clone(), grid);
    rec.dispatch(("reproject", "validate"), read.clone(), grid);

    // Follows, interpolates, or lists pixels that are to be marched, as neither rays nor past say anything about them.
    let scene_before = vec![("scene_before", buffers.scene_before.depth())];
    let read = [before.past(), current.read(), scene_before, now.bindings(), ray_list.bindings()].concat();
    let [columns, rows] = [rays.dispatch.march_width, height.div_ceil(stride)];
    rec.clear(&ray_list.count);
    rec.dispatch_rows(("reproject", "reproject"), &read, [columns, rows], |slice| {
        let (first_row, rows) = (stride * slice.start, stride * slice.len() as u32);
        let rows = rows.min(height - first_row);
        Dispatch { first_row, rows, ..rays.dispatch.clone() }.binding(gpu)
    });

    // A still, where most rays are not what the past says, or more pixels are listed than one marches.
    let listed = frame.at_samples();
    let pixels = width * height;
    let most = if refine::is_needed(&listed, quality) { MOST_LISTED * pixels as f32 } else { f32::MAX };
    let ours = [current.own(), ray_list.bindings(), vec![("most_listed", Binding::block(&[most.to_bits(), 0, 0, 0]))]];
    rec.dispatch(("reproject", "choose"), ours.concat(), [1; 3]);
    march::list(rec, &listed, pixels, MOST_LISTED.into(), ray_list, &now.cloud_buffers);
    rec.when(&current.still, |rec| begin(rec, frame, quality, ray_list, now));
}

/// Records a still that is the history of the frames after it.
fn begin(rec: &mut Recorder<'_>, frame: &Frame, quality: &Quality, ray_list: &RayList, out: &HistoryBuffers) {
    let mut still = frame.at_samples();
    march::record(rec, &still, quality, ray_list, &out.cloud_buffers);
    still.dispatch.lattice = refine::coarsest(&still, quality);
    let bindings = [vec![still.dispatch.binding(rec.gpu)], out.bindings()].concat();
    let [width, height] = frame.grid.samples();
    rec.dispatch(("reproject", "begin"), bindings, [width, height, 1]);
}

/// Makes of the frame `before`, which had another size or was known at other pixels, one like `frame`.
fn rescale(rec: &mut Recorder<'_>, frame: &Frame, before: &HistoryBuffers, out: &HistoryBuffers) {
    let bindings = [vec![frame.dispatch.binding(rec.gpu)], out.bindings(), before.past()].concat();
    let [width, height] = frame.grid.samples();
    rec.dispatch(("reproject", "rescale"), bindings, [width, height, 1]);
}
