//! On-screen help: the list of keys, and a hint while the panels are hidden.

use std::time::{Duration, Instant};

use eframe::egui::{self, Align2, Color32, FontId, Key, Ui};

/// Controls and their effects. docs/demo.md has the same table.
const KEYS: [(&str, &str); 10] = [
    ("W  A  S  D", "forward, left, back, right"),
    ("Q  E", "down, up"),
    ("Shift, Control", "five times as fast, a fifth"),
    ("wheel", "speed of flight"),
    ("F", "land and walk, or take off; Space jumps"),
    ("drag", "look around"),
    ("click", "take the pointer and look by moving it; Esc gives it back"),
    ("F1", "these keys"),
    ("F2", "the view alone, or with its panels"),
    ("Control Q", "leave"),
];
/// Duration of the hint after the panels are hidden.
const HINT_DURATION: Duration = Duration::from_secs(4);

/// Window with the list of keys; Esc and its close button set `open` to false.
pub fn key_window(context: &egui::Context, open: &mut bool) {
    if !*open {
        return;
    }
    if context.input(|input| input.key_pressed(Key::Escape)) {
        *open = false;
    }
    let window = egui::Window::new("Keys").anchor(Align2::CENTER_CENTER, [0.0; 2]).collapsible(false).resizable(false);
    window.open(open).show(context, |ui| {
        egui::Grid::new("keys").num_columns(2).spacing([16.0, 6.0]).show(ui, |ui| {
            for (key, effect) in KEYS {
                ui.strong(key);
                ui.label(effect);
                ui.end_row();
            }
        });
    });
}

/// Hint how to bring the panels back, for `HINT_DURATION` after they were hidden.
pub fn panel_hint(ui: &Ui, view: egui::Rect, hidden_since: Instant) {
    let remaining = HINT_DURATION.saturating_sub(hidden_since.elapsed());
    if remaining.is_zero() {
        return;
    }
    let anchor = view.center_bottom() - egui::vec2(0.0, 12.0);
    let text = |offset: f32, colour| {
        ui.painter().text(
            anchor + egui::Vec2::splat(offset),
            Align2::CENTER_BOTTOM,
            "F2 brings the panels back, F1 lists the keys",
            FontId::default(),
            colour,
        );
    };
    // Drop shadow: legible over bright clouds and over a night sky.
    text(1.0, Color32::BLACK);
    text(0.0, Color32::WHITE);
    ui.ctx().request_repaint_after(remaining);
}
