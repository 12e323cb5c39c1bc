//! Photos with black bars: the estimate sees the picture alone, and the scene keeps the whole photo.

use lo_events::{OnEvent, warn};
use lo_geometry::Camera;
use lo_imaging::{BlackBars, DepthMap, Photo};
use lo_scene::Frame;

use crate::{EstimateError, EstimateWarning, Input, PredictedDepth};

/// A photo with black bars, and its camera.
pub(crate) struct FramedPhoto {
    bars: BlackBars,
    photo: Photo,
    camera: Camera,
}

impl FramedPhoto {
    /// Crops a single photo with black bars to its picture, and reports them. Returns the input, and the whole photo if
    /// it has bars.
    pub fn unframe(input: Input, on_event: OnEvent<'_>) -> Result<(Input, Option<Self>), EstimateError> {
        let (photo, camera) = match &input {
            Input::Photo { photo, camera } => (photo, camera),
            Input::MeasuredDepth(frame) | Input::PredictedDepth(PredictedDepth { frame, .. }) => {
                (&frame.photo, &frame.camera)
            }
            Input::Photos { .. } => return Ok((input, None)),
        };
        let picture = BlackBars::of(photo).and_then(|bars| Some((bars, bars.camera_of_picture(camera)?)));
        let Some((bars, inner)) = picture else { return Ok((input, None)) };
        warn(on_event, EstimateWarning::BlackBars { bars })?;
        let framed = Self { bars, photo: photo.clone(), camera: *camera };
        let size = [photo.width(), photo.height()];
        let frame = |frame: Frame| Frame {
            camera: inner,
            photo: bars.cropped(&frame.photo),
            depth_m: bars.cropped_map(&frame.depth_m, size),
            exposure: frame.exposure,
        };
        let input = match input {
            Input::Photo { photo, .. } => Input::Photo { photo: bars.cropped(&photo), camera: inner },
            Input::MeasuredDepth(whole) => Input::MeasuredDepth(frame(whole)),
            Input::PredictedDepth(PredictedDepth { frame: whole, normals, model }) => {
                let normals = normals.map(|normals| bars.cropped_map(&normals, size));
                Input::PredictedDepth(PredictedDepth { frame: frame(whole), normals, model })
            }
            several => several,
        };
        Ok((input, Some(framed)))
    }

    /// Returns the frame of the whole photo, without depth in the bars.
    pub fn frame(self, picture: Frame) -> Frame {
        let Self { bars, photo, camera } = self;
        let (width, height) = (photo.width(), photo.height());
        let inner = &picture.depth_m;
        let [inner_width, inner_height] = [width - bars.left - bars.right, height - bars.top - bars.bottom];
        let side =
            |of: usize, inner: usize, depth: usize| ((of * depth) as f64 / inner as f64).round().max(1.0) as usize;
        let (columns, rows) = (side(width, inner_width, inner.width()), side(height, inner_height, inner.height()));
        // Index in the picture's map of a pixel's centre in the whole one's.
        let index = |at: usize, count: usize, size: usize, start: usize, inner_size: usize, inner_count: usize| {
            let place = (at as f64 + 0.5) * size as f64 / count as f64 - start as f64;
            let index = (place * inner_count as f64 / inner_size as f64).floor();
            (0.0..inner_count as f64).contains(&index).then_some(index as usize)
        };
        let depth_m = DepthMap::from_fn(columns, rows, |x, y| {
            let x = index(x, columns, width, bars.left, inner_width, inner.width());
            let y = index(y, rows, height, bars.top, inner_height, inner.height());
            x.zip(y).map_or(0.0, |at| inner[at])
        });
        Frame { camera, photo, depth_m, exposure: picture.exposure }
    }
}
