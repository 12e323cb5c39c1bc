//! Images of a moving camera: the same as a scene that was made from there.

use lo_geometry::{Camera, Cube, Quat, RigidTransform, Vec3};
use lo_imaging::{Image, Photo};
use lo_insert::{Composite, Inserter, Instance, Lighting, Placement, Plate, Quality};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{Frame, LitScene};

use crate::box_room::{HEIGHT, HIGH, LOW, WIDTH, linear_scene, matte, on_floor, sphere, wall_distance, wall_radiance};

/// Returns photo and depth of the box room from a camera.
fn frame(room_from_camera: &RigidTransform) -> Frame {
    let camera = Camera::from_hfov_deg(65.0, WIDTH as u32, HEIGHT as u32).unwrap();
    let seen = |x: usize, y: usize| {
        let local = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let direction = room_from_camera.direction(local);
        let distance_m = wall_distance(room_from_camera.translation_m, direction);
        (wall_radiance(room_from_camera.translation_m + direction * distance_m), -local.z * distance_m)
    };
    let photo = Photo::Linear(Image::from_fn(WIDTH, HEIGHT, |x, y| seen(x, y).0));
    Frame::new(photo, Image::from_fn(WIDTH, HEIGHT, |x, y| seen(x, y).1), camera, 1.0).unwrap()
}

fn plate(room_from_camera: RigidTransform) -> Plate {
    let neighbours = [room_from_camera; 2];
    Plate { frame: frame(&room_from_camera), distorted: None, room_from_camera, neighbours, predicted_depth: false }
}

fn aside() -> RigidTransform {
    let rotation = Quat::from_rotation_y(0.35) * Quat::from_rotation_x(-0.15) * Quat::from_rotation_z(0.05);
    RigidTransform { rotation, translation_m: Vec3::new(0.6, 0.1, -0.3) }
}

fn render(inserter: &Inserter, placement: Placement) -> Composite {
    let model = sphere(matte());
    inserter.render(&[Instance::new(&model, placement)], &mut lo_events::ignore).unwrap()
}

#[test]
fn a_plate_from_the_scenes_own_camera_is_its_photo() {
    let scene = linear_scene();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let placement = on_floor(0.2, -2.5, 0.4);
    let (own, on_plate) = (
        render(&inserter, placement),
        render(&inserter.on_plate(&Plate { frame: scene.frame.clone(), ..plate(RigidTransform::IDENTITY) }), placement),
    );
    let off = |a: &[f32; 3], b: &[f32; 3]| (Vec3::from(*a) - Vec3::from(*b)).abs().max_element();
    let worst = own
        .image
        .clone()
        .into_radiance()
        .pixels()
        .iter()
        .zip(on_plate.image.clone().into_radiance().pixels())
        .map(|(a, b)| off(a, b))
        .fold(0.0, f32::max);
    assert!(worst < 1e-4, "{worst}");
}

/// The box room as a scene in the axes of another camera.
fn scene_from(room_from_camera: &RigidTransform) -> LitScene {
    let camera_from_room = room_from_camera.inverse();
    let middle = 0.5 * (LOW + HIGH);
    let points: Vec<RadiancePoint> = lo_geometry::fibonacci_sphere(400_000)
        .into_iter()
        .map(|direction| {
            let position = middle + direction * wall_distance(middle, direction);
            let position_m = camera_from_room.point(position);
            RadiancePoint { position_m, radiance: wall_radiance(position), provenance: Provenance::Observed }
        })
        .collect();
    // The box, turned, in a cube with leaves of about the same size.
    let cube = Cube::centred(camera_from_room.point(middle), 7.0);
    let light = LightOctree::from_points(&points, cube, 6, 4).unwrap().0;
    LitScene::observed_only(light, frame(room_from_camera))
}

#[test]
fn a_plate_from_aside_is_the_scene_made_from_there() {
    let aside = aside();
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Normal).unwrap();
    let placement = on_floor(0.2, -2.5, 0.4);
    let on_plate = render(&inserter.on_plate(&plate(aside)), placement);

    let there = Inserter::new(&scene_from(&aside), Lighting::Octree, Quality::Normal).unwrap();
    let back = aside.inverse();
    let turned = Placement {
        position_m: back.point(placement.position_m),
        // A sphere has no heading.
        up: back.direction(placement.up),
        support: placement.support.map(|plane| plane.moved(&back)),
        ..placement
    };
    let truth = render(&there, turned);

    let same = on_plate.alpha.pixels().iter().zip(truth.alpha.pixels()).filter(|(a, b)| (*a - *b).abs() > 0.3).count();
    assert!(same < 8, "{same} pixels are covered in one of them only");
    let mean = |composite: &Composite| {
        let (sum, alpha) = composite
            .object
            .pixels()
            .iter()
            .zip(composite.alpha.pixels())
            .fold((Vec3::ZERO, 0.0), |(sum, alpha), (object, a)| (sum + Vec3::from(*object), alpha + a));
        sum / alpha
    };
    let (a, b) = (mean(&on_plate), mean(&truth));
    // The octrees have other leaves.
    assert!(((a - b) / b).abs().max_element() < 0.06, "{a} and {b}");
    let ratios = on_plate.shadow_ratio.pixels().iter().zip(truth.shadow_ratio.pixels());
    let (off, count) =
        ratios.filter(|(_, b)| b[1] < 0.97).fold((0.0, 0), |(off, n), (a, b)| (off + (a[1] - b[1]).abs(), n + 1));
    assert!(count > 100 && off / (count as f32) < 0.04, "{count}: {}", off / count as f32);
}

#[test]
fn nothing_flickers_while_the_camera_moves() {
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Normal).unwrap();
    let placement = on_floor(0.2, -2.5, 0.4);
    // A point of the floor in the sphere's shadow, and one on the sphere's top.
    let (floor, top) = (Vec3::new(0.75, LOW.y, -2.45), placement.position_m + Vec3::Y * 0.79);
    let (mut ratios, mut tops) = (Vec::new(), Vec::new());
    for step in 0..7 {
        let along = step as f32 / 6.0;
        let rotation = Quat::from_rotation_y(0.2 - 0.3 * along) * Quat::from_rotation_x(-0.2 - 0.1 * along);
        let pose = RigidTransform { rotation, translation_m: Vec3::new(0.3 - 0.5 * along, 0.3 * along, 0.2) };
        let plate = plate(pose);
        let composite = render(&inserter.on_plate(&plate), placement);
        let pixel = |point: Vec3| {
            let (u, v, _) = plate.frame.camera.project(pose.inverse().point(point)).unwrap();
            (u as usize, v as usize)
        };
        ratios.push(composite.shadow_ratio[pixel(floor)][1]);
        tops.push(composite.object[pixel(top)][1] / composite.alpha[pixel(top)]);
    }
    let spread = |values: &[f32]| {
        let (low, high) = values.iter().fold((f32::INFINITY, 0.0f32), |(low, high), &v| (low.min(v), high.max(v)));
        (high - low) / high
    };
    // Pixels are coarse: the points move within one by up to 3 cm.
    assert!(ratios[0] < 0.95 && spread(&ratios) < 0.05, "{ratios:?}");
    assert!(spread(&tops) < 0.05, "{tops:?}");
}

#[test]
fn motion_is_that_of_the_camera() {
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Draft).unwrap().with_passes();
    let placement = on_floor(0.2, -2.5, 0.4);
    let pose = aside();
    let next = RigidTransform { translation_m: pose.translation_m + Vec3::X * 0.05, ..pose };
    let plate = Plate { neighbours: [pose, next], ..plate(pose) };
    let composite = render(&inserter.on_plate(&plate), placement);
    let passes = composite.passes.unwrap();
    let camera = plate.frame.camera;
    let mut compared = 0;
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            if passes.depth_m[(x, y)] == 0.0 {
                continue;
            }
            // Positions are in the room.
            let point = Vec3::from(passes.position_m[(x, y)]);
            let at = |pose: &RigidTransform| camera.project(pose.inverse().point(point)).unwrap();
            let ((u, v, depth_m), (next_u, next_v, _)) = (at(&pose), at(&next));
            let [forward_u, forward_v, ..] = passes.motion_px.as_ref().unwrap()[(x, y)];
            assert!((f64::from(forward_u) - (next_u - u)).abs() < 0.01, "{forward_u} {}", next_u - u);
            assert!((f64::from(forward_v) + (next_v - v)).abs() < 0.01, "{forward_v} {}", next_v - v);
            assert!((depth_m as f32 - passes.depth_m[(x, y)]).abs() < 1e-3);
            compared += 1;
        }
    }
    assert!(compared > 200, "{compared}");
}
