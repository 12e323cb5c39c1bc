use lo_geometry::DVec3;
use serde_json::Value;

use super::error::PoseError;

pub(super) fn content(file: &str, what: impl ToString) -> PoseError {
    PoseError::Content { file: file.to_owned(), what: what.to_string() }
}

/// Parses a number, including one that is written as text.
pub(super) fn number(value: &Value) -> Option<f64> {
    value.as_f64()
}

/// Returns all numbers of nested arrays in row-major order; `None` if there is anything else, or more than a matrix
/// has.
pub(super) fn numbers(value: &Value) -> Option<Vec<f64>> {
    let mut all = Vec::new();
    for row in value.as_array()? {
        match row {
            Value::Array(row) => all.extend(row.iter().map(number).collect::<Option<Vec<f64>>>()?),
            value => all.push(number(value)?),
        }
        if all.len() > 16 {
            return None;
        }
    }
    Some(all)
}

/// Largest coordinate of a position, metres; differences of larger ones would lose precision.
const MAX_POSITION_M: f64 = 1e7;

pub(super) fn checked_position(position_m: DVec3, file: &str, pose: &str) -> Result<DVec3, PoseError> {
    match position_m.to_array().into_iter().find(|v| !v.is_finite() || v.abs() > MAX_POSITION_M) {
        Some(value) => Err(PoseError::Value { file: file.to_owned(), pose: pose.to_owned(), value }),
        None => Ok(position_m),
    }
}
