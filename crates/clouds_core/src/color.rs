//! Display transform from scene-linear Rec. 709 radiance to sRGB pixels. All clipping and gamma encoding is here.

use crate::blue_noise::{self, BLUE_SIZE};
use crate::error::{Error, Result};
use crate::shared::constants;

/// Names of the tone maps.
pub const TONE_MAPS: [&str; 3] = ["agx", "aces", "none"];

type Rgb = [f32; 3];

constants! {
    /// Weights of red, green and blue in the luminance, for Rec. 709 primaries (ITU-R BT.709).
    pub const LUMINANCE: [f64; 3] = [0.2126, 0.7152, 0.0722];

    /// Inset matrix of AgX (Troy Sobotka), for Rec. 709 primaries (Wrensch 2023).
    const AGX_INSET: [[f32; 3]; 3] = [
        [0.842_479_06, 0.078_433_6, 0.079_223_745],
        [0.042_328_242, 0.878_468_64, 0.079_166_13],
        [0.042_375_655, 0.078_433_6, 0.879_143],
    ];
    /// Outset matrix of AgX, for Rec. 709 primaries (Wrensch 2023).
    const AGX_OUTSET: [[f32; 3]; 3] = [
        [1.196_879, -0.098_020_88, -0.099_029_74],
        [-0.052_896_85, 1.151_903_1, -0.098_961_18],
        [-0.052_971_635, -0.098_043_45, 1.151_073_7],
    ];
    /// Range of the AgX curve in stops around middle grey, 0.18 (Wrensch 2023).
    const AGX_STOPS: [f32; 2] = [-12.473_93, 4.026_069];

    /// Input matrix of ACES (RRT and sRGB ODT), in the fit of Stephen Hill (BakingLab, 2016).
    const ACES_INPUT: [[f32; 3]; 3] =
        [[0.597_19, 0.354_58, 0.048_23], [0.076, 0.908_34, 0.015_66], [0.028_4, 0.133_83, 0.837_77]];
    /// Output matrix of ACES (Hill 2016).
    const ACES_OUTPUT: [[f32; 3]; 3] =
        [[1.604_75, -0.531_08, -0.073_67], [-0.102_08, 1.108_13, -0.006_05], [-0.003_27, -0.072_76, 1.076_02]];
}

fn transform(m: &[[f32; 3]; 3], v: Rgb) -> Rgb {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// sRGB transfer function (IEC 61966-2-1).
fn encode_srgb(v: f32) -> f32 {
    let v = v.clamp(0.0, 1.0);
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// AgX (Troy Sobotka), in the polynomial approximation of Benjamin Wrensch ("Minimal AgX Implementation", 2023) for
/// Rec. 709 primaries. The output is display-encoded.
fn agx(v: Rgb) -> Rgb {
    let [low, high] = AGX_STOPS;
    let curve = |x: f32| {
        let x2 = x * x;
        let x4 = x2 * x2;
        15.5 * x4 * x2 - 40.14 * x4 * x + 31.96 * x4 - 6.868 * x2 * x + 0.4298 * x2 + 0.1191 * x - 0.002_32
    };
    let log = |v: f32| ((v.max(1e-10).log2() - low) / (high - low)).clamp(0.0, 1.0);
    transform(&AGX_OUTSET, transform(&AGX_INSET, v).map(|v| curve(log(v)))).map(|v| v.clamp(0.0, 1.0))
}

/// ACES (RRT and sRGB ODT), in the fit of Stephen Hill (BakingLab, 2016).
fn aces(v: Rgb) -> Rgb {
    let fit = |v: f32| (v * (v + 0.024_578_6) - 0.000_090_537) / (v * (0.983_729 * v + 0.432_951) + 0.238_081);
    // The fit is undefined outside the range of displayable light: it would map negative and infinite values
    // arbitrarily.
    transform(&ACES_OUTPUT, transform(&ACES_INPUT, v.map(|v| v.clamp(0.0, 65504.0))).map(fit)).map(encode_srgb)
}

/// Index of a tone map in [`TONE_MAPS`], after a check of both arguments.
pub(crate) fn tone_map_index(exposure: f32, tone_map: &str) -> Result<usize> {
    let Some(index) = TONE_MAPS.iter().position(|name| *name == tone_map) else {
        return Err(Error::parameter("tonemap", format!("{tone_map:?}"), format!("one of {TONE_MAPS:?}")));
    };
    if !exposure.is_finite() {
        return Err(Error::parameter("exposure", exposure, "a finite number of stops"));
    }
    Ok(index)
}

/// Converts pixels of `channels` (3 or 4) values, in rows of `width`, to 8-bit sRGB. `exposure` is in stops.
///
/// Input colours with alpha are premultiplied; output colours are not, as in a PNG. The tone map applies to the
/// radiance of the covered part, however small its coverage. Alpha stays linear.
///
/// `dither` adds a fixed blue-noise pattern of half a quantization step to each side before rounding, the same to all
/// channels: local means keep a small fraction of a step, and grey stays grey. Exact steps, such as 0 and 255, do not
/// change.
///
/// Returns [`Error::Parameter`] for an unknown tone map or an exposure that is not finite.
pub fn to_srgb8(
    pixels: &[f32],
    channels: usize,
    width: usize,
    exposure: f32,
    tone_map: &str,
    dither: bool,
) -> Result<Vec<u8>> {
    let map = [agx, aces, |v: Rgb| v.map(encode_srgb)][tone_map_index(exposure, tone_map)?];
    let gain = exposure.exp2();
    let byte = |v: f32, threshold: f32| (v * 255.0 + threshold) as u8;
    let tile: &[f32] = if dither { &blue_noise::TILE } else { &[] };
    let mut out = Vec::with_capacity(pixels.len());
    for (y, row) in pixels.chunks(channels * width.max(1)).enumerate() {
        for (x, pixel) in row.chunks_exact(channels).enumerate() {
            let rank = tile.get(y % BLUE_SIZE * BLUE_SIZE + x % BLUE_SIZE);
            // Ranks start at 0: half a step of ranks makes their mean 1/2.
            let threshold = rank.map_or(0.5, |rank| rank + 0.5 / (BLUE_SIZE * BLUE_SIZE) as f32);
            let gain = match pixel.get(3) {
                Some(alpha) if *alpha > 0.0 => gain / alpha.min(1.0),
                Some(_) => 0.0,
                None => gain,
            };
            // Avoids NaN from 0 times infinity.
            let exposed = |v: f32| if gain > 0.0 { v * gain } else { 0.0 };
            let color = map([exposed(pixel[0]), exposed(pixel[1]), exposed(pixel[2])]);
            out.extend(color.map(|v| byte(v, threshold)));
            out.extend(pixel[3..].iter().map(|alpha| byte(alpha.clamp(0.0, 1.0), 0.5)));
        }
    }
    Ok(out)
}

/// Metering of [`auto_exposure`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metering {
    /// Target of the mean luminance.
    pub key: f64,
    /// Percentile of the luminance below which pixels are left out, among pixels with light.
    pub low: f64,
    /// Percentile from which on pixels are left out.
    pub high: f64,
}

impl Default for Metering {
    /// Middle grey, without the sun's disc and its glare.
    fn default() -> Self {
        Self { key: 0.18, low: 5.0, high: 95.0 }
    }
}

/// Exposure in stops that brings the geometric mean of the luminance to the key (Reinhard et al. 2002); 0 for a picture
/// without light.
///
/// Returns [`Error::Parameter`] for metering out of range.
pub fn auto_exposure(pixels: &[f32], channels: usize, metering: Metering) -> Result<f64> {
    let Metering { key, low, high } = metering;
    if !(key > 0.0 && key.is_finite()) {
        return Err(Error::parameter("key", format!("{key:?}"), "a number above 0"));
    }
    if !(0.0 <= low && low < high && high <= 100.0) {
        let allowed = format!("from 0 to less than high = {high:?}, which must be at most 100");
        return Err(Error::parameter("low", format!("{low:?}"), allowed));
    }
    let luminance = |pixel: &[f32]| pixel.iter().zip(LUMINANCE).map(|(v, share)| f64::from(*v) * share).sum();
    let mut light: Vec<f64> = pixels.chunks_exact(channels).map(luminance).collect();
    light.retain(|v| v.is_finite() && *v > 0.0);
    if light.is_empty() {
        return Ok(0.0);
    }
    let place = |percent: f64| percent / 100.0 * light.len() as f64;
    let first = place(low).floor() as usize;
    // At least one pixel remains.
    let end = (place(high).ceil() as usize).max(first + 1);
    // The order of the excluded pixels does not matter.
    let (_, _, above) = light.select_nth_unstable_by(first, f64::total_cmp);
    let count = end - first;
    if count <= above.len() {
        above.select_nth_unstable_by(count - 1, f64::total_cmp);
    }
    let mean = light[first..end].iter().map(|v| v.log2()).sum::<f64>() / count as f64;
    Ok(key.log2() - mean)
}
