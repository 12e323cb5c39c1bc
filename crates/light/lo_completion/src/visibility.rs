//! CameraView of points of the room from the cameras of the photos.

use lo_geometry::{Camera, RigidTransform, Vec3};
use lo_imaging::{DepthMap, RadianceImage};

/// CameraView from all cameras.
pub(crate) struct CameraViews(pub Vec<CameraView>);

impl CameraViews {
    /// Returns the radiance in the first photo that shows this point.
    pub fn seen(&self, point: Vec3) -> Option<[f32; 3]> {
        self.0.iter().find_map(|view| Some(view.radiance[view.seen_from_camera(point)?]))
    }

    /// Returns how a face may be closed at a point. No camera may look through the point, or see a surface closely in
    /// front of it.
    pub fn closure(&self, point: Vec3, margin: impl Fn(&CameraView) -> f32, leaf_m: f32) -> FaceClosure {
        let mut found = FaceClosure::Face;
        for view in &self.0 {
            match view.closure(point, margin(view), leaf_m) {
                FaceClosure::None => return FaceClosure::None,
                FaceClosure::Photo(light) => found = FaceClosure::Photo(light),
                FaceClosure::Face => {}
            }
        }
        found
    }
}

/// CameraView from one camera.
pub(crate) struct CameraView {
    pub camera: Camera,
    /// Transform from the room's frame to the camera's axes.
    pub camera_from_world: RigidTransform,
    /// The photo at the depth map's resolution.
    pub radiance: RadianceImage,
    /// Depth of every pixel.
    pub depth_m: DepthMap,
    /// Greatest distance behind the depth map at which a point counts as visible.
    pub tolerance_m: f32,
}

impl CameraView {
    /// Returns pixel, depth map value and the point's own depth, if the point is in the image.
    fn project(&self, point: Vec3) -> Option<((usize, usize), f32, f32)> {
        let (u, v, depth_m) = self.camera.project(self.camera_from_world.point(point))?;
        let inside = u >= 0.0 && v >= 0.0 && u < f64::from(self.camera.width) && v < f64::from(self.camera.height);
        inside.then(|| {
            let pixel = (u as usize, v as usize);
            (pixel, self.depth_m[pixel], depth_m as f32)
        })
    }

    /// Returns the pixel that shows this point, if nothing occludes it.
    fn seen_from_camera(&self, point: Vec3) -> Option<(usize, usize)> {
        let (pixel, seen_m, own_m) = self.project(point)?;
        (own_m <= seen_m + self.tolerance_m + 0.03 * seen_m).then_some(pixel)
    }

    /// Returns how a face may be closed at a point: with the face's radiance, with the photo's, or not at all.
    ///
    /// A surfel must not be in front of the depth map, nor less than `margin_m` behind it. Where the pixels are coarser
    /// than the leaves and show the face itself, they cannot fill its leaves; there the surfel takes the pixel's
    /// radiance.
    fn closure(&self, point: Vec3, margin_m: f32, leaf_m: f32) -> FaceClosure {
        match self.project(point) {
            Some((pixel, seen_m, own_m)) if own_m < seen_m + margin_m => {
                let coarse = own_m > 0.5 * leaf_m * self.camera.fx.min(self.camera.fy) as f32;
                let same = (own_m - seen_m).abs() < self.tolerance_m.max(0.1 * own_m);
                if coarse && same { FaceClosure::Photo(self.radiance[pixel]) } else { FaceClosure::None }
            }
            _ => FaceClosure::Face,
        }
    }
}

/// How a leaf of a face is closed.
pub(crate) enum FaceClosure {
    Face,
    Photo([f32; 3]),
    None,
}
