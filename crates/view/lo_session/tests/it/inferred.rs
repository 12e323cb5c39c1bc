//! The choice of light for unobserved regions.

use std::sync::{Arc, LazyLock};

use lightoctree::{Document, Estimate, InferredLight, LightMode, LightPurpose, LightTuning, LitScene};
use lo_geometry::Quat;
use lo_imaging::{Image, Photo, RadianceImage};
use lo_scene::LightEffect;
use lo_scene::{Completion, EstimateOrigin, ExpectedLight, Frame, LightChange};
use lo_session::{Command, LitSceneCache, OpenScene, Session, SessionError, insert_argv, insert_command, outputs};

use crate::session::{ROOM, SIZE, add};

/// The room of `session.rs` with expected light from the upper right. The photo's left corner is black, the right one
/// clipped.
pub static INFERRED: LazyLock<Arc<OpenScene>> =
    LazyLock::new(|| Arc::new(OpenScene::new("room.scene", scene(Some(expected())))));

fn expected() -> ExpectedLight {
    let radiance = RadianceImage::from_fn(64, 32, |x, y| {
        let near = (-0.02 * ((x as f32 - 44.0).powi(2) + (y as f32 - 8.0).powi(2))).exp();
        [0.2 + 6.0 * near, 0.2 + 5.0 * near, 0.2 + 3.5 * near]
    });
    ExpectedLight::new(&radiance, Quat::IDENTITY, 3.0)
}

fn scene(expected: Option<ExpectedLight>) -> Estimate {
    let plain = ROOM.estimate().clone();
    let Photo::Srgb8(photo) = &plain.frame.photo else { panic!("expected an 8-bit photo") };
    let photo = Image::from_fn(SIZE.0, SIZE.1, |x, y| match (x, y) {
        (0..8, 0..8) => [0; 3],
        (136.., 0..8) => [255; 3],
        at => photo[at],
    });
    let frame = Frame { photo: Photo::Srgb8(photo), ..plain.frame.clone() };
    let origin = EstimateOrigin { completion: Completion::Network, ..plain.origin.clone() };
    Estimate { frame, origin, expected, ..plain }
}

fn session() -> Session {
    Session::new(INFERRED.clone()).unwrap()
}

fn chosen(session: &Session) -> InferredLight {
    session.view().inferred_light.chosen
}

/// Consecutive commands, each with the resulting choice.
fn steps() -> [(Command, InferredLight); 6] {
    let usual = LightTuning::default();
    let white = Some([60.5, 80.5]);
    let plausible = |tuning| InferredLight { light: LightMode::Plausible, tuning };
    let tuned = LightTuning { contrast: 0.7, warmth_ev: -0.5, white };
    [
        (Command::Contrast { factor: 0.7 }, plausible(LightTuning { contrast: 0.7, ..usual })),
        (Command::Warmth { ev: -0.5 }, plausible(LightTuning { contrast: 0.7, warmth_ev: -0.5, ..usual })),
        (Command::White { pixel: white }, plausible(tuned)),
        (
            Command::InferredLight { light: LightMode::Expected },
            InferredLight { light: LightMode::Expected, tuning: tuned },
        ),
        (
            Command::White { pixel: None },
            InferredLight { light: LightMode::Expected, tuning: LightTuning { white: None, ..tuned } },
        ),
        (
            Command::InferredLight { light: LightMode::Even },
            InferredLight { light: LightMode::Even, tuning: LightTuning { white: None, ..tuned } },
        ),
    ]
}

#[test]
fn each_message_is_a_step_of_the_history() {
    let mut session = session();
    assert_eq!(
        (chosen(&session), session.view().inferred_light.effect),
        (InferredLight::default(), LightEffect::Expected)
    );
    for (command, wanted) in steps() {
        let before = session.state().clone();
        session.preview(&command).unwrap();
        assert_eq!(chosen(&session), wanted, "{command:?}");
        session.cancel();
        assert_eq!(session.state(), &before);
        session.apply(&command).unwrap();
        assert_eq!(chosen(&session), wanted, "{command:?}");
        assert!(session.undo());
        assert_eq!(session.state(), &before);
        assert!(session.redo());
        assert_eq!(chosen(&session), wanted, "{command:?}");
    }
    // The tuning is kept while a light without effect is chosen.
    session.apply(&Command::InferredLight { light: LightMode::Plausible }).unwrap();
    assert_eq!(session.state().inferred_light().tuning.contrast, 0.7);
    session.apply(&Command::ResetLights).unwrap();
    assert_eq!((chosen(&session), session.state().lights.is_empty()), (InferredLight::default(), true));
    // A whole drag is one step; one that ends where it began is none.
    for factor in [1.2, 1.6, 2.0] {
        session.preview(&Command::Contrast { factor }).unwrap();
    }
    session.commit();
    session.preview(&Command::Contrast { factor: 0.0 }).unwrap();
    session.preview(&Command::Contrast { factor: 2.0 }).unwrap();
    session.commit();
    assert_eq!(chosen(&session).tuning.contrast, 2.0);
    assert!(session.undo());
    assert_eq!(session.state().lights.inferred, None);
}

#[test]
fn invalid_choices_are_refused_and_change_nothing() {
    let refused = |session: &mut Session, command: Command, why: &str| {
        let before = session.state().clone();
        for tried in [session.preview(&command), session.apply(&command)] {
            let error = tried.unwrap_err().to_string();
            assert!(error.contains(why), "{command:?}: {error}");
        }
        assert_eq!(session.state(), &before, "{command:?}");
    };
    let white = |u: f64, v: f64| Command::White { pixel: Some([u, v]) };
    let mut inferred = session();
    for factor in [-0.1, 3.01, f32::NAN, f32::INFINITY] {
        refused(&mut inferred, Command::Contrast { factor }, "the contrast must be from 0 to 3");
    }
    for ev in [-4.1, 4.1, f32::NAN, f32::NEG_INFINITY] {
        refused(&mut inferred, Command::Warmth { ev }, "the warmth must be from -4 to 4 stops");
    }
    for (u, v) in [(-0.5, 3.0), (SIZE.0 as f64, 3.0), (3.0, SIZE.1 as f64), (f64::NAN, 3.0), (3.0, f64::INFINITY)] {
        refused(&mut inferred, white(u, v), "outside the");
    }
    refused(&mut inferred, white(2.5, 2.5), "(2.5, 2.5) is black");
    refused(&mut inferred, white(141.5, 2.5), "(141.5, 2.5) is clipped");
    inferred.apply(&white(60.5, 80.5)).unwrap();
    refused(&mut inferred, white(2.5, 2.5), "black");
    inferred.apply(&Command::InferredLight { light: LightMode::Expected }).unwrap();
    refused(&mut inferred, Command::Contrast { factor: 2.0 }, "only on plausible light");
    inferred.apply(&Command::InferredLight { light: LightMode::Even }).unwrap();
    for command in [Command::Warmth { ev: 1.0 }, white(60.5, 80.5), Command::White { pixel: None }] {
        refused(&mut inferred, command, "not even light");
    }
    // A scene of a network without expected light, and one without a network.
    let mut older = Session::new(Arc::new(OpenScene::new("room.scene", scene(None)))).unwrap();
    assert_eq!(older.view().inferred_light.effect, LightEffect::Fitted);
    for command in [Command::Contrast { factor: 2.0 }, Command::Warmth { ev: 1.0 }, white(60.5, 80.5)] {
        refused(&mut older, command, "no expected light");
    }
    older.apply(&Command::InferredLight { light: LightMode::Even }).unwrap();
    let mut shell = Session::new(ROOM.clone()).unwrap();
    assert_eq!(shell.view().inferred_light.effect, LightEffect::None);
    refused(&mut shell, Command::InferredLight { light: LightMode::Even }, "all choices are the same");
}

/// Lights the scene as the command line does.
fn lit(session: &Session) -> LitScene {
    let mut document = INFERRED.document.clone();
    document.light_edits = session.state().lights.clone();
    document.light_edits.inferred = Some(session.state().inferred_light());
    document.lit(LightPurpose::Objects { at_m: Default::default() }).unwrap()
}

#[test]
fn scenes_are_lit_as_by_the_command_line() {
    let mut session = session();
    let scenes = LitSceneCache::new(INFERRED.clone());
    assert!(*scenes.lit(session.state()).unwrap() == lit(&session));
    for (command, _) in steps() {
        let before = scenes.lit(session.state()).unwrap();
        session.apply(&command).unwrap();
        let after = scenes.lit(session.state()).unwrap();
        assert!(*after == lit(&session), "{command:?}");
        assert!(after.light != before.light, "{command:?}");
    }
    // With light edits, too. Ids of lights do not depend on the choice.
    session.apply(&Command::InferredLight { light: LightMode::Plausible }).unwrap();
    let names = |session: &Session| session.view().lights.into_iter().map(|light| light.listed.id).collect::<Vec<_>>();
    let light = names(&session)[0].clone();
    let change = LightChange { on: false, ..LightChange::NONE };
    session.apply(&Command::SetLight { light, change }).unwrap();
    for factor in [0.0, 1.0, 3.0] {
        let known = names(&session);
        session.apply(&Command::Contrast { factor }).unwrap();
        assert_eq!(names(&session), known);
        assert!(*scenes.lit(session.state()).unwrap() == lit(&session), "{factor}");
    }
}

#[test]
fn a_draft_previews_what_is_fitted_later() {
    let mut session = session();
    let scenes = LitSceneCache::new(INFERRED.clone());
    session.apply(&Command::Contrast { factor: 2.0 }).unwrap();
    let draft = scenes.lit_draft(session.state()).unwrap();
    assert!(Arc::ptr_eq(&draft, &scenes.lit_draft(session.state()).unwrap()), "the draft is cached");
    let fitted = scenes.lit(session.state()).unwrap();
    assert!(Arc::ptr_eq(&fitted, &scenes.lit_draft(session.state()).unwrap()), "fitted light replaces the draft");
    // Within half a stop, so that a preview shows the requested contrast.
    let sum = |scene: &LitScene| scene.light.rgba.last().unwrap().iter().map(|rgba| rgba[1]).sum::<f32>();
    let [draft, fitted] = [sum(&draft), sum(&fitted)];
    assert!((draft / fitted).log2().abs() < 0.5, "{draft} {fitted}");
}

#[test]
fn the_scene_and_the_command_line_keep_the_choice() {
    let mut session = session();
    session.apply(&add("builtin:sphere", [125.5, 90.5])).unwrap();
    let plain = insert_command("room.scene", session.state()).unwrap();
    let options = |session: &Session| {
        let words = insert_argv("room.scene", session.state()).unwrap();
        let from = words.iter().position(|word| word == "--light").unwrap_or(words.len());
        words[from..].iter().take_while(|word| *word != "--quality").cloned().collect::<Vec<_>>().join(" ")
    };
    assert!(!plain.contains("--light"));
    let wanted = [
        "--light plausible --contrast 0.7",
        "--light plausible --contrast 0.7 --warmth -0.5",
        "--light plausible --contrast 0.7 --warmth -0.5 --white 60.5,80.5",
        "--light expected --warmth -0.5 --white 60.5,80.5",
        "--light expected --warmth -0.5",
        "--light even",
    ];
    for ((command, _), wanted) in steps().into_iter().zip(wanted) {
        session.apply(&command).unwrap();
        assert_eq!(options(&session), wanted);
        assert!(!session.view().edited, "the options express the choice completely");
    }
    session.apply(&Command::InferredLight { light: LightMode::Plausible }).unwrap();
    let saved = Document::from_bytes(&outputs::scene(&INFERRED, session.state()).unwrap()).unwrap();
    assert_eq!(saved.light_edits.inferred, Some(chosen(&session)));
    let mut again = Session::new(Arc::new(OpenScene::new("room.scene", saved))).unwrap();
    assert_eq!((chosen(&again), again.view().edited), (chosen(&session), false));
    // If the file has a choice, the options state even the default light. Removing the choice requires saving the file.
    for command in [Command::Contrast { factor: 1.0 }, Command::Warmth { ev: 0.0 }] {
        again.apply(&command).unwrap();
    }
    assert_eq!((options(&again).as_str(), again.view().edited), ("--light plausible", false));
    again.apply(&Command::ResetLights).unwrap();
    assert_eq!((options(&again).as_str(), again.view().edited), ("", true));
    assert!(matches!(again.apply(&Command::Contrast { factor: 9.0 }), Err(SessionError::InvalidNumber { .. })));
}
