//! User-supplied table of density by height and cloud type, as a texture.

use super::lut::{Inputs, Lut, view};
use crate::error::Result;
use crate::gpu::Recorder;
use crate::schema::Table;

/// Profile table on the GPU.
#[derive(Default)]
pub(crate) struct Profile {
    lut: Lut<Table>,
}

impl Profile {
    pub fn update(&mut self, rec: &mut Recorder<'_>, inputs: &Inputs<'_>) -> Result<()> {
        let Some(profile) = &inputs.params.clouds.profile else { return Ok(()) };
        let table = self.lut.update(rec, profile.clone(), |rec| {
            let Table(map) = profile;
            let texture = rec.gpu.texture("profile", [map.width as u32, map.height as u32, 1], 1);
            let texels: Vec<_> = map.data.iter().map(|v| [half::f16::from_f32(*v); 4]).collect();
            rec.gpu.write_texture(&texture, &texels);
            Ok(view(&texture))
        })?;
        rec.bind([("profile_table", (&table).into())]);
        Ok(())
    }
}
