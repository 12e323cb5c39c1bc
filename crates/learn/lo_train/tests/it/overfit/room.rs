//! Rooms with radiance in closed form: boxes with shaded walls and a bright lamp in the ceiling.

use lo_dataset::{Metadata, NovelView, Sample};
use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_octree::{Provenance, RadiancePoint};
use lo_random::RngExt;

/// A box-shaped room; the camera is at the origin.
pub struct BoxRoom {
    half: Vec3,
    centre: Vec3,
    /// Colours of the walls +x, −x, +y, −y, +z, −z.
    colours: [[f32; 3]; 6],
    lamp: [f32; 3],
    /// Centre of the lamp, relative to half the edges of the ceiling.
    lamp_at: [f32; 2],
}

impl BoxRoom {
    pub const USUAL: Self = Self {
        half: Vec3::new(3.1, 1.5, 2.7),
        centre: Vec3::new(0.4, 0.1, -1.1),
        colours: [[0.7, 0.2, 0.1], [0.1, 0.3, 0.7], [0.8; 3], [0.3, 0.2, 0.1], [0.2, 0.6, 0.2], [0.5, 0.5, 0.2]],
        lamp: [6.0, 5.0, 4.0],
        lamp_at: [0.0; 2],
    };

    /// Draws a room of random size and colours.
    pub fn drawn(index: u64) -> Self {
        let mut stream = lo_random::stream(5, "box rooms", index);
        let mut draw = |low: f32, high: f32| stream.random_range(low..high);
        let half = Vec3::new(draw(1.6, 3.4), draw(1.2, 1.7), draw(1.6, 3.4));
        Self {
            half,
            centre: half * Vec3::new(draw(-0.4, 0.4), draw(-0.2, 0.2), draw(-0.6, 0.0)),
            colours: std::array::from_fn(|_| std::array::from_fn(|_| draw(0.1, 0.9))),
            lamp: std::array::from_fn(|_| draw(3.0, 8.0)),
            lamp_at: [draw(-0.6, 0.6), draw(-0.6, 0.6)],
        }
    }

    /// Returns the radiance of the wall at `p`, relative to the room's centre.
    fn radiance(&self, p: Vec3) -> [f32; 3] {
        let relative = p / self.half;
        let axis = (0..3).max_by(|&a, &b| relative[a].abs().total_cmp(&relative[b].abs())).unwrap();
        let [x, z] = [relative.x - self.lamp_at[0], relative.z - self.lamp_at[1]];
        if axis == 1 && relative.y > 0.0 && x.abs() < 0.3 && z.abs() < 0.3 {
            return self.lamp;
        }
        let shade = 0.8 + 0.2 * (1.3 * (p.x + p.z)).sin();
        self.colours[2 * axis + usize::from(relative[axis] <= 0.0)].map(|c| c * shade)
    }

    /// Returns the distance to the wall from a point inside, relative to the centre.
    fn distance(&self, origin: Vec3, direction: Vec3) -> f32 {
        (0..3)
            .map(|axis| {
                let wall = if direction[axis] > 0.0 { self.half[axis] } else { -self.half[axis] };
                (wall - origin[axis]) / direction[axis]
            })
            .fold(f32::INFINITY, |nearest, t| if t < nearest { t } else { nearest })
    }

    /// Draws a point uniformly on the walls, relative to the centre.
    fn wall_point(&self, stream: &mut impl RngExt) -> Vec3 {
        let half = self.half;
        let mut p = Vec3::from_array(std::array::from_fn(|_| stream.random_range(-1.0f32..1.0)));
        let areas = [half.y * half.z, half.x * half.z, half.x * half.y];
        let pick = stream.random_range(0.0..areas.iter().sum::<f32>());
        let axis = if pick < areas[0] {
            0
        } else if pick < areas[0] + areas[1] {
            1
        } else {
            2
        };
        p[axis] = p[axis].signum();
        p * half
    }

    /// Returns a sample with `views` panoramas of 96 × 48 pixels.
    pub fn sample(&self, views: usize) -> Sample {
        let Self { half, centre, .. } = *self;
        let camera = Camera::from_hfov_deg(75.0, 120, 80).unwrap();
        let seen = |x: usize, y: usize| {
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let point = -centre + direction * self.distance(-centre, direction);
            (self.radiance(point), -(point + centre).z)
        };
        let mut stream = lo_random::stream(3, "room", 0);
        let point = |p: Vec3| {
            let (position_m, radiance) = (p + centre, self.radiance(p));
            RadiancePoint { position_m, radiance, provenance: Provenance::Inferred }
        };
        let points = (0..60_000).map(|_| point(self.wall_point(&mut stream))).collect();
        let view = |i: usize| {
            let t = i as f32;
            let position = half * Vec3::new(0.6 * (2.1 * t).sin(), 0.5 * (1.3 * t).cos(), 0.6 * (3.7 * t).sin());
            let pixel = |x: usize, y: usize| {
                let direction = lo_geometry::pixel_direction(x, y, 96, 48);
                (direction, self.distance(position, direction))
            };
            NovelView {
                position_m: position + centre,
                rotation: Quat::IDENTITY,
                radiance: Image::from_fn(96, 48, |x, y| {
                    let (direction, distance) = pixel(x, y);
                    self.radiance(position + direction * distance)
                }),
                depth_m: Some(DepthMap::from_fn(96, 48, |x, y| pixel(x, y).1)),
            }
        };
        Sample {
            id: "box".to_owned(),
            scene_id: "box".to_owned(),
            photo: Image::from_fn(120, 80, |x, y| seen(x, y).0.map(lo_imaging::srgb8_from_linear)),
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
}
