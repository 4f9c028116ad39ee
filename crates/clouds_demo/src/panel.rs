//! Sliders made from the one definition of the parameters: unit, range, what it is, and the way back to the default.

use clouds_core::params::{Params, Quality};
use clouds_core::schema::{Block, Field, Type, Value, assign};
use eframe::egui::{self, Color32, Response, RichText, Slider, Ui, WidgetText};

/// Ranges wider than this are in decades.
const WIDE: f64 = 300.0;
/// Points of the column of names in a panel.
const NAMES: f32 = 128.0;
/// Points of a slider beside it: with its number and its unit they fill the panel.
const SLIDER: f32 = 90.0;

/// A name, and its widget after it.
pub fn labelled(ui: &mut Ui, name: &str, widget: impl FnOnce(&mut Ui) -> Response) -> Response {
    let label = ui.label(name);
    widget(ui).labelled_by(label.id)
}

/// A row of a panel: names in a column, and their widgets after them.
pub fn field(ui: &mut Ui, name: impl Into<WidgetText>, widget: impl FnOnce(&mut Ui) -> Response) -> Response {
    ui.horizontal(|ui| {
        let label = column(ui, name);
        widget(ui).labelled_by(label.id)
    })
    .inner
}

/// A menu after its name, with room for all choices.
pub fn menu(ui: &mut Ui, name: &str, chosen: &str, choices: impl FnOnce(&mut Ui)) {
    labelled(ui, name, |ui| {
        let menu = egui::ComboBox::from_id_salt(name).selected_text(chosen).height(400.0);
        menu.show_ui(ui, choices).response
    });
}

/// A name in the column of names.
fn column(ui: &mut Ui, name: impl Into<WidgetText>) -> Response {
    ui.spacing_mut().slider_width = SLIDER;
    let size = egui::vec2(NAMES, ui.spacing().interact_size.y);
    let layout = egui::Layout::left_to_right(egui::Align::Center);
    let place = ui.allocate_ui_with_layout(size, layout, |ui| {
        ui.set_min_width(NAMES);
        ui.add(egui::Label::new(name).truncate())
    });
    place.inner
}

/// What the user has asked for in a panel.
#[derive(Default)]
pub struct Panel {
    /// Only fields whose name or text has this.
    pub search: String,
    /// Why the last change was refused.
    pub refused: Option<String>,
}

impl Panel {
    /// All groups of a sky; says whether it was changed.
    pub fn sky(&mut self, ui: &mut Ui, params: &mut Params) -> bool {
        let mut next = params.clone();
        let usual = Params::default();
        let mut changed = false;
        for ((name, block), (_, usual)) in next.blocks_mut().into_iter().zip(usual.blocks()) {
            changed |= self.block(ui, name, block, usual);
        }
        changed && self.accept(next.check().map(|()| next), params)
    }

    /// The fields of a method; says whether it was changed.
    pub fn quality(&mut self, ui: &mut Ui, quality: &mut Quality, usual: &Quality) -> bool {
        let mut next = quality.clone();
        self.block(ui, "quality", &mut next, usual) && self.accept(next.check().map(|()| next), quality)
    }

    /// Takes what is allowed, and says why not what is not.
    fn accept<T>(&mut self, next: clouds_core::Result<T>, current: &mut T) -> bool {
        match next {
            Ok(next) => {
                *current = next;
                self.refused = None;
                true
            }
            Err(error) => {
                self.refused = Some(error.to_string());
                false
            }
        }
    }

    fn block(&self, ui: &mut Ui, name: &str, block: &mut dyn Block, usual: &dyn Block) -> bool {
        let search = self.search.trim().to_lowercase();
        let wanted = |field: &Field| {
            // What follows from the winds of before is no matter of sliders.
            if matches!(field.ty, Type::Exact(_)) {
                return false;
            }
            search.is_empty() || format!("{name}.{} {}", field.name, field.doc).to_lowercase().contains(&search)
        };
        let fields: Vec<_> = block.fields().iter().enumerate().filter(|(_, field)| wanted(field)).collect();
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
                row(ui, name, field, &mut value, &usual.get(index));
                if value != before {
                    // A slider stays within the range that is checked.
                    changed |= assign(block, name, field.name, &value).is_ok();
                }
            }
        });
        changed
    }
}

fn row(ui: &mut Ui, block: &str, field: &Field, value: &mut Value, usual: &Value) {
    let hover = |response: egui::Response| {
        let unit = if field.unit.is_empty() { String::new() } else { format!("\n[{}]", field.unit) };
        response.on_hover_text(format!("{block}.{}\n{}{unit}\n{}", field.name, field.doc.trim(), field.allowed()))
    };
    ui.horizontal(|ui| {
        let name = field.name.replace('_', " ");
        let label = hover(column(ui, if value == usual { RichText::new(name) } else { RichText::new(name).strong() }));
        let back = ui.add_enabled(value != usual, egui::Button::new("×").small());
        if back.on_hover_text(format!("back to {usual}")).clicked() {
            *value = usual.clone();
        }
        hover(widget(ui, field, value).labelled_by(label.id));
    });
}

fn widget(ui: &mut Ui, field: &Field, value: &mut Value) -> egui::Response {
    let (min, max) = field.range;
    let suffix = if field.unit.is_empty() { String::new() } else { format!(" {}", field.unit) };
    let wide = min >= 0.0 && max > WIDE * min.max(1.0);
    match (field.ty, value) {
        (Type::F32, Value::Float(v)) => {
            ui.add(Slider::new(v, min..=max).logarithmic(wide).suffix(suffix).max_decimals(6))
        }
        (Type::U32, Value::Int(v)) => ui.add(Slider::new(v, min as i64..=max as i64).logarithmic(wide).suffix(suffix)),
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
