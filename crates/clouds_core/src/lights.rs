//! Pictures by the light of sun, moon or both. Radiance is linear in its sources, so that one by both is the sum of two, each
//! with one of them, whose history is its own.

use std::mem;

use crate::error::{Error, Result};
use crate::gpu::Interrupt;
use crate::moon::Lights;
use crate::params::Params;
use crate::passes::display::Screen;
use crate::renderer::{Picture, Renderer};
use crate::scene_depth::SceneDepth;
use crate::shot::Shot;

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
