//! What is remembered of the frames before, and what counts as a cut.

use crate::camera::Camera;
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::params::{self, Params};
use crate::scene_depth::{SceneDepth, SceneTextures};
use crate::shot::Shot;
use crate::targets::{Targets, Temporal};
use crate::wind::Advection;

/// The frame before.
pub(crate) struct Past {
    pub camera: Camera,
    pub params: Params,
    pub time: f64,
    pub frame: Frame,
    /// Distance of the user's scene.
    pub scene: Option<Vec<f32>>,
    /// Frames since the last cut.
    pub index: u32,
}

impl Past {
    /// Whether what was seen before says nothing about what is seen now.
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
            || weather_change(old, new) > MOST_WEATHER_CHANGE
            || old.volume != new.volume
            || (old.light.model, old.light.phase) != (new.light.model, new.light.phase)
            || old.atmosphere.planet_radius != new.atmosphere.planet_radius
    }

    /// Whether the next frame may be reprojected from this one: there is no cut, clouds are marched in both or in neither,
    /// and the size is the same where a scene of the user has edges.
    pub fn serves(&self, shot: &Shot<'_>, cloudless: bool, size: [u32; 2]) -> bool {
        let same_size = [self.frame.view.width, self.frame.view.height] == size;
        !self.is_cut(shot) && self.frame.cloudless == cloudless && (self.is_bare(shot.scene.is_some()) || same_size)
    }

    /// Whether the edges of a scene are nowhere, then and now: only then may the frame before have had other pixels.
    pub fn is_bare(&self, scene: bool) -> bool {
        self.scene.is_none() && !scene
    }
}

/// Largest share of the weather map that may change from one frame to the next without a cut: a third within the sixteen
/// frames in which every pixel is marched anew. A change in thirty seconds (thesis2018) is that slow from two frames a
/// second on.
const MOST_WEATHER_CHANGE: f32 = 0.02;

/// The share of the weather map that is another.
fn weather_change(old: &Params, new: &Params) -> f32 {
    let old = old.weather_shares();
    let kept = |(weather, share): (params::Weather, f32)| {
        old.iter().find(|(before, _)| *before == weather).map_or(0.0, |(_, before)| before.min(share))
    };
    1.0 - new.weather_shares().into_iter().map(kept).sum::<f32>()
}

/// A picture that every frame of a static shot makes better, where frames are not reprojected: the mean of stills.
pub(crate) struct Accumulator {
    camera: Camera,
    params: Params,
    time: f64,
    background: bool,
    /// Distance and radiance of the user's scene.
    scene: Option<(Vec<f32>, Option<Vec<f32>>)>,
    pub image: Vec<f32>,
    /// Stills that it is the mean of.
    pub count: u32,
}

impl Accumulator {
    /// An empty one.
    pub fn new(shot: &Shot<'_>) -> Self {
        let scene = shot.scene.map(|scene| (scene.distance.to_vec(), scene.color.map(<[f32]>::to_vec)));
        let (camera, params, time) = (*shot.camera, shot.params.clone(), shot.time);
        Self { camera, params, time, background: shot.background, scene, image: Vec::new(), count: 0 }
    }

    /// Whether it is of a shot.
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
    /// Notes what has changed since the frame before.
    pub(crate) fn follow(&mut self, shot: &Shot<'_>, params: &Params, last: Option<&Past>, resized: Option<&Targets>) {
        let Some(last) = last else { return };
        let carried = Advection::between((&last.params, last.time), (params, shot.time));
        self.set_previous(&last.frame, shot.camera.eye - last.camera.eye, &carried);
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

/// Uploads the scene of a strip and, in an animation, that of the previous frame. Where only one of the two has a scene,
/// that of the other is infinitely far away.
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
    let nothing = vec![f32::INFINITY; if temporal.is_some() { strip.end } else { 0 }];
    textures.upload(gpu, &scene.unwrap_or(SceneDepth { distance: &nothing, color: None }), strip.clone());
    let Some(Temporal { scene_before, .. }) = temporal else { return };
    if !scene_before.holds(pixels as u64, false) {
        *scene_before = SceneTextures::new(gpu, pixels as u64, false);
    }
    let distance = past.and_then(|past| past.scene.as_deref()).unwrap_or(&nothing);
    scene_before.upload(gpu, &SceneDepth { distance, color: None }, strip);
}
