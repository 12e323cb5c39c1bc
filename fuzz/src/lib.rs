//! Shared code of the fuzz targets.

use std::panic::{set_hook, take_hook};

/// Replaces libFuzzer's panic hook, which aborts at every panic, by one that aborts only for panics in this project's
/// code.
///
/// For targets whose readers run third-party decoders behind `catch_unwind`. A decoder's panic that leaves its reader
/// still ends the program, because libfuzzer-sys aborts if a target unwinds. Call this in the target's `init`, after
/// libFuzzer has set its own hook.
pub fn let_decoders_panic() {
    let report_and_abort = take_hook();
    set_hook(Box::new(move |panic| {
        let file = panic.location().map_or("", std::panic::Location::file);
        let foreign = file.contains("/registry/") || file.starts_with("/rustc/");
        if !foreign {
            report_and_abort(panic);
        }
    }));
}
