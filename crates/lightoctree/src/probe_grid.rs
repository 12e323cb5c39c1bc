use lo_geometry::{Vec3, orthonormal_basis};
use lo_scene::{Estimate, Side};

/// Returns the centres of `counts` equal cells that fill the room, in metres in the world frame.
///
/// `counts` is the number of cells along the room's axes x, y (up) and z. Of the returned points, x varies fastest,
/// then y. The cells fill the box bounded by the room's planes and the occupied leaves. Without planes it is the
/// axis-aligned box of the occupied leaves.
pub fn probe_grid(estimate: &Estimate, counts: [usize; 3]) -> Vec<Vec3> {
    let (axes, low, high) = room_bounds(estimate);
    let mut points = Vec::with_capacity(counts.iter().product());
    let at = |axis: usize, i: usize| low[axis] + (high[axis] - low[axis]) * (i as f32 + 0.5) / counts[axis] as f32;
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                points.push(axes * Vec3::new(at(0, i), at(1, j), at(2, k)));
            }
        }
    }
    points
}

/// Returns the room's axes as columns (y is up), and the lowest and highest coordinates along them.
fn room_bounds(estimate: &Estimate) -> (lo_geometry::Mat3, Vec3, Vec3) {
    let occupied = occupied_corners(estimate);
    let Some(room) = &estimate.room else {
        let (low, high) = bounds(occupied.into_iter());
        return (lo_geometry::Mat3::IDENTITY, low, high);
    };
    let wall = room.planes.iter().find(|plane| plane.side == Side::Wall).map(|plane| plane.plane.normal);
    let z =
        wall.map(|normal| (normal - room.up * normal.dot(room.up)).normalize_or_zero()).filter(|z| *z != Vec3::ZERO);
    let z = z.unwrap_or_else(|| orthonormal_basis(room.up).x_axis);
    let axes = lo_geometry::Mat3::from_cols(room.up.cross(z), room.up, z);
    let (mut low, mut high) = bounds(occupied.into_iter().map(|point| axes.transpose() * point));
    for plane in &room.planes {
        let normal = axes.transpose() * plane.plane.normal;
        let axis = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs())).unwrap_or(0);
        let at = plane.plane.offset_m / normal[axis];
        if normal[axis] > 0.0 {
            low[axis] = low[axis].max(at);
        } else {
            high[axis] = high[axis].min(at);
        }
    }
    (axes, low.min(high), high)
}

/// Returns the lowest and highest corner of every occupied leaf of the finest level, in the world frame.
fn occupied_corners(estimate: &Estimate) -> Vec<Vec3> {
    let light = &estimate.light;
    let depth = light.octree.depth();
    let edge_m = light.cube.node_edge_m(depth);
    let level = &light.octree.levels()[depth as usize];
    let mut corners = Vec::new();
    for key in level.row_keys() {
        let [x, y, z] = lo_octree::xyz_from_key(key);
        let low = light.cube.origin_m + Vec3::new(x as f32, y as f32, z as f32) * edge_m;
        corners.extend([low, low + Vec3::splat(edge_m)]);
    }
    corners
}

fn bounds(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), point| (low.min(point), high.max(point)))
}
