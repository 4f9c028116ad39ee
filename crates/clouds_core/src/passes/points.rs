//! Answers at points, and probes of single shader functions.

use super::{Context, Scene};
use crate::error::Result;
use crate::frame::Frame;
use crate::kernel::Kernel;

/// Points in one dispatch: few enough that a march of each toward the sun stays far under a watchdog's second.
pub(crate) const CHUNK: usize = 1 << 14;

/// Runs `kernel` over points (four numbers each), whatever it makes of them, `most` of them in a dispatch.
pub(crate) fn run(
    ctx: &mut Context<'_>,
    scene: &Scene<'_>,
    frame: &Frame,
    kernel: &Kernel,
    points: &[[f32; 4]],
    most: usize,
) -> Result<Vec<[f32; 4]>> {
    let mut results = Vec::with_capacity(points.len());
    for chunk in points.chunks(most) {
        let bytes = std::mem::size_of_val(chunk) as u64;
        let (given, answers) = (ctx.gpu.buffer("points", bytes), ctx.gpu.buffer("results", bytes));
        ctx.gpu.queue.write_buffer(&given, 0, bytemuck::cast_slice(chunk));
        ctx.uniforms.upload_frame(ctx.gpu, &Frame { width: chunk.len() as u32, ..frame.clone() });
        let bindings =
            [scene.bindings.as_slice(), &[("points", (&given).into()), ("results", (&answers).into())]].concat();
        let mut work = ctx.gpu.work();
        work.dispatch(kernel, &bindings, [chunk.len() as u32, 1, 1])?;
        work.download(&answers, 0, bytes);
        let downloads = work.submit(ctx.timings, ctx.interrupt)?;
        results.extend_from_slice(downloads[0].numbers());
    }
    Ok(results)
}
