//! The march with panels halved until nothing changes.

use super::clouds::CloudBuffers;
use super::rays::Rays;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;

/// Bytes of a `ReferenceRay` of bindings.wgsl.
pub const RAY_BYTES: u64 = 192;

/// Integrates the sheet of `frame`.
pub(crate) fn run(rec: &mut Recorder<'_>, frame: &Frame, rays: &Rays, out: &CloudBuffers) -> Result<()> {
    rays.run(rec, frame, ("reference", "reference"), "reference_rays", &out.bindings())
}
