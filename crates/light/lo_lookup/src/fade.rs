/// Returns 1 up to the first bound and 0 from the second on, smooth in between.
pub(crate) fn fade(value: f32, (all, none): (f32, f32)) -> f32 {
    lo_geometry::smoothstep(none, all, value)
}
