use glam::Vec3;

/// Largest coordinate of a position that a user or a file gives, metres. Rooms are smaller, and `f32` still resolves
/// millimetres.
pub const MAX_COORDINATE_M: f32 = 1e4;

/// Returns whether all coordinates are within ± [`MAX_COORDINATE_M`].
pub fn is_position(point: Vec3) -> bool {
    // Also false for NaN.
    point.to_array().iter().all(|coordinate| coordinate.abs() <= MAX_COORDINATE_M)
}
