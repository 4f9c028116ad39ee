//! The keys, for who asks, and the way back from the view alone.

use std::time::{Duration, Instant};

use eframe::egui::{self, Align2, Color32, FontId, Key, Ui};

/// Keys and mouse, and what they do. The same as in docs/demo.md.
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
/// How long the view alone says how to leave it.
const REMINDER: Duration = Duration::from_secs(4);

/// The list of keys, where it is open; F1, Esc and its button close it.
pub fn keys(context: &egui::Context, open: &mut bool) {
    if !*open {
        return;
    }
    if context.input(|input| input.key_pressed(Key::Escape)) {
        *open = false;
    }
    let window = egui::Window::new("Keys").anchor(Align2::CENTER_CENTER, [0.0; 2]).collapsible(false).resizable(false);
    window.open(open).show(context, |ui| {
        egui::Grid::new("keys").num_columns(2).spacing([16.0, 6.0]).show(ui, |ui| {
            for (key, what) in KEYS {
                ui.strong(key);
                ui.label(what);
                ui.end_row();
            }
        });
    });
}

/// Says for some seconds how the panels come back.
pub fn way_back(ui: &Ui, view: egui::Rect, since: Instant) {
    let left = REMINDER.saturating_sub(since.elapsed());
    if left.is_zero() {
        return;
    }
    let at = view.center_bottom() - egui::vec2(0.0, 12.0);
    let text = |offset: f32, colour| {
        let at = at + egui::Vec2::splat(offset);
        ui.painter().text(
            at,
            Align2::CENTER_BOTTOM,
            "F2 brings the panels back, F1 lists the keys",
            FontId::default(),
            colour,
        );
    };
    // Legible before bright clouds and before the night.
    text(1.0, Color32::BLACK);
    text(0.0, Color32::WHITE);
    ui.ctx().request_repaint_after(left);
}
