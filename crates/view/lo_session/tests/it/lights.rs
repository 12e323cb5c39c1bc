//! Lights that are dragged, suns that are aimed by shadows, and steps of several commands.

use lo_geometry::Vec3;
use lo_scene::LightChange;
use lo_session::{Command, NewLight, Session};

use crate::session::{FLOOR_M, ROOM, add, with_sphere};

const SUN: NewLight =
    NewLight::Sun { azimuth_deg: -120.0, elevation_deg: 35.0, strength: 3.0, angle_deg: 1.0, kelvin: 4000.0 };

fn direction(session: &Session) -> Vec3 {
    session.view().lights.last().unwrap().listed.direction.unwrap()
}

fn top_m(session: &Session) -> Vec3 {
    let view = session.view();
    let object = &view.objects[0];
    Vec3::from(object.position_m) + Vec3::from(object.up) * object.size_m[1]
}

#[test]
fn a_sun_follows_the_shadow_of_an_object() {
    let mut session = with_sphere();
    assert!(session.view().objects[0].shadows.is_empty());
    session.apply(&Command::AddLight { new: SUN }).unwrap();
    let before = session.view();
    let [shadow] = &before.objects[0].shadows[..] else { panic!() };
    assert_eq!(shadow.light, "A1");
    // On the floor, and on the wall just above it.
    for to in [[100.5, 85.5], [110.5, 69.2]] {
        session.preview(&Command::AimSun { light: "A1".into(), object: 1, to }).unwrap();
        let (point_m, _) = ROOM.surfaces.at_pixel(to[0], to[1]).unwrap();
        let expected = (top_m(&session) - point_m).normalize();
        assert!(direction(&session).angle_between(expected).to_degrees() < 0.1, "{to:?}");
        // The shadow is shown where it was dragged to, to the width of a pixel of this small photo.
        let view = session.view();
        let seen = view.objects[0].shadows[0].pixel;
        assert!((seen[0] - to[0]).hypot(seen[1] - to[1]) < 1.5, "{seen:?} {to:?}");
        // Strength and colour stay.
        let [sun, was] = [&view, &before].map(|view| view.lights.last().unwrap().listed.clone());
        assert_eq!((sun.irradiance, sun.color_temperature_k), (was.irradiance, was.color_temperature_k));
    }
    session.commit();
    let aimed = direction(&session);
    // The sun would be below the horizon: it stays.
    session.apply(&Command::AimSun { light: "A1".into(), object: 1, to: [72.5, 20.5] }).unwrap();
    assert_eq!(direction(&session), aimed);
    assert!(session.undo() && session.view().lights.last().unwrap().sun_deg == before.lights.last().unwrap().sun_deg);
    session.apply(&Command::TurnSun { light: "A1".into(), azimuth_deg: 90.0, elevation_deg: -5.0 }).unwrap();
    assert!(session.view().objects[0].shadows.is_empty(), "below the horizon there are no shadows");
    let off = LightChange { on: false, ..LightChange::NONE };
    session.apply(&Command::TurnSun { light: "A1".into(), azimuth_deg: 90.0, elevation_deg: 50.0 }).unwrap();
    assert_eq!(session.view().objects[0].shadows.len(), 1);
    session.apply(&Command::SetLight { light: "A1".into(), change: off }).unwrap();
    assert!(session.view().objects[0].shadows.is_empty());
}

#[test]
fn a_lamp_is_dragged_to_surfaces_which_it_touches() {
    let mut session = with_sphere();
    let lamp = NewLight::Sphere { at_m: [0.0, 0.6, -1.5], radius_m: 0.1, radiance: 40.0, kelvin: 3500.0 };
    session.apply(&Command::AddLight { new: lamp }).unwrap();
    let at = |session: &Session| session.view().lights.last().unwrap().changed.at_m;
    session.preview(&Command::DragLight { light: "A1".into(), to: [100.5, 85.5] }).unwrap();
    let on_floor = at(&session).unwrap();
    assert!((on_floor.y + FLOOR_M - 0.1).abs() < 0.01, "{on_floor}");
    session.preview(&Command::DragLight { light: "A1".into(), to: [72.5, 20.5] }).unwrap();
    let on_wall = at(&session).unwrap();
    assert!((on_wall.z + 5.9).abs() < 0.03, "{on_wall}");
    session.commit();
    assert!(session.undo());
    assert_eq!(at(&session), None);
    // Refusals and positions without depth change nothing.
    for wrong in [
        Command::DragLight { light: "A7".into(), to: [72.5, 20.5] },
        Command::AimSun { light: "A1".into(), object: 1, to: [100.5, 85.5] },
        Command::TurnSun { light: "A1".into(), azimuth_deg: 0.0, elevation_deg: 20.0 },
        Command::TurnSun { light: "A7".into(), azimuth_deg: 0.0, elevation_deg: 20.0 },
    ] {
        let before = session.state().clone();
        assert!(session.apply(&wrong).is_err(), "{wrong:?}");
        assert_eq!(session.state(), &before);
    }
    session.apply(&Command::DragLight { light: "A1".into(), to: [-5.0, 20.5] }).unwrap();
    assert_eq!(at(&session), None);
}

#[test]
fn several_commands_are_one_step() {
    let mut session = with_sphere();
    session.apply(&add("builtin:sphere", [20.5, 90.5])).unwrap();
    let before = session.state().clone();
    let drag = |object, to| Command::Drag { object, to };
    let moved = Command::Together { commands: vec![drag(1, [110.5, 90.5]), drag(2, [30.5, 90.5])] };
    session.preview(&moved).unwrap();
    session.commit();
    let apart = |session: &Session, index: usize| {
        (session.state().objects[index].placement.position_m - before.objects[index].placement.position_m).length()
    };
    assert!(apart(&session, 0) > 0.05 && apart(&session, 1) > 0.05);
    let copies =
        Command::Together { commands: vec![Command::Duplicate { object: 1 }, Command::Duplicate { object: 2 }] };
    session.apply(&copies).unwrap();
    let names: Vec<&str> = session.state().objects.iter().map(|object| object.name.as_str()).collect();
    assert_eq!(names, ["sphere", "sphere 2", "sphere 3", "sphere 4"]);
    let all = (1..=4).map(|object| Command::Delete { object }).collect();
    session.apply(&Command::Together { commands: all }).unwrap();
    assert!(session.state().objects.is_empty());
    assert!(session.undo() && session.undo() && session.undo());
    assert_eq!(session.state(), &before);
    // All or none; no steps of steps.
    for wrong in [
        vec![drag(1, [110.5, 90.5]), Command::Delete { object: 9 }],
        vec![Command::Together { commands: vec![] }],
        vec![Command::MoveKey { object: 1, from_s: 0.0, to_s: 1.0 }],
        vec![drag(1, [110.5, 90.5]); 101],
    ] {
        assert!(session.apply(&Command::Together { commands: wrong }).is_err());
        assert_eq!(session.state(), &before);
    }
}
