//! Compute kernels with resources bound by name. WGSL alone defines binding numbers, workgroup sizes and the `override`
//! constants that a kernel is specialized for; reflection reads them.

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
use super::link::{Import, Linked};
use crate::error::{Error, Result};

/// Pass and entry point.
pub(crate) type Name = (&'static str, &'static str);

/// Resource for a variable of a kernel.
#[derive(Clone)]
pub(crate) enum Binding {
    Buffer(wgpu::Buffer),
    View(wgpu::TextureView),
    Sampler(wgpu::Sampler),
    /// Words of a uniform block, uploaded with the recording.
    Block(Arc<[u32]>),
    /// Range of indirect-dispatch arguments, by number.
    Arguments(Range<u32>),
}

/// Resources by variable name.
pub(crate) type Bindings = Vec<(&'static str, Binding)>;

impl Binding {
    /// Binding of a uniform block.
    pub fn block(words: &[u32]) -> Self {
        Self::Block(words.into())
    }

    /// Size in bytes of the buffer, or of the texture with its mips, without padding by the driver.
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

/// Specialization table: values of `override` constants by name. A kernel is compiled for the constants that it reads:
/// unused features are compiled out instead of branched over.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Specialization {
    values: Vec<(&'static str, f64)>,
    /// Files that are linked for names of imports.
    pub imports: Vec<Import>,
}

impl Specialization {
    /// Table of the given values.
    pub fn new(values: impl IntoIterator<Item = (&'static str, f64)>, imports: Vec<Import>) -> Self {
        Self { values: values.into_iter().collect(), imports }
    }

    /// Copy with some values replaced or added.
    pub fn with(&self, values: &[(&'static str, f64)]) -> Arc<Self> {
        let mut table = self.clone();
        for (name, value) in values {
            match table.values.iter_mut().find(|(key, _)| key == name) {
                Some((_, old)) => *old = *value,
                None => table.values.push((name, *value)),
            }
        }
        Arc::new(table)
    }

    /// Names of the constants.
    #[cfg(test)]
    pub fn names(&self) -> impl Iterator<Item = &'static str> {
        self.values.iter().map(|(name, _)| *name)
    }

    fn get(&self, name: &str) -> Option<f64> {
        self.values.iter().find(|(key, _)| *key == name).map(|(_, value)| *value)
    }
}

/// Shader module of a pass on the device, and its entry points.
pub(crate) struct Program {
    shader: wgpu::ShaderModule,
    entries: HashMap<String, Entry>,
    /// Imports that a specialization table has resolved.
    imports: Vec<Import>,
}

/// Reflection of an entry point.
struct Entry {
    workgroup: [u32; 3],
    variables: Vec<Variable>,
    /// Names of the `override` constants that it reads.
    constants: Vec<String>,
}

#[derive(Clone)]
struct Variable {
    name: String,
    number: u32,
    /// Dimension of a texture; None for other variables.
    dimension: Option<ImageDimension>,
}

/// Identity of a kernel: pass, entry point, and bits of the values of the constants that it reads.
pub(crate) type Key = (String, String, Vec<Option<u64>>);

impl Program {
    /// Links and validates a pass.
    pub fn new(gpu: &Gpu, pass: &str, imports: &[Import]) -> Result<Self> {
        let linked = Linked::new(&format!("passes/{pass}"), imports, gpu.generated).map_err(Error::Device)?;
        Self::from_linked(gpu, &linked)
    }

    /// Program of linked source.
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
        // Reuses the parsed module.
        let source = wgpu::ShaderSource::Naga(Cow::Owned(module));
        let descriptor = wgpu::ShaderModuleDescriptor { label: None, source };
        let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..Default::default() };
        // SAFETY: only loop bounding is off. It adds a counter to every loop (ten times the time on some drivers,
        // gfx-rs/wgpu#7698). All shaders are part of this crate, and each of their loops terminates. Bounds checks stay
        // on.
        let shader = unsafe { gpu.device.create_shader_module_trusted(descriptor, checks) };
        Ok(Self { shader, entries, imports: linked.resolved.clone() })
    }

    fn entry(&self, name: &str) -> Result<&Entry> {
        self.entries.get(name).ok_or_else(|| Error::Device(format!("no kernel named {name:?}")))
    }

    /// Identity of the kernel of an entry point with a specialization table.
    pub fn key(&self, (pass, entry): (&str, &str), specialization: &Specialization) -> Result<Key> {
        let values = self.entry(entry)?.constants.iter().map(|name| specialization.get(name).map(f64::to_bits));
        let files = self.imports.iter().map(|(_, file)| *file);
        let program: Vec<_> = std::iter::once(pass).chain(files).collect();
        Ok((program.join(" "), entry.to_owned(), values.collect()))
    }

    /// Compiles an entry point for a specialization table.
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

/// Names of the `override` constants read by a function and its callees.
fn used_constants(module: &Module, function: &Function) -> Vec<String> {
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    let mut functions = vec![function];
    while let Some(function) = functions.pop() {
        let read = function.expressions.iter().filter_map(|(_, expression)| override_of(expression));
        found.extend(read);
        visit_calls(&function.body, &mut |handle| {
            if seen.insert(handle) {
                functions.push(&module.functions[handle]);
            }
        });
    }
    // Initializers of constants may read further constants.
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

/// Visits each call in a block, nested blocks included.
fn visit_calls(block: &Block, visit: &mut impl FnMut(Handle<Function>)) {
    for statement in block {
        match statement {
            Statement::Call { function, .. } => visit(*function),
            Statement::Block(inner) => visit_calls(inner, visit),
            Statement::If { accept, reject, .. } => {
                [accept, reject].into_iter().for_each(|block| visit_calls(block, visit));
            }
            Statement::Switch { cases, .. } => cases.iter().for_each(|case| visit_calls(&case.body, visit)),
            Statement::Loop { body, continuing, .. } => {
                [body, continuing].into_iter().for_each(|block| visit_calls(block, visit));
            }
            _ => {}
        }
    }
}

/// Variables that an entry point uses.
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

/// Compute pipeline with the variables that it uses.
pub struct Kernel {
    /// Name in timings, benches and GPU debuggers.
    pub label: String,
    pub(crate) workgroup: [u32; 3],
    pub(crate) pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    variables: Vec<Variable>,
}

impl Kernel {
    /// Whether it binds a resource whose name has a prefix.
    pub(crate) fn reads(&self, prefix: &str) -> bool {
        self.variables.iter().any(|variable| variable.name.starts_with(prefix))
    }
}

/// Buffers of the uniform blocks and of the dispatch arguments of a recording.
pub(crate) struct Resources<'a> {
    pub blocks: &'a wgpu::Buffer,
    pub offsets: &'a HashMap<*const u32, u64>,
    pub arguments: &'a wgpu::Buffer,
    /// Bytes between consecutive dispatch arguments.
    pub stride: u64,
}

impl Kernel {
    /// Bind group with the first resource of the name of each used variable. Missing samplers default to those of the
    /// device; missing textures, which the kernel declares but does not read, to a placeholder of one texel.
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

/// Entry for a kernel: compiled, or empty while the holder of the lock compiles it.
type Slot = Arc<Mutex<Option<Arc<Kernel>>>>;

/// Cache of kernels with the number of their last use.
#[derive(Default)]
struct KernelCache {
    slots: HashMap<Key, (Slot, u64)>,
    uses: u64,
}

/// Programs and kernels of a device.
#[derive(Default)]
struct Kernels {
    programs: Mutex<HashMap<&'static str, Vec<Arc<Program>>>>,
    cache: Mutex<KernelCache>,
}

/// Maximum number of cached kernels. On lavapipe a kernel takes 2 to 3 MB; a picture has ten to thirty.
const MAX_KERNELS: usize = 48;

impl KernelCache {
    /// Evicts the least recently used kernels above the limit.
    fn evict(&mut self) {
        while self.slots.len() > MAX_KERNELS {
            let Some(oldest) = self.slots.iter().min_by_key(|(_, (_, last_use))| *last_use) else { return };
            let key = oldest.0.clone();
            self.slots.remove(&key);
        }
    }
}

impl Gpu {
    /// Program of a pass, linked and validated on first use.
    fn program(&self, pass: &'static str, imports: &[Import]) -> Result<Arc<Program>> {
        let kernels = self.common::<Kernels>();
        let same = |program: &&Arc<Program>| program.imports.iter().all(|import| imports.contains(import));
        if let Some(program) = lock(&kernels.programs).entry(pass).or_default().iter().find(same) {
            return Ok(program.clone());
        }
        let program = Arc::new(Program::new(self, pass, imports)?);
        let mut programs = lock(&kernels.programs);
        let programs = programs.entry(pass).or_default();
        // Another thread may have linked it meanwhile.
        if let Some(other) = programs.iter().find(same) {
            return Ok(other.clone());
        }
        programs.push(program.clone());
        Ok(program)
    }

    fn slot(&self, name: Name, specialization: &Specialization) -> Result<(Arc<Program>, Slot)> {
        let program = self.program(name.0, &specialization.imports)?;
        let key = program.key(name, specialization)?;
        let common = self.common::<Kernels>();
        let mut kernels = lock(&common.cache);
        let use_number = kernels.uses;
        kernels.uses += 1;
        let (slot, last_use) = kernels.slots.entry(key).or_default();
        *last_use = use_number;
        let slot = slot.clone();
        kernels.evict();
        Ok((program, slot))
    }

    /// Kernel, compiled on first use.
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

    /// Whether a kernel is compiled.
    pub(crate) fn is_compiled(&self, name: Name, specialization: &Specialization) -> Result<bool> {
        let (_, slot) = self.slot(name, specialization)?;
        // The entry is locked during compilation.
        Ok(slot.try_lock().is_ok_and(|slot| slot.is_some()))
    }

    /// Drops all programs and kernels, so that the shaders are read again.
    pub(crate) fn forget_kernels(&self) {
        let kernels = self.common::<Kernels>();
        lock(&kernels.programs).clear();
        lock(&kernels.cache).slots.clear();
    }
}
