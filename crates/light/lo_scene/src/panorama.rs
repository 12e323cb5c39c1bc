use half::f16;
use lo_geometry::{Quat, Vec3, is_position};
use lo_imaging::{RadianceImage, resize_equirectangular};
use lo_octree::MAX_RADIANCE;
use serde::{Deserialize, Serialize};

/// A user's panorama of the room, and its contribution to a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct PanoramaContribution {
    /// Source of the panorama and its alignment.
    pub source: PanoramaSource,
    /// Share of the panorama in the radiance of each row: `share[d][row]` of
    /// [`LightOctree::rgba`](lo_octree::LightOctree::rgba), 0 for none and 255 for all.
    ///
    /// Above the leaves it is the mean over a node's non-empty children. Rows observed by the photo have 0.
    pub share: Vec<Vec<u8>>,
    /// The panorama itself; absent from older scene files.
    pub image: Option<PanoramaImage>,
}

/// A panorama with its orientation in the room.
#[derive(Clone, Debug, PartialEq)]
pub struct PanoramaImage {
    /// Linear RGB radiance in the photo's units, twice as wide as high, in this project's orientation.
    pub radiance: RadianceImage,
    /// Unit rotation from the panorama's axes to the photo's.
    pub world_from_panorama: Quat,
}

/// Largest angle of a panorama's alignment in either direction, degrees.
const MAX_ANGLE_DEG: f32 = 3600.0;

/// Largest exposure of a panorama in either direction, stops: between extremes of a photo's and a panorama's units.
const MAX_EXPOSURE_EV: f32 = 100.0;

/// Largest width that a scene stores, pixels.
const MAX_WIDTH: usize = 2048;

/// Largest value that is stored in half precision without scaling; brighter panoramas are scaled down as a whole.
const MAX_HALF: f32 = 60_000.0;

impl PanoramaImage {
    /// Stores linear radiance with at most 2048 columns, at most [`MAX_RADIANCE`], and rounded to half precision, so
    /// that the file holds exactly these values.
    pub fn new(radiance: &RadianceImage, world_from_panorama: Quat) -> Self {
        let smaller =
            (radiance.width() > MAX_WIDTH).then(|| resize_equirectangular(radiance, MAX_WIDTH, MAX_WIDTH / 2));
        let radiance = smaller.as_ref().unwrap_or(radiance);
        let scale = scale(radiance);
        let exact = |value: f32| f16::from_f32(value.min(MAX_RADIANCE) / scale).to_f32() * scale;
        Self { radiance: radiance.map(|pixel| pixel.map(exact)), world_from_panorama }
    }

    /// Returns the power of two by which the file divides radiance.
    pub(crate) fn scale(&self) -> f32 {
        scale(&self.radiance)
    }
}

fn scale(radiance: &RadianceImage) -> f32 {
    let brightest = radiance.pixels().as_flattened().iter().copied().fold(0.0, f32::max).min(MAX_RADIANCE);
    (brightest / MAX_HALF).max(1.0).log2().ceil().exp2()
}

/// Source of a panorama and its alignment in the room.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanoramaSource {
    /// File name without folders.
    pub file: String,
    /// Position of its camera, metres in the photo's frame.
    pub position_m: Vec3,
    /// Yaw from the photo's heading to the panorama's centre, to the right about the room's vertical, degrees.
    pub yaw_deg: f32,
    /// Upward tilt of the panorama's centre from the room's horizontal, degrees.
    pub pitch_deg: f32,
    /// Clockwise tilt of the panorama about its centre, degrees.
    pub roll_deg: f32,
    /// Stops from the panorama's values to the photo's: radiance = value · 2^exposure.
    pub exposure_ev: f32,
    /// Agreement of the panorama with the photo, from 0 to 1.
    pub confidence: f32,
    /// Whether its highlights are clipped, so that they are lower bounds.
    pub clipped: bool,
}

impl PanoramaSource {
    /// Returns whether the position is near the room, angles and exposure are in range, and the confidence in [0, 1].
    pub(crate) fn is_valid(&self) -> bool {
        let angles_deg = [self.yaw_deg, self.pitch_deg, self.roll_deg];
        is_position(self.position_m)
            && angles_deg.iter().all(|angle_deg| angle_deg.abs() <= MAX_ANGLE_DEG)
            && self.exposure_ev.abs() <= MAX_EXPOSURE_EV
            && (0.0..=1.0).contains(&self.confidence)
    }
}
