#![allow(clippy::unwrap_used)]

use lo_geometry::Vec3;

use crate::{LoadOptions, MeshError, Model};

fn read(bytes: &[u8]) -> Result<Model, MeshError> {
    Model::from_ply_bytes(bytes, &LoadOptions::default())
}

const ASCII: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty double y\n\
    property float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\n\
    element face 1\nproperty list uchar int vertex_indices\nproperty uchar flag\nend_header\n\
    0 0 0 255 0 0 0 0\n1 0 0 0 128 0 1 0\n1 1 0 0 0 255 1 1\n0 1 0 255 255 255 0 1\n4 0 1 2 3 9\n";

/// A square with normals in either byte order, `list ushort short` indices and an unknown element between.
fn binary(big: bool) -> Vec<u8> {
    let order = if big { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = format!(
        "ply\r\nformat {order} 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\nproperty float z\r\n\
         property float nx\r\nproperty float ny\r\nproperty float nz\r\nelement edge 1\r\nproperty list uint double w\r\n\
         property int n\r\nelement face 2\r\nproperty list ushort short vertex_index\r\nend_header\r\n"
    )
    .into_bytes();
    let mut put = |little: &[u8]| {
        let mut word = little.to_vec();
        if big {
            word.reverse();
        }
        bytes.extend(word);
    };
    for [x, y] in [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]] {
        [x, y, 0.5, 0.0, 0.0, -2.0].iter().for_each(|v| put(&v.to_le_bytes()));
    }
    put(&2_u32.to_le_bytes());
    put(&1.0_f64.to_le_bytes());
    put(&2.0_f64.to_le_bytes());
    put(&7_i32.to_le_bytes());
    for face in [[0_i16, 2, 1], [0, 3, 2]] {
        put(&3_u16.to_le_bytes());
        face.iter().for_each(|v| put(&v.to_le_bytes()));
    }
    bytes
}

#[test]
fn ascii_square() {
    let model = read(ASCII.as_bytes()).unwrap();
    assert_eq!((model.positions.len(), model.triangles.len()), (4, 2));
    assert!(model.normals.iter().all(|&n| n == Vec3::Z));
    assert_eq!(model.bounds().size(), Vec3::new(1.0, 1.0, 0.0));
    let at = |p: Vec3| model.positions.iter().position(|&q| q == p).unwrap();
    assert_eq!(model.uvs[0][at(Vec3::ZERO)], [0.0, 1.0], "t points up");
    assert_eq!(model.colors[at(Vec3::ZERO)], [1.0, 0.0, 0.0, 1.0]);
    assert!((model.colors[at(Vec3::X)][1] - 0.215_86).abs() < 1e-5);
}

#[test]
fn binary_of_both_byte_orders() {
    for big in [false, true] {
        let model = read(&binary(big)).unwrap();
        assert_eq!(model.triangles, [[0, 2, 1], [0, 3, 2]]);
        assert_eq!(model.positions[2], Vec3::new(1.0, 1.0, 0.5));
        assert!(model.normals.iter().all(|&n| n == Vec3::NEG_Z), "normals of the file, made unit");
    }
}

#[test]
fn triangle_strips() {
    let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
        element tristrips 1\nproperty list int int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n1 1 0\n8 0 1 2 3 -1 0 1 2\n";
    let model = read(text.as_bytes()).unwrap();
    assert_eq!(model.triangles.len(), 3);
    assert!(model.normals.iter().all(|&n| n == Vec3::Z), "every second triangle of a strip is turned");
}

#[test]
fn errors_say_what() {
    let error = |text: String| read(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(error("plyx".into()), "invalid PLY file at line 1: missing end_header");
    assert_eq!(
        error(ASCII.replace("vertex 4", "vertex 4000000000")),
        "invalid PLY file at header: 4000000000 elements 'vertex' do not fit into the 88 bytes after the header"
    );
    assert_eq!(
        error(ASCII.replace("4 0 1 2 3", "4 0 1 2 7")),
        "face 0 refers to vertex 7, but there are 4 vertices (counted from 0)"
    );
    assert_eq!(
        error(ASCII.replace("4 0 1 2 3", "900 0 1 2 3")),
        "invalid PLY file at byte 365: a list of 900 values does not fit into the file"
    );
    assert_eq!(
        error(ASCII.replace("element face 1", "element face 0")),
        "the mesh has no triangles: it is a point cloud of 4 points without faces"
    );
    assert_eq!(
        error(ASCII.replace("property float x", "property float q")),
        "invalid PLY file at header: the vertices have no x, y and z"
    );
    assert!(error(ASCII.replace("0 0 0 255", "0 zero 0 255")).ends_with("'zero' is not a number"));
}

#[test]
fn truncation_never_panics() {
    for bytes in [ASCII.as_bytes().to_vec(), binary(false), binary(true)] {
        for end in 0..bytes.len() {
            // In ASCII, the last value (an unused flag) and its line end may be missing.
            assert!(read(&bytes[..end]).is_err() || end + 2 >= bytes.len(), "{end}");
        }
    }
}

#[test]
fn a_second_list_of_vertices_is_refused() {
    let vertex = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    let colors = "property uchar red\nproperty uchar green\nproperty uchar blue\n";
    let text = format!(
        "ply\nformat ascii 1.0\n{vertex}{colors}{vertex}element face 1\nproperty list uchar int vertex_indices\nend_header\n\
         0 0 0 1 2 3\n1 0 0 1 2 3\n0 1 0 1 2 3\n0 0 0\n1 0 0\n0 1 0\n3 3 4 5\n"
    );
    let error = read(text.as_bytes()).unwrap_err().to_string();
    assert_eq!(error, "invalid PLY file at line 10: duplicate element 'vertex'");
}
