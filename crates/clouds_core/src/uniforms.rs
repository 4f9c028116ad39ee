//! Uniform blocks derived from a picture, by lifetime: `frame` with its parts `view` and `sky`, and `dispatch`. The
//! third block, `params`, holds what the user sets.

use crate::gpu::{Binding, Gpu};
use crate::schema::{self, Block};

crate::params! {
    /// Camera, eye and planet in this frame and the previous one. Computed in f64 (frame.rs).
    View {
        /// Width of the picture, pixels.
        width: u32 = 1;
        /// Height of the picture, pixels.
        height: u32 = 1;
        /// 1 to composite the clouds over the background, 0 to return the clouds alone.
        background: u32 = 1;
        /// 1 if eye, view, clouds or the user's scene have moved since the previous frame.
        moving: u32 = 0;
        /// Maximum number of rays through a pixel that is wider than clouds (subrays.wgsl).
        most_rays: f32 = 1.0;
        /// Index of the first path of each pixel (passes/path).
        first_sample: u32 = 0;
        /// Tangent of half the vertical field of view.
        tan_half_fov: f32 = 1.0;
        /// Half the field of view of a fisheye, radians.
        half_fov: f32 = 1.0;
        /// Camera axis, right.
        right: [f32; 3] = [1.0, 0.0, 0.0];
        /// Camera axis, up.
        up: [f32; 3] = [0.0, 0.0, 1.0];
        /// Camera axis, forward.
        forward: [f32; 3] = [0.0, 1.0, 0.0];
        /// Right axis of the previous frame's camera.
        previous_right: [f32; 3] = [1.0, 0.0, 0.0];
        /// Up axis of the previous frame's camera.
        previous_up: [f32; 3] = [0.0, 0.0, 1.0];
        /// Forward axis of the previous frame's camera.
        previous_forward: [f32; 3] = [0.0, 1.0, 0.0];
        /// Tangent of half the vertical field of view of the previous frame.
        previous_tan_half_fov: f32 = 1.0;
        /// Half the field of view of a fisheye in the previous frame, radians.
        previous_half_fov: f32 = 1.0;
        /// Width of the previous frame, pixels; it may differ.
        previous_width: u32 = 1;
        /// Height of the previous frame, pixels.
        previous_height: u32 = 1;
        /// Sample spacing of the previous frame, pixels.
        previous_spacing: u32 = 1;
        /// Number of frames in which each sample of the previous frame was marched once.
        previous_cycle: u32 = 1;
        /// Displacement of the eye since the previous frame, m.
        eye_motion: [f32; 3] = [0.0, 0.0, 0.0];
        /// Displacement of the clouds by the wind since the previous frame, m.
        cloud_motion: [f32; 3] = [0.0, 0.0, 0.0];
        /// Distance at which pixels without clouds are reprojected, m.
        far_distance: f32 = 100000.0;
        /// Unit vector away from the planet's centre, at the eye.
        zenith: [f32; 3] = [0.0, 0.0, 1.0];
        /// Altitude of the eye, m.
        altitude: f32 = 0.0;
        /// Distance of the eye from the planet's centre, m.
        centre_distance: f32 = 6371000.0;
        /// Depression of the horizon below the horizontal at the eye, radians.
        horizon_dip: f32 = 0.0;
        /// Power of the eye with respect to the sphere of the ground: (h - H)(2R + h + H) for a sphere at altitude H,
        /// m^2.
        power_ground: f32 = 0.0;
        /// Power of the eye with respect to the sphere of the lowest clouds, m^2.
        power_base: f32 = 0.0;
        /// Power of the eye with respect to the sphere of the highest clouds, m^2.
        power_top: f32 = 0.0;
        /// Power of the eye with respect to the sphere of the highest clouds, procedural or user-supplied, that shade
        /// the air, m^2.
        power_shade: f32 = 0.0;
        /// Power of the eye with respect to the sphere of the high clouds, m^2.
        power_high: f32 = 0.0;
        /// Power of the eye with respect to the sphere of the top of the atmosphere, m^2.
        power_air: f32 = 0.0;
        /// Distance of the eye from the planet's centre plus its component along the axis through the origin, m
        /// (chart.wgsl).
        chart_reach: f32 = 12742000.0;
        /// Horizontal position of the eye, east and north, divided by `chart_reach`.
        chart_slope: [f32; 2] = [0.0, 0.0];
        /// Bounding box of the sun's disc: left, top, right and bottom, pixels. It may exceed the sides of a panorama,
        /// and is empty if the disc is outside the picture.
        sun_bounds: [f32; 4] = [0.0; 4];
        /// Bounding box of the moon's disc, as `sun_bounds`.
        moon_bounds: [f32; 4] = [0.0; 4];
        /// Directions per axis over which the sky is averaged in a pixel (passes/composite).
        sky_samples: u32 = 1;
        /// Directions per axis over which the phase function is averaged in a pixel (light.wgsl).
        phase_samples: u32 = 1;
        /// 1 if the radiance of the user's scene is given.
        scene_lit: u32 = 0;
        /// Distance from which on rays can meet air that clouds shade, m.
        shaft_start: f32 = 0.0;
        /// Length of the range of distances in which air is shaded, m.
        shaft_length: f32 = 1.0;
    }
}

crate::params! {
    /// Sun, moon, clouds and winds relative to the eye at the time of the frame. Computed in f64 (frame.rs).
    Sky {
        /// Lowest altitude of procedural clouds and rain, m.
        shell_base: f32 = 0.0;
        /// Highest altitude of procedural clouds, m.
        shell_top: f32 = 1.0;
        /// Highest altitude of the lower deck, m.
        lower_top: f32 = 1.0;
        /// Fraction of its height range that the upper deck is given, 0 at a coverage of 0.
        upper_shown: f32 = 0.0;
        /// Fraction of the way to the ground that rain falls.
        rain_reach: f32 = 0.0;
        /// Shortest scale of variation of the base shape, m; `quality.sphere_tracing` is relative to it.
        leap_scale: f32 = 1.0;
        /// Extinction at density 1: the largest of clouds, upper deck and rain, 1/m.
        extinction: f32 = 0.0;
        /// Extinction of the lower deck relative to `extinction`.
        share: f32 = 1.0;
        /// Extinction of the upper deck relative to `extinction`.
        upper_share: f32 = 0.0;
        /// Extinction of the rain relative to `extinction`.
        rain_share: f32 = 0.0;
        /// Lowest corner of the user's grid, relative to the eye, m.
        volume_low: [f32; 3] = [0.0; 3];
        /// Highest corner of the user's grid, relative to the eye, m.
        volume_high: [f32; 3] = [0.0; 3];
        /// Voxels of the user's grid per metre along each axis.
        volume_scale: [f32; 3] = [0.0; 3];
        /// Shortest side of a voxel, m.
        voxel: f32 = 0.0;
        /// Fit to the phase function of cloud droplets (droplets.wgsl): g of the Henyey-Greenstein lobe, g and alpha of
        /// the Draine lobe, weight of the Draine lobe.
        droplet: [f32; 4] = [0.0; 4];
        /// Split of the phase function (light_field.wgsl): fraction of the light that keeps going, mean cosine, scale of
        /// the extinction, scaled albedo over 4 pi.
        split: [f32; 4] = [0.0, 0.0, 1.0, 0.0];
        /// Mean cosine of the light that turns.
        turned_cosine: f32 = 0.0;
        /// Cells of the finest level of the light field: across, along, rows; number of levels, 0 without a field.
        field_size: [f32; 4] = [1.0, 1.0, 1.0, 0.0];
        /// Cell of the finest level, m.
        field_cell: [f32; 3] = [1.0; 3];
        /// Altitude of the base of the lowest row, m.
        field_base: f32 = 0.0;
        /// Levels of the light field: position of the eye relative to the middle of the level, after advection, on the
        /// chart, m; first row in the textures of all levels; number of rows.
        field_levels: [[f32; 4]; 8] = [[0.0; 4]; 8];
        /// Axes of the light field at the eye, in the world: east and north on the chart.
        field_east: [f32; 3] = [1.0, 0.0, 0.0];
        /// As `field_east`.
        field_north: [f32; 3] = [0.0, 1.0, 0.0];
        /// Factor on the texels of the sky-view LUT (atmosphere.wgsl).
        sky_scale: f32 = 1024.0;
        /// Irradiance that the texels of the sky-view LUT are divided by.
        sky_unit: [f32; 3] = [1.0; 3];
        /// Unit vector toward the sun.
        sun_direction: [f32; 3] = [0.0, 0.0, 1.0];
        /// Unit vector toward the sun in the previous frame.
        previous_sun: [f32; 3] = [0.0, 0.0, 1.0];
        /// Centre of the region kept clear of clouds, relative to the eye, m.
        clear_at: [f32; 2] = [0.0, 0.0];
        /// Radius of the region kept clear of clouds, m.
        clear_radius: f32 = 0.0;
        /// Unit vector toward which the wind blows.
        wind_direction: [f32; 2] = [0.0, 1.0];
        /// Position of the eye in the tile of the base shape after advection, from 0 to 1; z belongs to altitude 0.
        shape_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// Position of the eye in the tile of the detail noise, as `shape_origin`.
        detail_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// Position of the eye in the tile of the curl noise.
        curl_origin: [f32; 2] = [0.0, 0.0];
        /// Position of the eye in the weather map (v down).
        weather_origin: [f32; 2] = [0.0, 0.0];
        /// Position of the eye in the large-scale weather map (v down).
        broad_origin: [f32; 2] = [0.0, 0.0];
        /// Factor on the texels of the large-scale weather map.
        broad_scale: f32 = 0.0;
        /// Largest offset by the large-scale weather map.
        broad_most: f32 = 0.0;
        /// Distortion of the weather map where the alpha of the large-scale map is 1, in tiles of the weather map.
        broad_bend: f32 = 0.0;
        /// Largest relative elongation of paths in the weather map by that distortion.
        broad_stretch: f32 = 0.0;
        /// Distance that rain has fallen, in the space of the noise, which is compressed along the streaks, m.
        rain_fall: f32 = 0.0;
        /// Unit vector toward which the wind of the upper deck blows.
        upper_direction: [f32; 2] = [0.0, 1.0];
        /// Position of the eye in the tile of the base shape of the upper deck, as `shape_origin`.
        upper_shape_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// Position of the eye in the tile of the detail noise of the upper deck, as `shape_origin`.
        upper_detail_origin: [f32; 3] = [0.0, 0.0, 0.0];
        /// Position of the eye in the tile of the curl noise of the upper deck.
        upper_curl_origin: [f32; 2] = [0.0, 0.0];
        /// Position of the eye in the weather map for the upper deck (v down).
        upper_weather_origin: [f32; 2] = [0.0, 0.0];
        /// Position of the eye in the texture of the high clouds, along and across their wind.
        high_origin: [f32; 2] = [0.0, 0.0];
        /// Position of the eye in the second, larger-scale read of the texture of the high clouds.
        high_broad_origin: [f32; 2] = [0.0, 0.0];
        /// Unit vector along the wind of the high clouds.
        high_direction: [f32; 2] = [0.0, 1.0];
        /// Weight of the new update in the crossfade of each of the four largest octaves of the high clouds.
        high_age: [f32; 4] = [0.0; 4];
        /// Weight of the new update in the crossfade of each of the four smallest octaves of the high clouds.
        high_age_small: [f32; 4] = [0.0; 4];
        /// Index of the old update of each of the four largest octaves of the high clouds.
        high_update: [f32; 4] = [0.0; 4];
        /// Index of the old update of each of the four smallest octaves of the high clouds.
        high_update_small: [f32; 4] = [0.0; 4];
        /// Unit vector toward the moon.
        moon_direction: [f32; 3] = [0.0, 0.0, 1.0];
        /// Irradiance of the moon.
        moon_light: [f32; 3] = [0.0; 3];
        /// Unit vector perpendicular to `moon_direction`, toward the lit side of the moon.
        moon_bright: [f32; 3] = [1.0, 0.0, 0.0];
        /// Cosine of the phase angle, at the moon between sun and eye; 1 at full moon.
        moon_phase: f32 = 1.0;
        /// Texel size of the user's shadow map, or of the finest level of the shadow clipmap on the ground
        /// (ground_shadow.wgsl), m.
        shadow_texel: f32 = 1.0;
        /// Position of the eye relative to the centre of the shadow clipmap, after advection, m.
        shadow_eye: [f32; 2] = [0.0; 2];
    }
}

crate::params! {
    /// Range of pixels or rays of a dispatch.
    Dispatch {
        /// First row of this slice, in pixels of the picture (in `march`, in marched rows).
        first_row: u32 = 0;
        /// Number of rows of this slice.
        rows: u32 = 1;
        /// First column of the pixels of a disc of light (passes/composite).
        first_column: u32 = 0;
        /// Number of columns of those pixels; in passes/points the number of points.
        columns: u32 = 1;
        /// First row of the strip that the buffers hold, in pixels of the picture (in `march`, in marched rows).
        strip_row: u32 = 0;
        /// Number of rows of the strip.
        strip_rows: u32 = 1;
        /// Spacing of marched pixels along both axes, pixels.
        stride: u32 = 1;
        /// Offset of the marched pixel in its cell, across, pixels.
        subpixel_x: u32 = 0;
        /// Offset of the marched pixel in its cell, down, pixels.
        subpixel_y: u32 = 0;
        /// Number of marched pixels per row.
        march_width: u32 = 1;
        /// Spacing of the samples of adaptive sampling along both axes, in marched pixels (passes/refine).
        grid_spacing: u32 = 1;
        /// 1 if rays search for cloud only in the range where their neighbours found it, 0 if along their full length.
        spans: u32 = 0;
        /// Worker threads among which a CPU device distributes workgroups; 1 on a GPU (workgroups.wgsl).
        threads: u32 = 1;
        /// Number of listed rays in this dispatch (passes/march, passes/reference, passes/path).
        active_rays: u32 = 0;
        /// Index of the first ray in the list (passes/march).
        first_ray: u32 = 0;
        /// Maximum number of loop iterations of each ray in this dispatch.
        budget: u32 = 0;
    }
}

crate::params! {
    /// Level of the light field while it is baked (passes/light_field).
    FieldLevel {
        /// Cells toward the east.
        across: u32 = 1;
        /// Cells toward the north.
        along: u32 = 1;
        /// Cells upward.
        rows: u32 = 1;
        /// Light that enters at the sides (luts/light_field.rs).
        sides: u32 = 0;
        /// Cell, m.
        cell: [f32; 3] = [1.0; 3];
        /// Cells of the coarser level, 0 if there is none.
        coarser_across: u32 = 0;
        /// As `coarser_across`.
        coarser_along: u32 = 0;
        /// As `coarser_across`.
        coarser_rows: u32 = 0;
        /// Cells of the coarser level per cell.
        coarser_scale: [f32; 3] = [1.0; 3];
        /// Position of the middle relative to that of the coarser level, in cells of that.
        coarser_offset: [f32; 2] = [0.0; 2];
        /// Whether it is a grid that corrects a finer one: without sun and sky.
        corrects: u32 = 0;
        /// First row in the textures of all levels.
        first_row: u32 = 0;
        /// Number of the lowest row. Staircases along directions are tied to it: a row that is added above or below
        /// leaves those of the others alone.
        lowest: f32 = 0.0;
        /// Unit vector toward the sun, in the axes of the field.
        sun: [f32; 3] = [0.0, 0.0, 1.0];
        /// Whether the sun reaches the clouds.
        sunlit: u32 = 0;
        /// Curvature of the ground, half of the reciprocal of its radius, 1/m.
        bend: f32 = 0.0;
        /// Whether the tilted directions cross a row in less than a cell, in flat cells.
        tilt_crosses: u32 = 0;
        /// As `tilt_crosses`, of the coarser level.
        coarser_tilt_crosses: u32 = 0;
        /// Largest number of cells that a ray toward the sun crosses in this level.
        sun_steps: u32 = 1;
    }
}

/// Uniform block of several parts.
pub(crate) fn uniform(parts: &[&dyn Block]) -> Binding {
    Binding::block(&schema::words(parts))
}

impl Dispatch {
    /// Binding of this block, by name.
    pub(crate) fn binding(&self, gpu: &Gpu) -> (&'static str, Binding) {
        ("dispatch", uniform(&[&Self { threads: gpu.threads, ..self.clone() }]))
    }
}
