use std::sync::Arc;

use lo_geometry::Vec3;
use lo_imaging::{BlackBars, Image};
use lo_octree::LightOctree;

use crate::derived::Derived;
use crate::{CameraSource, Completion, DistortedPhoto, ExpectedLight, Frame, OtherPhoto, PanoramaContribution, Room};

/// The estimate of a room from photos: its radiance and the observed frame. Self-contained.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Radiance of the whole room, without the user's edits of the light.
    pub light: LightOctree,
    /// The photo with its depth and camera.
    pub frame: Frame,
    /// The photo as its lens took it, if the frame has its undistorted version. Composites are distorted back to it.
    pub distorted: Option<Arc<DistortedPhoto>>,
    /// Gravity and the closing planes, where they are known.
    pub room: Option<Room>,
    /// The light network's confidence: `confidence[d][row]` of each row of [`LightOctree::rgba`], 255 · e^−ε with the
    /// expected error ε of log(1 + radiance).
    pub confidence: Option<Vec<Vec<u8>>>,
    /// The expected energy of the light around the camera, where a network predicts it.
    pub expected: Option<ExpectedLight>,
    /// A panorama of the room, and what its light contributed.
    pub panorama: Option<PanoramaContribution>,
    /// Further photos that the light comes from.
    pub other_photos: Vec<OtherPhoto>,
    /// Inputs and methods of the estimate.
    pub origin: EstimateOrigin,
    /// Values computed once and kept.
    #[doc(hidden)]
    pub derived: Derived,
}

/// Inputs and methods of an estimate. The default is measured depth without completion or named sources.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EstimateOrigin {
    /// Completion of unobserved regions.
    pub completion: Completion,
    /// Source of the camera's intrinsics, if known.
    pub camera_source: Option<CameraSource>,
    /// Expected error of the room's up, degrees, where a network predicted it.
    pub up_deviation_deg: Option<f32>,
    /// Names of the input files, without folders.
    pub sources: Vec<String>,
    /// Whether the frame's depth was predicted from the photo instead of measured.
    pub predicted_depth: bool,
    /// Name of the third-party depth model that predicted it.
    pub depth_model: Option<String>,
}

impl Estimate {
    /// Creates an estimate with measured depth and no completion or sources; `light` holds observed radiance only.
    pub fn observed_only(light: LightOctree, frame: Frame) -> Self {
        Self {
            light,
            frame,
            distorted: None,
            room: None,
            confidence: None,
            expected: None,
            panorama: None,
            other_photos: Vec::new(),
            origin: EstimateOrigin::default(),
            derived: Derived::default(),
        }
    }

    /// Returns the unit vector against gravity, in the world frame; the camera's up if the room is unknown.
    pub fn up(&self) -> Vec3 {
        self.room.as_ref().map_or(Vec3::Y, |room| room.up)
    }

    /// Returns the black bars of the photo, if there are any. Computed once.
    pub fn black_bars(&self) -> Option<BlackBars> {
        *self.derived.black_bars.get_or_init(|| BlackBars::of(&self.frame.photo))
    }

    /// Returns the observed surface: the frame at working resolution without flying pixels. Computed once.
    pub fn surface(&self) -> &Frame {
        self.derived.surface.get_or_init(|| self.frame.working().without_flying_pixels())
    }

    /// Returns [`Frame::normals`] of the observed surface. Computed once.
    pub fn surface_normals(&self) -> &Image<Option<Vec3>> {
        self.derived.surface_normals.get_or_init(|| self.surface().normals())
    }
}
