use lo_cone::{Cone, ConeTracer, Settings};
use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::balance::balance;
use crate::cap::{cap_of, excess};
use crate::{LightPatch, PatchShape};

/// Half-angle tangent of the rays that test whether a face looks into the room.
pub(crate) const RAY_TANGENT: f32 = 0.01;

/// Opacity above which such a ray hit something.
pub(crate) const MET: f32 = 0.5;

/// Number of leaves, from a face inwards, whose light leaves through it. Shells of inferred surfaces are up to this
/// thick.
const LAYERS: u32 = 4;

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
    let mut patches = Vec::new();
    for leaf in light.octree.leaf_nodes() {
        let centre = light.node_middle_m(leaf.depth, light.octree.key(leaf));
        patches.extend(patches_of_leaf(light, leaf.depth, centre, &excess));
    }
    let inside: Vec<LightPatch> = patches.iter().filter(|patch| looks_into_room(patch, tracer)).copied().collect();
    // An octree that is not closed has no inside; then all faces count.
    let mut patches = if inside.is_empty() { patches } else { inside };
    let lamps = ConeTracer::new(&with(light.rows_with(|depth, row, _| excess[depth][row])), Settings::default());
    if let Ok(lamps) = lamps {
        balance(&mut patches, tracer, &lamps, eyes);
    }
    (patches, dimmed)
}

/// Returns whether a ray from before the face meets anything. The back of a closed room's shell looks into empty space.
fn looks_into_room(patch: &LightPatch, tracer: &ConeTracer) -> bool {
    let PatchShape::Square { centre, normal, edge_m } = patch.shape else { return false };
    let cone = Cone { origin: centre + normal * 1.5 * edge_m, direction: normal, tan_half_angle: RAY_TANGENT };
    tracer.trace(&cone).opacity > MET
}

/// Returns the bright faces of a leaf, as patches at the centre of the leaf, since the position of the surface in a leaf
/// is unknown.
fn patches_of_leaf(
    light: &LightOctree,
    depth: u32,
    centre: Vec3,
    excess: &[Vec<Vec3>],
) -> impl Iterator<Item = LightPatch> {
    let edge_m = light.cube.node_edge_m(depth);
    exposed_normals(light, depth, centre).filter_map(move |normal| {
        let (mut radiance, mut passed) = (Vec3::ZERO, 1.0);
        for (depth, row, opacity) in nodes_behind(light, depth, centre, normal) {
            radiance += excess[depth][row] * (passed * opacity);
            passed *= 1.0 - opacity;
        }
        let shape = PatchShape::Square { centre, normal, edge_m };
        (radiance != Vec3::ZERO).then_some(LightPatch { shape, radiance, extent: edge_m * edge_m })
    })
}

/// Returns the share of what is behind a face that the nodes there stop, along the normal.
pub(crate) fn opacity_behind(light: &LightOctree, depth: u32, centre: Vec3, normal: Vec3) -> f32 {
    1.0 - nodes_behind(light, depth, centre, normal).map(|(.., opacity)| 1.0 - opacity).product::<f32>()
}

/// Iterates over the nodes behind a face of the node of this depth and centre, front to back, up to the first empty
/// one: depth, row, and opacity of one edge of that node.
fn nodes_behind(
    light: &LightOctree,
    depth: u32,
    centre: Vec3,
    normal: Vec3,
) -> impl Iterator<Item = (usize, usize, f32)> {
    let edge_m = light.cube.node_edge_m(depth);
    (0..LAYERS).map_while(move |layer| {
        let (found, node) = light.locate(centre - normal * (layer as f32 * edge_m), depth)?;
        let row = usize::try_from(light.octree.levels()[found as usize].rows[node]).ok()?;
        let alpha = light.rgba[found as usize][row][3];
        let share = edge_m / light.cube.node_edge_m(found);
        Some((found as usize, row, 1.0 - (1.0 - alpha).powf(share)))
    })
}

/// Returns the normals of the faces that border on empty nodes, for the node of this depth and centre.
pub(crate) fn exposed_normals(light: &LightOctree, depth: u32, centre: Vec3) -> impl Iterator<Item = Vec3> {
    let edge_m = light.cube.node_edge_m(depth);
    let axes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z];
    axes.into_iter().filter(move |normal| {
        light.locate(centre + *normal * edge_m, depth).is_none_or(|(d, node)| light.node_rgba(d, node).is_none())
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f32::consts::PI;

    use lo_geometry::{Cube, pixel_direction, pixel_solid_angle_sr};
    use lo_octree::key_from_xyz;

    use super::*;

    /// A room of 4 m, of grey walls of half-transparent leaves, `layers` thick. A lamp of 4 × 4 leaves in its ceiling has
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
