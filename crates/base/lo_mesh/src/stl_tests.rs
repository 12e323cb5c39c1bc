#![allow(clippy::unwrap_used)]

use lo_geometry::Vec3;

use crate::{LoadOptions, MeshError, Model};

fn read(bytes: &[u8]) -> Result<Model, MeshError> {
    Model::from_stl_bytes(bytes, &LoadOptions::default())
}

const SQUARE: [[[f32; 3]; 3]; 2] =
    [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [[-0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]];

fn ascii() -> String {
    let facets = SQUARE.map(|points| {
        let vertices = points.map(|[x, y, z]| format!("      vertex {x} {y} {z:e}\r\n")).concat();
        format!("  facet normal 0 0 0\r\n    outer loop\r\n{vertices}    endloop\r\n  endfacet\r\n")
    });
    format!("solid square\r\n{}endsolid square\r\n", facets.concat())
}

fn binary() -> Vec<u8> {
    let mut bytes = b"solid but binary".to_vec();
    bytes.resize(80, 0);
    bytes.extend(2_u32.to_le_bytes());
    for points in SQUARE {
        bytes.extend([0; 12]);
        bytes.extend(points.iter().flatten().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0; 2]);
    }
    bytes
}

#[test]
fn both_kinds_weld_to_a_square() {
    for bytes in [ascii().into_bytes(), binary()] {
        let model = read(&bytes).unwrap();
        assert_eq!((model.positions.len(), model.triangles.len()), (4, 2));
        assert!(model.normals.iter().all(|&n| n == Vec3::Z));
    }
}

#[test]
fn errors_say_what() {
    let error = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
    assert_eq!(error(b"xyz"), "invalid STL file at byte 3: unexpected end of file in the header");
    let mut hostile = binary();
    hostile[0] = b'x';
    hostile[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    assert_eq!(
        error(&hostile),
        "invalid STL file at byte 80: the header declares 4294967295 triangles, the file has 2"
    );
    assert_eq!(error(&[0; 84]), "the mesh has no triangles");
    assert_eq!(error(b"solid x\nendsolid"), "the mesh has no triangles");
    assert_eq!(error(b"solid x\nvertex 1 2\n"), "invalid STL file at line 2: a vertex needs three numbers");
}

#[test]
fn truncation_never_panics() {
    for end in 0..binary().len() {
        let mut bytes = binary()[..end].to_vec();
        assert!(read(&bytes).is_err());
        if let Some(first) = bytes.first_mut() {
            *first = b'x';
        }
        assert!(read(&bytes).is_err());
    }
    for end in 0..ascii().len() {
        let _ = read(&ascii().as_bytes()[..end]);
    }
}
