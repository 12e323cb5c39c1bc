//! Depth in NumPy's archives, in arrays with dimensions of 1, and inverse depth.

use std::io::{Cursor, Write};

use lo_imaging::{DepthMap, Image};
use lo_testdata::shared_data;
use zip::CompressionMethod;
use zip::write::SimpleFileOptions;

fn npy(descr: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}");
    [b"\x93NUMPY\x01\x00".as_slice(), &(header.len() as u16).to_le_bytes(), header.as_bytes(), data].concat()
}

fn f4(shape: &str, values: &[f32]) -> Vec<u8> {
    npy("<f4", shape, &values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
}

fn npz(method: CompressionMethod, arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in arrays {
        archive.start_file(*name, SimpleFileOptions::default().compression_method(method)).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

fn read(bytes: &[u8]) -> Result<Vec<f32>, String> {
    lo_imaging::depth_from_bytes(bytes, "d.npz", None).map(DepthMap::into_pixels).map_err(|error| error.to_string())
}

#[test]
fn dimensions_of_one_are_dropped() {
    for shape in ["(2, 3)", "(1, 2, 3)", "(2, 3, 1)", "(1, 1, 2, 3)", "(1, 2, 3, 1)"] {
        let depth = lo_imaging::depth_from_bytes(&f4(shape, &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), "d", None).unwrap();
        assert_eq!((depth.width(), depth.height(), depth[(0, 1)]), (3, 2, 4.0), "{shape}");
    }
    for shape in ["(2, 3, 3)", "(3, 2, 3)", "(2, 1, 3)", "(6,)", "()"] {
        let error = read(&f4(shape, &[0.0; 18])).unwrap_err();
        assert!(error.contains("two dimensions") && error.contains(&shape[1..shape.len() - 1]), "{error}");
    }
}

#[test]
fn integers_of_all_sizes_are_millimetres() {
    for (descr, one) in [
        ("|u1", &[200u8][..]),
        ("<u2", &[200, 0]),
        (">u2", &[0, 200]),
        ("<i2", &[200, 0]),
        ("<u4", &[200, 0, 0, 0]),
        (">i4", &[0, 0, 0, 200]),
    ] {
        assert_eq!(read(&npy(descr, "(1, 1)", one)), Ok(vec![0.2]), "{descr}");
    }
}

#[test]
fn the_depth_of_an_archive_is_found() {
    let depth = || f4("(1, 2)", &[1.0, 2.0]);
    let other = || f4("(1, 2)", &[8.0, 9.0]);
    for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
        let file = npz(method, &[("rgb.npy", f4("(1, 2, 3)", &[0.0; 6])), ("depth.npy", depth())]);
        assert_eq!(read(&file), Ok(vec![1.0, 2.0]));
    }
    for name in ["depth_m.npy", "depth.npy", "Depth.npy", "pred.npy", "arr_0.npy"] {
        let file = npz(CompressionMethod::Deflated, &[("confidence.npy", other()), (name, depth())]);
        assert_eq!(read(&file), Ok(vec![1.0, 2.0]), "{name}");
    }
    // The only map of an archive, whatever its name; a matrix of intrinsics is none.
    let map: Vec<f32> = (1..=30).map(|v| v as f32).collect();
    let intrinsics = ("K.npy", f4("(3, 3)", &[0.0; 9]));
    let file = npz(CompressionMethod::Deflated, &[("z_buffer.npy", f4("(5, 6)", &map)), intrinsics.clone()]);
    assert_eq!(read(&file).unwrap().len(), 30);
    // Inverse depth is not taken for depth.
    let file = npz(CompressionMethod::Deflated, &[("disparity.npy", f4("(5, 6)", &map))]);
    assert!(read(&file).unwrap_err().contains("disparity (5, 6)"));
    let inverse = lo_imaging::inverse_depth_from_bytes(&file, "d.npz").unwrap();
    assert_eq!((inverse.width(), inverse.height(), inverse[(0, 0)]), (6, 5, 1.0));
}

#[test]
fn other_archives_are_refused_with_their_arrays() {
    let map = vec![1.0; 30];
    let two = [("a.npy", f4("(5, 6)", &map)), ("b.npy", f4("(5, 6)", &map)), ("n.npy", f4("()", &[1.0]))];
    let error = read(&npz(CompressionMethod::Deflated, &two)).unwrap_err();
    assert!(error.contains("a (5, 6), b (5, 6), n ()") && error.contains("d.npz"), "{error}");
    let error = read(&npz(CompressionMethod::Stored, &[("readme.txt", b"text".to_vec())])).unwrap_err();
    assert!(error.contains("no NumPy array"), "{error}");
    // A header that promises more than the archive can hold is refused before memory is allocated.
    let error = read(&npz(CompressionMethod::Deflated, &[("depth.npy", f4("(16000, 16000)", &[1.0]))])).unwrap_err();
    assert!(error.contains("too large"), "{error}");
    let error = read(&npz(CompressionMethod::Deflated, &[("depth.npy", f4("(5, 6)", &[1.0]))])).unwrap_err();
    assert!(error.contains("array depth") && error.contains("only 4 of 120 bytes"), "{error}");
    let whole = npz(CompressionMethod::Deflated, &two);
    (0..whole.len()).for_each(|length| assert!(read(&whole[..length]).is_err()));
}

#[test]
fn inverse_depth_keeps_its_zeros_and_grey_images_of_eight_bits() {
    let values = [0.0, -1.5, f32::NAN, f32::INFINITY];
    let inverse = lo_imaging::inverse_depth_from_bytes(&f4("(1, 4)", &values), "d.npy").unwrap();
    assert_eq!(inverse.pixels()[..2], [0.0, -1.5]);
    assert!(inverse.pixels()[2..].iter().all(|v| v.is_nan()));
    let grey = lo_imaging::encode_png(&Image::new(2, 1, vec![[7; 3], [255; 3]]));
    assert_eq!(lo_imaging::inverse_depth_from_bytes(&grey, "d.png").unwrap().pixels(), [7.0, 255.0]);
    let colour = lo_imaging::encode_png(&Image::new(2, 1, vec![[7; 3], [255, 0, 0]]));
    let error = lo_imaging::inverse_depth_from_bytes(&colour, "d.png").unwrap_err().to_string();
    assert!(error.contains("colour image"), "{error}");
}

#[test]
fn units_and_whole_ranges_are_told() {
    let file = |values: &[f32]| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("d.npy");
        std::fs::write(&path, f4(&format!("(1, {})", values.len()), values)).unwrap();
        lo_imaging::read_depth_file(path, None).unwrap()
    };
    assert_eq!(file(&[1.0, 2.0]).units_per_metre, 1.0);
    assert!(file(&[0.0, 0.3, 1.0]).spans_range && !file(&[0.0, 0.3, 1.1]).spans_range);
    let Some(folder) = shared_data("inputs", "units of real depth files") else { return };
    let read = |name: &str| lo_imaging::read_depth_file(folder.join(name), None).unwrap();
    assert!(read("norm_depth16.png").spans_range && !read("tum5000.png").spans_range);
    assert_eq!(read("tum5000.png").units_per_metre, 1000.0);
    // As NumPy reads them.
    for name in ["depth_pro.npz", "depth_1xHxW.npy"] {
        let depth_m = read(name).depth_m;
        let (least, most) = depth_m.pixels().iter().fold((f32::MAX, 0.0f32), |(a, b), &z| (a.min(z), b.max(z)));
        assert_eq!((depth_m.width(), depth_m.height(), least, most), (256, 192, 1.566, 3.512), "{name}");
    }
}
