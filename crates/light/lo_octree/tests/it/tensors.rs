//! The octree's tensors: exact round trips, and errors for damaged input.

use lo_geometry::{Cube, Vec3};
use lo_octree::{
    LightOctree, NamedTensor, Octree, OctreeError, OctreeHeader, Provenance, RadiancePoint, read_tensors, write_tensors,
};
use proptest::prelude::*;
use safetensors::{Dtype, SafeTensors, serialize};

const CUBE: Cube = Cube { origin_m: Vec3::new(-1.25, -0.1, -3.3), edge_m: 5.7 };

fn sample(depth: u32, full_depth: u32, count: usize) -> LightOctree {
    let points: Vec<RadiancePoint> = (0..count)
        .map(|i| {
            let t = i as f32;
            let unit = Vec3::new(0.5 + 0.49 * (0.3 * t).sin(), (0.618 * t).fract(), t / count as f32);
            let provenance = if i % 3 == 0 { Provenance::Inferred } else { Provenance::Observed };
            RadiancePoint {
                position_m: CUBE.world_from_unit(unit),
                radiance: [0.1 * t, 1.0, 30.0 / (1.0 + t)],
                provenance,
            }
        })
        .collect();
    LightOctree::from_points(&points, CUBE, depth, full_depth).unwrap().0
}

/// A grown octree with non-empty leaves above the finest depth.
fn grown() -> LightOctree {
    let mut octree = Octree::full(1).unwrap();
    octree.set_nonempty(&[true, false, true, true, false, false, false, true]).unwrap();
    octree.grow(&[true, false, false, true, false, false, false, false]).unwrap();
    octree.set_nonempty(&[true; 16]).unwrap();
    let rgba = octree.levels().iter().map(|level| vec![[0.5, 1.0, 2.0, 0.25]; level.nonempty]).collect();
    let seen = octree.levels().iter().map(|level| vec![9; level.nonempty]).collect();
    LightOctree { octree, cube: CUBE, rgba, seen, lobes: None }
}

fn bytes_of(tensors: Vec<NamedTensor>) -> Vec<u8> {
    serialize(tensors.into_iter().map(|tensor| (tensor.name.clone(), tensor)), None).unwrap()
}

fn read(bytes: &[u8], header: &OctreeHeader) -> Result<LightOctree, OctreeError> {
    read_tensors(&SafeTensors::deserialize(bytes).unwrap(), header)
}

/// Returns the error text after `change` was made to one tensor of a small octree.
fn error_after(name: &str, change: impl FnOnce(&mut NamedTensor)) -> String {
    let (header, mut tensors) = write_tensors(&sample(4, 2, 300));
    change(tensors.iter_mut().find(|tensor| tensor.name == name).unwrap());
    read(&bytes_of(tensors), &header).unwrap_err().to_string()
}

#[test]
fn round_trips_are_exact() {
    let mut directional = sample(5, 2, 500);
    let lobe = |rgba: &[f32; 4]| [rgba[0], -rgba[1], 0.5];
    directional.lobes = Some(directional.rgba.iter().map(|rows| rows.iter().map(lobe).collect()).collect());
    for light in [directional, sample(7, 4, 2000), sample(3, 3, 10), sample(1, 0, 1), sample(6, 2, 0), grown()] {
        let (header, tensors) = write_tensors(&light);
        let json = serde_json::to_string(&header).unwrap();
        let header: OctreeHeader = serde_json::from_str(&json).unwrap();
        let bytes = bytes_of(tensors.clone());
        let back = read(&bytes, &header).unwrap();
        assert_eq!(back, light);
        assert_eq!(write_tensors(&back), (header, tensors));
    }
}

#[test]
fn lobes_are_of_all_depths_and_finite() {
    let mut light = sample(4, 2, 300);
    light.lobes = Some(light.rgba.iter().map(|rows| vec![[1.0, 0.0, -2.0]; rows.len()]).collect());
    let (header, tensors) = write_tensors(&light);
    let is = |name: &'static str| move |tensor: &NamedTensor| tensor.name == name;
    let mut fewer = tensors.clone();
    fewer.retain(|tensor| !is("octree.3.lobes")(tensor));
    let error = read(&bytes_of(fewer), &header).unwrap_err().to_string();
    assert!(error.contains("octree.3.lobes"), "{error}");
    let mut infinite = tensors;
    let lobes = infinite.iter_mut().find(|tensor| is("octree.2.lobes")(tensor)).unwrap();
    lobes.bytes[16..20].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let error = read(&bytes_of(infinite), &header).unwrap_err().to_string();
    assert!(error.contains("octree.2.lobes, entry 1"), "{error}");
}

#[test]
fn errors_name_tensor_and_entry() {
    let word =
        |entry: usize, value: [u8; 4]| move |t: &mut NamedTensor| t.bytes[4 * entry..][..4].copy_from_slice(&value);
    assert_eq!(
        error_after("octree.2.keys", word(5, 6u32.to_le_bytes())),
        "tensor octree.2.keys, entry 5 is not the key of the next child of a split node above"
    );
    assert_eq!(
        error_after("octree.1.children", word(3, (-1i32).to_le_bytes())),
        "tensor octree.1.children, entry 3 leaves a node above the full depth unsplit"
    );
    assert_eq!(
        error_after("octree.1.children", word(3, 32i32.to_le_bytes())),
        "tensor octree.1.children, entry 3 is neither -1 nor the index after the children of the split node before it"
    );
    assert_eq!(
        error_after("octree.4.children", word(0, 0i32.to_le_bytes())),
        "tensor octree.4.children, entry 0 splits a node of the finest depth"
    );
    assert_eq!(
        error_after("octree.4.nonempty", |t| t.bytes[1] = 2),
        "tensor octree.4.nonempty, entry 1 is neither 0 nor 1"
    );
    for (entry, value) in [(3, 1.5f32), (2, -1.0), (1, f32::NAN), (0, f32::INFINITY), (2, 1.1e14)] {
        assert_eq!(
            error_after("octree.3.rgba", word(4 + entry, value.to_le_bytes())),
            "tensor octree.3.rgba, entry 1 is not radiance from 0 to 1e14 with opacity in [0, 1]"
        );
    }
    assert_eq!(
        error_after("octree.0.keys", |t| t.dtype = Dtype::F32),
        "tensor octree.0.keys: expected U32 [1], got F32 [1]"
    );
    assert_eq!(error_after("octree.3.seen", |t| t.name = "other".into()), "tensor octree.3.seen is missing");

    // An empty node at the full depth that is split, and a non-empty node whose parent is empty.
    let light = sample(4, 2, 300);
    let empty = light.octree.levels()[2].rows.iter().position(|&row| row < 0).unwrap();
    let next = 8 * light.octree.levels()[2].children[..empty].iter().filter(|&&child| child >= 0).count() as i32;
    assert_eq!(
        error_after("octree.2.children", word(empty, next.to_le_bytes())),
        format!("tensor octree.2.children, entry {empty} splits an empty node below the full depth")
    );
    let error = error_after("octree.0.nonempty", |t| t.bytes[0] = 0);
    assert_eq!(error, "tensor octree.0.rgba: expected F32 [0, 4], got F32 [1, 4]");
}

#[test]
fn headers_are_checked() {
    let (header, tensors) = write_tensors(&sample(4, 2, 300));
    let bytes = bytes_of(tensors);
    let cube = Cube { edge_m: f32::NAN, ..CUBE };
    for (bad, text) in [
        (
            OctreeHeader { format_version: 2, ..header },
            "the octree's format version is 2; this program reads version 1",
        ),
        (OctreeHeader { depth: 0, ..header }, "the octree's depth must lie between 1 and 10, got 0"),
        (OctreeHeader { depth: u32::MAX, ..header }, "the octree's depth must lie between 1 and 10, got 4294967295"),
        (
            OctreeHeader { full_depth: 5, ..header },
            "the full depth must lie between 0 and the smaller of the depth (4) and 7, got 5",
        ),
        (
            OctreeHeader { cube, ..header },
            "the cube's edge must be from 0.001 to 1000000 m and its corner within ± 1000000 m, \
             got corner [-1.25, -0.1, -3.3] m and edge NaN m",
        ),
        (OctreeHeader { cube: Cube { edge_m: 1e19, ..CUBE }, ..header }, "the cube's edge must be from"),
        (OctreeHeader { cube: Cube { edge_m: 1e-30, ..CUBE }, ..header }, "the cube's edge must be from"),
        (OctreeHeader { cube: Cube { origin_m: Vec3::splat(-1e7), ..CUBE }, ..header }, "the cube's edge must be from"),
        (OctreeHeader { depth: 5, ..header }, "tensor octree.5.keys is missing"),
        (OctreeHeader { depth: 3, ..header }, "tensor octree.3.children, entry 0 splits a node of the finest depth"),
        (OctreeHeader { full_depth: 4, ..header }, "tensor octree.2.children, entry"),
    ] {
        let error = read(&bytes, &bad).unwrap_err().to_string();
        assert!(error.starts_with(text), "{error} instead of {text}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    /// A damaged file that still parses either reads as a usable octree or gives an error.
    #[test]
    fn damaged_files_never_panic(
        flips in prop::collection::vec((any::<prop::sample::Index>(), 0..8u32), 0..6),
        truncate in prop::option::weighted(0.2, any::<prop::sample::Index>()),
        swap in prop::option::weighted(0.3, (any::<prop::sample::Index>(), any::<prop::sample::Index>())),
    ) {
        let (header, mut tensors) = write_tensors(&if flips.len() % 2 == 0 { sample(3, 1, 40) } else { grown() });
        if let Some((a, b)) = swap {
            let (a, b) = (a.index(tensors.len()), b.index(tensors.len()));
            let name = std::mem::take(&mut tensors[a].name);
            tensors[a].name = std::mem::replace(&mut tensors[b].name, name.clone());
            if a == b {
                tensors[a].name = name;
            }
        }
        let mut bytes = bytes_of(tensors);
        for (place, bit) in flips {
            let place = place.index(bytes.len());
            bytes[place] ^= 1 << bit;
        }
        if let Some(place) = truncate {
            bytes.truncate(place.index(bytes.len()));
        }
        if let Ok(file) = SafeTensors::deserialize(&bytes)
            && let Ok(light) = read_tensors(&file, &header)
        {
            for (depth, level) in light.octree.levels().iter().enumerate() {
                prop_assert_eq!(light.octree.neighbours(depth as u32).len(), level.len());
                for (node, &key) in level.keys.iter().enumerate() {
                    prop_assert_eq!(light.octree.find(depth as u32, key), Some(node));
                    light.node_rgba(depth as u32, node);
                }
            }
            let (header, tensors) = write_tensors(&light);
            prop_assert_eq!(read(&bytes_of(tensors), &header).unwrap(), light);
        }
    }
}
