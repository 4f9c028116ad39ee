//! What the renderer knows about a frame and its user does not set: the `frame` uniform. Everything that would lose
//! its digits in f32 (planet radii, long times, distant eyes) is worked out here in f64.

use std::f32::consts::PI;

use glam::{DVec2, DVec3, Vec3};

use crate::camera::{Camera, Projection};
use crate::params;
use crate::params::{Edge, Params};
use crate::passes::sun_volume;

params! {
    /// What the renderer knows about a frame.
    Frame {
        /// Width of the picture in pixels.
        width: u32 = 1;
        /// Height of the picture in pixels.
        height: u32 = 1;
        /// First row of this band of the picture (of the marched rows, in `march`).
        first_row: u32 = 0;
        /// Rows of this band.
        rows: u32 = 1;
        /// First row that the buffers hold: where this sheet begins (of the marched rows, in `march`).
        sheet_row: u32 = 0;
        /// Rows that they hold.
        sheet_rows: u32 = 1;
        /// Every how many pixels one is marched, in both directions.
        stride: u32 = 1;
        /// Which of them, across.
        subpixel_x: u32 = 0;
        /// Which of them, down.
        subpixel_y: u32 = 0;
        /// Pixels marched in a row.
        march_width: u32 = 1;
        /// Every how many of those a ray is known, in both directions (passes/refine).
        lattice: u32 = 1;
        /// 1 when the rays look for cloud where their neighbours have found it, 0 when they look everywhere.
        spans: u32 = 0;
        /// 1 to put the clouds before the sky, 0 to return them alone.
        background: u32 = 1;
        /// 1 when anything but the jitter differs from the frame before.
        moving: u32 = 0;
        /// Shift of the blue noise from frame to frame.
        jitter_shift: f32 = 0.0;

        /// Rays of the list in this dispatch (passes/march, passes/reference, passes/path).
        active_rays: u32 = 0;
        /// The first of them (passes/march).
        first_ray: u32 = 0;
        /// Turns that each may take.
        budget: u32 = 0;
        /// Number of the first path of each pixel (passes/path).
        first_sample: u32 = 0;

        /// Projection, as in camera.wgsl, for which kernels are compiled.
        camera_kind: u32 = 0;
        /// 1 where there are high clouds, for which `composite` is compiled.
        high_clouds: u32 = 0;
        /// 1 where nothing has been marched, as there are no clouds, for which `composite` is compiled.
        cloudless: u32 = 0;
        /// Tangent of half the vertical field of view.
        tan_half_fov: f32 = 1.0;
        /// Half the field of view of a fisheye in radians.
        half_fov: f32 = 1.0;
        /// Camera axis.
        right: [f32; 3] = [1.0, 0.0, 0.0];
        /// Camera axis.
        up: [f32; 3] = [0.0, 0.0, 1.0];
        /// Camera axis.
        forward: [f32; 3] = [0.0, 1.0, 0.0];

        /// The same of the frame before.
        previous_right: [f32; 3] = [1.0, 0.0, 0.0];
        /// The same of the frame before.
        previous_up: [f32; 3] = [0.0, 0.0, 1.0];
        /// The same of the frame before.
        previous_forward: [f32; 3] = [0.0, 1.0, 0.0];
        /// The same of the frame before.
        previous_tan_half_fov: f32 = 1.0;
        /// The same of the frame before.
        previous_half_fov: f32 = 1.0;
        /// How far the eye has moved since the frame before, m.
        eye_motion: [f32; 3] = [0.0, 0.0, 0.0];
        /// How far the wind has carried the clouds since the frame before, m.
        cloud_motion: [f32; 3] = [0.0, 0.0, 0.0];
        /// Distance at which pixels without clouds are reprojected, m.
        far_distance: f32 = 100000.0;

        /// Unit vector away from the planet's centre, at the eye.
        zenith: [f32; 3] = [0.0, 0.0, 1.0];
        /// Altitude of the eye, m.
        altitude: f32 = 0.0;
        /// Distance of the eye from the planet's centre, m.
        centre_distance: f32 = 6371000.0;
        /// Angle of the horizon below the horizontal at the eye, radians.
        horizon_dip: f32 = 0.0;
        /// Power of the eye's point for the ground: (h - H)(2R + h + H) for a sphere at altitude H, m^2.
        power_ground: f32 = 0.0;
        /// The same for the base of the clouds.
        power_base: f32 = 0.0;
        /// The same for their top.
        power_top: f32 = 0.0;
        /// The same for the high clouds.
        power_high: f32 = 0.0;
        /// The same for the top of the air.
        power_air: f32 = 0.0;

        /// Extinction where the density is 1, 1/m.
        extinction: f32 = 0.0;
        /// Lowest corner of the user's grid, relative to the eye, m.
        volume_low: [f32; 3] = [0.0; 3];
        /// Highest corner.
        volume_high: [f32; 3] = [0.0; 3];
        /// Its voxels in a metre along each axis.
        volume_scale: [f32; 3] = [0.0; 3];
        /// The shortest side of a voxel, m.
        voxel: f32 = 0.0;

        /// Where the eye is in the sun volume, after the wind, m from its middle (sun_volume.wgsl).
        sun_volume_eye: [f32; 2] = [0.0; 2];

        /// Unit vector toward the sun.
        sun_direction: [f32; 3] = [0.0, 0.0, 1.0];
        /// Unit vector toward which the wind blows.
        wind_direction: [f32; 2] = [0.0, 1.0];
        /// Where the eye stands in the base shape's tile, after the wind, with the z of altitude 0.
        shape_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// The same in the detail's tile.
        detail_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// The same in the curl noise's tile.
        curl_origin: [f32; 2] = [0.0, 0.0];
        /// The same in the weather map (v down).
        weather_origin: [f32; 2] = [0.0, 0.0];
        /// The same in the high clouds' texture, along and across their wind.
        high_origin: [f32; 2] = [0.0, 0.0];
        /// The same in the second, broader read of that texture.
        high_broad_origin: [f32; 2] = [0.0, 0.0];
        /// Unit vector along the high clouds' wind.
        high_direction: [f32; 2] = [0.0, 1.0];
        /// How far each of the four large octaves of the high clouds is from its old update to its new one.
        high_age: [f32; 4] = [0.0; 4];
        /// The same for the four small ones.
        high_age_small: [f32; 4] = [0.0; 4];
        /// Number of the old update of the large octaves.
        high_update: [f32; 4] = [0.0; 4];
        /// The same for the small ones.
        high_update_small: [f32; 4] = [0.0; 4];
    }
}

/// How much larger the second read of the high clouds' texture is than the first (as in high_layer.wgsl).
const HIGH_BROAD: f32 = 3.2;

/// Altitude where the air ends, m (Hillaire 2020).
const AIR_TOP: f64 = 100_000.0;

/// The unit vector toward the sun.
pub fn sun_direction(params: &Params) -> DVec3 {
    let (elevation, azimuth) = (f64::from(params.sun.elevation), f64::from(params.sun.azimuth));
    let level = compass(azimuth) * elevation.to_radians().cos();
    DVec3::new(level.x, level.y, elevation.to_radians().sin())
}

/// The unit vector toward a compass direction in degrees, clockwise from north.
fn compass(degrees: f64) -> DVec2 {
    // Quarter turns are exact, so that a wind to the east does not blow north by 1e-16 of its way.
    let quarters = (degrees / 90.0).round();
    let (sin, cos) = (degrees - 90.0 * quarters).to_radians().sin_cos();
    match quarters.rem_euclid(4.0) as u32 {
        0 => DVec2::new(sin, cos),
        1 => DVec2::new(cos, -sin),
        2 => DVec2::new(-sin, -cos),
        _ => DVec2::new(-cos, sin),
    }
}

/// The fractional part of `v / period`, in f64: f32 coordinates would be metres off after a week of wind (hazard 13).
fn wrap(v: f64, period: f32) -> f32 {
    let fraction = (v / f64::from(period)).rem_euclid(1.0) as f32;
    // Rounding to f32 may give 1.0, which is 0; and a way too long for f64 has no fraction.
    if fraction < 1.0 { fraction } else { 0.0 }
}

/// How far the clouds drift in a time, m. What the eye follows is the silhouette: it drifts with the weather, and its
/// billows with the base shape.
pub(crate) fn drift(params: &Params, elapsed: f64) -> DVec3 {
    let wind = &params.wind;
    let weather = compass(f64::from(wind.weather_direction)) * f64::from(wind.weather_speed);
    let shape = compass(f64::from(wind.direction)) * f64::from(wind.speed);
    ((weather + shape) * 0.5).extend(0.5 * f64::from(wind.updraft)) * elapsed
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

impl Frame {
    /// The frame of a picture of `size` pixels seen by `camera` at `time` seconds.
    pub fn new(camera: &Camera, params: &Params, time: f64, size: [u32; 2]) -> Self {
        let mut frame =
            Self { width: size[0], height: size[1], rows: size[1], march_width: size[0], ..Self::default() };
        frame.set_camera(camera);
        frame.set_planet(camera.eye, params);
        frame.set_wind(camera.eye, params, time);
        frame.set_volume(camera.eye, params);
        frame.sun_volume_eye = sun_volume::eye_in(camera.eye, params, time);
        frame.high_clouds = u32::from(params.high_clouds.coverage > 0.0);
        frame.sun_direction = sun_direction(params).as_vec3().to_array();
        frame
    }

    /// Angle between marched pixels in the middle of the picture, radians (`pixel_width` of camera.wgsl).
    pub fn marched_angle(&self) -> f32 {
        let pixel = match self.camera_kind {
            kind if kind == Projection::Equirect as u32 => 2.0 * PI / self.width as f32,
            kind if kind == Projection::Fisheye as u32 => 2.0 * self.half_fov / self.width.min(self.height) as f32,
            _ => 2.0 * self.tan_half_fov / self.height as f32,
        };
        pixel * self.stride as f32
    }

    /// Whether the sun can reach the clouds: false only where `sky_light` is none (passes/sky.wgsl, atmosphere.wgsl).
    pub fn sunlit(&self, params: &Params) -> bool {
        let height = f64::from(0.5 * (params.clouds.base + params.clouds.top));
        let radius = f64::from(params.atmosphere.planet_radius);
        let horizon = -(1.0 - (radius / (radius + height)).powi(2)).max(0.0).sqrt();
        let cosine = Vec3::from_array(self.zenith).dot(Vec3::from_array(self.sun_direction));
        // The sun's half degree, and what f32 may be off.
        f64::from(cosine) - horizon > -0.005 - 1e-5 && params.sun.irradiance != [0.0; 3]
    }

    fn set_camera(&mut self, camera: &Camera) {
        self.camera_kind = camera.projection as u32;
        let half = (0.5 * camera.fov).to_radians();
        self.tan_half_fov = if camera.projection == Projection::Perspective { half.tan() as f32 } else { 1.0 };
        self.half_fov = half as f32;
        self.right = camera.right.as_vec3().to_array();
        self.up = camera.up.as_vec3().to_array();
        self.forward = camera.forward.as_vec3().to_array();
    }

    fn set_planet(&mut self, eye: DVec3, params: &Params) {
        let radius = f64::from(params.atmosphere.planet_radius);
        let from_centre = eye + DVec3::Z * radius;
        let distance = from_centre.length();
        let h = distance - radius;
        let power = |altitude: f64| ((h - altitude) * (2.0 * radius + h + altitude)) as f32;
        self.zenith = if distance > 0.0 { (from_centre / distance).as_vec3().to_array() } else { [0.0, 0.0, 1.0] };
        self.altitude = h as f32;
        self.centre_distance = distance as f32;
        self.horizon_dip = (radius / (radius + h.max(0.0))).acos() as f32;
        // An eye under the ground is on it: were the ground to hide nothing from there, it would vanish at z = 0.
        self.power_ground = power(0.0).max(0.0);
        self.power_base = power(f64::from(params.clouds.base));
        self.power_top = power(f64::from(params.clouds.top));
        self.power_high = power(f64::from(params.high_clouds.altitude));
        self.power_air = power(AIR_TOP);
    }

    fn set_volume(&mut self, eye: DVec3, params: &Params) {
        let Some(volume) = &params.volume else {
            self.extinction = params.clouds.extinction;
            return;
        };
        let [low, high] = volume.bounds();
        let voxels = DVec3::from_array(volume.size().map(|n| n as f64));
        self.extinction = volume.max();
        self.volume_low = (low - eye).as_vec3().to_array();
        self.volume_high = (high - eye).as_vec3().to_array();
        self.volume_scale = (voxels / (high - low)).as_vec3().to_array();
        self.voxel = ((high - low) / voxels).min_element() as f32;
    }

    fn set_wind(&mut self, eye: DVec3, params: &Params, time: f64) {
        let (clouds, wind, high) = (&params.clouds, &params.wind, &params.high_clouds);
        let direction = compass(f64::from(wind.direction));
        let rise = -f64::from(wind.updraft) * time;
        let drifted = |speed: f32| eye.truncate() - direction * f64::from(speed) * time;
        let volume = |at: DVec2, scale: f32| [wrap(at.x, scale), wrap(at.y, scale), wrap(rise, scale)];
        let plane = |at: DVec2, scale: f32| [wrap(at.x, scale), wrap(at.y, scale)];
        self.wind_direction = direction.as_vec2().to_array();
        self.shape_origin = volume(drifted(wind.speed), clouds.shape_scale);
        self.detail_origin = volume(drifted(wind.detail_speed), clouds.detail_scale);
        self.curl_origin = plane(drifted(wind.detail_speed), clouds.curl_scale);

        // The middle of the weather map is the origin of the world, its first row the north.
        let weather =
            eye.truncate() - compass(f64::from(wind.weather_direction)) * f64::from(wind.weather_speed) * time;
        let half = 0.5 * f64::from(params.weather.extent);
        let (extent, edge) = (params.weather.extent, params.weather.edge);
        self.weather_origin = [on_map(weather.x + half, extent, edge), on_map(half - weather.y, extent, edge)];

        let along = compass(f64::from(high.direction));
        let across = DVec2::new(-along.y, along.x);
        let at = eye.truncate() - along * f64::from(high.speed) * time;
        let at = DVec2::new(at.dot(along), at.dot(across));
        self.high_origin = plane(at, high.scale);
        self.high_broad_origin = plane(at, HIGH_BROAD * high.scale);
        self.high_direction = along.as_vec2().to_array();
        // In steps of a 512th of the smallest octave's life, which change no pixel by more than two thousandths: a new
        // texture in every frame would take longer than all else that is baked.
        let step = 1.0 / (512.0 * f64::from(high.evolution) * f64::from(1u32 << (high.octaves - 1)));
        let time = if step.is_finite() { (time / step).round() * step } else { time };
        for octave in 0..8 {
            let updates = time * f64::from(high.evolution) * f64::from(1u32 << octave);
            // Update numbers come round after 65,536, exact in f32 (passes/high_clouds.wgsl).
            let (number, age) = (updates.floor().rem_euclid(65536.0) as f32, (updates - updates.floor()) as f32);
            let (numbers, ages) = if octave < 4 {
                (&mut self.high_update, &mut self.high_age)
            } else {
                (&mut self.high_update_small, &mut self.high_age_small)
            };
            numbers[octave % 4] = number;
            ages[octave % 4] = age;
        }
    }

    /// Notes what has changed since the frame before, for reprojection.
    pub fn set_previous(&mut self, previous: &Self, eye_motion: DVec3, params: &Params, elapsed: f64) {
        self.previous_right = previous.right;
        self.previous_up = previous.up;
        self.previous_forward = previous.forward;
        self.previous_tan_half_fov = previous.tan_half_fov;
        self.previous_half_fov = previous.half_fov;
        self.eye_motion = eye_motion.as_vec3().to_array();
        self.cloud_motion = drift(params, elapsed).as_vec3().to_array();
    }
}
