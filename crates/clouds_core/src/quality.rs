//! Numerical methods by name, and the constraints between their settings.

use crate::error::{Error, Result};
use crate::params::{Integrator, Model, Params, Quality, check_block};
use crate::published;
use crate::schema::Typed as _;

impl Quality {
    /// Names of the numerical methods. The last three are the published settings of the sources.
    pub const NAMES: [&str; 8] =
        ["preview", "draft", "balanced", "high", "reference", "nubis2015", "thesis2018", "vsu2022"];

    /// The numerical method of that name.
    pub fn named(name: &str) -> Result<Self> {
        let balanced = Self::default();
        let draft = Self {
            steps_zenith: 80,
            steps_horizon: 192,
            coarse_step: 3,
            light_steps: 10,
            min_transmittance: 0.03,
            adaptive_threshold: 0.5,
            path_samples: 16,
            relief_samples: 2,
            ..balanced.clone()
        };
        Ok(match name {
            "balanced" => balanced,
            "draft" => draft,
            "preview" => {
                Self { steps_zenith: 54, steps_horizon: 128, light_steps: 8, adaptive_threshold: 1.0, ..draft }
            }
            "high" => Self {
                steps_zenith: 192,
                steps_horizon: 512,
                coarse_step: 3,
                light_steps: 48,
                light_group_weight: 0.01,
                min_transmittance: 0.002,
                adaptive_threshold: 0.0,
                path_samples: 256,
                field_cells: 128,
                field_cell: 50.0,
                relief_samples: 16,
                ..balanced
            },
            "reference" => Self {
                integrator: Integrator::Reference,
                path_samples: 1024,
                field_cells: 128,
                field_cell: 50.0,
                ..balanced
            },
            _ => {
                return published::quality(name).ok_or_else(|| {
                    Error::parameter("quality", format!("{name:?}"), format!("one of {:?}", Self::NAMES))
                });
            }
        })
    }

    /// Maximum number of loop iterations of a ray. lavapipe silently ends loops after 65,535 iterations, summed over
    /// a shader (docs/numerics.md). A limit of 40,000 leaves room for the third more light samples of an upper deck
    /// (light.wgsl).
    fn turns(&self) -> u32 {
        // Growing steps may be twice as many (passes/march.wgsl).
        let steps = self.steps_zenith.max(self.steps_horizon) * if self.step_growth > 0.0 { 2 } else { 1 };
        // What is lit as one has gathered more than its share; the rest of the ray is one more.
        let groups = (1.0 / self.light_group_weight + 1.0).min(steps as f32) as u32;
        2 * steps + groups * (1 + self.light_steps)
    }

    /// The integrator of a sky: the light model `path` is a deprecated alias of the integrator `path`.
    pub fn integrator_of(&self, params: &Params) -> Integrator {
        if params.light.model == Model::Path { Integrator::Path } else { self.integrator }
    }

    /// Checks that the integrator has the light model of a sky.
    pub(crate) fn check_model(&self, params: &Params) -> Result<()> {
        let model = params.light.model;
        if self.integrator != Integrator::Path || matches!(model, Model::Octaves | Model::Multiple | Model::Path) {
            return Ok(());
        }
        let allowed =
            "'multiple' or 'octaves' with quality.integrator = 'path', which traces every order of scattering";
        Err(Error::parameter("light.model", model.to_value(), allowed))
    }

    /// Whether a grid is read in f32 instead of by half-float hardware filtering.
    pub(crate) fn is_precise(&self, params: &Params) -> bool {
        self.integrator_of(params) != Integrator::March
    }

    /// Maximum number of rays through a pixel that is wider than clouds (subrays.wgsl): 16, the mean of which is off
    /// by a tenth of the difference between cloud and clear sky, or as many as lavapipe has iterations for, less
    /// those of a mean of the phase function.
    pub(crate) fn most_rays(&self) -> f32 {
        (48_000 / self.turns().max(1)).clamp(1, 16) as f32
    }

    /// Checks the range of every value, and the constraints between values.
    pub fn check(&self) -> Result<()> {
        check_block("quality", self)?;
        let turns = self.turns();
        if turns > 40_000 {
            return Err(Error::parameter(
                "quality.light_steps",
                self.light_steps,
                format!(
                    "so small that twice the view steps and the light samples of all groups, here {turns}, are at most 40000"
                ),
            ));
        }
        Ok(())
    }
}
