use lo_insert::InsertError;
use lo_lights::LightsError;

/// An error that prevents an estimate from being lit as requested.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LightingError {
    /// An edit refers to an emitter that does not exist.
    #[error(transparent)]
    Edit(#[from] LightsError),
    /// The white pixel shows no surface.
    #[error("the white pixel: {0}")]
    White(#[source] InsertError),
    /// The white pixel is clipped or black, so it has no colour: which of the two, then column and row.
    #[error("the white pixel ({1}, {2}) is {0}: choose a pixel of another brightness")]
    WhiteWithoutColour(&'static str, f64, f64),
}
