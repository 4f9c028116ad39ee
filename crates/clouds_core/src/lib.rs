//! Volumetric clouds by ray marching on Vulkan compute.
//!
//! [`Params`] describes a sky, [`Quality`] the numerical method. [`Renderer`] renders a [`Shot`]: camera, parameters
//! and time. `ARCHITECTURE.md` follows a frame through the files.

mod blue_noise;
pub mod camera;
mod chart;
mod clipmap;
pub mod color;
mod directions;
pub mod error;
mod field;
pub mod files;
pub mod frame;
pub mod generate;
pub mod gpu;
mod grid;
mod history;
mod lights;
mod luts;
mod mie;
mod moon;
pub mod params;
mod passes;
pub mod picture;
mod plan;
mod published;
mod quality;
mod query;
pub mod renderer;
mod scattering;
pub mod scene_depth;
pub mod schema;
pub mod shader;
mod shared;
pub mod shot;
mod specialization;
mod targets;
pub mod uniforms;
pub mod volume;
pub mod wind;

pub use camera::Camera;
pub use error::{Error, Result};
pub use gpu::{AdapterInfo, Gpu, adapters, disk_cache as cache};
pub use luts::light_solver::Cells;
pub use params::{Params, Quality};
pub use passes::display::Screen;
pub use renderer::Renderer;
pub use shot::Shot;
pub use volume::DensityGrid;
pub use wgpu;
