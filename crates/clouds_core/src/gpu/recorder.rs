//! Recorder: the GPU work of a picture, held as data until it is submitted.
//!
//! Dispatches, copies and readbacks are recorded in order. [`Recorder::submit`] compiles their kernels, encodes them,
//! and waits once, unless the work may keep the device busy for longer than [`SLICE_SECONDS`]. Longer work is
//! time-sliced into several submissions, so that no watchdog resets the device. The cost of a dispatch is estimated per
//! kernel, from timestamps of earlier dispatches.

use std::collections::HashMap;
use std::mem;
use std::num::NonZero;
use std::ops::Range;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Instant;

use super::adapter::lock;
use super::device::{COPIED, Download, Gpu, Interrupt, Timings, mips, texture_bytes};
use super::kernel::{Binding, Bindings, Kernel, Name, Resources, Specialization};
use crate::error::Result;
use crate::shared::constants;

/// Time budget of a submission in s, also of a dispatch over a list of maximum length: a quarter of the two seconds
/// after which Windows resets a device. Two submissions complete after Ctrl-C.
const SLICE_SECONDS: f64 = 0.5;
/// Maximum number of workgroups along one side of a dispatch (WebGPU's default limit).
const MAX_GROUPS: u32 = 65_535;
/// Alignment of uniform blocks in bytes (WebGPU's default limit).
const UNIFORM_ALIGNMENT: usize = 256;

constants! {
    /// Bytes between the arguments of consecutive indirect dispatches, so that each can be bound as a uniform.
    /// Arguments are the workgroups along each side and the number of invocations for the whole list.
    const ARGUMENT_STRIDE: u64 = UNIFORM_ALIGNMENT as u64;
    /// Invocations per workgroup of a dispatch over a list.
    const LIST_GROUP: u32 = 64;
    /// Invocations along each side of a workgroup of a grid dispatched conditionally or in slices of rows.
    const GRID_GROUP: u32 = 8;
}

/// Maximum number of timed dispatches of a recording: WebGPU allows 4,096 queries in a set.
const MAX_TIMED: usize = 2048;

/// Tells whether a recording has been submitted: a LUT whose recording was dropped does not exist.
#[derive(Clone, Default)]
pub(crate) struct Token(Arc<AtomicBool>);

impl Token {
    /// Whether the recording has been submitted.
    pub fn is_submitted(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// List filled by kernels; the entries are in another buffer.
pub(crate) struct List<'a> {
    pub count: &'a wgpu::Buffer,
    /// Maximum number of entries.
    pub most: u32,
    /// Invocations per entry.
    pub each: u32,
    /// Typical number of entries, as a fraction of the maximum.
    pub likely: f64,
}

/// Kernel of a dispatch.
#[derive(Clone)]
pub(crate) enum Which {
    /// Kernel of a pass with a specialization table.
    Named(Name, Arc<Specialization>),
    /// Compiled kernel.
    Made(Arc<Kernel>),
}

/// Size of a dispatch in invocations.
#[derive(Clone, Copy)]
enum Extent {
    Grid([u32; 3]),
    /// Number of the dispatch arguments, and the expected number of invocations.
    Indirect(u32, f64),
}

enum Step {
    Dispatch { which: Which, bindings: Bindings, extent: Extent },
    Clear(wgpu::Buffer),
    Fill { texture: wgpu::Texture, mip: u32, buffer: wgpu::Buffer },
    Copy { buffer: wgpu::Buffer, offset: u64, staging: wgpu::Buffer },
    CopyTexture { texture: wgpu::Texture, staging: wgpu::Buffer },
}

/// Kernel with its specialization table.
type PipelineRequest = (Name, Arc<Specialization>);

/// Handler of the bytes of a readback.
type ReadbackHandler = Box<dyn FnOnce(&[u8])>;

/// Recording of GPU work.
pub(crate) struct Recorder<'a> {
    pub gpu: &'a Gpu,
    /// Resources that every dispatch may bind, by name.
    scope: Bindings,
    specialization: Arc<Specialization>,
    /// Buffer whose value must not be 0 for grids to be dispatched.
    condition: Option<wgpu::Buffer>,
    steps: Vec<Step>,
    arguments: u32,
    /// Empty dispatches of kernels that later recordings may request.
    ahead: Vec<Step>,
    downloads: Vec<Download>,
    received: Vec<(usize, ReadbackHandler)>,
    token: Token,
    timings: &'a mut Timings,
    interrupt: Interrupt<'a>,
}

impl<'a> Recorder<'a> {
    /// Empty recording; the times of its kernels are added to `timings`.
    pub fn new(gpu: &'a Gpu, timings: &'a mut Timings, interrupt: Interrupt<'a>) -> Self {
        Self {
            gpu,
            scope: Bindings::new(),
            specialization: Arc::default(),
            condition: None,
            steps: Vec::new(),
            arguments: 0,
            ahead: Vec::new(),
            downloads: Vec::new(),
            received: Vec::new(),
            token: Token::default(),
            timings,
            interrupt,
        }
    }

    /// Binds resources for all further dispatches.
    pub fn bind(&mut self, bindings: impl IntoIterator<Item = (&'static str, Binding)>) {
        for (name, binding) in bindings {
            match self.scope.iter_mut().find(|(bound, _)| *bound == name) {
                Some((_, old)) => *old = binding,
                None => self.scope.push((name, binding)),
            }
        }
    }

    /// Names of the bound resources and their sizes in bytes.
    pub fn held(&self) -> Vec<(&'static str, u64)> {
        self.scope.iter().map(|(name, binding)| (*name, binding.bytes())).filter(|(_, bytes)| *bytes > 0).collect()
    }

    /// Sets the specialization table of further dispatches; returns the previous one.
    pub fn specialize(&mut self, specialization: Arc<Specialization>) -> Arc<Specialization> {
        mem::replace(&mut self.specialization, specialization)
    }

    /// Replaces or adds values in the specialization table of further dispatches; returns the previous table.
    pub fn specialize_with(&mut self, values: &[(&'static str, f64)]) -> Arc<Specialization> {
        let table = self.specialization.with(values);
        self.specialize(table)
    }

    /// Whether the results recorded with a token are available to further dispatches: submitted already, or earlier in
    /// this recording.
    pub fn has(&self, token: &Token) -> bool {
        token.is_submitted() || Arc::ptr_eq(&token.0, &self.token.0)
    }

    /// Token of the current recording.
    pub fn token(&self) -> Token {
        self.token.clone()
    }

    /// Dispatches a kernel over a grid of invocations, with bindings in addition to those of the scope.
    pub fn dispatch(&mut self, name: Name, bindings: Bindings, extent: [u32; 3]) {
        self.dispatch_kernel(Which::Named(name, self.specialization.clone()), bindings, extent);
    }

    /// Dispatches any kernel over a grid of invocations.
    pub fn dispatch_kernel(&mut self, which: Which, bindings: Bindings, extent: [u32; 3]) {
        let Some(condition) = self.condition.clone() else { return self.push(which, bindings, Extent::Grid(extent)) };
        let [x, y] = [extent[0], extent[1]].map(|along| along.div_ceil(GRID_GROUP));
        let argument = self.arguments;
        self.arguments += 1;
        let arrangement = Binding::block(&[x, y, 0, 0]);
        let own = vec![
            ("arrangement", arrangement),
            ("list_count", (&condition).into()),
            ("arguments", Binding::Arguments(argument..argument + 1)),
        ];
        self.push(Which::Named(("arrange", "arrange_grid"), Arc::default()), own, Extent::Grid([1; 3]));
        self.push(which, bindings, Extent::Indirect(argument, 0.0));
    }

    /// Dispatches a kernel over `rows` rows of `width` invocations, time-sliced by rows. `block` makes the uniform
    /// block of each slice, with its name.
    pub fn dispatch_rows(
        &mut self,
        name: Name,
        bindings: &Bindings,
        [width, rows]: [u32; 2],
        block: impl Fn(Range<u32>) -> (&'static str, Binding),
    ) {
        // Whole workgroups.
        let group = u64::from(GRID_GROUP);
        let most = self.gpu.most_invocations(name.1, SLICE_SECONDS) / u64::from(width) / group * group;
        let most = most.clamp(group, u64::from(MAX_GROUPS)) as u32;
        for first in (0..rows).step_by(most as usize) {
            let slice = first..(first + most).min(rows);
            let size = [width, slice.len() as u32, 1];
            self.dispatch(name, [&[block(slice)], bindings.as_slice()].concat(), size);
        }
    }

    /// Dispatches a kernel indirectly over the entries of a list, time-sliced, and clears the list. `block` makes the
    /// uniform block of each slice, with its name, from the index of the first invocation. `listed` holds the number of
    /// all invocations.
    pub fn dispatch_list(
        &mut self,
        name: Name,
        bindings: &Bindings,
        list: &List<'_>,
        block: impl Fn(u32) -> (&'static str, Binding),
    ) {
        let invocations = list.most * list.each;
        let most = self.gpu.most_invocations(name.1, SLICE_SECONDS) / u64::from(LIST_GROUP) * u64::from(LIST_GROUP);
        let most = most.clamp(LIST_GROUP.into(), (LIST_GROUP * MAX_GROUPS).into()) as u32;
        let slices = invocations.div_ceil(most);
        let first = self.arguments;
        self.arguments += slices;
        let arrangement = Binding::block(&[slices, most, list.each, 0]);
        let own = vec![
            ("arrangement", arrangement),
            ("list_count", list.count.into()),
            ("arguments", Binding::Arguments(first..self.arguments)),
        ];
        let arrange = Which::Named(("arrange", "arrange_list"), Arc::default());
        self.push(arrange, own, Extent::Grid([slices, 1, 1]));
        self.clear(list.count);
        for slice in 0..slices {
            let argument = first + slice;
            let own = [block(slice * most), ("listed", Binding::Arguments(argument..argument + 1))];
            let which = Which::Named(name, self.specialization.clone());
            // A conditional list is typically empty.
            let likely = if self.condition.is_some() { 0.0 } else { list.likely * f64::from(invocations) };
            let likely = (likely - f64::from(slice * most)).clamp(0.0, most.into());
            self.push(which, [&own, bindings.as_slice()].concat(), Extent::Indirect(argument, likely));
        }
    }

    /// Records work under a condition: its grids are dispatched only if the value of `condition` is not 0 on the
    /// device.
    pub fn when(&mut self, condition: &wgpu::Buffer, record: impl FnOnce(&mut Self)) {
        let outer = self.condition.replace(condition.clone());
        record(self);
        self.condition = outer;
    }

    fn push(&mut self, which: Which, bindings: Bindings, extent: Extent) {
        // Bindings of the dispatch take precedence over the scope.
        let bindings = [bindings, self.scope.clone()].concat();
        self.steps.push(Step::Dispatch { which, bindings, extent });
    }

    /// Records work of the next picture whose kernels are compiled now. Its dispatches are empty: lavapipe (Mesa 22.3)
    /// compiles a kernel at its first dispatch.
    pub fn compile_ahead(&mut self, record: impl FnOnce(&mut Self)) {
        let steps = mem::take(&mut self.steps);
        record(self);
        let ahead = mem::replace(&mut self.steps, steps);
        self.ahead.extend(ahead.into_iter().filter_map(|step| match step {
            Step::Dispatch { which, bindings, .. } => {
                Some(Step::Dispatch { which, bindings, extent: Extent::Grid([0; 3]) })
            }
            _ => None,
        }));
    }

    /// Fills a buffer with zeros.
    pub fn clear(&mut self, buffer: &wgpu::Buffer) {
        self.steps.push(Step::Clear(buffer.clone()));
    }

    /// Copies a buffer to a mip of a texture. The rows in the buffer are padded to multiples of 256 bytes.
    pub fn fill(&mut self, texture: &wgpu::Texture, mip: u32, buffer: &wgpu::Buffer) {
        self.steps.push(Step::Fill { texture: texture.clone(), mip, buffer: buffer.clone() });
    }

    /// Records a readback of `bytes` bytes of a buffer; [`Recorder::submit`] returns the readbacks in order.
    pub fn download(&mut self, buffer: &wgpu::Buffer, offset: u64, bytes: u64) {
        if buffer.usage().contains(wgpu::BufferUsages::MAP_READ) {
            self.downloads.push(Download::of(buffer.clone(), offset..offset + bytes));
            return;
        }
        let staging = self.gpu.staging(bytes);
        self.steps.push(Step::Copy { buffer: buffer.clone(), offset, staging: staging.clone() });
        self.downloads.push(Download::of(staging, 0..bytes));
    }

    /// Records a readback of a texture and its mips, with padded rows.
    pub fn download_texture(&mut self, texture: &wgpu::Texture) {
        let bytes = texture_bytes(texture, COPIED);
        let staging = self.gpu.staging(bytes);
        self.steps.push(Step::CopyTexture { texture: texture.clone(), staging: staging.clone() });
        self.downloads.push(Download::of(staging, 0..bytes));
    }

    /// Passes the last readback to `received` after completion instead of returning it.
    pub fn receive(&mut self, received: impl FnOnce(&[u8]) + 'static) {
        self.received.push((self.downloads.len() - 1, Box::new(received)));
    }

    /// Runs the recording, waits for it and returns the readbacks.
    pub fn submit(mut self) -> Result<Vec<Download>> {
        self.flush()
    }

    /// Runs the recording as [`Recorder::submit`]; further work can be recorded.
    pub fn flush(&mut self) -> Result<Vec<Download>> {
        (self.interrupt)()?;
        let mut steps = mem::take(&mut self.steps);
        steps.append(&mut self.ahead);
        let token = mem::take(&mut self.token);
        let mut downloads = mem::take(&mut self.downloads);
        let arguments = mem::take(&mut self.arguments);
        let mut submission = Submission::new(self.gpu, &steps, arguments, self.interrupt);
        while_compiling(self.gpu, pipeline_requests(&steps), || {
            steps.iter().try_for_each(|step| submission.encode(step))
        })?;
        submission.finish(&mut downloads, self.timings)?;
        token.0.store(true, Ordering::Relaxed);
        // From the last to the first, so that indices stay valid.
        let received = mem::take(&mut self.received).into_iter().rev();
        let arrived: Vec<_> = received.map(|(index, received)| (downloads.remove(index), received)).collect();
        arrived.into_iter().rev().for_each(|(download, received)| received(download.numbers()));
        Ok(downloads)
    }
}

/// Kernels that steps name.
fn pipeline_requests(steps: &[Step]) -> Vec<PipelineRequest> {
    let named = |step: &Step| match step {
        Step::Dispatch { which: Which::Named(name, specialization), .. } => Some((*name, specialization.clone())),
        _ => None,
    };
    steps.iter().filter_map(named).collect()
}

/// Runs `work` while other threads compile kernels.
fn while_compiling<T>(gpu: &Gpu, wanted: Vec<PipelineRequest>, work: impl FnOnce() -> Result<T>) -> Result<T> {
    let mut missing: Vec<PipelineRequest> = Vec::new();
    for (name, specialization) in wanted {
        let same = |(requested, table): &PipelineRequest| *requested == name && *table == specialization;
        if !missing.iter().any(same) && !gpu.is_compiled(name, &specialization)? {
            missing.push((name, specialization));
        }
    }
    // One thread per core at most: each thread has a memory arena of its own in glibc. For 60 random skies they take
    // 669 MB with a thread per kernel, and 350 MB with one arena.
    let threads = thread::available_parallelism().map_or(1, NonZero::get).min(missing.len());
    let missing = Mutex::new(missing.into_iter());
    let compile = || {
        let next = || lock(&missing).next();
        while let Some((name, specialization)) = next() {
            gpu.kernel(name, &specialization)?;
        }
        Ok(())
    };
    thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(compile)).collect();
        let done = work()?;
        for thread in threads {
            thread.join().unwrap_or_else(|panic| resume_unwind(panic))?;
        }
        Ok(done)
    })
}

/// Encoding and submission of recorded steps.
struct Submission<'a> {
    gpu: &'a Gpu,
    interrupt: Interrupt<'a>,
    /// Uniform blocks, and the offset of each in bytes.
    blocks: wgpu::Buffer,
    offsets: HashMap<*const u32, u64>,
    arguments: wgpu::Buffer,
    encoder: wgpu::CommandEncoder,
    /// Estimated time of the commands encoded since the last submission, s.
    seconds: f64,
    in_flight: Option<wgpu::SubmissionIndex>,
    queries: Option<wgpu::QuerySet>,
    /// Kernel and size of each dispatch.
    dispatched: Vec<(Arc<Kernel>, Extent)>,
    started: Instant,
}

impl<'a> Submission<'a> {
    fn new(gpu: &'a Gpu, steps: &[Step], arguments: u32, interrupt: Interrupt<'a>) -> Self {
        let mut bytes: Vec<u8> = Vec::new();
        let mut offsets = HashMap::new();
        let mut dispatches = 0;
        for step in steps {
            let Step::Dispatch { bindings, .. } = step else { continue };
            dispatches += 1;
            for (_, binding) in bindings {
                if let Binding::Block(words) = binding {
                    offsets.entry(words.as_ptr()).or_insert_with(|| {
                        bytes.resize(bytes.len().next_multiple_of(UNIFORM_ALIGNMENT), 0);
                        let begin = bytes.len() as u64;
                        bytes.extend_from_slice(bytemuck::cast_slice(words));
                        begin
                    });
                }
            }
        }
        let blocks = gpu.uniform("blocks", bytes.len().next_multiple_of(UNIFORM_ALIGNMENT).max(UNIFORM_ALIGNMENT));
        gpu.queue.write_buffer(&blocks, 0, &bytes);
        let timed = 2 * dispatches.min(MAX_TIMED) as u32;
        let queries = gpu.nanoseconds_per_tick.filter(|_| timed > 0).map(|_| {
            gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: timed,
            })
        });
        Self {
            gpu,
            interrupt,
            blocks,
            offsets,
            arguments: gpu.arguments(ARGUMENT_STRIDE * u64::from(arguments.max(1))),
            encoder: encoder(gpu),
            seconds: 0.0,
            in_flight: None,
            queries,
            dispatched: Vec::new(),
            started: Instant::now(),
        }
    }

    fn encode(&mut self, step: &Step) -> Result<()> {
        match step {
            Step::Dispatch { which, bindings, extent } => self.dispatch(which, bindings, *extent)?,
            Step::Clear(buffer) => self.encoder.clear_buffer(buffer, 0, None),
            Step::Fill { texture, mip, buffer } => {
                let Some((target, layout, size)) = mips(texture, COPIED).nth(*mip as usize) else { return Ok(()) };
                let layout = wgpu::TexelCopyBufferLayout { offset: 0, ..layout };
                self.encoder.copy_buffer_to_texture(wgpu::TexelCopyBufferInfo { buffer, layout }, target, size);
            }
            Step::Copy { buffer, offset, staging } => {
                self.encoder.copy_buffer_to_buffer(buffer, *offset, staging, 0, staging.size());
            }
            Step::CopyTexture { texture, staging } => {
                for (source, layout, size) in mips(texture, COPIED) {
                    let target = wgpu::TexelCopyBufferInfo { buffer: staging, layout };
                    self.encoder.copy_texture_to_buffer(source, target, size);
                }
            }
        }
        Ok(())
    }

    fn dispatch(&mut self, which: &Which, bindings: &Bindings, extent: Extent) -> Result<()> {
        let kernel = match which {
            Which::Made(kernel) => kernel.clone(),
            Which::Named(name, specialization) => {
                // The device runs the encoded commands while the kernel is compiled.
                if !self.gpu.is_compiled(*name, specialization)? {
                    self.submit();
                }
                self.gpu.kernel(*name, specialization)?
            }
        };
        let seconds = extent.expected() * self.gpu.seconds_each(&kernel.label);
        if self.seconds > 0.0 && self.seconds + seconds > SLICE_SECONDS {
            // lavapipe executes submissions synchronously (Mesa 22.3): waits end before they call the interrupt check.
            (self.interrupt)()?;
            let before = self.in_flight.take();
            self.submit();
            // At most two slices are in flight; an interrupt prevents only those after them.
            before.map_or(Ok(()), |index| self.gpu.wait(index, self.interrupt))?;
        }
        self.seconds += seconds;

        let resources = Resources {
            blocks: &self.blocks,
            offsets: &self.offsets,
            arguments: &self.arguments,
            stride: ARGUMENT_STRIDE,
        };
        let group = kernel.bind(self.gpu, bindings, &resources)?;
        let number = self.dispatched.len();
        let empty = matches!(extent, Extent::Grid([0, ..]));
        let queries = self.queries.as_ref().filter(|_| number < MAX_TIMED && !empty);
        let timestamp_writes = queries.map(|query_set| wgpu::ComputePassTimestampWrites {
            query_set,
            beginning_of_pass_write_index: Some(2 * number as u32),
            end_of_pass_write_index: Some(2 * number as u32 + 1),
        });
        let descriptor = wgpu::ComputePassDescriptor { label: Some(&kernel.label), timestamp_writes };
        let mut pass = self.encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&kernel.pipeline);
        pass.set_bind_group(0, &group, &[]);
        match extent {
            Extent::Grid(size) => {
                let [x, y, z] = std::array::from_fn(|i| size[i].div_ceil(kernel.workgroup[i]));
                pass.dispatch_workgroups(x, y, z);
            }
            Extent::Indirect(argument, _) => {
                pass.dispatch_workgroups_indirect(&self.arguments, ARGUMENT_STRIDE * u64::from(argument));
            }
        }
        drop(pass);
        if !empty {
            self.dispatched.push((kernel, extent));
        }
        Ok(())
    }

    /// Submits the encoded commands.
    fn submit(&mut self) {
        let encoded = mem::replace(&mut self.encoder, encoder(self.gpu));
        self.in_flight = Some(self.gpu.submit(encoded));
        self.seconds = 0.0;
    }

    /// Waits for all submissions and opens the readbacks.
    fn finish(mut self, downloads: &mut [Download], timings: &mut Timings) -> Result<()> {
        let gpu = self.gpu;
        let mut own = Vec::new();
        let timed = self.dispatched.len().min(MAX_TIMED) as u64;
        let mut bring = |encoder: &mut wgpu::CommandEncoder, buffer: &wgpu::Buffer| {
            let staging = gpu.staging(buffer.size());
            encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
            own.push(Download::of(staging, 0..buffer.size()));
        };
        bring(&mut self.encoder, &self.arguments);
        if let Some(queries) = self.queries.as_ref().filter(|_| timed > 0) {
            let resolved = gpu.resolved(16 * timed);
            self.encoder.resolve_query_set(queries, 0..2 * timed as u32, &resolved, 0);
            bring(&mut self.encoder, &resolved);
        }
        self.submit();
        downloads.iter_mut().chain(&mut own).for_each(Download::map);
        let last = self.in_flight.take().expect("was just submitted");
        gpu.wait(last, self.interrupt)?;
        downloads.iter_mut().chain(&mut own).try_for_each(Download::open)?;
        self.learn(&own, timings);
        Ok(())
    }

    /// Updates the estimated costs of kernels.
    fn learn(&self, own: &[Download], timings: &mut Timings) {
        let arguments: &[u32] = own[0].numbers();
        let invocations = |extent: Extent| match extent {
            Extent::Grid(size) => size.map(f64::from).iter().product::<f64>(),
            Extent::Indirect(argument, _) => {
                let at = (ARGUMENT_STRIDE / 4 * u64::from(argument)) as usize;
                let groups = arguments[at..at + 3].iter().map(|n| f64::from(*n)).product::<f64>();
                groups * f64::from(LIST_GROUP)
            }
        };
        let Some((ticks, period)) = own.get(1).zip(self.gpu.nanoseconds_per_tick) else {
            // Without timestamps the measured time is distributed in proportion to the estimates.
            let each =
                |(kernel, extent): &(Arc<Kernel>, Extent)| invocations(*extent) * self.gpu.seconds_each(&kernel.label);
            let estimated: f64 = self.dispatched.iter().map(each).sum();
            let ratio = self.started.elapsed().as_secs_f64() / estimated.max(1e-9);
            for (kernel, extent) in &self.dispatched {
                let seconds = ratio * each(&(kernel.clone(), *extent));
                self.gpu.learn(&kernel.label, invocations(*extent), seconds);
            }
            return;
        };
        let pairs: &[[u64; 2]] = ticks.numbers();
        for ((kernel, extent), [begin, end]) in self.dispatched.iter().zip(pairs) {
            let nanoseconds = end.saturating_sub(*begin) as f64 * period;
            timings.add(&kernel.label, nanoseconds * 1e-6);
            self.gpu.learn(&kernel.label, invocations(*extent), nanoseconds * 1e-9);
        }
    }
}

impl Extent {
    /// Expected number of invocations.
    fn expected(self) -> f64 {
        match self {
            Self::Grid(size) => size.map(f64::from).iter().product(),
            Self::Indirect(_, likely) => likely,
        }
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("recording") })
}

/// Initial estimate of the time of an invocation in s, on a CPU and on a GPU: ten times that of a march in `draft`, and
/// that of a march in `high`.
const INITIAL_COST: [f64; 2] = [3e-5, 1e-7];
/// Invocations below which a dispatch is not used for estimates: launch overhead dominates.
const MIN_TIMED_INVOCATIONS: f64 = 1024.0;

/// Estimated time of an invocation in s, by kernel.
#[derive(Default)]
struct Costs(Mutex<HashMap<String, f64>>);

impl Gpu {
    /// Estimated time of an invocation of a kernel in s.
    fn seconds_each(&self, kernel: &str) -> f64 {
        let [processor, other] = INITIAL_COST;
        let guess = if self.info.kind == "cpu" { processor } else { other };
        lock(&self.common::<Costs>().0).get(kernel).copied().unwrap_or(guess)
    }

    /// Number of invocations of a kernel that fit a time in s, at least one.
    fn most_invocations(&self, kernel: &str, seconds: f64) -> u64 {
        ((seconds / self.seconds_each(kernel)) as u64).max(1)
    }

    /// Updates the estimate for a kernel from a dispatch of many invocations; after the first update by at most a
    /// factor of four at once.
    fn learn(&self, kernel: &str, invocations: f64, seconds: f64) {
        if invocations >= MIN_TIMED_INVOCATIONS && seconds > 0.0 {
            let common = self.common::<Costs>();
            let mut costs = lock(&common.0);
            let each = seconds / invocations;
            let each = costs.get(kernel).map_or(each, |old| each.clamp(old / 4.0, old * 4.0));
            costs.insert(kernel.to_owned(), each);
        }
    }
}
