//! Text formats of the sky parameters: the TOML files of `Params.save`, and Python code that renders the view.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use clouds_core::params::{Params, RENAMED, Weather};
use clouds_core::schema::{Block, Map, Type, Value, assign};
use clouds_core::{Camera, DensityGrid};
use glam::DVec3;
use toml::{Table, Value as Toml};

/// Scenes of the Python package; tests/test_demo.py compares them and regenerates the file with `UPDATE=1`.
const SCENES: &str = include_str!("scenes.toml");

/// Named scenes with camera and parameters.
pub fn scenes() -> Result<Vec<(String, Camera, Params)>> {
    let table: Table = SCENES.parse()?;
    table.into_iter().map(|(name, scene)| scene_from(name, scene)).collect()
}

fn scene_from(name: String, scene: Toml) -> Result<(String, Camera, Params)> {
    let Toml::Table(mut scene) = scene else { bail!("{name} must be a table") };
    let Some(Toml::Table(camera)) = scene.remove("camera") else { bail!("{name}.camera is missing") };
    let vector = |field: &str| -> Result<DVec3> {
        match camera.get(field).map(value).transpose()? {
            Some(Value::Vector(v)) if v.len() == 3 => Ok(DVec3::from_slice(&v)),
            _ => bail!("{name}.camera.{field} must be 3 numbers"),
        }
    };
    let fov = camera.get("fov_y").and_then(Toml::as_float).unwrap_or(60.0);
    let eye = vector("eye")?;
    let camera = Camera::look_at(eye, eye + vector("forward")?, DVec3::Z, fov)?;
    Ok((name, camera, params_from(scene)?))
}

/// Parameters from a TOML file; omitted fields have their defaults.
pub fn load(path: &Path) -> Result<Params> {
    let text = std::fs::read_to_string(path).with_context(|| format!("{} cannot be read", path.display()))?;
    // Some Windows editors write a byte-order mark.
    let text = text.trim_start_matches('\u{feff}');
    let table: Table = text.parse().with_context(|| format!("{} is no TOML file", path.display()))?;
    let table = inline_arrays(Toml::Table(table), path.parent().unwrap_or(Path::new("")))?;
    let Toml::Table(table) = table else { unreachable!("`inline_arrays` returns a table for a table") };
    params_from(table).with_context(|| format!("{} is no sky", path.display()))
}

/// Value with the names of `.npy` files replaced by the arrays in them; Python saves arrays beside the TOML file.
fn inline_arrays(value: Toml, folder: &Path) -> Result<Toml> {
    fn nested(shape: &[usize], data: &[f32]) -> Toml {
        match shape {
            [] => Toml::Float(f64::from(data[0])),
            [side, rest @ ..] => {
                let parts = data.chunks((data.len() / side.max(&1)).max(1));
                Toml::Array(parts.map(|part| nested(rest, part)).collect())
            }
        }
    }
    Ok(match value {
        Toml::String(name) if name.ends_with(".npy") => {
            let (shape, data) = clouds_core::files::read_npy(&folder.join(name))?;
            nested(&shape, &data)
        }
        Toml::Array(parts) if parts.iter().any(Toml::is_table) => {
            Toml::Array(parts.into_iter().map(|part| inline_arrays(part, folder)).collect::<Result<_>>()?)
        }
        Toml::Table(fields) => {
            let fields = fields.into_iter().map(|(name, field)| Ok((name, inline_arrays(field, folder)?)));
            Toml::Table(fields.collect::<Result<_>>()?)
        }
        other => other,
    })
}

fn params_from(table: Table) -> Result<Params> {
    let mut params = Params::default();
    for (block, fields) in table {
        match (block.as_str(), fields) {
            ("weather_mix", Toml::Array(weathers)) => {
                for (index, weather) in weathers.into_iter().enumerate() {
                    let path = format!("weather_mix[{index}]");
                    let Toml::Table(mut fields) = weather else { bail!("{path} must be a table") };
                    let Some(weight) = fields.remove("weight").and_then(|w| w.as_float()) else {
                        bail!("{path}.weight is missing: a weather of a mixture has a weight");
                    };
                    let mut weather = Weather::default();
                    fill(&mut weather, &path, &fields)?;
                    params.weather_mix.push((weather, weight as f32));
                }
            }
            ("volume", Toml::Table(fields)) => params.volume = Some(Arc::new(grid(&fields)?)),
            (_, Toml::Table(fields)) => {
                let mut blocks = params.blocks_mut();
                let names: Vec<_> = blocks.iter().map(|(name, _)| *name).collect();
                let Some((name, block)) = blocks.iter_mut().find(|(name, _)| *name == current(&block)) else {
                    bail!("{block} is not allowed: it must be one of {}", names.join(", "));
                };
                fill(*block, name, &fields)?;
            }
            _ => bail!("{block} must be a table"),
        }
    }
    params.check()?;
    Ok(params)
}

/// Name of a block or field by its name or a deprecated one.
fn current(name: &str) -> &str {
    RENAMED.iter().find(|(old, _)| *old == name).map_or(name, |(_, new)| new)
}

fn fill(block: &mut dyn Block, path: &str, fields: &Table) -> Result<()> {
    for (name, given) in fields {
        let name = current(name);
        assign(block, path, name, &value(given).with_context(|| format!("{path}.{name}"))?)?;
    }
    Ok(())
}

fn grid(fields: &Table) -> Result<DensityGrid> {
    let (Some(Toml::Array(slices)), Some(Toml::Array(bounds))) = (fields.get("extinction"), fields.get("bounds"))
    else {
        bail!("volume must have extinction and bounds");
    };
    let slices: Vec<_> = slices.iter().map(|slice| numbers(slice, 2)).collect::<Result<_>>()?;
    let Some((first, _)) = slices.first() else { bail!("volume.extinction is empty") };
    let [height, width] = first[..] else { bail!("volume.extinction must be of three dimensions") };
    if slices.iter().any(|(shape, _)| shape != first) {
        bail!("volume.extinction must have slices of one shape");
    }
    let data = slices.iter().flat_map(|(_, data)| data.iter().map(|v| *v as f32)).collect();
    let corners: Vec<_> = bounds.iter().map(|corner| numbers(corner, 1)).collect::<Result<_>>()?;
    let [(_, low), (_, high)] = &corners[..] else { bail!("volume.bounds must be two corners") };
    if low.len() != 3 || high.len() != 3 {
        bail!("volume.bounds must be two corners of 3 numbers");
    }
    let size = [width, height, slices.len()];
    Ok(DensityGrid::new(size, data, DVec3::from_slice(low), DVec3::from_slice(high))?)
}

fn number(given: &Toml) -> Option<f64> {
    given.as_float().or_else(|| given.as_integer().map(|v| v as f64))
}

/// Shape and elements of a nested array of `dimensions` dimensions.
fn numbers(given: &Toml, dimensions: usize) -> Result<(Vec<usize>, Vec<f64>)> {
    let Toml::Array(entries) = given else { bail!("{given} must be an array") };
    if dimensions == 1 {
        let data: Option<Vec<_>> = entries.iter().map(number).collect();
        return Ok((vec![entries.len()], data.context("an array must be of numbers")?));
    }
    let rows: Vec<_> = entries.iter().map(|row| numbers(row, dimensions - 1)).collect::<Result<_>>()?;
    let inner = rows.first().map(|(shape, _)| shape.clone()).unwrap_or_default();
    if rows.iter().any(|(shape, _)| *shape != inner) {
        bail!("the rows of an array must be of one length");
    }
    Ok(([vec![rows.len()], inner].concat(), rows.into_iter().flat_map(|(_, data)| data).collect()))
}

fn value(given: &Toml) -> Result<Value> {
    Ok(match given {
        Toml::Boolean(v) => Value::Bool(*v),
        Toml::Integer(v) => Value::Int(*v),
        Toml::Float(v) => Value::Float(*v),
        Toml::String(v) => Value::Text(v.clone()),
        Toml::Array(entries) if entries.iter().any(Toml::is_array) => {
            let deep = entries.iter().any(|row| row.as_array().is_some_and(|row| row.iter().any(Toml::is_array)));
            let (shape, data) = numbers(given, if deep { 3 } else { 2 })?;
            let channels = shape.get(2).copied().unwrap_or(1);
            let data = data.iter().map(|v| *v as f32).collect();
            Value::Map(Arc::new(Map { width: shape[1], height: shape[0], channels, data }))
        }
        Toml::Array(_) => Value::Vector(numbers(given, 1)?.1),
        Toml::Datetime(_) | Toml::Table(_) => bail!("{given} must be a number, a string, a boolean or an array"),
    })
}

/// Writes all parameters to a TOML file, which the Python package can read.
pub fn save(path: &Path, params: &Params) -> Result<()> {
    Ok(clouds_core::files::write_bytes(path, to_toml(params)?.as_bytes())?)
}

fn to_toml(params: &Params) -> Result<String> {
    let mut table = Table::new();
    for (name, block) in params.blocks() {
        table.insert(name.into(), Toml::Table(table_of(block)));
    }
    if !params.weather_mix.is_empty() {
        let weathers = params.weather_mix.iter().map(|(weather, weight)| {
            let mut fields = table_of(weather);
            fields.insert("weight".into(), Toml::Float(f64::from(*weight)));
            Toml::Table(fields)
        });
        table.insert("weather_mix".into(), Toml::Array(weathers.collect()));
    }
    if let Some(grid) = &params.volume {
        let [width, height, depth] = grid.size();
        let map = Map { width, height: height * depth, channels: 1, data: grid.extinction().to_vec() };
        let Toml::Array(rows) = nested(&map) else { bail!("a grid is an array") };
        let slices = rows.chunks(height).map(|rows| Toml::Array(rows.to_vec())).collect();
        let corner = |v: DVec3| Toml::Array(v.to_array().map(Toml::Float).to_vec());
        let mut fields = Table::new();
        fields.insert("extinction".into(), Toml::Array(slices));
        fields.insert("bounds".into(), Toml::Array(grid.bounds().map(corner).to_vec()));
        table.insert("volume".into(), Toml::Table(fields));
    }
    Ok(toml::to_string(&table)?)
}

fn table_of(block: &dyn Block) -> Table {
    let fields = block.fields().iter().enumerate();
    fields.filter_map(|(index, field)| Some((field.name.to_owned(), toml_of(&block.get(index))?))).collect()
}

fn toml_of(value: &Value) -> Option<Toml> {
    Some(match value {
        Value::Bool(v) => Toml::Boolean(*v),
        Value::Int(v) => Toml::Integer(*v),
        Value::Float(v) => Toml::Float(*v),
        Value::Vector(v) => Toml::Array(v.iter().map(|v| Toml::Float(*v)).collect()),
        Value::Text(v) => Toml::String(v.clone()),
        Value::Map(map) => nested(map),
        Value::None => return None,
    })
}

fn nested(map: &Map) -> Toml {
    let number = |v: &f32| Toml::Float(f64::from(*v));
    let pixel = |v: &[f32]| if v.len() == 1 { number(&v[0]) } else { Toml::Array(v.iter().map(number).collect()) };
    let row = |row: &[f32]| Toml::Array(row.chunks(map.channels).map(pixel).collect());
    Toml::Array(map.data.chunks(map.width * map.channels).map(row).collect())
}

/// Arguments of the Python code that renders a view.
pub struct PythonCall<'a> {
    /// Camera.
    pub camera: &'a Camera,
    /// Sky parameters.
    pub params: &'a Params,
    /// Animation time, s.
    pub time: f64,
    /// Name of the quality.
    pub quality: &'a str,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Exposure, stops.
    pub exposure: f32,
    /// Tone map, one of [`clouds_core::color::TONE_MAPS`].
    pub tone_map: &'a str,
}

/// Python code that renders the view.
///
/// Parameters that have no Python literal come from a TOML file ([`needs_file`]), whose name is `params_file`.
pub fn python_code(call: &PythonCall<'_>, params_file: Option<&str>) -> String {
    let mut code = String::from("import nubis\n\n");
    if let Some(path) = params_file {
        let _ = writeln!(code, "params = nubis.Params.load({path:?})");
    } else {
        let changes = changes(call.params);
        if changes.is_empty() {
            code += "params = nubis.Params()\n";
        } else {
            code += "params = nubis.Params().with_(\n    **{\n";
            for (path, value) in changes {
                let _ = writeln!(code, "        \"{path}\": {value},");
            }
            code += "    }\n)\n";
        }
    }
    let Camera { eye, forward, up, fov, .. } = call.camera;
    let target = *eye + *forward;
    let tuple = |v: DVec3| format!("({:?}, {:?}, {:?})", v.x, v.y, v.z);
    let _ = writeln!(
        code,
        "camera = nubis.Camera.look_at(\n    eye={},\n    target={},\n    up={},\n    fov_y={fov:?},\n)",
        tuple(*eye),
        tuple(target),
        tuple(*up)
    );
    let [width, height] = call.size;
    let PythonCall { time, quality, exposure, tone_map, .. } = call;
    let _ = writeln!(code, "renderer = nubis.Renderer({width}, {height}, quality=\"{quality}\")");
    let _ = writeln!(code, "frame = renderer.render(camera, params, time={time:?})");
    let _ = writeln!(code, "nubis.save(\"sky.png\", frame, exposure={exposure:?}, tonemap=\"{tone_map}\")");
    code
}

/// Whether parameters have no Python literal: maps, mixtures and density grids.
pub fn needs_file(params: &Params) -> bool {
    let has_map = |block: &dyn Block| {
        let fields = block.fields().iter().enumerate();
        fields.filter(|(_, f)| matches!(f.ty, Type::Map(_))).any(|(i, _)| block.get(i) != Value::None)
    };
    params.volume.is_some()
        || !params.weather_mix.is_empty()
        || params.blocks().iter().any(|(_, block)| has_map(*block))
}

/// Fields that differ from their defaults: path and Python literal.
fn changes(params: &Params) -> Vec<(String, String)> {
    let default = Params::default();
    let mut changes = Vec::new();
    for ((name, block), (_, default)) in params.blocks().iter().zip(default.blocks()) {
        for (index, field) in block.fields().iter().enumerate() {
            let value = block.get(index);
            if value != default.get(index) {
                changes.push((format!("{name}.{}", field.name), python_value(&value)));
            }
        }
    }
    changes
}

fn python_value(value: &Value) -> String {
    match value {
        Value::Bool(true) => "True".into(),
        Value::Bool(false) => "False".into(),
        Value::Float(v) => format!("{v:?}"),
        Value::Vector(v) => format!("({})", v.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Params> {
        params_from(text.parse()?)
    }

    #[test]
    fn scenes_are_valid() {
        let scenes = scenes().expect("scenes are valid");
        assert!(scenes.iter().any(|(name, ..)| name == "fair_weather"));
        assert!(scenes.len() > 8);
    }

    #[test]
    fn saved_parameters_round_trip() {
        let mut params = Params::default();
        params.clouds.coverage = 0.7;
        params.sun.irradiance = [1.0, 2.5, 3.0];
        let data = (0..24).map(|i| i as f32 / 24.0).collect();
        params.weather.map = Some(Arc::new(Map { width: 4, height: 2, channels: 3, data }));
        params.weather_mix.push((Weather { seed: 7, map: params.weather.map.clone(), ..Weather::default() }, 0.25));
        let low = DVec3::new(0.0, 0.0, 1000.0);
        let grid = DensityGrid::new([2, 3, 4], (0..24).map(|i| i as f32 * 1e-3).collect(), low, low + 500.0);
        params.volume = Some(Arc::new(grid.expect("is a grid")));
        let text = to_toml(&params).expect("is written");
        assert_eq!(parsed(&text).expect("is read"), params);
    }

    #[test]
    fn deprecated_names_are_read() {
        let params = parsed("[atmosphere]\nbeams = false\n[wander]\nwind = 0.25").unwrap();
        assert!(!params.atmosphere.light_shafts);
        assert!((params.wind_variation.wind - 0.25).abs() < 1e-6);
    }

    #[test]
    fn invalid_files_are_rejected_by_field() {
        for (text, named) in [
            ("[clouds]\ncoverage = 2.0", "clouds.coverage = 2"),
            ("[clouds]\ncovrage = 0.5", "clouds.covrage"),
            ("[cloud]\n", "cloud is not allowed"),
            ("[light]\nmodel = 'best'", "light.model"),
            ("[clouds]\nbase = 3000.0\ntop = 2000.0", "clouds.top"),
            ("[weather]\nmap = [[[0.1, 0.2, 0.3]], [[0.1, 0.2]]]", "weather.map"),
        ] {
            let error = format!("{:#}", parsed(text).expect_err(text));
            assert!(error.contains(named), "{error}");
        }
    }

    #[test]
    fn python_code_has_the_changed_fields() {
        let (_, camera, mut params) = scenes().expect("scenes are valid").remove(0);
        params.clouds.coverage = 0.7;
        params.light.model = clouds_core::params::Model::Vsu2022;
        let call = PythonCall {
            camera: &camera,
            params: &params,
            time: 3.0,
            quality: "balanced",
            size: [64, 36],
            exposure: 0.5,
            tone_map: "agx",
        };
        let code = python_code(&call, None);
        assert!(code.contains("\"clouds.coverage\": 0.7,") && code.contains("\"light.model\": \"vsu2022\","), "{code}");
        assert!(!code.contains("clouds.base"), "{code}");
    }
}
