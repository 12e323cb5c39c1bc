//! A scene in the scales of known lengths.

use std::sync::Arc;

use lightoctree::KnownLength;
use lo_insert::Path;

use crate::{Object, ObjectPosition, OpenScene, SessionError, State};

/// Maximum number of scaled scenes, so that undo and redo need not prepare them again.
const MAX_SCALED: usize = 3;

/// A scene as it was opened, and scaled copies of it, the last used last.
pub(crate) struct ScaledScenes {
    own: Arc<OpenScene>,
    scaled: Vec<(KnownLength, Arc<OpenScene>)>,
}

impl ScaledScenes {
    /// Creates it without scaled copies.
    pub fn new(own: Arc<OpenScene>) -> Self {
        Self { own, scaled: Vec::new() }
    }

    /// Returns the scene as it was opened.
    pub fn own(&self) -> &OpenScene {
        &self.own
    }

    /// Returns the scene scaled to a known length, or as it was opened.
    ///
    /// # Errors
    /// If no scale follows from the length.
    pub fn at(&mut self, known: Option<KnownLength>) -> Result<Arc<OpenScene>, SessionError> {
        let Some(known) = known else { return Ok(self.own.clone()) };
        let found = self.scaled.iter().position(|(other, _)| *other == known);
        let scene = match found {
            Some(index) => self.scaled.remove(index).1,
            None => Arc::new(self.own.with_known_length(&known)?),
        };
        if self.scaled.len() >= MAX_SCALED {
            self.scaled.remove(0);
        }
        self.scaled.push((known, scene.clone()));
        Ok(scene)
    }
}

/// Returns a state in a scaled room. Objects keep their sizes and their places in the photo.
pub(crate) fn in_scaled_room(
    state: State,
    known_length: Option<KnownLength>,
    scene: &OpenScene,
    factor: f32,
) -> Result<State, SessionError> {
    let factor_f64 = f64::from(factor);
    let scaled = |position_m: [f64; 3]| position_m.map(|x| f64::from((x * factor_f64) as f32));
    let path = |path: Path| Path {
        keyframes: path
            .keyframes
            .into_iter()
            .map(|key| lo_insert::Keyframe { position_m: key.position_m.map(scaled), ..key })
            .collect(),
        ..path
    };
    let object = |object: Object| {
        let position = match object.position {
            ObjectPosition::Position(position_m) => ObjectPosition::Position(scaled(position_m)),
            pixel @ ObjectPosition::Pixel(_) => pixel,
        };
        Object { position, path: object.path.map(path), ..object }.placed(scene.ground(), state.time_s)
    };
    Ok(State {
        objects: state.objects.into_iter().map(object).collect::<Result<_, _>>()?,
        lights: state.lights.in_scaled_room(factor),
        known_length,
        ..state
    })
}
