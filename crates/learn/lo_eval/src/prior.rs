//! A panorama of the room that a method knows, and those that it is scored on.

use std::f32::consts::PI;

use lightoctree::octree::LightOctree;
use lightoctree::{Event, PanoramaPrior, Warning};
use lo_dataset::{NovelView, Sample};
use lo_geometry::{Orientation, Vec3};

use crate::MethodError;

/// A known panorama and those that are scored lie at least this far from each other, metres.
pub const MIN_PANORAMA_DISTANCE_M: f32 = 0.7;

/// What a sample lacks that has none such.
pub(crate) const TWO_PANORAMAS_APART: &str = "two panoramas 0.7 m or more apart";

/// A panorama this near to the camera, metres, is the one that the photo was cut out of, where it is the only one.
const AT_CAMERA_M: f32 = 1e-3;

/// A panorama of a sample's room.
#[derive(Clone, Debug)]
pub struct KnownPanorama {
    /// Where it is, and what it shows.
    pub view: NovelView,
    /// Whether it is also what methods are scored on: of samples that are cut out of panoramas there is no other.
    pub is_scored: bool,
}

impl KnownPanorama {
    /// Takes the first of the sample's panoramas that has others at least [`MIN_PANORAMA_DISTANCE_M`] away, and leaves those to be scored. Of a sample with the
    /// one panorama at its camera: takes that, and leaves it too.
    ///
    /// # Errors
    /// [`MethodError::Needs`] where there is neither; the sample keeps its panoramas.
    pub fn take(sample: &mut Sample) -> Result<Self, MethodError> {
        if let [view] = &sample.views[..]
            && view.position_m.length() < AT_CAMERA_M
        {
            return Ok(Self { view: view.clone(), is_scored: true });
        }
        let apart = |a: &NovelView, b: &NovelView| a.position_m.distance(b.position_m) >= MIN_PANORAMA_DISTANCE_M;
        let known = sample.views.iter().find(|a| sample.views.iter().any(|b| apart(a, b)));
        let view = known.cloned().ok_or(MethodError::Needs(TWO_PANORAMAS_APART))?;
        sample.views.retain(|other| apart(&view, other));
        Ok(Self { view, is_scored: false })
    }

    /// How far its centre is to the right of the photo's heading, about the panorama's own vertical, in radians.
    pub(crate) fn yaw_rad(&self) -> f32 {
        let up = self.view.rotation * Vec3::Y;
        let centre = self.view.rotation * Vec3::NEG_Z;
        let heading = (Vec3::NEG_Z - up * up.dot(Vec3::NEG_Z)).normalize_or(centre);
        centre.dot(heading.cross(up)).atan2(centre.dot(heading))
    }

    /// As a user would give it, with the yaw or without.
    pub(crate) fn prior(&self, yaw_is_given: bool) -> Result<PanoramaPrior, MethodError> {
        let radiance = self.view.radiance.clone();
        let mut prior = PanoramaPrior::new(radiance, Orientation::Lightoctree, "known.hdr")?.at(self.view.position_m);
        prior.yaw_rad = yaw_is_given.then(|| self.yaw_rad());
        Ok(prior)
    }
}

/// How a panorama was laid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PriorAlignment {
    /// From 0 to 1, how well it shows what the photo shows.
    pub confidence: f64,
    /// Its yaw less the true one, where that is known.
    pub yaw_error_deg: Option<f64>,
    /// Stops from its values to the photo's; 0 is right where both are in units of the photo's white.
    pub exposure_ev: f64,
    /// Whether it was said that it may not fit.
    pub is_warned: bool,
    /// Of the leaves that the photo saw, the share that is the same to the bit as without the panorama; where that was looked at.
    pub seen_unchanged: Option<f64>,
}

/// Whether an event says that a panorama may not fit.
pub(crate) fn is_doubt(event: &Event) -> bool {
    matches!(event, Event::Warning(Warning::PanoramaMatch { .. } | Warning::PanoramaNotCompared))
}

/// Absolute difference of two yaws, in degrees.
pub(crate) fn yaw_error_deg(got_deg: f32, truth_rad: f32) -> f64 {
    let difference = got_deg.to_radians() - truth_rad;
    f64::from(((difference + PI).rem_euclid(2.0 * PI) - PI).abs()).to_degrees()
}

/// Share of the leaves that the photo saw in `before` that `after` has, the same to the bit.
pub(crate) fn unchanged(before: &LightOctree, after: &LightOctree) -> f64 {
    let [mut all, mut same] = [0usize; 2];
    for (depth, level) in before.octree.levels().iter().enumerate() {
        for ((&key, &row), &child) in level.keys.iter().zip(&level.rows).zip(&level.children) {
            let Some(row) = usize::try_from(row).ok().filter(|&row| child < 0 && before.seen[depth][row] > 0) else {
                continue;
            };
            all += 1;
            let is_same = after.row(depth as u32, key).is_some_and(|other| {
                after.rgba[depth][other].map(f32::to_bits) == before.rgba[depth][row].map(f32::to_bits)
                    && after.seen[depth][other] == before.seen[depth][row]
            });
            same += usize::from(is_same);
        }
    }
    if before.cube == after.cube { same as f64 / all.max(1) as f64 } else { 0.0 }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::testing;
    use lo_geometry::Quat;

    #[test]
    fn the_first_panorama_with_others_far_enough_is_known() {
        let mut sample = testing::box_room();
        let view = |x: f32| NovelView { position_m: Vec3::new(x, 0.0, -1.0), ..sample.views[0].clone() };
        sample.views = [0.0, 0.4, 0.75, 0.69].map(view).into();
        let known = KnownPanorama::take(&mut sample).unwrap();
        assert_eq!((known.view.position_m.x, known.is_scored), (0.0, false));
        let left: Vec<f32> = sample.views.iter().map(|view| view.position_m.x).collect();
        assert_eq!(left, [0.75]);
        assert!(matches!(KnownPanorama::take(&mut sample), Err(MethodError::Needs(_))));
        assert_eq!(sample.views.len(), 1);
        sample.views[0].position_m = Vec3::ZERO;
        assert!(KnownPanorama::take(&mut sample).unwrap().is_scored && sample.views.len() == 1);
    }

    #[test]
    fn yaws_are_to_the_right_of_the_heading() {
        let view = testing::box_room().views.swap_remove(0);
        let yaw =
            |rotation: Quat| KnownPanorama { view: NovelView { rotation, ..view.clone() }, is_scored: false }.yaw_rad();
        assert!(yaw(Quat::IDENTITY).abs() < 1e-6);
        // turning about +Y by a positive angle takes −Z to −X, to the left
        assert!((yaw(Quat::from_rotation_y(-0.5)) - 0.5).abs() < 1e-5);
        // a camera that looks down sees a level panorama tilted
        assert!((yaw(Quat::from_rotation_x(0.4) * Quat::from_rotation_y(1.0)) + 1.0).abs() < 1e-5);
        assert!((yaw_error_deg(-179.0, 179f32.to_radians()) - 2.0).abs() < 1e-3);
    }
}
