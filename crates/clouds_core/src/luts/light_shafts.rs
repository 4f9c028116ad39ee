//! Shadows of clouds on the air of a picture: light shafts (crepuscular rays).

use glam::DVec2;

use super::lut::{Inputs, Lut, view};
use super::shadow;
use super::sky::snap_to_cell;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;
use crate::params;

/// Angle in radians between rays at the centre of the picture, maximum number of rays along a side (a panorama has
/// 393), and number of slices in distance.
const ANGLE: f32 = 0.016;
const MAX_RAYS: u32 = 400;
const SLICES: u32 = 32;

/// Motion in m of eye and shadows within which the volume is reused: a quarter of a texel of the shadows. The volume is
/// baked for the centre of such a cell, so that it depends on the picture alone, not on earlier ones.
const STEP: f64 = 16.0;

/// Key of the volume: size, camera axes, fields of view and sky scale; sun, atmosphere; shadows, light of the light
/// field, whether the field is that of an animation, and its snapped levels; snapped position of the eye, and its position
/// in the shadow clipmap.
type Key = (
    ([u32; 3], [[f32; 3]; 3], [f32; 3]),
    (params::Sun, params::Atmosphere),
    (shadow::Key, Option<(params::Light, bool)>, [[f32; 4]; 8]),
    ([f64; 3], [f64; 2]),
);

/// Light-shaft volume on the GPU.
#[derive(Default)]
pub(crate) struct LightShafts {
    lut: Lut<Key>,
}

/// Size of the volume for a picture, in texels.
fn size(frame: &Frame) -> [u32; 3] {
    let pixel = frame.marched_angle() / frame.dispatch.stride as f32;
    // At least one pixel between rays.
    let along = |pixels: u32| (pixels.min((pixels as f32 * pixel / ANGLE) as u32) + 1).clamp(2, MAX_RAYS);
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
        let snapped = |place: DVec2| (place / STEP).round() * STEP;
        let place = snapped(place).to_array();
        let levels = frame.sky.field_levels.map(|[x, y, first, rows]| {
            let [x, y] =
                (snapped(DVec2::new(x.into(), y.into()) + from.truncate() - eye.truncate())).as_vec2().to_array();
            [x, y, first, rows]
        });
        let (sun, air, shadows) = (params.sun.clone(), params.atmosphere.clone(), shadow::key(inputs));
        let light = frame.field.map(|_| (params.light.clone(), inputs.field.is_animated()));
        let key = ((size, axes, scales), (sun, air), (shadows, light, levels), (from.to_array(), place));
        let volume = self.lut.update(rec, key, |rec| {
            let volume = view(&rec.gpu.texture_3d("light_shafts", size));
            let mut there = frame.clone();
            there.sky.shadow_eye = place.map(|v| v as f32);
            there.sky.field_levels = levels;
            there.set_planet(from, params);
            let bindings = [there.bindings(rec.gpu).as_slice(), &[("volume_out", (&volume).into())]].concat();
            rec.dispatch(("light_shafts", "light_shafts_bake"), bindings, [size[0], size[1], 1]);
            Ok(volume)
        })?;
        rec.bind([("light_shafts", (&volume).into())]);
        Ok(())
    }
}
