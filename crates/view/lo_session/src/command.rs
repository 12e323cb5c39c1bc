use lightoctree::LightMode;
use lightoctree::insert::{Align, Interpolation};
use lightoctree::scene::LightChange;
use serde::{Deserialize, Serialize};

use crate::{NewLight, ObjectMaterial, Place, Size};

/// One thing that a session's user does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Command {
    /// Puts a new object into the photo, on the surface seen at a pixel, or where there is a free surface.
    Add {
        /// Name of its mesh.
        mesh: String,
        /// Where.
        #[serde(default)]
        pixel: Option<[f64; 2]>,
        /// Its material instead of the mesh's own.
        #[serde(default)]
        material: Option<ObjectMaterial>,
    },
    /// Puts the same object beside.
    Duplicate {
        /// Which.
        object: u32,
    },
    /// Takes an object away.
    Delete {
        /// Which.
        object: u32,
    },
    /// Calls an object otherwise.
    Rename {
        /// Which.
        object: u32,
        /// How.
        name: String,
    },
    /// Stands an object elsewhere.
    Place {
        /// Which.
        object: u32,
        /// Where.
        place: Place,
    },
    /// Drags an object so that its base's middle is seen at a photo position: along the surface it stands on.
    Drag {
        /// Which.
        object: u32,
        /// Where to.
        to: [f64; 2],
    },
    /// Makes an object larger or smaller.
    Size {
        /// Which.
        object: u32,
        /// How large.
        size: Size,
    },
    /// Turns an object about its up.
    Turn {
        /// Which.
        object: u32,
        /// To where, degrees.
        yaw_deg: f64,
    },
    /// Stands an object upright, along its surface or along the picture.
    Align {
        /// Which.
        object: u32,
        /// How.
        align: Align,
    },
    /// Gives an object a material, or the mesh's own.
    Material {
        /// Which.
        object: u32,
        /// What.
        material: Option<ObjectMaterial>,
    },
    /// Adds a keyframe where an object stands now, or puts it in the place of the one of that time.
    SetKey {
        /// Which object.
        object: u32,
        /// When, seconds.
        time_s: f64,
    },
    /// Moves a keyframe to another time. As part of a gesture it is told from where it was before.
    MoveKey {
        /// Of which object.
        object: u32,
        /// From when, seconds.
        from_s: f64,
        /// To when, seconds.
        to_s: f64,
    },
    /// Takes a keyframe away.
    DeleteKey {
        /// Of which object.
        object: u32,
        /// Of when, seconds.
        time_s: f64,
    },
    /// How an object goes from keyframe to keyframe.
    Interpolate {
        /// Which.
        object: u32,
        /// How.
        interpolation: Interpolation,
    },
    /// In how many pictures movements are shown, and how fast.
    Frames {
        /// How many; else as many as the keyframes take at `fps`.
        #[serde(default)]
        frames: Option<u32>,
        /// Frames per second.
        fps: u32,
    },
    /// How polished what carries the objects is.
    FloorGloss {
        /// From 0 to 1.
        gloss: f32,
    },
    /// Chooses the light of what no photo shows.
    GuessedLight {
        /// Which.
        light: LightMode,
    },
    /// Tunes the contrast of plausible light.
    Contrast {
        /// Factor on that of similar rooms in stops, from 0 to 3.
        factor: f32,
    },
    /// Tunes the colour of expected and plausible light.
    Warmth {
        /// Stops by which it is redder than estimated, from −4 to 4.
        ev: f32,
    },
    /// Says what is white: expected and plausible light get the colour that it has in the photo.
    White {
        /// A pixel that shows it, or none.
        #[serde(default)]
        pixel: Option<[f64; 2]>,
    },
    /// Changes a light of the list.
    SetLight {
        /// Its name in the list.
        light: String,
        /// What is changed of it.
        change: LightChange,
    },
    /// Adds a light.
    AddLight {
        /// What.
        new: NewLight,
    },
    /// Puts another light in the place of one that was added.
    ReplaceLight {
        /// Its name in the list.
        light: String,
        /// What.
        new: NewLight,
    },
    /// Takes an added light away.
    RemoveLight {
        /// Its name in the list.
        light: String,
    },
    /// Forgets all changes of the light.
    ResetLights,
}
