use lo_geometry::{Plane, Quat, RigidTransform, Vec2, Vec3};
use lo_mesh::Bounds;
use lo_scene::Estimate;
use serde::{Deserialize, Serialize};

use crate::objects::below::surface_below;
use crate::{Base, Ground, InsertError};

/// Largest tilt of a surface that counts as level, degrees: depth noise tilts fitted normals by a few degrees.
const LEVEL_DEG: f32 = 10.0;

/// Largest tilt of a surface that supports an object, degrees.
const STANDING_DEG: f32 = 40.0;

/// Largest tilt of a supporting surface where depth, and so normals, are predicted, degrees.
const PREDICTED_STANDING_DEG: f32 = 55.0;

/// Largest height above or below the initial base of readings that may belong to the supporting surface: metres, and
/// metres per metre of depth, for measured and for predicted depth.
const PATCH_REACH: [(f32, f32); 2] = [(0.02, 0.01), (0.04, 0.04)];

/// Fewest readings that give a better height than one pixel.
const MIN_PATCH: usize = 5;

/// Alignment of an object's +Y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Align {
    /// Against gravity; the camera's up if gravity is unknown.
    #[default]
    Gravity,
    /// Along the normal of the surface; against gravity on surfaces within 10° of level. On walls the object lies with
    /// its base on the wall.
    Surface,
    /// Up in the image, the camera's +Y.
    None,
}

/// Position, size and rotation of an object.
///
/// The centre of the base of the model's bounding box is at `position_m`, its +Y points along `up`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// World position of the object's base, in metres.
    pub position_m: Vec3,
    /// Metres per unit of the model.
    pub scale: f32,
    /// Rotation about `up`, counter-clockwise seen from above, in radians.
    pub yaw_rad: f32,
    /// Unit vector to which the model's +Y is rotated.
    pub up: Vec3,
    /// Surface that the object rests on, if any; light is gathered from above it.
    pub support: Option<Plane>,
}

impl Placement {
    /// Places an object at a world position; the floor supports it if it is near. Other surfaces are ignored, so that
    /// [`Align::Surface`] equals [`Align::Gravity`].
    pub fn at(scene: &Estimate, position_m: Vec3, align: Align) -> Self {
        let up = match align {
            Align::Gravity | Align::Surface => scene.up(),
            Align::None => Vec3::Y,
        };
        let near = 2.0 * scene.light.cube.node_edge_m(scene.light.octree.depth());
        let floor = scene.room.as_ref().and_then(|room| room.floor());
        let support = floor.filter(|floor| floor.signed_distance_m(position_m).abs() < near);
        Self { position_m, scale: 1.0, yaw_rad: 0.0, up, support }
    }

    /// Places an object on the surface at photo position `(u, v)`, pixel centres at +0.5. [`Placement::settled`]
    /// refines its height.
    ///
    /// Surfaces steeper than 40° (55° for predicted depth) do not support objects, except with [`Align::Surface`]. A
    /// [`Layout`](crate::Layout) refuses them.
    ///
    /// # Errors
    /// If the position is outside of the photo, or the depth map has no reading there.
    pub fn rest_on_pixel<'a>(ground: impl Into<Ground<'a>>, u: f64, v: f64, align: Align) -> Result<Self, InsertError> {
        let ground = ground.into();
        let (scene, (position_m, normal)) = (ground.estimate, ground.surface_at_pixel(u, v)?);
        let gravity = scene.up();
        let tilt_deg = tilt_deg(normal, gravity);
        let level_deg = if scene.room.is_some() { LEVEL_DEG } else { 0.0 };
        let carries = tilt_deg < standing_deg(scene);
        let is_sloped = tilt_deg > level_deg && tilt_deg < STANDING_DEG;
        let up = match align {
            Align::Surface if is_sloped || !carries => normal,
            Align::Gravity | Align::Surface => gravity,
            Align::None => Vec3::Y,
        };
        let support = (carries || align == Align::Surface).then(|| Plane::through(position_m, up));
        Ok(Self { position_m, scale: 1.0, yaw_rad: 0.0, up, support })
    }

    /// Places an object as [`rest_on_pixel`](Self::rest_on_pixel), on a surface that supports it.
    ///
    /// # Errors
    /// [`InsertError::Steep`] for other surfaces, and all errors of [`rest_on_pixel`](Self::rest_on_pixel).
    pub(crate) fn stand_on_pixel(ground: Ground<'_>, u: f64, v: f64, align: Align) -> Result<Self, InsertError> {
        let placement = Self::rest_on_pixel(ground, u, v, align)?;
        if placement.support.is_some() {
            return Ok(placement);
        }
        let (position_m, normal) = ground.surface_at_pixel(u, v)?;
        let tilt_deg = tilt_deg(normal, ground.estimate.up());
        let least_cosine = standing_deg(ground.estimate).to_radians().cos();
        let (below_m, below_pixel) = match surface_below(ground.estimate, position_m, normal, least_cosine) {
            Some((below_m, pixel)) => (Some(below_m), pixel),
            None => (None, None),
        };
        Err(InsertError::Steep { u, v, tilt_deg, position_m, below_m, below_pixel })
    }

    /// Returns the placement with another scale, in metres per unit of the model.
    pub fn scaled(self, scale: f32) -> Self {
        Self { scale, ..self }
    }

    /// Returns the placement with another yaw in radians.
    pub fn turned(self, yaw_rad: f32) -> Self {
        Self { yaw_rad, ..self }
    }

    /// Moves the base along the line of sight to the height of its supporting surface: the median of the readings
    /// below the base. Without support, or with too few readings, it stays.
    ///
    /// Set scale and yaw first: both determine which readings are below the base.
    pub fn settled<'a>(self, ground: impl Into<Ground<'a>>, base: &Base) -> Self {
        if self.support.is_none() {
            return self;
        }
        let ground = ground.into();
        let heights_m = self.heights_below(ground, base);
        if heights_m.len() < MIN_PATCH {
            return self;
        }
        // Repeat near the median, to exclude other objects on the surface.
        let middle_m = median(heights_m.clone());
        let reach_m = 0.5 * self.patch_reach_m(ground.estimate);
        let height_m = median(heights_m.into_iter().filter(|h| (h - middle_m).abs() <= reach_m).collect());
        // Along the line of sight, so that the base keeps its image position.
        let sight = self.position_m.normalize_or(Vec3::NEG_Z);
        let rise = sight.dot(self.up);
        let step = if rise.abs() > 0.05 { sight * (height_m / rise) } else { self.up * height_m };
        let position_m = self.position_m + step;
        Self { position_m, support: Some(Plane::through(position_m, self.up)), ..self }
    }

    /// Returns the placement in the axes of another camera.
    pub(crate) fn seen_from(&self, camera_from_room: &RigidTransform) -> Self {
        let up = camera_from_room.direction(self.up);
        // What is left of the rotation after the shortest one to the new up turns about +Y.
        let rotation = camera_from_room.rotation * self.rotation();
        let turn = Quat::from_rotation_arc(Vec3::Y, up).inverse() * rotation;
        Self {
            position_m: camera_from_room.point(self.position_m),
            up,
            yaw_rad: 2.0 * turn.y.atan2(turn.w),
            support: self.support.map(|support| support.moved(camera_from_room)),
            scale: self.scale,
        }
    }

    /// Returns scale, rotation and translation of a model of these bounds.
    pub fn of_model(&self, bounds: Bounds) -> lo_mesh::Placement {
        let (scale, rotation) = (self.scale, self.rotation());
        let centre = bounds.center();
        let base = Vec3::new(centre.x, bounds.min.y, centre.z);
        lo_mesh::Placement { scale, rotation, translation: self.position_m - rotation * (base * scale) }
    }

    /// Returns the rotation from the model's axes to the world's.
    pub(crate) fn rotation(&self) -> Quat {
        (Quat::from_rotation_arc(Vec3::Y, self.up) * Quat::from_rotation_y(self.yaw_rad)).normalize()
    }

    fn patch_reach_m(&self, scene: &Estimate) -> f32 {
        let (least_m, per_m) = PATCH_REACH[usize::from(scene.origin.predicted_depth)];
        least_m + per_m * -self.position_m.z
    }

    /// Returns the heights over the base of the readings below it that may belong to the supporting surface.
    fn heights_below(&self, ground: Ground<'_>, base: &Base) -> Vec<f32> {
        let rotation = self.rotation();
        let sample_points =
            base.sample_points(self.scale, rotation).map(|point| self.position_m + point).chain([self.position_m]);
        let sample_points: Vec<Vec3> = sample_points.collect();
        let map = ground.around(&sample_points);
        let local_from_world = rotation.conjugate();
        let reach_m = self.patch_reach_m(ground.estimate);
        let least_cosine = PREDICTED_STANDING_DEG.to_radians().cos();
        let below = |(x, y): (usize, usize)| {
            let surface = map.pixel(x, y)?;
            let offset = local_from_world * (surface.position_m - self.position_m);
            let pitch_m = -surface.position_m.z / map.camera.fx as f32;
            let carries = surface.normal.dot(self.up) > least_cosine && offset.y.abs() <= reach_m;
            let inside = || base.contains(Vec2::new(offset.x, offset.z) / self.scale, pitch_m / self.scale);
            (carries && inside()).then_some(offset.y)
        };
        let (columns, rows) = map.window(&sample_points);
        rows.flat_map(|y| columns.clone().map(move |x| (x, y))).filter_map(below).collect()
    }

    /// Checks that all numbers are valid.
    ///
    /// # Errors
    /// If a number is NaN, infinite or out of range.
    pub fn check(&self) -> Result<(), InsertError> {
        let bad = |name, needed, found: String| Err(InsertError::Placement { name, needed, found });
        if !(self.position_m.is_finite() && self.position_m.abs().max_element() < 1e4) {
            return bad("the position", "three finite numbers below 10 km", self.position_m.to_string());
        }
        if !(self.scale.is_finite() && self.scale > 1e-6 && self.scale < 1e6) {
            return bad("the scale", "a number between 1e-6 and 1e6", self.scale.to_string());
        }
        if !self.yaw_rad.is_finite() {
            return bad("the yaw", "a finite angle", self.yaw_rad.to_string());
        }
        if (self.up.length_squared() - 1.0).abs() > 1e-3 || !self.up.is_finite() {
            return bad("the up direction", "a unit vector", self.up.to_string());
        }
        Ok(())
    }
}

fn tilt_deg(normal: Vec3, up: Vec3) -> f32 {
    normal.dot(up).clamp(-1.0, 1.0).acos().to_degrees()
}

/// Returns the largest tilt of a surface that supports an object, degrees.
fn standing_deg(scene: &Estimate) -> f32 {
    if scene.origin.predicted_depth { PREDICTED_STANDING_DEG } else { STANDING_DEG }
}

/// Returns the median; 0 for an empty list.
fn median(mut values: Vec<f32>) -> f32 {
    let middle = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(middle, f32::total_cmp).1 }
}

#[cfg(test)]
mod tests {
    use lo_geometry::fibonacci_sphere;

    use super::*;

    #[test]
    fn placements_keep_their_pose_in_other_axes() {
        let points = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::new(0.3, -0.2, 0.9)];
        let bounds = Bounds { min: Vec3::splat(-1.0), max: Vec3::new(1.0, 2.0, 1.5) };
        for (i, up) in fibonacci_sphere(40).into_iter().enumerate() {
            let yaw_rad = i as f32 * 0.7;
            let position_m = Vec3::new(0.5, -1.0, -2.0);
            let support = Some(Plane::through(position_m, up));
            let placement = Placement { position_m, scale: 0.4, yaw_rad, up, support };
            let axis = fibonacci_sphere(40)[(i * 7 + 3) % 40];
            let rotation = Quat::from_axis_angle(axis, 0.3 + i as f32 * 0.1);
            let camera_from_room = RigidTransform { rotation, translation_m: Vec3::new(0.1 * i as f32, 1.0, -0.4) };
            let seen = placement.seen_from(&camera_from_room);
            assert!(seen.check().is_ok(), "{seen:?}");
            for point in points {
                let there = camera_from_room.point(placement.of_model(bounds).world_from_model(point));
                let off_m = (seen.of_model(bounds).world_from_model(point) - there).length();
                assert!(off_m < 1e-4, "{up} {axis}: {off_m}");
            }
            assert!(seen.support.is_some_and(|plane| plane.signed_distance_m(seen.position_m).abs() < 1e-5));
        }
    }
}
