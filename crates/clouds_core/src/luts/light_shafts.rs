//! The shadows of clouds on the air of a picture: crepuscular rays.

use glam::DVec2;

use super::lut::{Inputs, Lut, view};
use super::shadow;
use super::sky::snap_to_cell;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;
use crate::params;

/// Angle between rays in the middle of the picture, radians, most of them along a side (393 go around a panorama), and slices
/// of their distance.
const ANGLE: f32 = 0.016;
const MOST: u32 = 400;
const SLICES: u32 = 32;

/// Eye and shadows may move so far while the volume stays, m: a quarter of a texel of the shadows. What the air lacks is seen
/// from the middle of such a step, so that it follows from the picture alone, not from those before.
const STEP: f64 = 16.0;

/// What the volume is made from: its size, the camera's axes, its fields of view and the sky's scale, sun, air and shadows, from
/// where, and where those are.
type Key = ([u32; 3], [[f32; 3]; 3], [f32; 3], params::Sun, params::Atmosphere, shadow::Key, [f64; 3], [f64; 2]);

/// The volume on the GPU.
#[derive(Default)]
pub(crate) struct LightShafts {
    lut: Lut<Key>,
}

/// Texels for a picture.
fn size(frame: &Frame) -> [u32; 3] {
    let pixel = frame.marched_angle() / frame.dispatch.stride as f32;
    // At least a pixel apart.
    let along = |pixels: u32| (pixels.min((pixels as f32 * pixel / ANGLE) as u32) + 1).clamp(2, MOST);
    [along(frame.view.width), along(frame.view.height), SLICES]
}

impl LightShafts {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Inputs { params, frame, eye, .. } = *inputs;
        if !frame.light_shafts {
            return Ok(());
        }
        let size = size(frame);
        let axes = [frame.view.right, frame.view.up, frame.view.forward];
        let scales = [frame.view.tan_half_fov, frame.view.half_fov, frame.sky.sky_scale];
        let from = snap_to_cell(eye, params, STEP);
        let place = DVec2::from_array(frame.sky.shadow_eye.map(f64::from)) + from.truncate() - eye.truncate();
        let place = ((place / STEP).round() * STEP).to_array();
        let (sun, air, shadows) = (params.sun.clone(), params.atmosphere.clone(), shadow::key(inputs));
        let key = (size, axes, scales, sun, air, shadows, from.to_array(), place);
        let volume = self.lut.update(rec, key, |rec| {
            let volume = view(&rec.gpu.texture_3d("light_shafts", size));
            let mut there = frame.clone();
            there.sky.shadow_eye = place.map(|v| v as f32);
            there.set_planet(from, params);
            let bindings = [there.bindings(rec.gpu).as_slice(), &[("volume_out", (&volume).into())]].concat();
            rec.dispatch(("light_shafts", "light_shafts_bake"), bindings, [size[0], size[1], 1]);
            Ok(volume)
        })?;
        rec.bind([("light_shafts", (&volume).into())]);
        Ok(())
    }
}
