//! Errors of the crate, one variant for each exception class of the Python package.

/// Error with a message that names the field, the adapter or the shader.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// Invalid argument. Raised before any GPU work.
    #[error("{0}")]
    Parameter(String),
    /// No usable Vulkan adapter, or none that matches the request.
    #[error("{0}")]
    Adapter(String),
    /// Device lost, out of memory, or a request that the device refused.
    #[error("{0}")]
    Device(String),
    /// The process was forked after a device was opened: the threads of the driver do not exist in the child.
    #[error(
        "the GPU was in use before this process was forked, and a forked child cannot use it: start \
         workers with multiprocessing.get_context(\"spawn\"), or make the first Renderer in the worker"
    )]
    Fork,
    /// The caller's interrupt check stopped the work (Ctrl-C in Python).
    #[error("interrupted")]
    Interrupted,
    /// A file cannot be written or read.
    #[error("{0}")]
    File(String),
}

/// Result of the fallible functions of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// Parameter error in the common form: field, value, allowed values.
    pub fn parameter(field: &str, value: impl std::fmt::Display, allowed: impl std::fmt::Display) -> Self {
        Self::Parameter(format!("{field} = {value} is not allowed: it must be {allowed}"))
    }
}
