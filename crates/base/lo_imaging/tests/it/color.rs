//! Colour profiles, against LittleCMS 2.19 (relative colorimetric, without black point compensation), and metadata that
//! photos keep.

use std::path::Path;

use image::ImageEncoder;
use image::codecs::png::PngEncoder;
use lo_imaging::{GainMapParameters, Image, Photo, PhotoFile, PhotoNote};
use moxcms::{ColorProfile, curve_from_gamma};

/// Stored values of the tested pixels.
const PIXELS: [[u8; 3]; 13] = [
    [0, 0, 0],
    [255, 255, 255],
    [128, 128, 128],
    [200, 150, 100],
    [64, 128, 32],
    [255, 0, 0],
    [0, 255, 0],
    [0, 0, 255],
    [20, 30, 40],
    [240, 200, 220],
    [3, 2, 1],
    [250, 128, 5],
    [90, 200, 180],
];

fn with_gamma(gamma: f32) -> ColorProfile {
    let mut profile = ColorProfile::new_srgb();
    let curve = || Some(curve_from_gamma(gamma));
    (profile.cicp, profile.red_trc, profile.green_trc, profile.blue_trc) = (None, curve(), curve(), curve());
    profile
}

fn png(pixels: &[[u8; 3]], icc: Vec<u8>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = PngEncoder::new(&mut bytes);
    encoder.set_icc_profile(icc).unwrap();
    encoder.write_image(pixels.as_flattened(), pixels.len() as u32, 1, image::ExtendedColorType::Rgb8).unwrap();
    bytes
}

fn read(bytes: &[u8]) -> PhotoFile {
    lo_imaging::photo_from_bytes(bytes, "photo").unwrap()
}

#[track_caller]
fn assert_near(found: &[[u8; 3]], expected: &[[u8; 3]]) {
    assert_eq!(found.len(), expected.len());
    for (index, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!(a.iter().zip(b).all(|(a, b)| a.abs_diff(*b) <= 1), "pixel {index}: {a:?} instead of {b:?}");
    }
}

#[test]
fn rgb_profiles_convert_as_by_littlecms() {
    let p3 = [
        [0, 0, 0],
        [255, 255, 255],
        [128, 128, 128],
        [209, 147, 91],
        [32, 130, 0],
        [255, 0, 0],
        [0, 255, 0],
        [0, 0, 255],
        [17, 30, 41],
        [248, 198, 221],
        [3, 2, 1],
        [255, 119, 0],
        [0, 203, 180],
    ];
    let adobe = [
        [0, 0, 0],
        [255, 255, 255],
        [129, 129, 129],
        [217, 151, 97],
        [0, 129, 5],
        [255, 0, 0],
        [0, 255, 0],
        [0, 0, 255],
        [5, 24, 36],
        [254, 201, 222],
        [0, 0, 0],
        [255, 129, 0],
        [0, 201, 181],
    ];
    let prophoto = [
        [0, 0, 0],
        [255, 255, 255],
        [146, 146, 146],
        [252, 154, 108],
        [0, 157, 0],
        [255, 0, 0],
        [0, 255, 0],
        [0, 0, 255],
        [0, 42, 55],
        [255, 202, 229],
        [2, 1, 0],
        [255, 103, 0],
        [0, 226, 191],
    ];
    let linear = [
        [0, 0, 0],
        [255, 255, 255],
        [188, 188, 188],
        [229, 202, 168],
        [137, 188, 99],
        [255, 0, 0],
        [1, 255, 0],
        [0, 0, 255],
        [79, 96, 110],
        [248, 229, 239],
        [28, 22, 13],
        [253, 188, 38],
        [160, 229, 219],
    ];
    let gamma = [
        [0, 0, 0],
        [255, 255, 255],
        [129, 129, 129],
        [201, 151, 100],
        [62, 129, 26],
        [255, 0, 0],
        [1, 255, 0],
        [0, 0, 255],
        [12, 24, 35],
        [240, 201, 221],
        [0, 0, 0],
        [250, 129, 1],
        [90, 201, 182],
    ];
    let profiles = [
        (ColorProfile::new_display_p3(), p3),
        (ColorProfile::new_adobe_rgb(), adobe),
        (ColorProfile::new_pro_photo_rgb(), prophoto),
        (with_gamma(1.0), linear),
        (with_gamma(2.2), gamma),
    ];
    for (profile, expected) in profiles {
        let file = read(&png(&PIXELS, profile.encode().unwrap()));
        assert_eq!(file.notes, []);
        assert_near(file.photo.srgb8().pixels(), &expected);
        // 16 bits are converted alike
        let samples: Vec<u8> = PIXELS.iter().flatten().flat_map(|&v| (u16::from(v) * 257).to_ne_bytes()).collect();
        let mut deep = Vec::new();
        let mut encoder = PngEncoder::new(&mut deep);
        encoder.set_icc_profile(profile.encode().unwrap()).unwrap();
        encoder.write_image(&samples, PIXELS.len() as u32, 1, image::ExtendedColorType::Rgb16).unwrap();
        assert_near(read(&deep).photo.srgb8().pixels(), &expected);
    }
    // a profile of sRGB changes nothing
    let file = read(&png(&PIXELS, ColorProfile::new_srgb().encode().unwrap()));
    assert_eq!(file.photo.srgb8().pixels(), PIXELS);
}

#[test]
fn grey_and_cmyk_profiles_convert_as_by_littlecms() {
    let mut bytes = Vec::new();
    let mut encoder = PngEncoder::new(&mut bytes);
    encoder.set_icc_profile(ColorProfile::new_gray_with_gamma(2.2).encode().unwrap()).unwrap();
    encoder.write_image(&[0, 10, 60, 128, 200, 255], 6, 1, image::ExtendedColorType::L8).unwrap();
    assert_near(read(&bytes).photo.srgb8().pixels(), &[0, 3, 57, 129, 201, 255].map(|v| [v; 3]));

    let files = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/files");
    let expected = [
        [255, 255, 255],
        [0, 141, 218],
        [218, 5, 115],
        [255, 230, 5],
        [1, 1, 1],
        [97, 120, 148],
        [145, 87, 24],
        [37, 41, 124],
    ];
    for name in ["cmyk.tif", "cmyk.jpg"] {
        let file = lo_imaging::read_photo(files.join(name)).unwrap();
        assert_eq!(file.notes, [], "{name}");
        let photo = file.photo.srgb8();
        let centres: Vec<[u8; 3]> = (0..8).map(|patch| photo[(16 * patch + 8, 8)]).collect();
        // decoders of JPEG differ by 1 in the stored values
        let far = |(a, b): (&u8, &u8)| a.abs_diff(*b) > if name == "cmyk.tif" { 1 } else { 2 };
        assert!(!centres.iter().flatten().zip(expected.iter().flatten()).any(far), "{name}: {centres:?}");
    }
}

/// A PNG with chunks before its pixels.
fn png_with(pixels: &[[u8; 3]], chunks: &[(&[u8; 4], Vec<u8>)]) -> Vec<u8> {
    let png = lo_imaging::encode_png(&Image::new(pixels.len(), 1, pixels.to_vec()));
    let mut bytes = png[..33].to_vec();
    for (name, data) in chunks {
        let content = [&name[..], data].concat();
        bytes.extend((data.len() as u32).to_be_bytes());
        bytes.extend(&content);
        bytes.extend(crc32fast::hash(&content).to_be_bytes());
    }
    bytes.extend(&png[33..]);
    bytes
}

#[test]
fn chunks_of_a_png_state_its_colour_space() {
    let pixels = [[128, 128, 128], [200, 150, 100]];
    let words = |values: &[u32]| values.iter().flat_map(|v| v.to_be_bytes()).collect::<Vec<u8>>();
    let read = |chunks: &[(&[u8; 4], Vec<u8>)]| read(&png_with(&pixels, chunks)).photo;
    // PNG 3: the value that writers of sRGB state means its curve
    assert_eq!(read(&[(b"gAMA", words(&[45455]))]), Photo::Srgb8(Image::new(2, 1, pixels.to_vec())));
    let linear = read(&[(b"gAMA", words(&[100_000]))]);
    assert!((linear.linear_at((0, 0))[0] - 128.0 / 255.0).abs() < 1e-5);
    // cHRM of Display P3 with a power of 2.2, and cICP with sRGB's curve
    let primaries = words(&[31270, 32900, 68000, 32000, 26500, 69000, 15000, 6000]);
    let by_primaries = read(&[(b"gAMA", words(&[45455])), (b"cHRM", primaries)]);
    // by CSS Color 4's matrix in double precision
    assert_near(by_primaries.srgb8().pixels(), &[[129; 3], [210, 149, 91]]);
    let by_points = read(&[(b"cICP", vec![12, 13, 0, 1])]);
    assert_near(by_points.srgb8().pixels(), &[[128; 3], [209, 147, 91]]);
    // the perceptual quantizer: 58 % of the signal is 203 cd/m², the reference white (ITU-R BT.2408-7, table 1)
    let white = png_with(&[[148; 3]], &[(b"cICP", vec![9, 16, 0, 1])]);
    let value = self::read(&white).photo.linear_at((0, 0));
    assert!(value.iter().all(|v| (v - 1.0).abs() < 0.03), "{value:?}");
}

#[test]
fn profiles_that_cannot_be_used_are_named() {
    let damaged = read(&png(&PIXELS, b"no profile at all".to_vec()));
    assert!(matches!(damaged.notes[..], [PhotoNote::UnusableProfile { .. }]), "{:?}", damaged.notes);
    assert_eq!(damaged.photo, Photo::Srgb8(Image::new(13, 1, PIXELS.to_vec())));
    // 48 MB of zeros in 50 kB
    let bomb = png(&PIXELS, vec![0; 48 << 20]);
    assert!(bomb.len() < 1 << 20);
    assert!(matches!(read(&bomb).notes[..], [PhotoNote::UnusableProfile { .. }]));
}

#[test]
fn written_photos_keep_profile_and_metadata() {
    let folder = tempfile::tempdir().unwrap();
    let p3 = ColorProfile::new_display_p3().encode().unwrap();
    let mut exif = crate::exif::block(6, &[(0x920a, 5, 4250)]);
    let xmp = br#"<x:xmpmeta xmlns:x="adobe:ns:meta/"></x:xmpmeta>"#;
    let stored = [[10, 200, 30], [250, 20, 128]];
    let mut bytes = Vec::new();
    let mut encoder = PngEncoder::new(&mut bytes);
    encoder.set_icc_profile(p3.clone()).unwrap();
    encoder.set_exif_metadata(exif.clone()).unwrap();
    encoder.write_image(stored.as_flattened(), 2, 1, image::ExtendedColorType::Rgb8).unwrap();
    let chunk = [b"XML:com.adobe.xmp\0\0\0\0\0", &xmp[..]].concat();
    let content = [b"iTXt", &chunk[..]].concat();
    let crc = crc32fast::hash(&content).to_be_bytes();
    let inserted = [&(chunk.len() as u32).to_be_bytes()[..], &content, &crc].concat();
    bytes.splice(33..33, inserted);

    let file = read(&bytes);
    assert_eq!((file.photo.width(), file.photo.height()), (1, 2), "turned by its orientation");
    let upright = image::metadata::Orientation::remove_from_exif_chunk(&mut exif);
    assert_eq!(upright, Some(image::metadata::Orientation::Rotate90));
    for name in ["a.png", "a.jpg"] {
        let path = folder.path().join(name);
        lo_imaging::write_photo(&path, &file.photo, "tests").unwrap();
        let back = lo_imaging::read_photo(&path).unwrap().photo;
        let Photo::Encoded8(back) = back else { panic!("{name}") };
        assert_eq!(back.encoding.profile.as_ref().unwrap().icc(), p3, "{name}");
        assert_eq!(back.encoding.exif, exif, "{name}");
        assert_eq!(back.encoding.xmp, xmp, "{name}");
        if name == "a.png" {
            assert_eq!(back.image.pixels(), stored);
        }
    }
    // encoding undoes decoding for each code
    let Photo::Encoded8(photo) = &file.photo else { panic!() };
    for v in 0..=255u8 {
        for pixel in [[v; 3], [v, 0, 255], [30, v, 90], [255, 128, v]] {
            assert_eq!(photo.encoding.code(photo.encoding.linear(pixel)), pixel);
        }
    }
}

#[test]
fn inputs_with_profiles_have_the_means_of_their_readme() {
    let Some(inputs) = lo_testdata::shared_data("inputs", "colour profiles of photos") else { return };
    let mean = |name: &str| {
        let photo = lo_imaging::read_photo(inputs.join(name)).unwrap().photo.srgb8();
        let count = photo.pixels().len() as f64;
        [0, 1, 2].map(|c| photo.pixels().iter().map(|p| f64::from(p[c])).sum::<f64>() / count)
    };
    let base = [144.9, 130.5, 106.5];
    let expected = [
        ("base.jpg", base),
        ("p3.jpg", [147.8, 129.9, 103.0]),
        ("p3.png", [147.8, 129.9, 103.0]),
        ("adobergb.jpg", [150.1, 130.6, 104.7]),
        ("linear_icc.png", base),
    ];
    for (name, expected) in expected {
        let found = mean(name);
        // decoders of JPEG differ by some tenths
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.4), "{name}: {found:?}");
    }
}

#[test]
fn a_gain_map_gives_highlights() {
    let Some(inputs) = lo_testdata::shared_data("inputs", "a photo with a gain map") else { return };
    let file = lo_imaging::read_photo(inputs.join("ultrahdr.jpg")).unwrap();
    let [PhotoNote::GainMap { share, stops }] = file.notes[..] else { panic!("{:?}", file.notes) };
    assert!(share > 0.001 && stops > 0.5 && stops <= 1.1, "{share} {stops}");
    let Photo::Encoded8(photo) = &file.photo else { panic!() };
    assert_eq!(photo.encoding.gain_map.as_ref().unwrap().parameters, GainMapParameters::default());
    // what is shown stays
    let base = lo_imaging::read_photo(inputs.join("base.jpg")).unwrap().photo.srgb8();
    let shown = file.photo.srgb8();
    let differing = shown.pixels().iter().zip(base.pixels()).filter(|(a, b)| a != b).count();
    assert_eq!(differing, 0);
}

#[test]
fn a_cut_off_jpeg_is_named() {
    let Some(inputs) = lo_testdata::shared_data("inputs", "a truncated photo") else { return };
    let file = lo_imaging::read_photo(inputs.join("truncated.jpg")).unwrap();
    let [PhotoNote::Truncated { missing }] = file.notes[..] else { panic!("{:?}", file.notes) };
    assert!((0.45..0.55).contains(&missing), "{missing}");
    let rows = (480.0 * missing).round() as usize;
    let base = lo_imaging::read_photo(inputs.join("base.jpg")).unwrap().photo.srgb8();
    let photo = file.photo.srgb8();
    for (x, y) in (0..480).flat_map(|y| (0..640).map(move |x| (x, y))) {
        let expected = if y < 480 - rows { base[(x, y)] } else { [0; 3] };
        assert_eq!(photo[(x, y)], expected, "{x} {y}");
    }
    assert_eq!(lo_imaging::read_photo(inputs.join("base.jpg")).unwrap().notes, []);
    // most of it missing, and only the end
    let whole = std::fs::read(inputs.join("base.jpg")).unwrap();
    let error = lo_imaging::photo_from_bytes(&whole[..whole.len() / 5], "cut.jpg").unwrap_err().to_string();
    assert!(error.contains("cut.jpg") && error.contains("cut off"), "{error}");
    assert_eq!(read(&whole[..whole.len() - 2]).notes, [PhotoNote::Truncated { missing: 0.0 }]);
}

#[test]
fn radiance_files_with_faults_are_read_with_a_note() {
    let Some(inputs) = lo_testdata::shared_data("inputs", "radiance files with faults") else { return };
    let read = |name: &str| lo_imaging::read_photo(inputs.join(name)).unwrap();
    let exposure = read("exposure0.hdr");
    assert_eq!(exposure.notes, [PhotoNote::IgnoredHeader { line: "EXPOSURE=0".into() }]);
    let infinite = read("infnan.exr");
    assert!(matches!(infinite.notes[..], [PhotoNote::NotFinite { .. }]), "{:?}", infinite.notes);
    // the first part holds depth, the second a coloured picture
    let photo = read("multipart.exr").photo.radiance();
    assert!(photo.pixels().iter().any(|p| p[0] != p[1]), "grey");
}
