use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::{Provenance, RadiancePoint};

use crate::sample::Metadata;
use crate::{NovelView, Sample};

/// One room: its photos and the data they share. Shards store records, and the generator makes them.
///
/// Positions are in the record's own frame (metres, +Y need not be up), radiance in its own units. Every [`Shot`]
/// contains the transform to its photo's frame and units.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Identifier, unique in its dataset. Letters, digits, `-` and `_`.
    pub key: String,
    /// Room; see [`Sample::scene_id`].
    pub scene_id: String,
    /// Unit up direction of the room.
    pub up: Option<Vec3>,
    /// Radiance leaving all surfaces.
    pub points: Vec<RadiancePoint>,
    /// See [`Sample::point_area_m2`].
    pub point_area_m2: Option<f32>,
    /// Panoramas.
    pub views: Vec<NovelView>,
    /// Photos, at least one.
    pub shots: Vec<Shot>,
    /// Additional data of the room.
    pub metadata: Metadata,
}

/// One photo of a room.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Camera position, in metres.
    pub position_m: Vec3,
    /// Record-frame direction = rotation · camera direction.
    pub rotation: Quat,
    /// Per-channel factors from the record's radiance to units of the photo's white.
    pub gains: [f32; 3],
    /// Camera intrinsics.
    pub camera: Camera,
    /// sRGB photo.
    pub photo: Image<[u8; 3]>,
    /// File that the camera wrote, if any. It decodes to the photo.
    pub jpeg: Option<Vec<u8>>,
    /// HDR radiance of the photo's pixels, in units of its white.
    pub radiance: Option<RadianceImage>,
    /// See [`Sample::depth_m`].
    pub depth_m: Option<DepthMap>,
    /// See [`Sample::sensor_depth_m`].
    pub sensor_depth_m: Option<DepthMap>,
    /// See [`Sample::normal`].
    pub normal: Option<Image<[f32; 3]>>,
    /// See [`Sample::albedo`].
    pub albedo: Option<Image<[f32; 3]>>,
    /// Indices of the record's panoramas that belong to this photo, its own first. Each at most once.
    pub views: Vec<usize>,
    /// Additional data of the photo.
    pub metadata: Metadata,
}

/// A point counts as observed if the photo's depth differs by at most this, in metres. Points stand for the surface
/// within a leaf.
const OBSERVED_WITHIN_M: f32 = 0.1;

impl Record {
    /// Returns the sample of photo `shot`; see [`into_sample`](Self::into_sample).
    ///
    /// # Panics
    /// If there is no such photo, or it names a view that the record does not have.
    pub fn sample(&self, shot: usize) -> Sample {
        let chosen = &self.shots[shot];
        let alone = Self {
            key: if self.shots.len() == 1 { self.key.clone() } else { format!("{}-{shot}", self.key) },
            scene_id: self.scene_id.clone(),
            up: self.up,
            points: self.points.clone(),
            point_area_m2: self.point_area_m2,
            views: chosen.views.iter().map(|&view| self.views[view].clone()).collect(),
            shots: vec![Shot { views: (0..chosen.views.len()).collect(), ..chosen.clone() }],
            metadata: self.metadata.clone(),
        };
        alone.into_sample()
    }

    /// Converts a record with one photo into that photo's sample, without copying images. Points, views and directions
    /// are transformed to the photo's frame and units.
    ///
    /// Points that the photo's depth map shows become [`Provenance::Observed`]. Without a depth map they are unchanged.
    ///
    /// # Panics
    /// If the record does not have exactly one photo, or the photo names a view twice or one that the record does not
    /// have.
    pub fn into_sample(mut self) -> Sample {
        assert_eq!(self.shots.len(), 1, "a record with one photo makes a sample");
        let shot = self.shots.remove(0);
        let camera_from_record = shot.rotation.inverse();
        let into = |point: Vec3| camera_from_record * (point - shot.position_m);
        let scaled = |[r, g, b]: [f32; 3]| [r * shot.gains[0], g * shot.gains[1], b * shot.gains[2]];
        for point in &mut self.points {
            point.position_m = into(point.position_m);
            point.radiance = scaled(point.radiance);
            point.provenance = shot.provenance(point.position_m).unwrap_or(point.provenance);
        }
        let mut stored: Vec<Option<NovelView>> = self.views.into_iter().map(Some).collect();
        let own_view = |&index: &usize| {
            let mut view = stored[index].take().expect("a photo names a view once");
            view.position_m = into(view.position_m);
            view.rotation = camera_from_record * view.rotation;
            view.radiance.pixels_mut().iter_mut().for_each(|rgb| *rgb = scaled(*rgb));
            view
        };
        let views = shot.views.iter().map(own_view).collect();
        self.metadata.extend(shot.metadata);
        Sample {
            id: self.key,
            scene_id: self.scene_id,
            photo: shot.photo,
            camera: shot.camera,
            up: self.up.map(|up| camera_from_record * up),
            radiance: shot.radiance,
            depth_m: shot.depth_m,
            sensor_depth_m: shot.sensor_depth_m,
            normal: shot.normal,
            albedo: shot.albedo,
            points: self.points,
            point_area_m2: self.point_area_m2,
            views,
            metadata: self.metadata,
        }
    }
}

impl From<Sample> for Record {
    /// Makes a record with one photo, whose frame and units are the record's. Characters of the id that a key cannot
    /// contain become `_`.
    fn from(sample: Sample) -> Self {
        let allowed = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '_' { c } else { '_' };
        let shot = Shot {
            position_m: Vec3::ZERO,
            rotation: Quat::IDENTITY,
            gains: [1.0; 3],
            camera: sample.camera,
            photo: sample.photo,
            jpeg: None,
            radiance: sample.radiance,
            depth_m: sample.depth_m,
            sensor_depth_m: sample.sensor_depth_m,
            normal: sample.normal,
            albedo: sample.albedo,
            views: (0..sample.views.len()).collect(),
            metadata: sample.metadata,
        };
        Self {
            key: sample.id.chars().map(allowed).collect(),
            scene_id: sample.scene_id,
            up: sample.up,
            points: sample.points,
            point_area_m2: sample.point_area_m2,
            views: sample.views,
            shots: vec![shot],
            metadata: Metadata::new(),
        }
    }
}

impl Shot {
    /// Returns whether the photo observes a point of its frame. `None` without a depth map.
    fn provenance(&self, position_m: Vec3) -> Option<Provenance> {
        let depth = self.depth_m.as_ref()?;
        let seen = self.camera.project(position_m).is_some_and(|(u, v, z)| {
            let (u, v) = (u.floor(), v.floor());
            u >= 0.0
                && v >= 0.0
                && u < depth.width() as f64
                && v < depth.height() as f64
                && (f64::from(depth[(u as usize, v as usize)]) - z).abs() < f64::from(OBSERVED_WITHIN_M)
        });
        Some(if seen { Provenance::Observed } else { Provenance::Inferred })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::fixture::record;

    #[test]
    fn samples_are_in_the_photos_frame_and_units() {
        let mut record = record("a");
        // A point 2 m in front of the camera of photo 1, by the pose's matrix.
        let pose = glam_pose(&record.shots[1]);
        record.points[0].position_m = pose.transform_point3(Vec3::new(0.1, 0.2, -2.0));
        let sample = record.sample(1);
        assert!((sample.points[0].position_m - Vec3::new(0.1, 0.2, -2.0)).length() < 1e-5);
        assert_eq!(sample.points[3].radiance, [1.5, 0.125, 1.4e5]);
        assert_eq!(sample.views.len(), 1);
        let direction = Vec3::new(0.6, 0.0, -0.8);
        let expected = pose.inverse().transform_vector3(record.views[1].rotation * direction);
        assert!((sample.views[0].rotation * direction - expected).length() < 1e-5);
        assert_eq!(sample.views[0].radiance[(4, 1)], [0.6, 2.025, 6e5]);
        assert_eq!(sample.up, Some(Vec3::Y), "turned about the vertical alone");
        assert_eq!((sample.id.as_str(), sample.scene_id.as_str()), ("a-1", "room of a"));
        assert_eq!((sample.metadata["lights"].as_i64(), sample.metadata["iso"].as_i64()), (Some(3), Some(101)));
    }

    fn glam_pose(shot: &Shot) -> lo_geometry::Mat4 {
        lo_geometry::Mat4::from_rotation_translation(shot.rotation, shot.position_m)
    }

    #[test]
    fn points_that_the_photo_shows_are_seen() {
        let mut record = record("a");
        let pose = glam_pose(&record.shots[0]);
        let camera = record.shots[0].camera;
        let depth = record.shots[0].depth_m.clone().unwrap();
        let at = |z: f32| pose.transform_point3(camera.unproject(6.5, 4.5, f64::from(z)));
        let shown = depth[(6, 4)];
        record.points.truncate(4);
        for (point, z) in record.points.iter_mut().zip([shown, shown + 0.05, shown + 0.3, -shown]) {
            point.position_m = at(z);
        }
        let provenance: Vec<Provenance> = record.sample(0).points.iter().map(|p| p.provenance).collect();
        assert_eq!(
            provenance,
            [Provenance::Observed, Provenance::Observed, Provenance::Inferred, Provenance::Inferred]
        );
    }

    #[test]
    fn a_sample_makes_a_record_that_gives_it_back() {
        let sample = record("a").sample(0);
        let copy = Record::from(Sample { id: "x/y.1".into(), ..sample.clone() });
        assert_eq!(copy.key, "x_y_1");
        assert_eq!(copy.sample(0), Sample { id: "x_y_1".into(), ..sample });
    }
}
