//! Where the page's light probes are.

use lo_geometry::{Mat3, Vec3};
use lo_scene::{Frame, LitScene};

use crate::{Content, ExportError, photo_mesh};

/// Largest number of probes.
const MAX_PROBES: usize = 96;

/// Share of the photo's surfaces beyond each face of the grid, where light is extrapolated.
const BEYOND: f32 = 0.02;

/// Distance of the grid from the surfaces at its faces, in metres: leaves are thick.
const INSET_M: f32 = 0.08;

/// Smallest distance of two probes in metres.
const MIN_SPACING_M: f32 = 0.15;

/// Greatest depth of a free point behind the surface that the photo shows there: metres, and share of the depth.
const BEHIND_M: f32 = 0.1;
const BEHIND_SHARE: f32 = 0.03;

/// A regular grid of light probes about the surfaces that the photo shows. It is upright if gravity is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WebGrid {
    /// The grid's axes as columns, in the camera's frame; y is up.
    pub(super) axes: Mat3,
    /// Position of the first probe along the axes.
    pub(super) origin_m: Vec3,
    pub(super) spacing_m: Vec3,
    pub(super) counts: [usize; 3],
}

impl WebGrid {
    /// Returns the grid of a scene.
    ///
    /// # Errors
    /// If no pixel of the photo has depth.
    pub fn of(scene: &LitScene) -> Result<Self, ExportError> {
        let mesh = photo_mesh::of_scene(scene);
        if mesh.positions_m.is_empty() {
            return Err(ExportError::Nothing(Content::PhotoPoints));
        }
        let axes = scene.room.as_ref().map_or(Mat3::IDENTITY, |room| room.level_from_camera().transpose());
        let along = axes.transpose();
        let bounds: [[f32; 2]; 3] = std::array::from_fn(|axis| {
            let mut values: Vec<f32> = mesh.positions_m.iter().map(|&point| (along * point)[axis]).collect();
            values.sort_by(f32::total_cmp);
            let at = |share: f32| values[(share * (values.len() - 1) as f32) as usize];
            let (low, high) = (at(BEYOND), at(1.0 - BEYOND));
            let inset = INSET_M.min(0.5 * (high - low));
            [low + inset, high - inset]
        });
        let corner = |end: usize| Vec3::from_array(bounds.map(|ends| ends[end]));
        Ok(Self::between(axes, corner(0), corner(1)))
    }

    /// Fills a box with at most [`MAX_PROBES`] probes, in cells that are nearly cubes.
    fn between(axes: Mat3, low: Vec3, high: Vec3) -> Self {
        let size = high - low;
        let counts = |spacing: f32| size.to_array().map(|edge| (edge / spacing).ceil() as usize + 1);
        let mut spacing = MIN_SPACING_M;
        while counts(spacing).iter().product::<usize>() > MAX_PROBES {
            spacing *= 1.02;
        }
        let counts = counts(spacing);
        let spacing_m = Vec3::from_array(std::array::from_fn(|axis| size[axis] / (counts[axis] - 1).max(1) as f32));
        // An edge of no length has one probe, and no division by zero.
        Self { axes, origin_m: low, spacing_m: spacing_m.max(Vec3::splat(f32::MIN_POSITIVE)), counts }
    }

    /// Returns the positions of the probes in the camera's frame, in metres; x varies fastest, then y.
    pub fn points(&self) -> Vec<Vec3> {
        let [nx, ny, nz] = self.counts;
        let mut points = Vec::with_capacity(nx * ny * nz);
        for (z, y) in (0..nz).flat_map(|z| (0..ny).map(move |y| (z, y))) {
            let at = |x: usize| self.origin_m + Vec3::new(x as f32, y as f32, z as f32) * self.spacing_m;
            points.extend((0..nx).map(|x| self.axes * at(x)));
        }
        points
    }
}

/// Returns whether light at a point is that of the room: it is not inside of a surface, not beyond a plane of the room,
/// and not behind what the photo shows.
pub fn is_free(scene: &LitScene, point: Vec3) -> bool {
    let light = &scene.light;
    let is_empty = |(depth, node): (u32, usize)| light.octree.levels()[depth as usize].rows[node] < 0;
    light.locate(point, light.octree.depth()).is_some_and(is_empty)
        && scene.room.iter().flat_map(|room| &room.planes).all(|plane| plane.plane.signed_distance_m(point) > 0.0)
        && !is_hidden(&scene.frame, point)
}

/// Returns whether the photo shows a surface in front of a point.
fn is_hidden(frame: &Frame, point: Vec3) -> bool {
    let Some((u, v, depth_m)) = frame.camera.project(point) else { return false };
    let (width, height) = (frame.depth_m.width(), frame.depth_m.height());
    let (x, y) = (u / f64::from(frame.camera.width), v / f64::from(frame.camera.height));
    if !(0.0..1.0).contains(&x) || !(0.0..1.0).contains(&y) {
        return false;
    }
    let seen_m = frame.depth_m[((x * width as f64) as usize, (y * height as f64) as usize)];
    seen_m > 0.0 && depth_m as f32 > seen_m + BEHIND_M + BEHIND_SHARE * seen_m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_behind_the_photos_surfaces_is_not_free() {
        let scene = crate::test_scene::box_room();
        // The walls are at 2 m, and a wall ahead is seen.
        assert!(is_free(&scene, Vec3::new(0.0, 0.0, -1.0)));
        let ahead = scene.frame.depth_m[(scene.frame.depth_m.width() / 2, scene.frame.depth_m.height() / 2)];
        assert!(ahead > 0.0 && is_hidden(&scene.frame, Vec3::new(0.0, 0.0, -1.2 * ahead - 0.2)));
        assert!(!is_hidden(&scene.frame, Vec3::new(0.0, 0.0, -ahead)) && !is_hidden(&scene.frame, Vec3::Z));
        assert!(!is_free(&scene, Vec3::splat(100.0)));
    }

    #[test]
    fn cells_are_nearly_cubes_and_their_number_is_bounded() {
        for (low, high) in [
            (Vec3::new(-2.0, -1.4, -6.0), Vec3::new(3.0, 1.1, -0.5)),
            (Vec3::splat(-0.01), Vec3::splat(0.01)),
            (Vec3::ZERO, Vec3::new(40.0, 0.1, 0.0)),
        ] {
            let grid = WebGrid::between(Mat3::IDENTITY, low, high);
            let points = grid.points();
            assert!(points.len() <= MAX_PROBES && points.len() == grid.counts.iter().product::<usize>());
            assert!((points[0] - low).length() < 1e-6);
            assert!((points[points.len() - 1] - high).length() < 1e-4, "{grid:?}");
        }
        let grid = WebGrid::between(Mat3::IDENTITY, Vec3::new(-2.0, -1.4, -6.0), Vec3::new(3.0, 1.1, -0.5));
        assert!(grid.spacing_m.max_element() / grid.spacing_m.min_element() < 1.7, "{grid:?}");
        assert!(grid.points().len() > MAX_PROBES / 2);
    }
}
