//! The weather map, seen and painted, and a new one that comes gradually.

use std::sync::Arc;

use clouds_core::Params;
use clouds_core::params::Weather;
use clouds_core::schema::Map;
use eframe::egui::{self, Color32, ColorImage, Sense, TextureOptions, Ui, Vec2, pos2};

use crate::panel;

/// Channels of a weather map.
const CHANNELS: [&str; 3] = ["coverage", "type", "precipitation"];
/// The colours that they are shown in.
const COLOURS: [(&str, Color32); 3] = [("red", Color32::RED), ("green", Color32::GREEN), ("blue", Color32::BLUE)];
/// Points across the map in the panel.
const SIDE: f32 = 256.0;

/// A soft brush.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Brush {
    /// Which number of the map it changes.
    pub channel: usize,
    /// What a dab adds in its middle.
    pub amount: f32,
    /// Where it ends, as a share of the map's width.
    pub radius: f32,
}

impl Default for Brush {
    fn default() -> Self {
        Self { channel: 0, amount: 0.1, radius: 0.06 }
    }
}

impl Brush {
    /// A dab at a place of a map that repeats: `at` from its left and its top, 0 to 1. It falls smoothly to its edge.
    pub fn dab(&self, map: &mut Map, at: [f32; 2]) {
        let size = [map.width as i64, map.height as i64];
        let reach = size.map(|side| (self.radius * side as f32).max(1.0));
        let center = [at[0] * size[0] as f32, at[1] * size[1] as f32];
        let first = [0, 1].map(|i| (center[i] - reach[i]).floor() as i64);
        let last = [0, 1].map(|i| (center[i] + reach[i]).ceil() as i64);
        for y in first[1]..=last[1] {
            for x in first[0]..=last[0] {
                let away = ((x as f32 + 0.5 - center[0]) / reach[0]).hypot((y as f32 + 0.5 - center[1]) / reach[1]);
                let t = (1.0 - away).clamp(0.0, 1.0);
                let weight = t * t * (3.0 - 2.0 * t);
                let texel = y.rem_euclid(size[1]) * size[0] + x.rem_euclid(size[0]);
                let value = &mut map.data[texel as usize * map.channels + self.channel];
                *value = (*value + weight * self.amount).clamp(0.0, 1.0);
            }
        }
    }
}

/// A weather that goes over into another.
#[derive(Clone, Debug)]
struct Change {
    from: Weather,
    gone: f64,
    takes: f64,
}

/// The map in the panel.
#[derive(Default)]
pub struct WeatherPanel {
    brush: Brush,
    seconds: Option<f64>,
    change: Option<Change>,
    /// What the texture shows.
    drawn: Option<Arc<Map>>,
    texture: Option<egui::TextureHandle>,
}

impl WeatherPanel {
    /// Shows the map that is in the sky, with the place of the eye in it, and paints on it.
    pub fn show(&mut self, ui: &mut Ui, params: &mut Params, map: Option<&Arc<Map>>, eye: [f32; 2]) {
        ui.horizontal(|ui| {
            if ui.button("New weather").on_hover_text("another seed, which comes gradually").clicked() {
                self.change =
                    Some(Change { from: params.weather.clone(), gone: 0.0, takes: *self.seconds.get_or_insert(30.0) });
                params.weather.seed = params.weather.seed.wrapping_add(1);
                params.weather.map = None;
                self.step(params, 0.0);
            }
            let seconds = egui::Slider::new(self.seconds.get_or_insert(30.0), 0.0..=300.0).suffix(" s");
            panel::labelled(ui, "comes in", |ui| ui.add(seconds));
        });
        let Some(map) = map else { return };
        let (rect, response) = ui.allocate_exact_size(Vec2::splat(SIDE), Sense::click_and_drag());
        let texture = self.texture(ui.ctx(), map);
        let all = egui::Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        ui.painter().image(texture, rect, all, Color32::WHITE);
        let place = rect.min + rect.size() * Vec2::new(eye[0].rem_euclid(1.0), eye[1].rem_euclid(1.0));
        ui.painter().circle_stroke(place, 4.0, egui::Stroke::new(1.5, Color32::BLACK));
        ui.painter().circle_stroke(place, 5.5, egui::Stroke::new(1.5, Color32::WHITE));
        if let Some(at) = response.interact_pointer_pos() {
            let at = (at - rect.min) / rect.size();
            let mut painted = params.weather.map.clone().unwrap_or_else(|| map.clone());
            self.brush.dab(Arc::make_mut(&mut painted), [at.x, at.y]);
            params.weather.map = Some(painted);
        }
        response.on_hover_text("drag to paint");
        legend(ui);
        panel::field(ui, "brush paints", |ui| {
            let menu = egui::ComboBox::from_id_salt("channel").selected_text(CHANNELS[self.brush.channel]);
            let choices = |ui: &mut Ui| {
                for (index, name) in CHANNELS.iter().enumerate() {
                    ui.selectable_value(&mut self.brush.channel, index, *name);
                }
            };
            menu.show_ui(ui, choices).response
        });
        panel::field(ui, "adds", |ui| ui.add(egui::Slider::new(&mut self.brush.amount, -0.5..=0.5)));
        let radius = egui::Slider::new(&mut self.brush.radius, 0.01..=0.5).logarithmic(true);
        panel::field(ui, "radius", |ui| ui.add(radius)).on_hover_text("as a share of the map");
        if ui.add_enabled(params.weather.map.is_some(), egui::Button::new("Forget what is painted")).clicked() {
            params.weather.map = None;
        }
    }

    /// Goes on with a change of weather by `seconds`; says whether there is one.
    pub fn step(&mut self, params: &mut Params, seconds: f64) -> bool {
        let Some(change) = &mut self.change else { return false };
        change.gone += seconds;
        let left = 1.0 - change.gone / change.takes.max(1e-3);
        // Weathers of one mixture share extent and edge.
        let fits = change.from.extent == params.weather.extent && change.from.edge == params.weather.edge;
        params.weather_mix = if left > 0.0 && fits { vec![(change.from.clone(), left as f32)] } else { Vec::new() };
        if params.weather_mix.is_empty() {
            self.change = None;
        }
        true
    }

    fn texture(&mut self, context: &egui::Context, map: &Arc<Map>) -> egui::TextureId {
        let same = self.drawn.as_ref().is_some_and(|drawn| Arc::ptr_eq(drawn, map));
        if let (true, Some(texture)) = (same, &self.texture) {
            return texture.id();
        }
        let byte = |v: f32| (255.0 * v.clamp(0.0, 1.0)).round() as u8;
        let pixels = map.data.chunks_exact(map.channels).map(|v| Color32::from_rgb(byte(v[0]), byte(v[1]), byte(v[2])));
        let image = ColorImage::new([map.width, map.height], pixels.collect());
        let texture = context.load_texture("weather", image, TextureOptions::LINEAR);
        self.drawn = Some(map.clone());
        self.texture.insert(texture).id()
    }
}

/// What the colours of the map mean.
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
    fn a_dab_is_round_and_soft_and_comes_back_in_over_the_edge() {
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
    fn a_dab_changes_its_own_number_and_comes_back_in_at_the_bottom() {
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
    fn a_new_weather_comes_gradually() {
        let mut params = Params::default();
        let from = params.weather.clone();
        let mut panel =
            WeatherPanel { change: Some(Change { from, gone: 0.0, takes: 10.0 }), ..WeatherPanel::default() };
        params.weather.seed += 1;
        assert!(panel.step(&mut params, 2.5));
        assert_eq!(params.weather_mix[0].1, 0.75);
        assert!(params.check().is_ok());
        assert!(panel.step(&mut params, 8.0));
        assert!(params.weather_mix.is_empty() && !panel.step(&mut params, 1.0));
    }
}
