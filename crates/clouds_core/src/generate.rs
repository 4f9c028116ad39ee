//! Code generation for other languages: `python/nubis/params.py` and `docs/parameters.md`. `make generate`, a part of
//! `make build`, writes the files; a test keeps them current.

use std::fmt::Write as _;

use crate::params::{Params, Quality};
use crate::schema::{Block, Field, Type, Value};

/// Generated files: path from the root of the repository, and content.
pub fn files() -> [(&'static str, String); 2] {
    [("python/nubis/params.py", python()), ("docs/parameters.md", manual())]
}

/// Documentation of `weather_mix`.
const WEATHER_MIX: &str = "Further weathers and their weights in the weather map. Each weight is from 0 to 1, their \
    sum at most 1; `weather` has the rest. All weathers have the same `extent`, `edge` and `broad_extent`. A change of \
    the weather is a mixture of varying weights (thesis2018): see `WeatherBlend` and `lerp`.";

fn python_type(field: &Field) -> String {
    match field.ty {
        Type::F32 | Type::Exact(1) => "float".into(),
        Type::U32 => "int".into(),
        Type::Bool => "bool".into(),
        Type::Vector(n) | Type::Exact(n) => format!("tuple[{}]", vec!["float"; n].join(", ")),
        Type::Choice(names) => {
            format!("Literal[{}]", names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", "))
        }
        Type::Map(_) => "npt.NDArray[np.float32] | None".into(),
        Type::Array(_) => unreachable!("is set by no user"),
    }
}

fn python_number(v: f64) -> String {
    // Rust prints whole floats without a point, which Python reads as an int.
    if v == v.trunc() && v.abs() < 1e15 { format!("{v:.1}") } else { v.to_string() }
}

fn python_value(value: &Value) -> String {
    match value {
        Value::Bool(v) => if *v { "True" } else { "False" }.into(),
        Value::Int(v) => v.to_string(),
        Value::Float(v) => python_number(*v),
        Value::Vector(v) => format!("({})", v.iter().map(|v| python_number(*v)).collect::<Vec<_>>().join(", ")),
        Value::Text(v) => format!("{v:?}"),
        Value::Map(_) | Value::None => "None".into(),
    }
}

/// Documentation of a field without the leading space of `///`.
fn about(field: &Field) -> &'static str {
    field.doc.trim()
}

/// Breaks `text` into indented lines of at most 100 columns.
fn wrapped(text: &str, indent: &str) -> String {
    let mut out = String::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        if !line.is_empty() && indent.len() + line.len() + 1 + word.len() > 100 {
            let _ = writeln!(out, "{indent}{line}");
            line.clear();
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line += word;
    }
    let _ = writeln!(out, "{indent}{line}");
    out
}

fn dataclass(out: &mut String, block: &dyn Block) {
    // A block with further methods has a base class of its own.
    let base = if block.type_name() == "Sun" { "SunBlock" } else { "Block" };
    let decorator = "@dataclass(frozen=True, kw_only=True, eq=False)";
    let _ = writeln!(out, "\n\n{decorator}\nclass {}({base}):", block.type_name());
    out.push_str(&wrapped(&format!("\"\"\"{}", block.doc().trim()), "    "));
    out.push_str("\n    Attributes\n    ----------\n");
    for field in block.fields() {
        let ty = match field.ty {
            Type::Map(1) => "array of float32, shape (H, W), or None".into(),
            Type::Map(channels) => format!("array of float32, shape (H, W, {channels}), or None"),
            Type::Choice(names) => format!("{{{}}}", names.join(", ")),
            _ => python_type(field),
        };
        let _ = writeln!(out, "    {} : {ty}", field.name);
        out.push_str(&wrapped(&format!("{} Allowed: {}.", about(field), field.allowed()), "        "));
    }
    out.push_str("    \"\"\"\n\n");
    for (index, field) in block.fields().iter().enumerate() {
        let value = python_value(&block.get(index));
        let mut line = format!("    {}: {} = {value}", field.name, python_type(field));
        if line.len() > 100 {
            // Line breaks of `ruff format`.
            line = line.replace("Literal[", "Literal[\n        ").replace("] = ", "\n    ] = ");
        }
        let _ = writeln!(out, "{line}");
    }
}

fn python() -> String {
    let mut out = String::from(
        "\"\"\"The parameters of a sky and of the numerical method.\n\n\
         Generated from crates/clouds_core/src/params.rs by `make generate`: change it there.\n\"\"\"\n\n\
         from __future__ import annotations\n\n\
         from dataclasses import dataclass, field\n\
         from typing import Literal\n\n\
         import numpy as np\n\
         import numpy.typing as npt\n\n\
         from nubis._block import Block, Root\n\
         from nubis._nubis import DensityGrid\n\
         from nubis._sun import SunBlock\n",
    );
    let params = Params::default();
    for (_, block) in params.blocks() {
        dataclass(&mut out, block);
    }
    dataclass(&mut out, &Quality::default());
    out.push_str(
        "\n\n@dataclass(frozen=True, kw_only=True, eq=False)\nclass Params(Root):\n    \
         \"\"\"All parameters of a sky; the defaults are a fair-weather sky.\n\n    \
         Attributes\n    ----------\n",
    );
    for (name, block) in params.blocks() {
        let _ = writeln!(out, "    {name} : {}", block.type_name());
        out.push_str(&wrapped(block.doc(), "        "));
    }
    out.push_str("    weather_mix : tuple of (Weather, float)\n");
    out.push_str(&wrapped(WEATHER_MIX, "        "));
    out.push_str("    volume : DensityGrid or None\n");
    out.push_str(&wrapped(
        "User-supplied extinction grid that replaces the procedural clouds, and the high clouds unless \
         `high_clouds.with_volume` is True.",
        "        ",
    ));
    out.push_str("    \"\"\"\n\n");
    for (name, block) in params.blocks() {
        let ty = block.type_name();
        let _ = writeln!(out, "    {name}: {ty} = field(default_factory={ty})");
    }
    out.push_str("    weather_mix: tuple[tuple[Weather, float], ...] = ()\n");
    out.push_str("    volume: DensityGrid | None = None\n");
    out
}

fn manual() -> String {
    let mut out = String::from(
        "# Parameters\n\nGenerated from `crates/clouds_core/src/params.rs` by `make generate`: change it there. The \
         sources in brackets are listed in [sources.md](sources.md).\n",
    );
    let params = Params::default();
    let quality = Quality::default();
    let blocks = params.blocks();
    let all = blocks
        .iter()
        .map(|(name, block)| (format!("`{name}`"), *block))
        .chain([("`quality` (`nubis.Quality`)".to_owned(), &quality as &dyn Block)]);
    for (name, block) in all {
        let _ = writeln!(out, "\n## {name}\n\n{}\n", block.doc().trim());
        out.push_str("| field | default | allowed | what |\n| --- | --- | --- | --- |\n");
        for (index, field) in block.fields().iter().enumerate() {
            let value = python_value(&block.get(index));
            let allowed = field.allowed().replace('|', "\\|");
            let _ = writeln!(out, "| `{}` | `{value}` | {allowed} | {} |", field.name, about(field));
        }
    }
    let _ = writeln!(
        out,
        "\n## `weather_mix`\n\nA tuple of pairs (`nubis.Weather`, weight), empty by default. {WEATHER_MIX}"
    );
    out
}
