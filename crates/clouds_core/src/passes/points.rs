//! Answers at points, and probes of single shader functions.

use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Recorder, Which};
use crate::uniforms::Dispatch;

/// Points in one dispatch: few enough that a march of each toward the sun stays far under a watchdog's second.
pub(crate) const CHUNK: usize = 1 << 14;

/// Runs a kernel over points (four numbers each), whatever it makes of them, `most` of them in a submission.
pub(crate) fn run(
    rec: &mut Recorder<'_>,
    frame: &Frame,
    kernel: &Which,
    points: &[[f32; 4]],
    most: usize,
) -> Result<Vec<[f32; 4]>> {
    let mut results = Vec::with_capacity(points.len());
    for chunk in points.chunks(most) {
        let bytes = std::mem::size_of_val(chunk) as u64;
        let (given, answers) = (rec.gpu.buffer("points", bytes), rec.gpu.buffer("results", bytes));
        rec.gpu.queue.write_buffer(&given, 0, bytemuck::cast_slice(chunk));
        let block = Dispatch { columns: chunk.len() as u32, ..frame.dispatch.clone() }.binding(rec.gpu);
        let bindings = vec![block, ("points", (&given).into()), ("results", (&answers).into())];
        rec.dispatch_kernel(kernel.clone(), bindings, [chunk.len() as u32, 1, 1]);
        rec.download(&answers, 0, bytes);
        let downloads = rec.flush()?;
        results.extend_from_slice(downloads[0].numbers());
    }
    Ok(results)
}
