//! Shader hot reload: detects saved WGSL files.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Interval between two looks at the files.
pub const POLL_INTERVAL: Duration = Duration::from_millis(500);

/// Polling watch on the shader folder (`NUBIS_SHADERS`).
pub struct ShaderWatch {
    folder: PathBuf,
    /// Newest modification time in the folder.
    modified: Option<SystemTime>,
    last_poll: Instant,
}

impl ShaderWatch {
    /// Watch on a folder; `None` if the shaders are those built into the binary.
    pub fn new(folder: Option<OsString>) -> Option<Self> {
        let folder = PathBuf::from(folder?);
        Some(Self { modified: last_modified(&folder), folder, last_poll: Instant::now() })
    }

    /// Whether a file was saved since the previous poll; polls at most once per [`POLL_INTERVAL`].
    pub fn has_changed(&mut self) -> bool {
        if self.last_poll.elapsed() < POLL_INTERVAL {
            return false;
        }
        self.last_poll = Instant::now();
        let before = std::mem::replace(&mut self.modified, last_modified(&self.folder));
        self.modified != before
    }
}

fn last_modified(folder: &Path) -> Option<SystemTime> {
    let folders = [folder.to_path_buf(), folder.join("passes"), folder.join("light_models"), folder.join("fields")];
    let files = folders.into_iter().filter_map(|folder| folder.read_dir().ok());
    files.flatten().filter_map(|file| file.ok()?.metadata().ok()?.modified().ok()).max()
}
