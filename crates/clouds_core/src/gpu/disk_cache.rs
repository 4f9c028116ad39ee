//! Disk cache shared by processes: baked LUTs and compiled pipelines.
//!
//! The cache never fails a render. A file that is missing, incomplete, damaged or made from other inputs counts as a
//! miss, and its content is computed again; so does a folder that cannot be written.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::SystemTime;

use super::adapter::{AdapterInfo, lock};
use crate::error::{Error, Result};

/// First bytes of every file: program, version and format. Files with other first bytes are ignored.
const MAGIC: &str = concat!("nubis ", env!("CARGO_PKG_VERSION"), ", format 1\n");
/// Maximum number of files of a kind, 6 MB each for noise; the least recently used is deleted first. It also limits the
/// number of files that a process stores: a data set of thousands of seeds does not write all of them.
const MAX_FILES: usize = 8;
/// Size of pipeline data in bytes from which on it is discarded: it grows with each change of the shaders and is never
/// pruned.
const MAX_PIPELINE_BYTES: usize = 64 << 20;

/// Prefix of all file names. Only files with this prefix are touched: the folder may be the user's own and hold other
/// files.
const PREFIX: &str = "nubis-cache-";

/// Folder of the cache: `NUBIS_CACHE`, or `nubis` in the user's cache folder. None if `NUBIS_CACHE` is empty, `0` or
/// `off`, or if the user has no cache folder.
pub fn folder() -> Option<PathBuf> {
    match std::env::var_os("NUBIS_CACHE") {
        Some(off) if off.is_empty() || off == "0" || off.eq_ignore_ascii_case("off") => None,
        Some(folder) => Some(folder.into()),
        None => Some(dirs::cache_dir()?.join("nubis")),
    }
}

/// Size on disk in bytes.
pub fn size() -> u64 {
    let Some(folder) = folder() else { return 0 };
    files(&folder, PREFIX).iter().map(|file| file.bytes).sum()
}

/// Deletes all files of the cache, and its folder if that is empty then.
///
/// Returns [`Error::File`] if a file cannot be deleted.
pub fn clear() -> Result<()> {
    let Some(folder) = folder() else { return Ok(()) };
    for file in files(&folder, PREFIX) {
        match fs::remove_file(&file.path) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
                let named = if std::env::var_os("NUBIS_CACHE").is_some() { "NUBIS_CACHE: " } else { "" };
                return Err(Error::File(format!("{named}{}: {error}", file.path.display())));
            }
            _ => {}
        }
    }
    // Fails if the folder holds other files or does not exist.
    let _ = fs::remove_dir(&folder);
    Ok(())
}

/// Content of a kind stored for `key`. The key is everything that the content depends on, except for the version of
/// this crate.
pub(crate) fn load(kind: &str, key: &str) -> Option<Vec<u8>> {
    let file = File::open(path(&folder()?, kind, key)).ok()?;
    let bytes = read(&file, key)?;
    // Marks the file as recently used.
    let _ = file.set_modified(SystemTime::now());
    Some(bytes)
}

/// Stores content, given in parts, for `key`. Failures are ignored.
pub(crate) fn store(kind: &str, key: &str, parts: &[&[u8]]) {
    static STORED: AtomicUsize = AtomicUsize::new(0);
    if let Some(folder) = folder()
        && STORED.fetch_add(1, Ordering::Relaxed) < MAX_FILES
        && write(&folder, kind, key, parts).is_ok()
    {
        let mut files = files(&folder, &format!("{PREFIX}{kind}-"));
        files.sort_by_key(|file| std::cmp::Reverse(file.used));
        for file in files.iter().skip(MAX_FILES) {
            let _ = fs::remove_file(&file.path);
        }
    }
}

fn path(folder: &Path, kind: &str, key: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{kind}-{:08x}", crc32fast::hash(key.as_bytes())))
}

/// Writes a file atomically: another process that reads or writes it meanwhile sees the old file or the new one.
fn write(folder: &Path, kind: &str, key: &str, parts: &[&[u8]]) -> std::io::Result<()> {
    fs::create_dir_all(folder)?;
    let mut file = tempfile::Builder::new().prefix(&format!("{PREFIX}{kind}-")).suffix(".tmp").tempfile_in(folder)?;
    file.write_all(&header(key, parts))?;
    for part in parts {
        file.write_all(part)?;
    }
    file.persist(path(folder, kind, key))?;
    Ok(())
}

/// Content of a file, if it is complete and has this key.
fn read(mut file: &File, key: &str) -> Option<Vec<u8>> {
    let mut head = vec![0; header(key, &[]).len()];
    file.read_exact(&mut head).ok()?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).ok()?;
    (head == header(key, &[&bytes])).then_some(bytes)
}

/// Header: first bytes, lengths, checksum, and the full key, as file names are hashes that can collide.
fn header(key: &str, parts: &[&[u8]]) -> Vec<u8> {
    let mut checksum = crc32fast::Hasher::new();
    let mut length = 0;
    for part in parts {
        checksum.update(part);
        length += part.len();
    }
    let numbers = [key.len() as u64, length as u64, u64::from(checksum.finalize())];
    [MAGIC.as_bytes(), numbers.map(u64::to_le_bytes).as_flattened(), key.as_bytes()].concat()
}

/// Pipeline cache of the driver, loaded from disk, on adapters that support it.
pub(crate) struct Pipelines {
    key: String,
    cache: Option<wgpu::PipelineCache>,
    /// Data on disk.
    stored: Mutex<Option<Vec<u8>>>,
    /// Whether a pipeline has been created since the data was written.
    grown: AtomicBool,
}

impl Pipelines {
    pub fn new(device: &wgpu::Device, adapter: &wgpu::Adapter, info: &AdapterInfo) -> Self {
        let same = wgpu::util::pipeline_cache_key(&adapter.get_info()).unwrap_or_default();
        let key = format!("{same} {} {}", info.name, info.driver);
        let supported = device.features().contains(wgpu::Features::PIPELINE_CACHE) && folder().is_some();
        let stored = load("pipelines", &key).filter(|stored| supported && stored.len() < MAX_PIPELINE_BYTES);
        let descriptor =
            wgpu::PipelineCacheDescriptor { label: Some("pipelines"), data: stored.as_deref(), fallback: true };
        // SAFETY: the checksum shows that the data is the output of a pipeline cache; wgpu and the driver check that it
        // is one of theirs. Write access to the user's cache folder gives more power than pipelines do.
        let cache = supported.then(|| unsafe { device.create_pipeline_cache(&descriptor) });
        Self { key, cache, stored: Mutex::new(stored), grown: AtomicBool::new(false) }
    }

    /// Pipeline cache for the creation of a pipeline.
    pub fn cache(&self) -> Option<&wgpu::PipelineCache> {
        self.grown.store(true, Ordering::Relaxed);
        self.cache.as_ref()
    }

    /// Stores the pipelines compiled since the last call.
    pub fn store(&self) {
        if !self.grown.swap(false, Ordering::Relaxed) {
            return;
        }
        let Some(data) = self.cache.as_ref().and_then(wgpu::PipelineCache::get_data) else { return };
        let mut stored = lock(&self.stored);
        // Equal on drivers with a pipeline cache of their own, such as lavapipe, whose data is only a header.
        if stored.as_ref() != Some(&data) {
            store("pipelines", &self.key, &[&data]);
            *stored = Some(data);
        }
    }
}

struct CacheFile {
    path: PathBuf,
    bytes: u64,
    used: SystemTime,
}

/// Files with a prefix, including temporary files of running and of dead processes.
fn files(folder: &Path, prefix: &str) -> Vec<CacheFile> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let ours = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix));
    ours.filter_map(|entry| {
        let metadata = entry.metadata().ok()?;
        Some(CacheFile { path: entry.path(), bytes: metadata.len(), used: metadata.modified().ok()? })
    })
    .collect()
}
