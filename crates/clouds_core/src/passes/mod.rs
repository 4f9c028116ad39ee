//! Passes of a picture. Each has a module here, which records its dispatches, and a WGSL file of the same name under
//! `passes/`.

pub mod clouds;
pub mod composite;
pub mod display;
pub mod march;
pub mod path;
pub mod points;
pub mod rays;
pub mod reference;
pub mod refine;
pub mod reproject;
