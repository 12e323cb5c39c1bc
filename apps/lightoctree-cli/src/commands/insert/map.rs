//! A map that lights the objects instead of the octree.

use std::path::Path;

use lightoctree::{Document, LightPurpose, SceneRenderer};
use lo_geometry::{Orientation, Quat, Vec3};
use lo_imaging::{self as imaging, RadianceImage};

use crate::choice::{Choice, choice};
use crate::commands::environment::ORIENTATIONS;
use crate::commands::parse;
use crate::progress::Stages;
use crate::usage::Usage;

/// Options of the map.
#[derive(Debug, clap::Args)]
pub struct MapArgs {
    /// Light of the objects: `octree`, or `envmap:FILE` with an equirectangular .exr, .hdr or .pfm file
    #[arg(long, value_name = "octree|envmap:FILE", default_value = "octree")]
    lighting: String,

    /// Orientation of the map of --lighting envmap:FILE, named after a program that uses it [default: lightoctree]
    #[arg(long, value_name = "NAME", value_parser = choice(&ORIENTATIONS))]
    orientation: Option<Orientation>,

    /// Brightness of that map [default: photo]
    #[arg(long, value_name = "photo|file", value_parser = choice(&LEVELS))]
    lighting_level: Option<Level>,

    /// Stops by which that map is brightened further [default: 0]
    #[arg(long, value_name = "EV", value_parser = parse::exposure_ev, allow_hyphen_values = true)]
    lighting_ev: Option<f64>,

    /// Degrees by which that map is turned to the left, as the camera sees it [default: 0]
    #[arg(long, value_name = "DEG", value_parser = parse::angle_deg, allow_hyphen_values = true)]
    lighting_yaw_deg: Option<f64>,
}

/// Reference of a map's brightness.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Level {
    #[default]
    Photo,
    File,
}

/// Choices of the brightness.
static LEVELS: [Choice<Level>; 2] = [
    ("photo", Level::Photo, "The map's mean is that of the room's expected light at the objects"),
    ("file", Level::File, "As stored; 1.0 is the photo's white"),
];

/// Size at which the room's expected light is averaged.
const MEAN_SIZE: [usize; 2] = [64, 32];

impl MapArgs {
    /// Reads the map in this project's orientation; `None` for the octree.
    ///
    /// # Errors
    /// Unreadable files, maps of another shape, and options that have no effect.
    pub fn read(&self, stages: &Stages) -> anyhow::Result<Option<RadianceImage>> {
        if self.lighting == "octree" {
            let given = [
                ("--orientation", self.orientation.is_some()),
                ("--lighting-level", self.lighting_level.is_some()),
                ("--lighting-ev", self.lighting_ev.is_some()),
                ("--lighting-yaw-deg", self.lighting_yaw_deg.is_some()),
            ];
            return match given.iter().find(|(_, is_given)| *is_given) {
                None => Ok(None),
                Some((option, _)) => {
                    Err(Usage(format!("{option} applies to the map of --lighting envmap:FILE only")).into())
                }
            };
        }
        let Some(path) = self.lighting.strip_prefix("envmap:") else {
            let text = &self.lighting;
            return Err(Usage(format!("--lighting {text}: must be `octree` or `envmap:FILE`")).into());
        };
        let file = imaging::read_photo(path)?;
        stages.photo_notes([(Path::new(path), &file)]);
        let map = file.photo.into_radiance();
        let (width, height) = (map.width(), map.height());
        if width != 2 * height {
            let message =
                format!("{path} is {width} × {height}: the width of an equirectangular map must be twice its height");
            return Err(Usage(message).into());
        }
        let from = self.orientation.unwrap_or(Orientation::Lightoctree);
        Ok(Some(imaging::reorient(&map, from, Orientation::Lightoctree)))
    }

    /// Turns the map and gives it its brightness.
    ///
    /// # Errors
    /// A map without light, and those of [`Document::lit`].
    pub fn adapted(
        &self,
        map: RadianceImage,
        document: &Document,
        at_m: Vec3,
        stages: &mut Stages,
    ) -> anyhow::Result<RadianceImage> {
        let map = match self.lighting_yaw_deg {
            Some(yaw_deg) if yaw_deg % 360.0 != 0.0 => {
                let rotation = Quat::from_rotation_y((yaw_deg % 360.0).to_radians() as f32);
                imaging::rotate_equirectangular(&map, rotation, map.width(), map.height())
            }
            _ => map,
        };
        let mut factor = self.lighting_ev.unwrap_or(0.0).exp2();
        if self.lighting_level.unwrap_or_default() == Level::Photo {
            let room = stages.stage("brightness of the room", || {
                let lit = document.lit(LightPurpose::Panorama)?;
                let [width, height] = MEAN_SIZE;
                anyhow::Ok(imaging::mean_luminance(&SceneRenderer::new(&lit).panorama(at_m, width, height).radiance))
            })?;
            let of_map = imaging::mean_luminance(&map);
            if of_map <= 0.0 {
                return Err(Usage("the map of --lighting has no light".into()).into());
            }
            let level = room / of_map;
            stages.note(&format!(
                "the map was made {:+.1} EV brighter, to the level of the room; --lighting-level file leaves it",
                level.log2()
            ));
            factor *= level;
        }
        Ok(map.map(|radiance| radiance.map(|v| (f64::from(v) * factor) as f32)))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use imaging::ExrOptions;

    fn of(lighting: &str) -> MapArgs {
        MapArgs {
            lighting: lighting.to_owned(),
            orientation: None,
            lighting_level: None,
            lighting_ev: None,
            lighting_yaw_deg: None,
        }
    }

    #[test]
    fn lighting_is_octree_or_a_map() {
        let quiet = Stages::new(true);
        assert!(of("octree").read(&quiet).unwrap().is_none());
        for without_effect in [
            MapArgs { orientation: Some(Orientation::Blender), ..of("octree") },
            MapArgs { lighting_level: Some(Level::File), ..of("octree") },
            MapArgs { lighting_ev: Some(1.0), ..of("octree") },
            MapArgs { lighting_yaw_deg: Some(90.0), ..of("octree") },
            of("sun"),
        ] {
            assert!(without_effect.read(&quiet).unwrap_err().is::<Usage>());
        }
        assert!(of("envmap:no/such.exr").read(&quiet).is_err());
    }

    #[test]
    fn maps_are_reoriented() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("map.hdr");
        // A bright column where the other program has our right side (+X).
        for (orientation, column) in [
            (Orientation::Lightoctree, 12),
            (Orientation::Openexr, 4),
            (Orientation::Threejs, 8),
            (Orientation::Blender, 8),
        ] {
            let map = RadianceImage::from_fn(16, 8, |x, _| [if x == column { 8.0 } else { 0.25 }; 3]);
            imaging::write_radiance(&file, &map, &ExrOptions::default()).unwrap();
            let args = MapArgs { orientation: Some(orientation), ..of(&format!("envmap:{}", file.display())) };
            let read = args.read(&Stages::new(true)).unwrap().unwrap();
            let right = lo_geometry::uv_from_direction(Vec3::new(1.0, 0.0, 0.01).normalize()).x * 16.0;
            assert_eq!(read[(right as usize, 4)], [8.0; 3], "{orientation:?}");
        }
    }
}
