//! Display of pictures in a window: conversion to 8 bits on the device.

use super::composite::Output;
use crate::color::{TONE_MAPS, to_srgb8, tone_map_index};
use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Bindings;
use crate::gpu::Gpu;
use crate::gpu::Recorder;
use crate::uniforms::Dispatch;

/// Screen texture: RGBA8 pixels on the device, encoded for a display (sRGB).
pub struct Screen {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    shown: wgpu::Buffer,
    exposure: f32,
    tone_map: &'static str,
}

impl Screen {
    /// Black screen of `width` x `height` pixels. `exposure` is in stops, `tone_map` one of
    /// [`TONE_MAPS`].
    ///
    /// Returns [`Error::Parameter`] for an invalid exposure or tone map.
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

    /// Exposure in stops, and name of the tone map.
    pub fn look(&self) -> (f32, &'static str) {
        (self.exposure, self.tone_map)
    }

    /// View of the texture, for sampling.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.view
    }

    /// Writes a picture from memory with exposure and tone map: radiance and alpha, four numbers per pixel, row by row.
    ///
    /// Returns [`Error::Parameter`] for a picture of another size.
    pub fn write(&self, gpu: &Gpu, image: &[f32]) -> Result<()> {
        let width = self.size()[0] as usize;
        // Alpha is ignored, as by the pass: a window has no background to blend with.
        let image: Vec<f32> = image.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2], 1.0]).collect();
        self.write_pixels(gpu, &to_srgb8(&image, 4, width, self.exposure, self.tone_map, true)?)
    }

    /// Writes encoded pixels from memory without conversion: RGBA8, four bytes per pixel, row by row.
    ///
    /// Returns [`Error::Parameter`] for another number of bytes.
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

/// Records the conversion of a picture to a screen.
pub(crate) fn record(rec: &mut Recorder<'_>, frame: &Frame, output: &Output, screen: &Screen) {
    let block = Dispatch { first_row: 0, rows: frame.view.height, ..frame.dispatch.clone() }.binding(rec.gpu);
    let bindings = [vec![block], output.bindings(), screen.bindings()].concat();
    rec.dispatch(("display", "display"), bindings, [frame.view.width, frame.view.height, 1]);
}
