// Which pixels the marched clouds are known at: all of them or, in a sparse picture, the corners of cells of four by four.
#import bindings

// Pixels from one that is known to the next.
fn spacing() -> u32 {
    return select(1u, TILE, LOW_RESOLUTION);
}

// How many are known in this picture.
fn sample_count() -> vec2u {
    return sample_count_by(vec2u(frame.view.width, frame.view.height), spacing());
}

// How many are known in a picture of `size` pixels. Those of a sparse one go up to a cell beyond its right and lower edges, so
// that each pixel lies between four.
fn sample_count_by(size: vec2u, spacing: u32) -> vec2u {
    return select(size, (size + spacing - 1u) / spacing + 1u, spacing > 1u);
}

// By what a depth counts between known pixels: opacity, and next to none where there is next to none.
fn depth_weight(transmittance: f32, depth: f32) -> f32 {
    return select(0.0, max(1.0 - transmittance, 1e-6), depth >= 0.0);
}
