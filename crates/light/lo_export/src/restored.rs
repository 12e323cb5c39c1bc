//! The photo's radiance with what the scene knows of its clipped highlights.

use std::collections::HashMap;

use lo_imaging::RadianceImage;
use lo_octree::{LightOctree, xyz_from_key};
use lo_scene::Frame;

use crate::free_space::Leaf;
use crate::sources::Kept;

/// The photo's radiance; pixels that the sensor clipped have that of their leaf where it is brighter, as much as its faces keep.
///
/// `None` where there is no such pixel: then the photo itself will do.
pub(crate) fn radiance(frame: &Frame, light: &LightOctree, leaves: &[Leaf], kept: &[Kept]) -> Option<RadianceImage> {
    let of_node: HashMap<_, _> =
        leaves.iter().zip(kept).map(|(leaf, kept)| ((leaf.depth, leaf.xyz), (leaf, kept))).collect();
    let depth = light.octree.depth();
    let edge_m = light.cube.node_edge_m(depth);
    let clipped = frame.clipped();
    let mut radiance = frame.radiance();
    let (columns, rows) = (frame.depth_m.width(), frame.depth_m.height());
    let mut changed = false;
    for y in 0..radiance.height() {
        for x in (0..radiance.width()).filter(|&x| clipped[(x, y)]) {
            let Some(point) = frame.point(x * columns / radiance.width(), y * rows / radiance.height()) else {
                continue;
            };
            // A surface may lie a leaf before or behind its reading.
            let leaf = [0.0, 1.0, -1.0].into_iter().find_map(|leaves| {
                let (depth, node) = light.locate(point + point.normalize_or_zero() * (leaves * edge_m), depth)?;
                of_node.get(&(depth, xyz_from_key(light.octree.levels()[depth as usize].keys[node])))
            });
            let Some((leaf, kept)) = leaf else { continue };
            let restored = kept.of(leaf.radiance());
            let pixel = &mut radiance[(x, y)];
            if lo_imaging::luminance(restored) > lo_imaging::luminance(*pixel) {
                *pixel = restored;
                changed = true;
            }
        }
    }
    changed.then_some(radiance)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Cube, Vec3};
    use lo_imaging::{Image, Photo};

    use super::*;
    use crate::free_space;
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
        let whole = radiance(&frame, &light, &leaves, &vec![Kept::All; leaves.len()]).unwrap();
        assert_eq!(whole[(1, 3)], [5.0, 4.0, 3.0]);
        assert_eq!(whole[(6, 3)], frame.radiance()[(6, 3)]);
        // With a lamp before the wall the faces have no more than white, which the photo has, too.
        assert_eq!(radiance(&frame, &light, &leaves, &vec![Kept::UpToWhite; leaves.len()]), None);
    }
}
