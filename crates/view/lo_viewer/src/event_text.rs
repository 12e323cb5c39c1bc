use std::borrow::Cow;

use lightoctree::{Stage, Warning};

/// Formats the library's stages and warnings.
#[derive(Clone, Copy)]
pub struct EventText {
    /// Returns the label of a stage.
    pub stage: fn(&Stage) -> Cow<'static, str>,
    /// Returns a warning as a sentence, given the names of the objects.
    pub warning: fn(&Warning, &[String]) -> String,
}
