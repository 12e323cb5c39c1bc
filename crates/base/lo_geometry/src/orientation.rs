use glam::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// Equirectangular orientation conventions of other programs.
///
/// A map in our frame has the centre column at −Z, +X to its right and row 0 at +Y. A preset rotates the *content* of
/// the map so that a program reading it by its own convention sees every light in the right world direction. The
/// program must share our world frame (Blender: after the usual Y-up → Z-up import).
///
/// All conventions view the sphere from inside with +Y on top. They differ only by quarter turns about +Y.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Orientation {
    /// Lightoctree and skylibs: centre −Z, +X right, +Y up.
    #[default]
    Lightoctree,
    /// OpenEXR latitude-longitude, Mitsuba and USD dome lights: centre +Z, +Y up.
    Openexr,
    /// three.js `EquirectangularReflectionMapping`: centre +X, +Y up.
    Threejs,
    /// Blender Cycles environment texture: centre +X in Blender's own Z-up frame.
    Blender,
    /// Unity `Skybox/Panoramic`: centre +X in Unity's own left-handed frame.
    Unity,
}

impl Orientation {
    /// All presets, for listings.
    pub const ALL: [Self; 5] = [Self::Lightoctree, Self::Openexr, Self::Threejs, Self::Blender, Self::Unity];

    /// Quarter turns about +Y from a world direction to its direction in the preset's map, read by our convention.
    ///
    /// The content of our map moves left by as many quarters of its width. Blender's importer maps our (x, y, z) to
    /// (x, −z, y), Unity's are (x, y, −z); their centre +X is therefore also our +X, as in three.js.
    pub fn quarter_turns(self) -> u32 {
        match self {
            Self::Lightoctree => 0,
            Self::Threejs | Self::Blender | Self::Unity => 1,
            Self::Openexr => 2,
        }
    }

    /// Rotation from a world direction to its direction in the preset's map, read by our convention
    /// ([`uv_from_direction`](crate::uv_from_direction)).
    pub fn map_from_world(self) -> Mat3 {
        match self.quarter_turns() {
            0 => Mat3::IDENTITY,
            1 => Mat3::from_cols(Vec3::NEG_Z, Vec3::Y, Vec3::X),
            _ => Mat3::from_cols(Vec3::NEG_X, Vec3::Y, Vec3::NEG_Z),
        }
    }

    /// Matrix from our world frame to the program's own. Blender's importers map (x, y, z) to (x, −z, y); Unity's
    /// left-handed frame has (x, y, −z), which is a reflection. The other programs share our axes.
    pub fn program_from_world(self) -> Mat3 {
        match self {
            Self::Blender => Mat3::from_cols(Vec3::X, Vec3::Z, Vec3::NEG_Y),
            Self::Unity => Mat3::from_cols(Vec3::X, Vec3::Y, Vec3::NEG_Z),
            Self::Lightoctree | Self::Openexr | Self::Threejs => Mat3::IDENTITY,
        }
    }

    /// Describes the program's own axes as seen from the photo's camera.
    pub fn axes(self) -> &'static str {
        match self {
            Self::Blender => "+X right, +Y ahead, +Z up",
            Self::Unity => "+X right, +Y up, +Z ahead",
            Self::Lightoctree | Self::Openexr | Self::Threejs => "+X right, +Y up, -Z ahead",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{pixel_direction, uv_from_direction};
    use glam::Vec2;
    use std::f32::consts::{PI, TAU};

    /// Map coordinates of a world direction by the programs' own formulas; v from the top.
    fn published_uv(preset: Orientation, d: Vec3) -> Vec2 {
        let v = d.y.acos() / PI;
        match preset {
            // soravux/skylibs, envmap/projections.py, world2latlong: u = (1 + arctan2(x, −z) / π) / 2, v = arccos(y) /
            // π
            Orientation::Lightoctree => Vec2::new((1.0 + d.x.atan2(-d.z) / PI) / 2.0, v),
            // OpenEXR, ImfEnvmap.cpp, LatLongMap: longitude = atan2(x, z), x position = longitude / (−2π) + 0.5. USD's
            // DomeLight refers to it; Mitsuba 3's envmap.cpp has the equal u = atan2(x, −z) / 2π wrapped to [0, 1)
            Orientation::Openexr => Vec2::new(0.5 - d.x.atan2(d.z) / TAU, v),
            // three.js, src/renderers/shaders/ShaderChunk/common.glsl.js, equirectUv: u = atan(z, x) / 2π + 0.5
            Orientation::Threejs => Vec2::new(0.5 + d.z.atan2(d.x) / TAU, v),
            // Blender, intern/cycles/kernel/camera/projection.h, direction_to_equirectangular with its range
            // (−2π, π, −π, π): u = (atan2(y, x) − π) / −2π, v upwards = 1 − acos(z) / π; in Blender's frame (x, −z, y)
            Orientation::Blender => {
                let b = Vec3::new(d.x, -d.z, d.y);
                Vec2::new((b.y.atan2(b.x) - PI) / -TAU, b.z.acos() / PI)
            }
            // Unity, Skybox-Panoramic.shader, ToRadialCoords: u = 0.5 − atan2(z, x) / 2π, v upwards = 1 − acos(y) / π;
            // in Unity's frame (x, y, −z)
            Orientation::Unity => Vec2::new(0.5 - (-d.z).atan2(d.x) / TAU, d.y.acos() / PI),
        }
    }

    #[test]
    fn lights_from_the_axes_land_where_each_program_reads_them() {
        // u of world −Z, +X, +Z, −X by the formulas above, computed by hand (1 and 0 are the same column)
        let columns = [
            (Orientation::Lightoctree, [0.5, 0.75, 0.0, 0.25]),
            (Orientation::Openexr, [0.0, 0.25, 0.5, 0.75]),
            (Orientation::Threejs, [0.25, 0.5, 0.75, 0.0]),
            (Orientation::Blender, [0.25, 0.5, 0.75, 0.0]),
            (Orientation::Unity, [0.25, 0.5, 0.75, 0.0]),
        ];
        let close = |a: f32, b: f32| ((a - b + 0.5).rem_euclid(1.0) - 0.5).abs() < 1e-6;
        for (preset, expected) in columns {
            for (direction, u) in [Vec3::NEG_Z, Vec3::X, Vec3::Z, Vec3::NEG_X].into_iter().zip(expected) {
                assert!(close(published_uv(preset, direction).x, u), "{preset:?} {direction}");
                let ours = uv_from_direction(preset.map_from_world() * direction);
                assert!(close(ours.x, u) && (ours.y - 0.5).abs() < 1e-6, "{preset:?} {direction}: {ours}");
            }
            assert_eq!(uv_from_direction(preset.map_from_world() * Vec3::Y).y, 0.0);
        }
    }

    #[test]
    fn a_light_in_the_programs_axes_is_where_its_map_shows_it() {
        for preset in Orientation::ALL {
            let program = preset.program_from_world();
            let ahead = program * Vec3::NEG_Z;
            let up = program * Vec3::Y;
            let words = |axis: Vec3| match axis.to_array() {
                [0.0, 1.0, 0.0] => "+Y",
                [0.0, 0.0, 1.0] => "+Z",
                [0.0, 0.0, -1.0] => "-Z",
                other => panic!("{other:?}"),
            };
            let axes = format!("{} ahead", words(ahead));
            assert!(preset.axes().contains(&axes) && preset.axes().contains(&format!("{} up", words(up))), "{axes}");
            assert_eq!(program * Vec3::X, Vec3::X);
            assert_eq!(program.determinant(), if preset == Orientation::Unity { -1.0 } else { 1.0 });
        }
        // Blender's own formula in Blender's own axes gives the preset's column.
        let direction = Vec3::new(0.3, 0.2, -0.9).normalize();
        let b = Orientation::Blender.program_from_world() * direction;
        let u = (b.y.atan2(b.x) - PI) / -TAU;
        assert!((uv_from_direction(Orientation::Blender.map_from_world() * direction).x - u).abs() < 1e-6);
    }

    #[test]
    fn every_direction_lands_where_each_program_reads_it() {
        for preset in Orientation::ALL {
            for (x, y) in (0..32).flat_map(|x| (0..16).map(move |y| (x, y))) {
                let direction = pixel_direction(x, y, 32, 16);
                let (ours, published) =
                    (uv_from_direction(preset.map_from_world() * direction), published_uv(preset, direction));
                // acos loses precision near the poles
                assert!((ours - published).length() < 1e-3, "{preset:?} {direction}: {ours} {published}");
            }
            assert!((preset.map_from_world().determinant() - 1.0).abs() < 1e-6);
        }
    }
}
