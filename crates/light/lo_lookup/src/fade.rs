/// 1 up to the first bound, 0 from the second on.
pub(crate) fn fade(value: f32, (all, none): (f32, f32)) -> f32 {
    let t = ((none - value) / (none - all)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
