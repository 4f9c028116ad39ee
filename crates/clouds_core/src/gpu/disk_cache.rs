//! What one process leaves on disk for the next: baked noise and compiled pipelines.
//!
//! A file that is missing, torn, damaged or of other inputs is as good as none, and so is a folder that cannot be written:
//! what is in it is made again. So nothing here fails a render.

use std::fs::{self, File};
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::SystemTime;

use super::adapter::{AdapterInfo, lock};
use crate::error::{Error, Result};

/// How every file begins: whose it is. One that begins otherwise is not read.
const MAGIC: &str = concat!("nubis ", env!("CARGO_PKG_VERSION"), ", format 1\n");
/// Most files of a kind in the folder, 6 MB each where they are noise; the one that was used last longest ago goes first.
/// A process stores no more either, so that a data set of thousands of seeds does not write all of them.
const KEPT: usize = 8;
/// Bytes of pipelines from which on none are loaded: they grow with each change of the shaders, and are never pruned.
const MOST_PIPELINES: usize = 64 << 20;

/// How the names of all files begin. What is done to files is done to these alone: the user may have named a folder with
/// others in it.
const PREFIX: &str = "nubis-cache-";

/// The folder: what `NUBIS_CACHE` names, else `nubis` in the user's cache folder. None where `NUBIS_CACHE` is empty, `0`
/// or `off`, or there is no such folder.
pub fn folder() -> Option<PathBuf> {
    match std::env::var_os("NUBIS_CACHE") {
        Some(off) if off.is_empty() || off == "0" || off.eq_ignore_ascii_case("off") => None,
        Some(folder) => Some(folder.into()),
        None => Some(dirs::cache_dir()?.join("nubis")),
    }
}

/// Bytes on disk.
pub fn size() -> u64 {
    let Some(folder) = folder() else { return 0 };
    files(&folder, PREFIX).iter().map(|file| file.bytes).sum()
}

/// Removes every file of the cache, and its folder where nothing else is in it.
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
    // Fails where there is more in it, or where it never was.
    let _ = fs::remove_dir(&folder);
    Ok(())
}

/// The bytes of a kind that were stored for `key`: all that they depend on, but for the version of this crate.
pub(crate) fn load(kind: &str, key: &str) -> Option<Vec<u8>> {
    let file = File::open(path(&folder()?, kind, key)).ok()?;
    let bytes = read(&file, key)?;
    // So that the files in use are the last to go.
    let _ = file.set_modified(SystemTime::now());
    Some(bytes)
}

/// Stores bytes, in parts, for `key`, if that can be done.
pub(crate) fn store(kind: &str, key: &str, parts: &[&[u8]]) {
    static STORED: AtomicUsize = AtomicUsize::new(0);
    if let Some(folder) = folder()
        && STORED.fetch_add(1, Ordering::Relaxed) < KEPT
        && write(&folder, kind, key, parts).is_ok()
    {
        let mut files = files(&folder, &format!("{PREFIX}{kind}-"));
        files.sort_by_key(|file| std::cmp::Reverse(file.used));
        for file in files.iter().skip(KEPT) {
            let _ = fs::remove_file(&file.path);
        }
    }
}

fn path(folder: &Path, kind: &str, key: &str) -> PathBuf {
    folder.join(format!("{PREFIX}{kind}-{:08x}", crc32fast::hash(key.as_bytes())))
}

/// Another process may read or write the same file now: it sees the old one or the new one, never half of one.
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

/// The bytes of a file, if it is whole and of this key.
fn read(mut file: &File, key: &str) -> Option<Vec<u8>> {
    let mut head = vec![0; header(key, &[]).len()];
    file.read_exact(&mut head).ok()?;
    let mut bytes = Vec::new();
    file.read_to_end(&mut bytes).ok()?;
    (head == header(key, &[&bytes])).then_some(bytes)
}

/// What stands before the bytes: whose they are, their length and checksum, and the key, in full, since names of files can
/// collide.
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

/// What the driver has compiled, from disk and for it, where the adapter gives it away.
pub(crate) struct Pipelines {
    key: String,
    cache: Option<wgpu::PipelineCache>,
    /// What is on disk.
    stored: Mutex<Option<Vec<u8>>>,
    /// Whether a pipeline has been made since that was written.
    grown: AtomicBool,
}

impl Pipelines {
    pub fn new(device: &wgpu::Device, adapter: &wgpu::Adapter, info: &AdapterInfo) -> Self {
        let same = wgpu::util::pipeline_cache_key(&adapter.get_info()).unwrap_or_default();
        let key = format!("{same} {} {}", info.name, info.driver);
        let offered = device.features().contains(wgpu::Features::PIPELINE_CACHE) && folder().is_some();
        let stored = load("pipelines", &key).filter(|stored| offered && stored.len() < MOST_PIPELINES);
        let descriptor =
            wgpu::PipelineCacheDescriptor { label: Some("pipelines"), data: stored.as_deref(), fallback: true };
        // SAFETY: the data is what such a cache gave: the checksum says so, and wgpu and the driver see whether they are
        // the ones that gave it. Who can write into the user's cache folder needs no pipelines to do harm.
        let cache = offered.then(|| unsafe { device.create_pipeline_cache(&descriptor) });
        Self { key, cache, stored: Mutex::new(stored), grown: AtomicBool::new(false) }
    }

    /// For making a pipeline.
    pub fn cache(&self) -> Option<&wgpu::PipelineCache> {
        self.grown.store(true, Ordering::Relaxed);
        self.cache.as_ref()
    }

    /// Stores what has been compiled since the last call.
    pub fn store(&self) {
        if !self.grown.swap(false, Ordering::Relaxed) {
            return;
        }
        let Some(data) = self.cache.as_ref().and_then(wgpu::PipelineCache::get_data) else { return };
        let mut stored = lock(&self.stored);
        // Equal where the driver keeps its pipelines elsewhere, as lavapipe does: then all of it is a header.
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

/// The files whose names begin so, among them those that are being written and those whose writers died.
fn files(folder: &Path, prefix: &str) -> Vec<CacheFile> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let ours = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix));
    ours.filter_map(|entry| {
        let about = entry.metadata().ok()?;
        Some(CacheFile { path: entry.path(), bytes: about.len(), used: about.modified().ok()? })
    })
    .collect()
}
