//! Editors generated from the parameter schema: value with unit and range, documentation, and reset to the default.

use clouds_core::params::{Params, Quality};
use clouds_core::schema::{Block, Field, Type, Value, assign};
use eframe::egui::{self, Color32, Response, RichText, Slider, Ui, WidgetText};

/// Ratio of a range's ends above which its slider is logarithmic.
const LOGARITHMIC_RATIO: f64 = 300.0;
/// Width of the label column, points.
const LABEL_WIDTH: f32 = 128.0;
/// Width of a slider without its number, points: label, slider, number and unit fill the panel.
const SLIDER_WIDTH: f32 = 90.0;

/// Label followed by its widget.
pub fn labelled(ui: &mut Ui, name: &str, widget: impl FnOnce(&mut Ui) -> Response) -> Response {
    let label = ui.label(name);
    widget(ui).labelled_by(label.id)
}

/// Row of a panel: label in the label column, followed by its widget.
pub fn labelled_row(ui: &mut Ui, name: impl Into<WidgetText>, widget: impl FnOnce(&mut Ui) -> Response) -> Response {
    ui.horizontal(|ui| {
        let label = column_label(ui, name);
        widget(ui).labelled_by(label.id)
    })
    .inner
}

/// Menu with a label, tall enough for all choices.
pub fn menu(ui: &mut Ui, name: &str, chosen: &str, choices: impl FnOnce(&mut Ui)) {
    labelled(ui, name, |ui| {
        let menu = egui::ComboBox::from_id_salt(name).selected_text(chosen).height(400.0);
        menu.show_ui(ui, choices).response
    });
}

/// Label in the label column.
fn column_label(ui: &mut Ui, name: impl Into<WidgetText>) -> Response {
    ui.spacing_mut().slider_width = SLIDER_WIDTH;
    let size = egui::vec2(LABEL_WIDTH, ui.spacing().interact_size.y);
    let layout = egui::Layout::left_to_right(egui::Align::Center);
    let cell = ui.allocate_ui_with_layout(size, layout, |ui| {
        ui.set_min_width(LABEL_WIDTH);
        ui.add(egui::Label::new(name).truncate())
    });
    cell.inner
}

/// State of the parameter panel.
#[derive(Default)]
pub struct Panel {
    /// Filter on the names and documentation of the fields.
    pub search: String,
    /// Error that rejected the last change.
    pub error: Option<String>,
}

impl Panel {
    /// Editors of all sky parameters; returns whether a value changed.
    pub fn sky(&mut self, ui: &mut Ui, params: &mut Params) -> bool {
        let mut next = params.clone();
        let default = Params::default();
        let mut changed = false;
        for ((name, block), (_, default)) in next.blocks_mut().into_iter().zip(default.blocks()) {
            changed |= self.block(ui, name, block, default);
        }
        changed && self.accept(next.check().map(|()| next), params)
    }

    /// Editors of the quality; returns whether a value changed.
    pub fn quality(&mut self, ui: &mut Ui, quality: &mut Quality, default: &Quality) -> bool {
        let mut next = quality.clone();
        self.block(ui, "quality", &mut next, default) && self.accept(next.check().map(|()| next), quality)
    }

    /// Applies a valid change; keeps the error of an invalid one.
    fn accept<T>(&mut self, next: clouds_core::Result<T>, current: &mut T) -> bool {
        match next {
            Ok(next) => {
                *current = next;
                self.error = None;
                true
            }
            Err(error) => {
                self.error = Some(error.to_string());
                false
            }
        }
    }

    fn block(&self, ui: &mut Ui, name: &str, block: &mut dyn Block, default: &dyn Block) -> bool {
        let search = self.search.trim().to_lowercase();
        let is_visible = |field: &Field| {
            // Exact fields hold accumulated wind drift and have no slider.
            if matches!(field.ty, Type::Exact(_)) {
                return false;
            }
            search.is_empty() || format!("{name}.{} {}", field.name, field.doc).to_lowercase().contains(&search)
        };
        let fields: Vec<_> = block.fields().iter().enumerate().filter(|(_, field)| is_visible(field)).collect();
        if fields.is_empty() {
            return false;
        }
        let mut changed = false;
        let open = (!search.is_empty()).then_some(true);
        let title = name.replace('_', " ");
        egui::CollapsingHeader::new(title).id_salt(name).open(open).show(ui, |ui| {
            for (index, field) in fields {
                let before = block.get(index);
                let mut value = before.clone();
                row(ui, name, field, &mut value, &default.get(index));
                if value != before {
                    // `assign` accepts every value in the range of the slider.
                    changed |= assign(block, name, field.name, &value).is_ok();
                }
            }
        });
        changed
    }
}

fn row(ui: &mut Ui, block: &str, field: &Field, value: &mut Value, default: &Value) {
    let hover = |response: egui::Response| {
        let unit = if field.unit.is_empty() { String::new() } else { format!("\n[{}]", field.unit) };
        response.on_hover_text(format!("{block}.{}\n{}{unit}\n{}", field.name, field.doc.trim(), field.allowed()))
    };
    ui.horizontal(|ui| {
        let name = field.name.replace('_', " ");
        let label =
            hover(column_label(ui, if value == default { RichText::new(name) } else { RichText::new(name).strong() }));
        let reset = ui.add_enabled(value != default, egui::Button::new("×").small());
        if reset.on_hover_text(format!("back to {default}")).clicked() {
            *value = default.clone();
        }
        hover(widget(ui, field, value).labelled_by(label.id));
    });
}

fn widget(ui: &mut Ui, field: &Field, value: &mut Value) -> egui::Response {
    let (min, max) = field.range;
    let suffix = if field.unit.is_empty() { String::new() } else { format!(" {}", field.unit) };
    let logarithmic = min >= 0.0 && max > LOGARITHMIC_RATIO * min.max(1.0);
    match (field.ty, value) {
        (Type::F32, Value::Float(v)) => {
            ui.add(Slider::new(v, min..=max).logarithmic(logarithmic).suffix(suffix).max_decimals(6))
        }
        (Type::U32, Value::Int(v)) => {
            ui.add(Slider::new(v, min as i64..=max as i64).logarithmic(logarithmic).suffix(suffix))
        }
        (Type::Bool, Value::Bool(v)) => ui.checkbox(v, ""),
        (Type::Choice(names), Value::Text(v)) => {
            let combo = egui::ComboBox::from_id_salt(field.name).selected_text(v.clone());
            combo
                .show_ui(ui, |ui| {
                    for name in names {
                        ui.selectable_value(v, (*name).to_owned(), *name);
                    }
                })
                .response
        }
        (Type::Vector(3), Value::Vector(v)) if (min, max) == (0.0, 1.0) => {
            let mut rgb = [v[0] as f32, v[1] as f32, v[2] as f32];
            let response = ui.color_edit_button_rgb(&mut rgb);
            if response.changed() {
                *v = rgb.map(|v| (f64::from(v) * 1e4).round() / 1e4).to_vec();
            }
            response
        }
        (Type::Vector(_), Value::Vector(v)) => {
            let number = |v| egui::DragValue::new(v).range(min..=max).speed(((max - min) / 1e4).clamp(1e-3, 100.0));
            ui.horizontal(|ui| v.iter_mut().map(|v| ui.add(number(v))).reduce(|a, b| a | b))
                .inner
                .unwrap_or_else(|| ui.label("–"))
        }
        (Type::Map(_), Value::Map(map)) => ui.label(format!("{} x {}", map.width, map.height)),
        _ => ui.colored_label(Color32::GRAY, "none"),
    }
}
