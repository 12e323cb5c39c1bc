//! Viewpoints of photos and positions of light probes.

use lo_geometry::{Camera, Quat, Ray, Vec2, Vec3};
use lo_mesh::PreparedModel;
use lo_random::Stream;
use lo_transport::Pose;

use crate::chance::between;
use crate::config::{SynthConfig, Tilt};
use crate::object::Object;
use crate::plan::Plan;
use crate::room_builder::Support;

/// Camera of a photo: pose and intrinsics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraPose {
    /// Position and rotation.
    pub pose: Pose,
    /// Intrinsics and image size.
    pub camera: Camera,
}

/// Oriented bounding box of a solid, for clearance tests.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SolidBox {
    pub center: Vec3,
    pub rotation: Quat,
    pub half: Vec3,
}

impl SolidBox {
    /// Distance to a point, metres; 0 inside.
    pub(crate) fn distance(&self, p: Vec3) -> f32 {
        let local = self.rotation.inverse() * (p - self.center);
        (local.abs() - self.half).max(Vec3::ZERO).length()
    }
}

/// Draws viewpoints and probe positions in the free space of a room.
pub(crate) struct ViewpointSampler<'a> {
    pub plan: &'a Plan,
    pub solids: &'a [SolidBox],
    pub model: &'a PreparedModel,
    /// Objects of the model in triangle order, the shell first.
    pub objects: &'a [Object],
}

/// Grid of rays with which a candidate view is scored.
const RAY_COLUMNS: usize = 9;
const RAY_ROWS: usize = 6;

/// Minimum and maximum number of candidate views.
const CANDIDATES: std::ops::Range<usize> = 8..60;

/// Score at which the search stops after the minimum number of candidates.
const GOOD_SCORE: f32 = 2.0;

/// Height range of cameras near the floor, metres.
const LOW_CAMERA_HEIGHT_M: [f32; 2] = [0.1, 0.5];

/// First surface along a ray.
pub(crate) struct RayHit {
    pub distance_m: f32,
    /// Index of the object; 0 for the shell and for a miss.
    pub object: usize,
    /// Sector (one of eight, by azimuth) that a wall of the shell faces; `None` for other surfaces.
    wall: Option<u8>,
}

/// Directions of the scoring rays in camera axes.
pub(crate) fn scoring_rays(camera: &Camera) -> impl Iterator<Item = Vec3> {
    (0..RAY_COLUMNS * RAY_ROWS).map(|k| {
        let u = (f64::from((k % RAY_COLUMNS) as u32) + 0.5) / RAY_COLUMNS as f64 * f64::from(camera.width);
        let v = (f64::from((k / RAY_COLUMNS) as u32) + 0.5) / RAY_ROWS as f64 * f64::from(camera.height);
        camera.direction(u, v)
    })
}

/// Draws intrinsics from the configured field of view; `upright` swaps width and height.
pub(crate) fn draw_intrinsics(random: &mut Stream, config: &SynthConfig, upright: bool) -> Camera {
    let ([low, high], [width, height]) = (config.hfov_deg, config.crop_size);
    let hfov = f64::from(between(random, low, high));
    let camera = Camera::from_hfov_deg(hfov, width, height).expect("the range was checked");
    if upright { Camera { cx: camera.cy, cy: camera.cx, width: height, height: width, ..camera } } else { camera }
}

impl ViewpointSampler<'_> {
    pub(crate) fn cast_ray(&self, origin: Vec3, direction: Vec3) -> RayHit {
        let Some(hit) = self.model.intersect_both_sides(&Ray { origin, direction }, 100.0) else {
            return RayHit { distance_m: 100.0, object: 0, wall: None };
        };
        let starts = |object: &Object| object.parts.first().is_none_or(|part| part.start <= hit.triangle as usize);
        let object = self.objects.partition_point(starts).saturating_sub(1);
        let model = self.model.model();
        let [a, b, c] = model.triangles[hit.triangle as usize].map(|v| model.positions[v as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let wall = (object == 0 && normal.y.abs() < 0.3).then(|| {
            let turn = normal.z.atan2(normal.x) / std::f32::consts::TAU;
            (8.0 * turn).round().rem_euclid(8.0) as u8
        });
        RayHit { distance_m: hit.distance_m, object, wall }
    }

    /// Whether a point is inside the room and at least `margin_m` from all solids, walls, floor and ceiling.
    pub(crate) fn is_free(&self, p: Vec3, margin_m: f32) -> bool {
        let floor = Vec2::new(p.x, p.z);
        self.plan.contains(floor, margin_m)
            && p.y > margin_m
            // A sloped ceiling can be nearest to the side.
            && [Vec2::ZERO, Vec2::X, Vec2::NEG_X, Vec2::Y, Vec2::NEG_Y]
                .into_iter()
                .all(|d| p.y < self.plan.ceiling(floor + d * margin_m) - margin_m)
            && self.solids.iter().all(|solid| solid.distance(p) >= margin_m)
    }

    /// Draws a camera that sees a good part of the room; `low` puts it near the floor.
    pub(crate) fn camera(&self, random: &mut Stream, config: &SynthConfig, upright: bool, low: bool) -> CameraPose {
        let camera = draw_intrinsics(random, config, upright);
        let mut best: Option<(f32, Pose)> = None;
        for attempt in 0..CANDIDATES.end {
            let Some(position) = self.draw_position(random, config, low) else {
                continue;
            };
            let yaw = between(random, 0.0, std::f32::consts::TAU);
            let tilt = |random: &mut Stream| between(random, -config.pitch_deg, config.pitch_deg);
            let pitch = match config.tilt {
                Tilt::Level => 0.5 * (tilt(random) + tilt(random)),
                Tilt::Uniform => tilt(random),
            };
            let pitch = pitch.to_radians();
            let roll = between(random, -config.roll_deg, config.roll_deg).to_radians();
            let rotation = Quat::from_rotation_y(yaw) * Quat::from_rotation_x(pitch) * Quat::from_rotation_z(roll);
            let pose = Pose { position, rotation };
            let score = self.score(&camera, &pose);
            if best.as_ref().is_none_or(|b| score > b.0) {
                best = Some((score, pose));
            }
            if attempt + 1 >= CANDIDATES.start && best.as_ref().is_some_and(|b| b.0 > GOOD_SCORE) {
                break;
            }
        }
        let middle = self.plan.rectangles[0];
        let center = (middle[0] + middle[1]) * 0.5;
        let pose = best
            .map_or(Pose { position: Vec3::new(center.x, 1.5, center.y), rotation: Quat::IDENTITY }, |(_, pose)| pose);
        CameraPose { pose, camera }
    }

    fn draw_position(&self, random: &mut Stream, config: &SynthConfig, low: bool) -> Option<Vec3> {
        let (min, max) = self.plan.extent();
        let ([low, high], margins) =
            if low { (LOW_CAMERA_HEIGHT_M, [0.09; 3]) } else { (config.camera_height_m, [0.35, 0.25, 0.2]) };
        for margin in margins {
            for _ in 0..30 {
                // The mean of two draws favours eye height.
                let height = 0.5 * (between(random, low, high) + between(random, low, high));
                let (x, z) = (between(random, min.x, max.x), between(random, min.y, max.y));
                let p = Vec3::new(x, height, z);
                if self.is_free(p, margin) {
                    return Some(p);
                }
            }
        }
        None
    }

    /// Scores a view by how people frame rooms.
    ///
    /// Rewards a large median distance, several objects, a corner and a window. Penalises surfaces close to the camera
    /// and a single wall that fills the image.
    fn score(&self, camera: &Camera, pose: &Pose) -> f32 {
        let rays = scoring_rays(camera).map(|direction| self.cast_ray(pose.position, pose.rotation * direction));
        let mut hits: Vec<RayHit> = rays.collect();
        hits.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        let number = hits.len() as f32;
        let share = |count: usize| count as f32 / number;
        // Half the diagonal of the room, within limits, counts as far.
        let (min, max) = self.plan.extent();
        let far = 0.5 * (max - min).length().clamp(2.0, 8.0);
        let distance = (hits[hits.len() / 2].distance_m / far).min(1.0);
        let (nearer, farther) = (hits[hits.len() / 10].distance_m, hits[hits.len() * 9 / 10].distance_m);
        let variety = (farther.min(10.0) / nearer.max(0.3)).log2().clamp(0.0, 2.0) / 2.0;
        let mut visible: Vec<usize> = hits.iter().map(|ray| ray.object).filter(|&object| object > 0).collect();
        let bulk = share(visible.len()).min(0.4) / 0.4;
        visible.sort_unstable();
        visible.dedup();
        let window = visible.iter().any(|&object| self.objects[object].name == "pane");
        let furniture = visible.iter().filter(|&&object| self.objects[object].support != Support::Building).count();
        let mut walls = [0; 8];
        hits.iter().filter_map(|ray| ray.wall).for_each(|wall| walls[usize::from(wall)] += 1);
        let corner = walls.iter().filter(|&&count| count >= 3).count() >= 2;
        let bare = share(walls.into_iter().max().unwrap_or(0));
        let near = share(hits.iter().filter(|ray| ray.distance_m < 0.7).count());
        distance
            + 0.4 * variety
            + 0.3 * bulk
            + 0.5 * (furniture.min(6) as f32 / 6.0)
            + if corner { 0.15 } else { 0.0 }
            + if window { 0.15 } else { 0.0 }
            - 2.0 * near
            - 2.0 * (bare - 0.35).max(0.0)
    }

    /// Draws a free point in the camera's frustum, in front of the visible surface and clear of all solids.
    pub(crate) fn probe(&self, random: &mut Stream, view: &CameraPose) -> Option<Vec3> {
        let (camera, pose) = (&view.camera, &view.pose);
        for margin in [0.15, 0.15, 0.15, 0.1] {
            for _ in 0..60 {
                // Near the image border, half of the probe's surroundings would be unobserved.
                let u = f64::from(between(random, 0.06, 0.94)) * f64::from(camera.width);
                let v = f64::from(between(random, 0.06, 0.94)) * f64::from(camera.height);
                let direction = pose.rotation * camera.direction(u, v);
                let depth = self.cast_ray(pose.position, direction).distance_m.min(8.0);
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
