//! What of a picture is shown: itself, or what lies behind it.

use clouds_core::color::LUMINANCE;
use clouds_core::picture::Picture;
use clouds_core::renderer::ROUND;

/// Evaluations that are white, as in thesis2018's figure 39.
pub const WHITE: f32 = 500.0;
/// Relative error of luminance that is white.
pub const WHITE_ERROR: f32 = 0.2;
/// The distance at which half of the light is left in the picture of depth, m.
const HALF: f32 = 5000.0;

/// What is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Sight {
    /// The picture.
    #[default]
    Picture,
    /// How much is seen through the clouds.
    Transmittance,
    /// How far away they are: near is bright.
    Depth,
    /// What each pixel costs.
    Heat,
    /// How many frames each pixel of a moving picture rests on.
    History,
    /// How far the picture is from `reference`, at rest, in larger pixels.
    Error,
}

impl Sight {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::Picture, Self::Transmittance, Self::Depth, Self::Heat, Self::History, Self::Error];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture",
            Self::Transmittance => "transmittance",
            Self::Depth => "depth",
            Self::Heat => "density evaluations",
            Self::History => "history length",
            Self::Error => "error",
        }
    }

    /// Whether it is made of the layers of a picture.
    pub fn is_of_layers(self) -> bool {
        matches!(self, Self::Transmittance | Self::Depth | Self::Heat)
    }
}

/// The pixels of a sight from the layers of a picture: four bytes each.
pub fn pixels_of(sight: Sight, picture: &Picture) -> Vec<u8> {
    let grey = |v: f32| [v, v, v];
    let color = |i: usize| match sight {
        Sight::Picture | Sight::Error | Sight::History | Sight::Transmittance => grey(1.0 - picture.image[4 * i + 3]),
        Sight::Depth if picture.depth[i] < 0.0 => grey(0.0),
        Sight::Depth => grey(1.0 / (1.0 + picture.depth[i] / HALF)),
        Sight::Heat => heat(picture.samples[i] as f32 / WHITE),
    };
    (0..picture.samples.len()).flat_map(|i| opaque(color(i))).collect()
}

/// The pixels of the relative error of one picture against another of luminance, from black to white at [`WHITE_ERROR`].
pub fn error_pixels(picture: &Picture, truth: &Picture) -> Vec<u8> {
    let luminance = |pixel: &[f32]| pixel.iter().zip(LUMINANCE).map(|(v, share)| v * share as f32).sum::<f32>();
    let pairs = picture.image.chunks_exact(4).zip(truth.image.chunks_exact(4));
    pairs
        .flat_map(|(a, b)| {
            let (a, b) = (luminance(a), luminance(b));
            opaque(heat((a - b).abs() / b.max(1e-12) / WHITE_ERROR))
        })
        .collect()
}

/// The pixels of the lengths of histories ([`clouds_core::Renderer::history_length`]), from nearly black for what has just come
/// into the picture to white for what has had a ray of its own; black where there is none.
pub fn history_pixels(lengths: &[u32], [width, height]: [u32; 2]) -> Vec<u8> {
    if lengths.is_empty() {
        return opaque([0.0; 3]).repeat(width as usize * height as usize);
    }
    lengths.iter().flat_map(|length| opaque(heat(*length as f32 / ROUND as f32))).collect()
}

/// Black, red, yellow, white from 0 to 1.
fn heat(share: f32) -> [f32; 3] {
    [0.0, 1.0, 2.0].map(|shift| 3.0 * share - shift)
}

fn opaque(color: [f32; 3]) -> [u8; 4] {
    let [r, g, b] = color.map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8);
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_relative() {
        let [a, b] = [1.1, 1.0].map(|v| Picture { image: vec![v, v, v, 1.0], ..Picture::default() });
        assert_eq!(error_pixels(&a, &a), [0, 0, 0, 255]);
        // A tenth of two tenths: between red and yellow.
        let [red, green, blue, _] = error_pixels(&a, &b)[..] else { panic!("one pixel") };
        assert!(red == 255 && (127..=129).contains(&green) && blue == 0, "{red} {green} {blue}");
    }

    #[test]
    fn a_history_grows_brighter() {
        assert_eq!(history_pixels(&[], [2, 1]), [0, 0, 0, 255].repeat(2));
        assert_eq!(history_pixels(&[1, 8, 16], [3, 1]), [48, 0, 0, 255, 255, 128, 0, 255, 255, 255, 255, 255]);
    }

    #[test]
    fn layers_become_colours() {
        let picture = Picture {
            image: vec![0.0, 0.0, 0.0, 0.25, 0.0, 0.0, 0.0, 1.0],
            depth: vec![5000.0, -1.0],
            samples: vec![500, 0],
            ..Picture::default()
        };
        assert_eq!(pixels_of(Sight::Transmittance, &picture), [191, 191, 191, 255, 0, 0, 0, 255]);
        assert_eq!(pixels_of(Sight::Depth, &picture), [128, 128, 128, 255, 0, 0, 0, 255]);
        assert_eq!(pixels_of(Sight::Heat, &picture), [255, 255, 255, 255, 0, 0, 0, 255]);
    }
}
