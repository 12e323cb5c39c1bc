use std::error::Error;
use std::io;

use lightoctree::export::ExportError;
use lightoctree::imaging::ImageError;
use lightoctree::insert::InsertError;
use lightoctree::lights::LightsError;
use lightoctree::scene::SceneError;
use lightoctree::{
    CheckpointError, DocumentError, EstimateError, LightingError, ModelError, PanoramaError, WebExportError,
};
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;

/// The end of a job without a result.
pub enum Failure {
    /// An error of the library, raised as the exception class of this name.
    Library(&'static str, Box<dyn Error + Send + Sync>),
    /// An argument that cannot be used, raised as `ValueError`.
    Argument(String),
    /// The job noticed that its caller has left.
    Cancelled,
}

impl Failure {
    /// Wraps an error of the library that is raised as the class of this name.
    pub fn new(class: &'static str, error: impl Error + Send + Sync + 'static) -> Self {
        Self::Library(class, Box::new(error))
    }

    /// Wraps an error of an argument, with its name.
    pub fn argument(name: &str, error: impl std::fmt::Display) -> Self {
        Self::Argument(format!("{name}: {error}"))
    }

    /// Converts it to a Python exception: `OSError` and its subclasses for errors of the operating system, else the
    /// library's own class.
    pub fn raise(self, py: Python<'_>) -> PyErr {
        match self {
            Self::Library(class, error) => {
                let text = message(&*error);
                os_error(&*error, &text).unwrap_or_else(|| of_class(py, class, text))
            }
            Self::Argument(text) => PyValueError::new_err(text),
            Self::Cancelled => of_class(py, "LightOctreeError", "cancelled".to_owned()),
        }
    }
}

/// Creates an exception of the package.
pub fn of_class(py: Python<'_>, class: &str, message: String) -> PyErr {
    match py.import("lightoctree._errors").and_then(|module| module.getattr(class)?.call1((message,))) {
        Ok(exception) => PyErr::from_value(exception),
        Err(error) => error,
    }
}

/// Returns the exception of the first error of input or output in the chain of causes, if the operating system
/// reported it.
fn os_error(error: &(dyn Error + 'static), text: &str) -> Option<PyErr> {
    let error = causes(error).find_map(|cause| cause.downcast_ref::<io::Error>())?;
    match (error.raw_os_error(), error.kind()) {
        (Some(code), _) => Some(PyOSError::new_err((code, text.replace(&format!(" (os error {code})"), "")))),
        // With a message of ours, there is only the kind.
        (None, io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput | io::ErrorKind::Other) => None,
        (None, kind) => Some(io::Error::new(kind, text.to_owned()).into()),
    }
}

/// Joins the chain of causes, without those that the text before them already contains.
fn message(error: &(dyn Error + 'static)) -> String {
    let mut text = String::new();
    for cause in causes(error).map(ToString::to_string) {
        if text.is_empty() {
            text = cause;
        } else if !text.contains(&cause) {
            text = format!("{text}: {cause}");
        }
    }
    text
}

fn causes<'a>(error: &'a (dyn Error + 'static)) -> impl Iterator<Item = &'a (dyn Error + 'static)> {
    std::iter::successors(Some(error), |&error| error.source())
}

impl From<EstimateError> for Failure {
    fn from(error: EstimateError) -> Self {
        match error {
            EstimateError::Cancelled(_) => Self::Cancelled,
            error => Self::new("EstimateError", error),
        }
    }
}

impl From<InsertError> for Failure {
    fn from(error: InsertError) -> Self {
        match error {
            InsertError::Cancelled(_) => Self::Cancelled,
            error => Self::new("InsertError", error),
        }
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        Self::new("InsertError", error)
    }
}

impl From<ImageError> for Failure {
    fn from(error: ImageError) -> Self {
        Self::new("ImageError", error)
    }
}

impl From<PanoramaError> for Failure {
    fn from(error: PanoramaError) -> Self {
        Self::new("ImageError", error)
    }
}

impl From<DocumentError> for Failure {
    fn from(error: DocumentError) -> Self {
        match error {
            // A transparent error is not among its causes.
            DocumentError::Scene(SceneError::Write(error)) => Self::new("SceneError", error),
            error => Self::new("SceneError", error),
        }
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            // Transparent errors are not among their causes.
            ExportError::Io(error) => Self::new("SceneError", error),
            ExportError::Image(error) => Self::new("SceneError", error),
            error => Self::new("SceneError", error),
        }
    }
}

impl From<LightingError> for Failure {
    fn from(error: LightingError) -> Self {
        Self::new("LightsError", error)
    }
}

impl From<LightsError> for Failure {
    fn from(error: LightsError) -> Self {
        Self::new("LightsError", error)
    }
}

impl From<CheckpointError> for Failure {
    fn from(error: CheckpointError) -> Self {
        Self::new("EstimateError", error)
    }
}

impl From<WebExportError> for Failure {
    fn from(error: WebExportError) -> Self {
        match error {
            WebExportError::Export(error) => error.into(),
            WebExportError::Cancelled(_) => Self::Cancelled,
        }
    }
}
