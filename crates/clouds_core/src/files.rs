//! Image files: PNG of 8-bit pixels, OpenEXR and Radiance HDR of linear pixels, and readers of all three; `.npy`
//! arrays.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{BufReader, BufWriter, Cursor, ErrorKind, Write as _};
use std::path::Path;

use exr::prelude::{Image, ReadChannels as _, ReadLayers as _, SpecificChannels, WritableImage as _};
use image::ImageEncoder as _;
use image::codecs::hdr::HdrEncoder;
use image::codecs::png::PngEncoder;
use tempfile::NamedTempFile;

use crate::error::{Error, Result};

fn file_error(path: &Path, error: impl std::fmt::Display) -> Error {
    Error::File(format!("{}: {error}", path.display()))
}

/// Checks that a file can be written: its folder exists and accepts files, and an existing file is writable. Callers
/// check before long work, whose result would be lost.
pub fn check_target(path: &Path) -> Result<()> {
    let refuse = |error: std::io::Error| file_error(path, error);
    match fs::metadata(path) {
        Ok(metadata) if metadata.is_dir() => Err(file_error(path, "it is a folder")),
        Ok(metadata) => {
            OpenOptions::new().write(true).open(path).map_err(refuse)?;
            if metadata.is_file() { temporary_for(path).map(drop).map_err(refuse) } else { Ok(()) }
        }
        Err(error) if error.kind() == ErrorKind::NotFound => temporary_for(path).map(drop).map_err(refuse),
        Err(error) => Err(refuse(error)),
    }
}

/// Temporary file in the folder of `path`, removed unless it is renamed to `path`.
fn temporary_for(path: &Path) -> std::io::Result<NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut prefix = OsString::from(".");
    // File names have at most 255 bytes.
    prefix.push(path.file_name().filter(|name| name.len() <= 200).unwrap_or_default());
    prefix.push(".");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // Mode of a newly created file, to which the umask applies.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// Writes a file atomically: under a temporary name in the same folder, renamed once it is complete and synchronized to
/// disk. Concurrent readers and an aborted process leave either the old file or the new one. A target that is not a
/// regular file, such as a pipe or `/dev/stdout`, is written in place.
pub fn replace(path: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> Result<(), String>) -> Result<()> {
    // Links are resolved, so that they stay links.
    let target = fs::canonicalize(path);
    let (target, old) = match &target {
        Ok(target) => (target.as_path(), fs::metadata(target).ok()),
        Err(_) => (path, None),
    };
    let io = |error: std::io::Error| file_error(path, error);
    if old.as_ref().is_some_and(|metadata| !metadata.is_file() && !metadata.is_dir()) {
        let file = OpenOptions::new().write(true).open(target).map_err(io)?;
        let mut writer = BufWriter::new(&file);
        write(&mut writer).map_err(|error| file_error(path, error))?;
        return writer.flush().map_err(io);
    }
    check_target(target)?;
    let new = temporary_for(target).map_err(io)?;
    let mut writer = BufWriter::new(new.as_file());
    write(&mut writer).map_err(|error| file_error(path, error))?;
    writer.flush().map_err(io)?;
    drop(writer);
    if let Some(old) = old {
        new.as_file().set_permissions(old.permissions()).map_err(io)?;
    }
    new.as_file().sync_all().map_err(io)?;
    new.persist(target).map_err(|error| io(error.error))?;
    Ok(())
}

/// Writes bytes atomically ([`replace`]).
pub fn write_bytes(path: &Path, bytes: &[u8]) -> Result<()> {
    replace(path, |out| out.write_all(bytes).map_err(|error| error.to_string()))
}

/// Writes 8-bit pixels of 3 or 4 channels as PNG. `size` is width and height.
pub fn write_png(path: &Path, pixels: &[u8], size: [usize; 2], channels: usize) -> Result<()> {
    let color = if channels == 4 { image::ExtendedColorType::Rgba8 } else { image::ExtendedColorType::Rgb8 };
    replace(path, |out| {
        let encoded = PngEncoder::new(out).write_image(pixels, size[0] as u32, size[1] as u32, color);
        encoded.map_err(|error| error.to_string())
    })
}

/// Writes linear pixels of 3 or 4 channels as OpenEXR, 32-bit float. `size` is width and height.
pub fn write_exr(path: &Path, pixels: &[f32], size: [usize; 2], channels: usize) -> Result<()> {
    let at = |place: exr::math::Vec2<usize>| &pixels[(place.y() * size[0] + place.x()) * channels..];
    let text = |error: exr::error::Error| error.to_string();
    // Encoded in memory first: the table of offsets is written last, and pipes cannot be sought.
    let mut bytes = Cursor::new(Vec::with_capacity(4 * pixels.len()));
    if channels == 4 {
        let colors = SpecificChannels::rgba(|place| {
            let p = at(place);
            (p[0], p[1], p[2], p[3])
        });
        Image::from_channels((size[0], size[1]), colors).write().to_buffered(&mut bytes).map_err(text)
    } else {
        let colors = SpecificChannels::rgb(|place| {
            let p = at(place);
            (p[0], p[1], p[2])
        });
        Image::from_channels((size[0], size[1]), colors).write().to_buffered(&mut bytes).map_err(text)
    }
    .map_err(|error| file_error(path, error))?;
    write_bytes(path, bytes.get_ref())
}

/// Writes the colours of linear pixels of 3 or 4 channels as Radiance HDR, without alpha and with negative values as 0.
/// `size` is width and height.
pub fn write_hdr(path: &Path, pixels: &[f32], size: [usize; 2], channels: usize) -> Result<()> {
    let colors: Vec<_> = pixels.chunks_exact(channels).map(|p| image::Rgb(rounded_rgbe([p[0], p[1], p[2]]))).collect();
    replace(path, |out| HdrEncoder::new(out).encode(&colors, size[0], size[1]).map_err(|error| error.to_string()))
}

/// Colour whose mantissas, truncated by `HdrEncoder`, equal the rounded mantissas of `rgb`. Readers decode mantissa /
/// 256 times the power of two, so that truncation darkens colours by 0.27 %.
fn rounded_rgbe(rgb: [f32; 3]) -> [f32; 3] {
    let largest = rgb.into_iter().fold(0.0, f32::max);
    // Below the smallest exponent; readers decode 0.
    if largest < 2f32.powi(-126) {
        return [0.0; 3];
    }
    // Exact: the exponent bits of the f32.
    let mut exponent = (largest.to_bits() >> 23) as i32 - 126;
    if (f64::from(largest) * 2f64.powi(8 - exponent)).round() >= 256.0 {
        exponent += 1;
    }
    // Largest exponent of the format; larger colours saturate.
    let step = 2f64.powi(exponent.min(127) - 8);
    rgb.map(|v| (((f64::from(v.max(0.0)) / step).round().min(255.0) + 0.5) * step) as f32)
}

/// Pixels of an image file.
pub struct Pixels {
    /// Width and height.
    pub size: [usize; 2],
    /// 1 (grey) or 3 (red, green, blue).
    pub channels: usize,
    /// Row by row. Integers are divided by their maximum, without decoding a transfer function; floats are unchanged.
    pub data: Vec<f32>,
}

/// Reads a PNG, Radiance HDR or OpenEXR file as grey or as red, green and blue. Further channels, such as alpha, are
/// dropped.
///
/// Returns [`Error::File`] if the file cannot be read and [`Error::Parameter`] if it cannot be decoded.
pub fn read_pixels(path: &Path) -> Result<Pixels> {
    let file = BufReader::new(File::open(path).map_err(|error| file_error(path, error))?);
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
    let reader = image::ImageReader::new(file).with_guessed_format().map_err(|error| file_error(path, error))?;
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

/// Reads an array of float32 in C order from a `.npy` file (NEP 1): its shape, and its values with the last axis
/// fastest.
///
/// Returns [`Error::File`] if the file cannot be read or has another type or order.
pub fn read_npy(path: &Path) -> Result<(Vec<usize>, Vec<f32>)> {
    let bytes = fs::read(path).map_err(|error| file_error(path, error))?;
    npy_from(&bytes).ok_or_else(|| file_error(path, "it is no .npy file of float32 in C order"))
}

fn npy_from(bytes: &[u8]) -> Option<(Vec<usize>, Vec<f32>)> {
    let version = *bytes.strip_prefix(b"\x93NUMPY")?.first()?;
    // The header length has two bytes in format version 1, four in later versions.
    let start = if version == 1 { 10 } else { 12 };
    let length = bytes.get(8..start)?.iter().rev().fold(0, |length, byte| length << 8 | usize::from(*byte));
    let header = std::str::from_utf8(bytes.get(start..start.checked_add(length)?)?).ok()?;
    if !header.contains("'descr': '<f4'") || !header.contains("'fortran_order': False") {
        return None;
    }
    let (_, shape) = header.split_once("'shape': (")?;
    let sides = shape.split_once(')')?.0.split(',').map(str::trim).filter(|side| !side.is_empty());
    let shape: Vec<usize> = sides.map(|side| side.parse().ok()).collect::<Option<_>>()?;
    let count = shape.iter().try_fold(4usize, |count, side| count.checked_mul(*side))?;
    let data = bytes.get(start + length..).filter(|data| data.len() == count)?;
    let numbers = data.chunks_exact(4).map(|v| f32::from_le_bytes([v[0], v[1], v[2], v[3]])).collect();
    Some((shape, numbers))
}
