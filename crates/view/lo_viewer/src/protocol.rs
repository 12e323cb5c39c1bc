//! What page and server say to each other over the WebSocket.
//!
//! The page sends one [`FromPage`] as JSON in a text message. The server sends one [`ToPage`] as JSON, in a text message where that is all; where pictures
//! belong to it, in a binary message: the length of the JSON as a 32-bit little-endian number, the JSON, then the pictures one after the other, whose
//! lengths the JSON tells.

use std::ops::RangeInclusive;

use lightoctree::geometry::Camera;
use lo_session::{Command, OutsideView, Overlay, RoomExtent, SessionView, Step};
use serde::{Deserialize, Serialize};

/// JPEG quality of pictures of what moves.
pub(crate) const MOVING_QUALITY: u8 = 88;

/// Longest message from a page, bytes.
pub const MAX_MESSAGE: usize = 64 << 10;

/// Exposures that a page may ask for, stops.
pub const EXPOSURES_EV: RangeInclusive<f32> = -20.0..=20.0;

/// What a page says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum FromPage {
    /// Does something, as a step of the history.
    Command {
        /// What.
        command: Command,
    },
    /// Shows what a command comes to, as part of a gesture that is kept or dropped.
    Preview {
        /// What.
        command: Command,
        /// The page's own number of the message, which the picture of it tells.
        sequence: u64,
    },
    /// Keeps the gesture.
    Commit,
    /// Drops the gesture.
    Cancel,
    /// Takes the last step back.
    Undo,
    /// Takes the last undone step again.
    Redo,
    /// OutsideQueue at another time.
    Seek {
        /// When, seconds.
        time_s: f64,
        /// The page's own number of the message, which the picture of it tells.
        sequence: u64,
    },
    /// Gives up the frames or the video that are being taken away.
    StopFilm,
    /// Asks for the light at a place.
    Probe {
        /// The photo position that it is above.
        pixel: [f64; 2],
        /// How far off that surface, metres.
        lift_m: f32,
        /// Stops by which the pictures are brightened.
        exposure_ev: f32,
    },
    /// Asks for an overlay.
    Overlay {
        /// Of what.
        what: Overlay,
    },
    /// Asks for a picture of the room from outside. It takes the place of the last one that the page asked for, even while that is drawn.
    Outside {
        /// The page's own number of the message, which the picture tells.
        sequence: u64,
        /// From where.
        view: OutsideView,
    },
    /// Gives up what is being opened.
    Stop,
    /// Closes the scene, for another one.
    Close,
}

/// What the server says.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "type", rename_all = "kebab-case")]
pub enum ToPage {
    /// The first message.
    Hello {
        /// The program's version.
        version: &'static str,
        /// Materials by name.
        materials: Vec<Preset>,
    },
    /// No scene is open.
    Empty {
        /// What went wrong with the last one.
        error: Option<String>,
        /// Whether photos can be estimated here.
        can_estimate: bool,
    },
    /// A scene is being opened.
    Opening {
        /// What.
        file: String,
        /// What is being done.
        stage: String,
        /// How much of that is done, 0 to 1, where it is known.
        done: Option<f64>,
    },
    /// A scene is open.
    Scene(SceneInfo),
    /// What stands in it.
    State {
        /// Number of the change; pictures tell which one they show.
        change: u64,
        /// All of it.
        view: Box<SessionView>,
    },
    /// What the user should know of the picture, in words.
    Notes {
        /// Number of the change.
        change: u64,
        /// One by one.
        notes: Vec<String>,
    },
    /// How far the next picture is.
    Progress {
        /// Number of the change.
        change: u64,
        /// Which picture.
        step: Step,
        /// What is being done.
        stage: String,
        /// How much of that is done, 0 to 1.
        done: f64,
    },
    /// The photo that parts of pictures lie on, JPEG.
    Photo {
        /// Its length in bytes.
        lengths: [usize; 1],
    },
    /// A picture, or what differs in it from [`ToPage::Photo`].
    Frame {
        /// Number of the change that it shows.
        change: u64,
        /// The last preview's number that went into it.
        sequence: u64,
        /// Which picture.
        step: Step,
        /// `image/jpeg` or `image/png`.
        mime: &'static str,
        /// Where on [`ToPage::Photo`] it lies, column and row of its first pixel; `None` for a whole picture.
        at: Option<[usize; 2]>,
        /// Its length in bytes.
        lengths: [usize; 1],
        /// How long the server worked at it, milliseconds.
        took_ms: f64,
    },
    /// The light at a place: panorama, mirror ball, and who says what the panorama shows, all PNG.
    Probe {
        /// The photo position.
        pixel: [f64; 2],
        /// The place, metres.
        at_m: [f32; 3],
        /// Their lengths in bytes.
        lengths: [usize; 3],
    },
    /// There is no surface at the place of the probe.
    NoProbe,
    /// An overlay, PNG.
    Overlay {
        /// Of what.
        what: Overlay,
        /// Colours (CSS) and what they mean.
        legend: Vec<(String, String)>,
        /// Its length in bytes.
        lengths: [usize; 1],
    },
    /// The room from outside.
    Outside {
        /// The number of the message that asked for it.
        sequence: u64,
        /// `image/jpeg` while the view moves, `image/png` when it is still.
        mime: &'static str,
        /// Its length in bytes.
        lengths: [usize; 1],
        /// How long the server worked at it, milliseconds.
        took_ms: f64,
    },
    /// How far the frames or the video are that are being taken away.
    Film {
        /// Pictures that are finished.
        done: usize,
        /// Of how many.
        frames: usize,
        /// How long the rest will take, seconds, once that can be told.
        left_s: Option<f64>,
        /// Why it ended before, if it did.
        ended: Option<String>,
    },
    /// What was asked for was not done.
    Refused {
        /// Why.
        why: String,
    },
}

/// An open scene.
#[derive(Clone, Debug, Serialize)]
pub struct SceneInfo {
    /// Its number; another scene has another one.
    pub scene: u64,
    /// What the command line calls its file.
    pub file: String,
    /// Whether that file is there; else it is to be saved first.
    pub is_saved: bool,
    /// The camera, in pixels of the photo.
    pub camera: Camera,
    /// Unit vector against gravity, in the camera's frame.
    pub up: [f32; 3],
    /// About where the room is.
    pub extent: RoomExtent,
    /// Whether depth is predicted.
    pub predicted_depth: bool,
    /// Whether a panorama gave some of its light.
    pub has_panorama: bool,
    /// What was said while it was opened.
    pub notes: Vec<String>,
}

/// A material by name.
#[derive(Clone, Debug, Serialize)]
pub struct Preset {
    /// Its name.
    pub name: &'static str,
    /// Linear RGB.
    pub base_color: [f32; 3],
    /// 0 dielectric … 1 metal.
    pub metallic: f32,
    /// Perceptual roughness.
    pub roughness: f32,
}

impl FromPage {
    /// Whether a newer message of this kind takes its place.
    pub fn is_passing(&self) -> bool {
        matches!(self, Self::Preview { .. } | Self::Seek { .. } | Self::Probe { .. } | Self::Outside { .. })
    }
}

impl ToPage {
    /// What a newer message takes the place of; smaller ones are sent first. `None` for what is said once.
    pub(crate) fn slot(&self) -> Option<u8> {
        Some(match self {
            Self::Hello { .. } => 0,
            // One of them is the case.
            Self::Empty { .. } | Self::Opening { .. } | Self::Scene(_) => 1,
            Self::State { .. } => 2,
            Self::Notes { .. } => 3,
            Self::Progress { .. } => 4,
            Self::Photo { .. } => 5,
            Self::Frame { .. } => 6,
            Self::Probe { .. } | Self::NoProbe => 7,
            Self::Overlay { .. } => 8,
            Self::Outside { .. } => 9,
            Self::Film { .. } => 10,
            Self::Refused { .. } => return None,
        })
    }
}

/// A message with its pictures, encoded.
#[derive(Clone, Debug)]
pub(crate) enum Encoded {
    Text(String),
    Binary(Vec<u8>),
}

/// Encodes a message.
pub(crate) fn encoded(message: &ToPage, pictures: &[&[u8]]) -> Encoded {
    let json = serde_json::to_string(message).expect("messages hold names and numbers, which can be written as JSON");
    if pictures.is_empty() {
        return Encoded::Text(json);
    }
    let mut bytes = Vec::with_capacity(4 + json.len() + pictures.iter().map(|picture| picture.len()).sum::<usize>());
    bytes.extend((json.len() as u32).to_le_bytes());
    bytes.extend(json.as_bytes());
    pictures.iter().for_each(|picture| bytes.extend(*picture));
    Encoded::Binary(bytes)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lightoctree::LightMode;

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
        assert_eq!(command(r#"{"do":"guessed-light","light":"expected"}"#), Command::GuessedLight { light });
        assert_eq!(command(r#"{"do":"contrast","factor":0.7}"#), Command::Contrast { factor: 0.7 });
        assert_eq!(command(r#"{"do":"warmth","ev":-0.5}"#), Command::Warmth { ev: -0.5 });
        assert_eq!(command(r#"{"do":"white","pixel":[4.5,6]}"#), Command::White { pixel: Some([4.5, 6.0]) });
        assert_eq!(command(r#"{"do":"white","pixel":null}"#), Command::White { pixel: None });
        for wrong in [
            r#"{"type":"shutdown"}"#,
            r#"{"type":"command","command":{"do":"drag","object":-1,"to":[4.5,6]}}"#,
            r#"{"type":"outside","sequence":1,"view":{"eye_m":[0,0,1],"target_m":[0,0,-1],"fov_deg":40,"width":-8,"height":8,"exposure_ev":0,"show":null,"still":true}}"#,
            r#"{"type":"outside","sequence":1,"view":{"eye_m":[0,0,1],"target_m":[0,0],"fov_deg":40,"width":8,"height":8,"exposure_ev":0,"show":null,"still":true}}"#,
            r#"{"type":"command","command":{"do":"material","object":1,"material":{"base_color_texture":"/etc/passwd"}}}"#,
            r#"{"type":"command","command":{"do":"guessed-light","light":"bright"}}"#,
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
    fn pictures_stand_behind_the_json() {
        let message = ToPage::Refused { why: "no".into() };
        let Encoded::Binary(bytes) = encoded(&message, &[b"one", b"two"]) else { panic!() };
        let length = u32::from_le_bytes(bytes[..4].try_into().unwrap()) as usize;
        assert_eq!(&bytes[4..4 + length], br#"{"type":"refused","why":"no"}"#);
        assert_eq!(&bytes[4 + length..], b"onetwo");
        assert!(matches!(encoded(&message, &[]), Encoded::Text(_)));
    }
}
