use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::{Provenance, RadiancePoint};

use crate::sample::Metadata;
use crate::{NovelView, Sample};

/// One room: what all its photos share, once, and the photos. What a shard holds and what the generator makes.
///
/// Positions are in the record's own frame (metres, +Y need not be up), radiance in its own units; every [`Shot`] says how both become its
/// photo's.
#[derive(Clone, Debug, PartialEq)]
pub struct Record {
    /// Unique in its dataset; letters, digits, `-` and `_`.
    pub key: String,
    /// The room; see [`Sample::scene_id`].
    pub scene_id: String,
    /// Unit direction that points up in the room.
    pub up: Option<Vec3>,
    /// Radiance leaving all surfaces.
    pub points: Vec<RadiancePoint>,
    /// See [`Sample::point_area_m2`].
    pub point_area_m2: Option<f32>,
    /// Panoramas.
    pub views: Vec<NovelView>,
    /// Photos, at least one.
    pub shots: Vec<Shot>,
    /// What else is known of the room.
    pub metadata: Metadata,
}

/// One photo of a room.
#[derive(Clone, Debug, PartialEq)]
pub struct Shot {
    /// Where the camera stands, metres.
    pub position_m: Vec3,
    /// Record-frame direction = rotation · camera direction.
    pub rotation: Quat,
    /// The record's radiance times this, per channel, is in units of the photo's white.
    pub gains: [f32; 3],
    /// The lens.
    pub camera: Camera,
    /// The photo, sRGB.
    pub photo: Image<[u8; 3]>,
    /// The file that the camera wrote, where there is one; it decodes to the photo.
    pub jpeg: Option<Vec<u8>>,
    /// The light that made the photo, in units of its white.
    pub radiance: Option<RadianceImage>,
    /// See [`Sample::depth_m`].
    pub depth_m: Option<DepthMap>,
    /// See [`Sample::sensor_depth_m`].
    pub sensor_depth_m: Option<DepthMap>,
    /// See [`Sample::normal`].
    pub normal: Option<Image<[f32; 3]>>,
    /// See [`Sample::albedo`].
    pub albedo: Option<Image<[f32; 3]>>,
    /// Which of the record's panoramas belong to this photo, its own ones first.
    pub views: Vec<usize>,
    /// What else is known of the photo.
    pub metadata: Metadata,
}

/// A point counts as seen where the photo's depth differs by no more than this, metres: points stand for the surface of a leaf.
const SEEN_WITHIN_M: f32 = 0.1;

impl Record {
    /// The sample of photo `shot`: everything turned into its frame and units.
    ///
    /// Points that the photo's depth map shows are [`Provenance::Observed`]; without a depth map they stay as they are.
    ///
    /// # Panics
    /// Where there is no such shot, or it names a view that the record has not.
    pub fn sample(&self, shot: usize) -> Sample {
        let taken = &self.shots[shot];
        let camera_from_record = taken.rotation.inverse();
        let into = |point: Vec3| camera_from_record * (point - taken.position_m);
        let scaled = |[r, g, b]: [f32; 3]| [r * taken.gains[0], g * taken.gains[1], b * taken.gains[2]];
        let points = self
            .points
            .iter()
            .map(|point| {
                let position_m = into(point.position_m);
                RadiancePoint {
                    position_m,
                    radiance: scaled(point.radiance),
                    provenance: taken.provenance(position_m).unwrap_or(point.provenance),
                }
            })
            .collect();
        let views = taken
            .views
            .iter()
            .map(|&view| {
                let view = &self.views[view];
                NovelView {
                    position_m: into(view.position_m),
                    rotation: camera_from_record * view.rotation,
                    radiance: view.radiance.map(|&rgb| scaled(rgb)),
                    depth_m: view.depth_m.clone(),
                }
            })
            .collect();
        let mut metadata = self.metadata.clone();
        metadata.extend(taken.metadata.clone());
        Sample {
            id: if self.shots.len() == 1 { self.key.clone() } else { format!("{}-{shot}", self.key) },
            scene_id: self.scene_id.clone(),
            photo: taken.photo.clone(),
            camera: taken.camera,
            up: self.up.map(|up| camera_from_record * up),
            radiance: taken.radiance.clone(),
            depth_m: taken.depth_m.clone(),
            sensor_depth_m: taken.sensor_depth_m.clone(),
            normal: taken.normal.clone(),
            albedo: taken.albedo.clone(),
            points,
            point_area_m2: self.point_area_m2,
            views,
            metadata,
        }
    }
}

impl From<Sample> for Record {
    /// A room with one photo, whose frame and units are the record's. Characters of the id that a key cannot have become `_`.
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
    /// Whether the photo shows a point of its frame; `None` without a depth map.
    fn provenance(&self, position_m: Vec3) -> Option<Provenance> {
        let depth = self.depth_m.as_ref()?;
        let seen = self.camera.project(position_m).is_some_and(|(u, v, z)| {
            let (u, v) = (u.floor(), v.floor());
            u >= 0.0
                && v >= 0.0
                && u < depth.width() as f64
                && v < depth.height() as f64
                && (f64::from(depth[(u as usize, v as usize)]) - z).abs() < f64::from(SEEN_WITHIN_M)
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
        // a point 2 m before the camera of photo 1, as the matrix of the pose has it
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
