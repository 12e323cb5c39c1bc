//! `--known-length`: the scale of the room from a real length in the photo.

use lightoctree::{Document, KnownLength, KnownLengthError};

use super::parse;
use crate::progress::Stages;
use crate::usage::Usage;

/// Option that scales the room.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct KnownLengthArgs {
    /// Scale the room so that two pixels of the photo are this many metres apart, such as the ends of a door's edge
    ///
    /// The photo stays the same. Objects keep their sizes, positions in metres apply to the scaled room.
    #[arg(long, value_name = "U,V,U,V,METRES", value_parser = parse::known_length, allow_hyphen_values = true)]
    known_length: Option<KnownLength>,
}

impl KnownLengthArgs {
    /// Returns the document with its room scaled as the option says, and prints a note.
    ///
    /// # Errors
    /// No scale follows from the length.
    pub fn apply(&self, document: Document, stages: &Stages) -> anyhow::Result<Document> {
        let Some(known) = &self.known_length else { return Ok(document) };
        let usage = |error: KnownLengthError| Usage(format!("--known-length: {error}"));
        let estimated_m = known.estimated_m(&document.estimate).map_err(usage)?;
        let factor = known.factor(&document.estimate).map_err(usage)?;
        let text = format!("the known length was estimated as {estimated_m:.3} m: the room is scaled by {factor:.3}");
        stages.note(&text);
        Ok(document.scaled(factor).map_err(usage)?)
    }
}
