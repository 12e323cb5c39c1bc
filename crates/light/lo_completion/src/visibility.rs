//! What the camera of the frame sees of points in the room.

use lo_geometry::{Camera, Vec3};
use lo_imaging::DepthMap;

/// What the camera sees where.
pub(crate) struct Visibility {
    pub camera: Camera,
    /// Complete: a depth for every pixel.
    pub depth_m: DepthMap,
    /// How far behind the seen depth a point may lie and be seen.
    pub tolerance_m: f32,
}

impl Visibility {
    /// Pixel and seen depth where a point falls into the image, with the point's own depth.
    fn project(&self, point: Vec3) -> Option<((usize, usize), f32, f32)> {
        let (u, v, depth_m) = self.camera.project(point)?;
        let inside = u >= 0.0 && v >= 0.0 && u < f64::from(self.camera.width) && v < f64::from(self.camera.height);
        inside.then(|| {
            let pixel = (u as usize, v as usize);
            (pixel, self.depth_m[pixel], depth_m as f32)
        })
    }

    /// The pixel that shows this point, where the camera sees it: nothing stands in front of it.
    pub fn seen_from_camera(&self, point: Vec3) -> Option<(usize, usize)> {
        let (pixel, seen_m, own_m) = self.project(point)?;
        (own_m <= seen_m + self.tolerance_m + 0.03 * seen_m).then_some(pixel)
    }

    /// What a closing surfel may do at a point: be there, with the face's radiance or the photo's, or not be there.
    ///
    /// It must not stand in front of what the camera sees, nor less than `margin_m` behind it. Where the pixels are coarser than the
    /// leaves and see the face itself, they cannot fill its leaves: there it takes the pixel's radiance.
    pub fn closing(&self, point: Vec3, margin_m: f32, leaf_m: f32) -> Closing {
        match self.project(point) {
            Some((pixel, seen_m, own_m)) if own_m < seen_m + margin_m => {
                let coarse = own_m > 0.5 * leaf_m * self.camera.fx.min(self.camera.fy) as f32;
                let same = (own_m - seen_m).abs() < self.tolerance_m.max(0.1 * own_m);
                if coarse && same { Closing::Photo(pixel) } else { Closing::Nothing }
            }
            _ => Closing::Face,
        }
    }
}

/// What closes a leaf of a face.
pub(crate) enum Closing {
    Face,
    Photo((usize, usize)),
    Nothing,
}
