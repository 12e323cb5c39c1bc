//! Warnings about placements that are probably wrong.

use lo_geometry::{Camera, Cube, Ray, Vec3};

use crate::objects::size::RoomSize;
use crate::objects::tracing::Objects;
use crate::surface::contact::surface_height_m;
use crate::surface::occluders::Occluders;
use crate::{Base, InsertWarning, Instance};

/// Smallest supported share of an object's base without a warning.
const MIN_SUPPORT: f32 = 0.5;

/// Smallest supported share of an object's base at an edge; with less, the object is not at the surface's height.
const MIN_EDGE_SUPPORT: f32 = 0.1;

/// Largest height of a supported point above or below the surface of a carrier, metres.
const CARRIES_M: f32 = 0.01;

/// Largest height of an object's base over or under the surface without a warning, as a share of its height, and of the
/// possible error of depth.
const MAX_GAP: f32 = 0.03;
const MAX_GAP_BIAS: f32 = 0.5;

/// Smallest cosine between an object's up direction and the room's of an object that stands.
const UPRIGHT: f32 = 0.7;

/// Visibility of an object in the photo.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ObjectVisibility {
    /// Whether any part is visible.
    pub shows: bool,
    /// Whether any part is hidden.
    pub hides: bool,
}

/// The parts of a scene that placements are compared with.
pub(crate) struct PlacementCheck<'a> {
    pub occluders: &'a Occluders,
    pub camera: &'a Camera,
    /// Cube of the octree.
    pub cube: &'a Cube,
    pub room: &'a RoomSize,
    /// Unit vector against gravity.
    pub up: Vec3,
}

impl PlacementCheck<'_> {
    /// Returns the warnings about objects of which `seen` is visible.
    pub fn warnings(
        &self,
        instances: &[Instance],
        objects: &Objects,
        seen: &[ObjectVisibility],
    ) -> impl Iterator<Item = InsertWarning> + use<> {
        let of_object = |object: usize| {
            let ObjectVisibility { shows, hides } = seen[object];
            let size = self.room.warning(object, &instances[object]);
            // That a model in other units surrounds the camera or leaves the room is no news.
            let is_too_large =
                matches!(size, Some(InsertWarning::ObjectTooHigh { .. } | InsertWarning::ObjectTooWide { .. }));
            let nothing = (!shows && !is_too_large).then(|| match hides {
                _ if objects[object].is_transparent() => InsertWarning::ObjectTransparent { object },
                true => InsertWarning::ObjectHidden { object },
                false => InsertWarning::ObjectOutsidePicture { object },
            });
            let is_outside = !is_too_large && !self.cube.contains(objects[object].centre_m);
            let outside = is_outside.then_some(InsertWarning::ObjectOutsideOctree { object });
            let supported =
                self.supported_share(object, &instances[object], objects).filter(|&share| share < MIN_SUPPORT);
            let is_judged = shows && size.is_none() && supported.is_none_or(|share| share < MIN_EDGE_SUPPORT);
            let gap = is_judged.then(|| self.gap_warning(object, &instances[object], objects)).flatten();
            let overhang = supported
                .filter(|_| gap.is_none())
                .map(|supported| InsertWarning::ObjectOverhangs { object, supported });
            nothing.into_iter().chain(size).chain(outside).chain(overhang).chain(gap)
        };
        let warnings: Vec<InsertWarning> = (0..objects.len()).flat_map(of_object).collect();
        let pairs: Vec<InsertWarning> =
            objects.intersecting().map(|objects| InsertWarning::ObjectsIntersect { objects }).collect();
        warnings.into_iter().chain(pairs)
    }

    /// Returns the warning about an upright object whose base is clearly above or below the observed surface.
    fn gap_warning(&self, index: usize, instance: &Instance, objects: &Objects) -> Option<InsertWarning> {
        let &Instance { model, placement, .. } = instance;
        if placement.up.dot(self.up) < UPRIGHT {
            return None;
        }
        let height_m = model.bounds().size().y * placement.scale;
        let on_other = |point: Vec3, gap_m: f32| {
            let down = Ray { origin: point + placement.up * CARRIES_M, direction: -placement.up };
            let mut others = objects.iter().enumerate().filter(|&(i, _)| i != index);
            others.any(|(_, other)| other.first(&down, gap_m.max(0.0) + 2.0 * CARRIES_M).is_some())
        };
        let gap_m = |point: Vec3| {
            let surface_m = surface_height_m(self.occluders, self.camera, point, placement.up, height_m)?;
            (!on_other(point, -surface_m)).then_some(-surface_m)
        };
        let points: Vec<Vec3> = Base::new(model)
            .sample_points(placement.scale, placement.rotation())
            .map(|point| placement.position_m + point)
            .collect();
        let mut gaps_m: Vec<f32> = points.iter().copied().filter_map(gap_m).collect();
        if gaps_m.is_empty() || 2 * gaps_m.len() < points.len() {
            return None;
        }
        let middle = gaps_m.len() / 2;
        let gap_m = *gaps_m.select_nth_unstable_by(middle, f32::total_cmp).1;
        let bias_m = self.occluders.bias_m(-placement.position_m.z);
        if gap_m.abs() <= (MAX_GAP * height_m).max(MAX_GAP_BIAS * bias_m) {
            return None;
        }
        let object = index;
        Some(if gap_m > 0.0 {
            InsertWarning::ObjectFloats { object, gap_m }
        } else {
            InsertWarning::ObjectSunk { object, depth_m: -gap_m }
        })
    }

    /// Returns the share of a resting object's base that real surfaces or other objects support; `None` unless half
    /// of the base can be judged.
    fn supported_share(&self, index: usize, instance: &Instance, objects: &Objects) -> Option<f32> {
        let &Instance { model, placement, .. } = instance;
        placement.support?;
        let on_other = |point: Vec3| {
            let down = Ray { origin: point + placement.up * CARRIES_M, direction: -placement.up };
            let mut others = objects.iter().enumerate().filter(|&(i, _)| i != index);
            others.any(|(_, other)| other.first(&down, 2.0 * CARRIES_M).is_some())
        };
        let known: Vec<Option<bool>> = Base::new(model)
            .sample_points(placement.scale, placement.rotation())
            .map(|point| placement.position_m + point)
            .map(|point| {
                if on_other(point) {
                    return Some(true);
                }
                self.occluders.carries(self.camera, point, placement.up)
            })
            .collect();
        let count = |state: bool| known.iter().filter(|known| **known == Some(state)).count();
        let (carried, free) = (count(true), count(false));
        (2 * (carried + free) >= known.len() && carried + free > 0).then(|| carried as f32 / (carried + free) as f32)
    }
}
