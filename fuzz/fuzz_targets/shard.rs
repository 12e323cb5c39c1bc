//! Shards: the bytes give an error or samples whose photos have their camera's size.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lo_dataset::{Dataset, Shards};

fuzz_target!(|bytes: &[u8]| {
    let mut bytes = bytes.to_vec();
    correct_checksums(&mut bytes);
    let path = std::env::temp_dir().join(format!("lightoctree-fuzz-{}.tar", std::process::id()));
    std::fs::write(&path, bytes).expect("the temporary folder can be written to");
    let Ok(shards) = Shards::open(&path) else { return };
    for index in 0..shards.len() {
        let Ok(sample) = shards.get(index) else { continue };
        let size = (sample.photo.width(), sample.photo.height());
        assert_eq!(size, (sample.camera.width as usize, sample.camera.height as usize));
        assert!(sample.views.iter().flat_map(|view| view.radiance.pixels()).flatten().all(|v| *v >= 0.0));
    }
});

/// Corrects the checksum of every tar header; otherwise nearly every mutation of a header would be rejected.
fn correct_checksums(bytes: &mut [u8]) {
    let mut at = 0;
    while let Some(header) = bytes.get_mut(at..at + 512) {
        header[148..156].fill(b' ');
        let sum: u32 = header.iter().map(|&byte| u32::from(byte)).sum();
        header[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
        let size =
            std::str::from_utf8(&header[124..135]).ok().and_then(|size| u64::from_str_radix(size.trim(), 8).ok());
        let blocks = size.unwrap_or(0).div_ceil(512);
        at = match usize::try_from(blocks).ok().and_then(|n| n.checked_mul(512)).and_then(|n| n.checked_add(at + 512)) {
            Some(next) => next,
            None => return,
        };
    }
}
