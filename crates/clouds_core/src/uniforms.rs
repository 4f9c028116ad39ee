//! The uniform blocks that follow from a picture, by how long they hold: `frame` with its parts `view` and `sky`, and `dispatch`.
//! The third, `params`, is what the user sets.

use crate::gpu::{Binding, Gpu};
use crate::schema::{self, Block};

crate::params! {
    /// Eye, camera and planet, and where they were in the frame before. Worked out in f64 (frame.rs).
    View {
        /// Width of the picture in pixels.
        width: u32 = 1;
        /// Height of the picture in pixels.
        height: u32 = 1;
        /// 1 to put the clouds before the sky, 0 to return them alone.
        background: u32 = 1;
        /// 1 where eye, view, clouds or the user's scene have moved since the frame before.
        moving: u32 = 0;
        /// Most rays through a pixel that is wider than clouds (subrays.wgsl).
        most_rays: f32 = 1.0;
        /// Number of the first path of each pixel (passes/path).
        first_sample: u32 = 0;
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
        /// Width of the frame before, where it had another size.
        previous_width: u32 = 1;
        /// Its height.
        previous_height: u32 = 1;
        /// Pixels from one that its clouds were known at to the next.
        previous_spacing: u32 = 1;
        /// Frames in which each of those was marched once.
        previous_cycle: u32 = 1;
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
        /// The same for the lowest clouds.
        power_base: f32 = 0.0;
        /// The same for the highest.
        power_top: f32 = 0.0;
        /// The same for the highest that shade the air, be they procedural or the user's.
        power_shade: f32 = 0.0;
        /// The same for the high clouds.
        power_high: f32 = 0.0;
        /// The same for the top of the air.
        power_air: f32 = 0.0;
        /// The distance of the eye from the planet's centre and the part of it along the axis through the origin, together, m
        /// (chart.wgsl).
        chart_reach: f32 = 12742000.0;
        /// Where the eye is beside that axis, as a share of it: east and north.
        chart_slope: [f32; 2] = [0.0, 0.0];
        /// Left, top, right and bottom of a part of the picture that holds the sun's disc, pixels; of a panorama maybe beyond its
        /// sides. Nothing where it is not in the picture.
        sun_bounds: [f32; 4] = [0.0; 4];
        /// The same of the moon's.
        moon_bounds: [f32; 4] = [0.0; 4];
        /// In how many directions, across and down, each pixel looks at the sky (passes/composite).
        sky_samples: u32 = 1;
        /// The same of the phase function (light.wgsl).
        phase_samples: u32 = 1;
        /// 1 where its radiance is known.
        scene_lit: u32 = 0;
        /// Distance from which on rays may meet such air, m.
        shaft_start: f32 = 0.0;
        /// How much farther away the last of it is, m.
        shaft_length: f32 = 1.0;
    }
}

crate::params! {
    /// Sun, moon, clouds and winds as the eye finds them at the time of the frame. Worked out in f64 (frame.rs).
    Sky {
        /// Lowest altitude of procedural clouds and rain, m.
        shell_base: f32 = 0.0;
        /// Highest.
        shell_top: f32 = 1.0;
        /// Highest altitude of the first deck, m.
        lower_top: f32 = 1.0;
        /// How much the second deck shows, 0 where its cover is 0.
        upper_shown: f32 = 0.0;
        /// How far rain falls, as a share of its way to the ground.
        rain_reach: f32 = 0.0;
        /// The shortest of the scales by which the base shape varies: of what `quality.leap` is a share, m.
        leap_scale: f32 = 1.0;
        /// Extinction where the density is 1: the largest of clouds, upper clouds and rain, 1/m.
        extinction: f32 = 0.0;
        /// That of the clouds as a share of it.
        share: f32 = 1.0;
        /// That of the upper clouds.
        upper_share: f32 = 0.0;
        /// That of the rain.
        rain_share: f32 = 0.0;
        /// Lowest corner of the user's grid, relative to the eye, m.
        volume_low: [f32; 3] = [0.0; 3];
        /// Highest corner.
        volume_high: [f32; 3] = [0.0; 3];
        /// Its voxels in a metre along each axis.
        volume_scale: [f32; 3] = [0.0; 3];
        /// The shortest side of a voxel, m.
        voxel: f32 = 0.0;
        /// Of the fit of cloud droplets (droplets.wgsl): g of its Henyey-Greenstein lobe, g and alpha of Draine's, and the
        /// share of that.
        droplet: [f32; 4] = [0.0; 4];
        /// By what the sky map is multiplied (atmosphere.wgsl).
        sky_scale: f32 = 1024.0;
        /// By what it is divided: irradiance.
        sky_unit: [f32; 3] = [1.0; 3];
        /// Unit vector toward the sun.
        sun_direction: [f32; 3] = [0.0, 0.0, 1.0];
        /// The same of the frame before.
        previous_sun: [f32; 3] = [0.0, 0.0, 1.0];
        /// The middle of the spot to keep clear, relative to the eye, m.
        clear_at: [f32; 2] = [0.0, 0.0];
        /// Its radius, m.
        clear_radius: f32 = 0.0;
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
        /// Where the eye stands in the larger weather map (v down).
        broad_origin: [f32; 2] = [0.0, 0.0];
        /// By what its texels are multiplied.
        broad_scale: f32 = 0.0;
        /// The most that it shifts anything by.
        broad_most: f32 = 0.0;
        /// By how many of its tiles the smaller one is bent where the larger map's alpha is 1.
        broad_bend: f32 = 0.0;
        /// How much longer at most a way in the smaller map becomes by that.
        broad_stretch: f32 = 0.0;
        /// How far the rain has fallen, in the noise, which is squeezed along its streaks, m.
        rain_fall: f32 = 0.0;
        /// Unit vector toward which the upper deck's wind blows.
        upper_direction: [f32; 2] = [0.0, 1.0];
        /// As `shape_origin`, for the upper deck.
        upper_shape_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// As `detail_origin`.
        upper_detail_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// As `curl_origin`.
        upper_curl_origin: [f32; 2] = [0.0, 0.0];
        /// As `weather_origin`.
        upper_weather_origin: [f32; 2] = [0.0, 0.0];
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
        /// Unit vector toward the moon.
        moon_direction: [f32; 3] = [0.0, 0.0, 1.0];
        /// Its irradiance.
        moon_light: [f32; 3] = [0.0; 3];
        /// Unit vector at right angles to that toward the moon, to the side of it that the sun lights.
        moon_bright: [f32; 3] = [1.0, 0.0, 0.0];
        /// Cosine of the angle at the moon between sun and eye: 1 when it is full.
        moon_phase: f32 = 1.0;
        /// Side of a texel of the user's shadow map, or of the finest level of the ground's (ground_shadow.wgsl), m.
        shadow_texel: f32 = 1.0;
        /// Where the eye is in those levels, after the wind, m from their middle.
        shadow_eye: [f32; 2] = [0.0; 2];
    }
}

crate::params! {
    /// Which pixels or rays a dispatch is for.
    Dispatch {
        /// First row of this band of the picture (of the marched rows, in `march`).
        first_row: u32 = 0;
        /// Rows of this band.
        rows: u32 = 1;
        /// First column of the pixels of a disc of light (passes/composite).
        first_column: u32 = 0;
        /// How many columns they are.
        columns: u32 = 1;
        /// First row that the buffers hold: where this sheet begins (of the marched rows, in `march`).
        strip_row: u32 = 0;
        /// Rows that they hold.
        strip_rows: u32 = 1;
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
        /// Threads among which the device shares the workgroups of a dispatch, 1 unless it is a processor (workgroups.wgsl).
        threads: u32 = 1;
        /// Rays of the list in this dispatch (passes/march, passes/reference, passes/path).
        active_rays: u32 = 0;
        /// The first of them (passes/march).
        first_ray: u32 = 0;
        /// Turns that each may take.
        budget: u32 = 0;
    }
}

/// A uniform block of several parts.
pub(crate) fn uniform(parts: &[&dyn Block]) -> Binding {
    Binding::block(&schema::words(parts))
}

impl Dispatch {
    /// Its uniform block, by name.
    pub(crate) fn binding(&self, gpu: &Gpu) -> (&'static str, Binding) {
        ("dispatch", uniform(&[&Self { threads: gpu.threads, ..self.clone() }]))
    }
}
