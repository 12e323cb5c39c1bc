//! The room scaled to a known length; hidden and locked objects in scenes.

use std::sync::Arc;

use lightoctree::{Document, KnownLength};
use lo_geometry::Vec3;
use lo_session::{Command, NewLight, ObjectPosition, OpenScene, Session, insert_argv, outputs};

use crate::session::{FLOOR_M, ROOM, add, with_sphere};

/// The front edge of the table, 1 m long and 1.6 m ahead.
fn table_edge(length_m: f64) -> KnownLength {
    let camera = ROOM.estimate().frame.camera;
    let ends = [-0.49, 0.49].map(|x| {
        let (u, v, _) = camera.project(Vec3::new(x, -0.7, -1.7)).unwrap();
        [u, v]
    });
    KnownLength { ends, length_m }
}

#[test]
fn a_known_length_scales_the_room_and_not_the_objects() {
    let mut session = with_sphere();
    session.apply(&Command::Place { object: 1, place: ObjectPosition::Position([0.4, -0.5, -2.0]) }).unwrap();
    session.apply(&add("builtin:sphere", [20.5, 90.5])).unwrap();
    let lamp = NewLight::Sphere { at_m: [0.0, 0.6, -1.5], radius_m: 0.1, radiance: 40.0, kelvin: 3500.0 };
    session.apply(&Command::AddLight { new: lamp }).unwrap();
    session.mark_saved("room.scene".into());
    let (before, scene) = (session.state().clone(), session.scene().clone());
    let known = table_edge(2.0);
    let factor = known.factor(ROOM.estimate()).unwrap();
    assert!((factor / (2.0 / 0.98) - 1.0).abs() < 0.05, "{factor}");
    session.apply(&Command::KnownLength { known: Some(known) }).unwrap();
    let view = session.view();
    assert_eq!((view.known_length, view.room_scale), (Some(known), factor));
    assert!(session.scene().extent().floor_m / scene.extent().floor_m > 0.98 * factor);
    let camera = scene.estimate().frame.camera;
    for (now, was) in session.state().objects.iter().zip(&before.objects) {
        let pixel = |at: Vec3| camera.project(at).map(|(u, v, _)| [u, v]).unwrap();
        let [a, b] = [now, was].map(|object| pixel(object.placement.position_m));
        assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 0.5, "{a:?} {b:?}");
        assert_eq!(now.placement.scale, was.placement.scale);
    }
    assert!((session.state().objects[1].placement.position_m.y / (-FLOOR_M * factor) - 1.0).abs() < 0.02);
    assert_eq!(session.state().lights.added[0].light.centre_m(), Some(Vec3::new(0.0, 0.6, -1.5) * factor));
    // The command line scales the file's room; with its lights, which need not be saved again.
    assert!(view.unsaved && !view.edited);
    let [from, to] = known.ends;
    let list = format!("{},{},{},{},2", from[0], from[1], to[0], to[1]);
    assert!(view.command.unwrap().contains(&format!(" --known-length {list} ")));
    // A saved scene has the scale itself.
    let bytes = outputs::scene(session.scene(), session.state()).unwrap();
    let saved = Document::from_bytes(&bytes).unwrap();
    assert_eq!(saved.estimate, session.scene().document.estimate);
    let reopened = Session::new(Arc::new(OpenScene::new("new.scene", saved))).unwrap();
    for (a, b) in reopened.state().objects.iter().zip(&session.state().objects) {
        assert_eq!((a.position, a.placement), (b.position, b.placement));
    }
    session.mark_saved("new.scene".into());
    assert!(!session.view().command.unwrap().contains("--known-length") && !session.is_unsaved());
    // Undo restores everything; then the file has another scale.
    assert!(session.undo());
    assert_eq!(session.state(), &before);
    assert!(Arc::ptr_eq(session.scene(), &scene));
    assert!(session.view().edited && session.is_unsaved());
    assert!(session.redo() && session.scene().scale == factor && !session.view().edited);
    session.apply(&Command::KnownLength { known: None }).unwrap();
    assert!(Arc::ptr_eq(session.scene(), &scene));
}

#[test]
fn senseless_lengths_are_refused() {
    let mut session = with_sphere();
    let before = session.state().clone();
    let ends = table_edge(1.0).ends;
    for (ends, length_m) in
        [(ends, 0.0), (ends, f64::NAN), (ends, 900.0), ([ends[0]; 2], 1.0), ([[-3.0, 5.0], ends[1]], 1.0)]
    {
        let known = Some(KnownLength { ends, length_m });
        assert!(session.apply(&Command::KnownLength { known }).is_err(), "{ends:?} {length_m}");
        let together = Command::Together { commands: vec![Command::KnownLength { known: None }] };
        assert!(session.apply(&together).is_err());
        assert_eq!(session.state(), &before);
    }
}

#[test]
fn scenes_keep_what_is_hidden_and_locked() {
    let mut session = with_sphere();
    session.apply(&add("builtin:sphere", [20.5, 90.5])).unwrap();
    session.mark_saved("room.scene".into());
    session.apply(&Command::Show { object: 1, is_shown: false }).unwrap();
    assert!(session.is_unsaved());
    session.apply(&Command::Lock { object: 2, is_locked: true }).unwrap();
    let bytes = outputs::scene(session.scene(), session.state()).unwrap();
    let saved = Document::from_bytes(&bytes).unwrap();
    let layout = saved.layout.clone().unwrap();
    let [first, second] = layout.objects() else { panic!() };
    assert_eq!([first.hidden, first.locked, second.hidden, second.locked], [true, false, false, true]);
    let reopened = Session::new(Arc::new(OpenScene::new("room.scene", saved))).unwrap();
    let kept: Vec<[bool; 2]> =
        reopened.state().objects.iter().map(|object| [object.is_hidden, object.is_locked]).collect();
    assert_eq!(kept, [[true, false], [false, true]]);
    // Images and the command line have the other one alone.
    let shown = layout.without_hidden().unwrap();
    assert_eq!(shown.objects().len(), 1);
    let words = insert_argv("room.scene", &reopened.state().shown_in_images()).unwrap();
    assert_eq!(words.iter().filter(|word| *word == "--mesh").count(), 1);
}
