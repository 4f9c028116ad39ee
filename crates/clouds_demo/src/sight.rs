//! What of a picture is shown: itself, or what lies behind it.

use clouds_core::renderer::Picture;

/// Evaluations that are white, as in thesis2018's figure 39.
pub const WHITE: f32 = 500.0;
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
}

impl Sight {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Picture, Self::Transmittance, Self::Depth, Self::Heat];

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Picture => "picture",
            Self::Transmittance => "transmittance",
            Self::Depth => "depth",
            Self::Heat => "density evaluations",
        }
    }
}

/// The pixels of a sight from the layers of a picture: four bytes each.
pub fn pixels_of(sight: Sight, picture: &Picture) -> Vec<u8> {
    let grey = |v: f32| [v, v, v];
    let color = |i: usize| match sight {
        Sight::Picture | Sight::Transmittance => grey(1.0 - picture.image[4 * i + 3]),
        Sight::Depth if picture.depth[i] < 0.0 => grey(0.0),
        Sight::Depth => grey(1.0 / (1.0 + picture.depth[i] / HALF)),
        // Black, red, yellow, white.
        Sight::Heat => [0.0, 1.0, 2.0].map(|shift| 3.0 * picture.samples[i] as f32 / WHITE - shift),
    };
    let byte = |v: f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
    (0..picture.samples.len())
        .flat_map(|i| {
            let [r, g, b] = color(i).map(byte);
            [r, g, b, 255]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

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
