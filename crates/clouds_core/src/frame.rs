//! Frame: quantities of a picture derived from camera, parameters and time. Those that would lose their digits in f32
//! (planet radii, long times, distant eyes) are computed here in f64.

use std::f32::consts::PI;
use std::f64::consts::{FRAC_PI_2, PI as PI64};

use glam::{DVec2, DVec3, Vec3};

use crate::camera::{Camera, Projection};
use crate::chart::{chart_reach, on_chart};
use crate::clipmap;
use crate::directions::{compass, sun_direction};
use crate::field::{Anchor, FieldShape, Now};
use crate::gpu::{Binding, Gpu};
use crate::grid::SampleGrid;
use crate::moon::MOON_RADIUS;
use crate::params;
use crate::params::{Edge, Model, Params, Phase};
use crate::scattering::{Split, droplet};
use crate::shared::constants;
use crate::uniforms::{Dispatch, Sky, View, uniform};
use crate::wind::Advection;

/// Frame of a picture or a query: its uniform blocks, and the switches of its specialization.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Camera, eye and planet.
    pub view: View,
    /// Sun, moon, clouds and winds relative to the eye.
    pub sky: Sky,
    /// Range of pixels of dispatches without a range of their own: the whole strip.
    pub dispatch: Dispatch,
    /// Projection of the camera.
    pub projection: Projection,
    /// Sample grid of the clouds.
    pub(crate) grid: SampleGrid,
    /// Shape of the light field, if the picture reads it.
    pub(crate) field: Option<FieldShape>,
    /// Whether there are high clouds.
    pub high_clouds: bool,
    /// Whether high clouds are embossed and the sun reaches any of them in sight.
    pub high_emboss: bool,
    /// Whether the sun is so low that its irradiance differs between the high clouds in sight.
    pub high_low_sun: bool,
    /// Whether there are no clouds to march.
    pub cloudless: bool,
    /// Whether there is a user-supplied scene.
    pub scene: bool,
    /// Whether clouds cast shadows on the visible ground.
    pub ground_shadow: bool,
    /// Whether clouds cast shadows on the visible air.
    pub light_shafts: bool,
}

constants! {
    /// Altitude of the top of the atmosphere in m (Hillaire 2020).
    const AIR_TOP: f64 = 100_000.0;
    /// Angular radius of the sun in radians: 0.2666 degrees (IAU: 695 700 km at 1 au).
    const SUN_RADIUS: f64 = 0.004_654;
    /// Sine of the angle to the horizon beyond which the sun's disc is visible in full or not at all: its radius,
    /// rounded up.
    const SUN_EDGE: f64 = 0.005;
    /// Ratio of length to width of streaks of rain.
    const RAIN_STRETCH: f64 = 12.0;
    /// Width of clouds as a fraction of their spacing (`leap_scale`).
    const CLOUD_WIDTH: f32 = 0.5;
    /// Ratio of the tile sizes of the second and the first read of the texture of the high clouds. It is no ratio of
    /// small integers, so that the repetitions do not coincide.
    const BROAD: f32 = 3.2;
    /// Number of updates of an octave of the high clouds after which their indices wrap. All are exact in f32.
    const UPDATES: u32 = 65_536;
    /// Sines of the sun's elevation, 12 and 20 degrees, between which its irradiance on the high clouds changes from a
    /// local value to that at the eye.
    const LOW_SUN: [f64; 2] = [0.208, 0.342];
}

/// Margin on the elevation of the sun's centre in radians, for the radius of its disc and for rounding to f32.
const HALF_SUN: f64 = SUN_EDGE + 0.001;

/// Displacement of the weather map by a value of 1 in the large-scale weather map, in tiles of the weather map.
/// Measured on the default sky, whose clouds are 5 km apart: the relative displacement of adjacent tiles is larger
/// nearly everywhere.
const BEND: f32 = 0.8;
/// Maximum slope of the displacement in a baked large-scale weather map, per width of the map.
const STEEPEST: f64 = 40.0;

/// Fall speed of rain in m/s: that of drops of 2.5 mm (Gunn and Kinzer 1949).
const RAIN_SPEED: f64 = 7.4;

/// Maximum width in radians of a pixel whose centre represents the glow around the sun: a seventh of the half width of
/// the forward peak of aerosol (g = 0.8). At that width the mean over the pixel differs by 0.5 % where the glow is
/// brightest.
const MAX_GLOW_WIDTH: f32 = 0.032;
/// Maximum number of directions per axis over which the sky and the phase function are averaged in a pixel.
const MAX_SKY_SAMPLES: f32 = 12.0;
const MAX_PHASE_SAMPLES: f32 = 64.0;

/// Half width in radians of the narrowest peak of the phase function of clouds.
fn phase_width(params: &Params) -> f32 {
    let light = &params.light;
    let peak = |g: f32| (1.0 - g.abs()) / g.abs().max(1e-3).sqrt();
    match light.phase {
        Phase::HenyeyGreenstein if matches!(light.model, Model::Thesis2018 | Model::Vsu2022) => {
            peak(light.g).min(peak(light.g_back))
        }
        Phase::HenyeyGreenstein => peak(light.g),
        Phase::Droplet => peak(droplet(f64::from(light.droplet_diameter))[0] as f32),
        // Half the width of a ring of the glory or the aureole: diffraction of light of 0.55 µm by a disc of the
        // droplet's diameter.
        Phase::Mie => 0.5 * 0.55 / light.droplet_diameter,
    }
}

/// Fractional part of `v / period`, in f64: coordinates in f32 would be off by metres after a week of wind.
fn wrap(v: f64, period: f32) -> f32 {
    let fraction = (v / f64::from(period)).rem_euclid(1.0) as f32;
    // Rounding to f32 may give 1, which is equivalent to 0. Displacements beyond the range of f64 give NaN.
    if fraction < 1.0 { fraction } else { 0.0 }
}

/// Coordinate of `v` on a weather map of width `extent`, from 0 to 1 across the map, in f64 as in `wrap`.
fn on_map(v: f64, extent: f32, edge: Edge) -> f32 {
    match edge {
        Edge::Repeat => wrap(v, extent),
        // A map and its mirror image have a period of two widths.
        Edge::Mirror => 2.0 * wrap(0.5 * v, extent),
        // Displacements beyond the range of f64 give NaN. At distances that f32 cannot resolve no map is in sight.
        Edge::Clamp if v.is_nan() => 0.0,
        Edge::Clamp => (v / f64::from(extent)).clamp(-1e12, 1e12) as f32,
    }
}

/// Altitude in m of the top of the marched clouds; of the user's grid that of its highest corner.
fn cloud_top(params: &Params) -> f64 {
    let Some(volume) = &params.volume else { return f64::from(params.shell()[1]) };
    let [low, high] = volume.bounds();
    let radius = f64::from(params.atmosphere.planet_radius);
    let far = low.abs().max(high.abs());
    DVec3::new(far.x, far.y, high.z + radius).length() - radius
}

/// Shortest scale of variation of the base shape in m: of the noise and of each weather. In a user's map the cover may
/// change from 0 to 1 within a texel, and the scale is 2.5 texels: leaps by a fifth of it (`quality.sphere_tracing`) reach half a
/// texel. Measured on islands of one texel: leaps by a whole texel miss one and a half times as many islands as
/// coarse steps do.
fn leap_scale(params: &Params) -> f32 {
    let of_weather = |(weather, _): (params::Weather, f32)| match &weather.map {
        Some(map) => 2.5 * weather.extent / map.width.max(map.height) as f32,
        None => weather.scale,
    };
    params.weather_shares().into_iter().map(of_weather).fold(params.clouds.shape_scale, f32::min)
}

impl Frame {
    /// Bindings of the uniform blocks, by name.
    pub(crate) fn bindings(&self, gpu: &Gpu) -> [(&'static str, Binding); 2] {
        [("frame", uniform(&[&self.view, &self.sky])), self.dispatch.binding(gpu)]
    }

    /// Frame of a camera and a picture size in pixels, without a sky.
    pub fn seen_by(camera: &Camera, [width, height]: [u32; 2]) -> Self {
        let mut frame = Self::default();
        [frame.view.width, frame.view.height] = [width, height];
        frame.grid.size = [width, height];
        frame.dispatch = Dispatch { rows: height, march_width: width, ..Dispatch::default() };
        frame.set_camera(camera);
        frame
    }

    /// Frame of a picture of `size` pixels by `camera` at `time` in s.
    pub fn new(camera: &Camera, params: &Params, time: f64, size: [u32; 2]) -> Self {
        let mut frame = Self::seen_by(camera, size);
        frame.set_planet(camera.eye, params);
        frame.set_wind(camera.eye, params, time);
        frame.set_volume(camera.eye, params);
        frame.sky.leap_scale = leap_scale(params);
        frame.sky.shadow_texel = clipmap::texel(frame.view.altitude);
        frame.sky.shadow_eye = clipmap::camera_in_clipmap(camera.eye, params, time);
        frame.high_clouds = params.has_high_clouds();
        frame.sky.sun_direction = sun_direction(params).as_vec3().to_array();
        frame.set_high_sun(params);
        frame.sky.droplet = droplet(f64::from(params.light.droplet_diameter)).map(|v| v as f32);
        frame.set_split(params);
        frame.set_sky_scale(params);
        frame.view.sun_bounds = frame.disc_bounds(camera, sun_direction(params), SUN_RADIUS);
        frame.set_moon(camera, params);
        frame.set_samples(params);
        frame
    }

    /// Angle in radians between marched pixels at the centre of the picture.
    pub fn marched_angle(&self) -> f32 {
        self.pixel_angle() * self.dispatch.stride as f32
    }

    /// Angular width in radians of a pixel at the centre of the picture (`pixel_width` of camera.wgsl).
    fn pixel_angle(&self) -> f32 {
        match self.projection {
            Projection::Equirect => (2.0 * PI / self.view.width as f32).max(PI / self.view.height as f32),
            Projection::Fisheye => 2.0 * self.view.half_fov / self.view.width.min(self.view.height) as f32,
            Projection::Perspective => 2.0 * self.view.tan_half_fov / self.view.height as f32,
        }
    }

    /// Bounding box of a disc in a direction: left, top, right and bottom in pixels. The radius is in radians. The box
    /// may exceed the sides of a panorama, and is empty if the disc is outside the picture.
    fn disc_bounds(&self, camera: &Camera, direction: DVec3, radius: f64) -> [f32; 4] {
        let (width, height) = (f64::from(self.view.width), f64::from(self.view.height));
        let [x, y, z] = [camera.right, camera.up, camera.forward].map(|axis| direction.dot(axis));
        // Margin for rounding to f32.
        let radius = 1.02 * radius;
        let (across, down) = match camera.projection {
            Projection::Equirect => {
                let latitude = y.clamp(-1.0, 1.0).asin();
                // A disc that contains a pole extends over all longitudes.
                let over = latitude.abs() + radius >= FRAC_PI_2;
                let half = if over { PI64 } else { (radius.sin() / latitude.cos()).min(1.0).asin() };
                let middle = x.atan2(z);
                let pixels = |longitude: f64| (0.5 + 0.5 * longitude / PI64) * width;
                let row = |latitude: f64| (0.5 - latitude.clamp(-FRAC_PI_2, FRAC_PI_2) / PI64) * height;
                ([pixels(middle - half), pixels(middle + half)], [row(latitude + radius), row(latitude - radius)])
            }
            Projection::Fisheye => {
                let sine = x.hypot(y);
                let (angle, rim) = (sine.atan2(z), 0.5 * camera.fov.to_radians());
                let outer = angle + radius;
                let scale = 0.5 * width.min(height) / rim;
                // The projection stretches a disc along the rim; opposite to the axis the disc extends over the whole
                // rim.
                let half =
                    if outer < 3.1 { radius * scale * (outer / outer.sin()).max(1.0) } else { 2.0 * width.max(height) };
                let seen = if angle - radius <= rim { half } else { f64::NEG_INFINITY };
                let middle = DVec2::new(x, -y) / sine.max(1e-12) * angle * scale + 0.5 * DVec2::new(width, height);
                ([middle.x - seen, middle.x + seen], [middle.y - seen, middle.y + seen])
            }
            Projection::Perspective => {
                // Tangent planes of the disc through the eye and an axis of the picture.
                let along = |side: f64, half: f64, size: f64| {
                    let reach = radius.sin() / side.hypot(z).max(1e-12);
                    let turn = if reach < 1.0 { reach.asin() } else { FRAC_PI_2 };
                    let place = |angle: f64| (0.5 + 0.5 * angle.clamp(-1.57, 1.57).tan() / half) * size;
                    let angle = side.atan2(z);
                    if angle.abs() - turn < FRAC_PI_2 { [place(angle - turn), place(angle + turn)] } else { [0.0, 0.0] }
                };
                let tan = f64::from(self.view.tan_half_fov);
                (along(x, tan * width / height, width), along(-y, tan, height))
            }
        };
        let inside = |range: [f64; 2], size: f64| range.map(|v| v.clamp(0.0, size) as f32);
        let [top, bottom] = inside(down, height);
        let [left, right] = match camera.projection {
            Projection::Equirect => across.map(|v| v as f32),
            _ => inside(across, width),
        };
        [left, top, right, bottom]
    }

    /// Sets direction, irradiance, phase and bounding box of a visible moon.
    fn set_moon(&mut self, camera: &Camera, params: &Params) {
        if !params.moon.visible || !params.moon.exists() {
            return;
        }
        let toward = params.moon.direction();
        let sun = params.lights_moon.map_or_else(|| sun_direction(params), DVec3::from_array);
        let beside = sun - sun.dot(toward) * toward;
        let bright = if beside.length() > 1e-9 { beside.normalize() } else { toward.any_orthonormal_vector() };
        self.view.moon_bounds = self.disc_bounds(camera, toward, MOON_RADIUS);
        self.sky.moon_direction = toward.as_vec3().to_array();
        self.sky.moon_light = params.moon.light();
        self.sky.moon_bright = bright.as_vec3().to_array();
        self.sky.moon_phase = params.moon.phase_angle().cos() as f32;
    }

    /// Elevation of a direction above the horizontal plane at the eye, degrees.
    pub(crate) fn height_of(&self, direction: DVec3) -> f64 {
        Vec3::from_array(self.view.zenith).as_dvec3().dot(direction).clamp(-1.0, 1.0).asin().to_degrees()
    }

    /// Ranges of pixels of the strip that contain the discs of sun and moon: first column, first row, number of
    /// columns, number of rows.
    pub(crate) fn disc_pixels(&self, params: &Params) -> Vec<[u32; 4]> {
        let mut found = Vec::new();
        let shown = params.sun.visible && params.sun.irradiance != [0.0; 3];
        let sun = Some(self.view.sun_bounds).filter(|_| shown);
        for [left, top, right, bottom] in sun.into_iter().chain([self.view.moon_bounds]) {
            let first_row = (top.floor() as u32).max(self.dispatch.strip_row);
            let end_row = (bottom.ceil() as u32).min(self.dispatch.strip_row + self.dispatch.rows);
            if !(left < right && top < bottom) || first_row >= end_row {
                continue;
            }
            let columns = (right.ceil() - left.floor()).min(self.view.width as f32) as u32;
            let first_column = (left.floor() as i64).rem_euclid(i64::from(self.view.width)) as u32;
            found.push([first_column, first_row, columns, end_row - first_row]);
        }
        found
    }

    /// Sets the numbers of directions that sample features narrower than a pixel: glow of the sky, phase function.
    fn set_samples(&mut self, params: &Params) {
        let pixel = self.pixel_angle();
        self.view.sky_samples = (pixel / MAX_GLOW_WIDTH).ceil().clamp(1.0, MAX_SKY_SAMPLES) as u32;
        let narrow = phase_width(params);
        let samples = if pixel > 0.4 * narrow { (pixel / (0.2 * narrow)).ceil() } else { 1.0 };
        self.view.phase_samples = samples.clamp(1.0, MAX_PHASE_SAMPLES) as u32;
    }

    /// Whether pixels that see the clouds from above may be wider than clouds (subrays.wgsl).
    pub fn has_subrays(&self) -> bool {
        // Distance to the horizon of the cloud tops, the farthest visible clouds.
        let away = self.view.power_top.max(0.0).sqrt();
        let pixel = self.pixel_angle() * self.grid.spacing() as f32;
        self.view.altitude > self.sky.shell_top && away * pixel > CLOUD_WIDTH * self.sky.leap_scale
    }

    /// Frame whose dispatches march every sample of the strip.
    pub fn at_samples(&self) -> Self {
        let spacing = self.grid.spacing();
        let [march_width, strip_rows] = self.grid.strip(self.dispatch.strip_rows).samples();
        let strip_row = self.dispatch.strip_row / spacing;
        let dispatch = Dispatch { stride: spacing, march_width, strip_row, strip_rows, ..self.dispatch.clone() };
        Self { dispatch, ..self.clone() }
    }

    /// Frame whose dispatches march one sample of each cell of temporal reprojection. `index` counts frames since the
    /// last cut.
    pub fn at_rays(&self, index: u32) -> Self {
        let stride = self.grid.stride() * self.grid.spacing();
        let [subpixel_x, subpixel_y] = self.grid.subpixel(index);
        let [march_width, strip_rows] = self.grid.cells();
        let dispatch = Dispatch { stride, subpixel_x, subpixel_y, march_width, strip_rows, ..self.dispatch.clone() };
        Self { dispatch, ..self.clone() }
    }

    /// Whether the sun can reach the clouds. False implies that `sky_light` has no sunlight (passes/sky.wgsl,
    /// atmosphere.wgsl).
    pub fn sunlit(&self, params: &Params) -> bool {
        if params.atmosphere.enabled {
            return self.sun_above(params, cloud_top(params));
        }
        // Altitude at which `sky_light` is baked: all marched clouds have one irradiance.
        let height = f64::from(0.5 * (params.clouds.base + params.clouds.top));
        let radius = f64::from(params.atmosphere.planet_radius);
        let horizon = -(1.0 - (radius / (radius + height)).powi(2)).max(0.0).sqrt();
        let cosine = Vec3::from_array(self.view.zenith).dot(Vec3::from_array(self.sky.sun_direction));
        // Margins for the sun's disc and for rounding to f32.
        f64::from(cosine) - horizon > -SUN_EDGE - 1e-5 && params.sun.irradiance != [0.0; 3]
    }

    /// Whether clouds cast shadows on the ground visible to `camera`.
    pub fn has_ground_shadow(&self, camera: &Camera, params: &Params) -> bool {
        let clouds = params.has_clouds() || params.has_high_clouds();
        let air = &params.atmosphere;
        // The sun's elevation at the horizon is higher than at the eye by at most the dip, the angle between them
        // around the planet.
        let sine = f64::from(Vec3::from_array(self.view.zenith).dot(Vec3::from_array(self.sky.sun_direction)));
        let up = sine.clamp(-1.0, 1.0).asin() > -f64::from(self.view.horizon_dip) - HALF_SUN;
        let lit = up && params.sun.irradiance != [0.0; 3] && air.ground_albedo != [0.0; 3];
        air.ground_shadows && clouds && lit && self.sees_below(camera, self.view.horizon_dip.into())
    }

    /// Whether clouds cast shadows on the air visible to `camera`.
    pub fn has_light_shafts(&self, camera: &Camera, params: &Params) -> bool {
        let air = &params.atmosphere;
        let top = cloud_top(params);
        let radius = f64::from(air.planet_radius);
        let dip = ((radius + top) / (radius + f64::from(self.view.altitude)).max(1.0)).min(1.0).acos();
        let inside = f64::from(self.view.altitude) <= top;
        let lit = self.sun_above(params, top);
        air.light_shafts && air.enabled && params.has_clouds() && lit && (inside || self.sees_below(camera, dip))
    }

    /// Whether any ray of the picture goes below a horizon, with a margin of half a degree. `dip` is the depression of
    /// the horizon below the horizontal in radians.
    fn sees_below(&self, camera: &Camera, dip: f64) -> bool {
        let down = -Vec3::from_array(self.view.zenith).as_dvec3();
        let horizon = FRAC_PI_2 - dip + 0.01;
        let below = |ray: DVec3| ray.normalize().dot(down).clamp(-1.0, 1.0).acos() < horizon;
        let half = match camera.projection {
            Projection::Equirect => return true,
            Projection::Fisheye => {
                return camera.forward.dot(down).clamp(-1.0, 1.0).acos() - f64::from(self.view.half_fov) < horizon;
            }
            Projection::Perspective => f64::from(self.view.tan_half_fov),
        };
        let wide = half * f64::from(self.view.width) / f64::from(self.view.height);
        let ray = |x: f64, y: f64| camera.forward + x * wide * camera.right + y * half * camera.up;
        let steps = || (0..=32).map(|i| f64::from(i) / 16.0 - 1.0);
        // The nadir is in the picture, or the lowest ray is at its border.
        let ahead = camera.forward.dot(down);
        let nadir = [camera.right.dot(down) / wide, camera.up.dot(down) / half];
        (ahead > 0.0 && nadir.iter().all(|v| v.abs() <= ahead))
            || steps().any(|s| [ray(s, -1.0), ray(s, 1.0), ray(-1.0, s), ray(1.0, s)].into_iter().any(below))
    }

    /// Sets the switches of sunlight on the high clouds.
    fn set_high_sun(&mut self, params: &Params) {
        let up = self.sun_above(params, f64::from(params.high_clouds.altitude));
        self.high_emboss = up && params.high_clouds.emboss > 0.0;
        self.high_low_sun = self.sun_sine() < LOW_SUN[1];
    }

    /// Sine of the sun's elevation at the eye.
    fn sun_sine(&self) -> f64 {
        f64::from(Vec3::from_array(self.view.zenith).dot(Vec3::from_array(self.sky.sun_direction))).clamp(-1.0, 1.0)
    }

    /// Whether the sun reaches any visible cloud up to an altitude in m.
    fn sun_above(&self, params: &Params, altitude: f64) -> bool {
        let radius = f64::from(params.atmosphere.planet_radius);
        let dip = |altitude: f64| (radius / (radius + altitude.max(0.0))).acos();
        // The farthest visible cloud is around the planet by the dips of the eye and of the cloud together. It is lit
        // until the sun is below its own horizon, one more dip of the cloud.
        let lowest = -(dip(f64::from(self.view.altitude)) + 2.0 * dip(altitude) + HALF_SUN);
        self.sun_sine().asin() > lowest && params.sun.irradiance != [0.0; 3]
    }

    /// Sets the factor on the texels of the sky-view LUT. It grows with the depression of the sun below the horizon, as
    /// dusk loses a factor of two or more per degree down to 18 degrees. It grows beyond, where only the night sky is
    /// visible.
    fn set_sky_scale(&mut self, params: &Params) {
        let depth = -self.sun_sine().asin().to_degrees() - f64::from(self.view.horizon_dip).to_degrees();
        self.sky.sky_scale = (1024.0 * (0.75 * depth.clamp(0.0, 40.0)).exp2()) as f32;
        // A night sky that outshines all sunlight has texels of 1000.
        let unit = |sun: f32, night: f32| sun.max(1e-3 * self.sky.sky_scale * night).max(1e-30);
        self.sky.sky_unit = std::array::from_fn(|i| unit(params.sun.irradiance[i], params.atmosphere.night[i]));
    }

    fn set_camera(&mut self, camera: &Camera) {
        self.projection = camera.projection;
        let half = (0.5 * camera.fov).to_radians();
        self.view.tan_half_fov = if camera.projection == Projection::Perspective { half.tan() as f32 } else { 1.0 };
        self.view.half_fov = half as f32;
        self.view.right = camera.right.as_vec3().to_array();
        self.view.up = camera.up.as_vec3().to_array();
        self.view.forward = camera.forward.as_vec3().to_array();
    }

    /// Sets the position of an eye relative to the planet, its cloud layers and its atmosphere.
    pub(crate) fn set_planet(&mut self, eye: DVec3, params: &Params) {
        let radius = f64::from(params.atmosphere.planet_radius);
        let from_centre = eye + DVec3::Z * radius;
        let distance = from_centre.length();
        let h = distance - radius;
        let power = |altitude: f64| ((h - altitude) * (2.0 * radius + h + altitude)) as f32;
        self.view.zenith = if distance > 0.0 { (from_centre / distance).as_vec3().to_array() } else { [0.0, 0.0, 1.0] };
        self.view.altitude = h as f32;
        self.view.centre_distance = distance as f32;
        let reach = chart_reach(eye, radius);
        self.view.chart_reach = reach as f32;
        self.view.chart_slope = (eye.truncate() / reach).as_vec2().to_array();
        self.view.horizon_dip = (radius / (radius + h.max(0.0))).acos() as f32;
        // An eye below the ground counts as on it. Otherwise the ground would hide nothing from there, and would vanish
        // at z = 0.
        self.view.power_ground = power(0.0).max(0.0);
        [self.sky.shell_base, self.sky.shell_top] = params.shell();
        self.sky.lower_top = params.lower_top();
        self.sky.upper_shown = params.upper_shown();
        self.sky.rain_reach = params.rain_reach();
        self.view.power_base = power(f64::from(self.sky.shell_base));
        self.view.power_top = power(f64::from(self.sky.shell_top));
        // Range of distances of shaded air: from the nearest point of the sphere of the cloud tops to where that sphere
        // sinks below the horizon.
        let top = cloud_top(params);
        self.view.power_shade = power(top);
        let tangent = |altitude: f64| (altitude.max(0.0) * (2.0 * radius + altitude)).sqrt();
        self.view.shaft_start = (h - top).max(0.0) as f32;
        self.view.shaft_length = (tangent(h) + tangent(top) - f64::from(self.view.shaft_start)).max(1.0) as f32;
        self.view.power_high = power(f64::from(params.high_clouds.altitude));
        self.view.power_air = power(AIR_TOP);
    }

    /// Sets the extinction of the clouds and the bounds of the user's grid.
    fn set_volume(&mut self, eye: DVec3, params: &Params) {
        let Some(volume) = &params.volume else {
            let upper = if params.has_upper_clouds() { params.upper_clouds.extinction } else { 0.0 };
            let rain = if params.has_rain_shafts() { params.clouds.rain_extinction } else { 0.0 };
            self.sky.extinction = params.clouds.extinction.max(upper).max(rain);
            // The relative extinction of a medium that is present is not 0: where it is marched does not depend on it.
            const MIN_SHARE: f32 = 1e-20;
            let share = |extinction| {
                if self.sky.extinction > 0.0 { f32::max(extinction / self.sky.extinction, MIN_SHARE) } else { 0.0 }
            };
            [self.sky.share, self.sky.upper_share, self.sky.rain_share] =
                [params.clouds.extinction, upper, rain].map(share);
            return;
        };
        let [low, high] = volume.bounds();
        let voxels = DVec3::from_array(volume.size().map(|n| n as f64));
        self.sky.extinction = volume.max();
        self.sky.volume_low = (low - eye).as_vec3().to_array();
        self.sky.volume_high = (high - eye).as_vec3().to_array();
        self.sky.volume_scale = (voxels / (high - low)).as_vec3().to_array();
        self.sky.voxel = ((high - low) / voxels).min_element() as f32;
    }

    /// Sets the positions of the eye in the noises and the weather of the upper deck, which have its scale.
    fn set_upper_wind(&mut self, eye: DVec2, params: &Params, advection: &Advection) {
        let (clouds, upper) = (&params.clouds, &params.upper_clouds);
        let scale = f64::from(upper.scale);
        let (shape, detail) = (eye - advection.upper, eye - advection.upper_detail);
        let plane = |at: DVec2, tile: f32| [wrap(at.x / scale, tile), wrap(at.y / scale, tile)];
        let volume = |at: DVec2, tile: f32| {
            let [x, y] = plane(at, tile);
            [x, y, wrap(-advection.rise / scale, tile)]
        };
        self.sky.upper_direction = compass(f64::from(upper.direction)).as_vec2().to_array();
        self.sky.upper_shape_origin = volume(shape, clouds.shape_scale);
        self.sky.upper_detail_origin = volume(detail, clouds.detail_scale);
        self.sky.upper_curl_origin = plane(detail, clouds.curl_scale);
        // An offset in the map: without it the clouds of both decks would be above one another.
        let extent = f64::from(params.weather.extent);
        let weather = shape + DVec2::new(0.37, 0.61) * extent * scale;
        let (extent, edge) = (params.weather.extent, params.weather.edge);
        self.sky.upper_weather_origin = [weather.x, -weather.y].map(|v| on_map(v / scale, extent, edge));
    }

    /// Sets the positions of the eye in noises, weather and high clouds after advection.
    fn set_wind(&mut self, eye: DVec3, params: &Params, time: f64) {
        let (clouds, wind, high) = (&params.clouds, &params.wind, &params.high_clouds);
        let advection = Advection::at(params, time);
        let volume = |at: DVec2, scale: f32| [wrap(at.x, scale), wrap(at.y, scale), wrap(-advection.rise, scale)];
        let plane = |at: DVec2, scale: f32| [wrap(at.x, scale), wrap(at.y, scale)];
        self.sky.wind_direction = compass(f64::from(wind.direction)).as_vec2().to_array();
        let eye = on_chart(eye, params);
        let (shape, detail) = (eye - advection.shape, eye - advection.detail);
        self.sky.shape_origin = volume(shape, clouds.shape_scale);
        self.sky.detail_origin = volume(detail, clouds.detail_scale);
        self.sky.curl_origin = plane(detail, clouds.curl_scale);

        // The centre of the weather map is the origin of the world, and row 0 is north.
        let weather = eye - advection.weather;
        let half = 0.5 * f64::from(params.weather.extent);
        let (extent, edge) = (params.weather.extent, params.weather.edge);
        self.sky.weather_origin = [on_map(weather.x + half, extent, edge), on_map(half - weather.y, extent, edge)];

        let broad = f64::from(params.weather.broad_extent) * 0.5;
        self.sky.broad_origin = plane(DVec2::new(weather.x + broad, broad - weather.y), params.weather.broad_extent);
        let shares = params.broad_shares();
        self.sky.broad_most = 0.5 * shares.total;
        self.sky.broad_scale = shares.total;
        self.sky.broad_bend = BEND * shares.bend * self.sky.broad_scale;
        let tiles = f64::from(BEND * params.weather.extent / params.weather.broad_extent);
        self.sky.broad_stretch = (tiles * STEEPEST) as f32;
        let fallen = RAIN_SPEED * time / RAIN_STRETCH;
        self.sky.rain_fall = wrap(fallen, clouds.shape_scale) * clouds.shape_scale;
        self.set_upper_wind(eye, params, &advection);

        let (spot, radius) = params.clear_spot();
        self.sky.clear_at = (DVec2::from_array(spot) - eye).as_vec2().to_array();
        self.sky.clear_radius = radius as f32;

        let along = compass(f64::from(high.direction));
        let across = DVec2::new(-along.y, along.x);
        let at = DVec2::new(eye.dot(along), eye.dot(across)) - advection.high;
        self.sky.high_origin = plane(at, high.scale);
        self.sky.high_broad_origin = plane(at, BROAD * high.scale);
        self.sky.high_direction = along.as_vec2().to_array();
        // Time is quantized to steps of 1/256 of the lifetime of the smallest octave, which change no pixel by more
        // than 0.004. A new texture in every frame would take longer than all other bakes.
        let step = 1.0 / (256.0 * f64::from(high.evolution) * f64::from(1u32 << (high.octaves - 1)));
        let time = if step.is_finite() { (time / step).round() * step } else { time };
        for octave in 0..8 {
            let updates = (time * f64::from(high.evolution) + params.drift.evolution) * f64::from(1u32 << octave);
            let number = updates.floor().rem_euclid(f64::from(UPDATES)) as f32;
            let age = (updates - updates.floor()) as f32;
            let (numbers, ages) = if octave < 4 {
                (&mut self.sky.high_update, &mut self.sky.high_age)
            } else {
                (&mut self.sky.high_update_small, &mut self.sky.high_age_small)
            };
            numbers[octave % 4] = number;
            ages[octave % 4] = age;
        }
    }

    /// Sets the split of the phase function that the light field is solved with.
    fn set_split(&mut self, params: &Params) {
        if params.light.model == Model::Multiple {
            let split = Split::new(&params.light);
            let source = split.albedo / (4.0 * PI64);
            self.sky.split = [split.forward, split.mean_cosine, split.scale, source].map(|v| v as f32);
            self.sky.turned_cosine = split.turned_cosine as f32;
        }
    }

    /// Sets shape, position and axes of the light field.
    pub(crate) fn set_field(&mut self, eye: DVec3, params: &Params, time: f64, shape: FieldShape) {
        let [across, along, rows] = shape.cells.map(|n| n as f32);
        self.sky.field_size = [across, along, rows, shape.levels as f32];
        self.sky.field_cell = shape.cell;
        self.sky.field_base = shape.base;
        self.field = Some(shape);
        let anchor = Anchor::still(eye, params, time);
        let eye_in_field = anchor.eye(&Now { params, eye, time });
        self.set_field_levels(&shape, |_| eye_in_field);
        if params.volume.is_some() {
            return;
        }
        // The chart is conformal: the image of a horizontal step is that step, turned and scaled.
        let zenith = Vec3::from_array(self.view.zenith).as_dvec3();
        let (a, b) = zenith.any_orthonormal_pair();
        let image = |step: DVec3| on_chart(eye + step, params) - on_chart(eye - step, params);
        let (of_a, of_b) = (image(a), image(b));
        let axis = |x: f64, y: f64| (x * a + y * b).try_normalize().unwrap_or(a).as_vec3().to_array();
        self.sky.field_east = axis(of_a.x, of_b.x);
        self.sky.field_north = axis(of_a.y, of_b.y);
    }

    /// Sets the rows of the levels of the light field, and the position of the eye relative to the middle of each.
    pub(crate) fn set_field_levels(&mut self, shape: &FieldShape, eye: impl Fn(usize) -> DVec2) {
        for level in 0..shape.levels {
            let eye = eye(level as usize).as_vec2();
            let rows = [shape.rows_before(level), shape.rows(level)].map(|n| n as f32);
            self.sky.field_levels[level as usize] = [eye.x, eye.y, rows[0], rows[1]];
        }
    }

    /// Components of a direction at the eye along the axes of the light field: east, north and up.
    pub(crate) fn in_field(&self, direction: Vec3) -> Vec3 {
        let axes = [self.sky.field_east, self.sky.field_north, self.view.zenith].map(Vec3::from_array);
        Vec3::from_array(axes.map(|axis| axis.dot(direction)))
    }

    /// Sets the camera and the sun of the previous frame and the displacements since in m, for reprojection.
    pub(crate) fn set_previous(&mut self, previous: &Self, eye_motion: DVec3, advection: &Advection) {
        self.view.previous_right = previous.view.right;
        self.view.previous_up = previous.view.up;
        self.view.previous_forward = previous.view.forward;
        self.view.previous_tan_half_fov = previous.view.tan_half_fov;
        self.view.previous_half_fov = previous.view.half_fov;
        self.sky.previous_sun = previous.sky.sun_direction;
        self.view.eye_motion = eye_motion.as_vec3().to_array();
        self.view.cloud_motion = advection.drift().as_vec3().to_array();
    }
}
