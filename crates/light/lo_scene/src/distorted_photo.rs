use std::sync::Arc;

use lo_geometry::{Camera, Distortion};
use lo_imaging::{EncodedPhoto, Image, Photo};
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};

use crate::document_tensors::{Tensor, floats, layout, tensor};
use crate::{SceneError, Undistortion};

/// Name of the tensor.
const PHOTO: &str = "distorted_photo";

/// A photo as its lens took it, if the estimate has its undistorted version.
#[derive(Clone, Debug, PartialEq)]
pub struct DistortedPhoto {
    /// The photo, of the undistorted one's size.
    pub photo: Photo,
    /// How it was undistorted.
    pub undistortion: Undistortion,
}

/// States lens and tensor in a scene file.
#[derive(Clone, Copy, Serialize, Deserialize)]
pub(crate) struct DistortedHeader {
    camera: Camera,
    distortion: Distortion,
}

/// Returns the header and the tensor of a distorted photo. Its encoding is that of the undistorted one.
pub(crate) fn write(distorted: &DistortedPhoto) -> (DistortedHeader, (String, Tensor<'_>)) {
    let undistortion = &distorted.undistortion;
    let header = DistortedHeader { camera: undistortion.distorted_camera(), distortion: undistortion.distortion() };
    let photo = &distorted.photo;
    let tensor = match photo {
        Photo::Srgb8(image) | Photo::Encoded8(EncodedPhoto { image, .. }) => Tensor::srgb8(image),
        Photo::Linear(image) => Tensor::floats(vec![photo.height(), photo.width(), 3], image.pixels().as_flattened()),
    };
    (header, (PHOTO.to_owned(), tensor))
}

/// Reads a distorted photo, given the undistorted one and its camera.
pub(crate) fn read(
    tensors: &SafeTensors<'_>,
    header: DistortedHeader,
    undistorted: &Photo,
    camera: &Camera,
) -> Result<Arc<DistortedPhoto>, SceneError> {
    let wrong = |what: String| SceneError::Metadata(format!("its lens distortion: {what}"));
    let Camera { fx, fy, cx, cy, width, height } = header.camera;
    Camera::new(fx, fy, cx, cy, width, height).map_err(|error| wrong(error.to_string()))?;
    let undistortion = Undistortion::new(header.camera, header.distortion).map_err(|error| wrong(error.to_string()))?;
    if undistortion.camera != *camera {
        return Err(wrong("it does not belong to the camera".to_owned()));
    }
    let (dtype, shape, bytes) = tensor(tensors, PHOTO)?;
    let size = [undistorted.height(), undistorted.width(), 3];
    let (height, width) = (size[0], size[1]);
    let photo = match (undistorted, dtype) {
        (Photo::Linear(_), Dtype::F32) if shape == size => {
            let values = floats(bytes);
            if !values.iter().all(|v| v.is_finite()) {
                return Err(wrong("its photo has values that are not finite".to_owned()));
            }
            Photo::Linear(Image::new(width, height, values.as_chunks().0.to_vec()))
        }
        (Photo::Srgb8(_) | Photo::Encoded8(_), Dtype::U8) if shape == size => {
            let image = Image::new(width, height, bytes.as_chunks().0.to_vec());
            match undistorted {
                Photo::Encoded8(EncodedPhoto { encoding, .. }) => Photo::encoded8(image, encoding.with_gain_map(None)),
                _ => Photo::Srgb8(image),
            }
        }
        _ => return Err(layout(PHOTO, "the photo's type and shape", dtype, &shape)),
    };
    Ok(Arc::new(DistortedPhoto { photo, undistortion }))
}

impl DistortedPhoto {
    /// Combines a photo with its undistortion. Its gain map is left to the undistorted photo.
    pub fn new(photo: Photo, undistortion: Undistortion) -> Self {
        let photo = match photo {
            Photo::Encoded8(EncodedPhoto { image, encoding }) => Photo::encoded8(image, encoding.with_gain_map(None)),
            photo => photo,
        };
        Self { photo, undistortion }
    }
}
