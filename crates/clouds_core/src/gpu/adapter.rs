//! Adapters: enumeration, selection, and the guard against forked processes.

use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use crate::error::{Error, Result};

/// Description of an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// Name, such as `llvmpipe (LLVM 15.0.6, 256 bits)`.
    pub name: String,
    /// Driver and version.
    pub driver: String,
    /// `vulkan`, `metal` or `dx12`.
    pub backend: String,
    /// `discrete`, `integrated`, `virtual`, `cpu` or `other`.
    pub kind: String,
    /// PCI bus address; empty if there is none.
    pub pci: String,
}

static PROCESS: AtomicU32 = AtomicU32::new(0);
static INSTANCE: OnceLock<wgpu::Instance> = OnceLock::new();

/// Locks a mutex and ignores poisoning; for data that no panic leaves half-written.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns [`Error::Fork`] in a child process forked after the driver started threads. The threads do not exist in the
/// child, and the first call would wait for them forever.
pub fn check_fork() -> Result<()> {
    let ours = std::process::id();
    match PROCESS.load(Ordering::Relaxed) {
        0 => Ok(()),
        pid if pid == ours => Ok(()),
        _ => Err(Error::Fork),
    }
}

/// Environment variables, as names and values, that must be set before the driver is loaded. Programs set them at
/// start-up: setting them is unsound once there are other threads.
///
/// Mesa's layer `VK_LAYER_MESA_device_select` asks Wayland for its device, and prints an error for each instance if
/// `XDG_RUNTIME_DIR` is not a folder, as on every machine without a display. The layer is switched off there, unless
/// the user has configured it: adapters are selected here by kind.
pub fn driver_settings() -> Vec<(&'static str, &'static str)> {
    let wayland = std::env::var_os("XDG_RUNTIME_DIR").is_some_and(|folder| std::path::Path::new(&folder).is_absolute());
    let configured = ["NODEVICE_SELECT", "MESA_VK_DEVICE_SELECT", "MESA_VK_DEVICE_SELECT_FORCE_DEFAULT_DEVICE"];
    let configured = configured.into_iter().any(|name| std::env::var_os(name).is_some());
    if wayland || configured { Vec::new() } else { vec![("NODEVICE_SELECT", "1")] }
}

/// wgpu instance, the connection to the drivers.
pub(super) fn instance() -> &'static wgpu::Instance {
    INSTANCE.get_or_init(|| {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        // OpenGL is not compiled in.
        descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
        wgpu::Instance::new(descriptor)
    })
}

/// Adapters, best first: discrete, integrated, virtual, other, CPU.
pub(super) fn enumerate() -> Result<Vec<wgpu::Adapter>> {
    check_fork()?;
    PROCESS.store(std::process::id(), Ordering::Relaxed);
    let instance = instance();
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

pub(super) fn describe(adapter: &wgpu::Adapter) -> AdapterInfo {
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

/// Usable adapters, best first.
///
/// Returns [`Error::Fork`] in a forked child.
pub fn adapters() -> Result<Vec<AdapterInfo>> {
    Ok(enumerate()?.iter().map(describe).collect())
}

/// Index of the requested adapter. `wanted` is an index, a kind, or a part of its name, driver or PCI address; None
/// selects the first.
pub(super) fn choose(adapters: &[AdapterInfo], wanted: Option<&str>) -> Result<usize> {
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
