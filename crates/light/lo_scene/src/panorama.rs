use lo_geometry::Vec3;
use serde::{Deserialize, Serialize};

/// What somebody's panorama of the room gave a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct LaidPanorama {
    /// Which panorama, and how it was laid.
    pub source: PanoramaSource,
    /// `share[d][row]` of each row of [`LightOctree::rgba`](lo_octree::LightOctree::rgba): how much of its radiance the panorama gave, 0 for nothing and
    /// 255 for all; above the leaves the mean of a node's non-empty children. What the photo saw has 0.
    pub share: Vec<Vec<u8>>,
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
