//! Messages between page and server over the WebSocket.
//!
//! The page sends [`FromPage`] as JSON in text messages. The server sends [`ToPage`] as JSON: in a text message without
//! images, else in a binary message. The latter holds the length of the JSON as a 32-bit little-endian integer, the
//! JSON, then the images, whose lengths are in the JSON.

use std::ops::RangeInclusive;

use lo_geometry::Camera;
use lo_session::{Command, OutsideView, Overlay, RenderStep, RoomExtent, SessionView};
use serde::{Deserialize, Serialize};

pub use crate::recent::RecentRoom;
pub use crate::sample::SampleView;

/// JPEG quality of drafts.
pub(crate) const DRAFT_JPEG_QUALITY: u8 = 88;

/// Maximum length of a page's message, bytes.
pub const MAX_MESSAGE: usize = 64 << 10;

/// Accepted exposures, stops.
pub const EXPOSURES_EV: RangeInclusive<f32> = -20.0..=20.0;

/// Accepted distances of a probe from its surface, metres.
pub const PROBE_LIFTS_M: RangeInclusive<f32> = 0.0..=10.0;

/// Slots of messages in the outbox.
pub(crate) const RECENT_SLOT: u8 = 1;
pub(crate) const OPENING_SLOT: u8 = 2;
pub(crate) const OVERLAY_SLOT: u8 = 10;

/// A message from the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum FromPage {
    /// Executes a command as one step of the history.
    Command {
        /// The command.
        command: Command,
    },
    /// Previews a command as part of a gesture.
    Preview {
        /// The command.
        command: Command,
        /// Number of the message; images refer to it.
        sequence: u64,
    },
    /// Commits the gesture.
    Commit,
    /// Cancels the gesture.
    Cancel,
    /// Undoes the last step.
    Undo,
    /// Redoes the last undone step.
    Redo,
    /// Moves to another time.
    Seek {
        /// The time, seconds.
        time_s: f64,
        /// Number of the message; images refer to it.
        sequence: u64,
    },
    /// Cancels the download of frames or a video.
    #[serde(rename = "stop-film")]
    StopSequence,
    /// Requests the light at a point.
    Probe {
        /// Photo position of the surface below the point.
        pixel: [f64; 2],
        /// Distance from the surface, metres.
        lift_m: f32,
        /// Exposure of the images, stops.
        exposure_ev: f32,
    },
    /// Requests the length between two photo positions.
    Measure {
        /// Photo positions of the ends, pixels.
        ends: [[f64; 2]; 2],
    },
    /// Requests an overlay.
    Overlay {
        /// The overlay.
        what: Overlay,
    },
    /// Requests an image of the room from outside. Replaces the page's previous request, even while that is rendered.
    Outside {
        /// Number of the request; the image refers to it.
        sequence: u64,
        /// The view.
        view: OutsideView,
    },
    /// Cancels opening a scene.
    Stop,
    /// Declares that the browser has written the scene of a change to a file.
    Saved {
        /// Number of the change, from the download's header `x-change`.
        change: u64,
        /// Name of the file.
        file: String,
    },
}

/// A message from the server.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum ToPage {
    /// The first message.
    Hello {
        /// Version of the program.
        version: &'static str,
        /// Material presets.
        materials: Vec<Preset>,
        /// Whether this program can estimate photos.
        can_estimate: bool,
        /// Whether open rooms are saved automatically.
        autosaves: bool,
        /// Photos to try the program with.
        samples: Vec<SampleView>,
    },
    /// No scene is open.
    Empty {
        /// Why the last scene could not be opened.
        error: Option<String>,
    },
    /// A scene is being opened. The one that is open stays until then.
    Opening {
        /// Name of the file.
        file: String,
        /// Current stage.
        stage: String,
        /// Progress of the stage, 0 to 1, if known.
        done: Option<f64>,
    },
    /// No scene is being opened any more: it follows, or could not be opened.
    OpeningEnded,
    /// A scene is open.
    Scene(SceneInfo),
    /// The session changed.
    State {
        /// Number of the change; images refer to it.
        change: u64,
        /// The session.
        view: Box<SessionView>,
    },
    /// Warnings about an image.
    Notes {
        /// Number of the change.
        change: u64,
        /// Warnings as sentences.
        notes: Vec<String>,
    },
    /// Progress of the next image.
    Progress {
        /// Number of the change.
        change: u64,
        /// Rendering step.
        step: RenderStep,
        /// Current stage.
        stage: String,
        /// Progress of the stage, 0 to 1.
        done: f64,
    },
    /// The photo that patches are laid over, JPEG.
    Photo {
        /// Length of the image, bytes.
        lengths: [usize; 1],
    },
    /// An image, or the region of it that differs from [`ToPage::Photo`].
    Frame {
        /// Number of the change that the image shows.
        change: u64,
        /// Number of the last preview that the image shows.
        sequence: u64,
        /// Rendering step.
        step: RenderStep,
        /// `image/jpeg` or `image/png`.
        mime: &'static str,
        /// Column and row on [`ToPage::Photo`] of the region's first pixel; `None` for a whole image.
        at: Option<[usize; 2]>,
        /// Length of the image, bytes.
        lengths: [usize; 1],
        /// Rendering time, milliseconds.
        took_ms: f64,
    },
    /// The light at a point: panorama, mirror ball, and provenance of the panorama, PNG.
    Probe {
        /// Photo position of the request.
        pixel: [f64; 2],
        /// The point, metres.
        at_m: [f32; 3],
        /// Lengths of the images, bytes.
        lengths: [usize; 3],
    },
    /// There is no surface at the requested position.
    NoProbe,
    /// The length between two photo positions.
    Measured {
        /// Photo positions of the ends, pixels.
        ends: [[f64; 2]; 2],
        /// The length, metres; `None` if an end has no depth.
        length_m: Option<f32>,
    },
    /// An overlay, PNG.
    Overlay {
        /// The overlay.
        what: Overlay,
        /// CSS colours and their meanings.
        legend: Vec<(String, String)>,
        /// Length of the image, bytes.
        lengths: [usize; 1],
    },
    /// An image of the room from outside.
    Outside {
        /// Number of the request.
        sequence: u64,
        /// `image/jpeg` during a movement, `image/png` at rest.
        mime: &'static str,
        /// Length of the image, bytes.
        lengths: [usize; 1],
        /// Rendering time, milliseconds.
        took_ms: f64,
    },
    /// Progress of a sequence download.
    #[serde(rename = "film")]
    SequenceProgress {
        /// Finished frames.
        done: usize,
        /// Total number of frames.
        frames: usize,
        /// Estimated remaining time, seconds, if known.
        left_s: Option<f64>,
        /// Why the download ended early.
        ended: Option<String>,
    },
    /// Recently opened rooms, those changed last first.
    Recent {
        /// The rooms.
        rooms: Vec<RecentRoom>,
    },
    /// A message was refused, or an image could not be rendered.
    Refused {
        /// The reason.
        why: String,
    },
}

/// An open scene.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct SceneInfo {
    /// Unique number of the opened scene.
    pub scene: u64,
    /// Camera, in pixels of the photo.
    pub camera: Camera,
    /// Unit vector against gravity, in the camera's frame.
    pub up: [f32; 3],
    /// Approximate extent of the room.
    pub extent: RoomExtent,
    /// Whether the depth is predicted, not measured.
    pub predicted_depth: bool,
    /// Whether a panorama contributed light.
    pub has_panorama: bool,
    /// Warnings of opening the scene.
    pub notes: Vec<String>,
}

/// A material preset.
#[derive(Clone, Debug, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Preset {
    /// Name.
    pub name: &'static str,
    /// Linear RGB base colour.
    pub base_color: [f32; 3],
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness.
    pub roughness: f32,
}

impl FromPage {
    /// Returns whether a newer message of this kind makes this one obsolete.
    pub fn is_replaceable(&self) -> bool {
        matches!(
            self,
            Self::Preview { .. } | Self::Seek { .. } | Self::Probe { .. } | Self::Overlay { .. } | Self::Outside { .. }
        )
    }
}

impl ToPage {
    /// Returns the slot of the outbox, where a newer message replaces an older one. Lower slots are sent first. `None`
    /// if the message is never replaced.
    pub(crate) fn slot(&self) -> Option<u8> {
        Some(match self {
            Self::Hello { .. } => 0,
            Self::Recent { .. } => RECENT_SLOT,
            Self::Opening { .. } | Self::OpeningEnded => OPENING_SLOT,
            // Mutually exclusive.
            Self::Empty { .. } | Self::Scene(_) => 3,
            Self::State { .. } => 4,
            Self::Notes { .. } => 5,
            Self::Progress { .. } => 6,
            Self::Photo { .. } => 7,
            Self::Frame { .. } => 8,
            Self::Probe { .. } | Self::NoProbe => 9,
            Self::Overlay { .. } => OVERLAY_SLOT,
            Self::Outside { .. } => 11,
            Self::SequenceProgress { .. } => 12,
            Self::Measured { .. } => 13,
            Self::Refused { .. } => return None,
        })
    }
}

/// An encoded message with its images.
#[derive(Clone, Debug)]
pub(crate) enum Encoded {
    Text(String),
    Binary(Vec<u8>),
}

/// Encodes a message.
pub(crate) fn encoded(message: &ToPage, images: &[&[u8]]) -> Encoded {
    let json = serde_json::to_string(message).expect("messages consist of names and numbers, which always serialize");
    if images.is_empty() {
        return Encoded::Text(json);
    }
    let mut bytes = Vec::with_capacity(4 + json.len() + images.iter().map(|image| image.len()).sum::<usize>());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(json.as_bytes());
    images.iter().for_each(|image| bytes.extend(*image));
    Encoded::Binary(bytes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lightoctree::{KnownLength, LightMode};

    use super::*;

    #[test]
    fn messages_of_the_page_are_read_and_others_refused() {
        let read = |text: &str| serde_json::from_str::<FromPage>(text);
        let drag = read(r#"{"type":"preview","sequence":3,"command":{"do":"drag","object":1,"to":[4.5,6]}}"#).unwrap();
        assert_eq!(drag, FromPage::Preview { command: Command::Drag { object: 1, to: [4.5, 6.0] }, sequence: 3 });
        assert_eq!(read(r#"{"type":"undo"}"#).unwrap(), FromPage::Undo);
        let command = |text: &str| match read(&format!(r#"{{"type":"command","command":{text}}}"#)).unwrap() {
            FromPage::Command { command } => command,
            other => panic!("{other:?}"),
        };
        let light = LightMode::Expected;
        assert_eq!(command(r#"{"do":"inferred-light","light":"expected"}"#), Command::InferredLight { light });
        assert_eq!(command(r#"{"do":"contrast","factor":0.7}"#), Command::Contrast { factor: 0.7 });
        assert_eq!(command(r#"{"do":"warmth","ev":-0.5}"#), Command::Warmth { ev: -0.5 });
        assert_eq!(command(r#"{"do":"white","pixel":[4.5,6]}"#), Command::White { pixel: Some([4.5, 6.0]) });
        assert_eq!(command(r#"{"do":"white","pixel":null}"#), Command::White { pixel: None });
        let aim = Command::AimSun { light: "A1".into(), object: 2, to: [4.5, 6.0] };
        assert_eq!(command(r#"{"do":"aim-sun","light":"A1","object":2,"to":[4.5,6]}"#), aim);
        let drag = Command::DragLight { light: "L1".into(), to: [4.5, 6.0] };
        let both = r#"{"do":"together","commands":[{"do":"aim-sun","light":"A1","object":2,"to":[4.5,6]},{"do":"drag-light","light":"L1","to":[4.5,6]}]}"#;
        assert_eq!(command(both), Command::Together { commands: vec![aim, drag] });
        assert_eq!(command(r#"{"do":"known-length","known":null}"#), Command::KnownLength { known: None });
        let ends = [[1.0, 2.0], [3.0, 4.5]];
        let known = Some(KnownLength { ends, length_m: 2.01 });
        let text = r#"{"do":"known-length","known":{"ends":[[1,2],[3,4.5]],"length_m":2.01}}"#;
        assert_eq!(command(text), Command::KnownLength { known });
        assert_eq!(read(r#"{"type":"measure","ends":[[1,2],[3,4.5]]}"#).unwrap(), FromPage::Measure { ends });
        for wrong in [
            r#"{"type":"measure","ends":[[1,2]]}"#,
            r#"{"type":"command","command":{"do":"together","commands":[{"do":"shutdown"}]}}"#,
            r#"{"type":"command","command":{"do":"turn-sun","light":"A1","azimuth_deg":4}}"#,
            r#"{"type":"shutdown"}"#,
            r#"{"type":"command","command":{"do":"drag","object":-1,"to":[4.5,6]}}"#,
            r#"{"type":"outside","sequence":1,"view":{"eye_m":[0,0,1],"target_m":[0,0,-1],"fov_deg":40,"width":-8,"height":8,"exposure_ev":0,"show":null,"still":true}}"#,
            r#"{"type":"outside","sequence":1,"view":{"eye_m":[0,0,1],"target_m":[0,0],"fov_deg":40,"width":8,"height":8,"exposure_ev":0,"show":null,"still":true}}"#,
            r#"{"type":"command","command":{"do":"material","object":1,"material":{"base_color_texture":"/etc/passwd"}}}"#,
            r#"{"type":"command","command":{"do":"inferred-light","light":"bright"}}"#,
            r#"{"type":"command","command":{"do":"contrast"}}"#,
            r#"{"type":"command","command":{"do":"warmth","ev":"red"}}"#,
            r#"{"type":"command","command":{"do":"white","pixel":[1]}}"#,
            "{}",
            "",
        ] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn images_follow_the_json() {
        let message = ToPage::Refused { why: "no".into() };
        let Encoded::Binary(bytes) = encoded(&message, &[b"one", b"two"]) else { panic!() };
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        assert_eq!(&bytes[4..4 + length], br#"{"type":"refused","why":"no"}"#);
        assert_eq!(&bytes[4 + length..], b"onetwo");
        assert!(matches!(encoded(&message, &[]), Encoded::Text(_)));
    }
}
