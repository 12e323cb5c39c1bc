//! The command line of `lightoctree`.

use std::sync::LazyLock;

use clap::{Parser, Subcommand};

use crate::args::Global;
use crate::commands;

/// Estimates the lighting of a room from one photo, renders HDR panoramas at any point and inserts virtual objects
#[derive(Debug, Parser)]
#[command(
    name = "lightoctree",
    version,
    long_version = LONG_VERSION.as_str(),
    propagate_version = true,
    max_term_width = 110
)]
pub struct Cli {
    /// Global options.
    #[command(flatten)]
    pub global: Global,
    /// Selected command.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Run all steps on a bundled photo
    Demo(commands::demo::Args),
    /// Estimate a scene from a photo, with or without depth
    Estimate(commands::estimate::Args),
    /// Estimate a scene from each of many photos, on one machine or in parts on several
    Batch(Box<commands::batch::Args>),
    /// Render an HDR environment map at a point of a scene
    Envmap(commands::envmap::Args),
    /// Render HDR environment maps at many points of a scene
    Probes(commands::probes::Args),
    /// Insert virtual objects into the photo of a scene
    Insert(Box<commands::insert::Args>),
    /// Move objects and edit lights in the browser
    View(commands::view::Args),
    /// Print the contents of a scene file
    Inspect(commands::inspect::Args),
    /// List and edit the lights of a scene
    Lights(commands::lights::Args),
    /// Convert a scene to PLY, glTF, USD or a web page
    Export(commands::export::Args),
    /// Convert photos of a mirror ball to an HDR panorama
    Unwrap(commands::unwrap::Args),
    /// Print a shell completion script
    Completions(commands::completions::Args),
    /// Write manual pages
    Man(commands::man::Args),
}

/// Version of the program and its weights, as `--version` prints them.
static LONG_VERSION: LazyLock<String> = LazyLock::new(|| {
    #[cfg(feature = "weights")]
    let weights = format!("SHA-256 {}", lo_estimate::WEIGHTS_SHA256);
    #[cfg(not(feature = "weights"))]
    let weights = "none";
    format!("{}\nweights: {weights}", env!("CARGO_PKG_VERSION"))
});

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_version_tells_program_and_weights() {
        let version = Cli::command().render_long_version();
        let (program, weights) = version.split_once('\n').unwrap_or_default();
        assert_eq!(program, concat!("lightoctree ", env!("CARGO_PKG_VERSION")));
        assert!(weights.starts_with(if cfg!(feature = "weights") { "weights: SHA-256 " } else { "weights: none" }));
        assert_eq!(Cli::command().render_version(), format!("{program}\n"));
    }
}
