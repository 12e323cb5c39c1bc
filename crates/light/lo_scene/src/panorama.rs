use half::f16;
use lo_geometry::{Quat, Vec3};
use lo_imaging::{RadianceImage, resize_equirectangular};
use serde::{Deserialize, Serialize};

/// What somebody's panorama of the room gave a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LaidPanorama {
    /// Which panorama, and how it was laid.
    pub source: PanoramaSource,
    /// `share[d][row]` of each row of [`LightOctree::rgba`](lo_octree::LightOctree::rgba): how much of its radiance the panorama gave, 0 for nothing and
    /// 255 for all; above the leaves the mean of a node's non-empty children. What the photo saw has 0.
    pub share: Vec<Vec<u8>>,
    /// The panorama itself; scene files of before had none.
    pub picture: Option<PanoramaPicture>,
}

/// A panorama as it lies in the room.
#[derive(Clone, Debug, PartialEq)]
pub struct PanoramaPicture {
    /// Linear RGB radiance in the photo's units, twice as wide as high, in our own orientation.
    pub radiance: RadianceImage,
    /// From its axes to the photo's, of unit length.
    pub world_from_panorama: Quat,
}

/// Most columns of a panorama that a scene keeps.
const MAX_WIDTH: usize = 2048;

/// Largest number that is kept as such in half precision; of brighter panoramas all are scaled.
const MAX_HALF: f32 = 60_000.0;

impl PanoramaPicture {
    /// Of linear radiance, at most 2048 columns and as exact as half precision is, so that the scene's file holds it as it is.
    pub fn new(radiance: &RadianceImage, world_from_panorama: Quat) -> Self {
        let smaller =
            (radiance.width() > MAX_WIDTH).then(|| resize_equirectangular(radiance, MAX_WIDTH, MAX_WIDTH / 2));
        let radiance = smaller.as_ref().unwrap_or(radiance);
        let scale = scale(radiance);
        let exact = |value: f32| f16::from_f32(value / scale).to_f32() * scale;
        Self { radiance: radiance.map(|pixel| pixel.map(exact)), world_from_panorama }
    }

    /// The power of two that radiance is divided by in the file.
    pub(crate) fn scale(&self) -> f32 {
        scale(&self.radiance)
    }
}

fn scale(radiance: &RadianceImage) -> f32 {
    let brightest = radiance.pixels().as_flattened().iter().copied().fold(0.0, f32::max);
    (brightest / MAX_HALF).max(1.0).log2().ceil().exp2()
}

/// Where a panorama comes from, and how it lies in the room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanoramaSource {
    /// Name of the file, without folders.
    pub file: String,
    /// Where it was taken, metres in the photo's frame.
    pub position_m: Vec3,
    /// Angle from the photo's heading to the panorama's centre, to the right, about the room's vertical; degrees.
    pub yaw_deg: f32,
    /// Upward tilt of the panorama's centre against the room's horizontal; degrees.
    pub pitch_deg: f32,
    /// Clockwise tilt of the panorama about its centre; degrees.
    pub roll_deg: f32,
    /// Stops from the panorama's values to the photo's: radiance = value · 2^exposure.
    pub exposure_ev: f32,
    /// How well the panorama shows what the photo shows, from 0 to 1.
    pub confidence: f32,
    /// Whether its bright parts are clipped: lower bounds, no measurements.
    pub clipped: bool,
}

impl PanoramaSource {
    /// Whether all numbers are finite and the confidence lies in [0, 1].
    pub(crate) fn is_valid(&self) -> bool {
        let numbers = [self.yaw_deg, self.pitch_deg, self.roll_deg, self.exposure_ev];
        self.position_m.is_finite()
            && numbers.iter().all(|number| number.is_finite())
            && (0.0..=1.0).contains(&self.confidence)
    }
}
