use lightoctree::{KnownLength, LightMode};
use lo_insert::{Align, Interpolation};
use lo_scene::LightChange;
use serde::{Deserialize, Serialize};

use crate::{NewLight, ObjectMaterial, ObjectPosition, ObjectSize};

/// One edit of a session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(tag = "do", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Command {
    /// Adds an object on the floor, shelf or table, or against the wall seen at a pixel, beside other objects.
    Add {
        /// Name of the mesh.
        mesh: String,
        /// Photo position; `None` chooses a free supporting surface.
        #[serde(default)]
        #[cfg_attr(feature = "typescript", ts(optional = nullable))]
        pixel: Option<[f64; 2]>,
        /// Replaces the mesh's own materials.
        #[serde(default)]
        #[cfg_attr(feature = "typescript", ts(optional = nullable))]
        material: Option<ObjectMaterial>,
    },
    /// Adds a copy next to an object.
    Duplicate {
        /// Id of the object.
        object: u32,
    },
    /// Deletes an object.
    Delete {
        /// Id of the object.
        object: u32,
    },
    /// Renames an object.
    Rename {
        /// Id of the object.
        object: u32,
        /// The new name.
        name: String,
    },
    /// Moves an object to a position.
    Place {
        /// Id of the object.
        object: u32,
        /// The new position.
        place: ObjectPosition,
    },
    /// Drags an object so that the middle of its base projects to a photo position: onto the surface seen there, or at
    /// its height if it is lifted.
    Drag {
        /// Id of the object.
        object: u32,
        /// Photo position, pixels.
        to: [f64; 2],
    },
    /// Drops an object along gravity onto the surface below it.
    PutDown {
        /// Id of the object.
        object: u32,
    },
    /// Scales an object.
    Size {
        /// Id of the object.
        object: u32,
        /// The new size.
        size: ObjectSize,
    },
    /// Rotates an object about its up axis.
    Turn {
        /// Id of the object.
        object: u32,
        /// The new rotation, degrees.
        yaw_deg: f64,
    },
    /// Aligns an object with gravity, its supporting surface or the image.
    Align {
        /// Id of the object.
        object: u32,
        /// The new alignment.
        align: Align,
    },
    /// Sets an object's material, or restores the mesh's own.
    Material {
        /// Id of the object.
        object: u32,
        /// The material; `None` restores the mesh's own.
        material: Option<ObjectMaterial>,
    },
    /// Shows an object in images, or hides it.
    Show {
        /// Id of the object.
        object: u32,
        /// Whether images show it.
        is_shown: bool,
    },
    /// Protects an object from being moved by accident, or releases it.
    Lock {
        /// Id of the object.
        object: u32,
        /// Whether it is protected.
        is_locked: bool,
    },
    /// Adds a keyframe of an object's current pose, replacing one at the same time.
    SetKey {
        /// Id of the object.
        object: u32,
        /// Time of the keyframe, seconds.
        time_s: f64,
    },
    /// Moves a keyframe to another time. Within a gesture, `from_s` is the time before the gesture.
    MoveKey {
        /// Id of the object.
        object: u32,
        /// Current time of the keyframe, seconds.
        from_s: f64,
        /// New time of the keyframe, seconds.
        to_s: f64,
    },
    /// Deletes a keyframe.
    DeleteKey {
        /// Id of the object.
        object: u32,
        /// Time of the keyframe, seconds.
        time_s: f64,
    },
    /// Sets the interpolation between an object's keyframes.
    Interpolate {
        /// Id of the object.
        object: u32,
        /// The new interpolation.
        interpolation: Interpolation,
    },
    /// Scales the room, so that a length in it is the known one.
    KnownLength {
        /// The length; `None` restores the scale of the scene file.
        #[serde(default)]
        #[cfg_attr(feature = "typescript", ts(optional = nullable))]
        known: Option<KnownLength>,
    },
    /// Sets the length and rate of the sequence.
    Frames {
        /// Number of frames; `None` follows from the keyframes and `fps`.
        #[serde(default)]
        #[cfg_attr(feature = "typescript", ts(optional = nullable))]
        frames: Option<u32>,
        /// Frames per second.
        fps: u32,
    },
    /// Sets the gloss of the surfaces that carry objects.
    FloorGloss {
        /// From 0 to 1.
        gloss: f32,
    },
    /// Chooses the light of unobserved regions.
    InferredLight {
        /// The light.
        light: LightMode,
    },
    /// Tunes the contrast of plausible light.
    Contrast {
        /// Factor on the contrast of similar rooms in stops, 0 to 3.
        factor: f32,
    },
    /// Tunes the colour of expected and plausible light.
    Warmth {
        /// Stops by which the light is redder than estimated, −4 to 4.
        ev: f32,
    },
    /// Declares a pixel white: expected and plausible light take its colour in the photo.
    White {
        /// Position of the pixel; `None` clears it.
        #[serde(default)]
        #[cfg_attr(feature = "typescript", ts(optional = nullable))]
        pixel: Option<[f64; 2]>,
    },
    /// Edits a listed light.
    SetLight {
        /// Id of the light.
        light: String,
        /// The edit.
        change: LightChange,
    },
    /// Adds a light.
    AddLight {
        /// The new light.
        new: NewLight,
    },
    /// Replaces an added light.
    ReplaceLight {
        /// Id of the light.
        light: String,
        /// The new light.
        new: NewLight,
    },
    /// Removes an added light.
    RemoveLight {
        /// Id of the light.
        light: String,
    },
    /// Moves a light to the surface seen at a photo position: a sphere touches it. Stays where the photo has no depth.
    DragLight {
        /// Id of the light.
        light: String,
        /// Photo position, pixels.
        to: [f64; 2],
    },
    /// Aims an added sun so that the shadow of an object's top falls on a photo position.
    AimSun {
        /// Id of the light.
        light: String,
        /// Id of the object.
        object: u32,
        /// Photo position of the shadow, pixels.
        to: [f64; 2],
    },
    /// Sets the direction of an added sun.
    TurnSun {
        /// Id of the light.
        light: String,
        /// Degrees to the right of the camera's axis, about the vertical.
        azimuth_deg: f32,
        /// Degrees above the horizon.
        elevation_deg: f32,
    },
    /// Discards all light edits.
    ResetLights,
    /// Executes commands as one step, such as moving several objects.
    Together {
        /// The commands, at most as many as objects; none of them moves a keyframe, scales the room or consists of
        /// others.
        commands: Vec<Command>,
    },
}
