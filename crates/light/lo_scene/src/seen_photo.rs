use lo_geometry::{RigidTransform, Vec3};
use lo_imaging::{Image, RadianceImage};

use crate::{Frame, Surfel};

/// A photo as completion looks at it: without flying pixels, with its surfaces' normals.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenPhoto {
    /// Without [flying pixels](Frame::without_flying_pixels).
    pub clean: Frame,
    /// Of each depth pixel, in the camera's axes; see [`Frame::normals`].
    pub normals: Image<Option<Vec3>>,
    /// Light of each photo pixel.
    pub radiance: RadianceImage,
    /// Where the camera stands in the axes of the first photo's camera.
    pub first_from_camera: RigidTransform,
}

impl SeenPhoto {
    /// Of a frame, best at the [working resolution](Frame::working).
    pub fn new(frame: &Frame, first_from_camera: RigidTransform) -> Self {
        let clean = frame.without_flying_pixels();
        let (normals, radiance) = (clean.normals(), clean.radiance());
        Self { clean, normals, radiance, first_from_camera }
    }

    /// Takes these normals for the surfaces', where there are any, in the camera's axes.
    ///
    /// # Panics
    /// Where they are not of the depth map's size.
    pub fn believe(&mut self, told: &Image<Option<Vec3>>) {
        let size = (self.normals.width(), self.normals.height());
        assert_eq!((told.width(), told.height()), size, "one normal for each depth pixel");
        self.normals.pixels_mut().iter_mut().zip(told.pixels()).for_each(|(fitted, told)| *fitted = told.or(*fitted));
    }

    /// One for each reading, in the axes of the first photo's camera.
    pub fn surfels(&self) -> Vec<Surfel> {
        let mut surfels = self.clean.surfels_with_normals(&self.normals, &self.radiance);
        // The first photo's stay as they are, to the bit.
        if self.first_from_camera != RigidTransform::IDENTITY {
            surfels.iter_mut().for_each(|surfel| *surfel = surfel.moved(&self.first_from_camera));
        }
        surfels
    }
}
