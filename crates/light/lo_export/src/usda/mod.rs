//! USD as text: the photo's camera, the room as emissive meshes, and variants of the lighting: these meshes with
//! lamps, or a probe as a dome.

mod camera;
mod light;
mod mesh;
mod text;

use lo_geometry::Camera;

use crate::header::{FRAME, GENERATOR, LEVEL_FRAME, UNITS};
use crate::lamps::Lamp;
use crate::photo_mesh::PhotoMesh;
use crate::points::Point;
use crate::probe::ProbeFile;
use crate::room_mesh::RoomMesh;
use crate::world_frame::WorldFrame;
use mesh::Sides;
use text::{indented, matrix};

/// Paths of the camera's frame and of the materials.
const WORLD: &str = "/Scene/World";
const MATERIALS: &str = "/Scene/World/Materials";

/// Scale of the shadow catcher towards the camera, relative to the photo's mesh: 4 mm in 2 m.
const CATCHER_SCALE: f32 = 0.998;

/// A texture file beside the stage.
pub(crate) struct Texture {
    /// File name.
    pub file: String,
    /// USD's `sourceColorSpace`.
    pub space: &'static str,
}

/// The room's meshes and textures.
pub(crate) struct Meshes<'a> {
    /// Faces of the leaves.
    pub room: &'a RoomMesh,
    /// Texture of their radiance.
    pub room_texture: &'a Texture,
    /// The observed surface.
    pub photo: &'a PhotoMesh,
    /// The photo.
    pub photo_texture: &'a Texture,
    /// The photo with restored highlights.
    pub seen_texture: &'a Texture,
    /// Distance from the camera beyond all parts of the room, in metres.
    pub beyond_m: f32,
}

/// Geometry of the stage.
pub(crate) enum SceneGeometry<'a> {
    /// The room as emissive meshes.
    Room(Meshes<'a>),
    /// Points with colours, and whether they have a panorama's share.
    Points(&'a [Point], bool),
}

/// Encodes the whole file.
pub(crate) fn encode(
    shown: &SceneGeometry,
    camera: &Camera,
    level: WorldFrame,
    lamps: &[Lamp],
    probes: &[ProbeFile],
) -> String {
    let variant = |index: usize| if index == 0 { "probe".to_owned() } else { format!("probe{}", index + 1) };
    // The dome already contains the light of mesh and lamps: with both, everything would be lit twice.
    let lighting = if probes.is_empty() { "room" } else { "probe" };
    let frame = if level == WorldFrame::CAMERA { FRAME } else { LEVEL_FRAME };
    let mut text = format!(
        r#"#usda 1.0
(
    customLayerData = {{
        string generator = "{GENERATOR}"
    }}
    defaultPrim = "Scene"
    doc = "{frame}; {UNITS}"
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
    def Xform "World"
    {{
        matrix4d xformOp:transform = {}
        uniform token[] xformOpOrder = ["xformOp:transform"]

"#,
        matrix(level.columns())
    );
    let mut world = camera::camera(camera);
    let mut dark = "";
    match shown {
        SceneGeometry::Room(meshes) => {
            world += &room(meshes, camera);
            dark = "over \"World\"\n{\n    over \"Room\" (\n        active = false\n    )\n    {\n    }\n\n    \
                    over \"Photo\" (\n        active = false\n    )\n    {\n    }\n}\n";
        }
        SceneGeometry::Points(points, panorama) => world += &mesh::points(points, *panorama),
    }
    text += &indented(&indented(&world));
    text += "    }\n\n    variantSet \"lighting\" = {\n";
    for (index, probe) in probes.iter().enumerate() {
        let body = indented(&indented(&indented(&(light::dome(probe) + dark))));
        text += &format!("        \"{}\" {{\n{body}        }}\n", variant(index));
    }
    let mut body = String::from("over \"World\"\n{\n");
    for (index, lamp) in lamps.iter().enumerate() {
        body += &indented(&light::lamp(index, lamp));
    }
    body += "}\n";
    text += &format!("        \"room\" {{\n{}        }}\n", indented(&indented(&indented(&body))));
    text + "    }\n}\n"
}

/// Encodes the meshes alone, for AR Quick Look: `textures` are those of the room and of the photo, in sRGB.
pub(crate) fn encode_for_ar(room: &RoomMesh, photo: &PhotoMesh, textures: [&str; 2], level: WorldFrame) -> String {
    let names = ["Room", "Photo"];
    let [of_room, of_photo] = names.map(|name| format!("/Scene/Materials/{name}"));
    let mut body = format!(
        "matrix4d xformOp:transform = {}\nuniform token[] xformOpOrder = [\"xformOp:transform\"]\n\n",
        matrix(level.columns())
    );
    body += &mesh::room(room, &of_room, Sides::Inner);
    body += &mesh::photo(photo, &of_photo, Sides::Inner);
    let mut materials = String::new();
    for (name, texture) in names.into_iter().zip(textures) {
        materials += &mesh::emitting("/Scene/Materials", name, texture, "sRGB");
    }
    body += &format!("def Scope \"Materials\"\n{{\n{}\n}}\n", indented(&materials).trim_end());
    format!(
        r#"#usda 1.0
(
    customLayerData = {{
        string generator = "{GENERATOR}"
    }}
    defaultPrim = "Scene"
    metersPerUnit = 1
    upAxis = "Y"
)

def Xform "Scene" (
    kind = "component"
)
{{
{}}}
"#,
        indented(&body)
    )
}

fn room(meshes: &Meshes, camera: &Camera) -> String {
    let material = |name: &str| format!("{MATERIALS}/{name}");
    let mut text = mesh::room(meshes.room, &material("Radiance"), Sides::Both);
    text += &mesh::photo(meshes.photo, &material("Seen"), Sides::Both);
    text += &mesh::shadow_catcher(&format!("{WORLD}/Photo"), CATCHER_SCALE, &material("Grey"));
    text += &camera::backdrop(camera, meshes.beyond_m, &material("Photo"));
    let mut materials = String::new();
    let emitting = [("Radiance", meshes.room_texture), ("Seen", meshes.seen_texture), ("Photo", meshes.photo_texture)];
    for (name, texture) in emitting {
        materials += &mesh::emitting(MATERIALS, name, &texture.file, texture.space);
    }
    materials += &mesh::grey(MATERIALS, "Grey");
    text + "def Scope \"Materials\"\n{\n" + indented(&materials).trim_end() + "\n}\n"
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::test_scene::box_room;
    use crate::{free_space, lamps, photo_mesh, points, room_mesh};

    /// Parses the numbers of an array, without its brackets.
    fn numbers(text: &str, declaration: &str) -> Vec<f32> {
        let (_, rest) = text.split_once(&format!("{declaration} = [")).unwrap();
        let (list, _) = rest.split_once(']').unwrap();
        list.replace(['(', ')'], "").split(", ").map(|number| number.parse().unwrap()).collect()
    }

    pub fn number(text: &str, declaration: &str) -> f64 {
        let (_, rest) = text.split_once(&format!("{declaration} = ")).unwrap();
        rest.lines().next().unwrap().parse().unwrap()
    }

    #[test]
    fn points_give_their_values_back() {
        let scene = box_room();
        let points = points::from_photo(&scene.frame);
        let text = encode(&SceneGeometry::Points(&points, false), &scene.frame.camera, WorldFrame::CAMERA, &[], &[]);
        let flat = |pick: fn(&Point) -> [f32; 3]| points.iter().flat_map(pick).collect::<Vec<f32>>();
        assert_eq!(numbers(&text, "point3f[] points"), flat(|p| p.position_m.to_array()));
        assert_eq!(numbers(&text, "float3[] primvars:radiance"), flat(|p| p.radiance));
        assert_eq!(numbers(&text, "color3f[] primvars:displayColor"), flat(|p| p.radiance.map(|c| c.min(1.0))));
        assert_eq!(numbers(&text, "float[] widths").len(), 47);
    }

    #[test]
    fn the_room_and_its_lamp_are_there() {
        let scene = box_room();
        let leaves = free_space::leaves(&scene.light, None);
        let lamps = lamps::find_lamps(&leaves);
        let room = room_mesh::from_leaves(&leaves, &lamps::face_emission(&leaves, &lamps), &scene.light.cube, 3);
        let photo = photo_mesh::from_frame(&scene.frame, None);
        let texture = Texture { file: "room.exr".to_owned(), space: "raw" };
        let meshes = Meshes {
            room: &room,
            room_texture: &texture,
            photo: &photo,
            photo_texture: &texture,
            seen_texture: &texture,
            beyond_m: 8.0,
        };
        let text = encode(&SceneGeometry::Room(meshes), &scene.frame.camera, WorldFrame::CAMERA, &lamps, &[]);
        let (_, body) = text.split_once("def Mesh \"Room\"").unwrap();
        let positions: Vec<f32> = room.positions_m.iter().flat_map(|p| p.to_array()).collect();
        assert_eq!(numbers(body, "point3f[] points"), positions);
        assert_eq!(numbers(body, "int[] faceVertexIndices").len(), 4 * 216);
        // USD counts texture rows from below.
        let uvs = numbers(body, "texCoord2f[] primvars:st");
        let [u, v] = crate::atlas::Atlas::new(216).uvs(0)[0];
        assert_eq!(uvs[..2], [u, 1.0 - v]);
        // A panel of 1 m² of (9, 7.2, 5.4): radiance times area.
        let (_, lamp) = text.split_once("def RectLight \"Lamp1\"").unwrap();
        assert!((number(lamp, "float inputs:intensity") - 9.0).abs() < 1e-5);
        assert!((number(lamp, "float inputs:width") - 1.0).abs() < 1e-3);
        assert!(lamp.contains("bool inputs:normalize = 1"));
    }
}
