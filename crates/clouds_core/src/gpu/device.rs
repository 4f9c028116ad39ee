//! The device: opened once per process, its textures and buffers, and waiting for it without hanging.

use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use super::adapter::{self, AdapterInfo, check_fork, choose, describe, enumerate, lock};
use super::disk_cache::Pipelines;
use super::link::Generated;
use crate::error::{Error, Result};
use crate::shared::constants;

/// Asked while waiting: an error stops the work (Ctrl-C).
pub type Interrupt<'a> = &'a dyn Fn() -> Result<()>;

/// How long one submission, meant to take half a second, may take before the device counts as hung.
const HUNG: Duration = Duration::from_secs(300);
/// How long to wait between looks at the caller's interrupt.
const SLICE: Duration = Duration::from_millis(100);

// Never dropped: some drivers crash when a device goes away while the process exits.
static OPEN: Mutex<Vec<(usize, Arc<Gpu>)>> = Mutex::new(Vec::new());

/// An open device with all that is shared by the renderers on it.
pub struct Gpu {
    /// The adapter.
    pub info: AdapterInfo,
    adapter: wgpu::Adapter,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Most bytes that one buffer can hold for a shader.
    pub(crate) max_buffer: u64,
    /// Threads among which it shares the workgroups of a dispatch, where it is a processor; else 1.
    pub(crate) threads: u32,
    pub(crate) repeat_sampler: wgpu::Sampler,
    pub(crate) clamp_sampler: wgpu::Sampler,
    pub(crate) mirror_sampler: wgpu::Sampler,
    /// A flat texture and one with a depth, of a texel each, for what a kernel could read and does not.
    pub(crate) nothing: [wgpu::TextureView; 2],
    /// What renderers share, one of each type.
    shared: Mutex<HashMap<TypeId, Arc<dyn Any + Send + Sync>>>,
    /// The modules of its shaders that are no files.
    pub(crate) generated: Generated,
    submissions: AtomicU64,
    waits: AtomicU64,
    /// What the driver has compiled.
    pub(crate) pipelines: Pipelines,
    pub(crate) nanoseconds_per_tick: Option<f64>,
    failure: Arc<Mutex<Failure>>,
    waiting: mpsc::Sender<Waiting>,
}

/// A submission, and who is told when it is done.
type Waiting = (wgpu::SubmissionIndex, mpsc::Sender<Result<wgpu::PollStatus, wgpu::PollError>>);

/// Waits for submissions, one after the other, for as long as they take: wgpu 30 panics where the time that a wait may take
/// ends while another thread submits to the same device (gfx-rs/wgpu pull request 9958).
fn start_waiting(device: wgpu::Device) -> mpsc::Sender<Waiting> {
    let (sender, receiver) = mpsc::channel::<Waiting>();
    thread::spawn(move || {
        for (index, done) in receiver {
            let poll = wgpu::PollType::Wait { submission_index: Some(index), timeout: None };
            // Nobody listens where the work was interrupted.
            let _ = done.send(device.poll(poll));
        }
    });
    sender
}

/// What is asked of a device.
fn limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
    let offered = adapter.limits();
    // What the code needs and no more, but as long a buffer as there is: it bounds the size of `animate`'s frames.
    // `march` names 17 textures; Vulkan promises 16, drivers have 96 and more. `reproject` names 10 buffers; Vulkan promises
    // 4, drivers of desktops have 16 and more.
    wgpu::Limits {
        max_sampled_textures_per_shader_stage: 17,
        max_storage_buffers_per_shader_stage: 10,
        max_buffer_size: offered.max_buffer_size,
        max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
        ..wgpu::Limits::default()
    }
}

/// A texel of nothing.
fn nothing(device: &wgpu::Device, dimension: wgpu::TextureDimension) -> wgpu::TextureView {
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("nothing"),
        size: wgpu::Extent3d { width: 1, height: 1, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count: 1,
        dimension,
        format: wgpu::TextureFormat::Rgba16Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING,
        view_formats: &[],
    });
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

#[derive(Default)]
struct Failure {
    /// The first error that no call has reported yet.
    error: Option<String>,
    lost: bool,
    /// The thread of the window that shares the device, whose errors are its own.
    window: Option<thread::ThreadId>,
}

impl Gpu {
    /// The device of the adapter that `wanted` means, opened on first use with the generated modules of its shaders; with none, the best.
    pub(crate) fn open_with(wanted: Option<&str>, generated: Generated) -> Result<Arc<Self>> {
        check_fork()?;
        let adapters = enumerate()?;
        let infos: Vec<_> = adapters.iter().map(describe).collect();
        let index = choose(&infos, wanted)?;
        let mut open = lock(&OPEN);
        open.retain(|(_, gpu)| !lock(&gpu.failure).lost);
        if let Some((_, gpu)) = open.iter().find(|(i, _)| *i == index) {
            return Ok(gpu.clone());
        }
        let gpu = Arc::new(Self::new(&adapters[index], infos[index].clone(), generated)?);
        open.push((index, gpu.clone()));
        Ok(gpu)
    }

    /// What a window needs that shows pictures of this device without bringing them to memory. Calling thread: the window's
    /// from here on, which renders no clouds. Errors of that thread cost the window one of its frames and are no errors of
    /// the renderer: a surface whose size changes while the device is busy cannot be configured, and what is then drawn to
    /// it at the new size is refused, until the device has time.
    pub fn shared(&self) -> (wgpu::Instance, wgpu::Adapter, wgpu::Device, wgpu::Queue) {
        lock(&self.failure).window = Some(thread::current().id());
        let instance = adapter::instance().clone();
        (instance, self.adapter.clone(), self.device.clone(), self.queue.clone())
    }

    fn new(adapter: &wgpu::Adapter, info: AdapterInfo, generated: Generated) -> Result<Self> {
        let timestamps = wgpu::Features::TIMESTAMP_QUERY & adapter.features();
        let keeps = wgpu::Features::PIPELINE_CACHE & adapter.features();
        // Where a processor renders, its memory is ours, and what it has made is read in place: of a frame of 1920x1080, which takes
        // 115 ms, the copy took 5. On other devices that would slow them down.
        let in_place = if info.kind == "cpu" { IN_PLACE & adapter.features() } else { wgpu::Features::empty() };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("nubis"),
            required_features: timestamps | keeps | in_place,
            required_limits: limits(adapter),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::Adapter(format!("{} ({}) gives no device: {error}", info.name, info.driver)))?;

        let failure = Arc::new(Mutex::new(Failure::default()));
        let reported = failure.clone();
        // Without this wgpu panics on the first error. wgpu calls it on the thread of the call that failed.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            let mut failure = lock(&reported);
            if failure.window != Some(thread::current().id()) {
                failure.error.get_or_insert_with(|| error.to_string());
            }
        }));
        let reported = failure.clone();
        device.set_device_lost_callback(move |reason, message| {
            let mut failure = lock(&reported);
            failure.lost = true;
            failure.error = Some(format!("the device was lost ({reason:?}): {message}"));
        });

        let pipelines = Pipelines::new(&device, adapter, &info);
        // Where it refuses the file, there is no cache, and nothing is wrong.
        lock(&failure).error = None;
        let sampler = |label, address| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some(label),
                address_mode_u: address,
                address_mode_v: address,
                address_mode_w: address,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                // One mip is read, not two.
                mipmap_filter: wgpu::MipmapFilterMode::Nearest,
                ..Default::default()
            })
        };
        let threads = thread::available_parallelism().map_or(1, |threads| threads.get() as u32);
        Ok(Self {
            threads: if info.kind == "cpu" { threads } else { 1 },
            info,
            adapter: adapter.clone(),
            repeat_sampler: sampler("repeat_sampler", wgpu::AddressMode::Repeat),
            clamp_sampler: sampler("clamp_sampler", wgpu::AddressMode::ClampToEdge),
            mirror_sampler: sampler("mirror_sampler", wgpu::AddressMode::MirrorRepeat),
            max_buffer: adapter.limits().max_storage_buffer_binding_size.min(adapter.limits().max_buffer_size),
            nothing: [wgpu::TextureDimension::D2, wgpu::TextureDimension::D3]
                .map(|dimension| nothing(&device, dimension)),
            shared: Mutex::default(),
            generated,
            submissions: AtomicU64::new(0),
            waits: AtomicU64::new(0),
            pipelines,
            nanoseconds_per_tick: (!timestamps.is_empty()).then(|| f64::from(queue.get_timestamp_period())),
            failure,
            waiting: start_waiting(device.clone()),
            device,
            queue,
        })
    }

    /// What all renderers of the device share of a type.
    pub(crate) fn common<T: Any + Send + Sync + Default>(&self) -> Arc<T> {
        let mut shared = lock(&self.shared);
        let slot = shared.entry(TypeId::of::<T>()).or_insert_with(|| Arc::new(T::default()));
        slot.clone().downcast().expect("is kept by its type")
    }

    /// How many submissions the device has had, and how often one was waited for.
    pub fn counters(&self) -> [u64; 2] {
        [&self.submissions, &self.waits].map(|counter| counter.load(Ordering::Relaxed))
    }

    /// The first error since the last call, if any.
    pub(crate) fn check(&self) -> Result<()> {
        let Some(mut error) = lock(&self.failure).error.take() else { return Ok(()) };
        // What is asked of a lost device is refused before it says that it is lost.
        let _ = self.device.poll(wgpu::PollType::Poll);
        let mut failure = lock(&self.failure);
        if failure.lost {
            error = failure.error.take().unwrap_or(error);
            failure.error = Some(error.clone());
            return Err(Error::Device(format!("{error}; make a new Renderer to go on")));
        }
        let advice = if error.to_lowercase().contains("memory") {
            "; free other GPU memory or render a smaller picture"
        } else {
            ""
        };
        Err(Error::Device(format!("{error}{advice}")))
    }

    /// A buffer of `bytes` for shaders.
    pub(crate) fn buffer(&self, label: &str, bytes: u64) -> wgpu::Buffer {
        self.buffer_for(label, bytes, wgpu::BufferUsages::empty())
    }

    /// The same for what is large and brought back often: in place, where that can be.
    pub(crate) fn picture_buffer(&self, label: &str, bytes: u64) -> wgpu::Buffer {
        let in_place = self.device.features().contains(IN_PLACE);
        let usage = if in_place { wgpu::BufferUsages::MAP_READ } else { wgpu::BufferUsages::empty() };
        self.buffer_for(label, bytes, usage)
    }

    fn buffer_for(&self, label: &str, bytes: u64, more: wgpu::BufferUsages) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.max(16),
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::UNIFORM
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::COPY_DST
                | more,
            mapped_at_creation: false,
        })
    }

    /// A buffer for the arguments of indirect dispatches, which are uniform blocks too.
    pub(crate) fn arguments(&self, bytes: u64) -> wgpu::Buffer {
        self.buffer_for("arguments", bytes, wgpu::BufferUsages::INDIRECT)
    }

    /// A buffer that timestamps are resolved into.
    pub(crate) fn resolved(&self, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: bytes,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        })
    }

    pub(crate) fn staging(&self, bytes: u64) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("staging"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// A buffer that holds a uniform block of `bytes`.
    pub(crate) fn uniform(&self, label: &str, bytes: usize) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// A half-float texture of four channels; a depth of 1 makes it flat. Half floats filter exactly on lavapipe, where
    /// 8-bit ones have 256 levels (docs/numerics.md), and four channels of them can be stored to on every adapter.
    pub(crate) fn texture(&self, label: &str, size: [u32; 3], mips: u32) -> wgpu::Texture {
        let dimension = if size[2] == 1 { wgpu::TextureDimension::D2 } else { wgpu::TextureDimension::D3 };
        self.allocate(
            label,
            size,
            mips,
            dimension,
            wgpu::TextureFormat::Rgba16Float,
            wgpu::TextureUsages::STORAGE_BINDING,
        )
    }

    /// The same, but never flat.
    pub(crate) fn texture_3d(&self, label: &str, size: [u32; 3]) -> wgpu::Texture {
        let (dimension, storage) = (wgpu::TextureDimension::D3, wgpu::TextureUsages::STORAGE_BINDING);
        self.allocate(label, size, 1, dimension, wgpu::TextureFormat::Rgba16Float, storage)
    }

    /// A flat texture of one or two channels, to be filled from here or from a buffer, as it cannot be stored to everywhere.
    pub(crate) fn flat(&self, label: &str, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::Texture {
        let dimension = wgpu::TextureDimension::D2;
        self.allocate(label, [width, height, 1], 1, dimension, format, wgpu::TextureUsages::empty())
    }

    /// The same with a depth, and mips.
    pub(crate) fn volume(&self, label: &str, size: [u32; 3], mips: u32, format: wgpu::TextureFormat) -> wgpu::Texture {
        self.allocate(label, size, mips, wgpu::TextureDimension::D3, format, wgpu::TextureUsages::empty())
    }

    fn allocate(
        &self,
        label: &str,
        [width, height, depth_or_array_layers]: [u32; 3],
        mip_level_count: u32,
        dimension: wgpu::TextureDimension,
        format: wgpu::TextureFormat,
        more: wgpu::TextureUsages,
    ) -> wgpu::Texture {
        let copies = wgpu::TextureUsages::COPY_SRC | wgpu::TextureUsages::COPY_DST;
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width, height, depth_or_array_layers },
            mip_level_count,
            sample_count: 1,
            dimension,
            format,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | copies | more,
            view_formats: &[],
        })
    }

    /// Fills a texture with texels, row by row.
    pub(crate) fn write_texture<T: bytemuck::NoUninit>(&self, texture: &wgpu::Texture, texels: &[T]) {
        let bytes_per_row = Some(size_of::<T>() as u32 * texture.width());
        self.queue.write_texture(
            texture.as_image_copy(),
            bytemuck::cast_slice(texels),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: Some(texture.height()) },
            texture.size(),
        );
    }

    /// Fills a texture and its mips with the [`texture_bytes`] of [`texture_rows`].
    pub(crate) fn restore_texture(&self, texture: &wgpu::Texture, bytes: &[u8]) {
        for (target, layout, size) in mips(texture, 1) {
            self.queue.write_texture(target, bytes, layout, size);
        }
    }

    /// Hands commands over.
    pub(crate) fn submit(&self, commands: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.submissions.fetch_add(1, Ordering::Relaxed);
        self.queue.submit([commands.finish()])
    }

    /// Waits for a submission and those before, or until `interrupt` fails.
    pub(crate) fn wait(&self, index: wgpu::SubmissionIndex, interrupt: Interrupt<'_>) -> Result<()> {
        self.waits.fetch_add(1, Ordering::Relaxed);
        let started = Instant::now();
        let (done, is_done) = mpsc::channel();
        let ended = || Error::Device("internal error, please report it".into());
        self.waiting.send((index, done)).map_err(|_| ended())?;
        loop {
            match is_done.recv_timeout(SLICE) {
                Ok(Ok(_)) => return self.check(),
                Err(RecvTimeoutError::Timeout) => {
                    self.check()?;
                    interrupt()?;
                    if started.elapsed() > HUNG {
                        return Err(Error::Device(format!(
                            "{} has not answered for {} s; make a new Renderer, or choose another adapter",
                            self.info.name,
                            HUNG.as_secs()
                        )));
                    }
                }
                // A lost device says so first.
                Ok(Err(error)) => return self.check().and(Err(Error::Device(error.to_string()))),
                Err(RecvTimeoutError::Disconnected) => return self.check().and(Err(ended())),
            }
        }
    }
}

/// Milliseconds on the GPU by kernel, in the order in which they first ran.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timings(pub Vec<(String, f64)>);

impl Timings {
    /// Adds time to a kernel's row.
    pub fn add(&mut self, label: &str, milliseconds: f64) {
        match self.0.iter_mut().find(|(name, _)| name == label) {
            Some((_, total)) => *total += milliseconds,
            None => self.0.push((label.to_owned(), milliseconds)),
        }
    }
}

/// Buffers that shaders write and we read.
const IN_PLACE: wgpu::Features = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;

constants! {
    /// What the rows of a texture that is copied to or from a buffer are padded to, bytes (WebGPU).
    pub(crate) const COPIED: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
}

/// The mips of a texture of half floats, and where their texels lie in memory, one mip after the other, their rows padded.
pub(crate) fn mips(
    texture: &wgpu::Texture,
    padded: u32,
) -> impl Iterator<Item = (wgpu::TexelCopyTextureInfo<'_>, wgpu::TexelCopyBufferLayout, wgpu::Extent3d)> {
    let mut end = 0;
    let texel = texture.format().block_copy_size(None).unwrap_or(8);
    (0..texture.mip_level_count()).map(move |mip_level| {
        let size = texture.size().mip_level_size(mip_level, texture.dimension());
        let row = (texel * size.width).next_multiple_of(padded);
        let offset = end;
        end += u64::from(row) * u64::from(size.height) * u64::from(size.depth_or_array_layers);
        let layout =
            wgpu::TexelCopyBufferLayout { offset, bytes_per_row: Some(row), rows_per_image: Some(size.height) };
        (wgpu::TexelCopyTextureInfo { mip_level, ..texture.as_image_copy() }, layout, size)
    })
}

/// The rows that `Recorder::download_texture` gave, without what pads them.
pub(crate) fn texture_rows<'a>(texture: &'a wgpu::Texture, bytes: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
    let padded = mips(texture, COPIED).zip(mips(texture, 1));
    padded.flat_map(move |((_, layout, size), (_, tight, _))| {
        let [row, own] = [layout, tight].map(|layout| layout.bytes_per_row.unwrap_or(0) as usize);
        let rows = (size.height * size.depth_or_array_layers) as usize;
        (0..rows).map(move |i| &bytes[layout.offset as usize + i * row..][..own])
    })
}

/// How many bytes a texture and its mips have, with rows padded.
pub(crate) fn texture_bytes(texture: &wgpu::Texture, padded: u32) -> u64 {
    let bytes = |layout: wgpu::TexelCopyBufferLayout, size: wgpu::Extent3d| {
        let row = u64::from(layout.bytes_per_row.unwrap_or(0));
        layout.offset + row * u64::from(size.height) * u64::from(size.depth_or_array_layers)
    };
    mips(texture, padded).last().map_or(0, |(_, layout, size)| bytes(layout, size))
}

/// Bytes that came back from the GPU, in a buffer that is the device's again when they are dropped.
pub(crate) struct Download {
    buffer: wgpu::Buffer,
    range: Range<u64>,
    /// Whether it is mapped, or will be.
    mapped: bool,
    /// What is mapped of it, once it is.
    view: Option<wgpu::BufferView>,
}

impl Download {
    pub fn of(buffer: wgpu::Buffer, range: Range<u64>) -> Self {
        Self { buffer, range, mapped: false, view: None }
    }

    /// Asks for it; failures come out when it is there.
    pub fn map(&mut self) {
        self.buffer.map_async(wgpu::MapMode::Read, self.range.clone(), |_| {});
        self.mapped = true;
    }

    /// Opens what has come back.
    pub fn open(&mut self) -> Result<()> {
        let found = self.buffer.get_mapped_range(self.range.clone());
        self.view = Some(found.map_err(|error| Error::Device(error.to_string()))?);
        Ok(())
    }

    /// The bytes as numbers.
    pub fn numbers<T: bytemuck::AnyBitPattern>(&self) -> &[T] {
        self.view.as_ref().map_or(&[], |view| bytemuck::cast_slice(view))
    }
}

impl Drop for Download {
    fn drop(&mut self) {
        self.view = None;
        // What was interrupted before it was submitted is not.
        if self.mapped {
            self.buffer.unmap();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asks for what no device has: a buffer of 2^60 bytes.
    fn err(gpu: &Gpu) {
        let _ = gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: 1 << 60,
            usage: wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
    }

    #[test]
    fn errors_of_a_window_are_its_own() {
        let gpu = Gpu::open(None).unwrap();
        let renders = gpu.clone();
        thread::spawn(move || {
            gpu.shared();
            err(&gpu);
            gpu.check().expect("the window's thread has erred");
        })
        .join()
        .unwrap();
        err(&renders);
        assert!(renders.check().is_err());
    }
}
