use lo_cone::{ConeTracer, Settings};
use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::LightPatch;
use crate::balance::balance;
use crate::cap::{cap_of, excess};
use crate::face::{Face, exposed_normals, look_into_room, nodes_behind};

/// Splits a lighting octree at the cap into patches of light and the octree without their excess. The two add up to the
/// whole, as cones of `tracer` see it from `eyes`.
///
/// The patches are the faces of leaves that border on empty space, look into the room and show bright leaves, each with
/// the radiance that its leaf and those behind it let through, by their opacities. For flat and slanted lamps alike,
/// their projections to any direction add up to the lamp's own.
pub fn split_octree(light: &LightOctree, tracer: &ConeTracer, eyes: &[Vec3]) -> (Vec<LightPatch>, LightOctree) {
    let cap = cap_of(light);
    let excess = light.merged(|leaf| excess(light.radiance(leaf), cap));
    let with = |rgba| LightOctree { rgba, ..light.clone() };
    let dimmed = with(light.rows_with(|depth, row, radiance| radiance - excess[depth][row]));
    if excess.iter().flatten().all(|&light| light == Vec3::ZERO) {
        return (Vec::new(), dimmed);
    }
    let mut faces = Vec::new();
    for leaf in light.octree.leaf_nodes() {
        let centre = light.node_middle_m(leaf.depth, light.octree.key(leaf));
        faces.extend(bright_faces(light, leaf.depth, centre, &excess));
    }
    let look_inside = look_into_room(faces.iter().map(|face: &Face| (face.centre, face.edge_m, face.normal)), tracer);
    let mut look_inside = look_inside.into_iter();
    faces.retain(|_| look_inside.next() == Some(true));
    let lamps = ConeTracer::new(&with(light.rows_with(|depth, row, _| excess[depth][row])), Settings::default());
    if let Ok(lamps) = lamps {
        balance(&mut faces, tracer, &lamps, eyes);
    }
    (faces.into_iter().map(Face::patch).collect(), dimmed)
}

/// Returns the faces of a leaf that border on empty nodes and show bright leaves.
fn bright_faces(light: &LightOctree, depth: u32, centre: Vec3, excess: &[Vec<Vec3>]) -> impl Iterator<Item = Face> {
    let edge_m = light.cube.node_edge_m(depth);
    exposed_normals(light, depth, centre).filter_map(move |normal| {
        let (mut radiance, mut passed) = (Vec3::ZERO, 1.0);
        for (depth, row, opacity) in nodes_behind(light, depth, centre, normal) {
            radiance += excess[depth][row] * (passed * opacity);
            passed *= 1.0 - opacity;
        }
        (radiance != Vec3::ZERO).then_some(Face { centre, normal, edge_m, radiance })
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f32::consts::PI;

    use lo_geometry::{Cube, pixel_direction, pixel_solid_angle_sr};
    use lo_octree::key_from_xyz;

    use super::*;
    use crate::PatchShape;
    use crate::face::opacity_behind;

    /// A room of 4 m, of grey walls of half-transparent leaves, `layers` thick. A lamp of 4 × 4 leaves in its ceiling
    /// has
    /// the opacity `alpha`.
    fn room(alpha: f32, layers: u32) -> LightOctree {
        let depth = |xyz: [u32; 3]| xyz.map(|c| c.min(31 - c)).into_iter().min().unwrap();
        let cells = (0..32u32.pow(3)).map(|i| [i / 1024, i / 32 % 32, i % 32]).filter(|xyz| depth(*xyz) < layers);
        let rgba = |xyz: [u32; 3]| match xyz {
            [14..=17, 28..=31, 10..=13] => [40.0, 30.0, 20.0, alpha],
            _ => [0.5, 0.5, 0.5, 0.6],
        };
        let mut leaves: Vec<(u32, [f32; 4])> = cells.map(|xyz| (key_from_xyz(xyz), rgba(xyz))).collect();
        leaves.sort_by_key(|leaf| leaf.0);
        let (keys, rgba): (Vec<u32>, Vec<[f32; 4]>) = leaves.into_iter().unzip();
        let seen = vec![0; keys.len()];
        LightOctree::from_leaves(keys, rgba, seen, Cube::centred(Vec3::ZERO, 4.0), 5, 2).unwrap()
    }

    fn tracer(light: &LightOctree) -> ConeTracer {
        ConeTracer::new(light, Settings::default()).unwrap()
    }

    /// Irradiance on an upward-facing surface.
    fn irradiance(light: &LightOctree, at: Vec3) -> f32 {
        let (width, height) = (512, 256);
        let panorama = tracer(light).panorama(at, width, height).radiance;
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let light = |((x, y), radiance): ((usize, usize), &[f32; 3])| {
            let cosine = pixel_direction(x, y, width, height).y.max(0.0);
            radiance[0] * cosine * pixel_solid_angle_sr(y, width, height)
        };
        pixels.zip(panorama.pixels()).map(light).sum()
    }

    fn irradiance_of_patches(patches: &[LightPatch], at: Vec3) -> f32 {
        let light = |patch: &LightPatch| {
            let PatchShape::Square { centre, normal, .. } = patch.shape else { panic!("{patch:?}") };
            let offset = centre - at;
            let direction = offset.normalize();
            let cosines = (-normal.dot(direction)).max(0.0) * direction.y.max(0.0);
            patch.radiance.x * patch.extent * cosines / offset.length_squared()
        };
        patches.iter().map(light).sum()
    }

    #[test]
    fn patches_and_the_rest_light_a_surface_as_the_octree_does() {
        let eyes = [Vec3::ZERO, Vec3::new(0.8, -0.6, 0.5)];
        for (alpha, layers) in [(0.9999, 1), (0.3, 1), (0.3, 3), (0.05, 3), (0.8, 2)] {
            let light = room(alpha, layers);
            let (patches, rest) = split_octree(&light, &tracer(&light), &eyes);
            assert!(patches.len() >= 16, "{}", patches.len());
            // Not one of the eyes.
            let at = Vec3::new(-0.4, -0.9, -0.7);
            let whole = irradiance(&light, at);
            let lamp = whole - irradiance(&rest, at);
            let ratio = irradiance_of_patches(&patches, at) / lamp;
            assert!((0.85..1.15).contains(&ratio), "{ratio} of opacity {alpha}, {layers} layers, {lamp} of {whole}");
            assert!(lamp < 1.1 * PI * 40.0);
        }
    }

    #[test]
    fn a_face_shows_the_leaves_behind_it_by_their_opacities() {
        let light = room(0.3, 3);
        let faces = (0..3).map(|layer| light.cube.world_from_unit(Vec3::new(15.5, 29.5 + layer as f32, 11.5) / 32.0));
        let opacities: Vec<f32> = faces.map(|centre| opacity_behind(&light, 5, centre, Vec3::NEG_Y)).collect();
        for (opacity, layers) in opacities.into_iter().zip([3, 2, 1]) {
            assert!((opacity - (1.0 - 0.7f32.powi(layers))).abs() < 1e-5, "{opacity} of {layers}");
        }
    }

    #[test]
    fn rooms_of_one_radiance_have_no_patches() {
        let mut light = room(0.6, 2);
        light.change_leaves(|_, _| Vec3::ONE);
        let (patches, rest) = split_octree(&light, &tracer(&light), &[Vec3::ZERO]);
        assert!(patches.is_empty());
        assert_eq!(rest, light);
    }
}
