//! Pictures on their way to a window: on the device, in 8 bits.

use super::composite::Output;
use crate::color::{TONE_MAPS, to_srgb8, tone_map_index};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::gpu::Recorder;
use crate::uniforms::Dispatch;

/// A texture of the device that a window shows: 8-bit pixels, encoded for a display.
pub struct Screen {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    shown: wgpu::Buffer,
    exposure: f32,
    tone_map: &'static str,
}

impl Screen {
    /// A black one of `width` by `height` pixels, for pictures with so many stops of exposure and one of
    /// [`crate::color::TONE_MAPS`].
    pub fn new(gpu: &Gpu, [width, height]: [u32; 2], exposure: f32, tone_map: &str) -> Result<Self> {
        let index = tone_map_index(exposure, tone_map)?;
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("screen"),
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8Unorm,
            usage: wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC
                | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let shown = gpu.uniform("shown", 16);
        gpu.queue.write_buffer(&shown, 0, bytemuck::cast_slice(&[exposure.exp2(), index as f32, 0.0, 0.0]));
        Ok(Self { texture, view, shown, exposure, tone_map: TONE_MAPS[index] })
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.texture.width(), self.texture.height()]
    }

    /// Stops of exposure, and the tone map.
    pub fn look(&self) -> (f32, &'static str) {
        (self.exposure, self.tone_map)
    }

    /// What a window samples.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.view
    }

    /// Shows a picture from memory: four numbers a pixel, row by row.
    pub fn write(&self, gpu: &Gpu, image: &[f32]) -> Result<()> {
        let width = self.size()[0] as usize;
        // Without alpha, as the pass shows it: a window has nothing behind.
        let image: Vec<f32> = image.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2], 1.0]).collect();
        self.write_pixels(gpu, &to_srgb8(&image, 4, width, self.exposure, self.tone_map, true)?)
    }

    /// Shows pixels from memory as they are: four bytes each, row by row.
    pub fn write_pixels(&self, gpu: &Gpu, pixels: &[u8]) -> Result<()> {
        let [width, height] = self.size();
        if pixels.len() as u64 != 4 * u64::from(width) * u64::from(height) {
            return Err(Error::parameter("pixels", pixels.len(), format!("4 numbers for each of {width} x {height}")));
        }
        let pixels: &[[u8; 4]] = bytemuck::cast_slice(pixels);
        gpu.write_texture(&self.texture, pixels);
        Ok(())
    }

    fn bindings(&self) -> Bindings {
        vec![("screen", (&self.view).into()), ("shown", (&self.shown).into())]
    }
}

/// Shows a picture.
pub(crate) fn record(rec: &mut Recorder<'_>, frame: &Frame, output: &Output, screen: &Screen) {
    let block = Dispatch { first_row: 0, rows: frame.view.height, ..frame.dispatch.clone() }.binding(rec.gpu);
    let bindings = [vec![block], output.bindings(), screen.bindings()].concat();
    rec.dispatch(("display", "display"), bindings, [frame.view.width, frame.view.height, 1]);
}
