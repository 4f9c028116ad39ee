//! Paths of light through every order of scattering.

use super::march::Marched;
use super::rays::Rays;
use super::{Context, Scene};
use crate::error::Result;
use crate::frame::Frame;

/// Bytes of a `PathRay` of bindings.wgsl.
pub const RAY_BYTES: u64 = 176;

/// Traces the paths of the band of `frame`.
pub(crate) fn run(ctx: &mut Context<'_>, scene: &Scene<'_>, frame: &Frame, rays: &Rays, out: &Marched) -> Result<()> {
    let kernel = ctx.gpu.kernel("path", "path", scene.variant)?;
    rays.run(ctx, scene, frame, &kernel, "path_rays", &out.bindings())
}
