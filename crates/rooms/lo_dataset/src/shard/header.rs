//! JSON header of a record, which describes its arrays.

use lo_geometry::Camera;
use serde::{Deserialize, Serialize};

use crate::sample::Metadata;

/// Version of the shard format that is written and read.
pub const FORMAT_VERSION: u32 = 1;

/// Content of `KEY.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct RecordHeader {
    pub format_version: u32,
    pub generator: String,
    pub scene_id: String,
    /// Convention of the frame, for readers without the documentation.
    pub frame: String,
    pub units: String,
    pub up: Option<[f32; 3]>,
    pub points: Option<PointsHeader>,
    pub views: Vec<ViewHeader>,
    pub shots: Vec<ShotHeader>,
    pub metadata: Metadata,
}

pub(super) const FRAME: &str = "metres; right-handed; a camera looks along -Z, +Y is up in its picture, +X right; \
    direction in the record's frame = rotation_xyzw * direction in the camera's or panorama's; a panorama's centre is -Z, its first row +Y";
pub(super) const UNITS: &str = "linear Rec. 709; radiance = array * 2**exponent; of points and views times a shot's gains: units of that photo's \
    white, as is the shot's own radiance; depth in millimetres, 0 is no reading; albedo sRGB-coded; normals * 127";

/// Array of half floats, to be multiplied by 2^exponent.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct HalfFloats {
    pub file: String,
    pub exponent: i32,
}

/// Positions as u16 steps from an origin.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct PointsHeader {
    pub position: String,
    pub origin_m: [f32; 3],
    pub step_m: f32,
    pub radiance: HalfFloats,
    /// Surface area per point. Missing in archives from before November 2026.
    #[serde(default)]
    pub area_m2: Option<f32>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ViewHeader {
    pub position_m: [f32; 3],
    pub rotation_xyzw: [f32; 4],
    pub radiance: HalfFloats,
    pub depth: Option<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct ShotHeader {
    pub position_m: [f32; 3],
    pub rotation_xyzw: [f32; 4],
    pub gains: [f32; 3],
    pub camera: Camera,
    pub photo: String,
    pub radiance: Option<HalfFloats>,
    pub depth: Option<String>,
    pub sensor_depth: Option<String>,
    pub normal: Option<String>,
    pub albedo: Option<String>,
    pub views: Vec<usize>,
    pub metadata: Metadata,
}
