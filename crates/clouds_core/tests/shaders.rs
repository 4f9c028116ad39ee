//! Validity of every shader, and agreement with the Rust declarations; without a GPU.

use std::collections::BTreeSet;

use clouds_core::params::{self, Params, Quality};
use clouds_core::schema::{Block, size, wgsl_name};
use clouds_core::shader::{self, Linked};
use clouds_core::uniforms::{Dispatch, Sky, View};
use wgpu::naga::{self, TypeInner};

fn linked(name: &str) -> (Linked, naga::Module) {
    let linked = shader::link(name).expect("links");
    let (module, _) = linked.parse().unwrap_or_else(|error| panic!("{error}"));
    (linked, module)
}

#[test]
fn every_shader_is_valid() {
    for name in shader::names() {
        linked(name);
    }
}

#[test]
fn every_shader_opens_with_a_sentence() {
    for name in shader::names() {
        let source = shader::read(name).expect("listed");
        assert!(source.starts_with("// "), "shaders/wgsl/{name}.wgsl must open with what it computes");
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// Words of WGSL source without comments.
fn words(source: &str) -> impl Iterator<Item = &str> {
    let code = source.lines().filter_map(|line| line.split("//").next());
    code.flat_map(|code| code.split(|c| !is_word(c))).filter(|word| !word.is_empty())
}

/// Constants that WGSL declares, also inside functions.
fn declared(source: &str) -> BTreeSet<&str> {
    words(source).zip(words(source).skip(1)).filter(|(before, _)| *before == "const").map(|(_, name)| name).collect()
}

#[test]
fn no_shader_declares_a_constant_of_rust_again() {
    let generated = shader::read("constants").expect("is generated");
    let shared = declared(&generated);
    assert!(shared.contains("AIR_TOP") && shared.len() == generated.lines().count(), "{generated}");
    for name in shader::names() {
        let source = shader::read(name).expect("listed");
        let again: Vec<_> = declared(&source).intersection(&shared).copied().collect();
        assert!(again.is_empty(), "shaders/wgsl/{name}.wgsl declares {again:?}, which Rust does");
    }
}

/// A constant that Rust alone reads must not be shared.
#[test]
fn shaders_read_each_constant_of_rust() {
    let generated = shader::read("constants").expect("is generated");
    let sources: Vec<_> = shader::names().map(|name| shader::read(name).expect("listed")).collect();
    let read: BTreeSet<_> = sources.iter().flat_map(|source| words(source)).collect();
    let unread: Vec<_> = declared(&generated).difference(&read).copied().collect();
    assert!(unread.is_empty(), "{unread:?}");
}

#[test]
fn errors_name_the_file_and_line() {
    let source = "#import math\nfn broken() -> f32 {\n    return missing;\n}\n";
    let error = shader::link_source(source).expect("links").parse().expect_err("is invalid");
    assert!(error.contains("(source).wgsl:3"), "{error}");
}

/// naga's layout of a struct: name, offset and size of its members, and its span, in bytes.
fn naga_struct(module: &naga::Module, name: &str) -> (Vec<(String, u32, u32)>, u32) {
    let mut layouter = naga::proc::Layouter::default();
    layouter.update(module.to_ctx()).expect("has a layout");
    let (_, ty) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name)).expect("is declared");
    let TypeInner::Struct { members, span } = &ty.inner else { panic!("{name} is no struct") };
    let members = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset, layouter[m.ty].size)).collect();
    (members, *span)
}

fn check_block(module: &naga::Module, block: &dyn Block) {
    let (members, _) = naga_struct(module, block.type_name());
    let ours: Vec<_> = block
        .fields()
        .iter()
        .filter(|field| field.ty.words() > 0)
        .map(|field| (wgsl_name(field.name).to_owned(), field.offset as u32, 4 * field.ty.words() as u32))
        .collect();
    assert_eq!(members, ours, "{}", block.type_name());
}

#[test]
fn naga_lays_out_the_uniforms_as_we_do() {
    let (_, module) = linked("bindings");
    let (params, quality) = (Params::default(), Quality::default());
    let (blocks, bytes) = params::uniform_layout();
    let (members, span) = naga_struct(&module, "Params");
    let ours: Vec<_> = blocks.iter().map(|(name, _, offset)| ((*name).to_owned(), *offset as u32)).collect();
    let theirs: Vec<_> = members.into_iter().map(|(name, offset, _)| (name, offset)).collect();
    assert_eq!(theirs, ours);
    assert_eq!(span as usize, bytes);
    assert_eq!(params::uniform(&params, &quality).len() * 4, bytes);
    for (_, block) in params.blocks().into_iter().filter(|(_, block)| size(block.fields()) > 0) {
        check_block(&module, block);
    }
    let (view, sky, dispatch) = (View::default(), Sky::default(), Dispatch::default());
    for block in [&quality as &dyn Block, &view, &sky, &dispatch] {
        check_block(&module, block);
        assert!(naga_struct(&module, block.type_name()).1 as usize <= size(block.fields()));
    }
}

#[test]
fn generated_files_are_fresh() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for (path, content) in clouds_core::generate::files() {
        let on_disk = std::fs::read_to_string(root.join(path)).unwrap_or_default();
        assert!(on_disk == content, "{path} is stale: run `make generate`");
    }
}
