//! Published settings of the sources, for comparison (docs/sources.md).

use crate::params::Quality;

/// Settings of a source by name.
pub(crate) fn quality(name: &str) -> Option<Quality> {
    // Equal steps, and light samples near by.
    let published = Quality {
        steps_zenith: 64,
        steps_horizon: 128,
        step_growth: 0.0,
        coarse_step: 1,
        sphere_tracing: 0.0,
        light_steps: 5,
        light_group_weight: 0.0,
        light_distance: 700.0,
        far_sample: true,
        cone: 0.12,
        light_detail_cutoff: 0.3,
        adaptive_threshold: 0.0,
        ..Quality::default()
    };
    match name {
        // "A sample and five more in a cone"; the sixth is the far one.
        "nubis2015" => Some(published),
        // Options A to D of the text: coarse steps of three, ten empty samples, light samples with full detail.
        "thesis2018" => {
            Some(Quality { coarse_step: 3, empty_before_coarse: 10, light_detail_cutoff: 1.0, ..published })
        }
        "vsu2022" => Some(Quality {
            steps_zenith: 250,
            steps_horizon: 250,
            light_steps: 64,
            light_distance: 2000.0,
            far_sample: false,
            light_detail_cutoff: 1.0,
            ..published
        }),
        _ => None,
    }
}
