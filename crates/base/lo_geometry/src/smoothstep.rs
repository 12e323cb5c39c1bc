/// GLSL's `smoothstep`: 0 up to `low`, 1 from `high`, and a cubic with zero slope at both ends between them.
///
/// Falls from 1 to 0 if `high` is below `low`.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_rises_or_falls_between_its_bounds() {
        for (x, expected) in [(-1.0, 0.0), (1.0, 0.0), (2.0, 0.5), (1.5, 0.15625), (3.0, 1.0), (9.0, 1.0)] {
            assert!((smoothstep(1.0, 3.0, x) - expected).abs() < 1e-6, "{x}");
            assert!((smoothstep(3.0, 1.0, x) - (1.0 - expected)).abs() < 1e-6, "{x}");
        }
    }
}
