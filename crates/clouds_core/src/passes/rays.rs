//! Rays that take more steps than one dispatch may: those that are not done go on in the next one.

use std::time::Instant;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::gpu::Recorder;
use crate::gpu::{Bindings, Name};
use crate::uniforms::Dispatch;

/// Most turns of a dispatch: with the loops inside one, lavapipe's limit of 65,535 over a shader is far (docs/numerics.md).
const MOST_TURNS: u32 = 2048;
/// What a dispatch should take, in seconds.
const SECONDS: f64 = 0.1;

/// The buffers of a band of rays.
pub(crate) struct Rays {
    pub state: wgpu::Buffer,
    active: wgpu::Buffer,
    progress: wgpu::Buffer,
    pub uncertainty: wgpu::Buffer,
}

impl Rays {
    pub fn new(gpu: &Gpu, rays: u64, state_bytes: u64) -> Self {
        Self {
            state: gpu.buffer("rays", state_bytes * rays),
            active: gpu.buffer("active_rays", 4 * rays),
            progress: gpu.buffer("progress", 8 * rays),
            uncertainty: gpu.buffer("uncertainty", 16 * rays),
        }
    }

    /// `state` is the variable that the rays are kept in.
    pub fn bindings(&self, state: &'static str) -> Bindings {
        vec![
            (state, (&self.state).into()),
            ("active_rays", (&self.active).into()),
            ("progress", (&self.progress).into()),
            ("uncertainty", (&self.uncertainty).into()),
        ]
    }

    /// Runs a kernel until the ray of each pixel of the sheet is done. `state` is the variable that they are kept in.
    pub fn run(
        &self,
        rec: &mut Recorder<'_>,
        frame: &Frame,
        kernel: Name,
        state: &'static str,
        outputs: &Bindings,
    ) -> Result<()> {
        rec.clear(&self.state);
        let bindings = [outputs.as_slice(), &self.bindings(state)].concat();
        let mut active: Vec<u32> = (0..frame.view.width * frame.dispatch.rows).collect();
        let mut budget = 32;
        while !active.is_empty() {
            let count = active.len() as u32;
            rec.gpu.queue.write_buffer(&self.active, 0, bytemuck::cast_slice(&active));
            let block = Dispatch { active_rays: count, budget, ..frame.dispatch.clone() }.binding(rec.gpu);
            rec.dispatch(kernel, [&[block], bindings.as_slice()].concat(), [count, 1, 1]);
            rec.download(&self.progress, 0, 8 * u64::from(count));
            let started = Instant::now();
            let downloads = rec.flush()?;
            let progress: &[[u32; 2]] = downloads[0].numbers();
            // A driver that ends loops by itself must not pass for convergence.
            if let Some([turns, _]) = progress.iter().find(|[turns, done]| *done == 0 && *turns != budget) {
                let what = format!("{} ended a loop after {turns} of {budget} turns", rec.gpu.info.name);
                return Err(Error::Device(format!("{what}: its results cannot be trusted")));
            }
            active = active.iter().zip(progress).filter(|(_, [_, done])| *done == 0).map(|(ray, _)| *ray).collect();
            let pace = SECONDS / started.elapsed().as_secs_f64().max(1e-6);
            budget = ((f64::from(budget) * pace.clamp(0.25, 4.0)) as u32).clamp(16, MOST_TURNS);
        }
        Ok(())
    }
}
