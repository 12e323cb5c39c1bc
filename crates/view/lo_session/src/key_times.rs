//! Times and positions of keyframes.

use lo_insert::{Keyframe, Path};
use lo_scene::MAX_TIME_S;

use crate::SessionError;
use crate::object_position::ObjectPosition;

/// Resolution of times: nearer times are equal.
const STEPS_PER_S: f64 = 1e4;

/// Rounds a time to the resolution of keyframes.
///
/// # Errors
/// If the time is outside 0 to [`MAX_TIME_S`].
pub(crate) fn quantized_time_s(time_s: f64) -> Result<f64, SessionError> {
    if (0.0..=MAX_TIME_S).contains(&time_s) {
        Ok((time_s * STEPS_PER_S).round() / STEPS_PER_S)
    } else {
        Err(SessionError::InvalidNumber { name: "the time", needed: "from 0 to 3600 seconds", found: time_s })
    }
}

/// Returns the keyframe that applies at a time exactly: the one at the time, or the first or last one outside the path.
pub(crate) fn key_at(path: &Path, time_s: f64) -> Option<&Keyframe> {
    let (first, last) = (path.keyframes.first()?, path.keyframes.last()?);
    if time_s <= first.time_s {
        Some(first)
    } else if time_s >= last.time_s {
        Some(last)
    } else {
        path.keyframes.iter().find(|key| is_same(key.time_s, time_s))
    }
}

/// Returns the position of a keyframe.
pub(crate) fn position_of(key: &Keyframe) -> ObjectPosition {
    match (key.pixel, key.position_m) {
        (Some(pixel), _) => ObjectPosition::Pixel(pixel),
        (None, position_m) => ObjectPosition::Position(position_m.unwrap_or_default()),
    }
}

pub(crate) fn is_same(a_s: f64, b_s: f64) -> bool {
    (a_s - b_s).abs() < 0.5 / STEPS_PER_S
}
