//! Shaders that are worked on: read anew when a file of theirs is saved.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// How often the files are looked at.
pub const EVERY: Duration = Duration::from_millis(500);

/// The folder of the shaders (`NUBIS_SHADERS`), and when a file in it was last saved.
pub struct Watch {
    folder: PathBuf,
    saved: Option<SystemTime>,
    looked: Instant,
}

impl Watch {
    /// Where shaders are read from a folder.
    pub fn new(folder: Option<OsString>) -> Option<Self> {
        let folder = PathBuf::from(folder?);
        Some(Self { saved: last_saved(&folder), folder, looked: Instant::now() })
    }

    /// Whether a file has been saved since it was asked last.
    pub fn has_changed(&mut self) -> bool {
        if self.looked.elapsed() < EVERY {
            return false;
        }
        self.looked = Instant::now();
        let before = std::mem::replace(&mut self.saved, last_saved(&self.folder));
        self.saved != before
    }
}

fn last_saved(folder: &Path) -> Option<SystemTime> {
    let files = [folder.to_path_buf(), folder.join("passes")].into_iter().filter_map(|folder| folder.read_dir().ok());
    files.flatten().filter_map(|file| file.ok()?.metadata().ok()?.modified().ok()).max()
}
