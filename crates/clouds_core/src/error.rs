//! Every way in which a call can fail, one variant for each exception class of the Python package.

/// What went wrong, in words that name the field, the adapter or the shader.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Error {
    /// An argument is not allowed. Raised before any GPU work.
    #[error("{0}")]
    Parameter(String),
    /// No usable Vulkan adapter, or not the one that was asked for.
    #[error("{0}")]
    Adapter(String),
    /// The device is lost, out of memory, or refused what we asked of it.
    #[error("{0}")]
    Device(String),
    /// The process was forked after a device existed: its threads are not in the child.
    #[error(
        "the GPU was in use before this process was forked, and a forked child cannot use it: start \
         workers with multiprocessing.get_context(\"spawn\"), or make the first Renderer in the worker"
    )]
    Fork,
    /// The caller's interrupt check asked to stop (Ctrl-C in Python).
    #[error("interrupted")]
    Interrupted,
    /// A file could not be written or read.
    #[error("{0}")]
    File(String),
}

/// The result of every fallible call of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// A parameter error in the one form that all of them have: field, value, what is allowed.
    pub fn parameter(field: &str, value: impl std::fmt::Display, allowed: impl std::fmt::Display) -> Self {
        Self::Parameter(format!("{field} = {value} is not allowed: it must be {allowed}"))
    }
}
