//! Device: opened once per process and adapter; creation of textures and buffers; waits that cannot hang.

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

/// Interrupt check, called during waits: an error stops the work (Ctrl-C).
pub type Interrupt<'a> = &'a dyn Fn() -> Result<()>;

/// Time after which a submission, planned to take half a second, counts as hung.
const HANG_TIMEOUT: Duration = Duration::from_secs(300);
/// Interval between calls of the interrupt check during a wait.
const POLL_INTERVAL: Duration = Duration::from_millis(100);

// Never dropped: some drivers crash when a device is destroyed while the process exits.
static OPEN_DEVICES: Mutex<Vec<(usize, Arc<Gpu>)>> = Mutex::new(Vec::new());

/// Open device and the resources that its renderers share.
pub struct Gpu {
    /// Its adapter.
    pub info: AdapterInfo,
    adapter: wgpu::Adapter,
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Maximum size of a storage buffer in bytes.
    pub(crate) max_buffer: u64,
    /// Worker threads among which a CPU device distributes the workgroups of a dispatch; 1 on a GPU.
    pub(crate) threads: u32,
    pub(crate) repeat_sampler: wgpu::Sampler,
    pub(crate) clamp_sampler: wgpu::Sampler,
    pub(crate) mirror_sampler: wgpu::Sampler,
    /// Placeholder textures of one texel, 2D and 3D, for bindings that a kernel declares but does not read.
    pub(crate) nothing: [wgpu::TextureView; 2],
    /// Resources shared by renderers, one of each type.
    shared: Mutex<HashMap<TypeId, Arc<dyn Any + Send + Sync>>>,
    /// Generated modules of its shaders.
    pub(crate) generated: Generated,
    submissions: AtomicU64,
    waits: AtomicU64,
    /// Pipeline cache.
    pub(crate) pipelines: Pipelines,
    pub(crate) nanoseconds_per_tick: Option<f64>,
    failure: Arc<Mutex<Failure>>,
    waiter: mpsc::Sender<WaitRequest>,
}

/// Submission, and the channel that is notified when it is done.
type WaitRequest = (wgpu::SubmissionIndex, mpsc::Sender<Result<wgpu::PollStatus, wgpu::PollError>>);

/// Thread that waits for submissions, one after the other, without a timeout: wgpu 30 panics if a wait times out while
/// another thread submits to the same device (gfx-rs/wgpu pull request 9958).
fn spawn_waiter(device: wgpu::Device) -> mpsc::Sender<WaitRequest> {
    let (sender, receiver) = mpsc::channel::<WaitRequest>();
    thread::spawn(move || {
        for (index, done) in receiver {
            let poll = wgpu::PollType::Wait { submission_index: Some(index), timeout: None };
            // Without a receiver after an interrupt.
            let _ = done.send(device.poll(poll));
        }
    });
    sender
}

/// Limits to request from an adapter.
fn required_limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
    let offered = adapter.limits();
    // Limits that the code needs and no more, except for the largest possible buffers: they bound the size of
    // `animate`'s frames. `march` binds up to 22 textures; Vulkan guarantees 16, drivers have 96 and more. `reproject` binds
    // 10 storage buffers; Vulkan guarantees 4, desktop drivers have 16 and more.
    wgpu::Limits {
        max_sampled_textures_per_shader_stage: 22,
        max_storage_buffers_per_shader_stage: 10,
        max_buffer_size: offered.max_buffer_size,
        max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
        ..wgpu::Limits::default()
    }
}

/// Placeholder texture of one texel.
fn placeholder(device: &wgpu::Device, dimension: wgpu::TextureDimension) -> wgpu::TextureView {
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
    /// First error that no call has reported yet.
    error: Option<String>,
    lost: bool,
    /// Thread of the window that shares the device; its errors are ignored.
    window: Option<thread::ThreadId>,
}

impl Gpu {
    /// Device of an adapter, opened on first use with the generated modules of its shaders. None selects the best
    /// adapter.
    pub(crate) fn open_with(wanted: Option<&str>, generated: Generated) -> Result<Arc<Self>> {
        check_fork()?;
        let adapters = enumerate()?;
        let infos: Vec<_> = adapters.iter().map(describe).collect();
        let index = choose(&infos, wanted)?;
        let mut open = lock(&OPEN_DEVICES);
        open.retain(|(_, gpu)| !lock(&gpu.failure).lost);
        if let Some((_, gpu)) = open.iter().find(|(i, _)| *i == index) {
            return Ok(gpu.clone());
        }
        let gpu = Arc::new(Self::new(&adapters[index], infos[index].clone(), generated)?);
        open.push((index, gpu.clone()));
        Ok(gpu)
    }

    /// Handles for a window that presents pictures of this device without a readback.
    ///
    /// The calling thread becomes the window's thread and must not render clouds. Errors on that thread cost the window
    /// a frame and are not reported to renderers: a surface that is resized while the device is busy cannot be
    /// configured, and drawing to it at the new size fails until the device is idle.
    pub fn shared(&self) -> (wgpu::Instance, wgpu::Adapter, wgpu::Device, wgpu::Queue) {
        lock(&self.failure).window = Some(thread::current().id());
        let instance = adapter::instance().clone();
        (instance, self.adapter.clone(), self.device.clone(), self.queue.clone())
    }

    fn new(adapter: &wgpu::Adapter, info: AdapterInfo, generated: Generated) -> Result<Self> {
        let timestamps = wgpu::Features::TIMESTAMP_QUERY & adapter.features();
        let pipeline_cache = wgpu::Features::PIPELINE_CACHE & adapter.features();
        // Readback in place on a CPU device, whose memory is host memory: at 1920x1080 it saves a copy of 5 ms of a
        // frame of 115 ms. On other devices mappable storage buffers are slower.
        let in_place = if info.kind == "cpu" { IN_PLACE & adapter.features() } else { wgpu::Features::empty() };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("nubis"),
            required_features: timestamps | pipeline_cache | in_place,
            required_limits: required_limits(adapter),
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::Adapter(format!("{} ({}) gives no device: {error}", info.name, info.driver)))?;

        let failure = Arc::new(Mutex::new(Failure::default()));
        let reported = failure.clone();
        // Without a handler wgpu panics on the first error. wgpu calls it on the thread of the failing call.
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
        // A rejected cache file is not an error; there is no pipeline cache then.
        lock(&failure).error = None;
        let sampler = |label, address| {
            device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some(label),
                address_mode_u: address,
                address_mode_v: address,
                address_mode_w: address,
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                // One mip level per read, not two.
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
                .map(|dimension| placeholder(&device, dimension)),
            shared: Mutex::default(),
            generated,
            submissions: AtomicU64::new(0),
            waits: AtomicU64::new(0),
            pipelines,
            nanoseconds_per_tick: (!timestamps.is_empty()).then(|| f64::from(queue.get_timestamp_period())),
            failure,
            waiter: spawn_waiter(device.clone()),
            device,
            queue,
        })
    }

    /// Resource of a type, shared by all renderers of the device and created on first use.
    pub(crate) fn common<T: Any + Send + Sync + Default>(&self) -> Arc<T> {
        let mut shared = lock(&self.shared);
        let slot = shared.entry(TypeId::of::<T>()).or_insert_with(|| Arc::new(T::default()));
        slot.clone().downcast().expect("is kept by its type")
    }

    /// Numbers of submissions and of waits for them since the device was opened.
    pub fn counters(&self) -> [u64; 2] {
        [&self.submissions, &self.waits].map(|counter| counter.load(Ordering::Relaxed))
    }

    /// Reports the first error since the last call.
    pub(crate) fn check(&self) -> Result<()> {
        let Some(mut error) = lock(&self.failure).error.take() else { return Ok(()) };
        // A lost device refuses requests before it reports its loss.
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

    /// Storage buffer of `bytes` bytes.
    pub(crate) fn buffer(&self, label: &str, bytes: u64) -> wgpu::Buffer {
        self.buffer_for(label, bytes, wgpu::BufferUsages::empty())
    }

    /// Storage buffer for large and frequent readbacks: mapped in place if the device supports it.
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

    /// Buffer of arguments for indirect dispatches, also bound as uniforms.
    pub(crate) fn arguments(&self, bytes: u64) -> wgpu::Buffer {
        self.buffer_for("arguments", bytes, wgpu::BufferUsages::INDIRECT)
    }

    /// Buffer for resolved timestamps.
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

    /// Buffer for uniform blocks of `bytes` bytes.
    pub(crate) fn uniform(&self, label: &str, bytes: usize) -> wgpu::Buffer {
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Half-float storage texture of four channels; 2D if its depth is 1. lavapipe filters half floats exactly, 8-bit
    /// texels with 256 levels (docs/numerics.md). Every adapter supports stores to four half-float channels.
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

    /// Half-float storage texture of four channels, 3D even with a depth of 1.
    pub(crate) fn texture_3d(&self, label: &str, size: [u32; 3]) -> wgpu::Texture {
        let (dimension, storage) = (wgpu::TextureDimension::D3, wgpu::TextureUsages::STORAGE_BINDING);
        self.allocate(label, size, 1, dimension, wgpu::TextureFormat::Rgba16Float, storage)
    }

    /// Storage texture of four 32-bit words per texel.
    pub(crate) fn words_3d(&self, label: &str, size: [u32; 3]) -> wgpu::Texture {
        let (dimension, storage) = (wgpu::TextureDimension::D3, wgpu::TextureUsages::STORAGE_BINDING);
        self.allocate(label, size, 1, dimension, wgpu::TextureFormat::Rgba32Uint, storage)
    }

    /// 2D texture of one or two channels. It is filled from the host or from a buffer, as not every adapter supports
    /// stores to its format.
    pub(crate) fn flat(&self, label: &str, [width, height]: [u32; 2], format: wgpu::TextureFormat) -> wgpu::Texture {
        let dimension = wgpu::TextureDimension::D2;
        self.allocate(label, [width, height, 1], 1, dimension, format, wgpu::TextureUsages::empty())
    }

    /// 3D texture with mips, filled as [`Gpu::flat`].
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

    /// Uploads texels, row by row.
    pub(crate) fn write_texture<T: bytemuck::NoUninit>(&self, texture: &wgpu::Texture, texels: &[T]) {
        let bytes_per_row = Some(size_of::<T>() as u32 * texture.width());
        self.queue.write_texture(
            texture.as_image_copy(),
            bytemuck::cast_slice(texels),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: Some(texture.height()) },
            texture.size(),
        );
    }

    /// Uploads all mips of a texture from bytes of [`texture_rows`], [`texture_bytes`] in number.
    pub(crate) fn restore_texture(&self, texture: &wgpu::Texture, bytes: &[u8]) {
        for (target, layout, size) in mips(texture, 1) {
            self.queue.write_texture(target, bytes, layout, size);
        }
    }

    /// Submits commands.
    pub(crate) fn submit(&self, commands: wgpu::CommandEncoder) -> wgpu::SubmissionIndex {
        self.submissions.fetch_add(1, Ordering::Relaxed);
        self.queue.submit([commands.finish()])
    }

    /// Waits for a submission and all before it, or until `interrupt` fails.
    ///
    /// Returns [`Error::Device`] after an error, a loss or a hang of the device.
    pub(crate) fn wait(&self, index: wgpu::SubmissionIndex, interrupt: Interrupt<'_>) -> Result<()> {
        self.waits.fetch_add(1, Ordering::Relaxed);
        let started = Instant::now();
        let (done, is_done) = mpsc::channel();
        let ended = || Error::Device("internal error, please report it".into());
        self.waiter.send((index, done)).map_err(|_| ended())?;
        loop {
            match is_done.recv_timeout(POLL_INTERVAL) {
                Ok(Ok(_)) => return self.check(),
                Err(RecvTimeoutError::Timeout) => {
                    self.check()?;
                    interrupt()?;
                    if started.elapsed() > HANG_TIMEOUT {
                        return Err(Error::Device(format!(
                            "{} has not answered for {} s; make a new Renderer, or choose another adapter",
                            self.info.name,
                            HANG_TIMEOUT.as_secs()
                        )));
                    }
                }
                // The loss of the device takes precedence.
                Ok(Err(error)) => return self.check().and(Err(Error::Device(error.to_string()))),
                Err(RecvTimeoutError::Disconnected) => return self.check().and(Err(ended())),
            }
        }
    }
}

/// GPU time in ms by kernel, in the order of first use.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timings(pub Vec<(String, f64)>);

impl Timings {
    /// Adds time to a kernel.
    pub fn add(&mut self, label: &str, milliseconds: f64) {
        match self.0.iter_mut().find(|(name, _)| name == label) {
            Some((_, total)) => *total += milliseconds,
            None => self.0.push((label.to_owned(), milliseconds)),
        }
    }
}

/// Feature for storage buffers that the host maps.
const IN_PLACE: wgpu::Features = wgpu::Features::MAPPABLE_PRIMARY_BUFFERS;

constants! {
    /// Row alignment in bytes of texture copies to and from buffers (WebGPU).
    pub(crate) const COPIED: u32 = wgpu::COPY_BYTES_PER_ROW_ALIGNMENT;
}

/// Mips of a texture and their layout in memory: one after the other, with rows padded to a multiple of `padded` bytes.
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

/// Rows of a downloaded texture (`Recorder::download_texture`) without padding.
pub(crate) fn texture_rows<'a>(texture: &'a wgpu::Texture, bytes: &'a [u8]) -> impl Iterator<Item = &'a [u8]> {
    let padded = mips(texture, COPIED).zip(mips(texture, 1));
    padded.flat_map(move |((_, layout, size), (_, tight, _))| {
        let [row, own] = [layout, tight].map(|layout| layout.bytes_per_row.unwrap_or(0) as usize);
        let rows = (size.height * size.depth_or_array_layers) as usize;
        (0..rows).map(move |i| &bytes[layout.offset as usize + i * row..][..own])
    })
}

/// Size of a texture with its mips in bytes, with rows padded to a multiple of `padded` bytes.
pub(crate) fn texture_bytes(texture: &wgpu::Texture, padded: u32) -> u64 {
    let bytes = |layout: wgpu::TexelCopyBufferLayout, size: wgpu::Extent3d| {
        let row = u64::from(layout.bytes_per_row.unwrap_or(0));
        layout.offset + row * u64::from(size.height) * u64::from(size.depth_or_array_layers)
    };
    mips(texture, padded).last().map_or(0, |(_, layout, size)| bytes(layout, size))
}

/// Readback of a buffer range. Dropping it unmaps the buffer.
pub(crate) struct Download {
    buffer: wgpu::Buffer,
    range: Range<u64>,
    /// Whether the buffer is mapped or a mapping is pending.
    mapped: bool,
    /// Mapped bytes, once opened.
    view: Option<wgpu::BufferView>,
}

impl Download {
    pub fn of(buffer: wgpu::Buffer, range: Range<u64>) -> Self {
        Self { buffer, range, mapped: false, view: None }
    }

    /// Requests the mapping; [`Download::open`] reports failures.
    pub fn map(&mut self) {
        self.buffer.map_async(wgpu::MapMode::Read, self.range.clone(), |_| {});
        self.mapped = true;
    }

    /// Opens the mapped range, once the device has completed the mapping.
    pub fn open(&mut self) -> Result<()> {
        let found = self.buffer.get_mapped_range(self.range.clone());
        self.view = Some(found.map_err(|error| Error::Device(error.to_string()))?);
        Ok(())
    }

    /// Bytes as numbers.
    pub fn numbers<T: bytemuck::AnyBitPattern>(&self) -> &[T] {
        self.view.as_ref().map_or(&[], |view| bytemuck::cast_slice(view))
    }
}

impl Drop for Download {
    fn drop(&mut self) {
        self.view = None;
        // An interrupt before the submission leaves the buffer unmapped.
        if self.mapped {
            self.buffer.unmap();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails on every device: a buffer of 2^60 bytes.
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
