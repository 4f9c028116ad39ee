//! Shadows of clouds: a map for the user, and a clipmap around the eye for pictures of the ground and of shaded air.
//! The clipmap is rebaked when sun or clouds change, and when winds or eye have moved by a step.

use super::lut::{Inputs, Lut, view};
use super::volume::Grid;
use crate::camera::Camera;
use crate::clipmap::{Casters, casters, origin};
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;
use crate::shared::constants;
use crate::uniforms::Dispatch;

constants! {
    /// Side of a level of the shadow clipmap in texels.
    const SHADOW_SIDE: u32 = 88;
    /// Number of levels of the shadow clipmap, each twice as wide and coarse as the one before.
    const SHADOW_LEVELS: u32 = 5;
}

/// Key of the shadow clipmap: shadow casters, planet and grid, snapped position and time, texel size, scale of the
/// extinction.
pub(crate) type Key = (Casters, (f32, Grid), [i64; 3], [f32; 2]);

/// Key of the shadow clipmap of a picture.
pub(crate) fn key(inputs: &Inputs<'_>) -> Key {
    let Inputs { params, frame, eye, time, .. } = *inputs;
    let planet = (params.atmosphere.planet_radius, Grid(params.volume.clone()));
    (casters(params), planet, origin(eye, params, time).steps, [frame.sky.shadow_texel, frame.sky.split[2]])
}

/// Shadow clipmap on the GPU.
#[derive(Default)]
pub(crate) struct GroundShadow {
    lut: Lut<Key>,
}

/// Whether a picture reads the shadow clipmap.
fn is_read(frame: &Frame) -> bool {
    frame.light_shafts || frame.ground_shadow && !frame.cloudless
}

impl GroundShadow {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Inputs { params, frame, eye, time, .. } = *inputs;
        if !is_read(frame) {
            return Ok(());
        }
        let levels = self.lut.update(rec, key(inputs), |rec| {
            let origin = origin(eye, params, time);
            let size = [SHADOW_SIDE, SHADOW_SIDE * SHADOW_LEVELS, 1];
            let [single, mean, levels] = [("", size), ("ground_shadow_mean", [1; 3]), ("ground_shadow", size)]
                .map(|(label, size)| view(&rec.gpu.texture(label, size, 1)));
            let mut there = Frame::new(&Camera::equirect(origin.place.extend(0.0))?, params, origin.time, [1, 1]);
            there.sky.shadow_texel = frame.sky.shadow_texel;
            let there = there.bindings(rec.gpu);
            let (made, of_all) = (("ground_shadow", (&single).into()), ("ground_shadow_mean", (&mean).into()));
            let mut bake = |entry, reads: &[_], out: &wgpu::TextureView, size| {
                let ours = [there.as_slice(), &[("map_out", out.into())], reads];
                rec.dispatch(("shadow", entry), ours.concat(), size);
            };
            bake("shadow_ground", &[], &single, size);
            bake("shadow_mean", std::slice::from_ref(&made), &mean, [SHADOW_SIDE, 1, 1]);
            bake("shadow_blend", &[made, of_all], &levels, size);
            Ok(levels)
        })?;
        rec.bind([("ground_shadow", (&levels).into())]);
        Ok(())
    }
}

/// Bakes the user's shadow map of `size` x `size` texels into `out`.
pub(crate) fn map(rec: &mut Recorder<'_>, frame: &Frame, size: u32, out: &wgpu::Buffer) {
    let bindings = [&[("shadow_out", out.into())], frame.bindings(rec.gpu).as_slice()].concat();
    let gpu = rec.gpu;
    rec.dispatch_rows(("shadow", "shadow_map"), &bindings, [size, size], |rows| {
        Dispatch { first_row: rows.start, rows: rows.len() as u32, ..frame.dispatch.clone() }.binding(gpu)
    });
}
