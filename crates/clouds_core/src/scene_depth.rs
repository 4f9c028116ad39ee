//! The user's scene: how far each pixel's ray goes until it meets it, and its radiance there.

use std::ops::Range;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::{Binding, Bindings};
use crate::shared::constants;

/// Farthest distance of a scene, m: what is beyond it counts as sky, as infinity does. Five times the diameter of the
/// largest planet. Rasterizers call the sky 1e10 and more, or the largest f32.
pub const FARTHEST: f32 = 1e10;

constants! {
    /// Distance of a scene that is not there, m: beyond all others.
    const NO_SCENE: f32 = 1e30;
    /// Texels of a row of the scene's textures: pictures are wider than textures may be.
    const SCENE_ROW: u32 = 2048;
}

/// A scene among the clouds, pixel by pixel.
#[derive(Clone, Copy, Debug)]
pub struct SceneDepth<'a> {
    /// Metres along the ray of each pixel; beyond [`FARTHEST`], infinity among it, there is nothing.
    pub distance: &'a [f32],
    /// Radiance, red, green and blue of each pixel; without it the picture leaves room for it.
    pub color: Option<&'a [f32]>,
}

impl SceneDepth<'_> {
    /// Whether it fits a picture.
    pub(crate) fn check(&self, [width, height]: [u32; 2]) -> Result<()> {
        let pixels = width as usize * height as usize;
        let fits = |name: &str, numbers: &[f32], channels: usize| {
            // Written so that NaN fails it.
            let good = numbers.len() == channels * pixels && numbers.iter().all(|v| *v >= 0.0);
            let allowed = format!("{channels} numbers from 0 for each of {width} x {height} pixels");
            if good { Ok(()) } else { Err(Error::parameter(name, "an array", allowed)) }
        };
        fits("scene_depth", self.distance, 1)?;
        self.color.map_or(Ok(()), |color| fits("scene_color", color, 3))
    }
}

/// A sheet of it on the GPU.
pub(crate) struct SceneTextures {
    depth: wgpu::Texture,
    color: wgpu::Texture,
    views: [wgpu::TextureView; 2],
}

impl SceneTextures {
    /// Textures for a user's scene of so many pixels, none where there is none.
    pub fn fit<'a>(
        kept: &'a mut Option<Self>,
        gpu: &Gpu,
        scene: Option<SceneDepth<'_>>,
        pixels: u32,
    ) -> Option<&'a Self> {
        let colored = scene?.color.is_some();
        if !kept.as_ref().is_some_and(|old| old.holds(pixels.into(), colored)) {
            *kept = Some(Self::new(gpu, pixels.into(), colored));
        }
        kept.as_ref()
    }

    /// Most pixels of a sheet: textures have at least so many rows.
    pub const MOST_PIXELS: u64 = 8192 * SCENE_ROW as u64;

    /// For sheets of so many pixels; of none where there is no scene, as kernels that ask for none want something bound.
    pub fn new(gpu: &Gpu, pixels: u64, colored: bool) -> Self {
        let texture = |label, pixels: u64, format| {
            let width = if pixels > 0 { SCENE_ROW } else { 1 };
            gpu.flat(label, [width, (pixels as u32).div_ceil(SCENE_ROW).max(1)], format)
        };
        let depth = texture("scene_depth", pixels, wgpu::TextureFormat::R32Float);
        let color = texture("scene_color", if colored { pixels } else { 0 }, wgpu::TextureFormat::Rgba32Float);
        let views = [&depth, &color].map(|texture| texture.create_view(&wgpu::TextureViewDescriptor::default()));
        Self { depth, color, views }
    }

    /// Whether it has room for sheets of so many pixels.
    pub fn holds(&self, pixels: u64, colored: bool) -> bool {
        let room = |texture: &wgpu::Texture| u64::from(texture.width()) * u64::from(texture.height());
        (pixels == 0 || room(&self.depth) >= pixels) && (!colored || room(&self.color) >= pixels)
    }

    /// Uploads some of its pixels.
    pub fn upload(&self, gpu: &Gpu, scene: &SceneDepth<'_>, pixels: Range<usize>) {
        let texels = |texture: &wgpu::Texture| texture.width() as usize * texture.height() as usize;
        let mut distance: Vec<f32> =
            scene.distance[pixels.clone()].iter().map(|v| if *v > FARTHEST { NO_SCENE } else { *v }).collect();
        distance.resize(texels(&self.depth), NO_SCENE);
        gpu.write_texture(&self.depth, &distance);
        if let Some(color) = scene.color {
            let rgb = &color[3 * pixels.start..3 * pixels.end];
            let mut rgba: Vec<[f32; 4]> = rgb.chunks_exact(3).map(|c| [c[0], c[1], c[2], 1.0]).collect();
            rgba.resize(texels(&self.color), [0.0; 4]);
            gpu.write_texture(&self.color, &rgba);
        }
    }

    pub fn depth(&self) -> Binding {
        (&self.views[0]).into()
    }

    pub fn bindings(&self) -> Bindings {
        vec![("scene_depth", self.depth()), ("scene_color", (&self.views[1]).into())]
    }
}
