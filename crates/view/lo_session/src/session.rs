use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use lightoctree::insert::{Align, Layout, Placement};
use lightoctree::mesh::Model;
use lightoctree::scene::{CONTRASTS, LightEdits, MAX_LIGHT_EDITS, ObjectDisplay, WARMTHS_EV};
use lightoctree::{BUILTIN_MODELS, BUILTIN_PREFIX, GuessedLight, LightEffect, LightMode};

use crate::drag::dragged;
use crate::{Command, Files, Mesh, Object, ObjectMaterial, OpenScene, Place, SessionError, Size, State};

/// Most meshes that a session holds beside the built-in ones.
const MAX_MESHES: usize = 200;

/// Height of new objects whose mesh is not plainly in metres.
const HEIGHT_M: f64 = 0.3;

/// Extents in which a mesh is taken to be in metres.
const METRES: std::ops::RangeInclusive<f32> = 0.02..=3.0;

/// Why a choice of light is refused.
const NO_CHOICE: &str = "the light of this scene is no guess of a network: all choices are the same";
const NO_EXPECTATION: &str =
    "this scene has no expected light: contrast, warmth and white change nothing; estimate it anew, without a panorama";

/// Objects and lights of one scene while somebody changes them.
///
/// A gesture is a row of [`Session::preview`]s that [`Session::commit`] keeps as one step of the history, or [`Session::cancel`] drops.
pub struct Session {
    open: Arc<OpenScene>,
    meshes: BTreeMap<String, Arc<Mesh>>,
    state: State,
    /// What a gesture shows.
    preview: Option<State>,
    undo: Vec<State>,
    redo: Vec<State>,
    next_id: u32,
}

impl Session {
    /// At a scene as its file left it: with its objects and the edits of its light.
    ///
    /// # Errors
    /// Those of [`State::of_document`].
    pub fn new(open: Arc<OpenScene>) -> Result<Self, SessionError> {
        let (state, meshes) = State::of_document(&open.document, open.ground())?;
        let next_id = state.objects.len() as u32 + 1;
        Ok(Self { open, meshes, state, preview: None, undo: Vec::new(), redo: Vec::new(), next_id })
    }

    /// The scene.
    pub fn open(&self) -> &Arc<OpenScene> {
        &self.open
    }

    /// What is shown: what a gesture previews, or else what was kept.
    pub fn state(&self) -> &State {
        self.preview.as_ref().unwrap_or(&self.state)
    }

    /// Whether a gesture is under way.
    pub fn is_previewing(&self) -> bool {
        self.preview.is_some()
    }

    /// Whether there is something to undo, and something to redo.
    pub fn can_undo_and_redo(&self) -> [bool; 2] {
        [!self.undo.is_empty(), !self.redo.is_empty()]
    }

    /// Carries a command out and keeps it as a step of the history; a gesture under way is kept before.
    ///
    /// # Errors
    /// Where it is impossible; nothing is changed then.
    pub fn apply(&mut self, command: &Command) -> Result<(), SessionError> {
        self.commit();
        let next = self.changed(command)?;
        self.keep(next);
        Ok(())
    }

    /// Shows what a command comes to, as part of a gesture.
    ///
    /// # Errors
    /// Where it is impossible; what is shown does not change then.
    pub fn preview(&mut self, command: &Command) -> Result<(), SessionError> {
        self.preview = Some(self.changed(command)?);
        Ok(())
    }

    /// Keeps what a gesture shows.
    pub fn commit(&mut self) {
        if let Some(shown) = self.preview.take() {
            self.keep(shown);
        }
    }

    /// Drops what a gesture shows.
    pub fn cancel(&mut self) {
        self.preview = None;
    }

    /// Looks at another time; a gesture under way is kept before. It is no step of the history, whose steps come back with the time that they were made at.
    ///
    /// # Errors
    /// A time out of range.
    pub fn seek(&mut self, time_s: f64) -> Result<(), SessionError> {
        self.commit();
        self.state = self.state.at(time_s, self.open.ground())?;
        Ok(())
    }

    /// Takes the last step back, or the gesture under way; `false` where there is none.
    pub fn undo(&mut self) -> bool {
        if self.preview.take().is_some() {
            return true;
        }
        let Some(before) = self.undo.pop() else { return false };
        self.redo.push(std::mem::replace(&mut self.state, before));
        true
    }

    /// Takes the last undone step again; `false` where there is none.
    pub fn redo(&mut self) -> bool {
        self.preview = None;
        let Some(after) = self.redo.pop() else { return false };
        self.undo.push(std::mem::replace(&mut self.state, after));
        true
    }

    /// Takes a mesh of a file in, under the file's name or one like it, which is the answer.
    ///
    /// # Errors
    /// A mesh without extent; too many of them.
    ///
    /// `content` and `parts`: the file and those that it names, by name, as they came.
    pub fn add_mesh(
        &mut self,
        file: &str,
        model: Model,
        content: Arc<[u8]>,
        parts: Files,
    ) -> Result<String, SessionError> {
        if self.meshes.keys().filter(|name| !name.starts_with(BUILTIN_PREFIX)).count() >= MAX_MESHES {
            return Err(SessionError::Full { what: "meshes", limit: MAX_MESHES });
        }
        // The command line knows files by their names: a second one of the same name is another file.
        let (stem, ending) = file.rsplit_once('.').unwrap_or((file, ""));
        let numbered = (2..).map(|number| format!("{stem}_{number}.{ending}"));
        let mut names = std::iter::once(file.to_owned()).chain(numbered);
        let name = names.find(|name| !self.meshes.contains_key(name)).unwrap_or_default();
        let parts = parts.into_iter().map(|(part, bytes)| (format!("{name}/{part}"), bytes));
        let files = std::iter::once((name.clone(), content)).chain(parts).collect();
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

    /// Names of the meshes that objects can be made of.
    pub fn mesh_names(&self) -> Vec<String> {
        let builtin = BUILTIN_MODELS.iter().map(|name| format!("{BUILTIN_PREFIX}{name}"));
        builtin.chain(self.meshes.keys().filter(|name| !name.starts_with(BUILTIN_PREFIX)).cloned()).collect()
    }

    fn keep(&mut self, next: State) {
        if next != self.state {
            self.undo.push(std::mem::replace(&mut self.state, next));
            self.redo.clear();
        }
    }

    /// What is shown, with a command carried out.
    fn changed(&mut self, command: &Command) -> Result<State, SessionError> {
        // The end of a keyframe's way is told from its beginning.
        let from = if matches!(command, Command::MoveKey { .. }) { &self.state } else { self.state() };
        let mut state = from.clone();
        let open = self.open.clone();
        let time_s = state.time_s;
        let object = |id: u32, change: &dyn Fn(&mut Object) -> Result<(), SessionError>| {
            let mut object = state.object(id)?.clone();
            change(&mut object)?;
            object.placed(open.ground(), time_s)
        };
        let simply = |id: u32, change: &dyn Fn(&mut Object)| {
            object(id, &|object| {
                change(object);
                Ok(())
            })
        };
        let changed = match command {
            Command::Add { mesh, pixel, material } => {
                let mesh = self.mesh(mesh)?;
                let new = self.new_object(mesh, *pixel, material.clone())?;
                return with_new(state, new);
            }
            Command::Duplicate { object } => {
                let new = self.duplicate(state.object(*object)?)?;
                return with_new(state, new);
            }
            Command::Delete { object } => {
                state.object(*object)?;
                state.objects.retain(|other| other.id != *object);
                return Ok(state);
            }
            Command::Drag { object: id, to } => {
                let place = dragged(&open, state.object(*id)?, self.is_lifted(*id), *to);
                let Some(place) = place else { return Ok(state) };
                object(*id, &|object| object.stand(place, object.yaw_deg, time_s))?
            }
            Command::Rename { object: id, name } => simply(*id, &|object| object.name.clone_from(name))?,
            Command::Place { object: id, place } => {
                object(*id, &|object| object.stand(*place, object.yaw_deg, time_s))?
            }
            Command::Size { object: id, size } => simply(*id, &|object| object.size = *size)?,
            Command::Turn { object: id, yaw_deg } => {
                object(*id, &|object| object.stand(object.place, *yaw_deg, time_s))?
            }
            Command::Align { object: id, align } => simply(*id, &|object| object.align = *align)?,
            Command::Material { object: id, material } => simply(*id, &|object| object.material.clone_from(material))?,
            Command::SetKey { object: id, time_s } => object(*id, &|object| object.set_key(*time_s))?,
            Command::MoveKey { object: id, from_s, to_s } => object(*id, &|object| object.move_key(*from_s, *to_s))?,
            Command::DeleteKey { object: id, time_s } => object(*id, &|object| object.delete_key(*time_s))?,
            Command::Interpolate { object: id, interpolation } => {
                object(*id, &|object| object.interpolate(*interpolation))?
            }
            Command::Frames { frames, fps } => {
                let shown = ObjectDisplay { frames: *frames, fps: *fps, ..ObjectDisplay::default() };
                shown.invalid_field().map_or(Ok(()), |why| Err(SessionError::Shown(why)))?;
                return Ok(State { frames: *frames, fps: *fps, ..state });
            }
            Command::FloorGloss { gloss } => {
                if !(0.0..=1.0).contains(gloss) {
                    let found = f64::from(*gloss);
                    return Err(SessionError::Number { name: "the floor's gloss", needed: "from 0 to 1", found });
                }
                return Ok(State { floor_gloss: *gloss, ..state });
            }
            Command::GuessedLight { .. }
            | Command::Contrast { .. }
            | Command::Warmth { .. }
            | Command::White { .. } => {
                state.lights.guessed = self.changed_guess(&state, command)?;
                return Ok(state);
            }
            _ => {
                self.change_lights(&mut state.lights, command)?;
                return Ok(state);
            }
        };
        // Names tell objects apart in layouts.
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

    /// Whether an object was in the air when the gesture began.
    fn is_lifted(&self, id: u32) -> bool {
        let begun = self.state.object(id).or_else(|_| self.state().object(id));
        begun.is_ok_and(|object| object.placement.support.is_none() && matches!(object.place, Place::Position(_)))
    }

    /// Another choice of light; none where that is what it is without one.
    fn changed_guess(&self, state: &State, command: &Command) -> Result<Option<GuessedLight>, SessionError> {
        let estimate = self.open.estimate();
        let within = |name, needed, range: RangeInclusive<f32>, value: f32| {
            let found = f64::from(value);
            if range.contains(&value) { Ok(value) } else { Err(SessionError::Number { name, needed, found }) }
        };
        let mut guessed = state.lights.guessed.unwrap_or_default();
        let no_effect = match (LightEffect::of(estimate), command) {
            (LightEffect::None, _) => Some(NO_CHOICE),
            (_, Command::GuessedLight { .. }) => None,
            (LightEffect::Fitted, _) => Some(NO_EXPECTATION),
            (_, Command::Contrast { .. }) => {
                (guessed.light != LightMode::Plausible).then_some("only plausible light has a contrast")
            }
            _ => (guessed.light == LightMode::Even)
                .then_some("warmth and white change expected and plausible light, not even light"),
        };
        if let Some(why) = no_effect {
            return Err(SessionError::NoEffect(why));
        }
        let tuning = &mut guessed.tuning;
        match *command {
            Command::GuessedLight { light } => guessed.light = light,
            Command::Contrast { factor } => {
                tuning.contrast = within("the contrast", "from 0 to 3", CONTRASTS, factor)?;
            }
            Command::Warmth { ev } => tuning.warmth_ev = within("the warmth", "from -4 to 4 stops", WARMTHS_EV, ev)?,
            Command::White { pixel } => {
                pixel.map_or(Ok(()), |pixel| lightoctree::check_white(estimate, pixel))?;
                tuning.white = pixel;
            }
            _ => {}
        }
        // A scene that came with a choice keeps one, so that the command line says it.
        let is_needed = guessed != GuessedLight::default() || self.open.document.light_edits.guessed.is_some();
        Ok(is_needed.then_some(guessed))
    }

    fn change_lights(&self, lights: &mut LightEdits, command: &Command) -> Result<(), SessionError> {
        let full = SessionError::Full { what: "changed lights", limit: MAX_LIGHT_EDITS };
        let estimate = self.open.estimate();
        match command {
            Command::SetLight { light, change } => {
                change.invalid_field().map_or(Ok(()), |what| Err(SessionError::Range(what)))?;
                let listed = self.open.lights().iter().find(|listed| listed.id == *light);
                if listed.is_none() && !lights.added.iter().any(|added| added.id == *light) {
                    return Err(SessionError::NoLight(light.clone()));
                }
                let found_at_m = listed.and_then(|listed| listed.position_m).unwrap_or_default();
                if lights.change(light, found_at_m, *change) { Ok(()) } else { Err(full) }
            }
            Command::AddLight { new } => lights.add(new.analytic(estimate)?).map(|_| ()).ok_or(full),
            Command::ReplaceLight { light, new } => {
                let new = new.analytic(estimate)?;
                let added = lights.added.iter_mut().find(|added| added.id == *light);
                added.ok_or_else(|| SessionError::NoLight(light.clone()))?.light = new;
                Ok(())
            }
            Command::RemoveLight { light } => {
                if lights.remove(light) {
                    Ok(())
                } else {
                    Err(SessionError::NoLight(light.clone()))
                }
            }
            _ => {
                *lights = LightEdits::default();
                Ok(())
            }
        }
    }

    fn new_object(
        &mut self,
        mesh: Arc<Mesh>,
        pixel: Option<[f64; 2]>,
        material: Option<ObjectMaterial>,
    ) -> Result<Object, SessionError> {
        let extent = mesh.size().max_element();
        let size = if METRES.contains(&extent) && mesh.name() != "builtin:suzanne" {
            Size::Scale(1.0)
        } else if mesh.size().y > 0.0 {
            Size::Height(HEIGHT_M)
        } else {
            Size::Scale(HEIGHT_M / f64::from(extent))
        };
        let file = mesh.name().strip_prefix(BUILTIN_PREFIX).unwrap_or(mesh.name());
        let stem = file.rsplit(['/', '\\']).next().unwrap_or(file);
        let stem = stem.rsplit_once('.').map_or(stem, |(stem, _)| stem);
        let place = match pixel {
            Some(pixel) => Place::Pixel(pixel),
            None => self.free_place(),
        };
        let new = Object {
            id: self.next_id,
            name: self.free_name(stem),
            mesh,
            place,
            size,
            yaw_deg: 0.0,
            path: None,
            align: Align::default(),
            material,
            placement: Placement::at(self.open.estimate(), Default::default(), Align::Gravity),
        };
        let new = new.placed(self.open.ground(), self.state().time_s)?;
        self.next_id += 1;
        Ok(new)
    }

    fn duplicate(&mut self, of: &Object) -> Result<Object, SessionError> {
        // It stands still: moved in the same way it would hide in the first one.
        let new = Object { id: self.next_id, name: self.free_name(&of.name), path: None, ..of.clone() };
        // Beside it, where there is something to stand on; else at the same place.
        let size = of.mesh.size() * of.placement.scale;
        let camera = self.open.estimate().frame.camera;
        let beside = camera.project(of.placement.position_m).and_then(|(u, v, z)| {
            let step = 1.2 * camera.fx * f64::from(size.x) / z;
            [step, -step].into_iter().find_map(|step| dragged(&self.open, of, self.is_lifted(of.id), [u + step, v]))
        });
        let moved = beside.and_then(|place| Object { place, ..new.clone() }.placed(self.open.ground(), 0.0).ok());
        self.next_id += 1;
        moved.map_or_else(|| new.placed(self.open.ground(), 0.0), Ok)
    }

    /// A name that no object has: with a number behind it where it is taken.
    fn free_name(&self, wanted: &str) -> String {
        let wanted = if wanted.is_empty() { "object" } else { wanted };
        let stem = wanted.trim_end_matches(|c: char| c.is_ascii_digit()).trim_end_matches([' ', '_']);
        let stem = if stem.is_empty() { wanted } else { stem };
        let taken = |name: &str| self.state().objects.iter().any(|object| object.name == name);
        let numbered = (2..).map(|number| format!("{stem} {number}"));
        std::iter::once(wanted.to_owned()).chain(numbered).find(|name| !taken(name)).unwrap_or_default()
    }

    /// A surface in the lower half of the photo on which something can stand, away from what stands there.
    fn free_place(&self) -> Place {
        /// Places along the width and the height at which one looks.
        const COLUMNS: [f64; 7] = [0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8];
        const ROWS: [f64; 5] = [0.75, 0.82, 0.68, 0.9, 0.6];
        let camera = self.open.estimate().frame.camera;
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        let up = self.open.up();
        let free = |[u, v]: [f64; 2]| {
            let (position_m, normal) = self.open.surfaces.at_pixel(u, v)?;
            let apart = |object: &Object| {
                let size = object.mesh.size() * object.placement.scale;
                (object.placement.position_m - position_m).length() > 0.5 * size.max_element() + 0.15
            };
            let is_free = normal.dot(up) > 0.9 && self.state().objects.iter().all(apart);
            is_free.then_some(Place::Pixel([u, v]))
        };
        let mut places =
            ROWS.iter().flat_map(|v| COLUMNS.map(|u| [(u * width).floor() + 0.5, (v * height).floor() + 0.5]));
        places.find_map(free).unwrap_or_else(|| {
            let ahead = camera.unproject(0.5 * width, 0.7 * height, f64::from(0.6 * self.open.far_m));
            Place::Position(ahead.to_array().map(f64::from))
        })
    }
}

fn with_new(mut state: State, new: Object) -> Result<State, SessionError> {
    if state.objects.len() >= Layout::MAX_OBJECTS {
        return Err(SessionError::Full { what: "objects", limit: Layout::MAX_OBJECTS });
    }
    state.objects.push(new);
    Ok(state)
}
