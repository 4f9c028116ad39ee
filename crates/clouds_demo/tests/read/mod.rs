//! Readback of screens.

use clouds_core::{Gpu, Screen, wgpu};

/// RGBA8 pixels of a screen, row by row.
pub fn pixels(gpu: &Gpu, screen: &Screen) -> Vec<u8> {
    let (_, _, device, queue) = gpu.shared();
    let texture = screen.view().texture();
    let [width, height] = screen.size();
    let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = device.create_buffer(&wgpu::BufferDescriptor {
        label: None,
        size: u64::from(row * height),
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(height) };
    let target = wgpu::TexelCopyBufferInfo { buffer: &staging, layout };
    encoder.copy_texture_to_buffer(texture.as_image_copy(), target, texture.size());
    queue.submit([encoder.finish()]);
    staging.map_async(wgpu::MapMode::Read, .., |_| {});
    device.poll(wgpu::PollType::wait_indefinitely()).expect("is done");
    let mapped = staging.get_mapped_range(..).expect("is mapped");
    mapped.chunks(row as usize).flat_map(|line| &line[..4 * width as usize]).copied().collect()
}
