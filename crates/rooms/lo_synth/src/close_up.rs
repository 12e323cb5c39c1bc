//! Close-up viewpoints: objects on tables, desks, shelves and the floor.

use std::f32::consts::TAU;

use lo_geometry::{Camera, Quat, Vec3};
use lo_random::Stream;
use lo_transport::Pose;

use crate::camera::{CameraPose, RayHit, ViewpointSampler, draw_intrinsics, scoring_rays};
use crate::chance::{between, weighted};
use crate::config::SynthConfig;
use crate::object::Object;
use crate::room_builder::Support;

/// Range of the distance from the camera to the target, metres; log-uniform.
const DISTANCE_M: [f32; 2] = [0.4, 1.5];
/// Minimum clearance around the camera, metres.
const CLEARANCE_M: f32 = 0.1;
/// Minimum distance of anything in the image, metres.
const MIN_SURFACE_DISTANCE_M: f32 = 0.22;
/// Range of the downward pitch towards the target, degrees.
const PITCH_DOWN_DEG: [f32; 2] = [10.0, 60.0];
/// Height above which a target counts as high, metres.
const HIGH_TARGET_M: f32 = 1.1;
const HIGH_PITCH_DOWN_DEG: [f32; 2] = [-12.0, 20.0];
/// Range of camera heights, metres.
const CAMERA_HEIGHT_M: [f32; 2] = [0.35, 2.1];
/// Number of candidate views; the best one is returned.
const CANDIDATES: usize = 40;
/// Score at which the search stops.
const GOOD_SCORE: f32 = 1.5;

impl ViewpointSampler<'_> {
    /// Draws a close-up of an object. Returns `None` if the room has no suitable object or no free camera position.
    pub(crate) fn close_up(&self, random: &mut Stream, config: &SynthConfig, upright: bool) -> Option<CameraPose> {
        let targets: Vec<(usize, f32)> =
            (0..self.objects.len()).map(|k| (k, target_weight(&self.objects[k]))).collect();
        if targets.iter().all(|target| target.1 == 0.0) {
            return None;
        }
        let camera = draw_intrinsics(random, config, upright);
        let mut best: Option<(f32, Pose)> = None;
        for _ in 0..CANDIDATES {
            let object = weighted(random, &targets);
            let target = self.point_on(random, object);
            let [low, high] = DISTANCE_M.map(f32::ln);
            let distance = between(random, low, high).exp();
            let [low, high] = if target.y > HIGH_TARGET_M { HIGH_PITCH_DOWN_DEG } else { PITCH_DOWN_DEG };
            let (down, turn) = (between(random, low, high).to_radians(), between(random, 0.0, TAU));
            let from = Vec3::new(turn.cos() * down.cos(), down.sin(), turn.sin() * down.cos());
            let position = target + from * distance;
            // The target may be off centre.
            let aside = [(); 2].map(|()| between(random, -0.25, 0.25) / camera.half_extent().max(0.5) as f32);
            let roll = between(random, -config.roll_deg, config.roll_deg).to_radians();
            let [low, high] = CAMERA_HEIGHT_M;
            if !(low..high).contains(&position.y) || !self.is_free(position, CLEARANCE_M) {
                continue;
            }
            let pose = Pose { position, rotation: look_rotation(-from, aside, roll) };
            let Some(score) = self.score_close_up(&camera, &pose, object, target) else { continue };
            if best.as_ref().is_none_or(|b| score > b.0) {
                best = Some((score, pose));
            }
            if score > GOOD_SCORE {
                break;
            }
        }
        best.map(|(_, pose)| CameraPose { pose, camera })
    }

    /// Draws a point in the central half of one of an object's parts.
    fn point_on(&self, random: &mut Stream, object: usize) -> Vec3 {
        let parts = &self.objects[object].parts;
        let part = &parts[((between(random, 0.0, 1.0) * parts.len() as f32) as usize).min(parts.len() - 1)];
        let model = self.model.model();
        let (min, max) = model.triangles[part.clone()]
            .iter()
            .flatten()
            .map(|&v| model.positions[v as usize])
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
        let share = Vec3::from_array([(); 3].map(|()| between(random, 0.25, 0.75)));
        min + (max - min) * share
    }

    /// Scores a view by the share of near surfaces and the number of objects.
    ///
    /// Returns `None` if something is too close to the camera or hides the target.
    fn score_close_up(&self, camera: &Camera, pose: &Pose, object: usize, target: Vec3) -> Option<f32> {
        let to = target - pose.position;
        let first_hit = self.cast_ray(pose.position, to.normalize());
        if first_hit.object != object && first_hit.distance_m < 0.8 * to.length() {
            return None;
        }
        let hits: Vec<RayHit> =
            scoring_rays(camera).map(|direction| self.cast_ray(pose.position, pose.rotation * direction)).collect();
        if hits.iter().any(|ray| ray.distance_m < MIN_SURFACE_DISTANCE_M) {
            return None;
        }
        let share =
            |test: &dyn Fn(&RayHit) -> bool| hits.iter().filter(|ray| test(ray)).count() as f32 / hits.len() as f32;
        let near = share(&|ray| ray.distance_m < DISTANCE_M[1]);
        let object_share = share(&|ray| ray.object > 0);
        let mut visible: Vec<usize> = hits.iter().map(|ray| ray.object).filter(|&object| object > 0).collect();
        visible.sort_unstable();
        visible.dedup();
        Some(near + 0.5 * object_share + 0.5 * (visible.len().min(6) as f32 / 6.0))
    }
}

/// Weight of an object as a target: small objects first, then furniture, never the building.
fn target_weight(object: &Object) -> f32 {
    match object.support {
        _ if object.parts.is_empty() => 0.0,
        Support::Object(_) if !object.name.contains("curtain") => 1.0,
        Support::Floor if object.name != "rug" => 0.5,
        Support::Wall if object.name.contains("shelf") => 0.5,
        _ => 0.0,
    }
}

/// Camera rotation that puts `direction` at an offset from the image centre, then rolls.
///
/// `aside` holds the tangents of the offset to the right and up.
fn look_rotation(direction: Vec3, aside: [f32; 2], roll_rad: f32) -> Quat {
    let yaw = (-direction.x).atan2(-direction.z) + aside[0].atan();
    let pitch = direction.y.clamp(-1.0, 1.0).asin() - aside[1].atan();
    Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch) * Quat::from_rotation_z(roll_rad)
}
