//! Lamps, and the dome of a probe.

use super::text::{asset, matrix, triple};
use crate::probe::ProbeFile;
use crate::sources::{Shape, Source};

/// A panel as a rectangle that shines into the room, any other cluster as a sphere; both have the lamp's size and power.
///
/// Normalised, so that a lamp keeps its power when it is made larger: `intensity` is radiance times area, from which Blender
/// makes watts.
pub fn lamp(index: usize, lamp: &Source) -> String {
    let strongest = lamp.radiance.into_iter().fold(0.0, f32::max);
    let row = lamp.position_m.extend(1.0).to_array();
    let (kind, size, place) = match lamp.shape {
        Shape::Panel { direction, across, size_m: [width_m, height_m] } => {
            // A rectangle shines along its -Z.
            let [x, y, z] = [across, across.cross(direction), -direction].map(|axis| axis.extend(0.0).to_array());
            let size = format!("float inputs:height = {height_m}\n    float inputs:width = {width_m}");
            ("RectLight", size, matrix([x, y, z, row]))
        }
        Shape::Ball { radius_m } => {
            let axes = lo_geometry::Mat4::from_translation(lamp.position_m).to_cols_array_2d();
            ("SphereLight", format!("float inputs:radius = {radius_m}"), matrix(axes))
        }
    };
    format!(
        r#"def {kind} "Lamp{}"
{{
    color3f inputs:color = {}
    float inputs:intensity = {}
    bool inputs:normalize = 1
    {size}
    matrix4d xformOp:transform = {place}
    uniform token[] xformOpOrder = ["xformOp:transform"]
}}

"#,
        index + 1,
        triple(lamp.radiance.map(|c| c / strongest)),
        strongest * lamp.area_m2,
    )
}

/// The panorama of a probe as what surrounds the scene.
pub fn dome(probe: &ProbeFile) -> String {
    format!(
        r#"def DomeLight "Probe"
{{
    float inputs:intensity = 1
    asset inputs:texture:file = {}
    token inputs:texture:format = "latlong"
    custom point3f userProperties:position_m = {}
}}
"#,
        asset(&probe.file.name),
        triple(probe.position_m.to_array())
    )
}
