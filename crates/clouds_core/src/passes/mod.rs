//! What makes a picture, one module for each pass with the WGSL file of the same name. Each records itself.

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
