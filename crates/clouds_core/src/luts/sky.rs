//! The sky around the camera, and the light that it and the sun give to the clouds.

use glam::DVec3;

use super::lut::{Inputs, Lut, view};
use super::transmittance;
use crate::camera::Camera;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;
use crate::params::{self, Params};
use crate::shared::constants;

/// Texels of the sky map: azimuth from the sun, angle from the horizon.
const SIZE: [u32; 3] = [128, 160, 1];

constants! {
    /// Distances at which the shares of the sky before them are known.
    const SHARE_SLICES: u32 = 24;
}

/// Texels of those shares: azimuth, angle, distance.
const SHARE_SIZE: [u32; 3] = [32, 64, SHARE_SLICES];

/// What the sky is made from: sun, air, night, where it is seen from, and where the clouds are that it lights.
type Key = (params::Sun, params::Atmosphere, [f32; 3], [f64; 3], [f32; 3]);

/// Where the sky is seen from, near the eye: the same place for all eyes around it, so that one that flies has a new sky
/// every ten metres of height or hundreds of metres of way, not in every frame. What that costs: half of what a step changes,
/// and a hundredth of a degree of the sun's elevation.
fn viewpoint(eye: DVec3, params: &Params) -> DVec3 {
    snap_to_cell(eye, params, 1e-4 * f64::from(params.atmosphere.planet_radius))
}

/// Steps of height for each factor of e of the height over a kilometre below the ground, as air thins out: of 8 m at the ground, 88 m
/// at 10 km. Measured, one of them changes no direction of the sky by more than 1.3 % (sun at 2 to 45 degrees) or 2.1 % (at -4); on
/// average 0.1 % near the ground, 0.2 % at 1 km and 1.1 % at 10 km.
const HEIGHT_STEPS: f64 = 125.0;

/// A place near the eye, the same for all eyes around it: at most half a `step` beside it, m, and half a step of height above or
/// below.
pub(super) fn snap_to_cell(eye: DVec3, params: &Params, step: f64) -> DVec3 {
    let radius = f64::from(params.atmosphere.planet_radius);
    let centre = DVec3::new(0.0, 0.0, -radius);
    let height = (eye - centre).length() - radius;
    let steps = ((1.0 + height.abs() / 1000.0).ln() * HEIGHT_STEPS).round();
    let height = 1000.0 * ((steps / HEIGHT_STEPS).exp() - 1.0) * height.signum();
    let place = (eye / step).round() * step - centre;
    centre + place.try_normalize().unwrap_or(DVec3::Z) * (radius + height)
}

/// The sky on the GPU.
#[derive(Default)]
pub(crate) struct Sky {
    lut: Lut<Key, (wgpu::TextureView, wgpu::TextureView, wgpu::Buffer)>,
}

impl Sky {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Inputs { params, eye, .. } = *inputs;
        let layers = [params.clouds.base, params.clouds.top, params.high_clouds.altitude];
        let from = viewpoint(eye, params);
        let sun = params::Sun { visible: true, ..params.sun.clone() };
        let key = (sun, transmittance::air(params), params.atmosphere.night, from.to_array(), layers);
        let (map, share, light) = self.lut.update(rec, key, |rec| {
            let frame = Frame::new(&Camera::equirect(from)?, params, 0.0, [1, 1]).bindings(rec.gpu);
            let map = view(&rec.gpu.texture("sky", SIZE, 1));
            let share = view(&rec.gpu.texture_3d("aerial_perspective_lut", SHARE_SIZE));
            let light = rec.gpu.buffer("sky_light", 64);
            let [across, down, _] = SHARE_SIZE;
            let bakes = [
                ("sky_view_bake", ("map_out", (&map).into()), SIZE),
                ("aerial_perspective_bake", ("volume_out", (&share).into()), [across, down, 1]),
                ("sky_light_bake", ("sky_light", (&light).into()), [1; 3]),
            ];
            for (entry, out, size) in bakes {
                rec.dispatch(("sky", entry), [frame.as_slice(), &[out]].concat(), size);
            }
            Ok((map, share, light))
        })?;
        rec.bind([
            ("sky_view_lut", (&map).into()),
            ("aerial_perspective_lut", (&share).into()),
            ("sky_light", (&light).into()),
            ("sky_light_uniform", (&light).into()),
        ]);
        Ok(())
    }
}
