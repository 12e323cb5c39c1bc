use lightoctree::{InferredLight, KnownLength};
use lo_insert::{Align, Path};
use lo_lights::{ListedLight, sun_angles_deg};
use lo_scene::LightEffect;
use lo_scene::{AddedLight, LightChange, LightEdits, LightShape};
use serde::Serialize;

use crate::first_size::MeshUnit;
use crate::sun_shadow::shadow_pixel;
use crate::{Object, ObjectMaterial, ObjectPosition, ObjectSize, Session, State, insert_command};

/// A session as data for a front end.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SessionView {
    /// Objects in the photo.
    pub objects: Vec<ObjectView>,
    /// Choice of light for unobserved regions.
    pub inferred_light: InferredLightView,
    /// Found and added lights.
    pub lights: Vec<LightView>,
    /// Gloss of the surfaces that carry objects, 0 to 1.
    pub floor_gloss: f32,
    /// Length to which the room of the scene file is scaled.
    pub known_length: Option<KnownLength>,
    /// Factor by which the room is larger than in the scene file.
    pub room_scale: f32,
    /// Whether there is a step to undo.
    pub can_undo: bool,
    /// Whether there is a step to redo.
    pub can_redo: bool,
    /// Command line that renders the final image; `None` without objects.
    pub command: Option<String>,
    /// Path of the scene file on the command line.
    pub file: String,
    /// Whether that file exists; otherwise the scene must be saved before `command` works.
    pub has_file: bool,
    /// Whether the scene must be saved before `command` works, because its light edits differ from the file's.
    pub edited: bool,
    /// Whether objects, lights or keyframes differ from the last opened or saved file.
    pub unsaved: bool,
    /// Names of the available meshes.
    pub meshes: Vec<String>,
    /// Current time, keyframe range and frames.
    pub timeline: TimelineView,
}

/// Timeline of a session.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct TimelineView {
    /// Current time, seconds.
    pub time_s: f64,
    /// Times of the first and last keyframe, seconds; `None` without keyframes.
    pub span_s: Option<[f64; 2]>,
    /// Number of frames of the sequence.
    pub frames: u32,
    /// Whether the user chose `frames`.
    pub is_chosen: bool,
    /// Frames per second.
    pub fps: u32,
}

/// One object.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct ObjectView {
    /// Id.
    pub id: u32,
    /// Name.
    pub name: String,
    /// Name of the mesh.
    pub mesh: String,
    /// Position as entered.
    pub place: ObjectPosition,
    /// Size as entered.
    pub size: ObjectSize,
    /// Rotation, degrees.
    pub yaw_deg: f64,
    /// Keyframes, if the object is animated.
    pub path: Option<Path>,
    /// Direction that the up axis is aligned with.
    pub align: Align,
    /// Material that replaces the mesh's own.
    pub material: Option<ObjectMaterial>,
    /// Whether images leave it out.
    pub is_hidden: bool,
    /// Whether it is protected from being moved by accident.
    pub is_locked: bool,
    /// Middle of the base, metres.
    pub position_m: [f32; 3],
    /// Unit vector of the up axis.
    pub up: [f32; 3],
    /// Extent along the object's axes, metres.
    pub size_m: [f32; 3],
    /// Metres per unit of the mesh.
    pub scale: f32,
    /// Whether a surface supports it.
    pub rests: bool,
    /// Shadows of its top in the added suns that are on.
    pub shadows: Vec<ShadowView>,
    /// Unit of the mesh's coordinates, in the plural.
    pub unit: &'static str,
    /// Metres per unit of the mesh by that unit.
    pub metres_per_unit: f64,
    /// Whether the mesh's format defines the unit; otherwise it is inferred.
    pub unit_is_stated: bool,
}

/// Shadow of an object's top.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct ShadowView {
    /// Id of the sun.
    pub light: String,
    /// Photo position, pixels; may be outside of the photo.
    pub pixel: [f64; 2],
}

/// Choice of light for unobserved regions.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct InferredLightView {
    /// The light and its tuning.
    #[serde(flatten)]
    pub chosen: InferredLight,
    /// Effect of other choices.
    pub effect: LightEffect,
}

/// One light.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct LightView {
    /// The light before edits.
    #[serde(flatten)]
    pub listed: ListedLight,
    /// Edits of the light.
    pub changed: LightChange,
    /// Direction of a sun: degrees to the right of the camera's axis, and above the horizon.
    pub sun_deg: Option<[f64; 2]>,
}

impl Session {
    /// Returns the session as data for a front end.
    pub fn view(&self) -> SessionView {
        let state = self.state();
        let scene = self.scene();
        let shadows = |object: &Object| {
            let suns = state.lights.added.iter().filter(|added| added.change.on);
            let shadow = |added: &AddedLight| match added.light.shape {
                LightShape::Sun { direction, .. } => {
                    let pixel = shadow_pixel(scene, object, direction)?;
                    Some(ShadowView { light: added.id.clone(), pixel })
                }
                _ => None,
            };
            suns.filter_map(shadow).collect()
        };
        let objects = state.objects.iter().map(|object| (object, MeshUnit::of(&object.mesh)));
        let objects = objects.map(|(object, MeshUnit { unit, is_stated })| ObjectView {
            id: object.id,
            name: object.name.clone(),
            mesh: object.mesh.name().to_owned(),
            place: object.position,
            size: object.size,
            yaw_deg: object.yaw_deg,
            path: object.path.clone(),
            align: object.align,
            material: object.material.clone(),
            is_hidden: object.is_hidden,
            is_locked: object.is_locked,
            position_m: object.placement.position_m.to_array(),
            up: object.placement.up.to_array(),
            size_m: (object.mesh.size() * object.placement.scale).to_array(),
            scale: object.placement.scale,
            rests: object.placement.support.is_some(),
            shadows: shadows(object),
            unit: unit.name(),
            metres_per_unit: unit.metres(),
            unit_is_stated: is_stated,
        });
        let found = scene.lights().iter().map(|listed| LightView {
            changed: state.lights.change_of(&listed.id),
            listed: ListedLight { change: None, ..listed.clone() },
            sun_deg: None,
        });
        let added = |added: &AddedLight| LightView {
            listed: ListedLight { change: None, ..ListedLight::of_added(added) },
            changed: added.change,
            sun_deg: match added.light.shape {
                LightShape::Sun { direction, .. } => Some(sun_angles_deg(scene.estimate(), direction)),
                _ => None,
            },
        };
        let [can_undo, can_redo] = self.can_undo_and_redo();
        SessionView {
            objects: objects.collect(),
            inferred_light: InferredLightView {
                chosen: state.lights.inferred.unwrap_or_default(),
                effect: LightEffect::of(scene.estimate()),
            },
            lights: found.chain(state.lights.added.iter().map(added)).collect(),
            floor_gloss: state.floor_gloss,
            known_length: state.known_length,
            room_scale: scene.scale,
            can_undo,
            can_redo,
            command: insert_command(self.file(), &self.on_command_line()),
            file: self.file().to_owned(),
            has_file: self.has_file(),
            unsaved: self.is_unsaved(),
            edited: self.is_edited(),
            meshes: self.mesh_names(),
            timeline: TimelineView {
                time_s: state.time_s,
                span_s: state.span_s(),
                frames: state.sequence_frames(),
                is_chosen: state.frames.is_some(),
                fps: state.fps,
            },
        }
    }
}

impl Session {
    /// Returns the shown state as the command line has it: without hidden objects, and scaled only if the scene file is
    /// not.
    fn on_command_line(&self) -> State {
        let shown = self.state().shown_in_images();
        State { known_length: shown.known_length.filter(|_| !self.has_saved_scale()), ..shown }
    }

    /// Returns whether the scene must be saved before the command line renders the shown state.
    fn is_edited(&self) -> bool {
        let (state, saved) = (self.state(), self.saved_lights());
        match self.saved_known_length() {
            known if known == state.known_length => is_edited(&state.lights, saved),
            // The option scales the file's lights, too.
            None => is_edited(&state.lights, &saved.in_scaled_room(self.scene().scale)),
            Some(_) => true,
        }
    }

    fn has_saved_scale(&self) -> bool {
        self.saved_known_length() == self.state().known_length
    }
}

/// Returns whether light edits differ from the scene file's in a way that the options of `insert` cannot express.
fn is_edited(lights: &LightEdits, of_file: &LightEdits) -> bool {
    // Options of `insert` express a choice of light, but not the removal of the file's choice.
    let inferred = lights.inferred.or(of_file.inferred);
    LightEdits { inferred, ..of_file.clone() } != *lights
}
