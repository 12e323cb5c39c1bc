use lightoctree::LightMode;
use lightoctree::geometry::{Orientation, Vec3};
use lightoctree::insert::Quality;
use lightoctree_cli::commands::parse;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// Returns the choice of this name.
///
/// # Errors
/// `ValueError` that lists the names.
pub fn choice<T: Copy>(argument: &str, name: &str, choices: &[(&str, T)]) -> PyResult<T> {
    if let Some((_, value)) = choices.iter().find(|(choice, _)| *choice == name) {
        return Ok(*value);
    }
    let quoted: Vec<String> = choices.iter().map(|(choice, _)| format!("{choice:?}")).collect();
    Err(PyValueError::new_err(format!("{argument} must be {}, not {name:?}", quoted.join(" or "))))
}

/// Returns the choice of inferred light.
pub fn light(name: &str) -> PyResult<LightMode> {
    let modes = [LightMode::Even, LightMode::Expected, LightMode::Plausible];
    choice("light", name, &modes.map(|mode| (mode.name(), mode)))
}

/// Returns the quality preset.
pub fn quality(name: &str) -> PyResult<Quality> {
    choice("quality", name, &[("draft", Quality::Draft), ("normal", Quality::Normal), ("high", Quality::High)])
}

/// Returns the orientation of a panorama.
pub fn orientation(name: &str) -> PyResult<Orientation> {
    let presets = lightoctree_cli::commands::environment::ORIENTATIONS;
    choice("orientation", name, &presets.map(|(name, value, _)| (name, value)))
}

/// Returns a position in metres, with the limits of the command line.
pub fn point(argument: &str, at: [f64; 3]) -> PyResult<Vec3> {
    parse::point(&text(at)).map_err(|error| PyValueError::new_err(format!("{argument}: {error}")))
}

/// Returns a unit vector, normalized as by the command line.
pub fn direction(argument: &str, direction: [f64; 3]) -> PyResult<Vec3> {
    parse::direction(&text(direction)).map_err(|error| PyValueError::new_err(format!("{argument}: {error}")))
}

/// Returns a number with the limits of the command line, which `parse` has.
pub fn number<T>(argument: &str, value: f64, parse: impl Fn(&str) -> Result<T, String>) -> PyResult<T> {
    parse(&value.to_string()).map_err(|error| PyValueError::new_err(format!("{argument}: {error}")))
}

/// Formats a vector as on the command line, to the bit.
fn text([x, y, z]: [f64; 3]) -> String {
    format!("{x},{y},{z}")
}
