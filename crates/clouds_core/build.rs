//! Embeds every file of `shaders/wgsl`, so that the renderer needs no files at run time.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    let root = Path::new(&env::var("CARGO_MANIFEST_DIR").expect("cargo sets it")).join("../../shaders/wgsl");
    let root = root.canonicalize().expect("shaders/wgsl lies two folders above the crate");
    println!("cargo::rerun-if-changed={}", root.display());
    let mut files: Vec<PathBuf> = Vec::new();
    for folder in [root.clone(), root.join("passes"), root.join("light_models"), root.join("fields")] {
        println!("cargo::rerun-if-changed={}", folder.display());
        for entry in fs::read_dir(folder).expect("the shaders can be listed") {
            files.push(entry.expect("the shaders can be listed").path());
        }
    }
    files.retain(|file| file.extension().is_some_and(|extension| extension == "wgsl"));
    files.sort();
    let mut code = String::from("static SHADERS: &[(&str, &str)] = &[\n");
    for file in files {
        println!("cargo::rerun-if-changed={}", file.display());
        let name = file.strip_prefix(&root).expect("found under it").with_extension("");
        let _ = writeln!(code, "    ({:?}, include_str!({:?})),", name.display().to_string(), file);
    }
    code += "];\n";
    let out = Path::new(&env::var("OUT_DIR").expect("cargo sets it")).join("shaders.rs");
    fs::write(out, code).expect("OUT_DIR can be written");
}
