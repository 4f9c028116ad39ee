//! Debug views: false-colour images of a frame's layers, history and error.

use clouds_core::color::LUMINANCE;
use clouds_core::picture::Picture;
use clouds_core::renderer::CYCLE;

/// Density evaluations shown as white, as in figure 39 of thesis2018.
pub const WHITE_EVALUATIONS: f32 = 500.0;
/// Relative error of luminance shown as white.
pub const WHITE_ERROR: f32 = 0.2;
/// Depth shown at half brightness, m.
const HALF_BRIGHTNESS_DEPTH: f32 = 5000.0;

/// Image shown in the view.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DebugView {
    /// Tone-mapped radiance: no debug view.
    #[default]
    Color,
    /// Transmittance of the clouds.
    Transmittance,
    /// Distance to the clouds; near is bright.
    Depth,
    /// Density evaluations per pixel.
    Evaluations,
    /// History length of each pixel of an animated frame.
    HistoryLength,
    /// Relative error against `reference`, at reduced resolution.
    Error,
}

impl DebugView {
    /// Views in the order of the menu.
    pub const ALL: [Self; 6] =
        [Self::Color, Self::Transmittance, Self::Depth, Self::Evaluations, Self::HistoryLength, Self::Error];

    /// Label in the menu.
    pub fn name(self) -> &'static str {
        match self {
            Self::Color => "picture",
            Self::Transmittance => "transmittance",
            Self::Depth => "depth",
            Self::Evaluations => "density evaluations",
            Self::HistoryLength => "history length",
            Self::Error => "error",
        }
    }

    /// Whether the view needs the layers of a [`Picture`].
    pub fn needs_layers(self) -> bool {
        matches!(self, Self::Transmittance | Self::Depth | Self::Evaluations)
    }
}

/// RGBA8 pixels of a debug view made from the layers of a picture.
pub fn layer_pixels(view: DebugView, picture: &Picture) -> Vec<u8> {
    let grey = |v: f32| [v, v, v];
    let color = |i: usize| match view {
        DebugView::Color | DebugView::Error | DebugView::HistoryLength | DebugView::Transmittance => {
            grey(1.0 - picture.image[4 * i + 3])
        }
        DebugView::Depth if picture.depth[i] < 0.0 => grey(0.0),
        DebugView::Depth => grey(1.0 / (1.0 + picture.depth[i] / HALF_BRIGHTNESS_DEPTH)),
        DebugView::Evaluations => heat_map(picture.samples[i] as f32 / WHITE_EVALUATIONS),
    };
    (0..picture.samples.len()).flat_map(|i| rgba8(color(i))).collect()
}

/// RGBA8 heat map of the relative error of luminance; white is [`WHITE_ERROR`].
pub fn error_pixels(picture: &Picture, reference: &Picture) -> Vec<u8> {
    let luminance = |pixel: &[f32]| pixel.iter().zip(LUMINANCE).map(|(v, weight)| v * weight as f32).sum::<f32>();
    let pairs = picture.image.chunks_exact(4).zip(reference.image.chunks_exact(4));
    pairs
        .flat_map(|(a, b)| {
            let (a, b) = (luminance(a), luminance(b));
            rgba8(heat_map((a - b).abs() / b.max(1e-12) / WHITE_ERROR))
        })
        .collect()
}

/// RGBA8 heat map of history lengths ([`clouds_core::Renderer::history_length`]).
///
/// A disoccluded pixel is nearly black; a pixel with a ray of its own is white. Without a history the image is black.
pub fn history_pixels(lengths: &[u32], [width, height]: [u32; 2]) -> Vec<u8> {
    if lengths.is_empty() {
        return rgba8([0.0; 3]).repeat(width as usize * height as usize);
    }
    lengths.iter().flat_map(|length| rgba8(heat_map(*length as f32 / CYCLE as f32))).collect()
}

/// Heat map over 0 to 1: black, red, yellow, white.
fn heat_map(value: f32) -> [f32; 3] {
    [0.0, 1.0, 2.0].map(|shift| 3.0 * value - shift)
}

fn rgba8(color: [f32; 3]) -> [u8; 4] {
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
        // A relative error of 0.1 is half of WHITE_ERROR: between red and yellow.
        let [red, green, blue, _] = error_pixels(&a, &b)[..] else { panic!("one pixel") };
        assert!(red == 255 && (127..=129).contains(&green) && blue == 0, "{red} {green} {blue}");
    }

    #[test]
    fn longer_histories_are_brighter() {
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
        assert_eq!(layer_pixels(DebugView::Transmittance, &picture), [191, 191, 191, 255, 0, 0, 0, 255]);
        assert_eq!(layer_pixels(DebugView::Depth, &picture), [128, 128, 128, 255, 0, 0, 0, 255]);
        assert_eq!(layer_pixels(DebugView::Evaluations, &picture), [255, 255, 255, 255, 0, 0, 0, 255]);
    }
}
