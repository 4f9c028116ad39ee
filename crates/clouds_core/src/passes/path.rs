//! Path tracer: every order of scattering.

use super::clouds::CloudBuffers;
use super::rays::Rays;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;

/// Size of `PathRay` of bindings.wgsl in bytes.
pub const RAY_BYTES: u64 = 176;

/// Traces the paths of the strip of `frame`.
pub(crate) fn run(rec: &mut Recorder<'_>, frame: &Frame, rays: &Rays, out: &CloudBuffers) -> Result<()> {
    rays.run(rec, frame, ("path", "path"), "path_rays", &out.bindings())
}
