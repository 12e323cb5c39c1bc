use lo_geometry::{RigidTransform, Vec3};
use lo_imaging::{Image, RadianceImage};

use crate::{Frame, Surfel};

/// A photo prepared for completion: without flying pixels, and with surface normals.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservedPhoto {
    /// The frame without [flying pixels](Frame::without_flying_pixels).
    pub clean: Frame,
    /// Normal at each depth pixel, in the camera's axes; see [`Frame::normals`].
    pub normals: Image<Option<Vec3>>,
    /// Linear radiance of each photo pixel.
    pub radiance: RadianceImage,
    /// Transform from this camera's axes to those of the first photo's camera.
    pub first_from_camera: RigidTransform,
}

impl ObservedPhoto {
    /// Prepares a frame, preferably at the [working resolution](Frame::working).
    pub fn new(frame: &Frame, first_from_camera: RigidTransform) -> Self {
        let clean = frame.without_flying_pixels();
        let (normals, radiance) = (clean.normals(), clean.radiance());
        Self { clean, normals, radiance, first_from_camera }
    }

    /// Prepares the first photo's frame. `normals`, in the camera's axes, replace the fitted ones where they are
    /// `Some`.
    ///
    /// # Panics
    /// If `normals` do not have the depth map's size.
    pub fn first(frame: &Frame, normals: Option<&Image<Option<Vec3>>>) -> Self {
        let mut photo = Self::new(frame, RigidTransform::IDENTITY);
        if let Some(normals) = normals {
            photo.override_normals(normals);
        }
        photo
    }

    fn override_normals(&mut self, measured: &Image<Option<Vec3>>) {
        let size = (self.normals.width(), self.normals.height());
        assert_eq!((measured.width(), measured.height()), size, "one normal per depth pixel");
        self.normals
            .pixels_mut()
            .iter_mut()
            .zip(measured.pixels())
            .for_each(|(fitted, measured)| *fitted = measured.or(*fitted));
    }

    /// Returns one surfel per reading, in the axes of the first photo's camera.
    pub fn surfels(&self) -> Vec<Surfel> {
        let mut surfels = self.clean.surfels_with_normals(&self.normals, &self.radiance);
        // Keep the first photo's surfels bit-identical.
        if self.first_from_camera != RigidTransform::IDENTITY {
            surfels.iter_mut().for_each(|surfel| *surfel = surfel.moved(&self.first_from_camera));
        }
        surfels
    }
}
