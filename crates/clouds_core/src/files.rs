//! Pictures on disk: PNG of 8-bit pixels, EXR and Radiance HDR of linear ones.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use exr::prelude::{write_rgb_file, write_rgba_file};
use image::codecs::hdr::HdrEncoder;

use crate::error::{Error, Result};

fn failed(path: &Path, error: impl std::fmt::Display) -> Error {
    Error::File(format!("{}: {error}", path.display()))
}

/// Writes 8-bit pixels of 3 or 4 channels as PNG.
pub fn write_png(path: &Path, pixels: &[u8], size: [usize; 2], channels: usize) -> Result<()> {
    let color = if channels == 4 { image::ExtendedColorType::Rgba8 } else { image::ExtendedColorType::Rgb8 };
    image::save_buffer_with_format(path, pixels, size[0] as u32, size[1] as u32, color, image::ImageFormat::Png)
        .map_err(|error| failed(path, error))
}

/// Writes linear pixels of 3 or 4 channels as OpenEXR, 32-bit float.
pub fn write_exr(path: &Path, pixels: &[f32], size: [usize; 2], channels: usize) -> Result<()> {
    let at = |x: usize, y: usize| &pixels[(y * size[0] + x) * channels..];
    let written = if channels == 4 {
        write_rgba_file(path, size[0], size[1], |x, y| {
            let p = at(x, y);
            (p[0], p[1], p[2], p[3])
        })
    } else {
        write_rgb_file(path, size[0], size[1], |x, y| {
            let p = at(x, y);
            (p[0], p[1], p[2])
        })
    };
    written.map_err(|error| failed(path, error))
}

/// Writes the colours of linear pixels of 3 or 4 channels as Radiance HDR, which has no alpha.
pub fn write_hdr(path: &Path, pixels: &[f32], size: [usize; 2], channels: usize) -> Result<()> {
    let file = File::create(path).map_err(|error| failed(path, error))?;
    let colors: Vec<_> = pixels.chunks_exact(channels).map(|p| image::Rgb([p[0], p[1], p[2]])).collect();
    HdrEncoder::new(BufWriter::new(file)).encode(&colors, size[0], size[1]).map_err(|error| failed(path, error))
}
