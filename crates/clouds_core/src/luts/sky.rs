//! Sky-view and aerial-perspective LUTs around the camera, and the light of sky and sun on the clouds.

use glam::DVec3;

use super::lut::{Inputs, Lut, view};
use super::transmittance;
use crate::camera::Camera;
use crate::error::Result;
use crate::frame::Frame;
use crate::gpu::Recorder;
use crate::params::{self, Params};
use crate::shared::constants;

/// Size of the sky-view LUT in texels: azimuth from the sun, angle from the horizon.
const SKY_VIEW_SIZE: [u32; 3] = [128, 160, 1];

constants! {
    /// Number of distances in the aerial-perspective LUT.
    const SHARE_SLICES: u32 = 24;
}

/// Size of the aerial-perspective LUT in texels: azimuth, angle, distance.
const AERIAL_PERSPECTIVE_SIZE: [u32; 3] = [32, 64, SHARE_SLICES];

/// Key of the sky: sun, atmosphere, night sky, snapped position of the eye, altitudes of the lit clouds.
type Key = (params::Sun, params::Atmosphere, [f32; 3], [f64; 3], [f32; 3]);

/// Position that the sky is baked for, the same for all eyes near it: the sky of a moving camera is rebaked every ten
/// metres of altitude or every few hundred metres of horizontal motion instead of every frame. The error is at most
/// half the change of a step, and a hundredth of a degree in the elevation of the sun.
fn viewpoint(eye: DVec3, params: &Params) -> DVec3 {
    snap_to_cell(eye, params, 1e-4 * f64::from(params.atmosphere.planet_radius))
}

/// Altitude steps per factor e of (altitude + 1 km), as the density of air falls with altitude: 8 m at the ground, 88 m
/// at 10 km. Measured, a step changes the sky in any direction by at most 1.3 % (sun at 2 to 45 degrees) or 2.1 % (sun
/// at -4 degrees); on average by 0.1 % near the ground, 0.2 % at 1 km and 1.1 % at 10 km.
const HEIGHT_STEPS: f64 = 125.0;

/// Position snapped to a grid, the same for all eyes in a cell: within half a `step` horizontally, in m, and half an
/// altitude step vertically.
pub(super) fn snap_to_cell(eye: DVec3, params: &Params, step: f64) -> DVec3 {
    let radius = f64::from(params.atmosphere.planet_radius);
    let centre = DVec3::new(0.0, 0.0, -radius);
    let height = (eye - centre).length() - radius;
    let steps = ((1.0 + height.abs() / 1000.0).ln() * HEIGHT_STEPS).round();
    let height = 1000.0 * ((steps / HEIGHT_STEPS).exp() - 1.0) * height.signum();
    let place = (eye / step).round() * step - centre;
    centre + place.try_normalize().unwrap_or(DVec3::Z) * (radius + height)
}

/// Sky LUTs on the GPU.
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
        let (map, aerial, light) = self.lut.update(rec, key, |rec| {
            let frame = Frame::new(&Camera::equirect(from)?, params, 0.0, [1, 1]).bindings(rec.gpu);
            let map = view(&rec.gpu.texture("sky", SKY_VIEW_SIZE, 1));
            let aerial = view(&rec.gpu.texture_3d("aerial_perspective_lut", AERIAL_PERSPECTIVE_SIZE));
            let light = rec.gpu.buffer("sky_light", 64);
            let [across, down, _] = AERIAL_PERSPECTIVE_SIZE;
            let bakes = [
                ("sky_view_bake", ("map_out", (&map).into()), SKY_VIEW_SIZE),
                ("aerial_perspective_bake", ("volume_out", (&aerial).into()), [across, down, 1]),
                ("sky_light_bake", ("sky_light", (&light).into()), [1; 3]),
            ];
            for (entry, out, size) in bakes {
                rec.dispatch(("sky", entry), [frame.as_slice(), &[out]].concat(), size);
            }
            Ok((map, aerial, light))
        })?;
        rec.bind([
            ("sky_view_lut", (&map).into()),
            ("aerial_perspective_lut", (&aerial).into()),
            ("sky_light", (&light).into()),
            ("sky_light_uniform", (&light).into()),
        ]);
        Ok(())
    }
}
