use std::ffi::CString;

use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::job::{Handler, Report};

/// Passes events to the caller's handler, or shows them as progress bars, and issues warnings.
pub struct Listener<'py> {
    function: Option<Bound<'py, PyAny>>,
    bars: Option<Bound<'py, PyAny>>,
    event: Bound<'py, PyAny>,
    warning: Bound<'py, PyAny>,
}

impl<'py> Listener<'py> {
    /// Listens for a handler. `lightoctree._progress` decides whether to show bars.
    pub fn new(py: Python<'py>, handler: &Handler<'_, 'py>) -> PyResult<Self> {
        let (function, bars) = match handler {
            Handler::Silent => (None, None),
            Handler::Bars => {
                let bars = py.import("lightoctree._progress")?.call_method0("bars")?;
                (None, (!bars.is_none()).then_some(bars))
            }
            Handler::Function(function) => (Some((*function).clone()), None),
        };
        let event = py.import("lightoctree._types")?.getattr("Event")?;
        let warning = py.import("lightoctree._errors")?.getattr("LightOctreeWarning")?;
        Ok(Self { function, bars, event, warning })
    }

    /// Passes a report on.
    ///
    /// # Errors
    /// Exceptions of the handler, and warnings that a filter turns into errors.
    pub fn receive(&mut self, report: &Report) -> PyResult<()> {
        if let Report::Warning { message } = report {
            let text = CString::new(message.replace('\0', ""))?;
            PyErr::warn(self.event.py(), &self.warning, &text, 1)?;
        }
        for handler in self.function.iter().chain(&self.bars) {
            handler.call1((self.event(report)?,))?;
        }
        Ok(())
    }

    fn event(&self, report: &Report) -> PyResult<Bound<'py, PyAny>> {
        let py = self.event.py();
        let fields = PyDict::new(py);
        let kind = match report {
            Report::Begun { stage } => {
                fields.set_item("stage", stage)?;
                "begun"
            }
            Report::Progress { stage, done, total } => {
                fields.set_item("stage", stage)?;
                fields.set_item("done", done)?;
                fields.set_item("total", total)?;
                "progress"
            }
            Report::Done { stage, took } => {
                fields.set_item("stage", stage)?;
                fields.set_item("seconds", took.as_secs_f64())?;
                "done"
            }
            Report::Figures { stage, figures } => {
                let values = PyDict::new(py);
                for figure in figures {
                    values.set_item(figure.name, figure.value)?;
                }
                fields.set_item("stage", stage)?;
                fields.set_item("figures", values)?;
                "figures"
            }
            Report::Warning { message } => {
                fields.set_item("message", message)?;
                "warning"
            }
        };
        self.event.call((kind,), Some(&fields))
    }
}

impl Drop for Listener<'_> {
    fn drop(&mut self) {
        if let Some(bars) = &self.bars {
            // A bar that cannot be removed must not hide the result or the error.
            let _ = bars.call_method0("close");
        }
    }
}
