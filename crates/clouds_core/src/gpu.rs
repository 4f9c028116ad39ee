//! The GPU: finding an adapter, opening a device once per process, and waiting for it without hanging.

use std::any::{Any, TypeId};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use crate::cache::Pipelines;
use crate::constants::constants;
use crate::error::{Error, Result};
use crate::kernel::{Kernel, Key, Name, Program, Specialization};
use crate::shader::{self, Linked};

/// What an adapter says of itself.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Its name, such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// `vulkan`, `metal` or `dx12`.
    pub backend: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub kind: String,
    /// PCI bus address, empty where there is none.
    pub pci: String,
}

/// Seconds that an invocation is thought to take before any has been timed, on a processor and on a GPU: ten times as long as one
/// of a march in `draft`, as long as one in `high`.
const FIRST_GUESS: [f64; 2] = [3e-5, 1e-7];
/// Invocations up to which a dispatch says nothing of how long one takes: launching it takes longer.
const TOO_FEW: f64 = 1024.0;
/// How long one submission, meant to take a tenth of a second, may take before the device counts as hung.
const HUNG: Duration = Duration::from_secs(300);
/// How long to wait between looks at the caller's interrupt.
const SLICE: Duration = Duration::from_millis(100);

/// Asked while waiting: an error stops the work (Ctrl-C).
pub type Interrupt<'a> = &'a dyn Fn() -> Result<()>;

static PROCESS: AtomicU32 = AtomicU32::new(0);
static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();
// Never dropped: some drivers crash when a device goes away while the process exits.
static OPEN: Mutex<Vec<(usize, Arc<Gpu>)>> = Mutex::new(Vec::new());

/// Locks a mutex whose data no panic can leave half-written.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An error in a child that was forked after the driver had started threads: they do not exist there, and the first
/// call would wait for them for ever.
pub fn check_fork() -> Result<()> {
    let ours = std::process::id();
    match PROCESS.load(Ordering::Relaxed) {
        0 => Ok(()),
        pid if pid == ours => Ok(()),
        _ => Err(Error::Fork),
    }
}

/// What the environment should hold, by name, before anything loads the driver. It is for programs to set when they start:
/// it cannot be set safely once there are threads.
///
/// Mesa's layer `VK_LAYER_MESA_device_select` asks Wayland for its device and prints an error for each instance where
/// `XDG_RUNTIME_DIR` is no folder, as on every machine without a screen. It is left out there, unless the user has a say in
/// it: adapters are chosen here by kind.
pub fn driver_settings() -> Vec<(&'static str, &'static str)> {
    let wayland = std::env::var_os("XDG_RUNTIME_DIR").is_some_and(|folder| std::path::Path::new(&folder).is_absolute());
    let wished = ["NODEVICE_SELECT", "MESA_VK_DEVICE_SELECT", "MESA_VK_DEVICE_SELECT_FORCE_DEFAULT_DEVICE"];
    let wished = wished.into_iter().any(|name| std::env::var_os(name).is_some());
    if wayland || wished { Vec::new() } else { vec![("NODEVICE_SELECT", "1")] }
}

/// The adapters, best first: discrete, integrated, virtual, other, CPU.
fn enumerate() -> Result<Vec<wgpu::Adapter>> {
    check_fork()?;
    PROCESS.store(std::process::id(), Ordering::Relaxed);
    let instance = INSTANCE.get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        // Never OpenGL: it is not even compiled in.
        descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        wgpu::Instance::new(descriptor)
    });
    let mut adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    adapters.sort_by_key(|adapter| match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    Ok(adapters)
}

fn describe(adapter: &wgpu::Adapter) -> AdapterInfo {
    let info = adapter.get_info();
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "cpu",
        wgpu::DeviceType::Other => "other",
    };
    AdapterInfo {
        name: info.name,
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        backend: info.backend.to_str().to_owned(),
        kind: kind.to_owned(),
        pci: info.device_pci_bus_id,
    }
}

/// The adapters that can be used, best first.
pub fn adapters() -> Result<Vec<AdapterInfo>> {
    Ok(enumerate()?.iter().map(describe).collect())
}

/// Which of `adapters` `wanted` means: an index, a kind, or a part of its name, driver or PCI address.
fn choose(adapters: &[AdapterInfo], wanted: Option<&str>) -> Result<usize> {
    let list = || {
        let lines: Vec<_> = adapters
            .iter()
            .enumerate()
            .map(|(i, a)| format!("  {i}: {} ({}, {}, {})", a.name, a.kind, a.backend, a.driver))
            .collect();
        if lines.is_empty() { "  none".to_owned() } else { lines.join("\n") }
    };
    if adapters.is_empty() {
        return Err(Error::Adapter(
            "no Vulkan adapter was found. Either the loader is missing, or no driver is installed, or a container hides \
             the GPU (NVIDIA: NVIDIA_DRIVER_CAPABILITIES=graphics). A driver that needs no GPU: apt-get install \
             mesa-vulkan-drivers libvulkan1"
                .into(),
        ));
    }
    let Some(wanted) = wanted.map(str::trim).filter(|wanted| !wanted.is_empty()) else { return Ok(0) };
    let found = match wanted.parse::<usize>() {
        Ok(index) => (index < adapters.len()).then_some(index),
        Err(_) => {
            let wanted = wanted.to_lowercase();
            adapters.iter().position(|a| {
                let pci = !a.pci.is_empty() && a.pci.to_lowercase() == wanted;
                a.kind == wanted || pci || format!("{} {}", a.name, a.driver).to_lowercase().contains(&wanted)
            })
        }
    };
    found.ok_or_else(|| Error::Adapter(format!("no adapter matches {wanted:?}; found:\n{}", list())))
}

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
    programs: Mutex<HashMap<&'static str, Arc<Program>>>,
    kernels: Mutex<Kernels>,
    /// Seconds that an invocation takes, by kernel.
    costs: Mutex<HashMap<String, f64>>,
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

/// A kernel that is there, or is being compiled by whoever holds the lock.
type Slot = Arc<Mutex<Option<Arc<Kernel>>>>;

/// The kernels of a device, each with the number of its last use.
#[derive(Default)]
struct Kernels {
    slots: HashMap<Key, (Slot, u64)>,
    uses: u64,
}

/// Most kernels that are kept: on lavapipe one takes 2 to 3 MB, and a picture has ten to thirty.
const MOST_KERNELS: usize = 48;

impl Kernels {
    /// Forgets those whose last use is longest ago, where there are too many.
    fn forget(&mut self) {
        while self.slots.len() > MOST_KERNELS {
            let Some(oldest) = self.slots.iter().min_by_key(|(_, (_, last_use))| *last_use) else { return };
            let key = oldest.0.clone();
            self.slots.remove(&key);
        }
    }
}

#[derive(Default)]
struct Failure {
    /// The first error that no call has reported yet.
    error: Option<String>,
    lost: bool,
}

impl Gpu {
    /// The device of the adapter that `wanted` means, opened on first use; with none, the best.
    pub fn open(wanted: Option<&str>) -> Result<Arc<Self>> {
        check_fork()?;
        let adapters = enumerate()?;
        let infos: Vec<_> = adapters.iter().map(describe).collect();
        let index = choose(&infos, wanted)?;
        let mut open = lock(&OPEN);
        open.retain(|(_, gpu)| !lock(&gpu.failure).lost);
        if let Some((_, gpu)) = open.iter().find(|(i, _)| *i == index) {
            return Ok(gpu.clone());
        }
        let gpu = Arc::new(Self::new(&adapters[index], infos[index].clone())?);
        open.push((index, gpu.clone()));
        Ok(gpu)
    }

    /// What a window needs that shows pictures of this device without bringing them to memory.
    pub fn shared(&self) -> (wgpu::Instance, wgpu::Adapter, wgpu::Device, wgpu::Queue) {
        let instance = INSTANCE.get().expect("a device was opened through it").clone();
        (instance, self.adapter.clone(), self.device.clone(), self.queue.clone())
    }

    fn new(adapter: &wgpu::Adapter, info: AdapterInfo) -> Result<Self> {
        let offered = adapter.limits();
        // What the code needs and no more, but as long a buffer as there is: it bounds the size of `animate`'s frames.
        // `march` names 17 textures; Vulkan promises 16, drivers have 96 and more. `reproject` names 10 buffers; Vulkan promises
        // 4, drivers of desktops have 16 and more.
        let limits = wgpu::Limits {
            max_sampled_textures_per_shader_stage: 17,
            max_storage_buffers_per_shader_stage: 10,
            max_buffer_size: offered.max_buffer_size,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            ..wgpu::Limits::default()
        };
        let timestamps = wgpu::Features::TIMESTAMP_QUERY & adapter.features();
        let keeps = wgpu::Features::PIPELINE_CACHE & adapter.features();
        // Where a processor renders, its memory is ours, and what it has made is read in place: of a frame of 1920x1080, which takes
        // 115 ms, the copy took 5. On other devices that would slow them down.
        let in_place = if info.kind == "cpu" { IN_PLACE & adapter.features() } else { wgpu::Features::empty() };
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("nubis"),
            required_features: timestamps | keeps | in_place,
            required_limits: limits,
            ..Default::default()
        };
        let (device, queue) = pollster::block_on(adapter.request_device(&descriptor))
            .map_err(|error| Error::Adapter(format!("{} ({}) gives no device: {error}", info.name, info.driver)))?;

        let failure = Arc::new(Mutex::new(Failure::default()));
        let reported = failure.clone();
        // Without this wgpu panics on the first error.
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            // A window's own business (`Gpu::shared`): its surface cannot be made anew while we keep the device busy, and is
            // as soon as we do not.
            if !error.to_string().contains("In Surface::") {
                lock(&reported).error.get_or_insert_with(|| error.to_string());
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
            max_buffer: offered.max_storage_buffer_binding_size.min(offered.max_buffer_size),
            nothing: [wgpu::TextureDimension::D2, wgpu::TextureDimension::D3]
                .map(|dimension| nothing(&device, dimension)),
            shared: Mutex::default(),
            programs: Mutex::default(),
            kernels: Mutex::default(),
            costs: Mutex::default(),
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

    /// A pass, linked and validated on first use.
    fn program(&self, pass: &'static str) -> Result<Arc<Program>> {
        let known = lock(&self.programs).get(pass).cloned();
        if let Some(program) = known {
            return Ok(program);
        }
        let program = Arc::new(Program::new(self, pass)?);
        Ok(lock(&self.programs).entry(pass).or_insert(program).clone())
    }

    fn slot(&self, name: Name, specialization: &Specialization) -> Result<(Arc<Program>, Slot)> {
        let program = self.program(name.0)?;
        let key = program.key(name, specialization)?;
        let mut kernels = lock(&self.kernels);
        let use_number = kernels.uses;
        kernels.uses += 1;
        let (slot, last_use) = kernels.slots.entry(key).or_default();
        *last_use = use_number;
        let slot = slot.clone();
        kernels.forget();
        Ok((program, slot))
    }

    /// A kernel, compiled on first use.
    pub(crate) fn kernel(&self, name: Name, specialization: &Specialization) -> Result<Arc<Kernel>> {
        let (program, slot) = self.slot(name, specialization)?;
        let mut slot = lock(&slot);
        if let Some(kernel) = &*slot {
            return Ok(kernel.clone());
        }
        let kernel = Arc::new(program.compile(self, name.1, specialization)?);
        *slot = Some(kernel.clone());
        Ok(kernel)
    }

    /// Whether a kernel is there already.
    pub(crate) fn is_compiled(&self, name: Name, specialization: &Specialization) -> Result<bool> {
        let (_, slot) = self.slot(name, specialization)?;
        // One that is being compiled is locked.
        Ok(slot.try_lock().is_ok_and(|slot| slot.is_some()))
    }

    /// What all renderers of the device share of a type.
    pub(crate) fn common<T: Any + Send + Sync + Default>(&self) -> Arc<T> {
        let mut shared = lock(&self.shared);
        let slot = shared.entry(TypeId::of::<T>()).or_insert_with(|| Arc::new(T::default()));
        slot.clone().downcast().expect("is kept by its type")
    }

    /// Seconds that an invocation of a kernel takes.
    pub(crate) fn seconds_each(&self, kernel: &str) -> f64 {
        let [processor, other] = FIRST_GUESS;
        let guess = if self.info.kind == "cpu" { processor } else { other };
        lock(&self.costs).get(kernel).copied().unwrap_or(guess)
    }

    /// How many invocations of a kernel take so many seconds, at least one.
    pub(crate) fn most_invocations(&self, kernel: &str, seconds: f64) -> u64 {
        ((seconds / self.seconds_each(kernel)) as u64).max(1)
    }

    /// Learns how long invocations of a kernel take: from many, and by no more than a factor of four at once after the first time.
    pub(crate) fn learn(&self, kernel: &str, invocations: f64, seconds: f64) {
        if invocations >= TOO_FEW && seconds > 0.0 {
            let mut costs = lock(&self.costs);
            let each = seconds / invocations;
            let each = costs.get(kernel).map_or(each, |old| each.clamp(old / 4.0, old * 4.0));
            costs.insert(kernel.to_owned(), each);
        }
    }

    /// How many submissions the device has had, and how often one was waited for.
    pub fn counters(&self) -> [u64; 2] {
        [&self.submissions, &self.waits].map(|counter| counter.load(Ordering::Relaxed))
    }

    /// Forgets what has been compiled, so that the shaders are read anew (`NUBIS_SHADERS`). Where one is broken all stays as it is,
    /// and the error names its file and line.
    pub fn reload_shaders(&self) -> Result<()> {
        for name in shader::names() {
            Linked::new(name).and_then(|linked| linked.parse().map(drop)).map_err(Error::File)?;
        }
        lock(&self.programs).clear();
        lock(&self.kernels).slots.clear();
        Ok(())
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
