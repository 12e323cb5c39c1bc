//! JPEG XL files by libjxl 0.7, against libjxl's decoded values.

use lo_imaging::{Image, Photo, PhotoFile, photo_from_bytes, read_photo, rgba8_from_bytes, size_from_bytes};

fn file(name: &str) -> String {
    format!("{}/tests/files/{name}", env!("CARGO_MANIFEST_DIR"))
}

fn patch<T: Copy>(image: &Image<T>, row: usize, column: usize) -> T {
    image[(16 * column + 8, 16 * row + 8)]
}

#[test]
fn a_photo_is_upright_with_profile_and_metadata() {
    let PhotoFile { photo, focal, notes, .. } = read_photo(file("display_p3.jxl")).unwrap();
    let Photo::Encoded8(photo) = photo else { panic!("{photo:?}") };
    assert_eq!((photo.image.width(), photo.image.height()), (32, 64));
    // lossless: as stored
    let patches = [
        [[0, 0, 254], [200, 150, 101]],
        [[239, 200, 219], [64, 128, 32]],
        [[128, 128, 128], [254, 0, 0]],
        [[255, 255, 255], [0, 255, 1]],
    ];
    for (row, patches) in patches.iter().enumerate() {
        for (column, &expected) in patches.iter().enumerate() {
            assert_eq!(patch(&photo.image, row, column), expected);
        }
    }
    let profile = photo.encoding.profile.as_ref().unwrap();
    assert!(!profile.is_srgb());
    // [200, 150, 101] by LittleCMS 2.19
    let converted = patch(&photo.srgb8(), 0, 1);
    assert!(converted.iter().zip([209, 147, 92]).all(|(a, b)| a.abs_diff(b) <= 2), "{converted:?}");
    // EXIF is compressed, XMP is not, and the codestream is in two parts
    assert_eq!(focal.equivalent_35mm, Some(26.0));
    assert!(String::from_utf8_lossy(&photo.encoding.xmp).contains("eight patches"));
    assert!(notes.is_empty(), "{notes:?}");
    let mut exif = photo.encoding.exif.clone();
    let orientation = image::metadata::Orientation::remove_from_exif_chunk(&mut exif);
    assert!(orientation.is_none_or(|o| o == image::metadata::Orientation::NoTransforms), "{orientation:?}");
}

#[test]
fn a_lossy_photo_is_srgb() {
    let Photo::Srgb8(image) = read_photo(file("lossy.jxl")).unwrap().photo else { panic!("not sRGB") };
    for ((row, column), expected) in [((0, 1), [201, 150, 100]), ((1, 1), [61, 128, 32]), ((3, 0), [255; 3])] {
        let found = patch(&image, row, column);
        assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1), "{found:?} instead of {expected:?}");
    }
}

#[test]
fn grey_and_alpha_are_read() {
    let Photo::Srgb8(grey) = read_photo(file("grey.jxl")).unwrap().photo else { panic!("not sRGB") };
    assert_eq!((grey.width(), grey.height()), (64, 8));
    assert!((0..64).all(|x| grey[(x, 3)] == [4 * x as u8; 3]));
    let bytes = std::fs::read(file("rgba.jxl")).unwrap();
    let texture = rgba8_from_bytes(&bytes, "a.jxl").unwrap();
    assert_eq!((patch(&texture, 0, 1), patch(&texture, 3, 1)), ([200, 150, 101, 255], [0, 255, 1, 128]));
    assert_eq!(size_from_bytes(&std::fs::read(file("display_p3.jxl")).unwrap(), "a").unwrap(), [64, 32]);
}

#[test]
fn floats_are_radiance_without_clipping() {
    let Photo::Linear(image) = read_photo(file("linear.jxl")).unwrap().photo else { panic!("not linear") };
    for ((row, column), expected) in
        [((0, 0), [0.25; 3]), ((0, 1), [4.5; 3]), ((1, 0), [2.0, 0.5, 0.125]), ((1, 1), [0.0; 3])]
    {
        let found = patch(&image, row, column);
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{found:?} instead of {expected:?}");
    }
}

#[test]
fn hdr_video_curves_are_radiance() {
    let Photo::Linear(image) = read_photo(file("pq.jxl")).unwrap().photo else { panic!("not linear") };
    // SMPTE ST 2084 over BT.2408's white of 203 cd/m²: signals of 0, 0.58 and 0.75
    for ((row, column), expected) in [((0, 0), 0.0), ((0, 1), 0.992), ((1, 0), 4.84)] {
        let found = patch(&image, row, column);
        assert!(found.iter().all(|v| (v - expected).abs() <= 0.02 * expected + 1e-4), "{found:?}: {expected}");
    }
    let [r, g, b] = patch(&image, 1, 1);
    assert!(r > 1.0 && g < 0.1 && b < 0.1, "{r} {g} {b}");
}

#[test]
fn damaged_files_are_errors() {
    for name in ["display_p3.jxl", "linear.jxl", "lossy.jxl", "pq.jxl"] {
        let bytes = std::fs::read(file(name)).unwrap();
        // the last bytes of a codestream may be padding, and XMP follows it in the first file
        let end = if name == "display_p3.jxl" { bytes.len() - 240 } else { bytes.len() - 4 };
        for length in (2..end).step_by(3) {
            assert!(photo_from_bytes(&bytes[..length], "cut.jxl").is_err(), "{name}: {length}");
        }
        // any result, but no panic and no abort
        for at in (0..bytes.len()).step_by(3) {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x55;
            let _ = photo_from_bytes(&damaged, "damaged.jxl");
        }
    }
}

#[test]
fn declared_sizes_are_bounded_before_decoding() {
    // two sizes of 2³⁰, each with its selector, and between them no ratio; then defaults (ISO/IEC 18181-1, SizeHeader)
    let (none, size) = ([false; 64], [true; 32]);
    let bits: Vec<bool> = [&none[..1], &size, &none[..3], &size, &[true; 2], &none].concat();
    let byte = |bits: &[bool]| bits.iter().rev().fold(0, |value, &bit| value << 1 | u8::from(bit));
    let bytes: Vec<u8> = bits.chunks(8).map(byte).collect();
    let error = photo_from_bytes(&[&[0xff, 0x0a][..], &bytes].concat(), "huge.jxl").unwrap_err().to_string();
    assert!(error.contains("too large"), "{error}");
}
