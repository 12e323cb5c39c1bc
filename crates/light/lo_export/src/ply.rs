//! PLY, binary little-endian: one vertex per point, for MeshLab, CloudCompare, Open3D and Blender.

use crate::header::{GENERATOR, UNITS};
use crate::points::Point;
use crate::probe::ProbeFile;

/// Vertex properties in file order.
const PROPERTIES: [(&str, &str); 15] = [
    ("float", "x"),
    ("float", "y"),
    ("float", "z"),
    ("float", "nx"),
    ("float", "ny"),
    ("float", "nz"),
    ("uchar", "red"),
    ("uchar", "green"),
    ("uchar", "blue"),
    ("float", "radiance_r"),
    ("float", "radiance_g"),
    ("float", "radiance_b"),
    ("float", "opacity"),
    ("float", "edge_m"),
    ("float", "seen"),
];

/// Additional property of scenes with a panorama.
const PANORAMA: (&str, &str) = ("float", "panorama");

/// Largest size of a vertex, bytes: thirteen floats and three bytes.
const VERTEX_BYTES: usize = 13 * 4 + 3;

/// Encodes the whole file. `frame` describes its axes; `panorama` tells whether the scene has a panorama.
pub(crate) fn encode(points: &[Point], frame: &str, probes: &[ProbeFile], panorama: bool) -> Vec<u8> {
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment {GENERATOR}\n");
    header += &format!("comment frame: {frame}\n");
    header += &format!("comment {UNITS}\n");
    header += "comment red, green, blue: sRGB of the radiance, clipped at 1.0, for viewers\n";
    header += "comment opacity: of one crossing; edge_m: edge in metres; seen: share that the photo saw, 0 to 1\n";
    if panorama {
        header += "comment panorama: share of the radiance that a panorama of the room gave, 0 to 1\n";
    }
    for probe in probes {
        let [x, y, z] = probe.position_m.to_array();
        header += &format!("comment light probe at {x} {y} {z} m: {}, {}\n", probe.file.name, probe.convention);
    }
    header += &format!("element vertex {}\n", points.len());
    for (kind, name) in PROPERTIES.into_iter().chain(panorama.then_some(PANORAMA)) {
        header += &format!("property {kind} {name}\n");
    }
    header += "end_header\n";

    let mut bytes = header.into_bytes();
    bytes.reserve_exact(points.len() * VERTEX_BYTES);
    for point in points {
        push_floats(&mut bytes, &point.position_m.to_array());
        push_floats(&mut bytes, &point.normal.to_array());
        bytes.extend(point.radiance.map(lo_imaging::srgb8_from_linear));
        push_floats(&mut bytes, &point.radiance);
        push_floats(&mut bytes, &[point.opacity, point.edge_m, point.seen]);
        if panorama {
            push_floats(&mut bytes, &[point.panorama]);
        }
    }
    bytes
}

fn push_floats(bytes: &mut Vec<u8>, values: &[f32]) {
    values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::io::BufReader;

    use ply_rs_bw::parser::Parser;
    use ply_rs_bw::ply::{DefaultElement, Property};

    use super::*;
    use crate::test_scene::box_room;
    use crate::{free_space, points};

    fn parse(bytes: &[u8]) -> (Vec<String>, Vec<DefaultElement>) {
        let ply = Parser::<DefaultElement>::new().read_ply(&mut BufReader::new(bytes)).unwrap();
        let comments = ply.header.comments.iter().map(|comment| comment.to_string()).collect();
        (comments, ply.payload["vertex"].clone())
    }

    #[test]
    fn what_a_panorama_gave_is_one_more_property() {
        let mut points = points::from_leaves(&free_space::leaves(&box_room().light, None));
        points[5].panorama = 0.25;
        let (comments, vertices) = parse(&encode(&points, "axes", &[], true));
        assert!(comments.iter().any(|comment| comment.contains("a panorama of the room gave")));
        let share = |vertex: &DefaultElement| match vertex["panorama"] {
            Property::Float(value) => value,
            ref other => panic!("panorama is {other:?}"),
        };
        assert_eq!((vertices.len(), share(&vertices[4]), share(&vertices[5])), (296, 0.0, 0.25));
    }

    #[test]
    fn another_reader_gets_every_value_back() {
        let points = points::from_leaves(&free_space::leaves(&box_room().light, None));
        let (comments, vertices) = parse(&encode(&points, "axes", &[], false));
        assert!(comments.iter().any(|comment| comment.contains("lightoctree export")));
        assert_eq!(vertices.len(), 296);
        for (vertex, point) in vertices.iter().zip(&points) {
            let float = |name: &str| match vertex[name] {
                Property::Float(value) => value,
                ref other => panic!("{name} is {other:?}"),
            };
            assert_eq!([float("x"), float("y"), float("z")], point.position_m.to_array());
            assert_eq!([float("nx"), float("ny"), float("nz")], point.normal.to_array());
            assert_eq!([float("radiance_r"), float("radiance_g"), float("radiance_b")], point.radiance);
            assert_eq!([float("opacity"), float("edge_m"), float("seen")], [point.opacity, 0.5, point.seen]);
        }
        // The lamp is brighter than white and clips; 0.5 is sRGB 188 (IEC 61966-2-1: 187.52).
        let red: Vec<u8> = vertices
            .iter()
            .map(|vertex| match vertex["red"] {
                Property::UChar(value) => value,
                ref other => panic!("red is {other:?}"),
            })
            .collect();
        assert_eq!(red.iter().filter(|&&value| value == 255).count(), 4);
        assert_eq!(red.iter().filter(|&&value| value == 188).count(), 292);
    }
}
