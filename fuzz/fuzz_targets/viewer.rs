//! Messages from the page to the viewer, one per line: each is rejected or applied. The session stays consistent and
//! can be undone to its initial state.
#![no_main]

use std::sync::{Arc, LazyLock};

use libfuzzer_sys::fuzz_target;
use lightoctree::geometry::Quat;
use lightoctree::imaging::RadianceImage;
use lightoctree::scene::{Completion, ExpectedLight, Scene};
use lo_session::{OpenScene, Session, SessionError, overlay, probe_place};
use lo_viewer::protocol::FromPage;

/// Largest number of messages; more add nothing.
const MAX_MESSAGES: usize = 64;

static ROOM: LazyLock<Arc<OpenScene>> = LazyLock::new(|| {
    let scene = Scene::from_bytes(include_bytes!("../corpus/scene/srgb8_edited.scene")).expect("a scene of the seeds");
    // With expected light, so that it can be chosen.
    let radiance = RadianceImage::from_fn(8, 4, |x, y| [0.5 + x as f32, 0.5 + y as f32, 1.0]);
    let expected = Some(ExpectedLight::new(&radiance, Quat::IDENTITY, 3.0));
    Arc::new(OpenScene::new("room.scene", Scene { completion: Completion::Network, expected, ..scene }))
});

fuzz_target!(|text: &str| {
    let mut session = Session::new(ROOM.clone()).expect("a scene of the seeds");
    let begun = session.state().clone();
    for message in text.lines().take(MAX_MESSAGES).filter_map(|line| serde_json::from_str::<FromPage>(line).ok()) {
        let (before, was_previewing) = (session.state().clone(), session.is_previewing());
        let refused = |result: Result<(), SessionError>| result.is_err();
        // Whether the message must not change the state.
        let stays = match message {
            FromPage::Command { command } => refused(session.apply(&command)),
            FromPage::Preview { command, .. } => refused(session.preview(&command)),
            FromPage::Commit => {
                session.commit();
                true
            }
            FromPage::Cancel => {
                session.cancel();
                false
            }
            FromPage::Undo => !session.undo(),
            FromPage::Redo => !session.redo() && !was_previewing,
            FromPage::Seek { time_s, .. } => refused(session.seek(time_s)),
            FromPage::Probe { pixel, lift_m, .. } => {
                let at = probe_place(session.open(), pixel, lift_m.clamp(0.0, 10.0));
                assert!(at.is_none_or(|at| at.is_finite() || !lift_m.is_finite()));
                true
            }
            FromPage::Overlay { what } => {
                let _ = overlay(session.open(), what);
                true
            }
            FromPage::Outside { view, .. } => {
                let _ = view.check(session.open().up());
                true
            }
            FromPage::StopFilm | FromPage::Stop | FromPage::Close => true,
        };
        let state = session.state();
        assert!(!stays || before == *state);
        for object in &state.objects {
            object.placement.check().expect("every object can be drawn");
        }
        serde_json::to_string(&session.view()).expect("serialising numbers and names cannot fail");
        let ids: std::collections::HashSet<u32> = state.objects.iter().map(|object| object.id).collect();
        assert_eq!(ids.len(), state.objects.len());
        if let Ok(layout) = state.layout() {
            assert_eq!(layout.objects().len(), state.objects.len());
        }
    }
    // The chosen light can be applied.
    if session.state().lights.guessed.is_some() {
        session.open().fitted.laid(&session.state().guessed()).expect("invalid white points are rejected earlier");
    }
    while session.undo() {}
    // The viewed time is not part of the history.
    let _ = session.seek(begun.time_s);
    assert!(begun == *session.state());
});
