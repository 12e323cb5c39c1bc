//! Points with radiance, the common input of all formats.

use lo_geometry::Vec3;
use lo_octree::Provenance;
use lo_scene::Frame;

use crate::free_space::Leaf;

/// A small piece of surface that emits or reflects light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Point {
    /// Centre in metres.
    pub position_m: Vec3,
    /// Unit normal, towards free space.
    pub normal: Vec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
    /// Opacity of one crossing, in [0, 1].
    pub opacity: f32,
    /// Edge of the leaf, or of the pixel's footprint, in metres.
    pub edge_m: f32,
    /// Share that the photo observed, in [0, 1].
    pub seen: f32,
    /// Share of its radiance that comes from a panorama, in [0, 1].
    pub panorama: f32,
}

impl Point {
    /// Returns the name of the first value that is not finite.
    pub fn non_finite(&self) -> Option<&'static str> {
        let values = [
            ("position", self.position_m.is_finite()),
            ("normal", self.normal.is_finite()),
            ("radiance", self.radiance.iter().all(|c| c.is_finite())),
            ("opacity", self.opacity.is_finite()),
            ("edge", self.edge_m.is_finite()),
        ];
        values.into_iter().find_map(|(name, finite)| (!finite).then_some(name))
    }
}

/// Returns one point per leaf that faces free space or that the photo observed.
///
/// The others were added by completion behind its walls to make them opaque: two thirds of the leaves, all invisible.
pub(crate) fn from_leaves(leaves: &[Leaf]) -> Vec<Point> {
    leaves
        .iter()
        .filter(|leaf| leaf.exposed != 0 || leaf.seen > 0.0)
        .map(|leaf| Point {
            position_m: leaf.centre_m,
            // A leaf without a preferred side faces the camera, from which it was observed, if at all.
            normal: leaf.vector_area_m2().try_normalize().unwrap_or((-leaf.centre_m).normalize_or(Vec3::Z)),
            radiance: leaf.radiance(),
            opacity: leaf.rgba[3],
            edge_m: leaf.edge_m,
            seen: leaf.seen,
            panorama: leaf.panorama,
        })
        .collect()
}

/// Returns one point per reading of the depth map that is not a flying pixel, row by row, with the photo's radiance.
pub(crate) fn from_photo(frame: &Frame) -> Vec<Point> {
    let camera = frame.depth_camera();
    let pixel_pitch = (1.0 / camera.fx.min(camera.fy)) as f32;
    frame
        .surfels(&frame.radiance())
        .into_iter()
        .map(|surfel| Point {
            position_m: surfel.position_m,
            normal: surfel.normal,
            radiance: surfel.radiance,
            opacity: 1.0,
            edge_m: -surfel.position_m.z * pixel_pitch,
            seen: f32::from(u8::from(surfel.provenance == Provenance::Observed)),
            panorama: 0.0,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::free_space;
    use crate::test_scene::box_room;

    #[test]
    fn what_lies_behind_the_walls_is_left_out() {
        let mut light = box_room().light;
        assert_eq!(from_leaves(&free_space::leaves(&light, None)).len(), 296);
        // Nothing observed: the edges and corners of the shell touch no free space.
        light.seen[3].fill(0);
        assert_eq!(from_leaves(&free_space::leaves(&light, None)).len(), 6 * 36);
    }

    #[test]
    fn photo_points_lie_where_the_photo_sees_them() {
        let frame = box_room().frame.clone();
        let points = from_photo(&frame);
        assert_eq!(points.len(), 47);
        // Row by row, without the hole at (0, 0).
        for (point, pixel) in points.iter().zip(1..48) {
            let (u, v) = (f64::from(pixel % 8) + 0.5, f64::from(pixel / 8) + 0.5);
            let (x, y, z) = frame.camera.project(point.position_m).expect("in front of the camera");
            assert!((x - u).abs() < 1e-5 && (y - v).abs() < 1e-5 && (z - 1.5).abs() < 1e-6);
            // At 1.5 m with f = 5 pixels, a pixel is 0.3 m wide.
            assert!((point.edge_m - 0.3).abs() < 1e-6);
            assert!(point.normal.dot(point.position_m) < 0.0, "{point:?} looks at the camera");
            assert_eq!((point.opacity, point.seen), (1.0, 1.0));
        }
        // Pixel (7, 5) is sRGB (210, 200, 128).
        let expected = [210.0, 200.0, 128.0f32].map(|c| ((c / 255.0 + 0.055) / 1.055).powf(2.4));
        assert!(points[46].radiance.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6));
    }
}
