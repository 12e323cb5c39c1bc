use lo_geometry::{Camera, Cube, Vec3};
use lo_octree::xyz_from_key;

use crate::light::{PhotoView, VisiblePoint};

/// Side of a cell in pixels of the camera.
const CELL: u32 = 4;

/// Space that photos show to be empty: in front of the observed surfaces.
#[derive(Clone, Debug)]
pub struct FreeSpace(Vec<CameraFreeSpace>);

/// Free space observed by one camera.
#[derive(Clone, Debug)]
struct CameraFreeSpace {
    /// The camera, with cells as pixels.
    view: PhotoView,
    /// Depth of the nearest point in each cell in metres, or 0 without points, where free space is unknown.
    nearest_m: Vec<f32>,
}

impl FreeSpace {
    /// Builds free space from the points that a camera observes.
    pub fn new(points: &[VisiblePoint], camera: &Camera) -> Self {
        Self::of_photos(points, &[PhotoView::only(*camera, points.len())])
    }

    /// Builds free space from several cameras. Each of them observes its own range of points.
    ///
    /// # Panics
    /// Where the views have more points than there are.
    pub fn of_photos(points: &[VisiblePoint], views: &[PhotoView]) -> Self {
        let mut rest = points;
        let of_view = |view: &PhotoView| {
            let (own, others) = rest.split_at(view.points);
            rest = others;
            CameraFreeSpace::new(own, view)
        };
        Self(views.iter().map(of_view).collect())
    }

    /// Reports whether any single camera shows the whole node to be empty.
    pub fn contains_node(&self, cube: Cube, depth: u32, key: u32) -> bool {
        self.0.iter().any(|camera| camera.contains_node(cube, depth, key))
    }
}

impl CameraFreeSpace {
    fn new(points: &[VisiblePoint], view: &PhotoView) -> Self {
        let camera = view.camera.resized(view.camera.width.div_ceil(CELL), view.camera.height.div_ceil(CELL));
        let view = PhotoView { camera, ..*view };
        let mut nearest_m = vec![0.0f32; camera.width as usize * camera.height as usize];
        for point in points {
            let Some((u, v, z)) = view.project(point.position_m) else { continue };
            if camera.contains(u, v) {
                let cell = &mut nearest_m[v as usize * camera.width as usize + u as usize];
                *cell = if *cell == 0.0 { z as f32 } else { cell.min(z as f32) };
            }
        }
        Self { view, nearest_m }
    }

    fn contains_node(&self, cube: Cube, depth: u32, key: u32) -> bool {
        let [x, y, z] = xyz_from_key(key).map(|i| i as f32);
        let (mut low, mut high, mut farthest_m) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2], 0.0f64);
        for corner in 0..8 {
            let at =
                Vec3::new(x, y, z) + Vec3::new((corner & 1) as f32, (corner >> 1 & 1) as f32, (corner >> 2) as f32);
            let at = cube.world_from_unit(at / (1u32 << depth) as f32);
            let Some((u, v, z)) = self.view.project(at) else { return false };
            (low, high) = ([low[0].min(u), low[1].min(v)], [high[0].max(u), high[1].max(v)]);
            farthest_m = farthest_m.max(z);
        }
        let (width, height) = (self.view.camera.width as usize, self.view.camera.height as usize);
        if low[0] < 0.0 || low[1] < 0.0 || high[0] >= width as f64 || high[1] >= height as f64 {
            return false;
        }
        let is_behind = |cell: f32| f64::from(cell) > farthest_m;
        (low[1] as usize..=high[1] as usize).all(|v| {
            self.nearest_m[v * width..][low[0] as usize..=high[0] as usize].iter().all(|&cell| is_behind(cell))
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Quat, RigidTransform};
    use lo_octree::key_from_xyz;

    use super::*;

    #[test]
    fn only_space_in_front_of_a_wall_is_free() {
        // A wall 3 m away fills the view of 90°, except for a hole in its left half.
        let camera = Camera::from_hfov_deg(90.0, 64, 64).unwrap();
        let pixels =
            (0..64 * 64).map(|i| (i % 64, i / 64)).filter(|&(u, v)| !(12..20).contains(&u) || !(28..36).contains(&v));
        let point = |(u, v): (i32, i32)| VisiblePoint {
            position_m: camera.unproject(f64::from(u) + 0.5, f64::from(v) + 0.5, 3.0),
            radiance: [0.5; 3],
            normal: Vec3::Z,
            certain: true,
        };
        let points: Vec<VisiblePoint> = pixels.map(point).collect();
        let free = FreeSpace::new(&points, &camera);
        let cube = Cube::centred(Vec3::ZERO, 8.0);
        // Nodes of 0.25 m, given by a point inside.
        let holds = |x: f32, y: f32, z: f32| {
            let unit = cube.unit_from_world(Vec3::new(x, y, z)) * 32.0;
            free.contains_node(cube, 5, key_from_xyz([unit.x as u32, unit.y as u32, unit.z as u32]))
        };
        assert!(holds(0.9, 0.4, -2.1) && holds(0.1, 0.1, -0.6));
        assert!(!holds(0.9, 0.4, -2.9), "contains the wall");
        assert!(!holds(0.9, 0.4, -3.4), "behind the wall");
        assert!(!holds(0.9, 0.4, 1.1) && !holds(0.1, 0.1, -0.1), "behind the camera, and beside it");
        assert!(!holds(2.1, 0.1, -2.1), "cut by the edge of the view");
        assert!(!holds(-1.0, 0.1, -2.1), "in front of the hole");
        assert!(!FreeSpace::new(&[], &camera).contains_node(cube, 5, 0));
    }

    #[test]
    fn each_camera_contributes_its_free_space() {
        // One camera faces a wall 3 m ahead. The other, to its side, faces a wall 2 m behind the first.
        let camera = Camera::from_hfov_deg(90.0, 64, 64).unwrap();
        let behind = RigidTransform {
            rotation: Quat::from_rotation_y(std::f32::consts::PI),
            translation_m: Vec3::new(0.5, 0.0, 0.0),
        };
        let wall = |world_from_camera: &RigidTransform, depth_m: f64| {
            let pixels = (0..64 * 64).map(|i| (f64::from(i % 64) + 0.5, f64::from(i / 64) + 0.5));
            let point = |(u, v)| VisiblePoint {
                position_m: world_from_camera.point(camera.unproject(u, v, depth_m)),
                radiance: [0.5; 3],
                normal: Vec3::ZERO,
                certain: true,
            };
            pixels.map(point).collect::<Vec<VisiblePoint>>()
        };
        let points = [wall(&RigidTransform::IDENTITY, 3.0), wall(&behind, 2.0)].concat();
        let first = PhotoView::only(camera, 64 * 64);
        let views = [first, PhotoView { camera_from_world: behind.inverse(), ..first }];
        let free = FreeSpace::of_photos(&points, &views);
        let cube = Cube::centred(Vec3::ZERO, 8.0);
        let holds = |x: f32, y: f32, z: f32| {
            let unit = cube.unit_from_world(Vec3::new(x, y, z)) * 32.0;
            free.contains_node(cube, 5, key_from_xyz([unit.x as u32, unit.y as u32, unit.z as u32]))
        };
        assert!(holds(0.9, 0.4, -2.1) && holds(0.6, 0.4, 1.4));
        assert!(!holds(0.6, 0.4, 2.1) && !holds(0.9, 0.4, -3.1), "behind the walls");
        assert!(!holds(3.1, 0.1, 0.1) && !holds(-2.4, 0.1, 1.1), "beside both views");
    }
}
