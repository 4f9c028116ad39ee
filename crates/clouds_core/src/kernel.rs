//! A compute pipeline whose resources are bound by name: binding numbers and workgroup sizes stand in WGSL alone.

use std::borrow::Cow;

use crate::error::{Error, Result};
use crate::frame::Frame;
use crate::gpu::Gpu;
use crate::params::{Model, Params, Phase, Quality, WeatherNoise};
use crate::passes::reproject;
use crate::shader::Linked;
use wgpu::naga::{AddressSpace, Module, valid::ModuleInfo};

/// Something that a kernel can be given for one of its variables.
#[derive(Clone, Copy)]
pub(crate) enum Binding<'a> {
    Buffer(&'a wgpu::Buffer),
    View(&'a wgpu::TextureView),
    Sampler(&'a wgpu::Sampler),
}

impl Binding<'_> {
    /// Bytes of the buffer, or of the texture with its mips: what they hold, without what drivers pad.
    pub fn bytes(self) -> u64 {
        let texture = match self {
            Self::Buffer(buffer) => return buffer.size(),
            Self::View(view) => view.texture(),
            Self::Sampler(_) => return 0,
        };
        let texel = u64::from(texture.format().block_copy_size(None).unwrap_or(0));
        let texels = |mip| {
            let size = texture.size().mip_level_size(mip, texture.dimension());
            u64::from(size.width) * u64::from(size.height) * u64::from(size.depth_or_array_layers)
        };
        texel * (0..texture.mip_level_count()).map(texels).sum::<u64>()
    }
}

impl<'a> From<&'a wgpu::Buffer> for Binding<'a> {
    fn from(buffer: &'a wgpu::Buffer) -> Self {
        Self::Buffer(buffer)
    }
}

impl<'a> From<&'a wgpu::TextureView> for Binding<'a> {
    fn from(view: &'a wgpu::TextureView) -> Self {
        Self::View(view)
    }
}

impl<'a> From<&'a wgpu::Sampler> for Binding<'a> {
    fn from(sampler: &'a wgpu::Sampler) -> Self {
        Self::Sampler(sampler)
    }
}

/// What a pipeline is made for: the values of the `override` constants of `bindings.wgsl`. What a picture does not need is
/// compiled out, not branched over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct Variant {
    /// The light model.
    pub model: Model,
    /// The phase function of the clouds.
    pub phase: Phase,
    /// Whether the clouds are the user's grid.
    pub volume: bool,
    /// Whether that grid is read in f32.
    pub precise: bool,
    /// Whether there is a spot to keep clear.
    pub keep_clear: bool,
    /// Whether there is air.
    pub air: bool,
    /// Whether the sun can reach the clouds.
    pub sunlit: bool,
    /// Whether it may rain.
    pub rainy: bool,
    /// Whether rain is seen.
    pub rain_shafts: bool,
    /// Whether there is a second deck.
    pub upper: bool,
    /// Whether a larger map shifts the weather.
    pub broad: bool,
    /// Whether the profile by height is the user's table.
    pub profile_table: bool,
    /// Whether clouds cast shadows on the air.
    pub beams: bool,
    /// Whether there is a scene of the user's.
    pub scene: bool,
    /// Whether pixels may be wider than clouds.
    pub subrays: bool,
    /// Whether the clouds are known at the corners of cells of pixels alone.
    pub sparse: bool,
    /// Whether there are light samples that see the detail.
    pub light_detail: bool,
    /// Whether there are light samples that do not.
    pub light_cheap: bool,
    /// The projection of the camera, for kernels that know pixels.
    pub camera: u32,
    /// Whether there are high clouds, for `composite`.
    pub high: bool,
    /// Whether those are embossed, for `composite`.
    pub high_emboss: bool,
    /// Whether the sun is so low that each of those has its own sunlight, for `composite`.
    pub high_low_sun: bool,
    /// Whether nothing has been marched, for `composite`.
    pub cloudless: bool,
    /// Whether clouds cast shadows on the ground in sight, for `composite`.
    pub ground_shadow: bool,
    /// Whether the sky and the depth are asked for, for `composite`.
    pub layers: bool,
    /// Whether the sky varies within a pixel, for `composite`.
    pub wide: bool,
    /// Whether the pixels are those of a disc of light, for `composite`.
    pub discs: bool,
    /// Whether the phase function varies within a pixel.
    pub wide_phase: bool,
    /// Which noises a weather map is baked from, for `weather`.
    pub weather_noise: WeatherNoise,
}

impl Variant {
    /// What a picture needs.
    pub fn new(params: &Params, quality: &Quality) -> Self {
        let model = params.light.model;
        Self {
            model,
            phase: params.light.phase,
            volume: params.volume.is_some(),
            keep_clear: params.clear_spot().1 > 0.0 && params.volume.is_none(),
            precise: quality.tolerance > 0.0 || model == Model::Path,
            air: params.atmosphere.enabled,
            sunlit: true,
            rainy: params.is_rainy(),
            rain_shafts: params.has_rain_shafts(),
            upper: params.has_upper_clouds(),
            broad: params.has_broad_weather(),
            profile_table: params.clouds.profile.is_some() && params.volume.is_none(),
            beams: false,
            scene: false,
            subrays: false,
            sparse: false,
            light_detail: quality.cheap_light > 0.0,
            light_cheap: quality.cheap_light < 1.0 || quality.far_sample || quality.light_distance <= 0.0,
            // What single passes ask for beside.
            camera: 0,
            high: false,
            high_emboss: false,
            high_low_sun: false,
            cloudless: false,
            ground_shadow: false,
            layers: false,
            wide: false,
            discs: false,
            wide_phase: false,
            weather_noise: WeatherNoise::WorleyPerlin,
        }
    }

    /// What a bake needs that knows no picture.
    pub fn bake() -> Self {
        Self::new(&Params::default(), &Quality::default())
    }

    /// What a picture needs that is seen in a frame.
    pub fn of_frame(params: &Params, quality: &Quality, frame: &Frame) -> Self {
        Self {
            sunlit: frame.sunlit(params),
            camera: frame.camera_kind,
            beams: frame.beams > 0,
            scene: frame.scene > 0,
            subrays: params.volume.is_none() && frame.has_subrays(),
            sparse: frame.sparse > 0,
            wide_phase: frame.phase_samples > 1,
            ..Self::new(params, quality)
        }
    }

    fn constants(self) -> [(&'static str, f64); 30] {
        let switch = |on| f64::from(u8::from(on));
        [
            ("MODEL", f64::from(self.model as u32)),
            ("PHASE", f64::from(self.phase as u32)),
            ("VOLUME", switch(self.volume)),
            ("KEEP_CLEAR", switch(self.keep_clear)),
            ("PRECISE", switch(self.precise)),
            ("AIR", switch(self.air)),
            ("SUNLIT", switch(self.sunlit)),
            ("RAINY", switch(self.rainy)),
            ("RAIN_SHAFTS", switch(self.rain_shafts)),
            ("UPPER", switch(self.upper)),
            ("BROAD_WEATHER", switch(self.broad)),
            ("PROFILE_TABLE", switch(self.profile_table)),
            ("BEAMS", switch(self.beams)),
            ("SCENE", switch(self.scene)),
            ("SUBRAYS", switch(self.subrays)),
            ("SPARSE", switch(self.sparse)),
            ("STRIDE", f64::from(reproject::stride(self.sparse))),
            ("LIGHT_DETAIL", switch(self.light_detail)),
            ("LIGHT_CHEAP", switch(self.light_cheap)),
            ("CAMERA", f64::from(self.camera)),
            ("HIGH", switch(self.high)),
            ("HIGH_EMBOSS", switch(self.high_emboss)),
            ("HIGH_LOW_SUN", switch(self.high_low_sun)),
            ("CLOUDLESS", switch(self.cloudless)),
            ("GROUND_SHADOW", switch(self.ground_shadow)),
            ("LAYERS", switch(self.layers)),
            ("WIDE", switch(self.wide)),
            ("DISCS", switch(self.discs)),
            ("WIDE_PHASE", switch(self.wide_phase)),
            ("WEATHER_NOISE", f64::from(self.weather_noise as u32)),
        ]
    }
}

/// A kernel of a pass, and what it is made for.
pub(crate) type Wanted = (&'static str, &'static str, Variant);

/// A compute pipeline and the variables that it uses.
pub struct Kernel {
    /// Name in timings, benches and GPU debuggers.
    pub label: String,
    pub(crate) workgroup: [u32; 3],
    pub(crate) pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    variables: Vec<(String, u32)>,
}

/// The variables that an entry point uses, with their binding numbers.
fn used_variables(module: &Module, info: &ModuleInfo, entry: usize) -> Vec<(String, u32)> {
    let uses = info.get_entry_point(entry);
    let mut variables = Vec::new();
    for (handle, variable) in module.global_variables.iter() {
        if let (false, Some(binding), Some(name)) = (uses[handle].is_empty(), variable.binding, &variable.name)
            && !matches!(variable.space, AddressSpace::WorkGroup | AddressSpace::Private)
        {
            variables.push((name.clone(), binding.binding));
        }
    }
    variables
}

impl Kernel {
    /// Links, validates and compiles the kernel `entry` of a pass.
    pub(crate) fn new(gpu: &Gpu, pass: &str, entry: &str, variant: Variant) -> Result<Self> {
        let linked = Linked::new(&format!("passes/{pass}")).map_err(Error::Device)?;
        Self::from_linked(gpu, &linked, entry, variant)
    }

    #[expect(clippy::disallowed_methods, reason = "the one place that makes pipelines")]
    pub(crate) fn from_linked(gpu: &Gpu, linked: &Linked, entry: &str, variant: Variant) -> Result<Self> {
        let (module, info) = linked.parse().map_err(Error::Device)?;
        let index = module
            .entry_points
            .iter()
            .position(|point| point.name == entry)
            .ok_or_else(|| Error::Device(format!("no kernel named {entry:?}")))?;
        let workgroup = module.entry_points[index].workgroup_size;
        let variables = used_variables(&module, &info, index);
        let declared = |name: &str| module.overrides.iter().any(|(_, o)| o.name.as_deref() == Some(name));
        let constants: Vec<_> = variant.constants().into_iter().filter(|(name, _)| declared(name)).collect();
        let descriptor = wgpu::ShaderModuleDescriptor {
            label: Some(entry),
            // What has been parsed already, not the text.
            source: wgpu::ShaderSource::Naga(Cow::Owned(module)),
        };
        let checks = wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..Default::default() };
        // SAFETY: only loop bounding is off, which costs a counter in every loop (ten times the time on some drivers,
        // gfx-rs/wgpu#7698). The shaders are this crate's own, and each of their loops ends. Bounds checks stay.
        let shader = unsafe { gpu.device.create_shader_module_trusted(descriptor, checks) };
        let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(entry),
            layout: None,
            module: &shader,
            entry_point: Some(entry),
            compilation_options: wgpu::PipelineCompilationOptions {
                zero_initialize_workgroup_memory: false,
                constants: &constants,
            },
            cache: gpu.pipelines.cache(),
        });
        let layout = pipeline.get_bind_group_layout(0);
        gpu.check()?;
        Ok(Self { label: entry.to_owned(), workgroup, pipeline, layout, variables })
    }

    /// A bind group with each used variable's resource. Samplers that are not given bind themselves.
    pub(crate) fn bind(&self, gpu: &Gpu, bindings: &[(&str, Binding<'_>)]) -> Result<wgpu::BindGroup> {
        let mut entries = Vec::new();
        for (name, number) in &self.variables {
            let given = bindings.iter().find(|(given, _)| given == name).map(|(_, binding)| *binding);
            let resource = match (given, name.as_str()) {
                (Some(Binding::Buffer(buffer)), _) => buffer.as_entire_binding(),
                (Some(Binding::View(view)), _) => wgpu::BindingResource::TextureView(view),
                (Some(Binding::Sampler(sampler)), _) => wgpu::BindingResource::Sampler(sampler),
                (None, "repeat_sampler") => wgpu::BindingResource::Sampler(&gpu.repeat_sampler),
                (None, "clamp_sampler") => wgpu::BindingResource::Sampler(&gpu.clamp_sampler),
                (None, _) => return Err(Error::Device(format!("{}: nothing bound to {name}", self.label))),
            };
            entries.push(wgpu::BindGroupEntry { binding: *number, resource });
        }
        let descriptor =
            wgpu::BindGroupDescriptor { label: Some(&self.label), layout: &self.layout, entries: &entries };
        Ok(gpu.device.create_bind_group(&descriptor))
    }
}
