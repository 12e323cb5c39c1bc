use lightoctree::insert::{Align, Path};
use lightoctree::lights::{ListedLight, sun_angles_deg};
use lightoctree::scene::{AddedLight, LightChange, LightEdits, LightShape};
use lightoctree::{GuessedLight, LightEffect};
use serde::Serialize;

use crate::{ObjectMaterial, Place, Session, Size, insert_command};

/// What a session shows, as data for a front end.
#[derive(Clone, Debug, Serialize)]
pub struct SessionView {
    /// What stands in the photo.
    pub objects: Vec<ObjectView>,
    /// Which light it is lit by.
    pub guessed_light: GuessedLightView,
    /// What gives light.
    pub lights: Vec<LightView>,
    /// How polished what carries the objects is.
    pub floor_gloss: f32,
    /// Whether there is something to undo.
    pub can_undo: bool,
    /// Whether there is something to do again.
    pub can_redo: bool,
    /// The command line that makes the final picture; none without objects.
    pub command: Option<String>,
    /// Whether the command line needs the scene saved first: its light is edited otherwise than its file says.
    pub edited: bool,
    /// Names of the meshes that objects can be made of.
    pub meshes: Vec<String>,
    /// What moves when.
    pub timeline: TimelineView,
}

/// Times of a session.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct TimelineView {
    /// The time that is looked at, seconds.
    pub time_s: f64,
    /// Times of the first keyframe and of the last, where something moves.
    pub span_s: Option<[f64; 2]>,
    /// Number of frames of a sequence.
    pub frames: u32,
    /// Whether somebody chose that.
    pub is_chosen: bool,
    /// Frames per second.
    pub fps: u32,
}

/// One object.
#[derive(Clone, Debug, Serialize)]
pub struct ObjectView {
    /// Its number.
    pub id: u32,
    /// Its name.
    pub name: String,
    /// Its mesh's name.
    pub mesh: String,
    /// Where it was put.
    pub place: Place,
    /// How large it was made.
    pub size: Size,
    /// How far it was turned, degrees.
    pub yaw_deg: f64,
    /// Its keyframes, where it moves.
    pub path: Option<Path>,
    /// Which way is up for it.
    pub align: Align,
    /// Its material, where it is not the mesh's own.
    pub material: Option<ObjectMaterial>,
    /// Middle of its base, metres.
    pub position_m: [f32; 3],
    /// Unit vector of its up.
    pub up: [f32; 3],
    /// Extent along its own axes, metres.
    pub size_m: [f32; 3],
    /// Metres per unit of its mesh.
    pub scale: f32,
    /// Whether it rests on something.
    pub rests: bool,
}

/// The light of what no photo shows.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct GuessedLightView {
    /// Which, and how it is tuned.
    #[serde(flatten)]
    pub chosen: GuessedLight,
    /// What another choice would change.
    pub effect: LightEffect,
}

/// One light.
#[derive(Clone, Debug, Serialize)]
pub struct LightView {
    /// Before changes.
    #[serde(flatten)]
    pub listed: ListedLight,
    /// What is changed of it.
    pub changed: LightChange,
    /// Of a sun, degrees to the right of where the camera looks and above the horizon.
    pub sun_deg: Option<[f64; 2]>,
}

impl Session {
    /// What it shows.
    pub fn view(&self) -> SessionView {
        let state = self.state();
        let open = self.open();
        let objects = state.objects.iter().map(|object| ObjectView {
            id: object.id,
            name: object.name.clone(),
            mesh: object.mesh.name().to_owned(),
            place: object.place,
            size: object.size,
            yaw_deg: object.yaw_deg,
            path: object.path.clone(),
            align: object.align,
            material: object.material.clone(),
            position_m: object.placement.position_m.to_array(),
            up: object.placement.up.to_array(),
            size_m: (object.mesh.size() * object.placement.scale).to_array(),
            scale: object.placement.scale,
            rests: object.placement.support.is_some(),
        });
        let found = open.lights().iter().map(|listed| LightView {
            changed: state.lights.change_of(&listed.id),
            listed: ListedLight { change: None, ..listed.clone() },
            sun_deg: None,
        });
        let added = |added: &AddedLight| LightView {
            listed: ListedLight { change: None, ..ListedLight::of_added(added) },
            changed: added.change,
            sun_deg: match added.light.shape {
                LightShape::Sun { direction, .. } => Some(sun_angles_deg(open.estimate(), direction)),
                _ => None,
            },
        };
        let [can_undo, can_redo] = self.can_undo_and_redo();
        SessionView {
            objects: objects.collect(),
            guessed_light: GuessedLightView {
                chosen: state.lights.guessed.unwrap_or_default(),
                effect: LightEffect::of(open.estimate()),
            },
            lights: found.chain(state.lights.added.iter().map(added)).collect(),
            floor_gloss: state.floor_gloss,
            can_undo,
            can_redo,
            command: insert_command(&open.file, state),
            edited: is_edited(&state.lights, &open.document.light_edits),
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

/// Whether lights differ from those of the scene's file in a way that the options of `insert` do not tell.
fn is_edited(lights: &LightEdits, of_file: &LightEdits) -> bool {
    // The options tell a choice, and nothing of what the file has where there is none.
    let guessed = lights.guessed.or(of_file.guessed);
    LightEdits { guessed, ..of_file.clone() } != *lights
}
