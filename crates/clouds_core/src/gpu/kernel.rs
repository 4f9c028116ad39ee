//! A compute pipeline whose resources are bound by name: binding numbers and workgroup sizes stand in WGSL alone, and so does
//! which `override` constants a kernel is compiled for.

use std::borrow::Cow;
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::sync::{Arc, Mutex};

use wgpu::naga::valid::ModuleInfo;
use wgpu::naga::{
    AddressSpace, Block, Expression, Function, Handle, ImageDimension, Module, Override, Statement, TypeInner,
};

use super::adapter::lock;
use super::device::Gpu;
use super::link::Linked;
use crate::error::{Error, Result};

/// A pass, and an entry point of it.
pub(crate) type Name = (&'static str, &'static str);

/// Something that a kernel can be given for one of its variables.
#[derive(Clone)]
pub(crate) enum Binding {
    Buffer(wgpu::Buffer),
    View(wgpu::TextureView),
    Sampler(wgpu::Sampler),
    /// The words of a uniform block, which is put on the device with the recording.
    Block(Arc<[u32]>),
    /// Arguments of indirect dispatches, by number.
    Arguments(Range<u32>),
}

/// Variables by name.
pub(crate) type Bindings = Vec<(&'static str, Binding)>;

impl Binding {
    /// A uniform block.
    pub fn block(words: &[u32]) -> Self {
        Self::Block(words.into())
    }

    /// Bytes of the buffer, or of the texture with its mips: what they hold, without what drivers pad.
    pub fn bytes(&self) -> u64 {
        let texture = match self {
            Self::Buffer(buffer) => return buffer.size(),
            Self::Block(words) => return 4 * words.len() as u64,
            Self::View(view) => view.texture(),
            Self::Sampler(_) | Self::Arguments(_) => return 0,
        };
        let texel = u64::from(texture.format().block_copy_size(None).unwrap_or(0));
        let texels = |mip| {
            let size = texture.size().mip_level_size(mip, texture.dimension());
            u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers)
        };
        texel * (0..texture.mip_level_count()).map(texels).sum::<u64>()
    }
}

impl From<&wgpu::Buffer> for Binding {
    fn from(buffer: &wgpu::Buffer) -> Self {
        Self::Buffer(buffer.clone())
    }
}

impl From<&wgpu::TextureView> for Binding {
    fn from(view: &wgpu::TextureView) -> Self {
        Self::View(view.clone())
    }
}

impl From<&wgpu::Sampler> for Binding {
    fn from(sampler: &wgpu::Sampler) -> Self {
        Self::Sampler(sampler.clone())
    }
}

/// Values of `override` constants by name. A kernel is compiled for those of them that it reads: what a picture does not need
/// is compiled out, not branched over.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Specialization(Vec<(&'static str, f64)>);

impl Specialization {
    /// A table.
    pub fn new(values: impl IntoIterator<Item = (&'static str, f64)>) -> Self {
        Self(values.into_iter().collect())
    }

    /// The same with other values.
    pub fn with(&self, values: &[(&'static str, f64)]) -> Arc<Self> {
        let mut table = self.clone();
        for (name, value) in values {
            match table.0.iter_mut().find(|(known, _)| known == name) {
                Some((_, old)) => *old = *value,
                None => table.0.push((name, *value)),
            }
        }
        Arc::new(table)
    }

    /// The names of the constants.
    #[cfg(test)]
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.0.iter().map(|(name, _)| *name)
    }

    fn get(&self, name: &str) -> Option<f64> {
        self.0.iter().find(|(known, _)| *known == name).map(|(_, value)| *value)
    }
}

/// A pass: its module on the device, and its entry points.
pub(crate) struct Program {
    shader: wgpu::ShaderModule,
    entries: HashMap<String, Entry>,
}

/// What reflection says of an entry point.
struct Entry {
    workgroup: [u32; 3],
    variables: Vec<Variable>,
    /// The constants that it reads.
    constants: Vec<String>,
}

#[derive(Clone)]
struct Variable {
    name: String,
    number: u32,
    /// Of a texture.
    dimension: Option<ImageDimension>,
}

/// Which kernel of a device: pass, entry and the values of the constants that it reads, by their bits.
pub(crate) type Key = (String, String, Vec<Option<u64>>);

impl Program {
    /// Links and validates a pass.
    pub fn new(gpu: &Gpu, pass: &str) -> Result<Self> {
        let linked = Linked::new(&format!("passes/{pass}"), gpu.generated).map_err(Error::Device)?;
        Self::from_linked(gpu, &linked)
    }

    /// The same of linked source.
    pub fn from_linked(gpu: &Gpu, linked: &Linked) -> Result<Self> {
        let (module, info) = linked.parse().map_err(Error::Device)?;
        let entries = module.entry_points.iter().enumerate().map(|(index, point)| {
            let entry = Entry {
                workgroup: point.workgroup_size,
                variables: used_variables(&module, &info, index),
                constants: used_constants(&module, &point.function),
            };
            (point.name.clone(), entry)
        });
        let entries = entries.collect();
        // What has been parsed already, not the text.
        let source = wgpu::ShaderSource::Naga(Cow::Owned(module));
        let descriptor = wgpu::ShaderModuleDescriptor { label: None, source };
        let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..Default::default() };
        // SAFETY: only loop bounding is off, which costs a counter in every loop (ten times the time on some drivers,
        // gfx-rs/wgpu#7698). The shaders are this crate's own, and each of their loops ends. Bounds checks stay.
        let shader = unsafe { gpu.device.create_shader_module_trusted(descriptor, checks) };
        Ok(Self { shader, entries })
    }

    fn entry(&self, name: &str) -> Result<&Entry> {
        self.entries.get(name).ok_or_else(|| Error::Device(format!("no kernel named {name:?}")))
    }

    /// Which kernel a table asks for.
    pub fn key(&self, (pass, entry): (&str, &str), specialization: &Specialization) -> Result<Key> {
        let values = self.entry(entry)?.constants.iter().map(|name| specialization.get(name).map(f64::to_bits));
        Ok((pass.to_owned(), entry.to_owned(), values.collect()))
    }

    /// Compiles an entry point.
    #[expect(clippy::disallowed_methods, reason = "the one place that makes pipelines")]
    pub fn compile(&self, gpu: &Gpu, name: &str, specialization: &Specialization) -> Result<Kernel> {
        let entry = self.entry(name)?;
        let names = entry.constants.iter().map(String::as_str);
        let constants: Vec<_> = names.filter_map(|name| Some((name, specialization.get(name)?))).collect();
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(name),
            layout: None,
            module: &self.shader,
            entry_point: Some(name),
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                constants: &constants,
            },
            cache: gpu.pipelines.cache(),
        });
        let layout = pipeline.get_bind_group_layout(0);
        gpu.check()?;
        let (workgroup, variables) = (entry.workgroup, entry.variables.clone());
        Ok(Kernel { label: name.to_owned(), workgroup, pipeline, layout, variables })
    }
}

/// The constants that a function and those that it calls read.
fn used_constants(module: &Module, function: &Function) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    let mut functions = vec![function];
    while let Some(function) = functions.pop() {
        let read = function.expressions.iter().filter_map(|(_, expression)| override_of(expression));
        found.extend(read);
        called(&function.body, &mut |handle| {
            if seen.insert(handle) {
                functions.push(&module.functions[handle]);
            }
        });
    }
    // A constant may be worked out from others.
    let mut names = BTreeSet::new();
    while let Some(handle) = found.pop() {
        let constant = &module.overrides[handle];
        if names.insert(constant.name.clone().unwrap_or_default())
            && let Some(init) = constant.init
        {
            let mut expressions = vec![init];
            while let Some(expression) = expressions.pop() {
                match &module.global_expressions[expression] {
                    Expression::Unary { expr, .. } | Expression::As { expr, .. } => expressions.push(*expr),
                    Expression::Binary { left, right, .. } => expressions.extend([*left, *right]),
                    other => found.extend(override_of(other)),
                }
            }
        }
    }
    names.into_iter().collect()
}

fn override_of(expression: &Expression) -> Option<Handle<Override>> {
    match expression {
        Expression::Override(handle) => Some(*handle),
        _ => None,
    }
}

/// Tells `tell` of each call in a block.
fn called(block: &Block, tell: &mut impl FnMut(Handle<Function>)) {
    for statement in block {
        match statement {
            Statement::Call { function, .. } => tell(*function),
            Statement::Block(inner) => called(inner, tell),
            Statement::If { accept, reject, .. } => [accept, reject].into_iter().for_each(|block| called(block, tell)),
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| called(&case.body, tell)),
            Statement::Loop { body, continuing, .. } => {
                [body, continuing].into_iter().for_each(|block| called(block, tell));
            }
            _ => {}
        }
    }
}

/// The variables that an entry point uses.
fn used_variables(module: &Module, info: &ModuleInfo, entry: usize) -> Vec<Variable> {
    let uses = info.get_entry_point(entry);
    let mut variables = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        if let (false, Some(binding), Some(name)) = (uses[handle].is_empty(), variable.binding, &variable.name)
            && !matches!(variable.space, AddressSpace::WorkGroup | AddressSpace::Private)
        {
            let dimension = match module.types[variable.ty].inner {
                TypeInner::Image { dim, .. } => Some(dim),
                _ => None,
            };
            variables.push(Variable { name: name.clone(), number: binding.binding, dimension });
        }
    }
    variables
}

/// A compute pipeline and the variables that it uses.
pub struct Kernel {
    /// Name in timings, benches and GPU debuggers.
    pub label: String,
    pub(crate) workgroup: [u32; 3],
    pub(crate) pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    variables: Vec<Variable>,
}

/// Where the blocks and the arguments of a recording lie on the device.
pub(crate) struct Resources<'a> {
    pub blocks: &'a wgpu::Buffer,
    pub offsets: &'a HashMap<*const u32, u64>,
    pub arguments: &'a wgpu::Buffer,
    /// Bytes from one set of arguments to the next.
    pub stride: u64,
}

impl Kernel {
    /// A bind group with each used variable's resource: the first of its name. Samplers that are not given bind themselves, and a
    /// texture that is not given, which a kernel could read and does not, is one texel.
    pub(crate) fn bind(
        &self,
        gpu: &Gpu,
        bindings: &[(&'static str, Binding)],
        resources: &Resources<'_>,
    ) -> Result<wgpu::BindGroup> {
        let mut entries = Vec::new();
        for Variable { name, number, dimension } in &self.variables {
            let given = bindings.iter().find(|(given, _)| given == name).map(|(_, binding)| binding);
            let part = |buffer, offset, size| {
                wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset,
                    size: std::num::NonZero::new(size),
                })
            };
            let resource = match (given, name.as_str(), dimension) {
                (Some(Binding::Buffer(buffer)), ..) => buffer.as_entire_binding(),
                (Some(Binding::View(view)), ..) => wgpu::BindingResource::TextureView(view),
                (Some(Binding::Sampler(sampler)), ..) => wgpu::BindingResource::Sampler(sampler),
                (Some(Binding::Block(words)), ..) => {
                    part(resources.blocks, resources.offsets[&words.as_ptr()], 4 * words.len() as u64)
                }
                (Some(Binding::Arguments(range)), ..) => {
                    let stride = resources.stride;
                    part(resources.arguments, stride * u64::from(range.start), stride * range.len() as u64)
                }
                (None, "repeat_sampler", _) => wgpu::BindingResource::Sampler(&gpu.repeat_sampler),
                (None, "clamp_sampler", _) => wgpu::BindingResource::Sampler(&gpu.clamp_sampler),
                (None, _, Some(ImageDimension::D3)) => wgpu::BindingResource::TextureView(&gpu.nothing[1]),
                (None, _, Some(_)) => wgpu::BindingResource::TextureView(&gpu.nothing[0]),
                (None, ..) => return Err(Error::Device(format!("{}: nothing bound to {name}", self.label))),
            };
            entries.push(wgpu::BindGroupEntry { binding: *number, resource });
        }
        let descriptor =
            wgpu::BindGroupDescriptor { label: Some(&self.label), layout: &self.layout, entries: &entries };
        Ok(gpu.device.create_bind_group(&descriptor))
    }
}

/// A kernel that is there, or is being compiled by whoever holds the lock.
type Slot = Arc<Mutex<Option<Arc<Kernel>>>>;

/// Kernels, each with the number of its last use.
#[derive(Default)]
struct Kept {
    slots: HashMap<Key, (Slot, u64)>,
    uses: u64,
}

/// Programs by name, and kernels, of a device.
#[derive(Default)]
struct Kernels {
    programs: Mutex<HashMap<&'static str, Arc<Program>>>,
    kept: Mutex<Kept>,
}

/// Most kernels that are kept: on lavapipe one takes 2 to 3 MB, and a picture has ten to thirty.
const MOST_KERNELS: usize = 48;

impl Kept {
    /// Forgets those whose last use is longest ago, where there are too many.
    fn forget(&mut self) {
        while self.slots.len() > MOST_KERNELS {
            let Some(oldest) = self.slots.iter().min_by_key(|(_, (_, last_use))| *last_use) else { return };
            let key = oldest.0.clone();
            self.slots.remove(&key);
        }
    }
}

impl Gpu {
    /// A pass, linked and validated on first use.
    fn program(&self, pass: &'static str) -> Result<Arc<Program>> {
        let kernels = self.common::<Kernels>();
        let known = lock(&kernels.programs).get(pass).cloned();
        if let Some(program) = known {
            return Ok(program);
        }
        let program = Arc::new(Program::new(self, pass)?);
        Ok(lock(&kernels.programs).entry(pass).or_insert(program).clone())
    }

    fn slot(&self, name: Name, specialization: &Specialization) -> Result<(Arc<Program>, Slot)> {
        let program = self.program(name.0)?;
        let key = program.key(name, specialization)?;
        let common = self.common::<Kernels>();
        let mut kernels = lock(&common.kept);
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

    /// Forgets what has been compiled, so that the shaders are read anew.
    pub(crate) fn forget_kernels(&self) {
        let kernels = self.common::<Kernels>();
        lock(&kernels.programs).clear();
        lock(&kernels.kept).slots.clear();
    }
}
