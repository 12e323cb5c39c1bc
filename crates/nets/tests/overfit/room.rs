//! A room whose light is known in closed form: a box with striped walls and a bright ceiling lamp.

use dataset::{Metadata, NovelView, Sample};
use geometry::{Camera, Quat, Vec3};
use imaging::{DepthMap, Image};
use octree::{Coverage, RadiancePoint};

const HALF: Vec3 = Vec3::new(3.1, 1.5, 2.7);
const CENTRE: Vec3 = Vec3::new(0.4, 0.1, -1.1);

/// Radiance of the wall point at `p`, relative to the room's centre.
fn radiance(p: Vec3) -> [f32; 3] {
    let relative = p / HALF;
    let axis = (0..3).max_by(|&a, &b| relative[a].abs().total_cmp(&relative[b].abs())).unwrap();
    let base = match (axis, relative[axis] > 0.0) {
        (0, true) => [0.7, 0.2, 0.1],
        (0, false) => [0.1, 0.3, 0.7],
        (1, true) if relative.x.abs() < 0.3 && relative.z.abs() < 0.3 => return [6.0, 5.0, 4.0],
        (1, true) => [0.8, 0.8, 0.8],
        (1, false) => [0.3, 0.2, 0.1],
        (_, true) => [0.2, 0.6, 0.2],
        (_, false) => [0.5, 0.5, 0.2],
    };
    let shade = 0.8 + 0.2 * (1.3 * (p.x + p.z)).sin();
    base.map(|c| c * shade)
}

/// Distance along a direction from a point inside, relative to the centre, to the wall.
fn distance(origin: Vec3, direction: Vec3) -> f32 {
    (0..3)
        .map(|axis| {
            let wall = if direction[axis] > 0.0 { HALF[axis] } else { -HALF[axis] };
            (wall - origin[axis]) / direction[axis]
        })
        .fold(f32::INFINITY, |nearest, t| if t < nearest { t } else { nearest })
}

/// With so many panoramas of 96 × 48.
pub fn sample(views: usize) -> Sample {
    let camera = Camera::from_hfov_deg(75.0, 120, 80).unwrap();
    let seen = |x: usize, y: usize| {
        let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let point = -CENTRE + direction * distance(-CENTRE, direction);
        (radiance(point), -(point + CENTRE).z)
    };
    let mut stream = random::stream(3, "room", 0);
    let mut point = || {
        use random::RngExt;
        let mut draw = || stream.random_range(-1.0f32..1.0);
        let mut p = Vec3::new(draw(), draw(), draw());
        let areas = [HALF.y * HALF.z, HALF.x * HALF.z, HALF.x * HALF.y];
        let pick = stream.random_range(0.0..areas.iter().sum::<f32>());
        let axis = if pick < areas[0] {
            0
        } else if pick < areas[0] + areas[1] {
            1
        } else {
            2
        };
        p[axis] = p[axis].signum();
        let p = p * HALF;
        RadiancePoint { position_m: p + CENTRE, radiance: radiance(p), coverage: Coverage::Inferred }
    };
    let points = (0..60_000).map(|_| point()).collect();
    let view = |i: usize| {
        let t = i as f32;
        let position = HALF * Vec3::new(0.6 * (2.1 * t).sin(), 0.5 * (1.3 * t).cos(), 0.6 * (3.7 * t).sin());
        let pixel = |x: usize, y: usize| {
            let direction = geometry::pixel_direction(x, y, 96, 48);
            (direction, distance(position, direction))
        };
        NovelView {
            position_m: position + CENTRE,
            rotation: Quat::IDENTITY,
            radiance: Image::from_fn(96, 48, |x, y| {
                let (direction, distance) = pixel(x, y);
                radiance(position + direction * distance)
            }),
            depth_m: Some(DepthMap::from_fn(96, 48, |x, y| pixel(x, y).1)),
        }
    };
    Sample {
        id: "box".to_owned(),
        scene_id: "box".to_owned(),
        photo: Image::from_fn(120, 80, |x, y| seen(x, y).0.map(imaging::srgb8_from_linear)),
        camera,
        up: Some(Vec3::Y),
        radiance: None,
        depth_m: Some(DepthMap::from_fn(120, 80, |x, y| seen(x, y).1)),
        sensor_depth_m: None,
        normal: None,
        albedo: None,
        points,
        point_area_m2: None,
        views: (0..views).map(view).collect(),
        metadata: Metadata::new(),
    }
}
