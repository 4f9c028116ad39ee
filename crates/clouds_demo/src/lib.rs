//! Fly through the sky: a window on the clouds of `clouds_core`, on the same device.
//!
//! [`app`] is the window, top to bottom. [`painter`] makes its pictures on a thread of its own.

pub mod app;
pub mod flight;
pub mod help;
pub mod painter;
pub mod panel;
pub mod preset;
pub mod resolution;
pub mod sight;
pub mod sun;
pub mod watch;
pub mod weather;
