//! Photos with black bars: networks and the estimate see the picture alone, and the scene keeps the whole photo.

use lo_events::{OnEvent, warn};
use lo_geometry::Camera;
use lo_imaging::{BlackBars, Image, Photo};
use lo_scene::{Frame, PosedFrame};

use crate::{EstimateError, EstimateWarning, Input, PredictedDepth};

/// A photo with black bars.
pub(crate) struct FramedPhoto {
    bars: BlackBars,
    photo: Photo,
}

impl FramedPhoto {
    /// Returns a photo with black bars; `None` without bars, or if the camera's principal point is in one.
    pub fn of(photo: &Photo, camera: Option<&Camera>) -> Option<Self> {
        let bars = BlackBars::of(photo)?;
        let has_picture = camera.is_none_or(|camera| bars.camera_of_picture(camera).is_some());
        has_picture.then(|| Self { bars, photo: photo.clone() })
    }

    /// Crops photos with black bars to their pictures, and reports them. Returns the input, and the first photo as a
    /// whole if it has bars.
    pub fn unframe(input: Input, on_event: OnEvent<'_>) -> Result<(Input, Option<Self>), EstimateError> {
        Ok(match input {
            Input::Photo { photo, camera } => match Self::reported(&photo, &camera, None, on_event)? {
                None => (Input::Photo { photo, camera }, None),
                Some(framed) => {
                    let (photo, camera) = (framed.picture(), framed.camera_of_picture(&camera));
                    (Input::Photo { photo, camera }, Some(framed))
                }
            },
            Input::MeasuredDepth(frame) => {
                let (frame, framed) = Self::unframed(frame, None, on_event)?;
                (Input::MeasuredDepth(frame), framed)
            }
            Input::PredictedDepth(PredictedDepth { frame, normals, model }) => {
                let (frame, framed) = Self::unframed(frame, None, on_event)?;
                let cropped = |normals| match &framed {
                    Some(framed) => framed.cropped(&normals),
                    None => normals,
                };
                let normals = normals.map(cropped);
                (Input::PredictedDepth(PredictedDepth { frame, normals, model }), framed)
            }
            Input::Photos { photos, exposures } => {
                let (mut pictures, mut first) = (Vec::with_capacity(photos.len()), None);
                for (index, PosedFrame { frame, first_from_camera }) in photos.into_iter().enumerate() {
                    let (frame, framed) = Self::unframed(frame, Some(index), on_event)?;
                    pictures.push(PosedFrame { frame, first_from_camera });
                    first = first.or(framed.filter(|_| index == 0));
                }
                (Input::Photos { photos: pictures, exposures }, first)
            }
        })
    }

    /// Returns a photo with black bars, and reports them. `index` is the photo's, if there are several.
    fn reported(
        photo: &Photo,
        camera: &Camera,
        index: Option<usize>,
        on_event: OnEvent<'_>,
    ) -> Result<Option<Self>, EstimateError> {
        let framed = Self::of(photo, Some(camera));
        if let Some(Self { bars, .. }) = framed {
            warn(on_event, EstimateWarning::BlackBars { bars, photo: index })?;
        }
        Ok(framed)
    }

    /// Crops a frame with black bars to its picture, as [`FramedPhoto::unframe`] does.
    fn unframed(
        frame: Frame,
        index: Option<usize>,
        on_event: OnEvent<'_>,
    ) -> Result<(Frame, Option<Self>), EstimateError> {
        let framed = Self::reported(&frame.photo, &frame.camera, index, on_event)?;
        let picture = framed.as_ref().map(|framed| framed.picture_of(&frame));
        Ok((picture.unwrap_or(frame), framed))
    }

    /// Returns the photo without the bars.
    pub fn picture(&self) -> Photo {
        self.bars.cropped(&self.photo)
    }

    /// Returns the camera of [`FramedPhoto::of`] in pixels of the picture.
    pub fn camera_of_picture(&self, whole: &Camera) -> Camera {
        self.bars.camera_of_picture(whole).expect("the principal point is in the picture")
    }

    /// Crops a map with the photo's view to the picture.
    pub fn cropped<T: Copy>(&self, map: &Image<T>) -> Image<T> {
        self.bars.cropped_map(map, self.size())
    }

    fn size(&self) -> [usize; 2] {
        [self.photo.width(), self.photo.height()]
    }

    /// Crops a frame of the photo to the picture.
    fn picture_of(&self, whole: &Frame) -> Frame {
        let (camera, photo) = (self.camera_of_picture(&whole.camera), self.picture());
        Frame { camera, photo, depth_m: self.cropped(&whole.depth_m), exposure: whole.exposure }
    }

    /// Returns the frame of the whole photo, without depth in the bars.
    pub fn frame(self, picture: Frame) -> Frame {
        let depth_m = self.bars.framed_map(&picture.depth_m, self.size(), 0.0);
        let camera = self.bars.camera_of_photo(&picture.camera);
        Frame { camera, photo: self.photo, depth_m, exposure: picture.exposure }
    }

    /// Returns depth predicted from the picture as depth of the whole photo, without depth and normals in the bars.
    #[cfg(feature = "depth-models")]
    pub fn predicted_depth(self, picture: PredictedDepth) -> PredictedDepth {
        let PredictedDepth { frame, normals, model } = picture;
        let none = lo_geometry::Vec3::ZERO;
        let normals = normals.map(|normals| self.bars.framed_map(&normals, self.size(), none));
        PredictedDepth { frame: self.frame(frame), normals, model }
    }
}
