use std::collections::VecDeque;
use std::mem::size_of;

use lo_insert::Keyframe;
use lo_scene::{AddedLight, EmitterEdit};

use crate::{Object, State};

/// Memory for states that can be restored, bytes.
const MAX_BYTES: usize = 64 << 20;

/// States before and after the current one. The oldest are dropped when they take too much memory.
#[derive(Default)]
pub(crate) struct History {
    undo: VecDeque<State>,
    redo: Vec<State>,
}

impl History {
    /// Adds the state before a new step. Steps that were undone are dropped.
    pub fn push(&mut self, before: State) {
        self.redo.clear();
        self.undo.push_back(before);
        let mut bytes: usize = self.undo.iter().map(bytes).sum();
        while bytes > MAX_BYTES
            && let Some(oldest) = self.undo.pop_front()
        {
            bytes -= self::bytes(&oldest);
        }
    }

    /// Replaces the current state by the one before it. Returns `false` if there is none.
    pub fn undo(&mut self, current: &mut State) -> bool {
        let Some(before) = self.undo.pop_back() else { return false };
        self.redo.push(std::mem::replace(current, before));
        true
    }

    /// Replaces the current state by the one that was undone last. Returns `false` if there is none.
    pub fn redo(&mut self, current: &mut State) -> bool {
        let Some(after) = self.redo.pop() else { return false };
        self.undo.push_back(std::mem::replace(current, after));
        true
    }

    /// Returns whether there is a step to undo, and one to redo.
    pub fn can_undo_and_redo(&self) -> [bool; 2] {
        [!self.undo.is_empty(), !self.redo.is_empty()]
    }
}

/// Approximate memory of a state without its meshes, which states share.
fn bytes(state: &State) -> usize {
    let object = |object: &Object| {
        let keyframes = object.path.as_ref().map_or(0, |path| path.keyframes.len());
        size_of::<Object>() + object.name.len() + keyframes * size_of::<Keyframe>()
    };
    let lights =
        state.lights.emitters.len() * size_of::<EmitterEdit>() + state.lights.added.len() * size_of::<AddedLight>();
    size_of::<State>() + state.objects.iter().map(object).sum::<usize>() + lights
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(fps: u32) -> State {
        // About 2.5 MB.
        let edit = EmitterEdit { id: String::new(), found_at_m: Default::default(), change: Default::default() };
        let mut state = State { fps, ..State::default() };
        state.lights.emitters = vec![edit; (5 << 19) / size_of::<EmitterEdit>()];
        state
    }

    #[test]
    fn the_oldest_steps_are_dropped() {
        let mut history = History::default();
        for step in 0..100 {
            history.push(state(step));
        }
        let mut current = state(100);
        let mut steps = 0;
        while history.undo(&mut current) {
            steps += 1;
            assert_eq!(current.fps, 100 - steps);
        }
        // 64 MB of 2.5 MB each.
        assert!((24..=26).contains(&steps), "{steps}");
        assert_eq!(history.can_undo_and_redo(), [false, true]);
        while history.redo(&mut current) {
            steps -= 1;
        }
        assert_eq!((steps, current.fps), (0, 100));
        assert!(history.undo(&mut current));
        history.push(state(7));
        assert_eq!(history.can_undo_and_redo(), [true, false]);
    }
}
