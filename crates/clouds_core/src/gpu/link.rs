//! Linker for WGSL files: a line `#import name` includes a file, once.

use std::collections::HashSet;
use std::path::Path;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));

/// Source of a generated module by its name; None for other names.
pub(crate) type Generated = fn(&str) -> Option<String>;

/// File that is linked for the name of an import.
pub(crate) type Import = (&'static str, &'static str);

/// Self-contained WGSL module with the origin of each line.
pub struct Linked {
    /// WGSL source.
    pub code: String,
    /// Imports that were resolved by the table of the caller.
    pub(crate) resolved: Vec<Import>,
    lines: Vec<(String, usize)>,
}

impl Linked {
    /// Links the file `root` with all of its imports. The order of WGSL declarations is free, so imports are appended.
    /// An import in the table is that of its file.
    pub(crate) fn new(root: &str, table: &[Import], generated: Generated) -> Result<Self, String> {
        let source = read(root, generated).ok_or_else(|| missing(root))?;
        Self::of(root, &source, table, generated)
    }

    /// Links `source` with all of its imports.
    pub(crate) fn from_source(source: &str, table: &[Import], generated: Generated) -> Result<Self, String> {
        Self::of("(source)", source, table, generated)
    }

    fn of(root: &str, source: &str, table: &[Import], generated: Generated) -> Result<Self, String> {
        let mut linked = Self { code: String::new(), resolved: Vec::new(), lines: Vec::new() };
        let mut queue = vec![(root.to_owned(), source.to_owned())];
        let mut seen = HashSet::from([root.to_owned()]);
        while let Some((file, source)) = queue.pop() {
            for (number, line) in source.lines().enumerate() {
                match line.strip_prefix("#import ") {
                    Some(import) if seen.insert(import.to_owned()) => {
                        let resolved = table.iter().find(|(name, _)| *name == import);
                        linked.resolved.extend(resolved);
                        let import = resolved.map_or(import, |(_, file)| *file);
                        if resolved.is_some() && !seen.insert(import.to_owned()) {
                            continue;
                        }
                        let source = read(import, generated).ok_or_else(|| format!("{file}: {}", missing(import)))?;
                        queue.push((import.to_owned(), source));
                    }
                    Some(_) => {}
                    None => {
                        linked.code += line;
                        linked.code.push('\n');
                        linked.lines.push((file.clone(), number + 1));
                    }
                }
            }
        }
        Ok(linked)
    }

    /// File and line of origin of line `number` of the linked source, from 1.
    pub fn origin(&self, number: usize) -> String {
        let (file, line) = &self.lines[number - 1];
        match std::env::var_os(FOLDER) {
            Some(folder) => format!("{}:{line}", Path::new(&folder).join(format!("{file}.wgsl")).display()),
            None => format!("shaders/wgsl/{file}.wgsl:{line}"),
        }
    }

    /// Parses and validates the module; errors name the original file and line.
    pub fn parse(&self) -> Result<(wgpu::naga::Module, wgpu::naga::valid::ModuleInfo), String> {
        use wgpu::naga::{front::wgsl, valid};
        let module = wgsl::parse_str(&self.code).map_err(|error| {
            let line = error.location(&self.code).map_or(1, |at| at.line_number as usize);
            format!("{}: {}", self.origin(line), error.emit_to_string(&self.code))
        })?;
        // For pack2x16float, which every enabled backend supports.
        let capabilities = valid::Capabilities::default() | valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        let info =
            valid::Validator::new(valid::ValidationFlags::all(), capabilities).validate(&module).map_err(|error| {
                let line = error.location(&self.code).map_or(1, |at| at.line_number as usize);
                format!("{}: {}", self.origin(line), error.emit_to_string(&self.code))
            })?;
        Ok((module, info))
    }
}

/// Source of a WGSL file or of a generated module.
pub(crate) fn read(name: &str, generated: Generated) -> Option<String> {
    let file = || match std::env::var_os(FOLDER) {
        // Development of shaders: files are read at run time, without a rebuild.
        Some(folder) => std::fs::read_to_string(Path::new(&folder).join(format!("{name}.wgsl"))).ok(),
        None => SHADERS.iter().find(|(file, _)| *file == name).map(|(_, source)| (*source).to_owned()),
    };
    generated(name).or_else(file)
}

/// Environment variable with the folder that shaders are read from.
const FOLDER: &str = "NUBIS_SHADERS";

/// Error message for a file that [`read`] does not find.
fn missing(name: &str) -> String {
    match std::env::var_os(FOLDER) {
        Some(folder) => format!("{FOLDER} = {folder:?} has no file {name}.wgsl that can be read"),
        None => format!("no shader named {name:?}"),
    }
}

/// Names of all WGSL files.
pub fn names() -> impl Iterator<Item = &'static str> {
    SHADERS.iter().map(|(name, _)| *name)
}
