//! What the targets share.

use std::panic::{set_hook, take_hook};

/// For targets whose readers run foreign decoders behind `catch_unwind`: replaces the panic hook of libFuzzer, which aborts
/// at every panic, by one that aborts only where the panic is in this project's own code.
///
/// A panic of a foreign decoder that leaves its reader still ends the program: libfuzzer-sys aborts for whatever unwinds
/// out of a target. Call it in the target's `init`, after libFuzzer has set its own hook.
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
