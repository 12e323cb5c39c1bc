//! A box room with a lamp, and objects for it.
#![allow(dead_code, reason = "no test needs all of it")]

use lo_geometry::{Camera, Cube, Plane, Vec3};
use lo_imaging::{Image, Photo, RadianceImage};
use lo_insert::{Composite, Inserter, Instance, Placement};
use lo_mesh::{LoadOptions, Material, Model, PreparedModel};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{Frame, LitScene};

pub const LOW: Vec3 = Vec3::new(-2.0, -1.0, -4.0);
pub const HIGH: Vec3 = Vec3::new(2.0, 1.5, 1.0);
pub const WIDTH: usize = 120;
pub const HEIGHT: usize = 80;

/// Returns the distance from inside the room to its walls along a direction.
pub fn wall_distance(origin: Vec3, direction: Vec3) -> f32 {
    let (a, b) = ((LOW - origin) / direction, (HIGH - origin) / direction);
    a.max(b).min_element()
}

pub fn wall_radiance(p: Vec3) -> [f32; 3] {
    let lamp = p.y > HIGH.y - 0.01 && (p.x + 0.5).abs() < 0.4 && (p.z + 2.0).abs() < 0.4;
    if lamp { [12.0, 11.0, 10.0] } else { [0.3 + 0.1 * (3.0 * p.x).sin(), 0.4, 0.3 + 0.1 * (2.0 * p.z).cos()] }
}

/// A box room with a lamp; `photo` makes the photo from the radiance image.
pub fn scene(photo: impl Fn(RadianceImage) -> Photo) -> LitScene {
    room(photo, wall_radiance, wall_radiance)
}

/// The room with separate radiances for the octree and for the photo.
pub fn room(
    photo: impl Fn(RadianceImage) -> Photo,
    known: impl Fn(Vec3) -> [f32; 3],
    seen: impl Fn(Vec3) -> [f32; 3],
) -> LitScene {
    let points: Vec<RadiancePoint> = lo_geometry::fibonacci_sphere(400_000)
        .into_iter()
        .map(|direction| {
            let origin = 0.5 * (LOW + HIGH);
            let position_m = origin + direction * wall_distance(origin, direction);
            RadiancePoint { position_m, radiance: known(position_m), provenance: Provenance::Observed }
        })
        .collect();
    let cube = Cube::centred(0.5 * (LOW + HIGH), 5.5);
    let light = LightOctree::from_points(&points, cube, 6, 4).unwrap().0;
    let camera = Camera::from_hfov_deg(65.0, WIDTH as u32, HEIGHT as u32).unwrap();
    let point = |x: usize, y: usize| {
        let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        direction * wall_distance(Vec3::ZERO, direction)
    };
    let radiance = Image::from_fn(WIDTH, HEIGHT, |x, y| seen(point(x, y)));
    let depth_m = Image::from_fn(WIDTH, HEIGHT, |x, y| -point(x, y).z);
    let frame = Frame::new(photo(radiance), depth_m, camera, 1.0).unwrap();
    LitScene::observed_only(light, frame)
}

pub fn linear_scene() -> LitScene {
    scene(Photo::Linear)
}

/// A latitude-longitude sphere of radius 1 about the origin.
pub fn sphere(material: Material) -> PreparedModel {
    let (rows, columns) = (32, 64);
    let mut positions = Vec::new();
    for row in 0..=rows {
        let (sin, cos) = (row as f32 / rows as f32 * std::f32::consts::PI).sin_cos();
        for column in 0..columns {
            let (s, c) = (column as f32 / columns as f32 * std::f32::consts::TAU).sin_cos();
            positions.push(Vec3::new(sin * c, cos, sin * s));
        }
    }
    let mut triangles = Vec::new();
    for row in 0..rows as u32 {
        for column in 0..columns as u32 {
            let next = (column + 1) % columns as u32;
            let at = |r: u32, c: u32| r * columns as u32 + c;
            triangles.push([at(row, column), at(row, next), at(row + 1, column)]);
            triangles.push([at(row, next), at(row + 1, next), at(row + 1, column)]);
        }
    }
    PreparedModel::new(Model::from_triangles(positions, triangles, material, &LoadOptions::default()).unwrap())
}

pub fn matte() -> Material {
    Material { base_color: [0.7, 0.7, 0.7, 1.0], ..Material::default() }
}

pub fn on_floor(x: f32, z: f32, scale: f32) -> Placement {
    let support = Some(Plane { normal: Vec3::Y, offset_m: LOW.y });
    Placement { position_m: Vec3::new(x, LOW.y, z), scale, yaw_rad: 0.0, up: Vec3::Y, support }
}

pub fn in_air(centre: Vec3, radius: f32) -> Placement {
    Placement { position_m: centre - Vec3::Y * radius, scale: radius, yaw_rad: 0.0, up: Vec3::Y, support: None }
}

pub fn alone(inserter: &Inserter, model: &PreparedModel, placement: Placement) -> Composite {
    together(inserter, &[Instance::new(model, placement)])
}

pub fn together(inserter: &Inserter, instances: &[Instance]) -> Composite {
    inserter.render(instances, &mut lo_events::ignore).unwrap()
}

pub fn changed(composite: &Composite) -> impl Fn(usize) -> bool {
    |i| composite.alpha.pixels()[i] > 0.0 || composite.shadow_ratio.pixels()[i] != [1.0; 3]
}

/// A slab of `width` × `depth`, 0.1 high.
pub fn slab(width: f32, depth: f32) -> PreparedModel {
    let (low, high) = (Vec3::new(-0.5 * width, 0.0, -0.5 * depth), Vec3::new(0.5 * width, 0.1, 0.5 * depth));
    let corner = |i: usize| {
        let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        Vec3::new(pick(0), pick(1), pick(2))
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let positions = (0..8).map(corner).collect();
    PreparedModel::new(Model::from_triangles(positions, triangles, matte(), &LoadOptions::default()).unwrap())
}
