//! What the renderer knows about a frame and its user does not set. Everything that would lose its digits in f32 (planet radii,
//! long times, distant eyes) is worked out here in f64.

use std::f32::consts::PI;
use std::f64::consts::{FRAC_PI_2, PI as PI64};

use glam::{DVec2, DVec3, Vec3};

use crate::camera::{Camera, Projection};
use crate::clipmap;
use crate::directions::{compass, sun_direction};
use crate::gpu::{Binding, Gpu};
use crate::grid::SampleGrid;
use crate::moon::MOON_RADIUS;
use crate::params;
use crate::params::{Edge, Model, Params, Phase};
use crate::shared::constants;
use crate::uniforms::{Dispatch, Sky, View, uniform};
use crate::wind::Advection;

/// A frame of a picture or of an answer: its uniform blocks, and what its kernels are compiled for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Eye, camera and planet.
    pub view: View,
    /// Sun, moon, clouds and winds.
    pub sky: Sky,
    /// Which pixels a dispatch is for, unless it says otherwise: all of the strip.
    pub dispatch: Dispatch,
    /// How the camera projects.
    pub projection: Projection,
    /// Which pixels hold a sample of the clouds.
    pub(crate) grid: SampleGrid,
    /// There are high clouds.
    pub high_clouds: bool,
    /// They are embossed, and the sun reaches any of them in sight.
    pub high_emboss: bool,
    /// The sun is so low that it shines on each of them in its own way.
    pub high_low_sun: bool,
    /// Nothing is marched, as there are no clouds.
    pub cloudless: bool,
    /// There is a scene of the user's.
    pub scene: bool,
    /// Clouds cast shadows on the ground in sight.
    pub ground_shadow: bool,
    /// Clouds cast shadows on the air in sight.
    pub light_shafts: bool,
}

constants! {
    /// Altitude where the air ends, m (Hillaire 2020).
    const AIR_TOP: f64 = 100_000.0;
    /// The sun's angular radius, radians: 0.2666 degrees (IAU: 695 700 km at 1 au).
    const SUN_RADIUS: f64 = 0.004_654;
    /// Sine of the angle to the horizon from which on the sun is seen whole, or not at all: half its width, rounded up.
    const SUN_EDGE: f64 = 0.005;
    /// How many times longer than wide streaks of rain are.
    const RAIN_STRETCH: f64 = 12.0;
    /// Width of clouds, as a share of the distance from one to the next (`leap_scale`).
    const CLOUD_WIDTH: f32 = 0.5;
    /// Least that the chart's scale is the planet's diameter over, planet radii: nearer to the antipode of the origin,
    /// from 172 degrees on, the chart would have no end.
    const CHART_END: f64 = 0.01;
    /// How many times larger the second read of the high clouds is than the first: no small ratio, so that they do not
    /// repeat together.
    const BROAD: f32 = 3.2;
    /// Updates of an octave of the high clouds after which their numbers come round: all are exact in f32.
    const UPDATES: u32 = 65_536;
    /// Sines of the sun's height, 12 and 20 degrees, between which its light goes over from another on each of the high
    /// clouds in sight to the same on all.
    const LOW_SUN: [f64; 2] = [0.208, 0.342];
}

/// What the sun's half width and f32 may add to its height, radians.
const HALF_SUN: f64 = SUN_EDGE + 0.001;

/// By how many tiles of the smaller map a value of 1 bends it. Measured on the default sky, whose clouds stand 5 km apart: the
/// tiles next to each other are bent apart by more than that nearly everywhere.
const BEND: f32 = 0.8;
/// The steepest that a baked value changes, for each width of the map.
const STEEPEST: f64 = 40.0;

/// Speed of falling rain, m/s: of drops of 2.5 mm (Gunn and Kinzer 1949).
const RAIN_SPEED: f64 = 7.4;

/// Widest pixel that sees the glow around the sun as it is in its middle, radians: a seventh of the half width of the forward
/// peak of aerosol (g = 0.8), with which the mean differs by 0.5 % where it is brightest.
const GLOW: f32 = 0.032;
/// Most directions, across and down, for the sky and for the phase function.
const MOST_SKY: f32 = 12.0;
const MOST_PHASE: f32 = 64.0;

/// The parameters of the phase function of droplets of 5 to 50 µm diameter (Jendersie and d'Eon 2023, equations 4 to 7).
fn droplet(diameter: f64) -> [f64; 4] {
    [
        (-0.099_056_7 / (diameter - 1.671_54)).exp(),
        (-2.206_79 / (diameter + 3.910_29) - 0.428_934).exp(),
        (3.624_89 - 8.292_88 / (diameter + 5.528_25)).exp(),
        (-0.599_085 / (diameter - 0.641_583) - 0.665_888).exp(),
    ]
}

/// The half width of the narrowest peak of the phase function of clouds, radians.
fn phase_width(params: &Params) -> f32 {
    let light = &params.light;
    let peak = |g: f32| (1.0 - g.abs()) / g.abs().max(1e-3).sqrt();
    match light.phase {
        Phase::HenyeyGreenstein if matches!(light.model, Model::Thesis2018 | Model::Vsu2022) => {
            peak(light.g).min(peak(light.g_back))
        }
        Phase::HenyeyGreenstein => peak(light.g),
        Phase::Droplet => peak(droplet(f64::from(light.droplet_diameter))[0] as f32),
        // Half a ring of the glory, or of the aureole: light of 0.55 µm on a disc as wide as the droplet.
        Phase::Mie => 0.5 * 0.55 / light.droplet_diameter,
    }
}

/// The fractional part of `v / period`, in f64: f32 coordinates would be metres off after a week of wind.
fn wrap(v: f64, period: f32) -> f32 {
    let fraction = (v / f64::from(period)).rem_euclid(1.0) as f32;
    // Rounding to f32 may give 1.0, which is 0; and a way too long for f64 has no fraction.
    if fraction < 1.0 { fraction } else { 0.0 }
}

/// Where `v` is on a weather map that is `extent` wide, from 0 to 1 across it, in f64 as `wrap`.
fn on_map(v: f64, extent: f32, edge: Edge) -> f32 {
    match edge {
        Edge::Repeat => wrap(v, extent),
        // A map and its mirror image repeat together.
        Edge::Mirror => 2.0 * wrap(0.5 * v, extent),
        // So far away that f32 does not tell where, no map is in sight; and a way too long for f64 leads nowhere.
        Edge::Clamp if v.is_nan() => 0.0,
        Edge::Clamp => (v / f64::from(extent)).clamp(-1e12, 1e12) as f32,
    }
}

/// Altitude of the highest marched clouds, m: for the user's grid of its highest corner.
fn highest(params: &Params) -> f64 {
    let Some(volume) = &params.volume else { return f64::from(params.shell()[1]) };
    let [low, high] = volume.bounds();
    let radius = f64::from(params.atmosphere.planet_radius);
    let far = low.abs().max(high.abs());
    DVec3::new(far.x, far.y, high.z + radius).length() - radius
}

/// The distance between features of the noise and of each weather; so short where the cover may go from nothing to all of it
/// within a texel of the user's map that leaps by a fifth of it reach half a texel. Measured, islands of a texel: a whole one
/// loses half as many again as big steps do.
fn leap_scale(params: &Params) -> f32 {
    let of_weather = |(weather, _): (params::Weather, f32)| match &weather.map {
        Some(map) => 2.5 * weather.extent / map.width.max(map.height) as f32,
        None => weather.scale,
    };
    params.weather_shares().into_iter().map(of_weather).fold(params.clouds.shape_scale, f32::min)
}

/// What the scale of the chart at a point is the planet's diameter over, m (chart.wgsl).
fn chart_reach(at: DVec3, radius: f64) -> f64 {
    let from_centre = at + DVec3::Z * radius;
    (from_centre.length() + from_centre.z).max(CHART_END * radius)
}

/// Where a point lies on the chart of weather and noises, m east and north of the origin (chart.wgsl).
fn on_chart(at: DVec3, params: &Params) -> DVec2 {
    let radius = f64::from(params.atmosphere.planet_radius);
    2.0 * radius / chart_reach(at, radius) * at.truncate()
}

impl Frame {
    /// Its uniform blocks.
    pub(crate) fn bindings(&self, gpu: &Gpu) -> [(&'static str, Binding); 2] {
        [("frame", uniform(&[&self.view, &self.sky])), self.dispatch.binding(gpu)]
    }

    /// What the camera and the size of a picture say of it.
    pub fn seen_by(camera: &Camera, [width, height]: [u32; 2]) -> Self {
        let mut frame = Self::default();
        [frame.view.width, frame.view.height] = [width, height];
        frame.grid.size = [width, height];
        frame.dispatch = Dispatch { rows: height, march_width: width, ..Dispatch::default() };
        frame.set_camera(camera);
        frame
    }

    /// The frame of a picture of `size` pixels seen by `camera` at `time` seconds.
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
        frame.set_sky_scale(params);
        frame.view.sun_bounds = frame.disc_bounds(camera, sun_direction(params), SUN_RADIUS);
        frame.set_moon(camera, params);
        frame.set_samples(params);
        frame
    }

    /// Angle between marched pixels in the middle of the picture, radians.
    pub fn marched_angle(&self) -> f32 {
        self.pixel_angle() * self.dispatch.stride as f32
    }

    /// Width of a pixel there, radians (`pixel_width` of camera.wgsl).
    fn pixel_angle(&self) -> f32 {
        match self.projection {
            Projection::Equirect => (2.0 * PI / self.view.width as f32).max(PI / self.view.height as f32),
            Projection::Fisheye => 2.0 * self.view.half_fov / self.view.width.min(self.view.height) as f32,
            Projection::Perspective => 2.0 * self.view.tan_half_fov / self.view.height as f32,
        }
    }

    /// Left, top, right and bottom of a part of the picture that holds a disc in a direction, of a radius in radians; empty where
    /// it is not in the picture.
    fn disc_bounds(&self, camera: &Camera, direction: DVec3, radius: f64) -> [f32; 4] {
        let (width, height) = (f64::from(self.view.width), f64::from(self.view.height));
        let [x, y, z] = [camera.right, camera.up, camera.forward].map(|axis| direction.dot(axis));
        // With room for what f32 makes of it.
        let radius = 1.02 * radius;
        let (across, down) = match camera.projection {
            Projection::Equirect => {
                let latitude = y.clamp(-1.0, 1.0).asin();
                // Around a pole it is everywhere.
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
                // Away from the axis what is round is wide, and opposite it everywhere.
                let half =
                    if outer < 3.1 { radius * scale * (outer / outer.sin()).max(1.0) } else { 2.0 * width.max(height) };
                let seen = if angle - radius <= rim { half } else { f64::NEG_INFINITY };
                let middle = DVec2::new(x, -y) / sine.max(1e-12) * angle * scale + 0.5 * DVec2::new(width, height);
                ([middle.x - seen, middle.x + seen], [middle.y - seen, middle.y + seen])
            }
            Projection::Perspective => {
                // The planes through the eye and an axis of the picture that touch the disc.
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

    /// What is seen of the moon.
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

    /// Height over the level at the eye, degrees.
    pub(crate) fn height_of(&self, direction: DVec3) -> f64 {
        Vec3::from_array(self.view.zenith).as_dvec3().dot(direction).clamp(-1.0, 1.0).asin().to_degrees()
    }

    /// The pixels of the sheet that discs of light are drawn in: first column, first row, columns, rows.
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

    /// How finely wide pixels look at what is narrower than they are.
    fn set_samples(&mut self, params: &Params) {
        let pixel = self.pixel_angle();
        self.view.sky_samples = (pixel / GLOW).ceil().clamp(1.0, MOST_SKY) as u32;
        let narrow = phase_width(params);
        let samples = if pixel > 0.4 * narrow { (pixel / (0.2 * narrow)).ceil() } else { 1.0 };
        self.view.phase_samples = samples.clamp(1.0, MOST_PHASE) as u32;
    }

    /// Whether pixels that look down on the clouds may be wider than those are (subrays.wgsl).
    pub fn has_subrays(&self) -> bool {
        // The farthest of them that the eye can see.
        let away = self.view.power_top.max(0.0).sqrt();
        let pixel = self.pixel_angle() * self.grid.spacing() as f32;
        self.view.altitude > self.sky.shell_top && away * pixel > CLOUD_WIDTH * self.sky.leap_scale
    }

    /// The frame whose dispatches march every sample of the strip.
    pub fn at_samples(&self) -> Self {
        let spacing = self.grid.spacing();
        let [march_width, strip_rows] = self.grid.strip(self.dispatch.strip_rows).samples();
        let strip_row = self.dispatch.strip_row / spacing;
        let dispatch = Dispatch { stride: spacing, march_width, strip_row, strip_rows, ..self.dispatch.clone() };
        Self { dispatch, ..self.clone() }
    }

    /// The frame whose dispatches march one sample of each cell of temporal reprojection: the frame `index` since the last cut.
    pub fn at_rays(&self, index: u32) -> Self {
        let stride = self.grid.stride() * self.grid.spacing();
        let [subpixel_x, subpixel_y] = self.grid.subpixel(index);
        let [march_width, strip_rows] = self.grid.cells();
        let dispatch = Dispatch { stride, subpixel_x, subpixel_y, march_width, strip_rows, ..self.dispatch.clone() };
        Self { dispatch, ..self.clone() }
    }

    /// Whether the sun can reach the clouds: false only where `sky_light` is none (passes/sky.wgsl, atmosphere.wgsl).
    pub fn sunlit(&self, params: &Params) -> bool {
        if params.atmosphere.enabled {
            return self.sun_above(params, highest(params));
        }
        // Where `sky_light` is worked out; one light for all marched clouds.
        let height = f64::from(0.5 * (params.clouds.base + params.clouds.top));
        let radius = f64::from(params.atmosphere.planet_radius);
        let horizon = -(1.0 - (radius / (radius + height)).powi(2)).max(0.0).sqrt();
        let cosine = Vec3::from_array(self.view.zenith).dot(Vec3::from_array(self.sky.sun_direction));
        // The sun's half degree, and what f32 may be off.
        f64::from(cosine) - horizon > -SUN_EDGE - 1e-5 && params.sun.irradiance != [0.0; 3]
    }

    /// Whether clouds cast shadows on the ground that `camera` sees.
    pub fn has_ground_shadow(&self, camera: &Camera, params: &Params) -> bool {
        let clouds = params.has_clouds() || params.has_high_clouds();
        let air = &params.atmosphere;
        // As far around the planet as the horizon is, the sun stands higher by as much.
        let sine = f64::from(Vec3::from_array(self.view.zenith).dot(Vec3::from_array(self.sky.sun_direction)));
        let up = sine.clamp(-1.0, 1.0).asin() > -f64::from(self.view.horizon_dip) - HALF_SUN;
        let lit = up && params.sun.irradiance != [0.0; 3] && air.ground_albedo != [0.0; 3];
        air.ground_shadows && clouds && lit && self.sees_below(camera, self.view.horizon_dip.into())
    }

    /// Whether clouds cast shadows on the air that `camera` sees.
    pub fn has_light_shafts(&self, camera: &Camera, params: &Params) -> bool {
        let air = &params.atmosphere;
        let top = highest(params);
        let radius = f64::from(air.planet_radius);
        let dip = ((radius + top) / (radius + f64::from(self.view.altitude)).max(1.0)).min(1.0).acos();
        let inside = f64::from(self.view.altitude) <= top;
        let lit = self.sun_above(params, top);
        air.beams && air.enabled && params.has_clouds() && lit && (inside || self.sees_below(camera, dip))
    }

    /// Whether any ray of a picture goes below a horizon at an angle under the level, or within half a degree of it.
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
        // Straight down is in the picture, or the lowest ray is on its rim.
        let ahead = camera.forward.dot(down);
        let nadir = [camera.right.dot(down) / wide, camera.up.dot(down) / half];
        (ahead > 0.0 && nadir.iter().all(|v| v.abs() <= ahead))
            || steps().any(|s| [ray(s, -1.0), ray(s, 1.0), ray(-1.0, s), ray(1.0, s)].into_iter().any(below))
    }

    /// What the sun asks of the high clouds.
    fn set_high_sun(&mut self, params: &Params) {
        let up = self.sun_above(params, f64::from(params.high_clouds.altitude));
        self.high_emboss = up && params.high_clouds.emboss > 0.0;
        self.high_low_sun = self.sun_sine() < LOW_SUN[1];
    }

    /// Sine of the sun's height at the eye.
    fn sun_sine(&self) -> f64 {
        f64::from(Vec3::from_array(self.view.zenith).dot(Vec3::from_array(self.sky.sun_direction))).clamp(-1.0, 1.0)
    }

    /// Whether the sun reaches any cloud in sight up to an altitude.
    fn sun_above(&self, params: &Params, altitude: f64) -> bool {
        let radius = f64::from(params.atmosphere.planet_radius);
        let dip = |altitude: f64| (radius / (radius + altitude.max(0.0))).acos();
        // The farthest of them in sight is as far around the planet as the horizons of the eye and of the layer lie apart,
        // and sees the sun until it is under a horizon of its own.
        let lowest = -(dip(f64::from(self.view.altitude)) + 2.0 * dip(altitude) + HALF_SUN);
        self.sun_sine().asin() > lowest && params.sun.irradiance != [0.0; 3]
    }

    /// What the sky map is multiplied by: the deeper the sun under the horizon, the more, as dusk loses a factor of two or
    /// more with every degree, to the 18th and, as then the night is what is seen, beyond.
    fn set_sky_scale(&mut self, params: &Params) {
        let depth = -self.sun_sine().asin().to_degrees() - f64::from(self.view.horizon_dip).to_degrees();
        self.sky.sky_scale = (1024.0 * (0.75 * depth.clamp(0.0, 40.0)).exp2()) as f32;
        // Where the night outshines all that the sun may give, it is 1000 in the map.
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

    /// Puts the planet under an eye.
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
        // An eye under the ground is on it: were the ground to hide nothing from there, it would vanish at z = 0.
        self.view.power_ground = power(0.0).max(0.0);
        [self.sky.shell_base, self.sky.shell_top] = params.shell();
        self.sky.lower_top = params.lower_top();
        self.sky.upper_shown = params.upper_shown();
        self.sky.rain_reach = params.rain_reach();
        self.view.power_base = power(f64::from(self.sky.shell_base));
        self.view.power_top = power(f64::from(self.sky.shell_top));
        // The air that they shade: from where the eye is nearest to it to where the last of it goes under the horizon.
        let top = highest(params);
        self.view.power_shade = power(top);
        let tangent = |altitude: f64| (altitude.max(0.0) * (2.0 * radius + altitude)).sqrt();
        self.view.shaft_start = (h - top).max(0.0) as f32;
        self.view.shaft_length = (tangent(h) + tangent(top) - f64::from(self.view.shaft_start)).max(1.0) as f32;
        self.view.power_high = power(f64::from(params.high_clouds.altitude));
        self.view.power_air = power(AIR_TOP);
    }

    fn set_volume(&mut self, eye: DVec3, params: &Params) {
        let Some(volume) = &params.volume else {
            let upper = if params.has_upper_clouds() { params.upper_clouds.extinction } else { 0.0 };
            let rain = if params.has_rain_shafts() { params.clouds.rain_extinction } else { 0.0 };
            self.sky.extinction = params.clouds.extinction.max(upper).max(rain);
            // No share of what is there is 0: that it is thin does not change where it is marched.
            const LEAST: f32 = 1e-20;
            let share = |extinction| {
                if self.sky.extinction > 0.0 { f32::max(extinction / self.sky.extinction, LEAST) } else { 0.0 }
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

    /// The noises and the weather of the upper deck, which are scaled with it.
    fn set_upper_wind(&mut self, eye: DVec2, params: &Params, carried: &Advection) {
        let (clouds, upper) = (&params.clouds, &params.upper_clouds);
        let scale = f64::from(upper.scale);
        let (shape, detail) = (eye - carried.upper, eye - carried.upper_detail);
        let plane = |at: DVec2, tile: f32| [wrap(at.x / scale, tile), wrap(at.y / scale, tile)];
        let volume = |at: DVec2, tile: f32| {
            let [x, y] = plane(at, tile);
            [x, y, wrap(-carried.rise / scale, tile)]
        };
        self.sky.upper_direction = compass(f64::from(upper.direction)).as_vec2().to_array();
        self.sky.upper_shape_origin = volume(shape, clouds.shape_scale);
        self.sky.upper_detail_origin = volume(detail, clouds.detail_scale);
        self.sky.upper_curl_origin = plane(detail, clouds.curl_scale);
        // Another part of the map, or one deck would stand on the other.
        let extent = f64::from(params.weather.extent);
        let weather = shape + DVec2::new(0.37, 0.61) * extent * scale;
        let (extent, edge) = (params.weather.extent, params.weather.edge);
        self.sky.upper_weather_origin = [weather.x, -weather.y].map(|v| on_map(v / scale, extent, edge));
    }

    fn set_wind(&mut self, eye: DVec3, params: &Params, time: f64) {
        let (clouds, wind, high) = (&params.clouds, &params.wind, &params.high_clouds);
        let carried = Advection::at(params, time);
        let volume = |at: DVec2, scale: f32| [wrap(at.x, scale), wrap(at.y, scale), wrap(-carried.rise, scale)];
        let plane = |at: DVec2, scale: f32| [wrap(at.x, scale), wrap(at.y, scale)];
        self.sky.wind_direction = compass(f64::from(wind.direction)).as_vec2().to_array();
        let eye = on_chart(eye, params);
        let (shape, detail) = (eye - carried.shape, eye - carried.detail);
        self.sky.shape_origin = volume(shape, clouds.shape_scale);
        self.sky.detail_origin = volume(detail, clouds.detail_scale);
        self.sky.curl_origin = plane(detail, clouds.curl_scale);

        // The middle of the weather map is the origin of the world, its first row the north.
        let weather = eye - carried.weather;
        let half = 0.5 * f64::from(params.weather.extent);
        let (extent, edge) = (params.weather.extent, params.weather.edge);
        self.sky.weather_origin = [on_map(weather.x + half, extent, edge), on_map(half - weather.y, extent, edge)];

        let broad = f64::from(params.weather.broad_extent) * 0.5;
        self.sky.broad_origin = plane(DVec2::new(weather.x + broad, broad - weather.y), params.weather.broad_extent);
        let shares = params.broad_shares();
        self.sky.broad_most = 0.5 * shares.total;
        self.sky.broad_scale = shares.total;
        self.sky.broad_bend = BEND * shares.bend * self.sky.broad_scale;
        let ways = f64::from(BEND * params.weather.extent / params.weather.broad_extent);
        self.sky.broad_stretch = (ways * STEEPEST) as f32;
        let fallen = RAIN_SPEED * time / RAIN_STRETCH;
        self.sky.rain_fall = wrap(fallen, clouds.shape_scale) * clouds.shape_scale;
        self.set_upper_wind(eye, params, &carried);

        let (spot, radius) = params.clear_spot();
        self.sky.clear_at = (DVec2::from_array(spot) - eye).as_vec2().to_array();
        self.sky.clear_radius = radius as f32;

        let along = compass(f64::from(high.direction));
        let across = DVec2::new(-along.y, along.x);
        let at = DVec2::new(eye.dot(along), eye.dot(across)) - carried.high;
        self.sky.high_origin = plane(at, high.scale);
        self.sky.high_broad_origin = plane(at, BROAD * high.scale);
        self.sky.high_direction = along.as_vec2().to_array();
        // In steps of a 256th of the smallest octave's life, which change no pixel by more than four thousandths: a new
        // texture in every frame would take longer than all else that is baked.
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

    /// Notes what has changed since the frame before, for reprojection.
    pub(crate) fn set_previous(&mut self, previous: &Self, eye_motion: DVec3, carried: &Advection) {
        self.view.previous_right = previous.view.right;
        self.view.previous_up = previous.view.up;
        self.view.previous_forward = previous.view.forward;
        self.view.previous_tan_half_fov = previous.view.tan_half_fov;
        self.view.previous_half_fov = previous.view.half_fov;
        self.sky.previous_sun = previous.sky.sun_direction;
        self.view.eye_motion = eye_motion.as_vec3().to_array();
        self.view.cloud_motion = carried.drift().as_vec3().to_array();
    }
}
