//! Known panoramas of a room, as input of methods.

use std::f32::consts::PI;

use lo_completion::{PanoramaPrior, PanoramaWarning};
use lo_dataset::{NovelView, Sample};
use lo_events::Event;
use lo_geometry::{Orientation, Vec3};
use lo_octree::LightOctree;

use crate::MethodError;

/// Smallest distance between a known panorama and the scored ones, metres.
pub const MIN_PANORAMA_DISTANCE_M: f32 = 0.7;

/// Requirement that a sample without such panoramas lacks.
pub(crate) const TWO_PANORAMAS_APART: &str = "two panoramas 0.7 m or more apart";

/// Distance to the camera, metres, below which a sample's only panorama is the one that the photo was cropped from.
const AT_CAMERA_M: f32 = 1e-3;

/// A panorama of a sample's room that methods may use.
#[derive(Clone, Debug)]
pub struct KnownPanorama {
    /// The panorama and its pose.
    pub view: NovelView,
    /// Whether methods are scored on the same panorama: crops of panoramas have no other.
    pub is_scored: bool,
}

impl KnownPanorama {
    /// Takes the first panorama with others at least [`MIN_PANORAMA_DISTANCE_M`] away; only those stay in the sample.
    ///
    /// If the only panorama is at the camera, returns that one and leaves it in the sample.
    ///
    /// # Errors
    /// [`MethodError::Needs`] if there is neither; the sample keeps its panoramas.
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

    /// Returns the yaw of the panorama's centre relative to the photo's heading, radians; positive to the right.
    ///
    /// Measured about the panorama's vertical.
    pub(crate) fn yaw_rad(&self) -> f32 {
        let up = self.view.rotation * Vec3::Y;
        let centre = self.view.rotation * Vec3::NEG_Z;
        let heading = (Vec3::NEG_Z - up * up.dot(Vec3::NEG_Z)).normalize_or(centre);
        centre.dot(heading.cross(up)).atan2(centre.dot(heading))
    }

    /// Converts to a prior as a user would supply it, with or without yaw.
    pub(crate) fn prior(&self, yaw_is_given: bool) -> Result<PanoramaPrior, MethodError> {
        let radiance = self.view.radiance.clone();
        let mut prior = PanoramaPrior::new(radiance, Orientation::Lightoctree, "known.hdr")?.at(self.view.position_m);
        prior.yaw_rad = yaw_is_given.then(|| self.yaw_rad());
        Ok(prior)
    }
}

/// Alignment of a panorama prior with the photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PriorAlignment {
    /// Agreement with the photo, from 0 to 1.
    pub confidence: f64,
    /// Absolute yaw error, if the true yaw is known.
    pub yaw_error_deg: Option<f64>,
    /// Exposure from panorama to photo, stops; 0 is correct if both are in units of the photo's white.
    pub exposure_ev: f64,
    /// Whether a warning reported that the panorama may not fit.
    pub is_warned: bool,
    /// Share of observed leaves that are identical, bit for bit, to those without the panorama; `None` if not measured.
    pub seen_unchanged: Option<f64>,
}

/// Returns whether an event warns that a panorama may not fit.
pub(crate) fn is_mismatch(event: &Event) -> bool {
    matches!(event.warning(), Some(PanoramaWarning::PoorMatch { .. } | PanoramaWarning::NotCompared))
}

/// Returns the absolute difference of two yaws, degrees.
pub(crate) fn yaw_error_deg(got_deg: f32, truth_rad: f32) -> f64 {
    let difference = got_deg.to_radians() - truth_rad;
    f64::from(((difference + PI).rem_euclid(2.0 * PI) - PI).abs()).to_degrees()
}

/// Returns the share of observed leaves of `before` that are identical, bit for bit, in `after`.
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
        // A positive rotation about +Y takes −Z to −X, to the left.
        assert!((yaw(Quat::from_rotation_y(-0.5)) - 0.5).abs() < 1e-5);
        // For a camera that looks down, a level panorama is tilted.
        assert!((yaw(Quat::from_rotation_x(0.4) * Quat::from_rotation_y(1.0)) + 1.0).abs() < 1e-5);
        assert!((yaw_error_deg(-179.0, 179f32.to_radians()) - 2.0).abs() < 1e-3);
    }
}
