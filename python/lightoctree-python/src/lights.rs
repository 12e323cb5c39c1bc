use lightoctree::Document;
use lightoctree::geometry::Vec3;
use lightoctree::lights::{AnalyticLight, LightChange, LightColor, LightKind, LightOrigin, LightsError, ListedLight};
use lightoctree_cli::commands::lights as commands;
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::Failure;

/// Converts a colour: kelvin, or linear Rec. 709 (r, g, b).
pub fn color(value: &Bound<'_, PyAny>) -> PyResult<LightColor> {
    if let Ok(kelvin) = value.extract() {
        return Ok(LightColor::Kelvin(kelvin));
    }
    let wrong = |_| PyTypeError::new_err(format!("color must be a temperature in kelvin or (r, g, b), not {value}"));
    value.extract().map(LightColor::Rgb).map_err(wrong)
}

/// Converts a value to a class of `lightoctree._types` that has its fields.
pub fn of_json<'py>(py: Python<'py>, class: &str, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    of_fields(class, &fields(py, value)?)
}

/// Converts an entry of the list of lights.
pub fn listed<'py>(py: Python<'py>, light: &ListedLight) -> PyResult<Bound<'py, PyAny>> {
    let fields = fields(py, light)?;
    // Files and `lights --json` keep former names of the origins.
    fields.set_item("origin", origin(light.origin))?;
    if let Some(change) = light.change {
        fields.set_item("change", change_of(py, change)?)?;
    }
    of_fields("Light", &fields)
}

fn change_of<'py>(py: Python<'py>, change: LightChange) -> PyResult<Bound<'py, PyAny>> {
    let LightChange { on, scale, color, at_m } = change;
    let fields = PyDict::new(py);
    fields.set_item("on", on)?;
    fields.set_item("scale", scale)?;
    match color {
        Some(LightColor::Kelvin(kelvin)) => fields.set_item("color", kelvin)?,
        Some(LightColor::Rgb([r, g, b])) => fields.set_item("color", (r, g, b))?,
        None => {}
    }
    fields.set_item("at_m", at_m.map(|at| (at.x, at.y, at.z)))?;
    of_fields("LightChange", &fields)
}

fn fields<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyDict>> {
    Ok(json(py, value)?.cast_into()?)
}

/// Converts a value to dictionaries, lists, strings and numbers, as the command line prints them.
pub fn json<'py>(py: Python<'py>, value: &impl serde::Serialize) -> PyResult<Bound<'py, PyAny>> {
    let value = serde_json::to_value(value).map_err(|error| PyRuntimeError::new_err(error.to_string()))?;
    py.import("json")?.call_method1("loads", (value.to_string(),))
}

fn of_fields<'py>(class: &str, fields: &Bound<'py, PyDict>) -> PyResult<Bound<'py, PyAny>> {
    fields.py().import("lightoctree._types")?.getattr(class)?.call_method1("_of", (fields,))
}

fn origin(origin: LightOrigin) -> &'static str {
    match origin {
        LightOrigin::Observed => "observed",
        LightOrigin::Panorama => "panorama",
        LightOrigin::Inferred => "inferred",
        LightOrigin::Added => "added",
    }
}

/// Adds a light as the command `lights add` does, and returns its name.
///
/// `light` returns the light, and what is to be told about it.
pub fn add(
    document: &mut Document,
    light: impl FnOnce(&Document) -> anyhow::Result<AnalyticLight>,
) -> Result<String, Failure> {
    let added = light(document).and_then(|light| commands::add(document, light));
    added.map_err(of_command)
}

/// Removes an added light as the command `lights remove` does.
pub fn remove(document: &mut Document, id: &str) -> Result<(), Failure> {
    commands::remove(document, id).map_err(of_command)
}

/// Converts an error of the command line, whose options are arguments here.
fn of_command(error: anyhow::Error) -> Failure {
    match error.downcast::<LightsError>() {
        Ok(error) => error.into(),
        Err(error) => Failure::Argument(error.to_string().replace("--", "")),
    }
}

/// Changes a light as the command `lights set` does.
pub fn change(
    document: &mut Document,
    id: &str,
    on: Option<bool>,
    scale: Option<f32>,
    color: Option<LightColor>,
    at: Option<Vec3>,
) -> Result<(), Failure> {
    let light = document.light(id)?;
    if at.is_some() && light.kind == LightKind::Sun {
        return Err(Failure::Argument(format!("at: {id} is a sun, which has no position")));
    }
    let before = document.light_edits.change_of(id);
    let change = LightChange {
        on: on.unwrap_or(before.on),
        scale: scale.unwrap_or(before.scale),
        color: color.or(before.color),
        at_m: at.or(before.at_m),
    };
    if let Some(what) = change.invalid_field() {
        return Err(Failure::Argument(format!("{what} is out of range")));
    }
    if document.light_edits.change(id, light.position_m.unwrap_or(Vec3::ZERO), change) {
        Ok(())
    } else {
        Err(Failure::Argument("the scene already has the maximum of edited lights".to_owned()))
    }
}
