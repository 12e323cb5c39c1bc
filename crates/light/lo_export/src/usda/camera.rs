//! The photo's camera, and the photo as a backdrop.

use lo_geometry::Camera;

use super::text::{array, interpolation, triple};

/// Width of the film back in tenths of a scene unit, as in USD: 36 mm full frame with the metre as the unit.
const FILM_WIDTH: f64 = 0.36;

/// Encodes the photo's camera; the aperture offsets express an off-centre principal point.
pub fn camera(camera: &Camera) -> String {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let focal_length = FILM_WIDTH * camera.fx / width;
    format!(
        r#"def Camera "Camera"
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

/// Encodes the photo on a card that fills the camera's view, `distance_m` away.
pub fn backdrop(camera: &Camera, distance_m: f32, material: &str) -> String {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let corners = [(0.0, height), (width, height), (width, 0.0), (0.0, 0.0)]
        .map(|(u, v)| camera.unproject(u, v, f64::from(distance_m)));
    let mut text = String::from("def Mesh \"Backdrop\" (\n    prepend apiSchemas = [\"MaterialBindingAPI\"]\n)\n{\n");
    text += "    uniform bool doubleSided = 1\n";
    text += &format!("    float3[] extent = [{}, {}]\n", triple(corners[0].to_array()), triple(corners[2].to_array()));
    text += "    int[] faceVertexCounts = [4]\n    int[] faceVertexIndices = [0, 1, 2, 3]\n";
    text += &format!("    rel material:binding = <{material}>\n");
    text += &array("    point3f[] points", "", corners.iter().map(|p| triple(p.to_array())));
    let vertex = interpolation("vertex");
    text += &array("    texCoord2f[] primvars:st", &vertex, ["(0, 0)", "(1, 0)", "(1, 1)", "(0, 1)"].into_iter());
    text + "    uniform token subdivisionScheme = \"none\"\n}\n\n"
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::tests::number;
    use crate::test_scene::box_room;

    #[test]
    fn the_frustum_is_the_photo() {
        let camera = box_room().frame.camera;
        let text = super::camera(&camera);
        let focal = number(&text, "focalLength");
        let (width, height) = (number(&text, "horizontalAperture"), number(&text, "verticalAperture"));
        let (right, up) = (number(&text, "horizontalApertureOffset"), number(&text, "verticalApertureOffset"));
        // USD's window on the plane one unit in front of the camera: (offset ± aperture / 2) / focal length.
        let corner = camera.unproject(0.0, 0.0, 1.0);
        assert!(((right - 0.5 * width) / focal - f64::from(corner.x)).abs() < 1e-6);
        assert!(((up + 0.5 * height) / focal - f64::from(corner.y)).abs() < 1e-6);
        let corner = camera.unproject(8.0, 6.0, 1.0);
        assert!(((right + 0.5 * width) / focal - f64::from(corner.x)).abs() < 1e-6);
        assert!(((up - 0.5 * height) / focal - f64::from(corner.y)).abs() < 1e-6);
    }
}
