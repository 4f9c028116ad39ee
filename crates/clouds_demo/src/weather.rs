//! Weather map panel: display, painting, and gradual transitions to a new weather.

use std::sync::Arc;

use clouds_core::Params;
use clouds_core::params::Weather;
use clouds_core::schema::Map;
use eframe::egui::{self, Color32, ColorImage, Sense, TextureOptions, Ui, Vec2, pos2};

use crate::panel;

/// Names of the weather map's channels.
const CHANNELS: [&str; 3] = ["coverage", "type", "precipitation"];
/// Display colours of the channels.
const COLOURS: [(&str, Color32); 3] = [("red", Color32::RED), ("green", Color32::GREEN), ("blue", Color32::BLUE)];
/// Side of the map in the panel, points.
const MAP_SIDE: f32 = 256.0;

/// Round brush with a smooth falloff.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brush {
    /// Index of the painted channel.
    pub channel: usize,
    /// Amount added at the centre of a dab.
    pub amount: f32,
    /// Radius, as a fraction of the map's side.
    pub radius: f32,
}

impl Default for Brush {
    fn default() -> Self {
        Self { channel: 0, amount: 0.1, radius: 0.06 }
    }
}

impl Brush {
    /// Paints a dab on a map that repeats. `at` is the centre from the left and the top, 0 to 1.
    pub fn dab(&self, map: &mut Map, at: [f32; 2]) {
        let size = [map.width as i64, map.height as i64];
        let radius = size.map(|side| (self.radius * side as f32).max(1.0));
        let center = [at[0] * size[0] as f32, at[1] * size[1] as f32];
        let first = [0, 1].map(|i| (center[i] - radius[i]).floor() as i64);
        let last = [0, 1].map(|i| (center[i] + radius[i]).ceil() as i64);
        for y in first[1]..=last[1] {
            for x in first[0]..=last[0] {
                let distance =
                    ((x as f32 + 0.5 - center[0]) / radius[0]).hypot((y as f32 + 0.5 - center[1]) / radius[1]);
                let t = (1.0 - distance).clamp(0.0, 1.0);
                let weight = t * t * (3.0 - 2.0 * t);
                let texel = y.rem_euclid(size[1]) * size[0] + x.rem_euclid(size[0]);
                let value = &mut map.data[texel as usize * map.channels + self.channel];
                *value = (*value + weight * self.amount).clamp(0.0, 1.0);
            }
        }
    }
}

/// Gradual transition from one weather to another.
#[derive(Clone, Debug)]
struct Transition {
    from: Weather,
    /// Time since the start, s.
    elapsed: f64,
    /// Length of the transition, s.
    duration: f64,
}

/// State of the weather map panel.
#[derive(Default)]
pub struct WeatherPanel {
    brush: Brush,
    /// Length of the next transition, s.
    transition_seconds: Option<f64>,
    transition: Option<Transition>,
    /// Map in the texture.
    uploaded: Option<Arc<Map>>,
    texture: Option<egui::TextureHandle>,
}

impl WeatherPanel {
    /// Panel with the current map, a marker at the eye, and the brush. `eye` is in map coordinates.
    pub fn show(&mut self, ui: &mut Ui, params: &mut Params, map: Option<&Arc<Map>>, eye: [f32; 2]) {
        ui.horizontal(|ui| {
            if ui.button("New weather").on_hover_text("another seed, which comes gradually").clicked() {
                self.transition = Some(Transition {
                    from: params.weather.clone(),
                    elapsed: 0.0,
                    duration: *self.transition_seconds.get_or_insert(30.0),
                });
                params.weather.seed = params.weather.seed.wrapping_add(1);
                params.weather.map = None;
                self.advance(params, 0.0);
            }
            let seconds = egui::Slider::new(self.transition_seconds.get_or_insert(30.0), 0.0..=300.0).suffix(" s");
            panel::labelled(ui, "comes in", |ui| ui.add(seconds));
        });
        let Some(map) = map else { return };
        let (rect, response) = ui.allocate_exact_size(Vec2::splat(MAP_SIDE), Sense::click_and_drag());
        let texture = self.texture(ui.ctx(), map);
        let all = egui::Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture, rect, all, Color32::WHITE);
        let marker = rect.min + rect.size() * Vec2::new(eye[0].rem_euclid(1.0), eye[1].rem_euclid(1.0));
        ui.painter().circle_stroke(marker, 4.0, egui::Stroke::new(1.5, Color32::BLACK));
        ui.painter().circle_stroke(marker, 5.5, egui::Stroke::new(1.5, Color32::WHITE));
        if let Some(at) = response.interact_pointer_pos() {
            let at = (at - rect.min) / rect.size();
            let mut painted = params.weather.map.clone().unwrap_or_else(|| map.clone());
            self.brush.dab(Arc::make_mut(&mut painted), [at.x, at.y]);
            params.weather.map = Some(painted);
        }
        response.on_hover_text("drag to paint");
        legend(ui);
        panel::labelled_row(ui, "brush paints", |ui| {
            let menu = egui::ComboBox::from_id_salt("channel").selected_text(CHANNELS[self.brush.channel]);
            let choices = |ui: &mut Ui| {
                for (index, name) in CHANNELS.iter().enumerate() {
                    ui.selectable_value(&mut self.brush.channel, index, *name);
                }
            };
            menu.show_ui(ui, choices).response
        });
        panel::labelled_row(ui, "adds", |ui| ui.add(egui::Slider::new(&mut self.brush.amount, -0.5..=0.5)));
        let radius = egui::Slider::new(&mut self.brush.radius, 0.01..=0.5).logarithmic(true);
        panel::labelled_row(ui, "radius", |ui| ui.add(radius)).on_hover_text("as a share of the map");
        if ui.add_enabled(params.weather.map.is_some(), egui::Button::new("Forget what is painted")).clicked() {
            params.weather.map = None;
        }
    }

    /// Advances the transition by `seconds`; returns whether there is one.
    pub fn advance(&mut self, params: &mut Params, seconds: f64) -> bool {
        let Some(transition) = &mut self.transition else { return false };
        transition.elapsed += seconds;
        let weight = 1.0 - transition.elapsed / transition.duration.max(1e-3);
        // All weathers of a mixture must have the same extent and edge.
        let is_mixable = transition.from.extent == params.weather.extent && transition.from.edge == params.weather.edge;
        params.weather_mix =
            if weight > 0.0 && is_mixable { vec![(transition.from.clone(), weight as f32)] } else { Vec::new() };
        if params.weather_mix.is_empty() {
            self.transition = None;
        }
        true
    }

    fn texture(&mut self, context: &egui::Context, map: &Arc<Map>) -> egui::TextureId {
        let same = self.uploaded.as_ref().is_some_and(|uploaded| Arc::ptr_eq(uploaded, map));
        if let (true, Some(texture)) = (same, &self.texture) {
            return texture.id();
        }
        let byte = |v: f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
        let pixels = map.data.chunks_exact(map.channels).map(|v| Color32::from_rgb(byte(v[0]), byte(v[1]), byte(v[2])));
        let image = ColorImage::new([map.width, map.height], pixels.collect());
        let texture = context.load_texture("weather", image, TextureOptions::LINEAR);
        self.uploaded = Some(map.clone());
        self.texture.insert(texture).id()
    }
}

/// Legend of the map's colours.
fn legend(ui: &mut Ui) {
    ui.horizontal(|ui| {
        for (channel, (name, colour)) in CHANNELS.iter().zip(COLOURS) {
            let (swatch, _) = ui.allocate_exact_size(Vec2::splat(10.0), Sense::hover());
            ui.painter().rect_filled(swatch, 2.0, colour);
            ui.label(format!("{name}: {channel}"));
        }
    });
    ui.weak("Black is 0, a full colour 1. North is up; the ring is you.");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey() -> Map {
        Map { width: 64, height: 32, channels: 3, data: vec![0.5; 64 * 32 * 3] }
    }

    #[test]
    fn a_dab_is_round_and_smooth_and_wraps_horizontally() {
        let mut map = grey();
        Brush { channel: 0, amount: 0.4, radius: 0.125 }.dab(&mut map, [0.0, 0.5]);
        let at = |x: usize, y: usize| map.data[(y * 64 + x) * 3];
        assert!(at(0, 16) > 0.85 && at(63, 16) > 0.85 && at(0, 15) > 0.85);
        assert!((at(0, 16) - at(63, 15)).abs() < 1e-6);
        assert_eq!((at(9, 16), at(54, 16), at(0, 21)), (0.5, 0.5, 0.5));
        assert!(at(4, 16) > 0.5 && at(4, 16) < at(1, 16));
        assert!(map.data.iter().skip(1).step_by(3).all(|v| *v == 0.5));
    }

    #[test]
    fn a_dab_changes_only_its_channel_and_wraps_vertically() {
        let mut map = grey();
        Brush { channel: 2, amount: -0.4, radius: 0.125 }.dab(&mut map, [0.5, 0.0]);
        let at = |x: usize, y: usize| &map.data[(y * 64 + x) * 3..][..3];
        for (x, y) in [(32, 0), (32, 31)] {
            assert!(at(x, y)[2] < 0.15, "{:?}", at(x, y));
        }
        assert!(map.data.chunks(3).all(|texel| texel[..2] == [0.5, 0.5]));
    }

    #[test]
    fn dabs_stay_within_the_range() {
        let mut map = grey();
        for _ in 0..10 {
            Brush { channel: 2, amount: 0.5, radius: 0.5 }.dab(&mut map, [0.3, 0.3]);
            Brush { channel: 1, amount: -0.5, radius: 0.5 }.dab(&mut map, [0.3, 0.3]);
        }
        assert!(map.data.iter().all(|v| (0.0..=1.0).contains(v)));
    }

    #[test]
    fn weather_transitions_are_gradual() {
        let mut params = Params::default();
        let from = params.weather.clone();
        let mut panel = WeatherPanel {
            transition: Some(Transition { from, elapsed: 0.0, duration: 10.0 }),
            ..WeatherPanel::default()
        };
        params.weather.seed += 1;
        assert!(panel.advance(&mut params, 2.5));
        assert_eq!(params.weather_mix[0].1, 0.75);
        assert!(params.check().is_ok());
        assert!(panel.advance(&mut params, 8.0));
        assert!(params.weather_mix.is_empty() && !panel.advance(&mut params, 1.0));
    }
}
