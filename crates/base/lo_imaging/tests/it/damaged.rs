//! Damaged, truncated and malicious files return errors: no panic, no huge allocation.

use lo_imaging::{DepthMap, ExrOptions, Image, ImageError, RadianceImage};

/// A small valid file of each format.
fn samples() -> Vec<(&'static str, Vec<u8>)> {
    let folder = tempfile::tempdir().unwrap();
    let radiance = RadianceImage::from_fn(20, 12, |x, y| [x as f32, y as f32 * 0.1, 7.5]);
    let depth = DepthMap::from_fn(20, 12, |x, y| (x + y) as f32 * 0.1);
    let picture = Image::from_fn(20, 12, |x, y| [x as u8 * 10, y as u8 * 20, 128]);
    let file = |name: &'static str, write: &dyn Fn(&std::path::Path)| {
        let path = folder.path().join(name);
        write(&path);
        (name, std::fs::read(path).unwrap())
    };
    let mut samples = vec![
        file("r.exr", &|p| lo_imaging::write_radiance(p, &radiance, &ExrOptions::default()).unwrap()),
        file("h.exr", &|p| {
            lo_imaging::write_radiance(p, &radiance, &ExrOptions { half: true, ..ExrOptions::default() }).unwrap();
        }),
        file("r.hdr", &|p| lo_imaging::write_radiance(p, &radiance, &ExrOptions::default()).unwrap()),
        file("r.pfm", &|p| lo_imaging::write_radiance(p, &radiance, &ExrOptions::default()).unwrap()),
        file("p.png", &|p| lo_imaging::write_srgb8(p, &picture, 90, lo_imaging::GENERATOR).unwrap()),
        file("p.jpg", &|p| lo_imaging::write_srgb8(p, &picture, 90, lo_imaging::GENERATOR).unwrap()),
        file("d.png", &|p| lo_imaging::write_depth(p, &depth, lo_imaging::GENERATOR).unwrap()),
        file("d.npy", &|p| lo_imaging::write_depth(p, &depth, lo_imaging::GENERATOR).unwrap()),
        file("d.exr", &|p| lo_imaging::write_depth(p, &depth, lo_imaging::GENERATOR).unwrap()),
    ];
    for format in [image::ImageFormat::Tiff, image::ImageFormat::WebP, image::ImageFormat::Bmp, image::ImageFormat::Pnm]
    {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let rgb = image::RgbImage::from_fn(20, 12, |x, y| image::Rgb([x as u8 * 9, y as u8 * 20, 77]));
        rgb.write_to(&mut bytes, format).unwrap();
        samples.push(("picture", bytes.into_inner()));
    }
    let mut bytes = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut bytes).unwrap();
    encoder.write_image::<tiff::encoder::colortype::Gray32Float>(20, 12, depth.pixels()).unwrap();
    samples.push(("d.tif", bytes.into_inner()));
    for compression in [
        exr::compression::Compression::RLE,
        exr::compression::Compression::PIZ,
        exr::compression::Compression::PXR24,
        exr::compression::Compression::B44A,
    ] {
        samples.push(("compressed.exr", exr_sample(compression, exr::image::Blocks::ScanLines).1));
    }
    samples
}

/// Writes an EXR with the exr crate: the image and the file.
fn exr_sample(compression: exr::compression::Compression, blocks: exr::image::Blocks) -> (RadianceImage, Vec<u8>) {
    use exr::prelude::*;
    let picture = RadianceImage::from_fn(40, 70, |x, y| [x as f32 / 4.0, y as f32 * 0.5, 3.0]);
    let channels = SpecificChannels::rgb(|Vec2(x, y): Vec2<usize>| {
        let [r, g, b] = picture[(x, y)];
        (f16::from_f32(r), f16::from_f32(g), b)
    });
    let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
    let layer = Layer::new((40, 70), LayerAttributes::default(), encoding, channels);
    let mut bytes = std::io::Cursor::new(Vec::new());
    Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes).unwrap();
    (picture, bytes.into_inner())
}

fn read_all_ways(name: &str, bytes: &[u8]) {
    let _ = lo_imaging::photo_from_bytes(bytes, name);
    let _ = lo_imaging::radiance_from_bytes(bytes, name);
    let _ = lo_imaging::depth_from_bytes(bytes, name, None);
    let _ = lo_imaging::rgba8_from_bytes(bytes, name);
    let _ = lo_imaging::exr_channels_from_bytes(bytes, name);
}

#[test]
fn every_exr_compression_and_layout_is_read() {
    use exr::compression::Compression::*;
    use exr::image::Blocks;
    for compression in [Uncompressed, RLE, ZIP1, ZIP16, PIZ, PXR24, B44, B44A] {
        for blocks in [Blocks::ScanLines, Blocks::Tiles(exr::math::Vec2(16, 16))] {
            let (picture, bytes) = exr_sample(compression, blocks);
            let back = lo_imaging::radiance_from_bytes(&bytes, "c.exr").unwrap();
            for (a, b) in back.pixels().iter().zip(picture.pixels()) {
                // B44 keeps 6 bits of each half, PXR24 16 bits of the float
                let tolerance = if matches!(compression, B44 | B44A) { 0.5 } else { 1e-4 };
                assert!((0..3).all(|c| (a[c] - b[c]).abs() <= tolerance), "{compression} {blocks:?}: {a:?} {b:?}");
            }
        }
    }
}

#[test]
fn truncated_files_never_panic() {
    for (name, bytes) in samples() {
        lo_imaging::photo_from_bytes(&bytes, name)
            .map(|_| ())
            .or_else(|_| lo_imaging::depth_from_bytes(&bytes, name, None).map(|_| ()))
            .unwrap();
        // all short prefixes, then every seventh
        for length in (0..bytes.len()).filter(|&l| l < 400 || l % 7 == 0) {
            read_all_ways(name, &bytes[..length]);
        }
    }
}

#[test]
fn flipped_bytes_never_panic() {
    let mut state = 7u64;
    let mut random = move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize
    };
    for (name, bytes) in samples() {
        for _ in 0..400 {
            let mut damaged = bytes.clone();
            for _ in 0..1 + random() % 3 {
                // mostly in the header, where damage matters most
                let range = if random() % 3 == 0 { bytes.len() } else { bytes.len().min(420) };
                damaged[random() % range] = match random() % 4 {
                    0 => 0,
                    1 => 255,
                    _ => random() as u8,
                };
            }
            read_all_ways(name, &damaged);
        }
    }
}

#[test]
fn sizes_are_checked_before_memory_is_taken() {
    let too_large = |bytes: &[u8], name: &str| {
        let error = lo_imaging::radiance_from_bytes(bytes, name).unwrap_err();
        assert!(matches!(error, ImageError::TooLarge { .. }), "{name}: {error}");
    };
    too_large(b"#?RADIANCE\n\n-Y 60000 +X 60000\n\x02\x02\x7f\x00", "bomb.hdr");
    too_large(b"#?RADIANCE\n\n-Y 16000 +X 16000\n\x02\x02\x7f\x00", "bomb.hdr");
    too_large(b"PF\n60000 60000\n-1\n", "bomb.pfm");
    too_large(b"P6 60000 60000 255\n", "bomb.ppm");
    // a PNG's size is in bytes 16 to 24; its checksum must match
    let mut png = lo_imaging::encode_png(&Image::from_fn(8, 8, |_, _| [1; 3]));
    png[16..24].copy_from_slice(&[0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60]);
    let sum = crc32(&png[12..29]);
    png[29..33].copy_from_slice(&sum.to_be_bytes());
    too_large(&png, "bomb.png");
    // 16 bits, 16,000 × 16,000 pixels in 1.5 MB, as deflate can hold: 3 GB as floats
    png[16..26].copy_from_slice(&[0, 0, 0x3e, 0x80, 0, 0, 0x3e, 0x80, 16, 2]);
    let sum = crc32(&png[12..29]);
    png[29..33].copy_from_slice(&sum.to_be_bytes());
    let length = 1_500_000u32.to_be_bytes();
    let idat = [&png[..33], &length, b"IDAT", &vec![0; 1_500_000]].concat();
    too_large(&idat, "deep.png");
    // an EXR's data window: the attribute's four numbers
    let (_, mut exr) = exr_sample(exr::compression::Compression::ZIP16, exr::image::Blocks::ScanLines);
    let at = exr.windows(11).position(|w| w == b"dataWindow\0").unwrap() + 11 + 6 + 4;
    exr[at..at + 16].copy_from_slice(&[0, 0, 0, 0, 0, 0, 0, 0, 0x5f, 0xea, 0, 0, 0x5f, 0xea, 0, 0]);
    let error = lo_imaging::radiance_from_bytes(&exr, "bomb.exr").unwrap_err();
    assert!(matches!(error, ImageError::TooLarge { .. } | ImageError::Invalid { .. }), "{error}");
    // an image without pixels is an error too
    let small = lo_imaging::radiance_from_bytes(b"#?RADIANCE\n\n-Y 2 +X 0\n", "empty.hdr").unwrap_err().to_string();
    assert!(small.contains("no pixels"), "{small}");
}

/// CRC-32 of PNG (ISO 3309), bit by bit.
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & (crc & 1).wrapping_neg()))
    })
}
