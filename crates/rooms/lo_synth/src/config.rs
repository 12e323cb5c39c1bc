//! Configuration of the generator.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::description::{RoomKind, Weather};
use crate::error::SynthError;

/// Distribution of camera pitch within ±[`SynthConfig::pitch_deg`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Tilt {
    /// Mean of two uniform draws: mostly near level.
    Level,
    /// Uniform, as with hand-held phones.
    Uniform,
}

/// Distribution of generated rooms and cameras. Every field has a default; shares are probabilities in [0, 1].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthConfig {
    /// Relative weights of room kinds; omitted kinds do not occur.
    pub room_weights: BTreeMap<RoomKind, f32>,
    /// Share of L-shaped rooms among those large enough.
    pub l_shape_share: f32,
    /// Share of rooms with a sloped ceiling among rectangular bedrooms, living rooms, offices and studios.
    pub sloped_ceiling_share: f32,
    /// Share of rooms without windows; bathrooms, corridors and cellars have fixed shares.
    pub windowless_share: f32,
    /// Share of rooms with one or two walls glazed almost from end to end and nearly up to the ceiling.
    ///
    /// Never applies to bathrooms, corridors and cellars.
    pub glazed_share: f32,
    /// Relative weights of outdoor conditions; `panorama` is ignored, see `panorama_share`.
    pub weather_weights: BTreeMap<Weather, f32>,
    /// Folder of outdoor equirectangular HDR panoramas (`.hdr`, `.exr`), Y up.
    pub panorama_folder: Option<PathBuf>,
    /// Share of rooms whose windows show one of these panoramas, if a folder is given.
    pub panorama_share: f32,
    /// Folders of images for posters, screens and covers: `.jpg`, `.png`, `.webp`, `.hdr` and `.exr`.
    ///
    /// Equirectangular images are cropped to perspective views.
    pub picture_folders: Vec<PathBuf>,
    /// Share of posters, screens and covers that show one of these images; the others are procedural.
    pub picture_share: f32,
    /// Share of rooms with dark walls and furniture.
    pub dark_share: f32,
    /// Share of rooms with light walls and furniture; the rest is in between.
    pub light_share: f32,
    /// Share of rooms lit by a single lamp.
    pub single_lamp_share: f32,
    /// Share of rooms lit by far more lamps than needed.
    pub over_lit_share: f32,
    /// Share of rooms whose lamps differ in colour temperature.
    pub mixed_light_share: f32,
    /// Share of rooms at night with 1/30 to 1/4 of the usual light.
    pub dim_share: f32,
    /// Share of daytime rooms with a clear sky and the sun in front of a window.
    ///
    /// Rooms that show a panorama are excluded.
    pub sun_share: f32,
    /// Share of daytime rooms with windows in which all lamps are off. Overrides the other lighting shares.
    pub daylit_share: f32,
    /// Share of rooms with hardly any small objects.
    pub clean_share: f32,
    /// Share of rooms full of small objects.
    pub cluttered_share: f32,
    /// Share of rooms with scattered papers, packages, devices and cables, and with posters.
    pub litter_share: f32,
    /// Share of rooms whose surfaces are worn, stained, sometimes patterned, and have normal maps.
    pub worn_share: f32,
    /// Share of enlarged rooms: 1.4 to 3 times as long and wide, and higher.
    ///
    /// Applies to halls, workshops, studios, classrooms, laboratories, open plans and empty rooms.
    pub large_share: f32,
    /// Share of rooms with one to three people.
    pub people_share: f32,
    /// Range of the horizontal field of view of photos, degrees.
    pub hfov_deg: [f32; 2],
    /// Range of camera heights above the floor, metres.
    pub camera_height_m: [f32; 2],
    /// Maximum camera pitch, degrees.
    pub pitch_deg: f32,
    /// Distribution of camera pitch.
    pub tilt: Tilt,
    /// Maximum camera roll, degrees.
    pub roll_deg: f32,
    /// Width and height of photos, pixels.
    pub crop_size: [u32; 2],
    /// Share of photos with width and height swapped; the field of view stays along the longer side.
    pub upright_share: f32,
    /// Share of close-ups: objects at 0.4 to 1.5 m, seen from 10 to 60° above, or about level if they stand high.
    pub close_up_share: f32,
    /// Share of the other photos taken from 0.1 to 0.5 m above the floor.
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
    /// Checks ranges and sums that the types do not enforce.
    ///
    /// # Errors
    /// [`SynthError::Config`] with the name of the invalid field.
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
                return wrong(field, "must be between 0 and 1");
            }
        }
        let sums = [
            ("light_share", "dark_share", self.dark_share + self.light_share),
            ("over_lit_share", "single_lamp_share", self.single_lamp_share + self.over_lit_share),
            ("cluttered_share", "clean_share", self.clean_share + self.cluttered_share),
        ];
        for (field, other, sum) in sums {
            if sum > 1.0 {
                return wrong(field, &format!("and `{other}` must not sum to more than 1"));
            }
        }
        let bad = |weight: &f32| !(weight.is_finite() && *weight >= 0.0);
        if self.room_weights.values().any(bad) || !self.room_weights.values().any(|&w| w > 0.0) {
            return wrong("room_weights", "must have a positive weight and no negative ones");
        }
        let weather = |w: &&f32| **w > 0.0;
        let known = self.weather_weights.iter().filter(|(w, _)| **w != Weather::Panorama).map(|(_, w)| w);
        if self.weather_weights.values().any(bad) || known.filter(weather).count() == 0 {
            return wrong("weather_weights", "must have a positive weight besides `panorama` and no negative ones");
        }
        let range = |[low, high]: [f32; 2], min: f32, max: f32| min <= low && low <= high && high <= max;
        if !range(self.hfov_deg, 10.0, 150.0) {
            return wrong("hfov_deg", "must be a range, minimum first, within 10 to 150");
        }
        if !range(self.camera_height_m, 0.2, 2.1) {
            return wrong("camera_height_m", "must be a range, minimum first, within 0.2 to 2.1");
        }
        if !(0.0..=60.0).contains(&self.pitch_deg) {
            return wrong("pitch_deg", "must be between 0 and 60");
        }
        if !(0.0..=45.0).contains(&self.roll_deg) {
            return wrong("roll_deg", "must be between 0 and 45");
        }
        if self.crop_size.iter().any(|s| !(8..=8192).contains(s)) {
            return wrong("crop_size", "must be between 8 and 8192");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn omitted_fields_have_defaults_and_unknown_ones_are_errors() {
        let config: SynthConfig = toml::from_str("dark_share = 0.5\nroom_weights = { kitchen = 1 }").unwrap();
        assert_eq!((config.dark_share, config.room_weights.len(), config.pitch_deg), (0.5, 1, 15.0));
        assert!(config.validate().is_ok());
        let error = toml::from_str::<SynthConfig>("darkness = 1").unwrap_err();
        assert!(error.to_string().contains("darkness"));
    }

    #[test]
    fn errors_name_the_field_out_of_range() {
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
