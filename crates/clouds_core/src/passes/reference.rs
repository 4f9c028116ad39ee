//! The march with panels halved until nothing changes.

use super::march::Marched;
use super::rays::Rays;
use super::{Context, Scene};
use crate::error::Result;
use crate::frame::Frame;

/// Bytes of a `ReferenceRay` of bindings.wgsl.
pub const RAY_BYTES: u64 = 192;

/// Integrates the band of `frame`.
pub(crate) fn run(ctx: &mut Context<'_>, scene: &Scene<'_>, frame: &Frame, rays: &Rays, out: &Marched) -> Result<()> {
    let kernel = ctx.gpu.kernel("reference", "reference", scene.variant)?;
    rays.run(ctx, scene, frame, &kernel, "reference_rays", &out.bindings())
}
