//! Close-up viewpoints: objects on tables, desks, shelves and the floor.

use std::f32::consts::TAU;

use lo_geometry::{Camera, Quat, Vec3};
use lo_random::Stream;
use lo_transport::Pose;

use crate::camera::{CameraPose, Seen, Space, coarse_rays, lens};
use crate::chance::{between, weighted};
use crate::config::SynthConfig;
use crate::object::Object;
use crate::stage::Support;

/// Range of the distance from the camera to the target, metres; log-uniform.
const DISTANCE_M: [f32; 2] = [0.4, 1.5];
/// Minimum clearance around the camera, metres.
const FREE_M: f32 = 0.1;
/// Minimum distance of anything in the image, metres.
const NEAREST_M: f32 = 0.22;
/// Range of the downward pitch towards the target, degrees.
const DOWN_DEG: [f32; 2] = [10.0, 60.0];
/// Height above which a target counts as high, metres.
const HIGH_M: f32 = 1.1;
const HIGH_DOWN_DEG: [f32; 2] = [-12.0, 20.0];
/// Range of camera heights, metres.
const HELD_M: [f32; 2] = [0.35, 2.1];
/// Number of candidate views; the best one is returned.
const LOOKS: usize = 40;
/// Score at which the search stops.
const GOOD_VIEW: f32 = 1.5;

impl Space<'_> {
    /// Draws a close-up of an object. Returns `None` if the room has no suitable object or no free camera position.
    pub(crate) fn close_up(&self, random: &mut Stream, config: &SynthConfig, upright: bool) -> Option<CameraPose> {
        let things: Vec<(usize, f32)> = (0..self.objects.len()).map(|k| (k, interest(&self.objects[k]))).collect();
        if things.iter().all(|thing| thing.1 == 0.0) {
            return None;
        }
        let camera = lens(random, config, upright);
        let mut best: Option<(f32, Pose)> = None;
        for _ in 0..LOOKS {
            let object = weighted(random, &things);
            let target = self.place_on(random, object);
            let [low, high] = DISTANCE_M.map(f32::ln);
            let distance = between(random, low, high).exp();
            let [low, high] = if target.y > HIGH_M { HIGH_DOWN_DEG } else { DOWN_DEG };
            let (down, turn) = (between(random, low, high).to_radians(), between(random, 0.0, TAU));
            let from = Vec3::new(turn.cos() * down.cos(), down.sin(), turn.sin() * down.cos());
            let position = target + from * distance;
            // The target may be off centre.
            let aside = [(); 2].map(|()| between(random, -0.25, 0.25) / camera.half_extent().max(0.5) as f32);
            let roll = between(random, -config.roll_deg, config.roll_deg).to_radians();
            let [low, high] = HELD_M;
            if !(low..high).contains(&position.y) || !self.is_free(position, FREE_M) {
                continue;
            }
            let pose = Pose { position, rotation: towards(-from, aside, roll) };
            let Some(score) = self.score_close_up(&camera, &pose, object, target) else { continue };
            if best.as_ref().is_none_or(|b| score > b.0) {
                best = Some((score, pose));
            }
            if score > GOOD_VIEW {
                break;
            }
        }
        best.map(|(_, pose)| CameraPose { pose, camera })
    }

    /// Draws a point in the central half of one of an object's parts.
    fn place_on(&self, random: &mut Stream, object: usize) -> Vec3 {
        let parts = &self.objects[object].parts;
        let part = &parts[((between(random, 0.0, 1.0) * parts.len() as f32) as usize).min(parts.len() - 1)];
        let model = self.model.model();
        let (least, most) = model.triangles[part.clone()]
            .iter()
            .flatten()
            .map(|&v| model.positions[v as usize])
            .fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(a, b), p| (a.min(p), b.max(p)));
        let share = Vec3::from_array([(); 3].map(|()| between(random, 0.25, 0.75)));
        least + (most - least) * share
    }

    /// Scores a view by the share of near surfaces and the number of objects.
    ///
    /// Returns `None` if something is too close to the camera or hides the target.
    fn score_close_up(&self, camera: &Camera, pose: &Pose, object: usize, target: Vec3) -> Option<f32> {
        let to = target - pose.position;
        let met = self.look(pose.position, to.normalize());
        if met.object != object && met.distance_m < 0.8 * to.length() {
            return None;
        }
        let seen: Vec<Seen> =
            coarse_rays(camera).map(|direction| self.look(pose.position, pose.rotation * direction)).collect();
        if seen.iter().any(|ray| ray.distance_m < NEAREST_M) {
            return None;
        }
        let share =
            |test: &dyn Fn(&Seen) -> bool| seen.iter().filter(|ray| test(ray)).count() as f32 / seen.len() as f32;
        let near = share(&|ray| ray.distance_m < DISTANCE_M[1]);
        let things = share(&|ray| ray.object > 0);
        let mut kinds: Vec<usize> = seen.iter().map(|ray| ray.object).filter(|&object| object > 0).collect();
        kinds.sort_unstable();
        kinds.dedup();
        Some(near + 0.5 * things + 0.5 * (kinds.len().min(6) as f32 / 6.0))
    }
}

/// Weight of an object as a target: small objects first, then furniture, never the building.
fn interest(object: &Object) -> f32 {
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
fn towards(direction: Vec3, aside: [f32; 2], roll_rad: f32) -> Quat {
    let yaw = (-direction.x).atan2(-direction.z) + aside[0].atan();
    let pitch = direction.y.clamp(-1.0, 1.0).asin() - aside[1].atan();
    Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch) * Quat::from_rotation_z(roll_rad)
}
