//! The command line, paths, materials and tables: text that a user types or writes.
#![no_main]

use clap::Parser;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|text: &str| {
    let _ = lightoctree_cli::args::Cli::try_parse_from(text.split('\n'));
});
