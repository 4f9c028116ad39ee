//! Module dependencies: imports have no cycle, and the device layer imports nothing above it.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Imports of each module.
type Graph = BTreeMap<String, BTreeSet<String>>;

/// Source of each module without its tests: `luts::sky` from `luts/sky.rs`, `luts` from `luts/mod.rs`.
fn modules(folder: &Path, parent: &str, found: &mut BTreeMap<String, String>) {
    for entry in fs::read_dir(folder).expect("is a folder").map(|entry| entry.expect("can be read").path()) {
        let stem = entry.file_stem().expect("has a name").to_string_lossy().into_owned();
        let name = if parent.is_empty() { stem.clone() } else { format!("{parent}::{stem}") };
        if entry.is_dir() {
            modules(&entry, &name, found);
        } else if stem != "lib" {
            let text = fs::read_to_string(&entry).expect("can be read");
            let code = text.split("#[cfg(test)]").next().unwrap_or_default().to_owned();
            found.insert(if stem == "mod" { parent.to_owned() } else { name }, code);
        }
    }
}

/// Expands the braces of a `use` path: `a::{b, c::d}` is `a::b` and `a::c::d`.
fn flattened(path: &str) -> Vec<String> {
    let Some((head, rest)) = path.split_once('{') else { return vec![path.to_owned()] };
    let inner = rest.rsplit_once('}').map_or(rest, |(inner, _)| inner);
    let (mut depth, mut parts) = (0, vec![String::new()]);
    for letter in inner.chars() {
        match letter {
            ',' if depth == 0 => parts.push(String::new()),
            _ => {
                depth += i32::from(letter == '{') - i32::from(letter == '}');
                parts.last_mut().expect("has one").push(letter);
            }
        }
    }
    parts.iter().filter(|part| !part.is_empty()).flat_map(|part| flattened(&format!("{head}{part}"))).collect()
}

/// Modules named by the `use` lines of a module and by its paths through `crate`.
fn imports(name: &str, code: &str, all: &BTreeMap<String, String>) -> BTreeSet<String> {
    let code: String = code.lines().map(|line| line.split("//").next().unwrap_or_default().to_owned() + "\n").collect();
    let mut paths = Vec::new();
    for part in code.split("use ").skip(1) {
        let path: String = part.split(';').next().unwrap_or_default().split_whitespace().collect();
        paths.extend(flattened(&path));
    }
    let is_part_of_path = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == ':';
    let through_crate = code.match_indices("crate::").map(|(at, _)| &code[at..]);
    paths.extend(
        through_crate.map(|rest| rest.split(|letter| !is_part_of_path(letter)).next().unwrap_or("").to_owned()),
    );
    let parent = name.rsplit_once("::").map_or("", |(parent, _)| parent);
    let absolute = paths.iter().filter_map(|path| match path.split_once("::") {
        Some(("crate", rest)) => Some(rest.to_owned()),
        Some(("super", rest)) if parent.is_empty() => Some(rest.to_owned()),
        Some(("super", rest)) => Some(format!("{parent}::{rest}")),
        // Child modules.
        Some((first, _)) => Some(format!("{name}::{first}")),
        None => None,
    });
    let module = |path: String| {
        let mut path = path.as_str();
        loop {
            if all.contains_key(path) {
                return Some(path.to_owned());
            }
            path = path.rsplit_once("::")?.0;
        }
    };
    absolute.filter_map(module).filter(|found| found != name).collect()
}

fn graph() -> Graph {
    let mut all = BTreeMap::new();
    modules(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut all);
    all.iter().map(|(name, code)| (name.clone(), imports(name, code, &all))).collect()
}

/// Modules in import cycles, and modules that import them: the rest after repeated removal of modules without remaining
/// imports.
fn cycle(mut graph: Graph) -> Graph {
    loop {
        let left: BTreeSet<_> = graph.keys().cloned().collect();
        let before = graph.len();
        graph.retain(|_, imports| imports.iter().any(|import| left.contains(import)));
        if graph.len() == before {
            return graph;
        }
    }
}

#[test]
fn the_modules_import_one_another_without_a_cycle() {
    let graph = graph();
    assert!(graph["renderer"].contains("luts") && graph["luts::sky"].contains("luts::lut"), "{graph:#?}");
    let cycle = cycle(graph);
    assert!(cycle.is_empty(), "a cycle is among these: {cycle:#?}");
}

#[test]
fn the_device_layer_knows_no_pass_no_frame_and_no_cloud() {
    for (name, imports) in graph().into_iter().filter(|(name, _)| name.starts_with("gpu")) {
        let above: Vec<_> = imports
            .into_iter()
            .filter(|import| !import.starts_with("gpu") && !["error", "shared"].contains(&import.as_str()))
            .collect();
        assert!(above.is_empty(), "{name} imports {above:?}");
    }
}

#[test]
fn a_cycle_is_found() {
    let of = |imports: &[&str]| imports.iter().map(|name| (*name).to_owned()).collect();
    let graph = Graph::from([
        ("a".to_owned(), of(&["b"])),
        ("b".to_owned(), of(&["c"])),
        ("c".to_owned(), of(&["b"])),
        ("d".to_owned(), of(&[])),
    ]);
    assert_eq!(cycle(graph).into_keys().collect::<Vec<_>>(), ["a", "b", "c"]);
    assert_eq!(flattened("crate::a::{b,c::{d,e}}"), ["crate::a::b", "crate::a::c::d", "crate::a::c::e"]);
}
