//! Rays that take more steps than a dispatch allows: unfinished rays continue in the next dispatch.

use std::time::Instant;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::gpu::Recorder;
use crate::gpu::{Bindings, Name};
use crate::uniforms::Dispatch;

/// Maximum number of loop iterations of a ray in a dispatch. With the inner loops they stay far below lavapipe's limit
/// of 65,535 per shader (docs/numerics.md).
const MAX_ITERATIONS: u32 = 2048;
/// Target time of a dispatch in s.
const SECONDS: f64 = 0.1;

/// Buffers of the rays of a strip.
pub(crate) struct Rays {
    pub state: wgpu::Buffer,
    active: wgpu::Buffer,
    progress: wgpu::Buffer,
    pub uncertainty: wgpu::Buffer,
}

impl Rays {
    /// Buffers for `rays` rays with states of `state_bytes` bytes each.
    pub fn new(gpu: &Gpu, rays: u64, state_bytes: u64) -> Self {
        Self {
            state: gpu.buffer("rays", state_bytes * rays),
            active: gpu.buffer("active_rays", 4 * rays),
            progress: gpu.buffer("progress", 8 * rays),
            uncertainty: gpu.buffer("uncertainty", 16 * rays),
        }
    }

    /// Bindings by name. `state` is the shader variable of the ray states.
    pub fn bindings(&self, state: &'static str) -> Bindings {
        vec![
            (state, (&self.state).into()),
            ("active_rays", (&self.active).into()),
            ("progress", (&self.progress).into()),
            ("uncertainty", (&self.uncertainty).into()),
        ]
    }

    /// Runs a kernel until the rays of all pixels of the strip are finished. `state` is the shader variable of the ray
    /// states.
    ///
    /// Returns [`Error::Device`] if the driver ends a loop early.
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
            // A loop that the driver ends early must not count as convergence.
            let ended_early = |[iterations, done]: &&[u32; 2]| *done == 0 && *iterations != budget;
            if let Some([iterations, _]) = progress.iter().find(ended_early) {
                let what = format!("{} ended a loop after {iterations} of {budget} turns", rec.gpu.info.name);
                return Err(Error::Device(format!("{what}: its results cannot be trusted")));
            }
            active = active.iter().zip(progress).filter(|(_, [_, done])| *done == 0).map(|(ray, _)| *ray).collect();
            let ratio = SECONDS / started.elapsed().as_secs_f64().max(1e-6);
            budget = ((f64::from(budget) * ratio.clamp(0.25, 4.0)) as u32).clamp(16, MAX_ITERATIONS);
        }
        Ok(())
    }
}
