//! Meshes, materials and points.

use lo_geometry::Vec3;

use super::text::{array, asset, interpolation, triple};
use crate::atlas::Atlas;
use crate::photo_mesh::PhotoMesh;
use crate::points::Point;
use crate::room_mesh::RoomMesh;

/// The visible sides of a mesh.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sides {
    /// Both.
    Both,
    /// Those that face the room: from outside one looks through its walls.
    Inner,
}

/// Encodes the room: quads with the texture of an [`Atlas`].
pub fn room(mesh: &RoomMesh, material: &str, sides: Sides) -> String {
    let atlas = Atlas::new(mesh.quads.len());
    let mut text = head("Room", &mesh.positions_m, material, sides);
    text += &array("    int[] faceVertexCounts", "", mesh.quads.iter().map(|_| 4));
    text += &array("    int[] faceVertexIndices", "", mesh.quads.iter().flatten());
    text += &array("    point3f[] points", "", mesh.positions_m.iter().map(|p| triple(p.to_array())));
    let uvs = (0..mesh.quads.len()).flat_map(|quad| atlas.uvs(quad)).map(st);
    text += &array("    texCoord2f[] primvars:st", &interpolation("faceVarying"), uvs);
    text + "    uniform token subdivisionScheme = \"none\"\n}\n\n"
}

/// Encodes the observed surface.
pub fn photo(mesh: &PhotoMesh, material: &str, sides: Sides) -> String {
    let mut text = head("Photo", &mesh.positions_m, material, sides);
    text += &array("    int[] faceVertexCounts", "", mesh.triangles.iter().map(|_| 3));
    text += &array("    int[] faceVertexIndices", "", mesh.triangles.iter().flatten());
    text += &array("    point3f[] points", "", mesh.positions_m.iter().map(|p| triple(p.to_array())));
    text += &array("    texCoord2f[] primvars:st", &interpolation("vertex"), mesh.uvs.iter().copied().map(st));
    text + "    uniform token subdivisionScheme = \"none\"\n}\n\n"
}

/// Encodes the photo's mesh as a grey shadow catcher, scaled by `scale` towards the camera at the origin.
pub fn shadow_catcher(photo: &str, scale: f32, material: &str) -> String {
    format!(
        r#"def Mesh "ShadowCatcher" (
    active = true
    prepend references = <{photo}>
)
{{
    rel material:binding = <{material}>
    float3 xformOp:scale = ({scale}, {scale}, {scale})
    uniform token[] xformOpOrder = ["xformOp:scale"]
}}

"#
    )
}

fn head(name: &str, positions_m: &[Vec3], material: &str, sides: Sides) -> String {
    let least = positions_m.iter().copied().fold(Vec3::INFINITY, Vec3::min);
    let most = positions_m.iter().copied().fold(Vec3::NEG_INFINITY, Vec3::max);
    format!(
        r#"def Mesh "{name}" (
    prepend apiSchemas = ["MaterialBindingAPI"]
)
{{
    uniform bool doubleSided = {}
    float3[] extent = [{}, {}]
    rel material:binding = <{material}>
"#,
        u8::from(sides == Sides::Both),
        triple(least.to_array()),
        triple(most.to_array())
    )
}

/// Returns texture coordinates in USD's convention, from the lower left.
fn st([u, v]: [f32; 2]) -> String {
    format!("({u}, {})", 1.0 - v)
}

/// Encodes a material that emits the linear radiance of a texture and reflects nothing. `space` is the texture's
/// `sourceColorSpace`.
pub fn emitting(parent: &str, name: &str, texture: &str, space: &str) -> String {
    format!(
        r#"def Material "{name}"
{{
    token outputs:surface.connect = <{parent}/{name}/Surface.outputs:surface>

    def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0, 0, 0)
        color3f inputs:emissiveColor.connect = <{parent}/{name}/Texture.outputs:rgb>
        float inputs:ior = 1
        float inputs:roughness = 1
        token outputs:surface
    }}

    def Shader "Texture"
    {{
        uniform token info:id = "UsdUVTexture"
        asset inputs:file = {}
        token inputs:sourceColorSpace = "{space}"
        float2 inputs:st.connect = <{parent}/{name}/Coordinates.outputs:result>
        token inputs:wrapS = "clamp"
        token inputs:wrapT = "clamp"
        float3 outputs:rgb
    }}

    def Shader "Coordinates"
    {{
        uniform token info:id = "UsdPrimvarReader_float2"
        string inputs:varname = "st"
        float2 outputs:result
    }}
}}

"#,
        asset(texture)
    )
}

/// Encodes a grey diffuse material.
pub fn grey(parent: &str, name: &str) -> String {
    format!(
        r#"def Material "{name}"
{{
    token outputs:surface.connect = <{parent}/{name}/Surface.outputs:surface>

    def Shader "Surface"
    {{
        uniform token info:id = "UsdPreviewSurface"
        color3f inputs:diffuseColor = (0.5, 0.5, 0.5)
        float inputs:ior = 1
        float inputs:roughness = 1
        token outputs:surface
    }}
}}

"#
    )
}

/// Encodes loose points; `panorama` adds the panorama's share of each.
pub fn points(points: &[Point], panorama: bool) -> String {
    let mut low = points[0].position_m;
    let mut high = low;
    for point in points {
        low = low.min(point.position_m - 0.5 * point.edge_m);
        high = high.max(point.position_m + 0.5 * point.edge_m);
    }
    let mut text = String::from("def Points \"Photo\"\n{\n");
    text += &format!("    float3[] extent = [{}, {}]\n", triple(low.to_array()), triple(high.to_array()));
    text += &array("    point3f[] points", "", points.iter().map(|p| triple(p.position_m.to_array())));
    text += &array("    normal3f[] normals", "", points.iter().map(|p| triple(p.normal.to_array())));
    text += &array("    float[] widths", "", points.iter().map(|p| p.edge_m));
    let vertex = interpolation("vertex");
    let clipped = points.iter().map(|p| triple(p.radiance.map(|c| c.clamp(0.0, 1.0))));
    text += &array("    color3f[] primvars:displayColor", &vertex, clipped);
    text += &array("    float3[] primvars:radiance", &vertex, points.iter().map(|p| triple(p.radiance)));
    text += &array("    float[] primvars:opacity", &vertex, points.iter().map(|p| p.opacity));
    text += &array("    float[] primvars:seen", &vertex, points.iter().map(|p| p.seen));
    if panorama {
        text += &array("    float[] primvars:panorama", &vertex, points.iter().map(|p| p.panorama));
    }
    text + "}\n\n"
}
