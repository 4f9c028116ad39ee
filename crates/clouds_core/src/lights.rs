//! Pictures by the light of sun, moon or both. Radiance is linear in its sources, so that one by both is the sum of two, each
//! with one of them, whose history is its own.

use std::mem;

use glam::DVec3;

use crate::directions::sun_direction;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Interrupt;
use crate::params::{Moon, Params, Sun};
use crate::passes::display::Screen;
use crate::picture::Picture;
use crate::renderer::Renderer;
use crate::scene_depth::SceneDepth;
use crate::shot::Shot;

/// Light that is fainter than this share of the other source's, or of the night's, is left out.
const NEGLIGIBLE: f64 = 1e-4;
/// By how many powers of two light falls with each degree that its source is under the horizon. Measured, the brightest of sky
/// and clouds: 9, 17, 26 and 34 at 6, 12, 18 and 24 degrees.
const DUSK: f64 = 1.4;

/// The skies whose pictures are one sky's together: that of the sun, and that of the moon. What comes from neither is in the first.
struct Lights {
    pub sun: Option<Params>,
    pub moon: Option<Params>,
}

impl Lights {
    /// Of a sky as it is seen in a frame.
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

/// The same sky with the moon's light in place of the sun's.
fn moonlit(params: &Params) -> Params {
    let Moon { elevation, azimuth, .. } = params.moon;
    let sun = Sun { elevation, azimuth, irradiance: params.moon.light(), visible: false };
    Params { sun, lights_moon: Some(sun_direction(params).to_array()), ..params.clone() }
}

impl Renderer {
    /// A still: finished in one call, without history or noise to wait for. `layers` fills those of the picture beside its image
    /// too.
    pub fn render(&mut self, shot: &Shot<'_>, layers: bool, interrupt: Interrupt<'_>) -> Result<Picture> {
        let still = |lit: &mut Self, shot: &Shot<'_>| lit.still(shot, layers, 0, interrupt);
        let Lights { sun, moon } = self.lights(shot)?;
        let Some(moon) = moon else { return still(self, &shot.of(sun.as_ref().unwrap_or(shot.params))) };
        let first = sun.map(|sun| still(self, &shot.of(&sun))).transpose()?;
        let black = black(shot, first.is_some());
        let second = self.by_moon(first.is_some(), |lit| still(lit, &without(shot, &moon, black.as_deref())))?;
        Ok(match first {
            Some(first) => first.and(&second),
            None => second,
        })
    }

    /// The next frame of an animation: a sixteenth of its pixels is marched, the others follow the clouds from the frame
    /// before. The first frame, and the first after a cut, is a still. Returns the image of [`Renderer::render`].
    ///
    /// Beside edges of the user's scene, now or in the frame before, every pixel is marched.
    ///
    /// Where rays converge or paths are traced, every frame is a still; a static shot goes on tracing.
    pub fn animate(&mut self, shot: &Shot<'_>, interrupt: Interrupt<'_>) -> Result<Vec<f32>> {
        self.lit_frame(shot, None, interrupt)
    }

    /// The same onto a screen of the size of the pictures, without bringing it to memory.
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
            return self.by_moon(false, |lit| lit.next_frame(&shot.of(&moon), screen, interrupt));
        };
        let mut image = self.next_frame(&shot.of(&sun), None, interrupt)?;
        let black = black(shot, true);
        let make = |lit: &mut Self| lit.next_frame(&without(shot, &moon, black.as_deref()), None, interrupt);
        add_light(&mut image, &self.by_moon(true, make)?);
        screen.map_or(Ok(()), |screen| screen.write(&self.gpu, &image))?;
        Ok(image)
    }

    /// What lights a sky.
    fn lights(&mut self, shot: &Shot<'_>) -> Result<Lights> {
        if !shot.params.moon.exists() {
            return Ok(Lights { sun: Some(shot.params.clone()), moon: None });
        }
        let (frame, _) = shot.checked(self.size, &self.quality)?;
        Ok(Lights::new(shot.params, &frame))
    }

    /// What the renderer of moonlight makes; its times are a part of ours, or all of them.
    fn by_moon<T>(&mut self, part: bool, make: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
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
    /// The picture of the same sky by the light of both.
    fn and(mut self, other: &Self) -> Self {
        add_light(&mut self.image, &other.image);
        add_light(&mut self.sky, &other.sky);
        self.samples.iter_mut().zip(&other.samples).for_each(|(sum, more)| *sum += more);
        // Both have the same paths, so that their errors may be of one sign.
        self.uncertainty.iter_mut().zip(&other.uncertainty).for_each(|(sum, more)| *sum += more);
        self
    }
}

/// Adds the light of another picture of the same sky, whose alpha is the same.
fn add_light(image: &mut [f32], other: &[f32]) {
    for (sum, more) in image.chunks_exact_mut(4).zip(other.chunks_exact(4)) {
        sum[..3].iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
    }
}

/// The radiance of the user's scene where another picture has it already: none.
fn black(shot: &Shot<'_>, known: bool) -> Option<Vec<f32>> {
    shot.scene.and_then(|scene| scene.color).filter(|_| known).map(|color| vec![0.0; color.len()])
}

/// The shot of a sky with a scene of another radiance, where there is one.
fn without<'a>(shot: &Shot<'a>, params: &'a Params, color: Option<&'a [f32]>) -> Shot<'a> {
    let scene = shot.scene.map(|scene| SceneDepth { distance: scene.distance, color: color.or(scene.color) });
    Shot { params, scene, ..*shot }
}
