//! Every image reader, on the same bytes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree_fuzz::let_decoders_panic;
use lo_imaging as imaging;

fuzz_target!(init: let_decoders_panic(), |bytes: &[u8]| {
    // The extension is used only if the content is not recognised.
    for name in ["a", "a.hdr", "a.pfm"] {
        let _ = imaging::photo_from_bytes(bytes, name);
    }
    let _ = imaging::radiance_from_bytes(bytes, "a");
    if let Ok(depth_m) = imaging::depth_from_bytes(bytes, "a.npy", Some(1000.0)) {
        assert!(depth_m.pixels().iter().all(|z| z.is_finite() && *z >= 0.0));
    }
    let _ = imaging::inverse_depth_from_bytes(bytes, "a.npz");
    let _ = imaging::rgba8_from_bytes(bytes, "a");
    let _ = imaging::exr_channels_from_bytes(bytes, "a.exr");
});
