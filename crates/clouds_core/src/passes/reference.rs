//! Reference integrator: panels are halved until the result has converged.

use super::clouds::CloudBuffers;
use super::rays::Rays;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;

/// Size of `ReferenceRay` of bindings.wgsl in bytes.
pub const RAY_BYTES: u64 = 192;

/// Integrates the strip of `frame`.
pub(crate) fn run(rec: &mut Recorder<'_>, frame: &Frame, rays: &Rays, out: &CloudBuffers) -> Result<()> {
    rays.run(rec, frame, ("reference", "reference"), "reference_rays", &out.bindings())
}
