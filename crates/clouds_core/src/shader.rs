//! Shaders of the crate: WGSL files, and modules generated from Rust declarations, which keeps both languages in step.

use std::fmt::Write as _;
use std::sync::Arc;

use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::luts::{large_scale_weather, light_solver, majorant, multiscatter, noise, shadow, sky, weather};
use crate::params::{self, Field, Model, Params, Quality};
use crate::schema::{Block, wgsl_struct};
use crate::uniforms::{Dispatch, FieldLevel, Sky, View};
use crate::{blue_noise, camera, chart, color, frame, gpu, grid, moon, scattering, scene_depth, specialization};

pub use crate::gpu::{Linked, names};

impl Gpu {
    /// Device of an adapter, opened on first use. `wanted` is an index, a kind, or a part of its name, driver or PCI
    /// address; None selects the best adapter.
    ///
    /// Returns [`Error::Adapter`] if no adapter matches, and [`Error::Fork`] in a forked child.
    pub fn open(wanted: Option<&str>) -> Result<Arc<Self>> {
        Self::open_with(wanted, generated)
    }

    /// Drops all compiled kernels, so that the shaders are read again (`NUBIS_SHADERS`).
    ///
    /// Returns [`Error::File`] with file and line of an invalid shader, and keeps the compiled kernels.
    pub fn reload_shaders(&self) -> Result<()> {
        for name in names() {
            link(name).and_then(|linked| linked.parse().map(drop)).map_err(Error::File)?;
        }
        self.forget_kernels();
        Ok(())
    }
}

/// Source of a WGSL file or of a generated module.
pub fn read(name: &str) -> Option<String> {
    gpu::read(name, generated)
}

/// Links a WGSL file with all of its imports. The file of a light model, or of a field, is linked as that.
pub fn link(name: &str) -> std::result::Result<Linked, String> {
    let own = |folder| names().find(|known| *known == name && known.starts_with(folder));
    let [model, field] = default_imports();
    let model = own("light_models/").map_or(model, |file| ("light_model", file));
    let field = own("fields/").map_or(field, |file| ("cloud_field", file));
    Linked::new(name, &[model, field], generated)
}

fn default_imports() -> [gpu::Import; 2] {
    [specialization::light_model(Model::Octaves), specialization::cloud_field(Field::Eroded)]
}

/// Links WGSL source with all of its imports.
pub fn link_source(source: &str) -> std::result::Result<Linked, String> {
    Linked::from_source(source, &default_imports(), generated)
}

/// Source of a generated module.
fn generated(name: &str) -> Option<String> {
    match name {
        "params" => Some(params_source()),
        "uniforms" => {
            let parts: [&dyn Block; 4] =
                [&View::default(), &Sky::default(), &Dispatch::default(), &FieldLevel::default()];
            let frame = "struct Frame {\n    @align(16) view: View,\n    @align(16) sky: Sky,\n}\n";
            Some(parts.map(wgsl_struct).concat() + frame)
        }
        "constants" => Some(constants_source()),
        _ => None,
    }
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

/// WGSL module `constants`. Shaders that read a constant of a module that is not listed here do not compile.
fn constants_source() -> String {
    let modules = [
        blue_noise::constants,
        large_scale_weather::constants,
        camera::constants,
        color::constants,
        chart::constants,
        frame::constants,
        grid::constants,
        light_solver::constants,
        gpu::device_constants,
        majorant::constants,
        moon::constants,
        multiscatter::constants,
        noise::constants,
        params::constants,
        gpu::recorder_constants,
        scattering::constants,
        scene_depth::constants,
        shadow::constants,
        sky::constants,
        weather::constants,
    ];
    modules.map(|constants| constants()).concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wgsl_has_the_values_of_rust() {
        let code = constants_source();
        for line in [
            "const AIR_TOP: f32 = 100000.0;",
            "const MOON_RADIUS: f32 = 0.00452;",
            "const NO_SCENE: f32 = 1e30;",
            "const BRICK: u32 = 4u;",
            "const LUMINANCE: vec3f = vec3f(0.2126, 0.7152, 0.0722);",
        ] {
            assert!(code.contains(line), "{line}\n{code}");
        }
    }
}
