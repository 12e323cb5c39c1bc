//! Where photos are taken from, and where light probes may be asked for.

use geometry::{Camera, Quat, Ray, Vec2, Vec3};
use mesh::PreparedModel;
use random::Stream;
use transport::Pose;

use crate::chance::between;
use crate::config::SynthConfig;
use crate::plan::Plan;

/// A photo's camera and place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    /// Where it stands and looks.
    pub pose: Pose,
    /// Lens and size.
    pub camera: Camera,
}

/// A box around one solid, for asking whether a point is free.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SolidBox {
    pub center: Vec3,
    pub rotation: Quat,
    pub half: Vec3,
}

impl SolidBox {
    /// Distance from a point; 0 inside.
    pub(crate) fn distance(&self, p: Vec3) -> f32 {
        let local = self.rotation.inverse() * (p - self.center);
        (local.abs() - self.half).max(Vec3::ZERO).length()
    }
}

/// What is needed to choose viewpoints.
pub(crate) struct Space<'a> {
    pub plan: &'a Plan,
    pub solids: &'a [SolidBox],
    pub model: &'a PreparedModel,
    /// The first so many triangles are floor, walls and ceiling.
    pub shell: usize,
}

/// Rays of a coarse picture.
const COLUMNS: usize = 9;
const ROWS: usize = 6;

impl Space<'_> {
    /// Distance to the next surface, and whether it is more than bare wall. Behind panes is no free space.
    fn depth(&self, origin: Vec3, direction: Vec3) -> (f32, bool) {
        let hit = self.model.intersect_both_sides(&Ray { origin, direction }, 100.0);
        hit.map_or((100.0, false), |hit| (hit.distance_m, hit.triangle as usize >= self.shell))
    }

    /// Whether a point is inside the room and at least `margin_m` from all solids, walls, floor and ceiling.
    pub(crate) fn is_free(&self, p: Vec3, margin_m: f32) -> bool {
        let floor = Vec2::new(p.x, p.z);
        self.plan.contains(floor, margin_m)
            && p.y > margin_m
            // Steep ceilings come near sideways.
            && [Vec2::ZERO, Vec2::X, Vec2::NEG_X, Vec2::Y, Vec2::NEG_Y]
                .into_iter()
                .all(|d| p.y < self.plan.ceiling(floor + d * margin_m) - margin_m)
            && self.solids.iter().all(|solid| solid.distance(p) >= margin_m)
    }

    /// A camera that sees a good part of the room.
    pub(crate) fn camera(&self, random: &mut Stream, config: &SynthConfig) -> CameraPose {
        let [low, high] = config.hfov_deg;
        let camera = {
            let hfov = f64::from(between(random, low, high));
            Camera::from_hfov_deg(hfov, config.crop_size[0], config.crop_size[1]).expect("the range was checked")
        };
        let mut best: Option<(f32, Pose)> = None;
        for attempt in 0..40 {
            let Some(position) = self.standpoint(random, config) else {
                continue;
            };
            let yaw = between(random, 0.0, std::f32::consts::TAU);
            let pitch = between(random, -config.pitch_deg, config.pitch_deg).to_radians();
            let roll = between(random, -config.roll_deg, config.roll_deg).to_radians();
            let rotation = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch) * Quat::from_rotation_z(roll);
            let pose = Pose { position, rotation };
            let score = self.score(&camera, &pose);
            if best.as_ref().is_none_or(|b| score > b.0) {
                best = Some((score, pose));
            }
            // Good enough, after a look around.
            if attempt >= 5 && best.as_ref().is_some_and(|b| b.0 > 0.95) {
                break;
            }
        }
        let middle = self.plan.rectangles[0];
        let center = (middle[0] + middle[1]) * 0.5;
        let pose = best
            .map_or(Pose { position: Vec3::new(center.x, 1.5, center.y), rotation: Quat::IDENTITY }, |(_, pose)| pose);
        CameraPose { pose, camera }
    }

    fn standpoint(&self, random: &mut Stream, config: &SynthConfig) -> Option<Vec3> {
        let (least, most) = self.plan.extent();
        let [low, high] = config.camera_height_m;
        for margin in [0.35, 0.25, 0.2] {
            for _ in 0..30 {
                // Eye height most of the time: the mean of two draws.
                let height = 0.5 * (between(random, low, high) + between(random, low, high));
                let (x, z) = (between(random, least.x, most.x), between(random, least.y, most.y));
                let p = Vec3::new(x, height, z);
                if self.is_free(p, margin) {
                    return Some(p);
                }
            }
        }
        None
    }

    /// How much of the room a view shows: depth, variety of depth, things, nothing right before the lens.
    fn score(&self, camera: &Camera, pose: &Pose) -> f32 {
        let (mut sum, mut near, mut squares, mut things) = (0.0, 0.0, 0.0, 0.0);
        for k in 0..COLUMNS * ROWS {
            let u = (f64::from((k % COLUMNS) as u32) + 0.5) / COLUMNS as f64 * f64::from(camera.width);
            let v = (f64::from((k / COLUMNS) as u32) + 0.5) / ROWS as f64 * f64::from(camera.height);
            let (depth, thing) = self.depth(pose.position, pose.rotation * camera.direction(u, v));
            let depth = depth.min(8.0);
            things += if thing { 1.0 } else { 0.0 };
            let value = (depth / 0.5).ln();
            sum += value;
            squares += value * value;
            near += if depth < 0.6 { 1.0 } else { 0.0 };
        }
        let number = (COLUMNS * ROWS) as f32;
        let mean = sum / number;
        let variety = (squares / number - mean * mean).max(0.0).sqrt();
        0.3 * mean + 0.5 * variety.min(0.6) + (things / number).min(0.45) - 2.0 * near / number
    }

    /// A free point that the photo sees: in its frustum, before the surface at its pixel, not nearer than `margin_m` to anything.
    pub(crate) fn probe(&self, random: &mut Stream, view: &CameraPose) -> Option<Vec3> {
        let (camera, pose) = (&view.camera, &view.pose);
        for margin in [0.15, 0.15, 0.15, 0.1] {
            for _ in 0..60 {
                // Not at the very border, where half of the probe's surroundings are unseen anyway.
                let u = f64::from(between(random, 0.06, 0.94)) * f64::from(camera.width);
                let v = f64::from(between(random, 0.06, 0.94)) * f64::from(camera.height);
                let direction = pose.rotation * camera.direction(u, v);
                let depth = self.depth(pose.position, direction).0.min(8.0);
                if depth < 0.6 {
                    continue;
                }
                let p = pose.position + direction * between(random, 0.35, (depth - margin).max(0.36));
                if self.is_free(p, margin) {
                    return Some(p);
                }
            }
        }
        None
    }
}
