//! Shot: camera, sky and time of a picture, checked before any GPU work.

use crate::camera::Camera;
use crate::error::{Error, Result};
use crate::field::FieldShape;
use crate::frame::Frame;
use crate::gpu::check_fork;
use crate::params::{Params, Quality};
use crate::scene_depth::SceneDepth;

/// Camera, sky and time of a picture.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    /// Position, orientation and projection of the camera.
    pub camera: &'a Camera,
    /// Parameters of the sky.
    pub params: &'a Params,
    /// Time in s.
    pub time: f64,
    /// Whether the clouds are composited over the background, with an alpha of 1. Otherwise the picture has the clouds
    /// alone, premultiplied.
    pub background: bool,
    /// User-supplied scene, which hides the clouds behind it. With radiance it is composited into the picture. Without
    /// radiance alpha is prepared for a later blend with the scene.
    pub scene: Option<SceneDepth<'a>>,
}

impl<'a> Shot<'a> {
    /// Shot with background and without a scene. `time` in s.
    pub fn new(camera: &'a Camera, params: &'a Params, time: f64) -> Self {
        Self { camera, params, time, background: true, scene: None }
    }

    /// User's scene, or an empty one.
    pub(crate) fn scene_or_none(&self) -> SceneDepth<'a> {
        self.scene.unwrap_or(SceneDepth { distance: &[], color: None })
    }

    /// Shot with other parameters.
    pub(crate) fn of<'b>(&self, params: &'b Params) -> Shot<'b>
    where
        'a: 'b,
    {
        Shot { params, ..*self }
    }

    /// Frame of a picture of `size` pixels, and the parameters at its time, in which the wander has been evaluated.
    ///
    /// Returns [`Error::Parameter`] for a value that is not allowed, and [`Error::Fork`] in a forked child.
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
        if let Some(shape) =
            FieldShape::new(&params, quality, frame.view.altitude, u64::from(size[0]) * u64::from(size[1]))
        {
            frame.set_field(self.camera.eye, &params, self.time, shape);
        }
        frame.view.background = u32::from(self.background);
        frame.scene = self.scene.is_some();
        frame.view.scene_lit = u32::from(self.scene.is_some_and(|scene| scene.color.is_some()));
        frame.light_shafts = frame.has_light_shafts(self.camera, &params);
        Ok((frame, params))
    }
}

/// Checks width and height in pixels.
pub(crate) fn check_size([width, height]: [u32; 2]) -> Result<()> {
    for (name, value) in [("width", width), ("height", height)] {
        if !(1..=65536).contains(&value) {
            return Err(Error::parameter(name, value, "a whole number from 1 to 65536 pixels"));
        }
    }
    Ok(())
}
