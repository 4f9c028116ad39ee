//! A recording: what a device does for a picture, as data until it is submitted.
//!
//! Dispatches, copies and downloads are recorded in order. [`Recorder::submit`] compiles the kernels that they name, encodes
//! them and waits: once, unless the work may keep the device busy for longer than [`SLICE_SECONDS`]. Then it is submitted in
//! slices, so that no watchdog resets the device. How long a dispatch may take is learned by kernel, from its timestamps.

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

/// Longest that one submission usually keeps the device busy, s, and that one dispatch does whose list is as long as it can be: a
/// fourth of the two seconds after which Windows resets a device. After Ctrl-C two of them go on.
const SLICE_SECONDS: f64 = 0.5;
/// Most workgroups along one side of a dispatch (WebGPU's default limit).
const MOST_GROUPS: u32 = 65_535;
/// What uniform blocks are aligned to, bytes (WebGPU's default limit).
const ALIGNED: usize = 256;

constants! {
    /// Bytes from the arguments of one indirect dispatch to those of the next, which are workgroups along each side and
    /// how many invocations the whole list has: each can be bound as a uniform.
    const ARGUMENT_STRIDE: u64 = ALIGNED as u64;
    /// Invocations of a workgroup of a list.
    const LIST_GROUP: u32 = 64;
    /// Invocations along each side of a workgroup of a grid that is dispatched under a condition or in slices of rows.
    const GRID_GROUP: u32 = 8;
}

/// Most dispatches of a recording that are timed: WebGPU allows 4,096 queries in a set.
const MOST_TIMED: usize = 2048;

/// Tells whether what was recorded has been submitted: a LUT that was recorded and then thrown away is not there.
#[derive(Clone, Default)]
pub(crate) struct Token(Arc<AtomicBool>);

/// A list that kernels write: entries elsewhere, and here how many there are.
pub(crate) struct List<'a> {
    pub count: &'a wgpu::Buffer,
    /// Most entries that it can have.
    pub most: u32,
    /// Invocations for each entry.
    pub each: u32,
    /// Share of those entries that it has as a rule.
    pub likely: f64,
}

/// What a dispatch runs.
#[derive(Clone)]
pub(crate) enum Which {
    /// A kernel of a pass, compiled for the values of a table.
    Named(Name, Arc<Specialization>),
    /// One that there is.
    Made(Arc<Kernel>),
}

/// How many invocations a dispatch has.
#[derive(Clone, Copy)]
enum Extent {
    Grid([u32; 3]),
    /// By the arguments of this number, as a rule so many.
    Indirect(u32, f64),
}

enum Step {
    Dispatch { which: Which, bindings: Bindings, extent: Extent },
    Clear(wgpu::Buffer),
    Fill { texture: wgpu::Texture, mip: u32, buffer: wgpu::Buffer },
    Copy { buffer: wgpu::Buffer, offset: u64, staging: wgpu::Buffer },
    CopyTexture { texture: wgpu::Texture, staging: wgpu::Buffer },
}

/// A kernel, and the table that it is compiled for.
type Wanted = (Name, Arc<Specialization>);

/// What is done with bytes that have come back.
type Received = Box<dyn FnOnce(&[u8])>;

/// Work on its way to the device.
pub(crate) struct Recorder<'a> {
    pub gpu: &'a Gpu,
    /// What every dispatch may use, by name.
    scope: Bindings,
    specialization: Arc<Specialization>,
    /// Where it is 0 no grid is dispatched.
    condition: Option<wgpu::Buffer>,
    steps: Vec<Step>,
    arguments: u32,
    /// Kernels that the next recordings may ask for.
    ahead: Vec<Wanted>,
    downloads: Vec<Download>,
    received: Vec<(usize, Received)>,
    token: Token,
    timings: &'a mut Timings,
    interrupt: Interrupt<'a>,
}

impl<'a> Recorder<'a> {
    /// An empty recording, whose kernels add to `timings`.
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

    /// Gives variables to every dispatch from here on.
    pub fn bind(&mut self, bindings: impl IntoIterator<Item = (&'static str, Binding)>) {
        for (name, binding) in bindings {
            match self.scope.iter_mut().find(|(known, _)| *known == name) {
                Some((_, old)) => *old = binding,
                None => self.scope.push((name, binding)),
            }
        }
    }

    /// Names and bytes of what every dispatch may use.
    pub fn held(&self) -> Vec<(&'static str, u64)> {
        self.scope.iter().map(|(name, binding)| (*name, binding.bytes())).filter(|(_, bytes)| *bytes > 0).collect()
    }

    /// Compiles kernels from here on for the values of a table; returns that before.
    pub fn specialize(&mut self, specialization: Arc<Specialization>) -> Arc<Specialization> {
        mem::replace(&mut self.specialization, specialization)
    }

    /// The same for the table so far with other values.
    pub fn specialize_with(&mut self, values: &[(&'static str, f64)]) -> Arc<Specialization> {
        let table = self.specialization.with(values);
        self.specialize(table)
    }

    /// Whether what was recorded with a token is there for what is recorded now: it has been submitted, or comes before.
    pub fn has(&self, token: &Token) -> bool {
        token.0.load(Ordering::Relaxed) || Arc::ptr_eq(&token.0, &self.token.0)
    }

    /// Stands for what is recorded now.
    pub fn token(&self) -> Token {
        self.token.clone()
    }

    /// Runs a kernel over a grid of invocations, with variables beside those of the scope.
    pub fn dispatch(&mut self, name: Name, bindings: Bindings, extent: [u32; 3]) {
        self.dispatch_kernel(Which::Named(name, self.specialization.clone()), bindings, extent);
    }

    /// The same with any kernel.
    pub fn dispatch_kernel(&mut self, which: Which, bindings: Bindings, extent: [u32; 3]) {
        let Some(condition) = self.condition.clone() else { return self.push(which, bindings, Extent::Grid(extent)) };
        let [x, y] = [extent[0], extent[1]].map(|along| along.div_ceil(GRID_GROUP));
        let argument = self.arguments;
        self.arguments += 1;
        let arrangement = Binding::block(&[x, y, 0, 0]);
        let ours = vec![
            ("arrangement", arrangement),
            ("list_count", (&condition).into()),
            ("arguments", Binding::Arguments(argument..argument + 1)),
        ];
        self.push(Which::Named(("arrange", "arrange_grid"), Arc::default()), ours, Extent::Grid([1; 3]));
        self.push(which, bindings, Extent::Indirect(argument, 0.0));
    }

    /// Runs a kernel over `rows` rows of `width` invocations, in slices where it may take long, each with the uniform block
    /// that `block` makes for it, by name.
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
        let most = most.clamp(group, u64::from(MOST_GROUPS)) as u32;
        for first in (0..rows).step_by(most as usize) {
            let slice = first..(first + most).min(rows);
            let size = [width, slice.len() as u32, 1];
            self.dispatch(name, [&[block(slice)], bindings.as_slice()].concat(), size);
        }
    }

    /// Runs a kernel over the entries of a list, as many as there will be, in slices where it may take long. The list is empty
    /// afterwards. `block` makes a uniform block, by name, for the number of the first invocation; `listed` holds the
    /// number of all.
    pub fn dispatch_list(
        &mut self,
        name: Name,
        bindings: &Bindings,
        list: &List<'_>,
        block: impl Fn(u32) -> (&'static str, Binding),
    ) {
        let invocations = list.most * list.each;
        let most = self.gpu.most_invocations(name.1, SLICE_SECONDS) / u64::from(LIST_GROUP) * u64::from(LIST_GROUP);
        let most = most.clamp(LIST_GROUP.into(), (LIST_GROUP * MOST_GROUPS).into()) as u32;
        let slices = invocations.div_ceil(most);
        let first = self.arguments;
        self.arguments += slices;
        let arrangement = Binding::block(&[slices, most, list.each, 0]);
        let ours = vec![
            ("arrangement", arrangement),
            ("list_count", list.count.into()),
            ("arguments", Binding::Arguments(first..self.arguments)),
        ];
        let arrange = Which::Named(("arrange", "arrange_list"), Arc::default());
        self.push(arrange, ours, Extent::Grid([slices, 1, 1]));
        self.clear(list.count);
        for slice in 0..slices {
            let argument = first + slice;
            let ours = [block(slice * most), ("listed", Binding::Arguments(argument..argument + 1))];
            let which = Which::Named(name, self.specialization.clone());
            // Under a condition it is as a rule empty.
            let likely = if self.condition.is_some() { 0.0 } else { list.likely * f64::from(invocations) };
            let likely = (likely - f64::from(slice * most)).clamp(0.0, most.into());
            self.push(which, [&ours, bindings.as_slice()].concat(), Extent::Indirect(argument, likely));
        }
    }

    /// Records what `record` does for the case that `condition` is not 0 then: its grids are dispatched only if so.
    pub fn when(&mut self, condition: &wgpu::Buffer, record: impl FnOnce(&mut Self)) {
        let outer = self.condition.replace(condition.clone());
        record(self);
        self.condition = outer;
    }

    fn push(&mut self, which: Which, bindings: Bindings, extent: Extent) {
        // What the dispatch has of its own comes first.
        let bindings = [bindings, self.scope.clone()].concat();
        self.steps.push(Step::Dispatch { which, bindings, extent });
    }

    /// Records what `record` does only to compile its kernels: the next picture finds them.
    pub fn compile_ahead(&mut self, record: impl FnOnce(&mut Self)) {
        let (steps, arguments) = (mem::take(&mut self.steps), self.arguments);
        record(self);
        self.ahead.extend(wanted(&self.steps));
        (self.steps, self.arguments) = (steps, arguments);
    }

    /// Fills a buffer with zeros.
    pub fn clear(&mut self, buffer: &wgpu::Buffer) {
        self.steps.push(Step::Clear(buffer.clone()));
    }

    /// Fills a mip of a texture from a buffer, whose rows are padded to whole 256 bytes.
    pub fn fill(&mut self, texture: &wgpu::Texture, mip: u32, buffer: &wgpu::Buffer) {
        self.steps.push(Step::Fill { texture: texture.clone(), mip, buffer: buffer.clone() });
    }

    /// Brings `bytes` of a buffer back; [`Recorder::submit`] returns them in the order of the calls.
    pub fn download(&mut self, buffer: &wgpu::Buffer, offset: u64, bytes: u64) {
        if buffer.usage().contains(wgpu::BufferUsages::MAP_READ) {
            self.downloads.push(Download::of(buffer.clone(), offset..offset + bytes));
            return;
        }
        let staging = self.gpu.staging(bytes);
        self.steps.push(Step::Copy { buffer: buffer.clone(), offset, staging: staging.clone() });
        self.downloads.push(Download::of(staging, 0..bytes));
    }

    /// The same for a texture of half floats and its mips, whose rows are padded.
    pub fn download_texture(&mut self, texture: &wgpu::Texture) {
        let bytes = texture_bytes(texture, COPIED);
        let staging = self.gpu.staging(bytes);
        self.steps.push(Step::CopyTexture { texture: texture.clone(), staging: staging.clone() });
        self.downloads.push(Download::of(staging, 0..bytes));
    }

    /// Hands the last download to `received` when it is there; it is not among those that are returned.
    pub fn receive(&mut self, received: impl FnOnce(&[u8]) + 'static) {
        self.received.push((self.downloads.len() - 1, Box::new(received)));
    }

    /// Runs everything, waits for it and returns the downloads.
    pub fn submit(mut self) -> Result<Vec<Download>> {
        self.flush()
    }

    /// The same, and goes on recording.
    pub fn flush(&mut self) -> Result<Vec<Download>> {
        (self.interrupt)()?;
        let steps = mem::take(&mut self.steps);
        let token = mem::take(&mut self.token);
        let mut downloads = mem::take(&mut self.downloads);
        let arguments = mem::take(&mut self.arguments);
        let mut submission = Submission::new(self.gpu, &steps, arguments, self.interrupt);
        let wanted = wanted(&steps).into_iter().chain(mem::take(&mut self.ahead));
        compiling(self.gpu, wanted, || steps.iter().try_for_each(|step| submission.encode(step)))?;
        submission.finish(&mut downloads, self.timings)?;
        token.0.store(true, Ordering::Relaxed);
        // From the last to the first, so that those before keep their places.
        let received = mem::take(&mut self.received).into_iter().rev();
        let arrived: Vec<_> = received.map(|(index, received)| (downloads.remove(index), received)).collect();
        arrived.into_iter().rev().for_each(|(download, received)| received(download.numbers()));
        Ok(downloads)
    }
}

/// The kernels that steps name.
fn wanted(steps: &[Step]) -> Vec<Wanted> {
    let named = |step: &Step| match step {
        Step::Dispatch { which: Which::Named(name, specialization), .. } => Some((*name, specialization.clone())),
        _ => None,
    };
    steps.iter().filter_map(named).collect()
}

/// Does `work` while kernels are compiled on other threads.
fn compiling<T>(gpu: &Gpu, wanted: impl Iterator<Item = Wanted>, work: impl FnOnce() -> Result<T>) -> Result<T> {
    let mut missing: Vec<Wanted> = Vec::new();
    for (name, specialization) in wanted {
        let same = |(known, table): &Wanted| *known == name && *table == specialization;
        if !missing.iter().any(same) && !gpu.is_compiled(name, &specialization)? {
            missing.push((name, specialization));
        }
    }
    // No more threads than run at once: each keeps memory of its own for what it has compiled (glibc's arenas), 669 MB for 60
    // random skies with a thread for each kernel and 350 MB with one arena.
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

/// Steps on their way to the device.
struct Submission<'a> {
    gpu: &'a Gpu,
    interrupt: Interrupt<'a>,
    /// Uniform blocks, and where each begins.
    blocks: wgpu::Buffer,
    offsets: HashMap<*const u32, u64>,
    arguments: wgpu::Buffer,
    encoder: wgpu::CommandEncoder,
    /// How long what has been encoded since the last submission may take, s.
    seconds: f64,
    in_flight: Option<wgpu::SubmissionIndex>,
    queries: Option<wgpu::QuerySet>,
    /// What was dispatched: the kernel, and over what.
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
                        bytes.resize(bytes.len().next_multiple_of(ALIGNED), 0);
                        let begin = bytes.len() as u64;
                        bytes.extend_from_slice(bytemuck::cast_slice(words));
                        begin
                    });
                }
            }
        }
        let blocks = gpu.uniform("blocks", bytes.len().next_multiple_of(ALIGNED).max(ALIGNED));
        gpu.queue.write_buffer(&blocks, 0, &bytes);
        let timed = 2 * dispatches.min(MOST_TIMED) as u32;
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
                // The device may do what it has until the kernel is there.
                if !self.gpu.is_compiled(*name, specialization)? {
                    self.submit();
                }
                self.gpu.kernel(*name, specialization)?
            }
        };
        let seconds = extent.likely() * self.gpu.seconds_each(&kernel.label);
        if self.seconds > 0.0 && self.seconds + seconds > SLICE_SECONDS {
            // Lavapipe has done what it is handed before it takes it (Mesa 22.3): no wait there is so long that it asks.
            (self.interrupt)()?;
            let before = self.in_flight.take();
            self.submit();
            // So that no more than two slices are on their way, of which an interrupt ends the second only.
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
        let queries = self.queries.as_ref().filter(|_| number < MOST_TIMED);
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
        self.dispatched.push((kernel, extent));
        Ok(())
    }

    /// Hands over what has been encoded.
    fn submit(&mut self) {
        let encoded = mem::replace(&mut self.encoder, encoder(self.gpu));
        self.in_flight = Some(self.gpu.submit(encoded));
        self.seconds = 0.0;
    }

    /// Waits for everything, and opens what is brought back.
    fn finish(mut self, downloads: &mut [Download], timings: &mut Timings) -> Result<()> {
        let gpu = self.gpu;
        let mut ours = Vec::new();
        let timed = self.dispatched.len().min(MOST_TIMED) as u64;
        let mut bring = |encoder: &mut wgpu::CommandEncoder, buffer: &wgpu::Buffer| {
            let staging = gpu.staging(buffer.size());
            encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, buffer.size());
            ours.push(Download::of(staging, 0..buffer.size()));
        };
        bring(&mut self.encoder, &self.arguments);
        if let Some(queries) = self.queries.as_ref().filter(|_| timed > 0) {
            let resolved = gpu.resolved(16 * timed);
            self.encoder.resolve_query_set(queries, 0..2 * timed as u32, &resolved, 0);
            bring(&mut self.encoder, &resolved);
        }
        self.submit();
        downloads.iter_mut().chain(&mut ours).for_each(Download::map);
        let last = self.in_flight.take().expect("was just submitted");
        gpu.wait(last, self.interrupt)?;
        downloads.iter_mut().chain(&mut ours).try_for_each(Download::open)?;
        self.learn(&ours, timings);
        Ok(())
    }

    /// Learns how long kernels take.
    fn learn(&self, ours: &[Download], timings: &mut Timings) {
        let arguments: &[u32] = ours[0].numbers();
        let invocations = |extent: Extent| match extent {
            Extent::Grid(size) => size.map(f64::from).iter().product::<f64>(),
            Extent::Indirect(argument, _) => {
                let at = (ARGUMENT_STRIDE / 4 * u64::from(argument)) as usize;
                let groups = arguments[at..at + 3].iter().map(|n| f64::from(*n)).product::<f64>();
                groups * f64::from(LIST_GROUP)
            }
        };
        let Some((ticks, period)) = ours.get(1).zip(self.gpu.nanoseconds_per_tick) else {
            // Without timestamps all are as much slower or faster than thought.
            let each =
                |(kernel, extent): &(Arc<Kernel>, Extent)| invocations(*extent) * self.gpu.seconds_each(&kernel.label);
            let thought: f64 = self.dispatched.iter().map(each).sum();
            let ratio = self.started.elapsed().as_secs_f64() / thought.max(1e-9);
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
    /// How many invocations it has as a rule.
    fn likely(self) -> f64 {
        match self {
            Self::Grid(size) => size.map(f64::from).iter().product(),
            Self::Indirect(_, likely) => likely,
        }
    }
}

fn encoder(gpu: &Gpu) -> wgpu::CommandEncoder {
    gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("recording") })
}

/// Seconds that an invocation is thought to take before any has been timed, on a processor and on a GPU: ten times as long as one
/// of a march in `draft`, as long as one in `high`.
const FIRST_GUESS: [f64; 2] = [3e-5, 1e-7];
/// Invocations up to which a dispatch says nothing of how long one takes: launching it takes longer.
const TOO_FEW: f64 = 1024.0;

/// Seconds that an invocation takes, by kernel.
#[derive(Default)]
struct Costs(Mutex<HashMap<String, f64>>);

impl Gpu {
    /// Seconds that an invocation of a kernel takes.
    fn seconds_each(&self, kernel: &str) -> f64 {
        let [processor, other] = FIRST_GUESS;
        let guess = if self.info.kind == "cpu" { processor } else { other };
        lock(&self.common::<Costs>().0).get(kernel).copied().unwrap_or(guess)
    }

    /// How many invocations of a kernel take so many seconds, at least one.
    fn most_invocations(&self, kernel: &str, seconds: f64) -> u64 {
        ((seconds / self.seconds_each(kernel)) as u64).max(1)
    }

    /// Learns how long invocations of a kernel take: from many, and by no more than a factor of four at once after the first time.
    fn learn(&self, kernel: &str, invocations: f64, seconds: f64) {
        if invocations >= TOO_FEW && seconds > 0.0 {
            let common = self.common::<Costs>();
            let mut costs = lock(&common.0);
            let each = seconds / invocations;
            let each = costs.get(kernel).map_or(each, |old| each.clamp(old / 4.0, old * 4.0));
            costs.insert(kernel.to_owned(), each);
        }
    }
}
