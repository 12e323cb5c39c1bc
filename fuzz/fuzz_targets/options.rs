//! Text that a user types or writes: the command line, materials, paths of keyframes, tables of points.
#![no_main]

use clap::Parser;
use libfuzzer_sys::fuzz_target;
use lightoctree::insert::Path;
use lightoctree::mesh::MaterialSpec;

fuzz_target!(|text: &str| {
    let words = std::iter::once("lightoctree").chain(text.split('\n'));
    let _ = lightoctree_cli::cli::Cli::try_parse_from(words);
    let _ = MaterialSpec::parse(text);
    if let Ok(path) = Path::from_json(text) {
        assert!(!path.keyframes.is_empty());
    }
    let _ = lightoctree_cli::commands::probes::points_from_csv(text);
});
