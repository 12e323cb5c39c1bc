use std::collections::BTreeMap;
use std::sync::Arc;

use lightoctree::{BUILTIN_MODELS, BUILTIN_PREFIX, KnownLength};
use lo_insert::Layout;
use lo_mesh::Model;
use lo_scene::{LightEdits, ObjectDisplay, plain_name};

use crate::drag::dragged;
use crate::history::History;
use crate::scaled_scenes::{ScaledScenes, in_scaled_room};
use crate::snap::{fallen, is_held};
use crate::{Command, Files, Mesh, Object, ObjectPosition, OpenScene, SessionError, State};

/// Maximum number of meshes besides the built-in ones.
const MAX_MESHES: usize = 200;

/// An editing session of one scene's objects and lights.
///
/// A gesture is a series of [`Session::preview`]s. [`Session::commit`] keeps it as one step of the history,
/// [`Session::cancel`] discards it.
pub struct Session {
    /// The scene in the scale of the shown state.
    pub(crate) scene: Arc<OpenScene>,
    scaled_scenes: ScaledScenes,
    meshes: BTreeMap<String, Arc<Mesh>>,
    state: State,
    /// State shown by the current gesture.
    preview: Option<State>,
    history: History,
    /// Path of the scene file on the command line.
    file: String,
    /// Whether that file exists.
    has_file: bool,
    /// State of the file that was opened or saved last; `None` if no file has it.
    saved: Option<State>,
    /// Bytes of the files of added meshes.
    mesh_bytes: usize,
    pub(crate) next_id: u32,
}

impl Session {
    /// Opens a scene with the objects and light edits of its document.
    ///
    /// # Errors
    /// Those of [`State::from_document`].
    pub fn new(scene: Arc<OpenScene>) -> Result<Self, SessionError> {
        let (state, meshes) = State::from_document(&scene.document, scene.ground())?;
        let next_id = state.objects.len() as u32 + 1;
        Ok(Self {
            file: scene.file.clone(),
            has_file: scene.is_saved,
            saved: Some(state.clone()),
            scaled_scenes: ScaledScenes::new(scene.clone()),
            scene,
            meshes,
            state,
            preview: None,
            history: History::default(),
            mesh_bytes: 0,
            next_id,
        })
    }

    /// Returns the scene.
    pub fn scene(&self) -> &Arc<OpenScene> {
        &self.scene
    }

    /// Returns the shown state: the preview of the current gesture, or else the committed state.
    pub fn state(&self) -> &State {
        self.preview.as_ref().unwrap_or(&self.state)
    }

    /// Returns whether a gesture is in progress.
    pub fn is_previewing(&self) -> bool {
        self.preview.is_some()
    }

    /// Returns whether there is a step to undo, and one to redo.
    pub fn can_undo_and_redo(&self) -> [bool; 2] {
        self.history.can_undo_and_redo()
    }

    /// Returns the path of the scene file on the command line.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// Returns whether that file exists.
    pub fn has_file(&self) -> bool {
        self.has_file
    }

    /// Returns whether the shown state differs from the file that was opened or saved last.
    pub fn is_unsaved(&self) -> bool {
        !self.saved.as_ref().is_some_and(|saved| saved.is_equally_saved(self.state()))
    }

    /// Declares that a scene file has the shown state.
    pub fn mark_saved(&mut self, file: String) {
        (self.file, self.has_file) = (file, true);
        self.saved = Some(self.state().clone());
    }

    /// Declares that no file has the shown state, as after recovery.
    pub fn mark_unsaved(&mut self) {
        self.saved = None;
    }

    /// Returns the light edits of the scene file.
    pub(crate) fn saved_lights(&self) -> &LightEdits {
        self.saved.as_ref().map_or(&self.scaled_scenes.own().document.light_edits, |saved| &saved.lights)
    }

    /// Returns the length to which the scene file was scaled in this session.
    pub(crate) fn saved_known_length(&self) -> Option<KnownLength> {
        self.saved.as_ref().and_then(|saved| saved.known_length)
    }

    /// Executes a command as one step of the history. Commits a gesture in progress first.
    ///
    /// # Errors
    /// If the command is invalid; the state does not change then.
    pub fn apply(&mut self, command: &Command) -> Result<(), SessionError> {
        self.commit();
        let next = self.changed(command)?;
        self.push(next);
        self.follow_scale();
        Ok(())
    }

    /// Previews a command as part of a gesture.
    ///
    /// # Errors
    /// If the command is invalid; the shown state does not change then.
    pub fn preview(&mut self, command: &Command) -> Result<(), SessionError> {
        self.preview = Some(self.changed(command)?);
        self.follow_scale();
        Ok(())
    }

    /// Commits the current gesture as one step of the history.
    pub fn commit(&mut self) {
        if let Some(shown) = self.preview.take() {
            self.push(shown);
        }
    }

    /// Discards the current gesture.
    pub fn cancel(&mut self) {
        self.preview = None;
        self.follow_scale();
    }

    /// Moves to another time. Commits a gesture in progress first.
    ///
    /// Seeking is not a step of the history. Undo and redo restore the time at which a step was made.
    ///
    /// # Errors
    /// If the time is out of range.
    pub fn seek(&mut self, time_s: f64) -> Result<(), SessionError> {
        self.commit();
        self.state = self.state.at(time_s, self.scene.ground())?;
        Ok(())
    }

    /// Discards the current gesture, or undoes the last step. Returns `false` if there is neither.
    pub fn undo(&mut self) -> bool {
        let is_undone = self.preview.take().is_some() || self.history.undo(&mut self.state);
        self.follow_scale();
        is_undone
    }

    /// Redoes the last undone step. Returns `false` if there is none.
    pub fn redo(&mut self) -> bool {
        self.preview = None;
        let is_redone = self.history.redo(&mut self.state);
        self.follow_scale();
        is_redone
    }

    /// Makes the scene that of the shown state's scale.
    fn follow_scale(&mut self) {
        // The scale was valid when the state was made.
        if let Ok(scene) = self.scaled_scenes.at(self.state().known_length) {
            self.scene = scene;
        }
    }

    /// Returns the bytes of all added meshes and the files that they reference, without those of the document.
    pub fn mesh_bytes(&self) -> usize {
        self.mesh_bytes
    }

    /// Adds a mesh read from a file and returns its name: the file's name, numbered if it is taken.
    ///
    /// `content` is the file's content, `parts` the files that it references, by name.
    ///
    /// # Errors
    /// If the session has too many meshes.
    pub fn add_mesh(
        &mut self,
        file: &str,
        model: Model,
        content: Arc<[u8]>,
        parts: Files,
    ) -> Result<String, SessionError> {
        if self.meshes.keys().filter(|name| !name.starts_with(BUILTIN_PREFIX)).count() >= MAX_MESHES {
            return Err(SessionError::TooMany { what: "meshes", limit: MAX_MESHES });
        }
        // On the command line, the prefix means a built-in mesh.
        let file = file.strip_prefix(BUILTIN_PREFIX).unwrap_or(file);
        // The command line identifies files by name, so a second file of the same name gets another one.
        let (stem, ending) = file.rsplit_once('.').unwrap_or((file, ""));
        let numbered = (2..).map(|number| format!("{stem}_{number}.{ending}"));
        let mut names = std::iter::once(file.to_owned()).chain(numbered);
        let name = names.find(|name| !self.meshes.contains_key(name)).unwrap_or_default();
        let parts = parts.into_iter().map(|(part, bytes)| (format!("{name}/{part}"), bytes));
        let files: Files = std::iter::once((name.clone(), content)).chain(parts).collect();
        self.mesh_bytes += bytes_of(&files);
        self.meshes.insert(name.clone(), Arc::new(Mesh::new(name.clone(), model).with_files(files)));
        Ok(name)
    }

    fn mesh(&mut self, name: &str) -> Result<Arc<Mesh>, SessionError> {
        if let Some(mesh) = self.meshes.get(name) {
            return Ok(mesh.clone());
        }
        let mesh = Arc::new(Mesh::builtin(name)?);
        self.meshes.insert(name.to_owned(), mesh.clone());
        Ok(mesh)
    }

    /// Returns the names of the available meshes.
    pub fn mesh_names(&self) -> Vec<String> {
        let builtin = BUILTIN_MODELS.iter().map(|name| format!("{BUILTIN_PREFIX}{name}"));
        builtin.chain(self.meshes.keys().filter(|name| !name.starts_with(BUILTIN_PREFIX)).cloned()).collect()
    }

    fn push(&mut self, next: State) {
        if next != self.state {
            self.history.push(std::mem::replace(&mut self.state, next));
        }
    }

    /// Returns the shown state after a command.
    fn changed(&mut self, command: &Command) -> Result<State, SessionError> {
        // `MoveKey` refers to the keyframe's time before the gesture.
        let from = if matches!(command, Command::MoveKey { .. }) { &self.state } else { self.state() };
        let state = from.clone();
        match command {
            Command::Together { commands } => {
                if commands.len() > Layout::MAX_OBJECTS {
                    return Err(SessionError::TooMany { what: "commands in one step", limit: Layout::MAX_OBJECTS });
                }
                let is_single = |one: &Command| {
                    !matches!(one, Command::Together { .. } | Command::MoveKey { .. } | Command::KnownLength { .. })
                };
                if !commands.iter().all(is_single) {
                    return Err(SessionError::NotTogether);
                }
                commands.iter().try_fold(state, |state, one| self.changed_from(state, one))
            }
            _ => self.changed_from(state, command),
        }
    }

    /// Returns a state after a command.
    fn changed_from(&mut self, mut state: State, command: &Command) -> Result<State, SessionError> {
        let scene = self.scene.clone();
        let time_s = state.time_s;
        let object = |id: u32, change: &dyn Fn(&mut Object) -> Result<(), SessionError>| {
            let mut object = state.object(id)?.clone();
            change(&mut object)?;
            object.placed(scene.ground(), time_s)
        };
        let infallible = |id: u32, change: &dyn Fn(&mut Object)| {
            object(id, &|object| {
                change(object);
                Ok(())
            })
        };
        let changed = match command {
            Command::Add { mesh, pixel, material } => {
                let mesh = self.mesh(mesh)?;
                let new = self.new_object(&state, mesh, *pixel, material.clone())?;
                return with_new(state, new);
            }
            Command::Duplicate { object } => {
                let new = self.duplicate(&state, state.object(*object)?)?;
                return with_new(state, new);
            }
            Command::Delete { object } => {
                state.object(*object)?;
                state.objects.retain(|other| other.id != *object);
                return Ok(state);
            }
            Command::Drag { object: id, to } => {
                let position = dragged(&scene, state.object(*id)?, self.is_lifted(*id), *to);
                let Some(position) = position else { return Ok(state) };
                object(*id, &|object| object.set_pose(position, object.yaw_deg, time_s))?
            }
            Command::Rename { object: id, name } => {
                if plain_name(name).is_empty() {
                    return Err(SessionError::NoName);
                }
                infallible(*id, &|object| object.name.clone_from(name))?
            }
            Command::PutDown { object: id } => {
                let position = fallen(&scene, state.object(*id)?).ok_or(SessionError::NothingBelow)?;
                object(*id, &|object| object.set_pose(position, object.yaw_deg, time_s))?
            }
            Command::Place { object: id, place } => {
                object(*id, &|object| object.set_pose(*place, object.yaw_deg, time_s))?
            }
            Command::Size { object: id, size } => infallible(*id, &|object| object.size = *size)?,
            Command::Turn { object: id, yaw_deg } => {
                object(*id, &|object| object.set_pose(object.position, *yaw_deg, time_s))?
            }
            Command::Align { object: id, align } => infallible(*id, &|object| object.align = *align)?,
            Command::Material { object: id, material } => {
                infallible(*id, &|object| object.material.clone_from(material))?
            }
            Command::Show { object: id, is_shown } => infallible(*id, &|object| object.is_hidden = !is_shown)?,
            Command::Lock { object: id, is_locked } => infallible(*id, &|object| object.is_locked = *is_locked)?,
            Command::SetKey { object: id, time_s } => object(*id, &|object| object.set_key(*time_s))?,
            Command::MoveKey { object: id, from_s, to_s } => object(*id, &|object| object.move_key(*from_s, *to_s))?,
            Command::DeleteKey { object: id, time_s } => object(*id, &|object| object.delete_key(*time_s))?,
            Command::Interpolate { object: id, interpolation } => {
                object(*id, &|object| object.interpolate(*interpolation))?
            }
            Command::Frames { frames, fps } => {
                let shown = ObjectDisplay { frames: *frames, fps: *fps, ..ObjectDisplay::default() };
                shown.invalid_field().map_or(Ok(()), |why| Err(SessionError::Sequence(why)))?;
                return Ok(State { frames: *frames, fps: *fps, ..state });
            }
            Command::KnownLength { known } => {
                let scaled = self.scaled_scenes.at(*known)?;
                return in_scaled_room(state, *known, &scaled, scaled.scale / scene.scale);
            }
            Command::FloorGloss { gloss } => {
                if !(0.0..=1.0).contains(gloss) {
                    let found = f64::from(*gloss);
                    return Err(SessionError::InvalidNumber { name: "the floor gloss", needed: "from 0 to 1", found });
                }
                return Ok(State { floor_gloss: *gloss, ..state });
            }
            Command::InferredLight { .. }
            | Command::Contrast { .. }
            | Command::Warmth { .. }
            | Command::White { .. } => {
                state.lights.inferred = self.changed_inferred_light(&state, command)?;
                return Ok(state);
            }
            _ => {
                self.change_lights(&mut state, command)?;
                return Ok(state);
            }
        };
        // Layouts identify objects by name.
        if state.objects.iter().any(|other| other.id != changed.id && other.name == changed.name) {
            return Err(SessionError::NameTaken(changed.name));
        }
        for other in &mut state.objects {
            if other.id == changed.id {
                *other = changed;
                break;
            }
        }
        Ok(state)
    }

    /// Returns whether an object was in the air before the gesture, neither on a support nor at a wall.
    fn is_lifted(&self, id: u32) -> bool {
        let begun = self.state.object(id).or_else(|_| self.state().object(id));
        begun.is_ok_and(|object| {
            let is_in_air =
                object.placement.support.is_none() && matches!(object.position, ObjectPosition::Position(_));
            is_in_air && !is_held(&self.scene, object)
        })
    }
}

fn bytes_of(files: &Files) -> usize {
    files.values().map(|content| content.len()).sum()
}

fn with_new(mut state: State, new: Object) -> Result<State, SessionError> {
    if state.objects.len() >= Layout::MAX_OBJECTS {
        return Err(SessionError::TooMany { what: "objects", limit: Layout::MAX_OBJECTS });
    }
    state.objects.push(new);
    Ok(state)
}
