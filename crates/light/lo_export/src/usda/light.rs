//! Lamps, and domes of light probes.

use lo_geometry::Vec3;
use lo_scene::{AnalyticLight, LightShape};

use super::text::{asset, matrix, triple};
use crate::lamps::Lamp;
use crate::probe::ProbeFile;

/// Encodes a lamp with its size and power, or a sun.
///
/// It is normalised, so that a lamp keeps its power when it is enlarged: `intensity` is radiance times area, which
/// Blender converts to watts, or a sun's irradiance.
pub fn lamp(index: usize, lamp: &Lamp) -> String {
    let AnalyticLight { shape, radiance } = lamp.light;
    let strongest = radiance.into_iter().fold(0.0, f32::max);
    // Rectangles and suns shine along their −Z.
    let place = |across: Vec3, direction: Vec3, at: Vec3| {
        let [x, y, z] = [across, across.cross(direction), -direction].map(|axis| axis.extend(0.0).to_array());
        matrix([x, y, z, at.extend(1.0).to_array()])
    };
    let (kind, size, place) = match shape {
        LightShape::Rectangle { centre_m, direction, across, size_m: [width_m, height_m], .. } => {
            let size = format!("float inputs:height = {height_m}\n    float inputs:width = {width_m}");
            ("RectLight", size, place(across, direction, centre_m))
        }
        LightShape::Sphere { centre_m, radius_m } => {
            let axes = lo_geometry::Mat4::from_translation(centre_m).to_cols_array_2d();
            ("SphereLight", format!("float inputs:radius = {radius_m}"), matrix(axes))
        }
        LightShape::Sun { direction, angular_radius_deg, .. } => {
            let across = lo_geometry::orthonormal_basis(direction).x_axis;
            let size = format!("float inputs:angle = {}", 2.0 * angular_radius_deg);
            ("DistantLight", size, place(across, -direction, Vec3::ZERO))
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
        lamp.label(index).replace(|c: char| !c.is_ascii_alphanumeric(), "_"),
        triple(radiance.map(|c| c / strongest)),
        strongest * lamp.light.extent(),
    )
}

/// Encodes the panorama of a probe as a dome light.
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
