//! Round trips through every writer, and files of other programs: fixtures made byte by byte.

use std::path::{Path, PathBuf};

use lo_imaging::{
    ChannelGroup, DepthMap, EnvironmentLayout, ExrOptions, Image, ImageError, Photo, RadianceImage, ToneCurve,
};
use proptest::prelude::*;

fn folder() -> tempfile::TempDir {
    tempfile::tempdir().unwrap()
}

/// Values from 1e-6 to 1e5 with flat parts (runs), some zero.
fn radiance(width: usize, height: usize) -> RadianceImage {
    RadianceImage::from_fn(width, height, |x, y| {
        let value = |c: usize| match (x / 7 + y + c) % 5 {
            0 => 0.0,
            1 => 0.75,
            k => ((x * 31 + y * 17 + c * 7) as f32 * 0.37).sin().abs() * 10f32.powi(k as i32 * 4 - 11) + 1e-6,
        };
        [value(0), value(1), value(2)]
    })
}

#[test]
fn exr_and_pfm_keep_every_bit() {
    let folder = folder();
    for (width, height) in [(37, 21), (1, 1), (300, 40)] {
        let image = radiance(width, height);
        for name in ["a.exr", "a.pfm"] {
            let path = folder.path().join(name);
            lo_imaging::write_radiance(&path, &image, &ExrOptions::default()).unwrap();
            assert_eq!(lo_imaging::read_radiance(&path).unwrap(), image, "{name}");
        }
    }
}

#[test]
fn half_exr_keeps_eleven_bits_and_holds_what_is_too_large() {
    let path = folder().keep().join("half.exr");
    let mut image = radiance(40, 30);
    image[(0, 0)] = [1e9, -1e9, 65504.0];
    lo_imaging::write_radiance(&path, &image, &ExrOptions { half: true, ..ExrOptions::default() }).unwrap();
    let back = lo_imaging::read_radiance(&path).unwrap();
    assert_eq!(back[(0, 0)], [65504.0, -65504.0, 65504.0]);
    for (a, b) in back.pixels().iter().zip(image.pixels()).skip(1) {
        // half: 2^-11 relative, 2^-25 absolute below the normal range
        assert!((0..3).all(|c| (a[c] - b[c].min(65504.0)).abs() <= b[c] * 4.9e-4 + 3e-8), "{a:?} {b:?}");
    }
    std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
}

#[test]
fn hdr_keeps_eight_bits_of_the_greatest_channel() {
    let folder = folder();
    // below 8 columns the encoding is flat; 200 columns need several runs
    for (width, height) in [(200, 9), (8, 8), (7, 5), (1, 1), (129, 3)] {
        let image = radiance(width, height);
        let path = folder.path().join("a.hdr");
        lo_imaging::write_radiance(&path, &image, &ExrOptions::default()).unwrap();
        let back = lo_imaging::read_radiance(&path).unwrap();
        for (a, b) in back.pixels().iter().zip(image.pixels()) {
            let greatest = b.iter().fold(0.0f32, |m, &v| m.max(v));
            assert!((0..3).all(|c| (a[c] - b[c]).abs() <= greatest / 255.9), "{a:?} {b:?}");
        }
        // a second pass through RGBE changes nothing
        lo_imaging::write_radiance(&path, &back, &ExrOptions::default()).unwrap();
        assert_eq!(lo_imaging::read_radiance(&path).unwrap(), back);
    }
    let path = folder.path().join("odd.hdr");
    let odd = RadianceImage::new(2, 1, vec![[f32::NAN, -1.0, 2.0], [f32::INFINITY, 1.0, 0.0]]);
    lo_imaging::write_radiance(&path, &odd, &ExrOptions::default()).unwrap();
    let back = lo_imaging::read_radiance(&path).unwrap();
    assert_eq!(back[(0, 0)], [0.0, 0.0, 2.0]);
    assert!(back[(1, 0)][0] > 1.6e38 && back[(1, 0)][0].is_finite());
}

#[test]
fn exr_layers_and_attributes_come_back() {
    let folder = folder();
    let path = folder.path().join("layers.exr");
    let color = radiance(20, 10);
    let object = Image::from_fn(20, 10, |x, y| [x as f32, y as f32, 0.5, 0.25]);
    let ratio = Image::from_fn(20, 10, |x, _| x as f32 / 20.0);
    let groups = [
        ChannelGroup::rgb("", &color),
        ChannelGroup::rgba("object", &object),
        ChannelGroup::single("shadow", "ratio", &ratio),
    ];
    let options = ExrOptions {
        white_luminance: Some(120.0),
        environment: Some(EnvironmentLayout::LatitudeLongitude),
        metadata: vec![("lightoctree.position_m".into(), "0 1.5 −2".replace('−', "-")), ("é".into(), "ü".into())],
        ..ExrOptions::default()
    };
    lo_imaging::write_exr(&path, (20, 10), &groups, &options).unwrap();
    assert_eq!(lo_imaging::read_radiance(&path).unwrap(), color);
    let all = lo_imaging::read_exr_channels(&path).unwrap();
    let names: Vec<&str> = all.channels.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["B", "G", "R", "object.A", "object.B", "object.G", "object.R", "shadow.ratio"]);
    assert_eq!(all.channels[7].1, ratio.pixels());
    assert_eq!(all.channels[6].1[5], 5.0);
    assert!(all.metadata.contains(&("lightoctree.position_m".into(), "0 1.5 -2".into())));
    // the standard attributes, as the exr crate's own reader sees them
    let meta = exr::meta::MetaData::read_from_file(&path, true).unwrap();
    let header = &meta.headers[0];
    assert_eq!(header.own_attributes.white_luminance, Some(120.0));
    assert_eq!(header.own_attributes.environment_map, Some(exr::meta::attribute::EnvironmentMap::LatitudeLongitude));
    let red = header.shared_attributes.chromaticities.unwrap().red;
    assert_eq!((red.0, red.1), (0.64, 0.33));

    let reserved = ExrOptions { metadata: vec![("channels".into(), "x".into())], ..ExrOptions::default() };
    let error = lo_imaging::write_exr(&path, (20, 10), &groups, &reserved).unwrap_err();
    assert!(matches!(error, ImageError::Encode { .. }), "{error}");
    let error = lo_imaging::write_exr(&path, (21, 10), &groups, &options).unwrap_err();
    assert!(error.to_string().contains("200 samples"), "{error}");
}

#[test]
fn pictures_come_back() {
    let folder = folder();
    let image = Image::from_fn(33, 17, |x, y| [(x * 7) as u8, (y * 15) as u8, (x + y) as u8]);
    let photo = Photo::Srgb8(image.clone());
    let png = folder.path().join("a.png");
    lo_imaging::write_photo(&png, &photo, lo_imaging::GENERATOR).unwrap();
    let back = lo_imaging::read_photo(&png).unwrap();
    assert_eq!(back.photo, photo);
    assert_eq!(lo_imaging::photo_from_bytes(&lo_imaging::encode_png(&image), "embedded").unwrap().photo, photo);
    // the content decides, not a wrong extension
    let liar = folder.path().join("a.jpg");
    std::fs::copy(&png, &liar).unwrap();
    assert_eq!(lo_imaging::read_photo(&liar).unwrap().photo, photo);

    let jpeg = folder.path().join("b.jpeg");
    lo_imaging::write_photo(&jpeg, &photo, lo_imaging::GENERATOR).unwrap();
    let Photo::Srgb8(back) = lo_imaging::read_photo(&jpeg).unwrap().photo else { panic!("a JPEG has 8 bits") };
    let error: f64 = back
        .pixels()
        .as_flattened()
        .iter()
        .zip(image.pixels().as_flattened())
        .map(|(a, b)| f64::from(a.abs_diff(*b)))
        .sum();
    assert!(error / (33.0 * 17.0 * 3.0) < 6.0, "{error}");

    let rgba = Image::from_fn(9, 5, |x, y| [x as u8, y as u8, 3, (x * 20) as u8]);
    lo_imaging::write_rgba8(&png, &rgba, lo_imaging::GENERATOR).unwrap();
    assert_eq!(lo_imaging::read_rgba8(&png).unwrap(), rgba);
    // read as a photo, alpha is dropped and the colour stays
    let Photo::Srgb8(back) = lo_imaging::read_photo(&png).unwrap().photo else { panic!("8 bits") };
    assert_eq!(back[(4, 2)], [4, 2, 3]);
}

#[test]
fn sixteen_bit_photos_are_linear_and_come_back() {
    let folder = folder();
    let path = folder.path().join("deep.png");
    let image = Image::from_fn(64, 4, |x, y| [(x * 1000 + y) as u16, 65535, (y * 9000) as u16]);
    lo_imaging::write_png16(&path, &image, lo_imaging::GENERATOR).unwrap();
    let photo = lo_imaging::read_photo(&path).unwrap().photo;
    let Photo::Linear(linear) = &photo else { panic!("16 bits are linearised") };
    // the standard's curve at code 32000 of 65535
    let expected = ((32000.0f64 / 65535.0 + 0.055) / 1.055).powf(2.4);
    assert!((f64::from(linear[(32, 0)][0]) - expected).abs() < 1e-6);
    lo_imaging::write_photo(&path, &photo, lo_imaging::GENERATOR).unwrap();
    assert_eq!(lo_imaging::read_photo(&path).unwrap().photo, photo);
}

#[test]
fn grey_palette_and_plain_formats_are_read() {
    // hand-made PGM, PPM and 2 × 2 BMP
    let Photo::Srgb8(grey) = lo_imaging::photo_from_bytes(b"P5 2 1 255\n\x10\xf0", "x").unwrap().photo else {
        panic!()
    };
    assert_eq!(grey.pixels(), [[16; 3], [240; 3]]);
    let Photo::Srgb8(color) = lo_imaging::photo_from_bytes(b"P3\n# c\n1 1\n255\n1 2 3\n", "x").unwrap().photo else {
        panic!()
    };
    assert_eq!(color.pixels(), [[1, 2, 3]]);
    let mut bmp =
        b"BM\x46\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0\x02\0\0\0\x02\0\0\0\x01\0\x18\0\0\0\0\0\x10\0\0\0".to_vec();
    bmp.extend([0; 16]);
    bmp.extend([1, 2, 3, 4, 5, 6, 0, 0, 7, 8, 9, 10, 11, 12, 0, 0]);
    let Photo::Srgb8(color) = lo_imaging::photo_from_bytes(&bmp, "x").unwrap().photo else { panic!() };
    assert_eq!(color.pixels(), [[9, 8, 7], [12, 11, 10], [3, 2, 1], [6, 5, 4]]);
    for format in [image::ImageFormat::Tiff, image::ImageFormat::WebP] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = image::RgbImage::from_fn(5, 3, |x, y| image::Rgb([x as u8 * 9, y as u8 * 50, 77]));
        picture.write_to(&mut bytes, format).unwrap();
        let Photo::Srgb8(color) = lo_imaging::photo_from_bytes(bytes.get_ref(), "x").unwrap().photo else { panic!() };
        assert_eq!(color[(4, 2)], [36, 100, 77], "{format:?}");
    }
}

#[test]
fn depth_comes_back_from_every_format() {
    let folder = folder();
    let depth = DepthMap::from_fn(23, 11, |x, y| if (x + y) % 4 == 0 { 0.0 } else { 0.5 + (x * y) as f32 * 0.0137 });
    for name in ["d.exr", "d.pfm", "d.npy"] {
        let path = folder.path().join(name);
        lo_imaging::write_depth(&path, &depth, lo_imaging::GENERATOR).unwrap();
        assert_eq!(lo_imaging::read_depth(&path, None).unwrap(), depth, "{name}");
        // an explicit scale applies to floats too
        let half = lo_imaging::read_depth(&path, Some(2.0)).unwrap();
        assert_eq!(half[(1, 0)], depth[(1, 0)] / 2.0);
    }
    let path = folder.path().join("d.png");
    lo_imaging::write_depth(&path, &depth, lo_imaging::GENERATOR).unwrap();
    let back = lo_imaging::read_depth(&path, None).unwrap();
    for (a, b) in back.pixels().iter().zip(depth.pixels()) {
        assert!((a - b).abs() <= 0.000_501 && (*a == 0.0) == (*b == 0.0));
    }
    let far = DepthMap::new(2, 1, vec![65.535, 65.6]);
    lo_imaging::write_depth(&path, &far, lo_imaging::GENERATOR).unwrap();
    assert_eq!(lo_imaging::read_depth(&path, None).unwrap().pixels(), [65.535, 0.0]);
}

#[test]
fn tiff_depth_is_read() {
    let mut float = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut float).unwrap();
    encoder.write_image::<tiff::encoder::colortype::Gray32Float>(2, 2, &[1.5, f32::NAN, 2.5, -1.0]).unwrap();
    let depth = lo_imaging::depth_from_bytes(float.get_ref(), "d.tif", None).unwrap();
    assert_eq!(depth.pixels(), [1.5, 0.0, 2.5, 0.0]);
    let mut integer = std::io::Cursor::new(Vec::new());
    let mut encoder = tiff::encoder::TiffEncoder::new(&mut integer).unwrap();
    encoder.write_image::<tiff::encoder::colortype::Gray16>(2, 1, &[5000, 0]).unwrap();
    assert_eq!(lo_imaging::depth_from_bytes(integer.get_ref(), "d", Some(5000.0)).unwrap().pixels(), [1.0, 0.0]);
}

#[test]
fn odd_readings_mean_no_reading() {
    let values = [1.0, 0.0, -2.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e10, 99_999.0];
    let mut pfm = b"Pf\n8 1\n-1\n".to_vec();
    pfm.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    let depth = lo_imaging::depth_from_bytes(&pfm, "d.pfm", None).unwrap();
    assert_eq!(depth.pixels(), [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 99_999.0]);
    let negative = [b"Pf\n1 1\n-1\n".as_slice(), &(-2.0f32).to_le_bytes()].concat();
    let error = lo_imaging::depth_from_bytes(&negative, "d.pfm", None).unwrap_err().to_string();
    assert!(error.contains("negative"), "{error}");
    for scale in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(lo_imaging::depth_from_bytes(&pfm, "d.pfm", Some(scale)).is_err());
    }
}

#[test]
fn numpy_headers_of_every_kind() {
    let npy = |header: &str, data: &[u8]| {
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00".as_slice(), &length, header.as_bytes(), data].concat()
    };
    let read = |bytes: &[u8]| lo_imaging::depth_from_bytes(bytes, "d.npy", None).map(|d| d.into_pixels());
    let f8: Vec<u8> = [1.0f64, 2.0, 3.0, 4.0].iter().flat_map(|v| v.to_be_bytes()).collect();
    let header = "{'descr': '>f8', 'fortran_order': False, 'shape': (2, 2), }\n";
    assert_eq!(read(&npy(header, &f8)).unwrap(), [1.0, 2.0, 3.0, 4.0]);
    let header = "{\"shape\": (2,2), 'fortran_order': True, 'descr': '>f8'}";
    assert_eq!(read(&npy(header, &f8)).unwrap(), [1.0, 3.0, 2.0, 4.0]);
    // 1.5 as half is 0x3e00
    let header = "{'descr': '<f2', 'fortran_order': False, 'shape': (1, 2), }";
    assert_eq!(read(&npy(header, &[0x00, 0x3e, 0x00, 0xfe])).unwrap(), [1.5, 0.0]);
    let header = "{'descr': '<u2', 'fortran_order': False, 'shape': (1, 1), }";
    assert_eq!(read(&npy(header, &[0xdc, 0x05])).unwrap(), [1.5]);
    for (header, says) in [
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (1,), }", "two dimensions"),
        ("{'descr': '<c8', 'fortran_order': False, 'shape': (1, 1), }", "c8"),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (100000, 100000), }", "megapixels"),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2), }", "only 8 of 16 bytes of pixel data"),
    ] {
        let error = read(&npy(header, &[0; 8])).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}

#[test]
fn pfm_of_both_byte_orders() {
    let values = [1.0f32, 2.0, 3.0, 4.0, 5.0, 6.0];
    let little: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    let big: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
    for (header, data) in [("PF\n1 2\n-1.0\n", &little), ("PF\n1 2\n1.0\n", &big), ("PF 1 2 2.5 ", &big)] {
        let image = lo_imaging::radiance_from_bytes(&[header.as_bytes(), data].concat(), "x").unwrap();
        // rows from the bottom
        assert_eq!(image.pixels(), [[4.0, 5.0, 6.0], [1.0, 2.0, 3.0]], "{header}");
    }
    let grey = lo_imaging::radiance_from_bytes(&[b"Pf\n3 2\n-1\n".as_slice(), &little].concat(), "x").unwrap();
    assert_eq!(grey[(0, 0)], [4.0; 3]);
}

#[test]
fn files_appear_whole_or_not_at_all() {
    let folder = folder();
    let path = folder.path().join("a.txt");
    std::fs::write(&path, "old").unwrap();
    let failed: Result<(), std::io::Error> = lo_imaging::write_atomically(&path, |out| {
        std::io::Write::write_all(out, b"half of")?;
        Err(std::io::Error::other("no"))
    });
    assert!(failed.is_err());
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
    lo_imaging::write_atomically(&path, |out| std::io::Write::write_all(out, b"new")).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file is left");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let ordinary = folder.path().join("b.txt");
        std::fs::write(&ordinary, "").unwrap();
        let mode = |path: &PathBuf| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&path), mode(&ordinary));
    }
    let nowhere = folder.path().join("missing").join("a.exr");
    let error = lo_imaging::write_radiance(&nowhere, &radiance(2, 2), &ExrOptions::default()).unwrap_err().to_string();
    assert!(error.starts_with(&nowhere.display().to_string()), "{error}");
}

#[test]
fn errors_say_what_is_possible() {
    let image = radiance(4, 4);
    let message = |e: ImageError| e.to_string();
    assert_eq!(
        message(lo_imaging::write_radiance("a.gif", &image, &ExrOptions::default()).unwrap_err()),
        "a.gif: cannot write an image of this type as “.gif”; use one of .exr, .hdr, .pfm"
    );
    assert!(
        message(lo_imaging::write_depth("a.jpg", &DepthMap::new(1, 1, vec![1.0]), lo_imaging::GENERATOR).unwrap_err())
            .contains(".npy")
    );
    assert!(
        message(lo_imaging::write_tone_mapped("a", &image, ToneCurve::Clip, 0.0, lo_imaging::GENERATOR).unwrap_err())
            .contains("no extension; use one of .png, .jpg")
    );
    assert!(message(lo_imaging::photo_from_bytes(b"hello", "note.txt").unwrap_err()).contains("expected PNG"));
    assert!(message(lo_imaging::read_photo("no-such-file.png").unwrap_err()).starts_with("no-such-file.png: "));
    let empty = RadianceImage::new(0, 0, vec![]);
    for name in ["e.exr", "e.hdr", "e.pfm"] {
        assert!(matches!(
            lo_imaging::write_radiance(name, &empty, &ExrOptions::default()),
            Err(ImageError::Encode { .. })
        ));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_radiance_survives_hdr_within_its_precision(
        pixels in proptest::collection::vec([0.0f32..1.0, 0.0f32..1.0, 0.0f32..1.0], 9 * 3),
        exponent in -100i32..100,
    ) {
        let image = RadianceImage::new(9, 3, pixels).map(|rgb| rgb.map(|v| v * (exponent as f32).exp2()));
        let folder = folder();
        let path = folder.path().join("p.hdr");
        lo_imaging::write_radiance(&path, &image, &ExrOptions::default()).unwrap();
        for (a, b) in lo_imaging::read_radiance(&path).unwrap().pixels().iter().zip(image.pixels()) {
            let greatest = b.iter().fold(0.0f32, |m, &v| m.max(v));
            // half a step of the shared exponent: up to 1/255 of the greatest where it was just rounded up
            prop_assert!((0..3).all(|c| (a[c] - b[c]).abs() <= greatest / 255.0), "{:?} {:?}", a, b);
        }
    }
}

#[test]
fn files_name_who_wrote_them() {
    let folder = tempfile::tempdir().unwrap();
    let (pixels, depth_m) = (Image::new(8, 8, vec![[9u8; 3]; 64]), DepthMap::new(8, 8, vec![1.5; 64]));
    let named = |path: &Path, name: &str| {
        let bytes = std::fs::read(path).unwrap();
        assert!(bytes.windows(name.len()).any(|window| window == name.as_bytes()), "{}", path.display());
    };
    for file in ["a.png", "a.jpg", "a.exr", "a.hdr"] {
        let path = folder.path().join(file);
        lo_imaging::write_photo(&path, &Photo::Srgb8(pixels.clone()), "kettle 3").unwrap();
        named(&path, "kettle 3");
    }
    let path = folder.path().join("depth.exr");
    lo_imaging::write_depth(&path, &depth_m, "Küche\n2").unwrap();
    named(&path, "K?che?2");
}
