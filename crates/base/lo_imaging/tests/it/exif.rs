//! Orientation, focal length and exposure from hand-made EXIF blocks (EXIF 2.32, TIFF 6.0).

use lo_imaging::{Image, PhotoFile};

/// Makes a little-endian EXIF block: orientation in IFD 0, `(tag, type, value)` in the EXIF IFD; a value of type 5 is a
/// rational over 1000.
pub fn block(orientation: u16, tags: &[(u16, u16, u32)]) -> Vec<u8> {
    structure(&[(0x0112, 3, orientation.into())], tags)
}

/// Makes a little-endian TIFF structure with these entries in IFD 0, by tag, and in the EXIF IFD.
fn structure(main: &[(u16, u16, u32)], tags: &[(u16, u16, u32)]) -> Vec<u8> {
    let entry = |tag: u16, kind: u16, value: u32| {
        [&tag.to_le_bytes()[..], &kind.to_le_bytes(), &1u32.to_le_bytes(), &value.to_le_bytes()].concat()
    };
    let count = main.len() as u16 + 1;
    let sub_ifd = 8 + 2 + u32::from(count) * 12 + 4;
    let mut block = [b"II*\0\x08\0\0\0".as_slice(), &count.to_le_bytes()].concat();
    block.extend(main.iter().flat_map(|&(tag, kind, value)| entry(tag, kind, value)));
    block.extend(entry(0x8769, 4, sub_ifd));
    block.extend([0; 4]);
    block.extend((tags.len() as u16).to_le_bytes());
    let mut data_at = sub_ifd + 2 + 12 * tags.len() as u32 + 4;
    let mut data = Vec::new();
    for &(tag, kind, value) in tags {
        if kind == 5 {
            block.extend(entry(tag, kind, data_at));
            data.extend([value.to_le_bytes(), 1000u32.to_le_bytes()].concat());
            data_at += 8;
        } else {
            block.extend(entry(tag, kind, value));
        }
    }
    block.extend([0; 4]);
    block.extend(data);
    block
}

fn png_with(block: &[u8], image: &Image<[u8; 3]>) -> Vec<u8> {
    let png = lo_imaging::encode_png(image);
    let content = [b"eXIf", block].concat();
    let mut crc = u32::MAX;
    for &byte in &content {
        crc = (0..8).fold(crc ^ u32::from(byte), |c, _| (c >> 1) ^ (0xedb8_8320 & (c & 1).wrapping_neg()));
    }
    // after the signature and IHDR
    [&png[..33], &(block.len() as u32).to_be_bytes(), &content, &(!crc).to_be_bytes(), &png[33..]].concat()
}

fn jpeg_with(block: &[u8], width: u32, height: u32) -> Vec<u8> {
    let mut jpeg = std::io::Cursor::new(Vec::new());
    image::RgbImage::from_fn(width, height, |x, _| image::Rgb([if x < width / 2 { 250 } else { 5 }, 0, 0]))
        .write_to(&mut jpeg, image::ImageFormat::Jpeg)
        .unwrap();
    let content = [b"Exif\0\0", block].concat();
    let length = (content.len() as u16 + 2).to_be_bytes();
    [&jpeg.get_ref()[..2], &[0xff, 0xe1], &length, &content, &jpeg.get_ref()[2..]].concat()
}

/// Makes a grey TIFF of 30 × 20 pixels.
fn tiff_with(orientation: u32, tags: &[(u16, u16, u32)]) -> Vec<u8> {
    let pixels: Vec<u8> = (0..600).map(|i| (i % 30) as u8).collect();
    let at = |strip: u32| {
        let main = [
            (256, 3, 30),
            (257, 3, 20),
            (258, 3, 8),
            (259, 3, 1),
            (262, 3, 1),
            (273, 4, strip),
            (274, 3, orientation),
            (277, 3, 1),
            (278, 3, 20),
            (279, 4, 600),
        ];
        structure(&main, tags)
    };
    let length = at(0).len() as u32;
    [at(length), pixels].concat()
}

#[test]
fn a_tiff_has_lens_exposure_and_metadata() {
    let tags = [(0x829a, 5, 20), (0x8827, 3, 400), (0xa405, 3, 24)];
    for (orientation, size) in [(1, (30, 20)), (6, (20, 30))] {
        let file = read(&tiff_with(orientation, &tags));
        assert_eq!((file.photo.width(), file.photo.height()), size);
        assert_eq!((file.focal.equivalent_35mm, file.exposure.iso), (Some(24.0), Some(400.0)));
        assert!((file.exposure.time_s.unwrap() - 0.02).abs() < 1e-12);
        let lo_imaging::Photo::Encoded8(photo) = &file.photo else { panic!("no metadata: {:?}", file.photo) };
        // What composites embed has the photo's metadata alone.
        let exif = &photo.encoding.exif;
        assert!(exif.len() < 200, "{} bytes", exif.len());
        let copy = read(&png_with(exif, &Image::from_fn(30, 20, |_, _| [0; 3])));
        assert_eq!((copy.photo.width(), copy.focal), (30, file.focal));
    }
    let plain = read(&tiff_with(6, &[])).photo;
    assert!(matches!(plain, lo_imaging::Photo::Srgb8(_)) && plain.width() == 20, "{plain:?}");
}

fn read(bytes: &[u8]) -> PhotoFile {
    lo_imaging::photo_from_bytes(bytes, "photo").unwrap()
}

#[test]
fn all_eight_orientations() {
    let stored = Image::from_fn(3, 2, |x, y| [x as u8, y as u8, 9]);
    for orientation in 1..=8u16 {
        let upright = read(&png_with(&block(orientation, &[]), &stored)).photo.srgb8();
        for (i, j) in (0..3).flat_map(|i| (0..2).map(move |j| (i, j))) {
            // by the standard: the visual side of the stored row 0 and column 0
            let at = match orientation {
                1 => (i, j),         // top, left
                2 => (2 - i, j),     // top, right
                3 => (2 - i, 1 - j), // bottom, right
                4 => (i, 1 - j),     // bottom, left
                5 => (j, i),         // left, top
                6 => (1 - j, i),     // right, top
                7 => (1 - j, 2 - i), // right, bottom
                _ => (j, 2 - i),     // left, bottom
            };
            assert_eq!(upright[at], stored[(i, j)], "orientation {orientation}");
        }
    }
    // no valid orientation: as stored
    for orientation in [0, 9, 60000] {
        let photo = read(&png_with(&block(orientation, &[]), &stored)).photo;
        assert_eq!(photo.srgb8(), stored);
    }
    let turned = read(&jpeg_with(&block(6, &[]), 64, 32)).photo.srgb8();
    assert_eq!((turned.width(), turned.height()), (32, 64));
    assert!(turned[(16, 8)][0] > 240 && turned[(16, 56)][0] < 15, "the stored left side is on top");
}

#[test]
fn focal_lengths_give_the_angle_of_the_lens() {
    // 50 mm on a 36 × 24 mm sensor of 6000 × 4000 pixels: 2 atan(18 / 50) = 39.6°, portrait 2 atan(12 / 50) = 27.0°
    let film = [(0xa405, 3, 50)];
    let dpi = (6000.0 / 36.0 * 25.4 * 1000.0) as u32;
    let plane = [(0x920a, 5, 50_000), (0xa002, 4, 6000), (0xa20e, 5, dpi), (0xa210, 3, 2)];
    let centimetres = [(0x920a, 5, 50_000), (0xa002, 4, 6000), (0xa20e, 5, dpi * 100 / 254), (0xa210, 3, 3)];
    for tags in [&film[..], &plane, &centimetres] {
        // a copy at 1/50 of the size has the same angles
        let landscape = read(&jpeg_with(&block(1, tags), 120, 80));
        assert!((landscape.hfov_deg().unwrap() - 39.598).abs() < 0.01, "{:?}", landscape.focal);
        assert!((landscape.focal_px().unwrap() - 8333.33 / 50.0).abs() < 0.05);
        let portrait = read(&jpeg_with(&block(6, tags), 120, 80));
        assert!((portrait.hfov_deg().unwrap() - 26.991).abs() < 0.01, "{:?}", portrait.focal);
        assert!((portrait.focal_px().unwrap() - landscape.focal_px().unwrap()).abs() < 1e-9);
    }
}

#[test]
fn a_photo_of_another_aspect_is_a_crop() {
    // 26 mm on film, and a focal plane of 100 pixels per mm behind 4.8 mm: both 480 pixels of an original of 640 × 480
    let film = [(0xa405, 3, 26), (0xa002, 4, 640), (0xa003, 4, 480)];
    let plane = [(0x920a, 5, 4_800), (0xa20e, 5, 100_000), (0xa210, 3, 4), (0xa002, 4, 640), (0xa003, 4, 480)];
    for tags in [&film[..], &plane] {
        let focal_px = |orientation: u16, width: u32, height: u32| {
            read(&jpeg_with(&block(orientation, tags), width, height)).focal_px().unwrap()
        };
        // the 26 of the film are a rounding of 25.96; 0.2 %
        let close = |focal: f64, expected: f64| (focal / expected - 1.0).abs() < 2e-3;
        assert!(close(focal_px(1, 640, 480), 480.0) && close(focal_px(1, 64, 48), 48.0));
        assert!(close(focal_px(6, 640, 480), 480.0));
        // square, cinema and portrait crops, at the original's resolution and reduced
        assert!(close(focal_px(1, 480, 480), 480.0) && close(focal_px(1, 240, 240), 240.0));
        assert!(close(focal_px(1, 640, 270), 480.0) && close(focal_px(1, 320, 135), 240.0));
        assert!(close(focal_px(1, 270, 480), 480.0) && close(focal_px(6, 480, 480), 480.0));
        // a photo that was turned without its tags is no crop
        assert!(close(focal_px(1, 480, 640), 480.0));
    }
    let square = read(&jpeg_with(&block(1, &film), 480, 480));
    assert!(square.focal.is_cropped(480, 480) && !square.focal.is_cropped(320, 240));
    assert!((square.hfov_deg().unwrap() - 53.1).abs() < 0.1);
    if let Some(file) = lo_testdata::shared_data("inputs/square_crop_exif640.jpg", "lens of a real crop") {
        assert!((lo_imaging::read_photo(file).unwrap().hfov_deg().unwrap() - 53.1).abs() < 0.1);
    }
}

#[test]
fn digital_zoom_lengthens_the_lens() {
    let film = [(0xa405, 3, 50), (0xa404, 5, 2000)];
    let dpi = (6000.0 / 36.0 * 25.4 * 1000.0) as u32;
    let plane = [(0xa404, 5, 2000), (0x920a, 5, 50_000), (0xa002, 4, 6000), (0xa20e, 5, dpi), (0xa210, 3, 2)];
    for tags in [&film[..], &plane] {
        // 2 atan(18 / 100) = 20.41°
        let photo = read(&jpeg_with(&block(1, tags), 120, 80));
        assert!((photo.hfov_deg().unwrap() - 20.41).abs() < 0.01, "{:?}", photo.focal);
    }
    // iPhones' equivalent includes it; 0 and 1 mean none
    let photo = read(&jpeg_with(&block(1, &film), 120, 80));
    let apple = lo_imaging::FocalLength { equivalent_includes_zoom: true, ..photo.focal };
    assert!((apple.hfov_deg(120, 80).unwrap() - 39.598).abs() < 0.01);
    for zoom in [0, 1000] {
        let photo = read(&jpeg_with(&block(1, &[(0xa405, 3, 50), (0xa404, 5, zoom)]), 120, 80));
        assert!((photo.hfov_deg().unwrap() - 39.598).abs() < 0.01);
    }
}

#[test]
fn exposures_are_read_plainly_and_by_apex() {
    let exposure = |tags: &[(u16, u16, u32)]| read(&jpeg_with(&block(1, tags), 12, 8)).exposure;
    // 1/40 s, f/2.8, ISO 400
    let plain = exposure(&[(0x829a, 5, 25), (0x829d, 5, 2800), (0x8827, 3, 400)]);
    let close = |got: Option<f64>, expected: f64| (got.unwrap() / expected - 1.0).abs() < 1e-9;
    assert!(close(plain.time_s, 0.025) && close(plain.f_number, 2.8) && close(plain.iso, 400.0), "{plain:?}");
    // Tv 5 is 1/32 s, Av 4 is f/4 (EXIF 2.32, annex C)
    let apex = exposure(&[(0x9201, 5, 5000), (0x9202, 5, 4000)]);
    assert!(close(apex.time_s, 1.0 / 32.0) && close(apex.f_number, 4.0) && apex.iso.is_none(), "{apex:?}");
    let none = exposure(&[(0x829a, 5, 0), (0x8827, 3, 0)]);
    assert_eq!((none.time_s, none.f_number, none.iso), (None, None, None));
}

#[test]
fn unusable_focal_lengths_are_none() {
    for tags in [
        &[][..],
        &[(0xa405, 3, 0)],      // "unknown" in the standard
        &[(0xa405, 3, 60000)],  // 0.03°
        &[(0x920a, 5, 50_000)], // millimetres without a sensor size
        &[(0x920a, 5, 50_000), (0xa20e, 5, 0), (0xa002, 4, 6000)],
    ] {
        assert_eq!(read(&jpeg_with(&block(1, tags), 120, 80)).hfov_deg(), None, "{tags:?}");
    }
    // a damaged block fails neither the image nor the tags before the damage
    let block = block(6, &[(0xa405, 3, 50)]);
    for length in 0..block.len() {
        let photo = read(&jpeg_with(&block[..length], 120, 80)).photo;
        assert!(photo.width() == 120 || photo.width() == 80);
    }
}
