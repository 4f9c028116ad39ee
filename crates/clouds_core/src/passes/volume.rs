//! The user's grid on the GPU, in the form that is read: half floats to be filtered, or f32 to be loaded.

use std::sync::Arc;

use super::{Baked, Bindings, Context};
use crate::error::Result;
use crate::params::Params;
use crate::volume::DensityGrid;

/// The grid as a texture, 1 at its largest extinction, which half floats could not hold.
pub(crate) struct Volume {
    made: Baked<Key, [wgpu::TextureView; 2]>,
}

/// Which grid, and whether in f32.
struct Key(Option<Arc<DensityGrid>>, bool);

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        let same = match (&self.0, &other.0) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            (a, b) => a.is_none() && b.is_none(),
        };
        same && self.1 == other.1
    }
}

impl Volume {
    pub const fn new() -> Self {
        Self { made: Baked::new() }
    }

    pub fn run(&mut self, ctx: &Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let precise = ctx.variant.precise;
        let [filtered, exact] = self.made.get(Key(params.volume.clone(), precise), || {
            // A kernel that could read a texture must be given one.
            let nothing = (&[0.0][..], [1; 3]);
            let grid = params.volume.as_ref().map_or(nothing, |grid| (grid.extinction(), grid.size()));
            let scale = params.volume.as_ref().map_or(1.0, |grid| grid.max().max(f32::MIN_POSITIVE).recip());
            let (half, full) = if precise { (nothing, grid) } else { (grid, nothing) };
            let texture = |label, size: [usize; 3], format| ctx.gpu.volume(label, size.map(|n| n as u32), 1, format);
            let filtered = texture("volume", half.1, wgpu::TextureFormat::R16Float);
            let texels: Vec<_> = half.0.iter().map(|v| half::f16::from_f32(v * scale)).collect();
            ctx.gpu.write_texture(&filtered, &texels);
            let exact = texture("volume_exact", full.1, wgpu::TextureFormat::R32Float);
            let texels: Vec<_> = full.0.iter().map(|v| v * scale).collect();
            ctx.gpu.write_texture(&exact, &texels);
            Ok([&filtered, &exact].map(|texture| texture.create_view(&wgpu::TextureViewDescriptor::default())))
        })?;
        Ok(vec![("volume", filtered.into()), ("volume_exact", exact.into())])
    }
}
