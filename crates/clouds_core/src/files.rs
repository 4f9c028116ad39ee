//! Pictures on disk: PNG of 8-bit pixels, EXR and Radiance HDR of linear ones; and pictures as numbers, from all three.

use std::fs::File;
use std::io::{BufReader, BufWriter};
use std::path::Path;

use exr::prelude::{ReadChannels as _, ReadLayers as _, write_rgb_file, write_rgba_file};
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

/// A picture as it stands in a file.
pub struct Pixels {
    /// Width and height.
    pub size: [usize; 2],
    /// 1 or 3.
    pub channels: usize,
    /// Row by row: the whole numbers of a file as parts of their largest, without any curve undone; floats as they are.
    pub data: Vec<f32>,
}

/// Reads a PNG, Radiance HDR or OpenEXR file: grey or red, green and blue; what else there is, such as alpha, is left out.
pub fn read_pixels(path: &Path) -> Result<Pixels> {
    let file = BufReader::new(File::open(path).map_err(|error| failed(path, error))?);
    let refuse = |error: &dyn std::fmt::Display| {
        Error::parameter(
            "path",
            format!("{:?}", path.display().to_string()),
            format!("a picture that is whole ({error})"),
        )
    };
    if path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("exr")) {
        return read_exr(file).map_err(|error| refuse(&error));
    }
    let reader = image::ImageReader::new(file).with_guessed_format().map_err(|error| failed(path, error))?;
    let image = reader.decode().map_err(|error| refuse(&error))?;
    let size = [image.width() as usize, image.height() as usize];
    Ok(if image.color().has_color() {
        Pixels { size, channels: 3, data: image.into_rgb32f().into_raw() }
    } else {
        Pixels { size, channels: 1, data: image.to_luma32f().into_raw() }
    })
}

fn read_exr(file: BufReader<File>) -> Result<Pixels, String> {
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.first_valid_layer().all_attributes().from_buffered(file).map_err(|error| error.to_string())?;
    let layer = image.layer_data;
    let named = |name: &str| layer.channel_data.list.iter().find(|channel| channel.name.eq(name));
    let chosen: Vec<_> = match [named("R"), named("G"), named("B")] {
        [Some(r), Some(g), Some(b)] => vec![r, g, b],
        _ => match (named("Y"), &*layer.channel_data.list) {
            (Some(grey), _) | (None, [grey]) => vec![grey],
            _ => return Err("it has neither the channels R, G, B nor a single one".into()),
        },
    };
    let (width, height) = (layer.size.0, layer.size.1);
    let mut data = vec![0.0; width * height * chosen.len()];
    for (index, channel) in chosen.iter().enumerate() {
        if channel.sampling.0 != 1 || channel.sampling.1 != 1 {
            return Err("its channels are of different sizes".into());
        }
        let values = channel.sample_data.values_as_f32();
        data.iter_mut().skip(index).step_by(chosen.len()).zip(values).for_each(|(out, value)| *out = value);
    }
    Ok(Pixels { size: [width, height], channels: chosen.len(), data })
}
