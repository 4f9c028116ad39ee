//! The user's density by height and type, as a texture.

use super::{Baked, Bindings, Context};
use crate::error::Result;
use crate::params::Params;
use crate::schema::Table;

/// The table on the GPU.
pub(crate) struct Profile {
    table: Baked<Option<Table>, wgpu::TextureView>,
}

impl Profile {
    pub const fn new() -> Self {
        Self { table: Baked::new() }
    }

    pub fn run(&mut self, ctx: &Context<'_>, params: &Params) -> Result<Bindings<'_>> {
        let view = self.table.get(params.clouds.profile.clone(), || {
            // A kernel that could read a texture must be given one.
            let (size, data) = match &params.clouds.profile {
                Some(Table(map)) => ([map.width as u32, map.height as u32, 1], &map.data[..]),
                None => ([1; 3], &[0.0][..]),
            };
            let texture = ctx.gpu.texture("profile", size, 1);
            let texels: Vec<_> = data.iter().map(|v| [half::f16::from_f32(*v); 4]).collect();
            ctx.gpu.write_texture(&texture, &texels);
            Ok(texture.create_view(&wgpu::TextureViewDescriptor::default()))
        })?;
        Ok(vec![("profile_table", view.into())])
    }
}
