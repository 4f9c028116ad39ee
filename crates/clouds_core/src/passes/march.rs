//! The march through the clouds, of every pixel or of a subset.

use super::clouds::CloudBuffers;
use super::refine::{self, RayList};
use crate::frame::Frame;
use crate::gpu::Recorder;
use crate::params::Quality;
use crate::uniforms::Dispatch;

/// Marches a sheet: the pixels of a lattice, then those between rays that do not look alike, or all of them.
pub(crate) fn record(rec: &mut Recorder<'_>, frame: &Frame, quality: &Quality, ray_list: &RayList, out: &CloudBuffers) {
    let gpu = rec.gpu;
    if !refine::is_needed(frame, quality) {
        let size = [frame.dispatch.march_width, frame.dispatch.strip_rows];
        return rec.dispatch_rows(("march", "march"), &out.bindings(), size, |rows| {
            let (first_row, rows) = (frame.dispatch.strip_row + rows.start, rows.len() as u32);
            Dispatch { first_row, rows, ..frame.dispatch.clone() }.binding(gpu)
        });
    }
    let mut frame = frame.clone();
    frame.dispatch.lattice = refine::coarsest(&frame, quality);
    refine::begin(rec, &frame, ray_list);
    let mut likely = 1.0;
    loop {
        list(rec, &frame, refine::pixels(&frame), likely, ray_list, out);
        if frame.dispatch.lattice == 1 {
            return;
        }
        refine::record(rec, &frame, ray_list, out);
        frame.dispatch.lattice /= 2;
        frame.dispatch.spans = 1;
        likely = REFINED;
    }
}

/// Share of the pixels of a finer lattice that are listed as a rule: in stills of eleven scenes an eighth to a fifth.
const REFINED: f64 = 0.2;

/// Marches the listed pixels, of which there are `most` at most, and as a rule a share of them.
pub(crate) fn list(
    rec: &mut Recorder<'_>,
    frame: &Frame,
    most: u32,
    likely: f64,
    ray_list: &RayList,
    out: &CloudBuffers,
) {
    let gpu = rec.gpu;
    let bindings = [out.bindings(), ray_list.bindings()].concat();
    rec.dispatch_list(("march", "march_list"), &bindings, &ray_list.list(most, 1, likely), |first_ray| {
        Dispatch { first_ray, ..frame.dispatch.clone() }.binding(gpu)
    });
}
