//! Specialization tables: values of the `override` constants, by name, and the light model that kernels are compiled
//! with.

use std::sync::Arc;

use crate::frame::Frame;
use crate::gpu::{Import, Specialization};
use crate::params::{Field, Model, Params, Quality, WeatherNoise};

/// Table of a picture. `layers`: background radiance and depth are outputs too.
pub(crate) fn of_picture(params: &Params, quality: &Quality, frame: &Frame, layers: bool) -> Arc<Specialization> {
    let high = frame.high_clouds;
    let on = |on: bool| f64::from(u8::from(on));
    of_sky(params, quality).with(&[
        ("SUNLIT", on(frame.sunlit(params))),
        ("CAMERA", f64::from(frame.projection as u32)),
        ("LIGHT_SHAFTS", on(frame.light_shafts)),
        ("SCENE", on(frame.scene)),
        ("SUBRAYS", on(params.volume.is_none() && frame.has_subrays())),
        ("LOW_RESOLUTION", on(frame.grid.low_resolution)),
        ("STRIDE", f64::from(frame.grid.stride())),
        ("HIGH", on(high)),
        ("HIGH_EMBOSS", on(high && frame.high_emboss)),
        ("HIGH_LOW_SUN", on(high && frame.high_low_sun)),
        ("CLOUDLESS", on(frame.cloudless)),
        ("GROUND_SHADOW", on(frame.ground_shadow)),
        ("LAYERS", on(layers)),
        ("WIDE", on(frame.view.sky_samples > 1)),
    ])
}

/// Table of queries of a sky without a picture.
pub(crate) fn of_points(params: &Params, quality: &Quality) -> Arc<Specialization> {
    Arc::new(of_sky(params, quality))
}

/// Table of bakes that are independent of the picture.
pub(crate) fn of_bakes() -> Arc<Specialization> {
    of_points(&Params::default(), &Quality::default())
}

/// File of a light model, by the name that light.wgsl imports. The path tracer shades the high clouds, which have no
/// thickness, by octaves.
pub(crate) fn light_model(model: Model) -> Import {
    let file = match model {
        Model::Single => "light_models/single",
        Model::Multiple => "light_models/multiple",
        Model::Octaves | Model::Path => "light_models/octaves",
        Model::Nubis2015 => "light_models/nubis2015",
        Model::Thesis2018 => "light_models/thesis2018",
        Model::Vsu2022 => "light_models/vsu2022",
    };
    ("light_model", file)
}

/// File of a field of cloud density, by the name that density.wgsl imports.
pub(crate) fn cloud_field(field: Field) -> Import {
    let file = match field {
        Field::Eroded => "fields/eroded",
        Field::Heaped => "fields/heaped",
    };
    ("cloud_field", file)
}

fn of_sky(params: &Params, quality: &Quality) -> Specialization {
    let on = |on: bool| f64::from(u8::from(on));
    let light = &params.light;
    let volume = params.volume.is_some();
    let cheap = quality.light_detail_cutoff < 1.0 || quality.far_sample || quality.light_distance <= 0.0;
    Specialization::new(
        [
            ("PHASE", f64::from(light.phase as u32)),
            ("VOLUME", on(volume)),
            ("PRECISE", on(quality.is_precise(params))),
            ("KEEP_CLEAR", on(params.clear_spot().1 > 0.0 && !volume)),
            ("AIR", on(params.atmosphere.enabled)),
            ("SUNLIT", 1.0),
            ("RAINY", on(params.is_rainy())),
            ("RAIN_SHAFTS", on(params.has_rain_shafts())),
            ("UPPER", on(params.has_upper_clouds())),
            ("LARGE_SCALE_WEATHER", on(params.has_large_scale_weather())),
            ("PROFILE_TABLE", on(params.clouds.profile.is_some() && !volume)),
            ("LIGHT_DETAIL", on(quality.light_detail_cutoff > 0.0)),
            ("LIGHT_CHEAP", on(cheap)),
            ("WEATHER_NOISE", f64::from(WeatherNoise::WorleyPerlin as u32)),
            ("HIGH_LOW_SUN", 0.0),
        ],
        vec![light_model(light.model), cloud_field(params.clouds.field)],
    )
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::shader;

    /// A name in the table alone would have no effect, and an override in the shaders alone would never be set.
    #[test]
    fn the_table_and_the_shaders_name_the_same_constants() {
        let frame = Frame::default();
        let table = of_picture(&Params::default(), &Quality::default(), &frame, false).with(&[("DISCS", 1.0)]);
        let ours: BTreeSet<_> = table.names().map(str::to_owned).collect();
        let mut theirs = BTreeSet::new();
        for name in shader::names() {
            let (module, _) = shader::link(name).expect("links").parse().expect("is valid");
            // Overrides derived from other overrides are not set by the table.
            let is_settable = |constant: &wgpu::naga::Override| {
                constant
                    .init
                    .is_none_or(|init| matches!(module.global_expressions[init], wgpu::naga::Expression::Literal(_)))
            };
            theirs.extend(module.overrides.iter().filter(|(_, o)| is_settable(o)).filter_map(|(_, o)| o.name.clone()));
        }
        assert_eq!(ours, theirs);
    }
}
