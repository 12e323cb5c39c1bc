//! A page's messages, one per line: each is refused or executed. The session stays valid and can be undone completely.
#![no_main]

use std::sync::{Arc, LazyLock};

use libfuzzer_sys::fuzz_target;
use lightoctree::{Document, KnownLength};
use lo_geometry::Quat;
use lo_imaging::RadianceImage;
use lo_scene::{Completion, ExpectedLight};
use lo_session::{OpenScene, Session, SessionError, overlay, probe_position};
use lo_viewer::protocol::FromPage;

/// Maximum number of messages.
const MAX_MESSAGES: usize = 64;

static ROOM: LazyLock<Arc<OpenScene>> = LazyLock::new(|| {
    let mut document =
        Document::from_bytes(include_bytes!("../corpus/scene/srgb8_edited.scene")).expect("the seed scene is valid");
    // With expected light, so that the choice of light has an effect.
    let radiance = RadianceImage::from_fn(8, 4, |x, y| [0.5 + x as f32, 0.5 + y as f32, 1.0]);
    let expected = Some(ExpectedLight::new(&radiance, Quat::IDENTITY, 3.0));
    let estimate = Arc::make_mut(&mut document.estimate);
    (estimate.origin.completion, estimate.expected) = (Completion::Network, expected);
    Arc::new(OpenScene::new("room.scene", document))
});

fuzz_target!(|text: &str| {
    let mut session = Session::new(ROOM.clone()).expect("the seed scene is valid");
    let begun = session.state().clone();
    for message in text.lines().take(MAX_MESSAGES).filter_map(|line| serde_json::from_str::<FromPage>(line).ok()) {
        let (before, was_previewing) = (session.state().clone(), session.is_previewing());
        let refused = |result: Result<(), SessionError>| result.is_err();
        // Whether the shown state must be unchanged.
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
                let at = probe_position(session.scene(), pixel, lift_m.clamp(0.0, 10.0));
                assert!(at.is_none_or(|at| at.is_finite() || !lift_m.is_finite()));
                true
            }
            FromPage::Overlay { what } => {
                let _ = overlay(session.scene(), what);
                true
            }
            FromPage::Measure { ends } => {
                let measured = KnownLength { ends, length_m: 1.0 }.estimated_m(session.scene().estimate());
                assert!(measured.map_or(true, f32::is_finite));
                true
            }
            FromPage::Outside { view, .. } => {
                let _ = view.check(session.scene().up());
                true
            }
            FromPage::StopSequence | FromPage::Stop | FromPage::Saved { .. } => true,
        };
        let state = session.state();
        assert!(!stays || before == *state);
        for object in &state.objects {
            object.placement.check().expect("placements can be rendered");
        }
        serde_json::to_string(&session.view()).expect("views consist of numbers and names");
        let ids: std::collections::HashSet<u32> = state.objects.iter().map(|object| object.id).collect();
        assert_eq!(ids.len(), state.objects.len());
        if let Ok(layout) = state.layout() {
            assert_eq!(layout.objects().len(), state.objects.len());
        }
    }
    // Every chosen light can be computed.
    if session.state().lights.inferred.is_some() {
        session.scene().fitted.apply(&session.state().inferred_light()).expect("invalid white pixels are refused");
    }
    while session.undo() {}
    // Seeking is not a step of the history.
    let _ = session.seek(begun.time_s);
    assert!(begun == *session.state());
});
