//! Device layer: adapters, devices, kernels, recordings and the disk cache. It does not depend on passes, frames or
//! clouds.

mod adapter;
mod device;
pub mod disk_cache;
mod kernel;
mod link;
mod recorder;

pub(crate) use device::{COPIED, Download, constants as device_constants, texture_bytes, texture_rows};
pub(crate) use kernel::{Binding, Bindings, Name, Program, Specialization};
pub(crate) use link::{Import, read};
pub(crate) use recorder::{List, Recorder, Token, Which, constants as recorder_constants};

pub use adapter::{AdapterInfo, adapters, check_fork, driver_settings, lock};
pub use device::{Gpu, Interrupt, Timings};
pub use kernel::Kernel;
pub use link::{Linked, names};
