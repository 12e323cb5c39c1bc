//! HEIC files by libheif 1.23 and x265, against libheif's decoded values, and gain maps.

use lo_imaging::{Image, Photo, PhotoFile, PhotoNote, photo_from_bytes, read_photo, rgba8_from_bytes, size_from_bytes};

fn file(name: &str) -> String {
    format!("{}/tests/files/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Eight patches of 16 × 16 pixels, turned by the file: stored values as libheif decodes them.
const PATCHES: [[[u8; 3]; 2]; 4] = [
    [[0, 0, 254], [200, 150, 101]],
    [[239, 200, 219], [64, 128, 32]],
    [[128, 128, 128], [254, 0, 0]],
    [[255, 255, 255], [0, 255, 1]],
];

fn patch<T: Copy>(image: &Image<T>, row: usize, column: usize) -> T {
    image[(16 * column + 8, 16 * row + 8)]
}

#[test]
fn a_photo_is_upright_with_profile_and_metadata() {
    let PhotoFile { photo, focal, notes, .. } = read_photo(file("display_p3.heic")).unwrap();
    let Photo::Encoded8(photo) = photo else { panic!("{photo:?}") };
    assert_eq!((photo.image.width(), photo.image.height()), (32, 64));
    for (row, patches) in PATCHES.iter().enumerate() {
        for (column, expected) in patches.iter().enumerate() {
            let found = patch(&photo.image, row, column);
            assert!(found.iter().zip(expected).all(|(a, b)| a.abs_diff(*b) <= 1), "{found:?} instead of {expected:?}");
        }
    }
    let profile = photo.encoding.profile.as_ref().unwrap();
    assert_eq!((profile.name(), profile.is_srgb()), ("P3", false));
    // [200, 150, 100] by LittleCMS 2.19
    let converted = patch(&photo.srgb8(), 0, 1);
    assert!(converted.iter().zip([209, 147, 91]).all(|(a, b)| a.abs_diff(b) <= 2), "{converted:?}");
    assert_eq!(focal.equivalent_35mm, Some(26.0));
    assert!(notes.is_empty(), "{notes:?}");
    // the tag that turns the picture is gone: the pixels are upright
    let mut exif = photo.encoding.exif.clone();
    let orientation = image::metadata::Orientation::remove_from_exif_chunk(&mut exif);
    assert!(orientation.is_none_or(|o| o == image::metadata::Orientation::NoTransforms), "{orientation:?}");
}

#[test]
fn sizes_and_textures_are_read() {
    let bytes = std::fs::read(file("display_p3.heic")).unwrap();
    assert_eq!(size_from_bytes(&bytes, "a.heic").unwrap(), [64, 32]);
    let texture = rgba8_from_bytes(&bytes, "a.heic").unwrap();
    assert_eq!((texture.width(), texture.height(), patch(&texture, 3, 0)[3]), (32, 64, 255));
}

#[test]
fn ten_bits_of_hdr_are_radiance() {
    let Photo::Linear(image) = read_photo(file("pq.heic")).unwrap().photo else { panic!("not linear") };
    // SMPTE ST 2084 over BT.2408's white of 203 cd/m²: signals of 0, 0.58 and 0.75
    for ((row, column), expected) in [((0, 0), 0.0), ((0, 1), 0.992), ((1, 0), 4.84)] {
        let found = patch(&image, row, column);
        assert!(found.iter().all(|v| (v - expected).abs() <= 0.02 * expected + 1e-4), "{found:?}: {expected}");
    }
    // saturated in BT.2020
    let [r, g, b] = patch(&image, 1, 1);
    assert!(r > 1.0 && g < 0.1 && b < 0.1, "{r} {g} {b}");
}

fn encode(image: &Image<[u8; 3]>, clipped_stops: Option<f32>) -> Vec<u8> {
    let (width, height) = (image.width() as u32, image.height() as u32);
    let options = heifer::EncodeOptions { quality: 95, ..Default::default() };
    let Some(stops) = clipped_stops else {
        return heifer::encode_rgb8(width, height, image.pixels().as_flattened(), &options).unwrap();
    };
    let mut base = heifer::Image::filled(width, height, 8, [0, 0, 0, 255]);
    for (stored, pixel) in base.data.as_chunks_mut::<4>().0.iter_mut().zip(image.pixels()) {
        *stored = [pixel[0].into(), pixel[1].into(), pixel[2].into(), 255];
    }
    let bright = |v: u8| if v == 255 { stops.exp2() } else { lo_imaging::linear_from_srgb8(v) };
    let data = image.pixels().as_flattened().iter().map(|&v| bright(v)).collect();
    let hdr = heifer::HdrImage { width, height, headroom: stops.exp2(), data };
    heifer::encode_hdr(&base, &hdr, &options).unwrap()
}

#[test]
fn a_gain_map_gives_the_radiance_of_clipped_pixels() {
    let image = Image::from_fn(128, 96, |x, _| if x < 64 { [120; 3] } else { [255; 3] });
    let read = photo_from_bytes(&encode(&image, Some(2.0)), "a.heic").unwrap();
    let radiance = read.photo.radiance();
    assert!((radiance[(32, 48)][0] - lo_imaging::linear_from_srgb8(120)).abs() < 0.01, "{:?}", radiance[(32, 48)]);
    assert!((radiance[(100, 48)][0] / 4.0 - 1.0).abs() < 0.05, "{:?}", radiance[(100, 48)]);
    assert!(matches!(read.notes[..], [PhotoNote::GainMap { share, .. }] if (share - 0.5).abs() < 0.05), "{read:?}");
    // sRGB, as the container says
    let plain = photo_from_bytes(&encode(&image, None), "a.heic").unwrap();
    assert!(matches!(plain.photo, Photo::Srgb8(_)), "{:?}", plain.photo);
}

#[test]
fn a_grid_of_tiles_is_one_picture() {
    let image = Image::from_fn(1100, 700, |x, y| [(x / 5) as u8, (y / 3) as u8, 90]);
    let bytes = encode(&image, None);
    let Photo::Srgb8(read) = photo_from_bytes(&bytes, "a.heic").unwrap().photo else { panic!("not sRGB") };
    assert_eq!((read.width(), read.height()), (1100, 700));
    let error: u64 = read
        .pixels()
        .as_flattened()
        .iter()
        .zip(image.pixels().as_flattened())
        .map(|(a, b)| u64::from(a.abs_diff(*b)))
        .sum();
    assert!(error < 2 * 3 * 1100 * 700, "mean difference {}", error as f64 / (3.0 * 1100.0 * 700.0));
}

#[test]
fn damaged_files_are_errors() {
    for name in ["display_p3.heic", "pq.heic"] {
        let bytes = std::fs::read(file(name)).unwrap();
        for length in (0..bytes.len()).step_by(7) {
            assert!(photo_from_bytes(&bytes[..length], "cut.heic").is_err(), "{length}");
        }
        // any result, but no panic and no abort
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x55;
            let _ = photo_from_bytes(&damaged, "damaged.heic");
        }
    }
}

#[test]
fn declared_sizes_are_bounded_before_decoding() {
    let bytes = std::fs::read(file("display_p3.heic")).unwrap();
    // the property ispe: 64 × 32
    let at = bytes.windows(4).position(|w| w == b"ispe").unwrap() + 8;
    let mut huge = bytes.clone();
    huge[at..at + 8].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 1]);
    let error = photo_from_bytes(&huge, "huge.heic").unwrap_err().to_string();
    assert!(error.contains("too large"), "{error}");
}
