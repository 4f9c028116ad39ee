// Sample grid: the pixels that hold a sample of the marched clouds. At low resolution they are the corners of cells of
// 4x4 pixels, else all pixels.
#import bindings

// Spacing of samples, pixels.
fn spacing() -> u32 {
    return select(1u, TILE, LOW_RESOLUTION);
}

// Number of samples of this picture, across and down.
fn sample_count() -> vec2u {
    return sample_count_by(vec2u(frame.view.width, frame.view.height), spacing());
}

// Number of samples of a picture of `size` pixels, across and down. At low resolution samples extend up to a cell
// beyond the right and lower edges, so that each pixel lies between four.
fn sample_count_by(size: vec2u, spacing: u32) -> vec2u {
    return select(size, (size + spacing - 1u) / spacing + 1u, spacing > 1u);
}

// Weight of a sample's depth in interpolation: its opacity, at least 1e-6 where there is a depth.
fn depth_weight(transmittance: f32, depth: f32) -> f32 {
    return select(0.0, max(1.0 - transmittance, 1e-6), depth >= 0.0);
}
