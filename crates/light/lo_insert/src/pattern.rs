//! Points of a fixed pattern.

use lo_geometry::Vec2;

/// Returns point `i` of the Hammersley set of `count` points in [0, 1)².
pub(crate) fn hammersley(i: usize, count: usize) -> Vec2 {
    let radical_inverse = (i as u32).reverse_bits() as f32 / 4_294_967_808.0;
    Vec2::new(radical_inverse, (i as f32 + 0.5) / count as f32)
}
