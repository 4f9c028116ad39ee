//! Rendering with the light of sun, moon or both. Radiance is linear in the light sources: a picture with both is the
//! sum of two pictures with one source each. Each source has a history of its own.

use std::mem;

use glam::DVec3;

use crate::directions::sun_direction;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Interrupt;
use crate::params::{Moon, Params, Sun};
use crate::passes::display::Screen;
use crate::picture::Picture;
use crate::plan::Target;
use crate::renderer::Renderer;
use crate::scene_depth::SceneDepth;
use crate::shot::Shot;

/// Threshold below which a light source is left out: its strength relative to the other source or to the night sky.
const NEGLIGIBLE: f64 = 1e-4;
/// Decay of the light with the depression of its source below the horizon, in powers of two per degree. Measured on the
/// brightest of sky and clouds: 9, 17, 26 and 34 powers at 6, 12, 18 and 24 degrees.
const DUSK: f64 = 1.4;

/// Parameters of the pictures to add up: one lit by the sun, one by the moon. The first of them includes night sky and
/// ambient light.
struct Lights {
    pub sun: Option<Params>,
    pub moon: Option<Params>,
}

impl Lights {
    /// Significant light sources of a sky in a frame.
    pub fn new(params: &Params, frame: &Frame) -> Self {
        let strength = |direction: DVec3, light: [f32; 3]| {
            let under = -frame.height_of(direction) - f64::from(frame.view.horizon_dip).to_degrees();
            f64::from(light.into_iter().fold(0.0, f32::max)) * (-DUSK * under.max(0.0)).exp2()
        };
        let night = if params.atmosphere.enabled { params.atmosphere.night } else { [0.0; 3] };
        let night = std::f64::consts::PI * f64::from(night.into_iter().fold(0.0, f32::max));
        let sun = strength(sun_direction(params), params.sun.irradiance);
        let moon = if params.moon.exists() { strength(params.moon.direction(), params.moon.light()) } else { 0.0 };
        let by_moon = moon > NEGLIGIBLE * sun.max(night);
        let by_sun = !by_moon || sun > NEGLIGIBLE * moon.max(night);
        let mut lit = by_moon.then(|| moonlit(params));
        if let (true, Some(second)) = (by_sun, &mut lit) {
            second.moon.visible = false;
            second.atmosphere.night = [0.0; 3];
            second.light.ambient = [0.0; 3];
        }
        Self { sun: by_sun.then(|| params.clone()), moon: lit }
    }
}

/// Parameters with the moon as the light source in place of the sun.
fn moonlit(params: &Params) -> Params {
    let Moon { elevation, azimuth, .. } = params.moon;
    let sun = Sun { elevation, azimuth, irradiance: params.moon.light(), visible: false };
    Params { sun, lights_moon: Some(sun_direction(params).to_array()), ..params.clone() }
}

impl Renderer {
    /// Renders a still picture, finished in one call, without history or remaining noise. `layers` fills all layers of
    /// the picture, not the image alone.
    ///
    /// Returns [`Error::Parameter`] for a value that is not allowed.
    pub fn render(&mut self, shot: &Shot<'_>, layers: bool, interrupt: Interrupt<'_>) -> Result<Picture> {
        let still =
            |lit: &mut Self, shot: &Shot<'_>| lit.frame(shot, Target::Still { layers, first_sample: 0 }, interrupt);
        let Lights { sun, moon } = self.lights(shot)?;
        let Some(moon) = moon else { return still(self, &shot.of(sun.as_ref().unwrap_or(shot.params))) };
        let first = sun.map(|sun| still(self, &shot.of(&sun))).transpose()?;
        let zero = zero_scene_color(shot, first.is_some());
        let second =
            self.on_moonlight_renderer(first.is_some(), |lit| still(lit, &relit(shot, &moon, zero.as_deref())))?;
        Ok(match first {
            Some(first) => first.plus(&second),
            None => second,
        })
    }

    /// Renders the next frame of an animation: one pixel in sixteen is marched, the others are reprojected from the
    /// previous frame. The first frame, and the first after a cut, is a still. Returns the image of
    /// [`Renderer::render`].
    ///
    /// Every pixel along edges of the user's scene, in this frame or the previous one, is marched.
    ///
    /// With the reference integrator and with path tracing every frame is a still; a static shot continues to
    /// accumulate paths.
    pub fn animate(&mut self, shot: &Shot<'_>, interrupt: Interrupt<'_>) -> Result<Vec<f32>> {
        self.lit_frame(shot, None, interrupt)
    }

    /// Renders the next frame of an animation to a screen texture of the picture's size, without a readback.
    pub fn animate_onto(&mut self, screen: &Screen, shot: &Shot<'_>, interrupt: Interrupt<'_>) -> Result<()> {
        if screen.size() != self.size {
            let [width, height] = screen.size();
            let [w, h] = self.size;
            return Err(Error::parameter("screen", format!("{width} x {height}"), format!("of {w} x {h} pixels")));
        }
        self.lit_frame(shot, Some(screen), interrupt).map(drop)
    }

    fn lit_frame(&mut self, shot: &Shot<'_>, screen: Option<&Screen>, interrupt: Interrupt<'_>) -> Result<Vec<f32>> {
        let Lights { sun, moon } = self.lights(shot)?;
        let Some(moon) = moon else {
            self.moonlit.iter_mut().for_each(|lit| lit.forget());
            return self.next_frame(&shot.of(sun.as_ref().unwrap_or(shot.params)), screen, interrupt);
        };
        let Some(sun) = sun else {
            self.forget();
            return self.on_moonlight_renderer(false, |lit| lit.next_frame(&shot.of(&moon), screen, interrupt));
        };
        let mut image = self.next_frame(&shot.of(&sun), None, interrupt)?;
        let zero = zero_scene_color(shot, true);
        let make = |lit: &mut Self| lit.next_frame(&relit(shot, &moon, zero.as_deref()), None, interrupt);
        add_light(&mut image, &self.on_moonlight_renderer(true, make)?);
        screen.map_or(Ok(()), |screen| screen.write(&self.gpu, &image))?;
        Ok(image)
    }

    /// Significant light sources of a shot.
    fn lights(&mut self, shot: &Shot<'_>) -> Result<Lights> {
        if !shot.params.moon.exists() {
            return Ok(Lights { sun: Some(shot.params.clone()), moon: None });
        }
        let (frame, _) = shot.checked(self.size, &self.quality)?;
        Ok(Lights::new(shot.params, &frame))
    }

    /// Runs `make` on the renderer of moonlight. Its timings are added to ours if the picture is only a `part`, and
    /// replace ours otherwise.
    fn on_moonlight_renderer<T>(&mut self, part: bool, make: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        let mut lit = match self.moonlit.take() {
            Some(lit) => lit,
            None => Box::new(Self::on(self.gpu.clone(), self.size, self.quality.clone())),
        };
        let made = make(&mut lit);
        let times = mem::take(&mut lit.timings);
        self.moonlit = Some(lit);
        if part {
            times.0.iter().for_each(|(label, time)| self.timings.add(label, *time));
        } else {
            self.timings = times;
        }
        made
    }
}

impl Picture {
    /// Sum of two pictures of the same sky with one light source each.
    fn plus(mut self, other: &Self) -> Self {
        add_light(&mut self.image, &other.image);
        add_light(&mut self.sky, &other.sky);
        self.samples.iter_mut().zip(&other.samples).for_each(|(sum, more)| *sum += more);
        // Both pictures trace the same paths, so that their errors may be correlated.
        self.uncertainty.iter_mut().zip(&other.uncertainty).for_each(|(sum, more)| *sum += more);
        self
    }
}

/// Adds the light of another picture of the same sky, which has the same alpha.
fn add_light(image: &mut [f32], other: &[f32]) {
    for (sum, more) in image.chunks_exact_mut(4).zip(other.chunks_exact(4)) {
        sum[..3].iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
}

/// Zero radiance of the user's scene for the second picture, if the first one includes the scene.
fn zero_scene_color(shot: &Shot<'_>, in_first: bool) -> Option<Vec<f32>> {
    shot.scene.and_then(|scene| scene.color).filter(|_| in_first).map(|color| vec![0.0; color.len()])
}

/// Shot with other parameters and, if given, another radiance of the scene.
fn relit<'a>(shot: &Shot<'a>, params: &'a Params, color: Option<&'a [f32]>) -> Shot<'a> {
    let scene = shot.scene.map(|scene| SceneDepth { distance: scene.distance, color: color.or(scene.color) });
    Shot { params, scene, ..*shot }
}
