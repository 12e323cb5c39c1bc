//! The observed surface as one mesh with the photo as its texture.

use lo_geometry::{Plane, Vec3};
use lo_scene::{Frame, LitScene, Room};

/// Largest number of vertex columns; phone sensors have 256.
const MAX_COLUMNS: usize = 320;

/// Smallest jump in depth at which the mesh is torn: metres, and share of the depth.
const TEAR_M: f32 = 0.03;
const TEAR_SHARE: f32 = 0.05;

/// Largest height above or below the floor of its vertices: metres, and share of the depth.
const FLOOR_M: f32 = 0.04;
const FLOOR_SHARE: f32 = 0.015;

/// Triangles with texture coordinates in the photo.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PhotoMesh {
    /// Positions in metres.
    pub positions_m: Vec<Vec3>,
    /// Position in the photo, from the upper left, in [0, 1].
    pub uvs: Vec<[f32; 2]>,
    /// Counter-clockwise seen from the camera.
    pub triangles: Vec<[u32; 3]>,
}

/// Creates the mesh of a scene, whose floor is flattened if it is known.
pub(crate) fn of_scene(scene: &LitScene) -> PhotoMesh {
    from_frame(&scene.frame, scene.room.as_ref().and_then(Room::floor))
}

/// Creates a vertex per reading, at a resolution that other programs can handle. The floor is flattened.
///
/// Vertices move only along the photo's rays, so that the photo still fits as a texture.
pub(crate) fn from_frame(frame: &Frame, floor: Option<Plane>) -> PhotoMesh {
    let (columns, rows) = (frame.depth_m.width(), frame.depth_m.height());
    let smaller = (columns > MAX_COLUMNS).then(|| {
        let columns = MAX_COLUMNS.min(frame.photo.width());
        frame.at_resolution(columns, (columns * rows).div_ceil(frame.depth_m.width()))
    });
    let frame = smaller.as_ref().unwrap_or(frame).without_flying_pixels();
    let (columns, rows) = (frame.depth_m.width(), frame.depth_m.height());
    let mut mesh = PhotoMesh::default();
    let mut vertices = vec![None; columns * rows];
    for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
        let Some(point) = frame.point(x, y) else { continue };
        vertices[y * columns + x] = Some(mesh.positions_m.len() as u32);
        mesh.positions_m.push(floor.map_or(point, |floor| flattened(point, floor)));
        mesh.uvs.push([(x as f32 + 0.5) / columns as f32, (y as f32 + 0.5) / rows as f32]);
    }
    for (y, x) in (1..rows).flat_map(|y| (1..columns).map(move |x| (y, x))) {
        let at = |dx: usize, dy: usize| vertices[(y - 1 + dy) * columns + x - 1 + dx];
        for corners in [[at(0, 0), at(0, 1), at(1, 1)], [at(0, 0), at(1, 1), at(1, 0)]] {
            let [Some(a), Some(b), Some(c)] = corners else { continue };
            let depths = [a, b, c].map(|i| -mesh.positions_m[i as usize].z);
            let near = depths.into_iter().fold(f32::INFINITY, f32::min);
            let far = depths.into_iter().fold(0.0, f32::max);
            if far - near <= TEAR_M + TEAR_SHARE * near {
                mesh.triangles.push([a, b, c]);
            }
        }
    }
    mesh
}

/// Returns the intersection of the ray to a point with the floor, if the point belongs to the floor.
fn flattened(point: Vec3, floor: Plane) -> Vec3 {
    if floor.signed_distance_m(point).abs() > FLOOR_M + FLOOR_SHARE * point.length() {
        return point;
    }
    let scale = floor.offset_m / floor.normal.dot(point);
    // Near the horizon a small height is a long distance.
    if (scale - 1.0).abs() < 2.0 * TEAR_SHARE { point * scale } else { point }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Camera;
    use lo_imaging::{Image, Photo};

    use super::*;

    /// A wall at 3 m, a box at 1 m in its lower left, a hole at (7, 0).
    fn frame() -> Frame {
        let depth_m = Image::from_fn(8, 6, |x, y| match (x, y) {
            (7, 0) => 0.0,
            (..4, 3..) => 1.0,
            _ => 3.0,
        });
        let camera = Camera::new(5.0, 5.0, 4.0, 3.0, 8, 6).unwrap();
        Frame::new(Photo::Srgb8(Image::new(8, 6, vec![[9; 3]; 48])), depth_m, camera, 1.0).unwrap()
    }

    #[test]
    fn the_photo_fits_and_steps_are_torn() {
        let frame = frame();
        let mesh = from_frame(&frame, None);
        assert_eq!(mesh.positions_m.len(), 47);
        for (position_m, uv) in mesh.positions_m.iter().zip(&mesh.uvs) {
            let (u, v, _) = frame.camera.project(*position_m).unwrap();
            assert!((u as f32 / 8.0 - uv[0]).abs() < 1e-5 && (v as f32 / 6.0 - uv[1]).abs() < 1e-5);
        }
        // 7 × 5 squares, minus the six across the step (four along its top, two more along its side). Of the square
        // at its corner, one triangle is on the wall; one triangle misses the corner without a reading.
        assert_eq!(mesh.triangles.len(), 2 * (35 - 6) + 1 - 1);
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|i| mesh.positions_m[i as usize]);
            assert!((b - a).cross(c - a).dot(-a) > 0.0, "seen from the camera");
            assert!((a.z - b.z).abs() + (a.z - c.z).abs() < 1e-6);
        }
    }

    #[test]
    fn the_floor_is_flat_and_stays_under_its_pixels() {
        let floor = Plane { normal: Vec3::Y, offset_m: -1.5 };
        for (point, of_floor) in [
            (Vec3::new(0.3, -1.47, -2.0), true),
            (Vec3::new(0.3, -1.54, -2.0), true),
            (Vec3::new(0.3, -1.3, -2.0), false),
        ] {
            let flat = flattened(point, floor);
            assert_eq!(floor.signed_distance_m(flat).abs() < 1e-6, of_floor);
            assert!(flat.normalize().dot(point.normalize()) > 1.0 - 1e-6);
            assert_eq!(flat == point, !of_floor);
        }
    }
}
