//! Scaling a room about the camera: the photo stays the same, all lengths change.

use std::ops::RangeInclusive;

use lo_geometry::{Cube, Plane, RigidTransform, Vec3};
use lo_imaging::Image;
use serde::{Deserialize, Serialize};

use crate::light_edits::{AddedLight, AnalyticLight, EmitterEdit, LightChange, LightEdits, LightShape};
use crate::{
    Estimate, Frame, FrameError, MAX_LIGHT_POSITION_M, MAX_LIGHT_SIZE_M, MIN_LIGHT_SIZE_M, OtherPhoto,
    PanoramaContribution, PanoramaSource, Room, RoomPlane,
};

/// Factors by which a room can be scaled.
pub const ROOM_SCALES: RangeInclusive<f32> = 0.02..=50.0;

/// Valid known lengths, metres.
const LENGTHS_M: RangeInclusive<f64> = 0.001..=1000.0;

/// Smallest share of their distance from the camera that two ends are apart.
const MIN_SHARE: f32 = 0.002;

/// Factors this near to 1 leave a room unchanged: those of a room that was scaled by the same length before.
const UNCHANGED: f32 = 1e-5;

/// Radius, in depth pixels, in which the nearest surface is taken: users click beside the edge of an object.
const AROUND: isize = 2;

/// The real length between two points of the photo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct KnownLength {
    /// Photo positions of the ends, pixels.
    pub ends: [[f64; 2]; 2],
    /// The real length, metres.
    pub length_m: f64,
}

/// A known length from which no scale follows.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KnownLengthError {
    /// The length is not that of anything in a room.
    #[error("a known length is from 1 mm to 1 km, got {0} m")]
    Length(f64),
    /// An end is not in the photo.
    #[error("{0},{1} is outside of the photo, which has {2} × {3} pixels")]
    Outside(f64, f64, u32, u32),
    /// There is no depth at an end.
    #[error("the photo has no depth at {0},{1}; choose another point")]
    NoDepth(f64, f64),
    /// The ends coincide.
    #[error("the two points are too close to each other to measure between them")]
    Coincide,
    /// The room would be scaled by an implausible factor.
    #[error("{estimated_m:.3} m were estimated between the points: a room is scaled by at most 50 times")]
    Factor {
        /// Estimated length, metres.
        estimated_m: f32,
    },
    /// The scaled depth is not that of a room.
    #[error(transparent)]
    Frame(#[from] FrameError),
}

impl KnownLength {
    /// Returns the length between the ends in an estimate, metres.
    ///
    /// # Errors
    /// If an end is outside of the photo or has no depth.
    pub fn estimated_m(&self, estimate: &Estimate) -> Result<f32, KnownLengthError> {
        let camera = estimate.frame.camera;
        let point = |[u, v]: [f64; 2]| {
            if !camera.contains(u, v) {
                return Err(KnownLengthError::Outside(u, v, camera.width, camera.height));
            }
            estimate.nearest_point([u, v]).ok_or(KnownLengthError::NoDepth(u, v))
        };
        let [from_m, to_m] = [point(self.ends[0])?, point(self.ends[1])?];
        let length_m = (to_m - from_m).length();
        if length_m < MIN_SHARE * from_m.length() { Err(KnownLengthError::Coincide) } else { Ok(length_m) }
    }

    /// Returns the factor by which a room has to be scaled; 1 if its length is the known one already.
    ///
    /// # Errors
    /// Those of [`KnownLength::estimated_m`], and if length or factor are out of range.
    pub fn factor(&self, estimate: &Estimate) -> Result<f32, KnownLengthError> {
        if !LENGTHS_M.contains(&self.length_m) {
            return Err(KnownLengthError::Length(self.length_m));
        }
        let estimated_m = self.estimated_m(estimate)?;
        let factor = self.length_m as f32 / estimated_m;
        if !ROOM_SCALES.contains(&factor) {
            return Err(KnownLengthError::Factor { estimated_m });
        }
        Ok(if (factor - 1.0).abs() < UNCHANGED { 1.0 } else { factor })
    }
}

impl Estimate {
    /// Returns the nearest surface point around a pixel of the photo, metres; `None` without depth.
    pub fn nearest_point(&self, [u, v]: [f64; 2]) -> Option<Vec3> {
        let (depth_m, camera) = (&self.frame.depth_m, &self.frame.camera);
        let at = |share: f64, size: usize| (share * size as f64) as isize;
        let x = at(u / f64::from(camera.width), depth_m.width());
        let y = at(v / f64::from(camera.height), depth_m.height());
        let around = (-AROUND..=AROUND).flat_map(|dy| (-AROUND..=AROUND).map(move |dx| (x + dx, y + dy)));
        let reading = |(x, y): (isize, isize)| {
            let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
            let inside = x < depth_m.width() && y < depth_m.height();
            inside.then(|| depth_m[(x, y)]).filter(|&reading_m| reading_m > 0.0)
        };
        let nearest_m = around.filter_map(reading).min_by(f32::total_cmp)?;
        Some(camera.unproject(u, v, f64::from(nearest_m)))
    }

    /// Scales the room about the camera. Radiance, opacities and all directions stay.
    ///
    /// # Errors
    /// If the scaled depth is not that of a room.
    pub fn scaled(&self, factor: f32) -> Result<Self, FrameError> {
        let Frame { camera, photo, depth_m, exposure } = &self.frame;
        let depth_m: Image<f32> = depth_m.map(|z| z * factor);
        let mut light = self.light.clone();
        let Cube { origin_m, edge_m } = light.cube;
        light.cube = Cube { origin_m: origin_m * factor, edge_m: edge_m * factor };
        let plane = |plane: &RoomPlane| RoomPlane {
            plane: Plane { offset_m: plane.plane.offset_m * factor, ..plane.plane },
            ..*plane
        };
        let room = self.room.as_ref().map(|room| Room { up: room.up, planes: room.planes.iter().map(plane).collect() });
        let panorama = self.panorama.as_ref().map(|panorama| PanoramaContribution {
            source: PanoramaSource { position_m: panorama.source.position_m * factor, ..panorama.source.clone() },
            ..panorama.clone()
        });
        let other = |other: &OtherPhoto| {
            let RigidTransform { rotation, translation_m } = other.first_from_camera;
            OtherPhoto {
                first_from_camera: RigidTransform { rotation, translation_m: translation_m * factor },
                ..*other
            }
        };
        Ok(Self {
            light,
            frame: Frame::new(photo.clone(), depth_m, *camera, *exposure)?,
            room,
            panorama,
            other_photos: self.other_photos.iter().map(other).collect(),
            // Clones start without derived values.
            ..self.clone()
        })
    }
}

impl LightEdits {
    /// Returns the edits in a room that is scaled about the camera: lights are scaled with it, so that they shine as
    /// before.
    pub fn in_scaled_room(&self, factor: f32) -> Self {
        let place = |place_m: Vec3| {
            (place_m * factor).clamp(Vec3::splat(-MAX_LIGHT_POSITION_M), Vec3::splat(MAX_LIGHT_POSITION_M))
        };
        let size = |size_m: f32| (size_m * factor).clamp(MIN_LIGHT_SIZE_M, MAX_LIGHT_SIZE_M);
        let change = |change: LightChange| LightChange { at_m: change.at_m.map(place), ..change };
        let shape = |shape: LightShape| match shape {
            LightShape::Rectangle { centre_m, direction, across, size_m, two_sided } => LightShape::Rectangle {
                centre_m: place(centre_m),
                size_m: size_m.map(size),
                direction,
                across,
                two_sided,
            },
            LightShape::Sphere { centre_m, radius_m } => {
                LightShape::Sphere { centre_m: place(centre_m), radius_m: size(radius_m) }
            }
            LightShape::Sun { .. } => shape,
        };
        let emitter = |edit: &EmitterEdit| EmitterEdit {
            id: edit.id.clone(),
            found_at_m: place(edit.found_at_m),
            change: change(edit.change),
        };
        let added = |added: &AddedLight| AddedLight {
            id: added.id.clone(),
            light: AnalyticLight { shape: shape(added.light.shape), radiance: added.light.radiance },
            change: change(added.change),
        };
        Self {
            emitters: self.emitters.iter().map(emitter).collect(),
            added: self.added.iter().map(added).collect(),
            inferred: self.inferred,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Quat};
    use lo_imaging::Photo;
    use lo_octree::LightOctree;

    use super::*;
    use crate::{SceneFile, Side};

    fn estimate() -> Estimate {
        let camera = Camera::from_hfov_deg(90.0, 64, 48).unwrap();
        // A slanted wall.
        let depth_m = Image::from_fn(64, 48, |x, _| 2.0 + 0.01 * x as f32);
        let photo = Photo::Srgb8(Image::new(64, 48, vec![[90; 3]; 64 * 48]));
        let frame = Frame::new(photo, depth_m, camera, 1.0).unwrap();
        let (light, _) = LightOctree::from_points(&[], Cube::centred(Vec3::ZERO, 4.0), 3, 2).unwrap();
        let plane = Plane { normal: Vec3::Y, offset_m: -1.4 };
        let planes = vec![RoomPlane { side: Side::Floor, plane, measured: true }];
        let pose = RigidTransform { rotation: Quat::IDENTITY, translation_m: Vec3::X };
        Estimate {
            room: Some(Room { up: Vec3::Y, planes }),
            other_photos: vec![OtherPhoto { first_from_camera: pose, camera, exposure: 1.0 }],
            ..Estimate::observed_only(light, frame)
        }
    }

    #[test]
    fn a_scaled_room_has_the_known_length_and_the_same_photo() {
        let before = estimate();
        let known = KnownLength { ends: [[10.5, 20.5], [50.5, 30.5]], length_m: 5.0 };
        let factor = known.factor(&before).unwrap();
        let after = before.scaled(factor).unwrap();
        assert!((known.estimated_m(&after).unwrap() - 5.0).abs() < 1e-4);
        assert_eq!(known.factor(&after).unwrap(), 1.0, "it is scaled already");
        assert_eq!(after.frame.photo, before.frame.photo);
        assert_eq!(after.light.cube.edge_m, 4.0 * factor);
        assert_eq!(after.room.as_ref().unwrap().floor().unwrap().offset_m, -1.4 * factor);
        assert_eq!(after.other_photos[0].first_from_camera.translation_m, Vec3::X * factor);
        // Points keep their photo positions.
        let (a, b) = (before.nearest_point([33.0, 7.0]).unwrap(), after.nearest_point([33.0, 7.0]).unwrap());
        assert!((a * factor - b).length() < 1e-4);
        // The file has the same room.
        let bytes = SceneFile::from(after.clone()).to_bytes("test").unwrap();
        assert_eq!(*SceneFile::from_bytes(&bytes).unwrap().estimate, after);
    }

    #[test]
    fn lengths_without_a_scale_are_refused() {
        let mut room = estimate();
        let factor = |room: &Estimate, ends, length_m| KnownLength { ends, length_m }.factor(room);
        let ends = [[10.5, 20.5], [50.5, 30.5]];
        assert!(matches!(factor(&room, ends, 0.0), Err(KnownLengthError::Length(_))));
        assert!(matches!(factor(&room, ends, f64::NAN), Err(KnownLengthError::Length(_))));
        assert!(matches!(factor(&room, ends, 900.0), Err(KnownLengthError::Factor { .. })));
        assert!(matches!(factor(&room, [[10.5, 20.5]; 2], 1.0), Err(KnownLengthError::Coincide)));
        assert!(matches!(factor(&room, [[10.5, 20.5], [64.5, 3.0]], 1.0), Err(KnownLengthError::Outside(..))));
        // Rooms of 200 m are not read.
        let far = room.scaled(50.0).unwrap();
        assert!(matches!(far.scaled(50.0), Err(FrameError::DepthScale { .. })));
        room.frame.depth_m.pixels_mut()[..64 * 24].fill(0.0);
        assert!(matches!(factor(&room, ends, 1.0), Err(KnownLengthError::NoDepth(..))));
    }

    #[test]
    fn lights_keep_their_places_and_sizes_in_the_room() {
        let mut edits = LightEdits::default();
        let shape = LightShape::Sphere { centre_m: Vec3::new(1.0, 2.0, -3.0), radius_m: 0.1 };
        edits.add(AnalyticLight { shape, radiance: [3.0; 3] }).unwrap();
        let sun = LightShape::Sun { direction: Vec3::Y, angular_radius_deg: 0.5, of_photo: true };
        edits.add(AnalyticLight { shape: sun, radiance: [9.0; 3] }).unwrap();
        assert!(edits.change("L1", Vec3::X, LightChange { at_m: Some(Vec3::Z), ..LightChange::NONE }));
        let scaled = edits.in_scaled_room(2.0);
        let expected = LightShape::Sphere { centre_m: Vec3::new(2.0, 4.0, -6.0), radius_m: 0.2 };
        assert_eq!(scaled.added[0].light, AnalyticLight { shape: expected, radiance: [3.0; 3] });
        assert_eq!(scaled.added[1], edits.added[1]);
        assert_eq!(
            (scaled.emitters[0].found_at_m, scaled.emitters[0].change.at_m),
            (2.0 * Vec3::X, Some(2.0 * Vec3::Z))
        );
    }
}
