//! What the cameras of the photos see of points in the room.

use lo_geometry::{Camera, RigidTransform, Vec3};
use lo_imaging::{DepthMap, RadianceImage};

/// What all cameras see where.
pub(crate) struct Views(pub Vec<Visibility>);

impl Views {
    /// The light of the first photo that shows this point.
    pub fn seen(&self, point: Vec3) -> Option<[f32; 3]> {
        self.0.iter().find_map(|view| Some(view.radiance[view.seen_from_camera(point)?]))
    }

    /// What a closing surfel may do at a point by the word of all cameras: stand where none of them looks through or sees something close before.
    pub fn closing(&self, point: Vec3, margin: impl Fn(&Visibility) -> f32, leaf_m: f32) -> Closing {
        let mut found = Closing::Face;
        for view in &self.0 {
            match view.closing(point, margin(view), leaf_m) {
                Closing::Nothing => return Closing::Nothing,
                Closing::Photo(light) => found = Closing::Photo(light),
                Closing::Face => {}
            }
        }
        found
    }
}

/// What a camera sees where.
pub(crate) struct Visibility {
    pub camera: Camera,
    /// From the room's frame to the camera's axes.
    pub camera_from_world: RigidTransform,
    /// The photo at the depth map's resolution.
    pub radiance: RadianceImage,
    /// Complete: a depth for every pixel.
    pub depth_m: DepthMap,
    /// How far behind the seen depth a point may lie and be seen.
    pub tolerance_m: f32,
}

impl Visibility {
    /// Pixel and seen depth where a point falls into the image, with the point's own depth.
    fn project(&self, point: Vec3) -> Option<((usize, usize), f32, f32)> {
        let (u, v, depth_m) = self.camera.project(self.camera_from_world.point(point))?;
        let inside = u >= 0.0 && v >= 0.0 && u < f64::from(self.camera.width) && v < f64::from(self.camera.height);
        inside.then(|| {
            let pixel = (u as usize, v as usize);
            (pixel, self.depth_m[pixel], depth_m as f32)
        })
    }

    /// The pixel that shows this point, where the camera sees it: nothing stands in front of it.
    fn seen_from_camera(&self, point: Vec3) -> Option<(usize, usize)> {
        let (pixel, seen_m, own_m) = self.project(point)?;
        (own_m <= seen_m + self.tolerance_m + 0.03 * seen_m).then_some(pixel)
    }

    /// What a closing surfel may do at a point: be there, with the face's radiance or the photo's, or not be there.
    ///
    /// It must not stand in front of what the camera sees, nor less than `margin_m` behind it. Where the pixels are coarser than the
    /// leaves and see the face itself, they cannot fill its leaves: there it takes the pixel's radiance.
    fn closing(&self, point: Vec3, margin_m: f32, leaf_m: f32) -> Closing {
        match self.project(point) {
            Some((pixel, seen_m, own_m)) if own_m < seen_m + margin_m => {
                let coarse = own_m > 0.5 * leaf_m * self.camera.fx.min(self.camera.fy) as f32;
                let same = (own_m - seen_m).abs() < self.tolerance_m.max(0.1 * own_m);
                if coarse && same { Closing::Photo(self.radiance[pixel]) } else { Closing::Nothing }
            }
            _ => Closing::Face,
        }
    }
}

/// What closes a leaf of a face.
pub(crate) enum Closing {
    Face,
    Photo([f32; 3]),
    Nothing,
}
