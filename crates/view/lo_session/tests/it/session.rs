//! Sessions in a small room with exact depth: a floor, a table on it, and a wall.

use std::sync::{Arc, LazyLock};

use lightoctree::{Document, EstimateOptions, Estimator, Input, LightMode, LightPurpose};
use lo_events as events;
use lo_geometry::{Camera, Plane, Ray, Vec3};
use lo_imaging::{DepthMap, Image, Photo};
use lo_insert::{Align, Interpolation, Quality};
use lo_mesh::{LoadOptions, Model};
use lo_random::{RngExt, Stream};
use lo_scene::{Completion, Frame, LightChange, SceneFile, SceneObjects};
use lo_session::{
    Command, Files, LitSceneCache, NewLight, ObjectMaterial, ObjectPosition, ObjectSize, OpenScene, Overlay, Probe,
    RenderStep, Renderer, Sequence, Session, SessionError, State, insert_argv, outputs, overlay, probe_position,
};

use crate::inferred::INFERRED;

pub const SIZE: (usize, usize) = (144, 96);
/// Height of the camera above the floor and the tabletop.
pub const FLOOR_M: f32 = 1.2;
const TABLE_M: f32 = 0.7;

/// Depth of the floor, of a table 1 m wide whose edge is 1.6 m from the camera, and of a wall.
fn depth_m(camera: &Camera, x: usize, y: usize) -> f32 {
    let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(x as f64 + 0.5, y as f64 + 0.5) };
    let to = |plane: Plane| {
        plane.intersect(&ray).filter(|distance_m| *distance_m > 0.0).map(|distance_m| ray.at(distance_m))
    };
    let table = to(Plane::through(Vec3::new(0.0, -TABLE_M, 0.0), Vec3::Y))
        .filter(|point| (-0.5..=0.5).contains(&point.x) && (-2.2..=-1.6).contains(&point.z));
    let floor = to(Plane::through(Vec3::new(0.0, -FLOOR_M, 0.0), Vec3::Y));
    let wall = to(Plane::through(Vec3::new(0.0, 0.0, -6.0), Vec3::Z));
    [table, floor, wall].into_iter().flatten().map(|point| -point.z).fold(f32::INFINITY, f32::min)
}

pub static ROOM: LazyLock<Arc<OpenScene>> = LazyLock::new(|| {
    let (width, height) = SIZE;
    let camera = Camera::from_hfov_deg(65.0, width as u32, height as u32).unwrap();
    let depth_m = DepthMap::from_fn(width, height, |x, y| depth_m(&camera, x, y));
    let photo =
        Image::from_fn(width, height, |x, y| if depth_m[(x, y)] > 5.9 { [150, 160, 170] } else { [90, 85, 80] });
    let frame = Frame::new(Photo::Srgb8(photo), depth_m, camera, 1.0).unwrap();
    let options =
        EstimateOptions { completion: Some(Completion::Shell), up: Some(Vec3::Y), ..EstimateOptions::default() };
    let estimator = Estimator::without_networks();
    let scene = estimator.estimate(Input::MeasuredDepth(frame), &options, &mut events::ignore).unwrap();
    Arc::new(OpenScene::new("room.scene", scene))
});

fn session() -> Session {
    Session::new(ROOM.clone()).unwrap()
}

pub fn add(mesh: &str, pixel: [f64; 2]) -> Command {
    Command::Add { mesh: mesh.to_owned(), pixel: Some(pixel), material: None }
}

/// Creates a session with a sphere on the floor, right of the table.
pub fn with_sphere() -> Session {
    let mut session = session();
    session.apply(&add("builtin:sphere", [125.5, 90.5])).unwrap();
    session
}

#[test]
fn objects_stand_where_they_are_put_and_are_named() {
    let mut session = with_sphere();
    session.apply(&add("builtin:sphere", [20.5, 90.5])).unwrap();
    session.apply(&Command::Add { mesh: "builtin:suzanne".into(), pixel: None, material: None }).unwrap();
    let names: Vec<&str> = session.state().objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["sphere", "sphere 2", "suzanne"]);
    let sphere = &session.state().objects[0];
    // The floor is fitted to 144 × 96 readings: accurate to 1 cm.
    assert!((sphere.placement.position_m.y + FLOOR_M).abs() < 0.01, "{}", sphere.placement.position_m);
    assert!(sphere.placement.support.is_some());
    assert!(matches!(session.state().objects[2].size, ObjectSize::Height(_)));
    session.apply(&Command::Duplicate { object: 1 }).unwrap();
    let [first, .., copy] = &session.state().objects[..] else { panic!() };
    assert_eq!((copy.name.as_str(), copy.size), ("sphere 3", first.size));
    let apart_m = (copy.placement.position_m - first.placement.position_m).length();
    assert!((0.15..0.6).contains(&apart_m), "{apart_m}");
}

#[test]
fn invalid_commands_are_refused_and_change_nothing() {
    let mut session = with_sphere();
    session.apply(&add("builtin:sphere", [20.5, 90.5])).unwrap();
    let before = session.state().clone();
    let nan = f64::NAN;
    let refused = [
        Command::Delete { object: 9 },
        add("builtin:teapot", [1.0, 1.0]),
        add("/etc/passwd", [1.0, 1.0]),
        add("builtin:sphere", [1000.0, 1.0]),
        Command::Place { object: 1, place: ObjectPosition::Position([nan, 0.0, 0.0]) },
        Command::Place { object: 1, place: ObjectPosition::Position([1e9, 0.0, 0.0]) },
        Command::Size { object: 1, size: ObjectSize::Scale(0.0) },
        Command::Size { object: 1, size: ObjectSize::Height(f64::INFINITY) },
        Command::Turn { object: 1, yaw_deg: nan },
        Command::Rename { object: 1, name: "sphere 2".into() },
        Command::Material {
            object: 1,
            material: Some(ObjectMaterial { preset: Some("golf".into()), ..Default::default() }),
        },
        Command::Material { object: 1, material: Some(ObjectMaterial { roughness: Some(2.0), ..Default::default() }) },
        Command::FloorGloss { gloss: 1.5 },
        Command::SetLight { light: "L99".into(), change: LightChange { scale: 2.0, ..LightChange::NONE } },
        Command::RemoveLight { light: "A1".into() },
        Command::AddLight { new: NewLight::Sphere { at_m: [0.0; 3], radius_m: -1.0, radiance: 1.0, kelvin: 4000.0 } },
    ];
    for command in &refused {
        assert!(session.apply(command).is_err(), "{command:?}");
        assert!(session.preview(command).is_err(), "{command:?}");
        assert_eq!(session.state(), &before, "{command:?}");
    }
}

#[test]
fn a_dragged_object_keeps_to_its_level_at_depth_edges() {
    let mut session = with_sphere();
    let drag = |session: &mut Session, u: f64, v: f64| {
        session.preview(&Command::Drag { object: 1, to: [u, v] }).unwrap();
        session.state().objects[0].placement.position_m
    };
    // Along the floor beside the table, back and forth.
    for u in [120.0, 130.0, 138.0, 12.0, 5.0] {
        let at = drag(&mut session, u, 82.0);
        assert!((at.y + FLOOR_M).abs() < 0.02, "{u}: {at}");
    }
    session.commit();
    // Onto the table: at its edge it stays on the floor's level, in the middle it is on the tabletop.
    let camera = ROOM.estimate().frame.camera;
    let table = |x: f32, z: f32| camera.project(Vec3::new(x, -TABLE_M, z)).unwrap();
    let (edge_u, edge_v, _) = table(-0.495, -1.9);
    let at_edge = drag(&mut session, edge_u, edge_v);
    assert!((at_edge.y + FLOOR_M).abs() < 0.05, "{at_edge}");
    let (u, v, _) = table(0.0, -1.9);
    let on_table = drag(&mut session, u, v);
    assert!((on_table.y + TABLE_M).abs() < 0.02, "{on_table}");
    // From there to the table's edge it stays on the tabletop.
    let back_at_edge = drag(&mut session, edge_u, edge_v);
    assert!((back_at_edge.y + TABLE_M).abs() < 0.05, "{back_at_edge}");
    // It touches the wall under the pointer, 6 m away, and returns to the floor from there.
    let at_wall = drag(&mut session, 72.0, 40.0);
    let radius_m = 0.5 * session.view().objects[0].size_m[2];
    assert!((at_wall.z + 6.0 - radius_m).abs() < 0.03 && at_wall.y > 0.3, "{at_wall}");
    let (u, v, _) = camera.project(at_wall).unwrap();
    assert!((u - 72.0).abs() < 0.05 && (v - 40.0).abs() < 0.05, "{u} {v}");
    session.commit();
    let on_floor = drag(&mut session, 120.0, 82.0);
    assert!((on_floor.y + FLOOR_M).abs() < 0.02, "{on_floor}");
    session.cancel();
    assert_eq!(session.state().objects[0].placement.position_m, at_wall);
}

#[test]
fn a_lifted_object_stays_as_high_as_it_is() {
    let mut session = with_sphere();
    let at = session.state().objects[0].placement.position_m + Vec3::Y * 0.4;
    session
        .apply(&Command::Place { object: 1, place: ObjectPosition::Position(at.to_array().map(f64::from)) })
        .unwrap();
    for (u, v) in [(110.0, 70.0), (60.0, 72.0), (130.0, 80.0)] {
        session.preview(&Command::Drag { object: 1, to: [u, v] }).unwrap();
        let moved = session.state().objects[0].placement.position_m;
        assert!((moved.y - at.y).abs() < 1e-3, "{moved}");
        let (seen_u, seen_v, _) = ROOM.estimate().frame.camera.project(moved).unwrap();
        assert!((seen_u - u).abs() < 0.1 && (seen_v - v).abs() < 0.1, "{seen_u} {seen_v}");
    }
}

#[test]
fn a_gesture_is_one_step() {
    let mut session = with_sphere();
    let before = session.state().clone();
    for u in 100..120 {
        session.preview(&Command::Drag { object: 1, to: [f64::from(u), 84.0] }).unwrap();
    }
    let after = session.state().clone();
    session.commit();
    assert_ne!(before, after);
    assert!(session.undo());
    assert_eq!(session.state(), &before);
    assert!(session.redo());
    assert_eq!(session.state(), &after);
    // Neither a cancelled gesture nor one that ends where it began adds a step.
    session.preview(&Command::Turn { object: 1, yaw_deg: 40.0 }).unwrap();
    session.cancel();
    session.preview(&Command::Turn { object: 1, yaw_deg: 40.0 }).unwrap();
    session.preview(&Command::Turn { object: 1, yaw_deg: 0.0 }).unwrap();
    session.commit();
    assert_eq!(session.state(), &after);
    assert!(session.undo());
    assert_eq!(session.state(), &before);
}

#[test]
fn the_light_is_edited_and_undone() {
    let mut session = with_sphere();
    let sun = NewLight::Sun { azimuth_deg: 30.0, elevation_deg: 50.0, strength: 3.0, angle_deg: 1.0, kelvin: 5500.0 };
    session.apply(&Command::AddLight { new: sun }).unwrap();
    let view = session.view();
    let light = view.lights.last().unwrap();
    assert_eq!(light.listed.id, "A1");
    let [azimuth, elevation] = light.sun_deg.unwrap();
    assert!((azimuth - 30.0).abs() < 1e-3 && (elevation - 50.0).abs() < 1e-3);
    assert!((light.listed.irradiance.unwrap() / 3.0 - 1.0).abs() < 1e-3);
    session
        .apply(&Command::SetLight { light: "A1".into(), change: LightChange { on: false, ..LightChange::NONE } })
        .unwrap();
    assert!(!session.view().lights.last().unwrap().changed.on && session.view().edited);
    session.apply(&Command::ResetLights).unwrap();
    assert!(session.state().lights.is_empty() && !session.view().edited);
    (0..3).for_each(|_| assert!(session.undo()));
    assert!(session.state().lights.is_empty());
}

#[test]
fn images_are_refined_and_can_be_cancelled() {
    let session = with_sphere();
    let mut renderer = Renderer::new(Arc::new(LitSceneCache::new(ROOM.clone())));
    let draft = renderer.render(session.state(), RenderStep::Moving, &mut events::ignore).unwrap();
    let last = renderer.render(session.state(), RenderStep::Final, &mut events::ignore).unwrap();
    assert_eq!((draft.image.width(), last.image.width()), (SIZE.0, SIZE.0));
    let shown = last.alpha.pixels().iter().filter(|alpha| **alpha > 0.5).count();
    assert!((20..2000).contains(&shown), "{shown} pixels of a sphere");
    let mut events_received = 0;
    let stop = &mut |_| {
        events_received += 1;
        if events_received > 3 { std::ops::ControlFlow::Break(()) } else { std::ops::ControlFlow::Continue(()) }
    };
    let error = renderer.render(session.state(), RenderStep::Final, stop).unwrap_err();
    assert!(error.is_cancelled() && events_received == 4, "{error}");
    assert!(matches!(
        renderer.render(&State::default(), RenderStep::Moving, &mut events::ignore),
        Err(SessionError::NoObjects)
    ));
    // The same state gives the same bytes.
    let again = renderer.render(session.state(), RenderStep::Final, &mut events::ignore).unwrap();
    assert_eq!(outputs::image(&last).unwrap(), outputs::image(&again).unwrap());
}

#[test]
fn lights_reach_the_picture_and_a_scene_keeps_them() {
    let mut session = with_sphere();
    let scenes = Arc::new(LitSceneCache::new(ROOM.clone()));
    let mut renderer = Renderer::new(scenes.clone());
    let mean = |renderer: &mut Renderer, state: &State| {
        let composite = renderer.render(state, RenderStep::Moving, &mut events::ignore).unwrap();
        let sum: f32 = composite.object.pixels().iter().map(|rgb| rgb[1]).sum();
        sum / composite.alpha.pixels().iter().sum::<f32>()
    };
    let before = mean(&mut renderer, session.state());
    let lamp = NewLight::Sphere { at_m: [0.8, 0.0, -1.8], radius_m: 0.1, radiance: 50.0, kelvin: 4000.0 };
    session.apply(&Command::AddLight { new: lamp }).unwrap();
    let after = mean(&mut renderer, session.state());
    assert!(after > 1.2 * before, "{before} {after}");
    let bytes = outputs::scene(&ROOM, session.state()).unwrap();
    let scene = Document::from_bytes(&bytes).unwrap();
    let reopened = Session::new(Arc::new(OpenScene::new("room.scene", scene))).unwrap();
    assert_eq!(reopened.state().lights, session.state().lights);
    assert!(!reopened.view().edited);
    // As `insert` lights it.
    let mut document = ROOM.document.clone();
    document.light_edits = session.state().lights.clone();
    let lit = document.lit(LightPurpose::Objects { at_m: Vec3::ZERO }).unwrap();
    assert_eq!(*scenes.lit(session.state()).unwrap(), lit);
}

#[test]
fn probes_and_overlays_show_the_room() {
    let session = with_sphere();
    let scenes = Arc::new(LitSceneCache::new(ROOM.clone()));
    let at = probe_position(&ROOM, [125.5, 90.5], 0.1).unwrap();
    assert!((at.y + FLOOR_M - 0.1).abs() < 0.02, "{at}");
    assert!(probe_position(&ROOM, [-4.0, 3.0], 0.1).is_none());
    let pictures = Probe::new(scenes.clone()).images(session.state(), at, 32, 0.0).unwrap();
    assert_eq!((pictures.panorama.width(), pictures.ball.width(), pictures.provenance.width()), (64, 32, 64));
    let bright = pictures.panorama.pixels().iter().filter(|rgb| rgb[1] > 40).count();
    assert!(bright > 1000, "{bright} of 2048 pixels are lit");
    let exr = Probe::exr(&scenes, session.state(), at, 32).unwrap();
    let panorama = lo_imaging::radiance_from_bytes(&exr, "light.exr").unwrap();
    assert_eq!((panorama.width(), panorama.height()), (64, 32));
    for what in [Overlay::Depth, Overlay::Normals, Overlay::Levels, Overlay::Provenance] {
        let made = overlay(&ROOM, what).unwrap();
        let known = made.image.pixels().iter().filter(|rgba| rgba[3] == 255).count();
        assert!(known > SIZE.0 * SIZE.1 * 8 / 10, "{what:?}: {known} pixels");
        assert!(made.legend.len() >= 2, "{what:?}");
    }
    // The camera's view is observed in the photo.
    let origins = overlay(&ROOM, Overlay::Provenance).unwrap();
    let photo = origins.legend[0].0;
    let shown = origins.image.pixels().iter().filter(|rgba| rgba[..3] == photo).count();
    assert!(shown > SIZE.0 * SIZE.1 * 7 / 10, "{shown}");
}

#[test]
fn the_command_line_tells_all_objects() {
    let mut session = with_sphere();
    assert_eq!(insert_argv("room.scene", &State::default()), None);
    session.apply(&Command::Place { object: 1, place: ObjectPosition::Position([0.25, -0.5, -2.0]) }).unwrap();
    session.apply(&Command::Turn { object: 1, yaw_deg: -30.0 }).unwrap();
    session.apply(&Command::Align { object: 1, align: Align::None }).unwrap();
    let chrome = ObjectMaterial { preset: Some("chrome".into()), roughness: Some(0.3), ..ObjectMaterial::default() };
    session.apply(&Command::Material { object: 1, material: Some(chrome) }).unwrap();
    session.apply(&Command::FloorGloss { gloss: 0.5 }).unwrap();
    assert_eq!(
        lo_session::insert_command("my room.scene", session.state()).unwrap(),
        "lightoctree insert 'my room.scene' --mesh builtin:sphere --at 0.25,-0.5,-2 --yaw-deg -30 --align none \
         --material '{\"preset\":\"chrome\",\"roughness\":0.3}' --floor-gloss 0.5 --quality high -o picture.png"
    );
    let layout = outputs::layout(session.state()).unwrap();
    let read = lo_insert::Layout::from_json(std::str::from_utf8(&layout).unwrap()).unwrap();
    assert_eq!(read, session.state().layout().unwrap());
}

/// Generates a command, valid or not.
fn command(random: &mut Stream) -> Command {
    let object = random.random_range(1..5);
    let pixel = [random.random_range(0.0..150.0), random.random_range(30.0..96.0)];
    let share = random.random_range(-0.2..1.2f32);
    let time_s = f64::from(random.random_range(-1..8i32)) / 2.0;
    match random.random_range(0..26) {
        0 | 1 => add("builtin:sphere", pixel),
        2 => Command::Duplicate { object },
        3 => Command::Delete { object },
        4 | 5 => Command::Drag { object, to: pixel },
        6 => Command::Place { object, place: ObjectPosition::Pixel(pixel) },
        7 => Command::Place { object, place: ObjectPosition::Position([pixel[0] / 75.0 - 1.0, -0.5, -2.0]) },
        8 => Command::Turn { object, yaw_deg: 5.0 * pixel[0] - 300.0 },
        9 => Command::Size { object, size: ObjectSize::Scale(2.0 * f64::from(share)) },
        10 => Command::Rename { object, name: ["a", "b", ""][random.random_range(0..3)].to_owned() },
        11 => {
            let material = ObjectMaterial { roughness: Some(share), ..ObjectMaterial::default() };
            Command::Material { object, material: Some(material) }
        }
        12 => Command::FloorGloss { gloss: share },
        14 | 15 => Command::SetKey { object, time_s },
        16 => Command::MoveKey { object, from_s: time_s, to_s: f64::from(share) },
        17 => Command::DeleteKey { object, time_s },
        18 => Command::Interpolate { object, interpolation: Interpolation::CatmullRom },
        20 => Command::InferredLight {
            light: [LightMode::Even, LightMode::Expected, LightMode::Plausible][object as usize % 3],
        },
        21 => Command::Contrast { factor: 3.0 * share },
        22 => match random.random_range(0..3) {
            0 => Command::White { pixel: Some(pixel) },
            1 => Command::White { pixel: None },
            _ => Command::Warmth { ev: 10.0 * share - 5.0 },
        },
        23 => Command::PutDown { object },
        24 => Command::Show { object, is_shown: share < 0.5 },
        25 => Command::Lock { object, is_locked: share < 0.5 },
        19 => Command::Frames { frames: Some(random.random_range(0..9)), fps: random.random_range(0..30) },
        _ => match random.random_range(0..3) {
            0 => Command::AddLight {
                new: NewLight::Sun {
                    azimuth_deg: 0.0,
                    elevation_deg: 90.0 * share,
                    strength: 1.0,
                    angle_deg: 1.0,
                    kelvin: 5000.0,
                },
            },
            1 => Command::RemoveLight { light: "A1".into() },
            _ => Command::ResetLights,
        },
    }
}

#[test]
fn every_step_can_be_undone_and_redone() {
    let (mut done, mut refused) = (0, 0);
    for index in 0..60 {
        let mut random = lo_random::stream(11, "session", index);
        let mut session = Session::new(if index % 2 == 0 { ROOM.clone() } else { INFERRED.clone() }).unwrap();
        let beginning = session.state().clone();
        for _ in 0..random.random_range(1..40) {
            let before = session.state().clone();
            let tried = match random.random_range(0..15) {
                0..4 => session.apply(&command(&mut random)),
                4..7 => session.preview(&command(&mut random)),
                7 => {
                    session.commit();
                    assert_eq!(session.state(), &before);
                    Ok(())
                }
                8 => {
                    session.cancel();
                    Ok(())
                }
                13 | 14 => {
                    session.commit();
                    let kept = session.state().clone();
                    let sought = session.seek(random.random_range(-0.2..4.0));
                    let back = session.state().at(kept.time_s, ROOM.estimate()).unwrap();
                    assert_eq!(back, kept, "seeking changes nothing else");
                    if sought.is_err() {
                        assert_eq!(session.state(), &kept);
                    }
                    Ok(())
                }
                9 | 10 => {
                    session.undo();
                    Ok(())
                }
                _ => {
                    session.redo();
                    Ok(())
                }
            };
            if tried.is_err() {
                assert_eq!(session.state(), &before, "a refused command changes nothing");
            }
            done += usize::from(tried.is_ok());
            refused += usize::from(tried.is_err());
            // Names are unique, and the command line can express every state.
            let state = session.state();
            assert!(state.objects.is_empty() || state.layout().is_ok(), "{state:?}");
            assert!(
                state.lights.inferred.is_none_or(|inferred| inferred.tuning.invalid_field().is_none()),
                "{state:?}"
            );
        }
        session.commit();
        while session.redo() {}
        let end = session.state().clone();
        let mut steps = Vec::new();
        while session.undo() {
            steps.push(session.state().clone());
        }
        // Seeking is not a step.
        assert_eq!(session.state().at(beginning.time_s, ROOM.estimate()).unwrap(), beginning);
        for step in steps.iter().rev() {
            assert_eq!(session.state(), step);
            assert!(session.redo());
        }
        assert_eq!(session.state(), &end);
        // Placements follow from positions.
        for object in &end.objects {
            assert_eq!(&object.clone().placed(ROOM.estimate(), end.time_s).unwrap(), object);
        }
    }
    assert!(done > 300 && refused > 100, "{done} done, {refused} refused");
}

/// A tetrahedron as OBJ whose colour is in another file.
const OBJ: &[u8] =
    b"mtllib a.mtl\nusemtl red\nv 0 0 0\nv 0.3 0 0\nv 0 0.3 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
const MTL: &[u8] = b"newmtl red\nKd 1 0 0\n";

fn add_obj(session: &mut Session) {
    let resolve = |_: &str| Ok(MTL.to_vec());
    let model = Model::from_bytes("a.obj", OBJ, &resolve, &LoadOptions::default()).unwrap();
    let parts = Files::from([("a.mtl".to_owned(), Arc::from(MTL))]);
    assert_eq!(session.add_mesh("a.obj", model, Arc::from(OBJ), parts).unwrap(), "a.obj");
    session.apply(&add("a.obj", [40.5, 88.5])).unwrap();
}

#[test]
fn a_scene_opens_again_as_it_was() {
    let mut session = with_sphere();
    add_obj(&mut session);
    let chrome = ObjectMaterial { preset: Some("chrome".into()), roughness: Some(0.3), ..ObjectMaterial::default() };
    session.apply(&Command::Material { object: 1, material: Some(chrome) }).unwrap();
    session.apply(&Command::Turn { object: 2, yaw_deg: 33.3 }).unwrap();
    session.apply(&Command::Rename { object: 2, name: "red one".into() }).unwrap();
    session.apply(&Command::FloorGloss { gloss: 0.25 }).unwrap();
    for (time_s, u) in [(0.0, 125.5), (2.0, 60.5)] {
        session.seek(time_s).unwrap();
        session.apply(&Command::SetKey { object: 1, time_s }).unwrap();
        session.apply(&Command::Place { object: 1, place: ObjectPosition::Pixel([u, 90.5]) }).unwrap();
    }
    session.apply(&Command::Frames { frames: Some(9), fps: 12 }).unwrap();
    session.seek(0.75).unwrap();
    let bytes = outputs::scene(&ROOM, session.state()).unwrap();
    let scene = Document::from_bytes(&bytes).unwrap();
    assert_eq!(scene.meshes.keys().collect::<Vec<_>>(), ["a.obj", "a.obj/a.mtl"]);
    let open = Arc::new(OpenScene::new("room.scene", scene));
    let mut again = Session::new(open.clone()).unwrap();
    // Everything except the identity of the meshes.
    let told = |state: &State| {
        let placements: Vec<_> = state.objects.iter().map(|object| (object.id, object.placement)).collect();
        let numbers = (state.floor_gloss, state.frames, state.fps, state.time_s);
        (state.layout().unwrap(), placements, state.lights.clone(), numbers)
    };
    assert_eq!(told(again.state()), told(session.state()));
    assert!(!again.undo());
    let picture = |open: &Arc<OpenScene>, state: &State| {
        let mut renderer = Renderer::new(Arc::new(LitSceneCache::new(open.clone())));
        outputs::image(&renderer.render(state, RenderStep::Final, &mut events::ignore).unwrap()).unwrap()
    };
    assert!(picture(&open, again.state()) == picture(&ROOM, session.state()));
    assert!(outputs::scene(&open, again.state()).unwrap() == bytes);
    // After the objects are deleted, the file has no trace of them.
    [1, 2].iter().for_each(|&object| again.apply(&Command::Delete { object }).unwrap());
    again.apply(&Command::FloorGloss { gloss: 0.0 }).unwrap();
    again.apply(&Command::Frames { frames: None, fps: 24 }).unwrap();
    again.seek(0.0).unwrap();
    assert!(outputs::scene(&open, again.state()).unwrap() == ROOM.document.to_bytes("lightoctree estimate").unwrap());
}

#[test]
fn unsupported_objects_of_a_scene_are_named() {
    let wrong = |change: &dyn Fn(&mut SceneObjects), what: &str| {
        let mut session = with_sphere();
        add_obj(&mut session);
        let mut file = SceneFile::from_bytes(&outputs::scene(&ROOM, session.state()).unwrap()).unwrap();
        change(&mut file.objects);
        let error = match Document::from_bytes(&file.to_bytes("tests").unwrap()) {
            Ok(document) => Session::new(Arc::new(OpenScene::new("room.scene", document))).err().unwrap().to_string(),
            Err(error) => error.to_string(),
        };
        assert!(error.contains(what), "{error}");
    };
    wrong(&|objects| drop(objects.files.remove("a.obj")), "a needs a.obj");
    wrong(&|objects| objects.layout = "[".into(), "the scene's objects: layout");
    wrong(&|objects| objects.layout = objects.layout.replace("builtin:sphere", "builtin:ball"), "builtin:ball");
    wrong(&|objects| objects.layout = objects.layout.replace("builtin:sphere", "/etc/passwd"), "/etc/passwd");
    wrong(&|objects| drop(objects.files.insert("a.obj".into(), Arc::from(&b"v 0"[..]))), "a.obj");
    let material = r#","material":{"base_color_texture":"/etc/passwd"}}]"#;
    wrong(&|objects| objects.layout = objects.layout.replace("}]", material), "/etc/passwd");
    let carried = r#","on":"sphere"}]"#;
    wrong(&|objects| objects.layout = objects.layout.replace("}]", carried), "\"on\"");
    let path = r#""path":"/etc/passwd"}]"#;
    wrong(&|objects| objects.layout = format!(r#"[{{"mesh":"builtin:sphere",{path}"#), "/etc/passwd");
}

#[test]
fn keyframes_are_what_the_command_line_reads() {
    let mut session = with_sphere();
    let place = |session: &Session| session.state().objects[0].position;
    session.apply(&Command::SetKey { object: 1, time_s: 0.0 }).unwrap();
    // Moving it at another time adds a keyframe.
    session.seek(2.0).unwrap();
    session.preview(&Command::Drag { object: 1, to: [122.0, 88.0] }).unwrap();
    session.preview(&Command::Drag { object: 1, to: [120.25, 88.5] }).unwrap();
    session.commit();
    session.apply(&Command::Turn { object: 1, yaw_deg: 370.0 }).unwrap();
    let path = session.state().objects[0].path.clone().unwrap();
    let told: Vec<_> = path.keyframes.iter().map(|key| (key.time_s, key.pixel, key.yaw_deg)).collect();
    assert_eq!(told, [(0.0, Some([125.5, 90.5]), 0.0), (2.0, Some([120.25, 88.5]), 370.0)]);
    assert_eq!(place(&session), ObjectPosition::Pixel([120.25, 88.5]));
    // Between keyframes it is where `insert` places it.
    session.apply(&Command::Frames { frames: None, fps: 2 }).unwrap();
    let state = session.state().clone();
    assert_eq!((state.span_s(), state.sequence_frames()), (Some([0.0, 2.0]), 5));
    let models = [&**state.objects[0].mesh.plain()];
    let frames = state.layout().unwrap().placements(ROOM.estimate(), &models, 5).unwrap();
    for (frame, time_s) in [0.0, 0.5, 1.0, 1.5, 2.0].into_iter().enumerate() {
        session.seek(time_s).unwrap();
        assert_eq!(session.state().objects[0].placement, frames[0][frame]);
    }
    assert_eq!(
        lo_session::insert_command("room.scene", session.state()).unwrap(),
        "lightoctree insert room.scene --layout objects.json --frames 5 --fps 2 -o video.y4m"
    );
    // The image at a time equals that frame.
    let scenes = LitSceneCache::new(ROOM.clone());
    let sequence = Sequence::new(&scenes, session.state(), Quality::High).unwrap();
    session.seek(0.5).unwrap();
    let mut renderer = Renderer::new(Arc::new(LitSceneCache::new(ROOM.clone())));
    let shown = renderer.render(session.state(), RenderStep::Final, &mut events::ignore).unwrap();
    assert!(shown.image == sequence.render(1, &mut events::ignore).unwrap().image);
    // Within a gesture, `from_s` is the time before the gesture.
    for to_s in [1.0, 0.0, 3.5] {
        session.preview(&Command::MoveKey { object: 1, from_s: 2.0, to_s }).unwrap();
    }
    session.commit();
    assert_eq!(session.state().span_s(), Some([0.0, 3.5]));
    // Two undos: the moved keyframe, and the frame rate, each at the time of its step.
    assert!(session.undo() && session.undo());
    assert_eq!((session.state().span_s(), session.state().time_s, session.state().fps), (Some([0.0, 2.0]), 2.0, 24));
    for time_s in [0.0, 2.0] {
        session.apply(&Command::DeleteKey { object: 1, time_s }).unwrap();
    }
    assert_eq!(session.state().objects[0].path, None);
    assert_eq!((place(&session), session.state().objects[0].yaw_deg), (ObjectPosition::Pixel([120.25, 88.5]), 370.0));
    assert!(matches!(Sequence::new(&scenes, session.state(), Quality::Draft), Err(SessionError::NothingMoves)));
    for refused in [
        Command::DeleteKey { object: 1, time_s: 0.0 },
        Command::MoveKey { object: 1, from_s: 0.0, to_s: 1.0 },
        Command::SetKey { object: 1, time_s: f64::NAN },
        Command::SetKey { object: 1, time_s: 3601.0 },
        Command::Interpolate { object: 1, interpolation: Interpolation::Linear },
        Command::Frames { frames: Some(0), fps: 24 },
    ] {
        assert!(session.apply(&refused).is_err(), "{refused:?}");
    }
}
