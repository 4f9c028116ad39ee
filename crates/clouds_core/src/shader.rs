//! WGSL files and how they find each other: `#import name` on a line of its own brings in the whole of a file, once.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::path::Path;

use crate::constants;
use crate::params::{self, Params, Quality};
use crate::schema::{Block, wgsl_struct};
use crate::uniforms::{Dispatch, Sky, View};

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// One self-contained WGSL module, and where each of its lines came from.
pub struct Linked {
    /// The WGSL.
    pub code: String,
    lines: Vec<(String, usize)>,
}

impl Linked {
    /// Links the file called `root` with all that it imports. WGSL ignores the order of declarations, so importing is
    /// appending.
    pub fn new(root: &str) -> Result<Self, String> {
        let mut linked = Self { code: String::new(), lines: Vec::new() };
        let source = read(root).ok_or_else(|| missing(root))?;
        linked.append(root, &source)?;
        Ok(linked)
    }

    /// Links `source`, which is no file, with all that it imports.
    pub fn from_source(source: &str) -> Result<Self, String> {
        let mut linked = Self { code: String::new(), lines: Vec::new() };
        linked.append("(source)", source)?;
        Ok(linked)
    }

    fn append(&mut self, root: &str, source: &str) -> Result<(), String> {
        let mut queue = vec![(root.to_owned(), source.to_owned())];
        let mut seen = HashSet::from([root.to_owned()]);
        while let Some((file, source)) = queue.pop() {
            for (number, line) in source.lines().enumerate() {
                match line.strip_prefix("#import ") {
                    Some(import) if seen.insert(import.to_owned()) => {
                        let source = read(import).ok_or_else(|| format!("{file}: {}", missing(import)))?;
                        queue.push((import.to_owned(), source));
                    }
                    Some(_) => {}
                    None => {
                        self.code += line;
                        self.code.push('\n');
                        self.lines.push((file.clone(), number + 1));
                    }
                }
            }
        }
        Ok(())
    }

    /// The file and line that line `number` of the linked code came from.
    pub fn origin(&self, number: usize) -> String {
        let (file, line) = &self.lines[number - 1];
        match std::env::var_os(FOLDER) {
            Some(folder) => format!("{}:{line}", Path::new(&folder).join(format!("{file}.wgsl")).display()),
            None => format!("shaders/wgsl/{file}.wgsl:{line}"),
        }
    }

    /// Parses and validates the module; errors name the file and line that the text came from.
    pub fn parse(&self) -> Result<(wgpu::naga::Module, wgpu::naga::valid::ModuleInfo), String> {
        use wgpu::naga::{front::wgsl, valid};
        let module = wgsl::parse_str(&self.code).map_err(|error| {
            let line = error.location(&self.code).map_or(1, |at| at.line_number as usize);
            format!("{}: {}", self.origin(line), error.emit_to_string(&self.code))
        })?;
        // pack2x16float, which every backend that we open has.
        let capabilities = valid::Capabilities::default() | valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        let info =
            valid::Validator::new(valid::ValidationFlags::all(), capabilities).validate(&module).map_err(|error| {
                let line = error.location(&self.code).map_or(1, |at| at.line_number as usize);
                format!("{}: {}", self.origin(line), error.emit_to_string(&self.code))
            })?;
        Ok((module, info))
    }
}

/// The text of a WGSL file. `params`, `uniforms` and `constants` are not files: they are written from the one definition
/// of the parameters and of each constant, so that they cannot be stale.
pub fn read(name: &str) -> Option<String> {
    match name {
        "params" => Some(params_source()),
        "constants" => Some(constants::source()),
        "uniforms" => {
            let parts: [&dyn Block; 3] = [&View::default(), &Sky::default(), &Dispatch::default()];
            let frame = "struct Frame {\n    @align(16) view: View,\n    @align(16) sky: Sky,\n}\n";
            Some(parts.map(wgsl_struct).concat() + frame)
        }
        _ => match std::env::var_os(FOLDER) {
            // For work on shaders: read from a folder, without building anything again.
            Some(folder) => std::fs::read_to_string(Path::new(&folder).join(format!("{name}.wgsl"))).ok(),
            None => SHADERS.iter().find(|(file, _)| *file == name).map(|(_, source)| (*source).to_owned()),
        },
    }
}

/// The environment variable with the folder that shaders are read from.
const FOLDER: &str = "NUBIS_SHADERS";

/// An error for a file that [`read`] does not find.
fn missing(name: &str) -> String {
    match std::env::var_os(FOLDER) {
        Some(folder) => format!("{FOLDER} = {folder:?} has no file {name}.wgsl that can be read"),
        None => format!("no shader named {name:?}"),
    }
}

/// Every WGSL file by name.
pub fn names() -> impl Iterator<Item = &'static str> {
    SHADERS.iter().map(|(name, _)| *name)
}

fn params_source() -> String {
    let mut code = String::new();
    for (_, block) in Params::default().blocks() {
        code += &wgsl_struct(block);
    }
    code += &wgsl_struct(&Quality::default());
    code += "struct Params {\n";
    for (name, type_name, _) in params::uniform_layout().0 {
        let _ = writeln!(code, "    @align(16) {name}: {type_name},");
    }
    code += "}\n";
    code
}
