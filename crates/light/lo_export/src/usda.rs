//! USD as text: camera, points, and a choice of lighting: the probe as a dome, or the brightest leaves as lamps.

use std::fmt::{Display, Write};

use lo_geometry::{Camera, orthonormal_basis};

use crate::header::{GENERATOR, UNITS};
use crate::points::Point;
use crate::probe::ProbeFile;
use crate::sources::Source;

/// Width of the film back in tenths of a scene unit, as USD counts: 36 mm of full frame where the unit is the metre.
const FILM_WIDTH: f64 = 0.36;

/// The whole file; `panorama` says whether a panorama was laid onto the scene.
pub(crate) fn encode(
    points: &[Point],
    camera: &Camera,
    lamps: &[Source],
    probe: Option<&ProbeFile>,
    panorama: bool,
) -> String {
    // The dome holds the lamps' light already: one or the other, or everything is lit twice.
    let lighting = if probe.is_some() { "probe" } else { "lamps" };
    let mut text = format!(
        r#"#usda 1.0
(
    customLayerData = {{
        string generator = "{GENERATOR}"
    }}
    defaultPrim = "Scene"
    doc = "{UNITS}"
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "Scene" (
    variants = {{
        string lighting = "{lighting}"
    }}
    prepend variantSets = "lighting"
)
{{
"#
    );
    text += &camera_prim(camera);
    text += &points_prim(points, panorama);
    text += "    variantSet \"lighting\" = {\n";
    if let Some(probe) = probe {
        text += &format!("        \"probe\" {{\n{}        }}\n", dome_prim(probe));
    }
    text += "        \"lamps\" {\n";
    for (index, lamp) in lamps.iter().enumerate() {
        text += &lamp_prim(index, lamp);
    }
    text += "        }\n    }\n}\n";
    text
}

/// The photo's camera; the apertures' offsets carry a principal point off the centre.
fn camera_prim(camera: &Camera) -> String {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let focal_length = FILM_WIDTH * camera.fx / width;
    format!(
        r#"    def Camera "Camera"
    {{
        float2 clippingRange = (0.01, 1000)
        float focalLength = {focal_length}
        float horizontalAperture = {FILM_WIDTH}
        float horizontalApertureOffset = {}
        token projection = "perspective"
        float verticalAperture = {}
        float verticalApertureOffset = {}
    }}

"#,
        focal_length * (0.5 * width - camera.cx) / camera.fx,
        focal_length * height / camera.fy,
        focal_length * (camera.cy - 0.5 * height) / camera.fy,
    )
}

fn points_prim(points: &[Point], panorama: bool) -> String {
    let mut low = points[0].position_m;
    let mut high = low;
    for point in points {
        low = low.min(point.position_m - 0.5 * point.edge_m);
        high = high.max(point.position_m + 0.5 * point.edge_m);
    }
    let mut text = String::from("    def Points \"Room\"\n    {\n");
    text += &format!("        float3[] extent = [{}, {}]\n", triple(low.to_array()), triple(high.to_array()));
    text += &array("point3f[] points", "", points.iter().map(|p| triple(p.position_m.to_array())));
    text += &array("normal3f[] normals", "", points.iter().map(|p| triple(p.normal.to_array())));
    text += &array("float[] widths", "", points.iter().map(|p| p.edge_m));
    let vertex = " (\n            interpolation = \"vertex\"\n        )";
    let clipped = points.iter().map(|p| triple(p.radiance.map(|c| c.clamp(0.0, 1.0))));
    text += &array("color3f[] primvars:displayColor", vertex, clipped);
    text += &array("float3[] primvars:radiance", vertex, points.iter().map(|p| triple(p.radiance)));
    text += &array("float[] primvars:opacity", vertex, points.iter().map(|p| p.opacity));
    text += &array("float[] primvars:seen", vertex, points.iter().map(|p| p.seen));
    if panorama {
        text += &array("float[] primvars:panorama", vertex, points.iter().map(|p| p.panorama));
    }
    text += "    }\n\n";
    text
}

fn dome_prim(probe: &ProbeFile) -> String {
    // In a name between single @, an @ would end it; between triple ones a triple one is escaped.
    let texture = match probe.name.contains('@') {
        true => format!("@@@./{}@@@", probe.name.replace("@@@", "\\@@@")),
        false => format!("@./{}@", probe.name),
    };
    format!(
        r#"            def DomeLight "Probe"
            {{
                float inputs:intensity = 1
                asset inputs:texture:file = {texture}
                token inputs:texture:format = "latlong"
                custom point3f userProperties:position_m = {}
            }}
"#,
        triple(probe.position_m.to_array())
    )
}

/// A panel as a disk that shines into the room, any other cluster as a sphere; both have the cluster's area and radiance.
fn lamp_prim(index: usize, lamp: &Source) -> String {
    let strongest = lamp.radiance.into_iter().fold(0.0, f32::max);
    let (kind, radius_m) = match lamp.is_panel() {
        true => ("DiskLight", (lamp.area_m2 / std::f32::consts::PI).sqrt()),
        false => ("SphereLight", 0.5 * (lamp.area_m2 / std::f32::consts::PI).sqrt()),
    };
    // A disk shines along its -Z; a sphere does not care. USD's vectors are rows.
    let basis = if lamp.is_panel() { orthonormal_basis(-lamp.direction) } else { lo_geometry::Mat3::IDENTITY };
    let row = |[x, y, z]: [f32; 3], w: u8| format!("({x}, {y}, {z}, {w})");
    let rows = [
        row(basis.x_axis.to_array(), 0),
        row(basis.y_axis.to_array(), 0),
        row(basis.z_axis.to_array(), 0),
        row(lamp.position_m.to_array(), 1),
    ];
    format!(
        r#"            def {kind} "Lamp{}"
            {{
                color3f inputs:color = {}
                float inputs:intensity = {strongest}
                bool inputs:normalize = 0
                float inputs:radius = {radius_m}
                matrix4d xformOp:transform = ( {} )
                uniform token[] xformOpOrder = ["xformOp:transform"]
            }}
"#,
        index + 1,
        triple(lamp.radiance.map(|c| c / strongest)),
        rows.join(", ")
    )
}

fn array(declaration: &str, metadata: &str, values: impl Iterator<Item = impl Display>) -> String {
    let mut text = format!("        {declaration} = [");
    for (index, value) in values.enumerate() {
        let separator = if index == 0 { "" } else { ", " };
        write!(text, "{separator}{value}").expect("a String takes any text");
    }
    text + "]" + metadata + "\n"
}

/// Shortest decimals that give the same floats back.
fn triple([x, y, z]: [f32; 3]) -> String {
    format!("({x}, {y}, {z})")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_scene::box_room;
    use crate::{free_space, points, sources};

    /// The numbers of an array, without its brackets.
    fn numbers(text: &str, declaration: &str) -> Vec<f32> {
        let (_, rest) = text.split_once(&format!("{declaration} = [")).unwrap();
        let (list, _) = rest.split_once(']').unwrap();
        list.replace(['(', ')'], "").split(", ").map(|number| number.parse().unwrap()).collect()
    }

    fn number(text: &str, declaration: &str) -> f64 {
        let (_, rest) = text.split_once(&format!("{declaration} = ")).unwrap();
        rest.lines().next().unwrap().parse().unwrap()
    }

    #[test]
    fn arrays_give_the_values_back() {
        let scene = box_room();
        let leaves = free_space::leaves(&scene.light, None);
        let points = points::from_leaves(&leaves);
        let text = encode(&points, &scene.frame.camera, &sources::sources(&leaves), None, false);
        let flat = |pick: fn(&Point) -> [f32; 3]| points.iter().flat_map(pick).collect::<Vec<f32>>();
        assert_eq!(numbers(&text, "point3f[] points"), flat(|p| p.position_m.to_array()));
        assert_eq!(numbers(&text, "float3[] primvars:radiance"), flat(|p| p.radiance));
        assert_eq!(numbers(&text, "color3f[] primvars:displayColor"), flat(|p| p.radiance.map(|c| c.min(1.0))));
        assert_eq!(numbers(&text, "float[] widths"), [0.5; 296]);
        assert_eq!(numbers(&text, "float3[] extent"), [-2.0, -2.0, -2.0, 2.0, 2.0, 2.0]);
        // A panel of 1 m²: π r² = 1.
        assert!(text.contains("def DiskLight \"Lamp1\""));
        assert!((number(&text, "float inputs:radius") - (1.0 / std::f64::consts::PI).sqrt()).abs() < 1e-6);
        assert_eq!(number(&text, "float inputs:intensity"), 10.0);
    }

    #[test]
    fn the_frustum_is_the_photo() {
        let camera = box_room().frame.camera;
        let text = camera_prim(&camera);
        let focal = number(&text, "focalLength");
        let (width, height) = (number(&text, "horizontalAperture"), number(&text, "verticalAperture"));
        let (right, up) = (number(&text, "horizontalApertureOffset"), number(&text, "verticalApertureOffset"));
        // USD's window on the plane one unit before the camera: (offset ± aperture / 2) / focal length.
        let corner = camera.unproject(0.0, 0.0, 1.0);
        assert!(((right - 0.5 * width) / focal - f64::from(corner.x)).abs() < 1e-6);
        assert!(((up + 0.5 * height) / focal - f64::from(corner.y)).abs() < 1e-6);
        let corner = camera.unproject(8.0, 6.0, 1.0);
        assert!(((right + 0.5 * width) / focal - f64::from(corner.x)).abs() < 1e-6);
        assert!(((up - 0.5 * height) / focal - f64::from(corner.y)).abs() < 1e-6);
    }
}
