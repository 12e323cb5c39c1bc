//! First sizes and places of objects, and falling.

use std::sync::Arc;

use lo_geometry::Vec3;
use lo_insert::{Layout, Unit};
use lo_mesh::{LoadOptions, Model};
use lo_session::{Command, Files, ObjectPosition, ObjectSize, Session, outputs};

use crate::session::{ROOM, add};

const FLOOR_M: f32 = 1.2;
const TABLE_M: f32 = 0.7;

fn session() -> Session {
    Session::new(ROOM.clone()).unwrap()
}

/// Adds a box of a size in units of its file, and returns the name of its mesh.
fn add_box(session: &mut Session, file: &str, [x, y, z]: [f32; 3]) -> String {
    let corner = |i: usize| format!("v {} {} {}\n", x * (i & 1) as f32, y * (i >> 1 & 1) as f32, z * (i >> 2) as f32);
    let text: String = (0..8).map(corner).chain(["f 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n".to_owned()]).collect();
    let nothing = |_: &str| Err(std::io::Error::other("no part"));
    let model = Model::from_bytes("a.obj", text.as_bytes(), &nothing, &LoadOptions::default()).unwrap();
    session.add_mesh(file, model, Arc::from(text.as_bytes()), Files::new()).unwrap()
}

fn position(session: &Session, index: usize) -> Vec3 {
    session.state().objects[index].placement.position_m
}

/// Returns whether the bounding boxes of two objects overlap, seen from above.
fn overlap(session: &Session, [a, b]: [usize; 2]) -> bool {
    let objects = session.view().objects;
    let reach = |i: usize, axis: usize| 0.5 * objects[i].size_m[axis];
    [0, 2].into_iter().all(|axis| {
        let apart = (objects[a].position_m[axis] - objects[b].position_m[axis]).abs();
        apart < reach(a, axis) + reach(b, axis)
    })
}

#[test]
fn objects_at_one_pixel_stand_beside_each_other() {
    let mut session = session();
    for _ in 0..6 {
        session.apply(&add("builtin:sphere", [118.5, 88.5])).unwrap();
    }
    for a in 0..6 {
        let at = position(&session, a);
        assert!((at.y + FLOOR_M).abs() < 0.02 && session.state().objects[a].placement.support.is_some(), "{at}");
        for b in 0..a {
            assert!(!overlap(&session, [a, b]), "{a} {b}");
        }
    }
    // The first object is at the pixel.
    assert_eq!(session.state().objects[0].position, ObjectPosition::Pixel([118.5, 88.5]));
}

#[test]
fn objects_without_a_pixel_stand_beside_each_other() {
    let mut session = session();
    for _ in 0..8 {
        session.apply(&Command::Add { mesh: "builtin:sphere".into(), pixel: None, material: None }).unwrap();
    }
    for (a, b) in (0..8).flat_map(|a| (0..a).map(move |b| (a, b))) {
        let level = (position(&session, a).y - position(&session, b).y).abs() < 0.1;
        assert!(!(level && overlap(&session, [a, b])), "{a} {b}");
    }
}

#[test]
fn an_object_added_at_a_wall_touches_it() {
    let mut session = session();
    session.apply(&add("builtin:sphere", [72.5, 30.5])).unwrap();
    let view = session.view();
    let at = position(&session, 0);
    assert!((at.z + 6.0 - 0.5 * view.objects[0].size_m[2]).abs() < 0.03, "{at}");
    assert!(!view.objects[0].rests);
}

#[test]
fn sizes_follow_the_unit_of_the_file() {
    let mut session = session();
    let mut added = |file: &str, size: [f32; 3]| {
        let mesh = add_box(&mut session, file, size);
        session.apply(&Command::Add { mesh, pixel: Some([118.5, 88.5]), material: None }).unwrap();
        let object = session.view().objects.pop().unwrap();
        (object.size_m[1], object.unit, object.unit_is_stated)
    };
    // glTF is in metres. For other files, the unit is that which makes the object as large as furnishings are.
    assert_eq!(added("a.glb", [0.2, 0.4, 0.2]), (0.4, Unit::Metre.name(), true));
    assert_eq!(added("b.obj", [0.2, 0.4, 0.2]), (0.4, Unit::Metre.name(), false));
    let (height_m, unit, _) = added("c.stl", [12.0, 25.0, 9.0]);
    assert!((height_m - 0.25).abs() < 1e-6 && unit == Unit::Centimetre.name(), "{height_m} {unit}");
    let (height_m, unit, _) = added("d.stl", [120.0, 250.0, 90.0]);
    assert!((height_m - 0.25).abs() < 1e-6 && unit == Unit::Millimetre.name(), "{height_m} {unit}");
    // No unit is plausible: 30 cm along the longest side.
    assert!((added("e.ply", [1.7, 0.8, 0.6]).0 - 0.14).abs() < 1e-6);
}

#[test]
fn objects_that_would_fill_the_photo_are_smaller_at_first() {
    let mut session = session();
    let mesh = add_box(&mut session, "person.glb", [0.5, 2.0, 0.3]);
    session.apply(&Command::Add { mesh, pixel: Some([118.5, 88.5]), material: None }).unwrap();
    let camera = ROOM.estimate().frame.camera;
    let share = |session: &Session| {
        let object = &session.view().objects[0];
        camera.fy * f64::from(object.size_m[1]) / f64::from(-object.position_m[2]) / f64::from(camera.height)
    };
    assert!((share(&session) - 0.35).abs() < 0.03, "{}", share(&session));
    let ObjectSize::Height(height_m) = session.state().objects[0].size else { panic!() };
    assert!((height_m * 100.0).fract().abs() < 1e-9, "two digits: {height_m}");
    // Its real size is one command away.
    session.apply(&Command::Size { object: 1, size: ObjectSize::Scale(1.0) }).unwrap();
    assert!(share(&session) > 0.6);
}

#[test]
fn put_down_falls_along_gravity() {
    let mut session = session();
    session.apply(&add("builtin:sphere", [118.5, 88.5])).unwrap();
    let mut fall = |from: Vec3| {
        let from = ObjectPosition::Position(from.to_array().map(f64::from));
        session.apply(&Command::Place { object: 1, place: from }).unwrap();
        session.apply(&Command::PutDown { object: 1 }).unwrap();
        let fallen = position(&session, 0);
        session.apply(&Command::PutDown { object: 1 }).unwrap();
        assert!((position(&session, 0) - fallen).length() < 0.01, "a resting object stays");
        fallen
    };
    // From above the table onto it, from above the floor onto that. The surface seen behind the object is another one.
    let on_table = fall(Vec3::new(0.1, 0.1, -1.9));
    assert!((on_table - Vec3::new(0.1, -TABLE_M, -1.9)).length() < 0.04, "{on_table}");
    let on_floor = fall(Vec3::new(1.0, -0.4, -3.0));
    assert!((on_floor - Vec3::new(1.0, -FLOOR_M, -3.0)).length() < 0.04, "{on_floor}");
    // Below the table, where the photo does not show the floor.
    let behind = fall(Vec3::new(0.0, -0.9, -2.6));
    assert!((behind - Vec3::new(0.0, -FLOOR_M, -2.6)).length() < 0.04, "{behind}");
}

#[test]
fn a_dragged_object_does_not_get_behind_the_wall() {
    let mut session = session();
    session.apply(&add("builtin:sphere", [118.5, 88.5])).unwrap();
    for v in (0..90).rev() {
        session.preview(&Command::Drag { object: 1, to: [118.0, f64::from(v) + 0.5] }).unwrap();
        let at = position(&session, 0);
        assert!(at.z > -6.01, "{v}: {at}");
    }
}

#[test]
fn hidden_objects_are_left_out_of_images_but_not_of_the_scene() {
    let mut session = session();
    session.apply(&add("builtin:sphere", [118.5, 88.5])).unwrap();
    session.apply(&add("builtin:sphere", [20.5, 90.5])).unwrap();
    session.apply(&Command::Show { object: 1, is_shown: false }).unwrap();
    assert_eq!(session.state().shown_in_images().objects.len(), 1);
    assert_eq!(session.view().command.unwrap().matches("--mesh").count(), 1);
    let saved = outputs::scene(&ROOM, session.state()).unwrap();
    let layout = lightoctree::Document::from_bytes(&saved).unwrap().layout.unwrap();
    assert_eq!(Layout::objects(&layout).len(), 2);
    assert!(session.undo() && !session.view().objects[0].is_hidden);
}

#[test]
fn changes_are_unsaved_until_a_file_has_them() {
    let mut session = session();
    assert!(!session.is_unsaved());
    session.apply(&add("builtin:sphere", [118.5, 88.5])).unwrap();
    assert!(session.is_unsaved());
    session.mark_saved("new.scene".into());
    assert!(!session.is_unsaved());
    assert!(session.view().command.unwrap().contains("insert new.scene"));
    // Looking at another time changes no file.
    session.seek(1.0).unwrap();
    assert!(!session.is_unsaved());
    for change in [Command::Show { object: 1, is_shown: false }, Command::Lock { object: 1, is_locked: true }] {
        session.apply(&change).unwrap();
        assert!(session.is_unsaved() && session.undo() && !session.is_unsaved());
    }
    session.apply(&Command::FloorGloss { gloss: 0.5 }).unwrap();
    assert!(session.is_unsaved());
    session.undo();
    assert!(!session.is_unsaved());
    session.mark_unsaved();
    assert!(session.is_unsaved());
}

#[test]
fn objects_stand_in_front_of_the_wall_behind_them() {
    let mut session = session();
    // The floor 15 cm in front of the wall, which is 6 m away.
    let (u, v, _) = ROOM.estimate().frame.camera.project(Vec3::new(0.6, -FLOOR_M, -5.85)).unwrap();
    let mesh = add_box(&mut session, "chest.glb", [0.5, 0.8, 1.0]);
    session.apply(&Command::Add { mesh, pixel: Some([u, v]), material: None }).unwrap();
    let dragged = Command::Drag { object: 1, to: [u - 4.0, v] };
    for command in [None, Some(&dragged)] {
        command.map_or(Ok(()), |command| session.apply(command)).unwrap();
        let at = position(&session, 0);
        // Depth at 6 m is compared to 16 cm.
        assert!((-5.7..-5.5).contains(&at.z) && (at.y + FLOOR_M).abs() < 0.03, "{at}");
        assert!(session.view().objects[0].rests);
    }
    // Away from the wall it stays where it is put.
    session.apply(&Command::Drag { object: 1, to: [118.5, 80.5] }).unwrap();
    assert_eq!(session.state().objects[0].position, ObjectPosition::Pixel([118.5, 80.5]));
}
