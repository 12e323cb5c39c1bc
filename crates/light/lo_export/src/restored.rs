//! The photo's radiance with clipped highlights restored from the octree.

use std::collections::HashMap;

use lo_imaging::RadianceImage;
use lo_lights::ImageChange;
use lo_octree::{LightOctree, xyz_from_key};
use lo_scene::{Frame, LitScene};

use crate::free_space::{self, Leaf};
use crate::lamps::FaceEmission;

/// Returns [`radiance`] of a scene with its light edits.
pub(crate) fn of_scene(scene: &LitScene, leaves: &[Leaf], kept: &[FaceEmission]) -> Option<RadianceImage> {
    let Some(change) = scene.edited.as_ref().and_then(|edited| edited.octree.as_ref()) else {
        return radiance(&scene.frame, &scene.light, leaves, kept);
    };
    // The photo shows the light before edits.
    let before = LightOctree { rgba: change.before.clone(), ..scene.light.clone() };
    let leaves_before = free_space::leaves(&before, None);
    let all = vec![FaceEmission::All; leaves_before.len()];
    let mut edited = radiance(&scene.frame, &before, &leaves_before, &all).unwrap_or_else(|| scene.frame.radiance());
    ImageChange::new(&scene.light, change).photo(&mut edited, &scene.frame.camera);
    let of_node = of_node(leaves, kept);
    for_clipped(&scene.frame, &scene.light, &of_node, |at, (_, kept)| {
        if *kept != FaceEmission::All {
            edited[at] = FaceEmission::UpToWhite.of(edited[at]);
        }
    });
    Some(edited)
}

/// Returns the photo's radiance. Pixels that the sensor clipped get the radiance that the faces of their leaf emit,
/// if it is brighter.
///
/// Returns `None` if there is no such pixel, so that the photo itself can be used.
pub(crate) fn radiance(
    frame: &Frame,
    light: &LightOctree,
    leaves: &[Leaf],
    kept: &[FaceEmission],
) -> Option<RadianceImage> {
    let of_node = of_node(leaves, kept);
    let mut radiance = frame.radiance();
    let mut changed = false;
    for_clipped(frame, light, &of_node, |at, (leaf, kept)| {
        let restored = kept.of(leaf.radiance());
        let pixel = &mut radiance[at];
        if lo_imaging::luminance(restored) > lo_imaging::luminance(*pixel) {
            *pixel = restored;
            changed = true;
        }
    });
    changed.then_some(radiance)
}

type LeavesByNode<'a> = HashMap<(u32, [u32; 3]), (&'a Leaf, &'a FaceEmission)>;

fn of_node<'a>(leaves: &'a [Leaf], kept: &'a [FaceEmission]) -> LeavesByNode<'a> {
    leaves.iter().zip(kept).map(|(leaf, kept)| ((leaf.depth, leaf.xyz), (leaf, kept))).collect()
}

/// Calls `with` for each clipped pixel whose leaf is found.
fn for_clipped(
    frame: &Frame,
    light: &LightOctree,
    of_node: &LeavesByNode,
    mut with: impl FnMut((usize, usize), (&Leaf, &FaceEmission)),
) {
    let depth = light.octree.depth();
    let edge_m = light.cube.node_edge_m(depth);
    let clipped = frame.clipped();
    let (columns, rows) = (frame.depth_m.width(), frame.depth_m.height());
    for y in 0..clipped.height() {
        for x in (0..clipped.width()).filter(|&x| clipped[(x, y)]) {
            let Some(point) = frame.point(x * columns / clipped.width(), y * rows / clipped.height()) else {
                continue;
            };
            // A surface may be a leaf in front of or behind its reading.
            let leaf = [0.0, 1.0, -1.0].into_iter().find_map(|leaves| {
                let (depth, node) = light.locate(point + point.normalize_or_zero() * (leaves * edge_m), depth)?;
                of_node.get(&(depth, xyz_from_key(light.octree.levels()[depth as usize].keys[node])))
            });
            if let Some(&leaf) = leaf {
                with((x, y), leaf);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Cube, Vec3};
    use lo_imaging::{Image, Photo};

    use super::*;
    use crate::test_scene::light_of;

    #[test]
    fn clipped_pixels_have_their_leaf_s_light() {
        // A wall of radiance 5 at 1.75 m; the left half of the photo is clipped, the right half is not.
        let cells: Vec<_> = (0..64).map(|i| ([i / 8, i % 8, 0], [5.0, 4.0, 3.0, 0.99])).collect();
        let light = light_of(&cells, Cube::centred(Vec3::ZERO, 4.0), 3);
        let photo = Image::from_fn(8, 6, |x, _| if x < 4 { [255; 3] } else { [128; 3] });
        let camera = Camera::new(5.0, 5.0, 4.0, 3.0, 8, 6).unwrap();
        let frame = Frame::new(Photo::Srgb8(photo), Image::new(8, 6, vec![1.75; 48]), camera, 1.0).unwrap();
        let leaves = free_space::leaves(&light, None);
        let whole = radiance(&frame, &light, &leaves, &vec![FaceEmission::All; leaves.len()]).unwrap();
        assert_eq!(whole[(1, 3)], [5.0, 4.0, 3.0]);
        assert_eq!(whole[(6, 3)], frame.radiance()[(6, 3)]);
        // With a lamp in front of the wall, the faces emit no more than white, as in the photo.
        assert_eq!(radiance(&frame, &light, &leaves, &vec![FaceEmission::UpToWhite; leaves.len()]), None);
    }
}
