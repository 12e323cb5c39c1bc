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
        let (photo, camera) = match input {
            Input::Photos { mut photos, exposures } => {
                let mut first = None;
                for (index, PosedFrame { frame, .. }) in photos.iter_mut().enumerate() {
                    let Some(framed) = Self::of(&frame.photo, Some(&frame.camera)) else { continue };
                    warn(on_event, EstimateWarning::BlackBars { bars: framed.bars, photo: Some(index) })?;
                    *frame = framed.picture_of(frame);
                    first = first.or((index == 0).then_some(framed));
                }
                return Ok((Input::Photos { photos, exposures }, first));
            }
            Input::Photo { ref photo, ref camera } => (photo, camera),
            Input::MeasuredDepth(ref frame) | Input::PredictedDepth(PredictedDepth { ref frame, .. }) => {
                (&frame.photo, &frame.camera)
            }
        };
        let Some(framed) = Self::of(photo, Some(camera)) else { return Ok((input, None)) };
        warn(on_event, EstimateWarning::BlackBars { bars: framed.bars, photo: None })?;
        let input = match input {
            Input::Photo { camera, .. } => {
                Input::Photo { photo: framed.picture(), camera: framed.camera_of_picture(&camera) }
            }
            Input::MeasuredDepth(whole) => Input::MeasuredDepth(framed.picture_of(&whole)),
            Input::PredictedDepth(PredictedDepth { frame: whole, normals, model }) => {
                let normals = normals.map(|normals| framed.cropped(&normals));
                Input::PredictedDepth(PredictedDepth { frame: framed.picture_of(&whole), normals, model })
            }
            several @ Input::Photos { .. } => several,
        };
        Ok((input, Some(framed)))
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
