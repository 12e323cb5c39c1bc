//! Where the page's light probes are.

use lo_geometry::Vec3;
use lo_octree::LightOctree;
use lo_scene::{LitScene, Room};

use crate::{Content, ExportError, photo_mesh};

/// Largest number of probes: a page of 5 MB.
const MAX_PROBES: usize = 96;

/// Share of the photo's surfaces beyond each face of the grid, where light is extrapolated.
const BEYOND: f32 = 0.02;

/// Smallest distance of two probes in metres.
const MIN_SPACING_M: f32 = 0.15;

/// A regular grid of light probes about the surfaces that the photo shows, in the camera's frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WebGrid {
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
        let mesh = photo_mesh::from_frame(&scene.frame, scene.room.as_ref().and_then(Room::floor));
        if mesh.positions_m.is_empty() {
            return Err(ExportError::Nothing(Content::PhotoPoints));
        }
        let bounds: [[f32; 2]; 3] = std::array::from_fn(|axis| {
            let mut values: Vec<f32> = mesh.positions_m.iter().map(|point| point[axis]).collect();
            values.sort_by(f32::total_cmp);
            let at = |share: f32| values[(share * (values.len() - 1) as f32) as usize];
            [at(BEYOND), at(1.0 - BEYOND)]
        });
        Ok(Self::between(Vec3::from_array(bounds.map(|b| b[0])), Vec3::from_array(bounds.map(|b| b[1]))))
    }

    /// Fills a box with at most [`MAX_PROBES`] probes, in cells that are nearly cubes.
    fn between(low: Vec3, high: Vec3) -> Self {
        let size = high - low;
        let counts = |spacing: f32| size.to_array().map(|edge| (edge / spacing).ceil() as usize + 1);
        let mut spacing = MIN_SPACING_M;
        while counts(spacing).iter().product::<usize>() > MAX_PROBES {
            spacing *= 1.02;
        }
        let counts = counts(spacing);
        let spacing_m = Vec3::from_array(std::array::from_fn(|axis| size[axis] / (counts[axis] - 1).max(1) as f32));
        // An edge of no length has one probe, and no division by zero.
        Self { origin_m: low, spacing_m: spacing_m.max(Vec3::splat(f32::MIN_POSITIVE)), counts }
    }

    /// Returns the positions of the probes in metres; x varies fastest, then y.
    pub fn points(&self) -> Vec<Vec3> {
        let [nx, ny, nz] = self.counts;
        let mut points = Vec::with_capacity(nx * ny * nz);
        for (z, y) in (0..nz).flat_map(|z| (0..ny).map(move |y| (z, y))) {
            points.extend((0..nx).map(|x| self.origin_m + Vec3::new(x as f32, y as f32, z as f32) * self.spacing_m));
        }
        points
    }
}

/// Returns whether a point is inside the cube and not inside of a surface.
pub fn is_free(light: &LightOctree, point: Vec3) -> bool {
    light
        .locate(point, light.octree.depth())
        .is_some_and(|(depth, node)| light.octree.levels()[depth as usize].rows[node] < 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_nearly_cubes_and_their_number_is_bounded() {
        for (low, high) in [
            (Vec3::new(-2.0, -1.4, -6.0), Vec3::new(3.0, 1.1, -0.5)),
            (Vec3::splat(-0.01), Vec3::splat(0.01)),
            (Vec3::ZERO, Vec3::new(40.0, 0.1, 0.0)),
        ] {
            let grid = WebGrid::between(low, high);
            let points = grid.points();
            assert!(points.len() <= MAX_PROBES && points.len() == grid.counts.iter().product::<usize>());
            assert!((points[0] - low).length() < 1e-6);
            assert!((points[points.len() - 1] - high).length() < 1e-4, "{grid:?}");
        }
        let grid = WebGrid::between(Vec3::new(-2.0, -1.4, -6.0), Vec3::new(3.0, 1.1, -0.5));
        assert!(grid.spacing_m.max_element() / grid.spacing_m.min_element() < 1.7, "{grid:?}");
        assert!(grid.points().len() > MAX_PROBES / 2);
    }
}
