//! History of an animation: the previous frame, the conditions of a cut, and accumulation.

use crate::camera::Camera;
use crate::field::Now;
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::params::Params;
use crate::scene_depth::{SceneDepth, SceneTextures};
use crate::shot::Shot;
use crate::targets::{Targets, Temporal};
use crate::wind::Advection;

/// Previous frame of an animation.
pub(crate) struct Past {
    pub camera: Camera,
    pub params: Params,
    pub time: f64,
    pub frame: Frame,
    /// Distance of the user's scene in m, by pixel.
    pub scene: Option<Vec<f32>>,
    /// Number of frames since the last cut.
    pub index: u32,
}

impl Past {
    /// Sky of the frame.
    pub fn now(&self) -> Now<'_> {
        Now { params: &self.params, eye: self.camera.eye, time: self.time }
    }

    /// Whether a shot is a cut: it differs from the previous frame by so much that the history is useless.
    pub fn is_cut(&self, shot: &Shot<'_>) -> bool {
        let Shot { camera, params: new, time, .. } = *shot;
        let old = &self.params;
        let turned = camera.forward.dot(self.camera.forward) < 0.8 || camera.up.dot(self.camera.up) < 0.8;
        let jumped = camera.eye.distance(self.camera.eye) > 2000.0 || (time - self.time).abs() > 300.0;
        camera.projection != self.camera.projection
            || (camera.fov / self.camera.fov).ln().abs() > 0.2
            || turned
            || jumped
            || (old.clouds.seed, old.clouds.noise) != (new.clouds.seed, new.clouds.noise)
            || (old.weather.extent, old.weather.edge) != (new.weather.extent, new.weather.edge)
            || old.weather.broad_extent != new.weather.broad_extent
            || new.weather_change(old) > MAX_WEATHER_CHANGE
            || old.volume != new.volume
            || (old.light.model, old.light.phase) != (new.light.model, new.light.phase)
            || old.atmosphere.planet_radius != new.atmosphere.planet_radius
    }

    /// Whether a frame can be reprojected from this one: it is no cut, clouds are marched in both frames or in neither,
    /// and the size is the same if there is a user's scene, which may have edges.
    pub fn serves(&self, shot: &Shot<'_>, cloudless: bool, size: [u32; 2]) -> bool {
        let same_size = [self.frame.view.width, self.frame.view.height] == size;
        !self.is_cut(shot) && self.frame.cloudless == cloudless && (self.is_bare(shot.scene.is_some()) || same_size)
    }

    /// Whether neither frame has a user's scene. Only then may their sample grids differ: edges of a scene are found by
    /// comparing pixels of one grid (reproject.wgsl).
    pub fn is_bare(&self, scene: bool) -> bool {
        self.scene.is_none() && !scene
    }
}

/// Maximum fraction of the weather map that may change between two frames without a cut: it amounts to a third within
/// the sixteen frames in which every pixel is marched once. A change of weather within 30 s (thesis2018) stays below it
/// at two frames per second or more.
const MAX_WEATHER_CHANGE: f32 = 0.02;

/// Accumulator of a static shot without reprojection: the mean of its stills.
pub(crate) struct Accumulator {
    camera: Camera,
    params: Params,
    time: f64,
    background: bool,
    /// Distance in m and radiance of the user's scene, by pixel.
    scene: Option<(Vec<f32>, Option<Vec<f32>>)>,
    pub image: Vec<f32>,
    /// Number of accumulated stills.
    pub count: u32,
}

impl Accumulator {
    /// Empty accumulator for a shot.
    pub fn new(shot: &Shot<'_>) -> Self {
        let scene = shot.scene.map(|scene| (scene.distance.to_vec(), scene.color.map(<[f32]>::to_vec)));
        let (camera, params, time) = (*shot.camera, shot.params.clone(), shot.time);
        Self { camera, params, time, background: shot.background, scene, image: Vec::new(), count: 0 }
    }

    /// Whether its stills are of this shot.
    pub fn is_of(&self, shot: &Shot<'_>) -> bool {
        let seen = match (&self.scene, &shot.scene) {
            (Some((distance, color)), Some(SceneDepth { distance: now, color: lit })) => {
                distance == now && color.as_deref() == *lit
            }
            (last, now) => last.is_none() && now.is_none(),
        };
        (self.camera, self.time, self.background) == (*shot.camera, shot.time, shot.background)
            && self.params == *shot.params
            && seen
    }

    /// Adds a still.
    pub fn add(&mut self, still: Vec<f32>) {
        let share = 1.0 / (self.count as f32 + 1.0);
        if self.count == 0 {
            self.image = still;
        } else {
            self.image.iter_mut().zip(&still).for_each(|(old, new)| *old += share * (new - *old));
        }
        self.count += 1;
    }
}

impl Frame {
    /// Sets the motion since the previous frame. `resized` has the buffers of a previous frame on another sample grid.
    pub(crate) fn set_motion(
        &mut self,
        shot: &Shot<'_>,
        params: &Params,
        last: Option<&Past>,
        resized: Option<&Targets>,
    ) {
        let Some(last) = last else { return };
        let advection = Advection::between((&last.params, last.time), (params, shot.time));
        self.set_previous(&last.frame, shot.camera.eye - last.camera.eye, &advection);
        let scene = shot.scene.map(|scene| scene.distance);
        let still = last.camera == *shot.camera && self.view.cloud_motion == [0.0; 3] && last.scene.as_deref() == scene;
        self.view.moving = u32::from(!still);
        if let Some(old) = resized {
            [self.view.previous_width, self.view.previous_height] = old.grid.size;
            self.view.previous_spacing = old.grid.spacing();
            self.view.previous_cycle = old.grid.cycle();
        }
    }
}

/// Uploads the user's scene of a strip and, in an animation, that of the previous frame. A frame without a scene has
/// one at an infinite distance.
pub(crate) fn upload_scenes(
    textures: &SceneTextures,
    temporal: Option<&mut Temporal>,
    gpu: &Gpu,
    scene: Option<SceneDepth<'_>>,
    past: Option<&Past>,
    frame: &Frame,
) {
    let [first, pixels] =
        [frame.dispatch.strip_row, frame.dispatch.strip_rows].map(|rows| rows as usize * frame.view.width as usize);
    let strip = first..first + pixels;
    let empty = vec![f32::INFINITY; if temporal.is_some() { strip.end } else { 0 }];
    textures.upload(gpu, &scene.unwrap_or(SceneDepth { distance: &empty, color: None }), strip.clone());
    let Some(Temporal { scene_before, .. }) = temporal else { return };
    if !scene_before.holds(pixels as u64, false) {
        *scene_before = SceneTextures::new(gpu, pixels as u64, false);
    }
    let distance = past.and_then(|past| past.scene.as_deref()).unwrap_or(&empty);
    scene_before.upload(gpu, &SceneDepth { distance, color: None }, strip);
}
