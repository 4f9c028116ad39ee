//! Interactive demo of `clouds_core`: a window that shares its GPU device with the renderer.
//!
//! [`app`] is the window. [`render_thread`] renders its frames on a separate thread.

pub mod app;
pub mod debug_view;
pub mod flight;
pub mod help;
pub mod panel;
pub mod preset;
pub mod render_thread;
pub mod resolution;
pub mod shader_watch;
pub mod sun;
pub mod weather;
