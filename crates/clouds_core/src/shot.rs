//! What a picture is of, and what is checked of it before any work.

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::check_fork;
use crate::params::{Params, Quality};
use crate::scene_depth::SceneDepth;

/// A camera before a sky at a time.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    /// Where from, and which way.
    pub camera: &'a Camera,
    /// The sky.
    pub params: &'a Params,
    /// Seconds.
    pub time: f64,
    /// Whether the picture is of the whole sky, with alpha 1; else of the clouds alone, premultiplied.
    pub background: bool,
    /// What hides clouds behind it. With its radiance it is a part of the picture, without it alpha leaves room for it.
    pub scene: Option<SceneDepth<'a>>,
}

impl<'a> Shot<'a> {
    /// The whole sky, without a scene.
    pub fn new(camera: &'a Camera, params: &'a Params, time: f64) -> Self {
        Self { camera, params, time, background: true, scene: None }
    }

    /// The scene of the user, or an empty one.
    pub(crate) fn scene_or_none(&self) -> SceneDepth<'a> {
        self.scene.unwrap_or(SceneDepth { distance: &[], color: None })
    }

    /// The same of another sky.
    pub(crate) fn of<'b>(&self, params: &'b Params) -> Shot<'b>
    where
        'a: 'b,
    {
        Shot { params, ..*self }
    }

    /// The frame of a picture of `size` pixels, and its sky, in which what wanders has its value.
    pub(crate) fn checked(&self, size: [u32; 2], quality: &Quality) -> Result<(Frame, Params)> {
        check_fork()?;
        self.params.check()?;
        quality.check_model(self.params)?;
        if !self.time.is_finite() {
            return Err(Error::parameter("time", self.time, "a finite number of seconds"));
        }
        self.scene.map_or(Ok(()), |scene| scene.check(size))?;
        let params = self.params.at(self.time);
        let mut frame = Frame::new(self.camera, &params, self.time, size);
        frame.view.most_rays = quality.most_rays();
        frame.view.background = u32::from(self.background);
        frame.scene = self.scene.is_some();
        frame.view.scene_lit = u32::from(self.scene.is_some_and(|scene| scene.color.is_some()));
        frame.light_shafts = frame.has_light_shafts(self.camera, &params);
        Ok((frame, params))
    }
}

/// Whether a picture may have so many pixels.
pub(crate) fn check_size([width, height]: [u32; 2]) -> Result<()> {
    for (name, value) in [("width", width), ("height", height)] {
        if !(1..=65536).contains(&value) {
            return Err(Error::parameter(name, value, "a whole number from 1 to 65536 pixels"));
        }
    }
    Ok(())
}
