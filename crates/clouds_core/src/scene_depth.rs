//! User-supplied scene: the distance along each pixel's ray and the radiance there.

use std::ops::Range;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::gpu::{Binding, Bindings};
use crate::shared::constants;

/// Maximum distance of a scene in m, five times the diameter of the largest planet. Farther pixels, infinity included,
/// are sky. Rasterizers give the sky distances of 1e10 and more, or the largest f32.
pub const FARTHEST: f32 = 1e10;

constants! {
    /// Distance in m of pixels without a scene, beyond all others.
    const NO_SCENE: f32 = 1e30;
    /// Texels per row of the scene textures: pictures may be wider than the texture limit.
    const SCENE_ROW: u32 = 2048;
}

/// Scene among the clouds, by pixel.
#[derive(Clone, Copy, Debug)]
pub struct SceneDepth<'a> {
    /// Distance along the ray of each pixel in m; beyond [`FARTHEST`] there is no scene.
    pub distance: &'a [f32],
    /// Radiance of each pixel, red, green and blue. Without it the picture is composited for a later blend with the
    /// scene.
    pub color: Option<&'a [f32]>,
}

impl SceneDepth<'_> {
    /// Checks the lengths and the values for a picture of `width` x `height` pixels.
    pub(crate) fn check(&self, [width, height]: [u32; 2]) -> Result<()> {
        let pixels = width as usize * height as usize;
        let fits = |name: &str, numbers: &[f32], channels: usize| {
            // The comparison rejects NaN.
            let good = numbers.len() == channels * pixels && numbers.iter().all(|v| *v >= 0.0);
            let allowed = format!("{channels} numbers from 0 for each of {width} x {height} pixels");
            if good { Ok(()) } else { Err(Error::parameter(name, "an array", allowed)) }
        };
        fits("scene_depth", self.distance, 1)?;
        self.color.map_or(Ok(()), |color| fits("scene_color", color, 3))
    }
}

/// Textures with the scene of a strip.
pub(crate) struct SceneTextures {
    depth: wgpu::Texture,
    color: wgpu::Texture,
    views: [wgpu::TextureView; 2],
}

impl SceneTextures {
    /// Textures for a scene of `pixels` pixels, reused if they suffice; None without a scene.
    pub fn fit<'a>(
        textures: &'a mut Option<Self>,
        gpu: &Gpu,
        scene: Option<SceneDepth<'_>>,
        pixels: u32,
    ) -> Option<&'a Self> {
        let colored = scene?.color.is_some();
        if !textures.as_ref().is_some_and(|old| old.holds(pixels.into(), colored)) {
            *textures = Some(Self::new(gpu, pixels.into(), colored));
        }
        textures.as_ref()
    }

    /// Maximum number of pixels of a strip: every adapter supports 8192 texture rows.
    pub const MOST_PIXELS: u64 = 8192 * SCENE_ROW as u64;

    /// Textures for strips of `pixels` pixels. Without a scene they have one texel: kernels that name them need a
    /// binding.
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

    /// Whether strips of `pixels` pixels fit.
    pub fn holds(&self, pixels: u64, colored: bool) -> bool {
        let room = |texture: &wgpu::Texture| u64::from(texture.width()) * u64::from(texture.height());
        (pixels == 0 || room(&self.depth) >= pixels) && (!colored || room(&self.color) >= pixels)
    }

    /// Uploads a range of pixels. The remaining texels have no scene.
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
