//! Faces of leaves that border on empty space.

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::Vec3;
use lo_octree::LightOctree;

use crate::{LightPatch, PatchShape};

/// Half-angle tangent of the rays that test occlusion and whether a face looks into the room.
pub(crate) const RAY_TANGENT: f32 = 0.01;

/// Opacity above which such a ray hit something.
const MET: f32 = 0.5;

/// Number of leaves, from a face inwards, whose light leaves through it. Shells of inferred surfaces are up to this
/// thick.
const LAYERS: u32 = 4;

/// A face of a leaf, at the centre of the leaf, since the position of the surface in a leaf is unknown.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Face {
    pub centre: Vec3,
    pub normal: Vec3,
    pub edge_m: f32,
    pub radiance: Vec3,
}

impl Face {
    pub fn patch(self) -> LightPatch {
        let Self { centre, normal, edge_m, radiance } = self;
        LightPatch { shape: PatchShape::Square { centre, normal, edge_m }, radiance, extent: edge_m * edge_m }
    }
}

/// Returns for each face (its leaf's centre and edge, its normal) whether it looks into the room: a ray from before it
/// meets something. The back of a closed room's shell looks into empty space. If no face looks into the room, the
/// octree is not closed, and all do.
pub(crate) fn look_into_room(faces: impl Iterator<Item = (Vec3, f32, Vec3)>, tracer: &ConeTracer) -> Vec<bool> {
    let cone = |(centre, edge_m, normal): (Vec3, f32, Vec3)| Cone {
        origin: centre + normal * 1.5 * edge_m,
        direction: normal,
        tan_half_angle: RAY_TANGENT,
    };
    let cones: Vec<Cone> = faces.map(cone).collect();
    let mut samples = vec![ConeSample::default(); cones.len()];
    tracer.trace_batch(&cones, &mut samples);
    let is_closed = samples.iter().any(|sample| sample.opacity > MET);
    samples.iter().map(|sample| !is_closed || sample.opacity > MET).collect()
}

/// Returns the share of what is behind a face that the nodes there stop, along the normal.
pub(crate) fn opacity_behind(light: &LightOctree, depth: u32, centre: Vec3, normal: Vec3) -> f32 {
    1.0 - nodes_behind(light, depth, centre, normal).map(|(.., opacity)| 1.0 - opacity).product::<f32>()
}

/// Iterates over the nodes behind a face of the node of this depth and centre, front to back, up to the first empty
/// one: depth, row, and opacity of one edge of that node.
pub(crate) fn nodes_behind(
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
