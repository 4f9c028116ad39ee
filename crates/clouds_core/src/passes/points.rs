//! Queries at points, and probes of single shader functions.

use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::{Recorder, Which};
use crate::uniforms::Dispatch;

/// Number of points per dispatch. A march of each toward the sun takes far less than a second, the time after which a
/// watchdog may reset the device.
pub(crate) const CHUNK: usize = 1 << 14;

/// Runs a kernel over points, at most `most` per submission. Points and results have four numbers each, whose meaning
/// depends on the kernel.
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
