//! What a user can set.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::description::{RoomKind, Weather};
use crate::error::SynthError;

/// How the pitch of cameras is distributed within [`SynthConfig::pitch_deg`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tilt {
    /// Nearly level most of the time: the mean of two uniform draws.
    Level,
    /// All pitches alike, as phones are held.
    Uniform,
}

/// How generated rooms are distributed. Every field has a default; shares are probabilities from 0 to 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthConfig {
    /// Relative weights of the uses; kinds that are not named do not occur.
    pub room_weights: BTreeMap<RoomKind, f32>,
    /// Share of L-shaped rooms among those large enough.
    pub l_shape_share: f32,
    /// Share of sloped ceilings among rectangular bedrooms, living rooms, offices and studios.
    pub sloped_ceiling_share: f32,
    /// Share of rooms without windows (bathrooms and corridors have their own).
    pub windowless_share: f32,
    /// Share of rooms (without bathrooms, corridors and cellars) one or two of whose walls are glazed almost from end to end and up to near the ceiling.
    pub glazed_share: f32,
    /// Relative weights of what is outside; `panorama` is ignored here, see `panorama_share`.
    pub weather_weights: BTreeMap<Weather, f32>,
    /// A folder of outdoor equirectangular HDR panoramas (`.hdr`, `.exr`), Y up.
    pub panorama_folder: Option<PathBuf>,
    /// Share of rooms whose windows show one of these panoramas, where a folder is given.
    pub panorama_share: f32,
    /// Folders of pictures (`.jpg`, `.png`, `.webp`; equirectangular `.hdr` and `.exr`, of which views are cut) for posters, screens, covers.
    pub picture_folders: Vec<PathBuf>,
    /// Share of such things that show one of these pictures, where folders are given; the rest is drawn.
    pub picture_share: f32,
    /// Share of rooms with dark walls and furniture.
    pub dark_share: f32,
    /// Share of rooms with light walls and furniture; the rest lies between.
    pub light_share: f32,
    /// Share of rooms lit by a single lamp.
    pub single_lamp_share: f32,
    /// Share of rooms lit by far more lamps than needed.
    pub over_lit_share: f32,
    /// Share of rooms whose lamps are of different colours.
    pub mixed_light_share: f32,
    /// Share of rooms after dark with a thirtieth to a quarter of the usual light.
    pub dim_share: f32,
    /// Share of rooms by day (without those that show a panorama) into which the sun shines: their sky is clear, the sun stands before a window.
    pub sun_share: f32,
    /// Share of rooms by day, with windows, in which no lamp burns, whatever the other shares say.
    pub daylit_share: f32,
    /// Share of rooms with hardly anything lying about.
    pub clean_share: f32,
    /// Share of rooms full of things.
    pub cluttered_share: f32,
    /// Share of rooms in which papers, packages, devices and cables lie about and posters hang.
    pub litter_share: f32,
    /// Share of rooms whose surfaces are worn, stained, now and then patterned, and have a relief (normal maps).
    pub worn_share: f32,
    /// Share of halls, workshops, studios, class rooms, laboratories, open plans and empty rooms that are 1.4 to 3 times as long and as wide, and higher.
    pub large_share: f32,
    /// Share of rooms with one to three people in them.
    pub people_share: f32,
    /// Least and greatest horizontal field of view of crops, degrees.
    pub hfov_deg: [f32; 2],
    /// Least and greatest height of cameras above the floor, metres.
    pub camera_height_m: [f32; 2],
    /// Greatest pitch of cameras, degrees.
    pub pitch_deg: f32,
    /// Distribution of their pitch.
    pub tilt: Tilt,
    /// Greatest roll of cameras, degrees.
    pub roll_deg: f32,
    /// Width and height of crops, pixels.
    pub crop_size: [u32; 2],
    /// Share of photos held the other way: width and height change places, the field of view stays along the longer side.
    pub upright_share: f32,
    /// Share of photos of things close by: from 0.4 to 1.5 m, looking down by 10 to 60° at what stands on tables and on the floor, or level at what
    /// stands high.
    pub close_up_share: f32,
    /// Share of the other photos that are taken from 0.1 to 0.5 m above the floor.
    pub low_camera_share: f32,
}

impl Default for SynthConfig {
    fn default() -> Self {
        let rooms = [
            (RoomKind::Bedroom, 0.17),
            (RoomKind::Living, 0.2),
            (RoomKind::Kitchen, 0.11),
            (RoomKind::Office, 0.13),
            (RoomKind::Dining, 0.08),
            (RoomKind::Bathroom, 0.07),
            (RoomKind::Corridor, 0.05),
            (RoomKind::Studio, 0.07),
            (RoomKind::Classroom, 0.04),
            (RoomKind::OpenPlan, 0.08),
        ];
        let weather =
            [(Weather::Clear, 0.36), (Weather::Overcast, 0.26), (Weather::Sunset, 0.13), (Weather::Night, 0.25)];
        Self {
            room_weights: BTreeMap::from(rooms),
            l_shape_share: 0.2,
            sloped_ceiling_share: 0.15,
            windowless_share: 0.08,
            glazed_share: 0.0,
            weather_weights: BTreeMap::from(weather),
            panorama_folder: None,
            panorama_share: 0.5,
            picture_folders: Vec::new(),
            picture_share: 0.5,
            dark_share: 0.2,
            light_share: 0.45,
            single_lamp_share: 0.15,
            over_lit_share: 0.12,
            mixed_light_share: 0.0,
            dim_share: 0.0,
            sun_share: 0.0,
            daylit_share: 0.0,
            clean_share: 0.2,
            cluttered_share: 0.25,
            litter_share: 0.0,
            worn_share: 0.0,
            large_share: 0.0,
            people_share: 0.0,
            hfov_deg: [50.0, 90.0],
            camera_height_m: [0.8, 2.0],
            pitch_deg: 15.0,
            tilt: Tilt::Level,
            roll_deg: 3.0,
            crop_size: [480, 320],
            upright_share: 0.0,
            close_up_share: 0.0,
            low_camera_share: 0.0,
        }
    }
}

impl SynthConfig {
    /// Checks what types cannot say.
    ///
    /// # Errors
    /// [`SynthError::Config`] names the field.
    pub fn validate(&self) -> Result<(), SynthError> {
        let wrong =
            |field: &str, what: &str| Err(SynthError::Config { field: field.to_owned(), what: what.to_owned() });
        let shares = [
            ("l_shape_share", self.l_shape_share),
            ("sloped_ceiling_share", self.sloped_ceiling_share),
            ("windowless_share", self.windowless_share),
            ("glazed_share", self.glazed_share),
            ("panorama_share", self.panorama_share),
            ("picture_share", self.picture_share),
            ("dark_share", self.dark_share),
            ("light_share", self.light_share),
            ("single_lamp_share", self.single_lamp_share),
            ("over_lit_share", self.over_lit_share),
            ("mixed_light_share", self.mixed_light_share),
            ("dim_share", self.dim_share),
            ("sun_share", self.sun_share),
            ("daylit_share", self.daylit_share),
            ("clean_share", self.clean_share),
            ("cluttered_share", self.cluttered_share),
            ("litter_share", self.litter_share),
            ("worn_share", self.worn_share),
            ("large_share", self.large_share),
            ("people_share", self.people_share),
            ("upright_share", self.upright_share),
            ("close_up_share", self.close_up_share),
            ("low_camera_share", self.low_camera_share),
        ];
        for (field, share) in shares {
            if !(0.0..=1.0).contains(&share) {
                return wrong(field, "is not between 0 and 1");
            }
        }
        let sums = [
            ("light_share", self.dark_share + self.light_share),
            ("over_lit_share", self.single_lamp_share + self.over_lit_share),
            ("cluttered_share", self.clean_share + self.cluttered_share),
        ];
        for (field, sum) in sums {
            if sum > 1.0 {
                return wrong(field, "and the share that excludes it are more than 1 together");
            }
        }
        let bad = |weight: &f32| !(weight.is_finite() && *weight >= 0.0);
        if self.room_weights.values().any(bad) || !self.room_weights.values().any(|&w| w > 0.0) {
            return wrong("room_weights", "needs a positive weight, none negative");
        }
        let weather = |w: &&f32| **w > 0.0;
        let known = self.weather_weights.iter().filter(|(w, _)| **w != Weather::Panorama).map(|(_, w)| w);
        if self.weather_weights.values().any(bad) || known.filter(weather).count() == 0 {
            return wrong("weather_weights", "needs a positive weight besides `panorama`, none negative");
        }
        let range = |[low, high]: [f32; 2], least: f32, most: f32| least <= low && low <= high && high <= most;
        if !range(self.hfov_deg, 10.0, 150.0) {
            return wrong("hfov_deg", "is no range within 10 to 150");
        }
        if !range(self.camera_height_m, 0.2, 2.1) {
            return wrong("camera_height_m", "is no range within 0.2 to 2.1");
        }
        if !(0.0..=60.0).contains(&self.pitch_deg) {
            return wrong("pitch_deg", "is not between 0 and 60");
        }
        if !(0.0..=45.0).contains(&self.roll_deg) {
            return wrong("roll_deg", "is not between 0 and 45");
        }
        if self.crop_size.iter().any(|s| !(8..=8192).contains(s)) {
            return wrong("crop_size", "is not between 8 and 8192");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_file_may_set_some_fields_and_misspelt_ones_are_told() {
        let config: SynthConfig = toml::from_str("dark_share = 0.5\nroom_weights = { kitchen = 1 }").unwrap();
        assert_eq!((config.dark_share, config.room_weights.len(), config.pitch_deg), (0.5, 1, 15.0));
        assert!(config.validate().is_ok());
        let error = toml::from_str::<SynthConfig>("darkness = 1").unwrap_err();
        assert!(error.to_string().contains("darkness"));
    }

    #[test]
    fn values_out_of_range_are_named() {
        let field = |config: SynthConfig| match config.validate() {
            Err(SynthError::Config { field, .. }) => field,
            other => panic!("{other:?}"),
        };
        assert!(SynthConfig::default().validate().is_ok());
        assert_eq!(field(SynthConfig { dark_share: f32::NAN, ..Default::default() }), "dark_share");
        assert_eq!(field(SynthConfig { dark_share: 0.9, ..Default::default() }), "light_share");
        assert_eq!(field(SynthConfig { hfov_deg: [80.0, 60.0], ..Default::default() }), "hfov_deg");
        assert_eq!(field(SynthConfig { room_weights: BTreeMap::new(), ..Default::default() }), "room_weights");
    }
}
