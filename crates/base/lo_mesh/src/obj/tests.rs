#![allow(clippy::unwrap_used)]

use std::io::{Error, ErrorKind};

use lo_geometry::Vec3;

use crate::{AlphaMode, LoadOptions, MeshError, MeshWarning, Model};

const MTL: &str = "newmtl red\nKd 0.5 0 0\nKs 0.5 0.5 0.5\nNs 98\nd 0.25\n\
                   newmtl steel\nPr 0.3\nPm 1\nKe 2 3 4\nmap_Kd -s 2 2 1 missing file.png\n\
                   newmtl oldmetal\nKd 0 0 0\nKs 0.9 0.8 0.7\nNs 1000\n\
                   newmtl matte\nKd 0.1 0.2 0.3\nillum 1\n";

const QUAD: &str = "# comment\nmtllib some.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0 # end\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
                    vn 0 0 1\nusemtl red\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl steel\nf -4//-1 -3//-1 \\\n-2//-1\n";

fn read(text: &str) -> Result<Model, MeshError> {
    let resolve = |name: &str| {
        if name == "some.mtl" { Ok(MTL.as_bytes().to_vec()) } else { Err(Error::from(ErrorKind::NotFound)) }
    };
    Model::from_obj_bytes(text.as_bytes(), &resolve, &LoadOptions::default())
}

#[test]
fn quads_indices_and_materials() {
    let model = read(QUAD).unwrap();
    assert_eq!(model.triangles.len(), 3);
    assert_eq!(model.triangle_materials, [0, 0, 1]);
    assert!(model.normals.iter().all(|&n| n == Vec3::Z));
    // v points up in OBJ and down here.
    let at = |p: Vec3| model.positions.iter().position(|&q| q == p).unwrap();
    assert_eq!(model.uvs[0][at(Vec3::ZERO)], [0.0, 1.0]);
    let red = &model.materials[0];
    assert_eq!((red.base_color, red.alpha_mode), ([0.5, 0.0, 0.0, 0.25], AlphaMode::Blend));
    // (2 / (98 + 2))^¼
    assert!((red.roughness - 0.02_f32.powf(0.25)).abs() < 1e-6);
    let steel = &model.materials[1];
    assert_eq!((steel.roughness, steel.metallic, steel.emissive), (0.3, 1.0, [2.0, 3.0, 4.0]));
    assert_eq!(steel.base_color, [1.0; 4], "a texture is not darkened by a colour that is not there");
    assert_eq!(model.warnings.len(), 1);
    assert!(model.warnings[0].to_string().starts_with("texture missing file.png ignored: "), "{}", model.warnings[0]);
}

#[test]
fn shininess_and_old_metals() {
    let model =
        read("mtllib some.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl oldmetal\nf 1 2 3\nusemtl matte\nf 1 3 2\n").unwrap();
    let (metal, matte) = (&model.materials[0], &model.materials[1]);
    assert_eq!((metal.base_color, metal.metallic), ([0.9, 0.8, 0.7, 1.0], 1.0));
    assert!(metal.roughness < 0.25);
    assert_eq!((matte.roughness, matte.metallic), (1.0, 0.0));
}

#[test]
fn missing_libraries_are_warnings() {
    let model = read("mtllib gone.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl x\nf 1 2 3\n").unwrap();
    assert_eq!(model.warnings.len(), 1);
    assert!(
        model.warnings[0].to_string().starts_with("cannot read material file gone.mtl, its materials are white: "),
        "{}",
        model.warnings[0]
    );
    assert_eq!(model.materials[0].name, "x");
}

#[test]
fn smoothing_groups_decide() {
    let roof = |s: &str| format!("{s}\nv 0 0 0\nv 0 0 1\nv 1 0.2 0\nv -1 0.2 0\nf 1 2 3\nf 1 4 2\n");
    let vertices = |s: &str| read(&roof(s)).unwrap().positions.len();
    assert_eq!(vertices(""), 4, "23 degrees are smooth");
    assert_eq!(vertices("s off"), 6);
    assert_eq!(vertices("s 1"), 4);
}

#[test]
fn vertex_colours() {
    let model = read("v 0 0 0 1 0 0.5\nv 1 0 0 1 1 1\nv 0 1 0 0 0 0\nf 1 2 3\n").unwrap();
    assert!((model.colors[0][2] - 0.214_04).abs() < 1e-4, "sRGB 0.5 is 0.214 of light");
    assert_eq!(model.colors[2], [0.0, 0.0, 0.0, 1.0]);
}

#[test]
fn errors_say_where() {
    let error = |text| read(text).unwrap_err().to_string();
    assert_eq!(error("v 0 0 0\nf 1 2 3\n"), "line 2 refers to vertex 1, but there are 1 vertices (counted from 0)");
    assert_eq!(error("v 0 0\n"), "invalid OBJ file at line 1: a vertex needs three coordinates");
    assert_eq!(error("v 0 0 zero\n"), "invalid OBJ file at line 1: 'zero' is not a number");
    assert_eq!(error("v 0 0 0\n"), "the mesh has no triangles (it has 1 vertices, but no faces)");
    assert_eq!(error(""), "the mesh has no triangles (it has 0 vertices, but no faces)");
    assert!(error("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").starts_with(
        "the mesh has no triangles: 1 of 1 triangles dropped: a coordinate is not finite or too large (first: vertex"
    ));
    assert!(error("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n").ends_with("1 of 1 triangles dropped: zero area"));
}

#[test]
fn a_nan_vertex_costs_its_triangles_alone() {
    let model = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nv inf 1 0\nf 1 2 3\nf 2 3 4\n").unwrap();
    assert_eq!(model.triangles.len(), 1);
    assert!(matches!(model.warnings[..], [MeshWarning::UnusableCoordinate { dropped: 1, triangles: 2, .. }]));
}

#[test]
fn truncation_never_panics() {
    for end in 0..QUAD.len() {
        let _ = read(&QUAD[..end]);
    }
    for end in 0..MTL.len() {
        let resolve = |_: &str| Ok(MTL.as_bytes()[..end].to_vec());
        Model::from_obj_bytes(QUAD.as_bytes(), &resolve, &LoadOptions::default()).unwrap();
    }
}

#[test]
fn joined_lines_are_no_vertices() {
    // The second line belongs to the group's name: there are no vertices.
    let error = read("g name \\\nv 1 1 1\nf 1 1 1\n").unwrap_err().to_string();
    assert_eq!(error, "line 3 refers to vertex 0, but there are 0 vertices (counted from 0)");
    // A comment hides the backslash.
    assert_eq!(read("# \\\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap().triangles.len(), 1);
}

#[test]
fn pictures_put_together_are_made_once_and_are_counted() {
    let png = |edge: usize| {
        let picture = lo_imaging::Image::from_fn(edge, edge, |x, _| [(255 * x / edge) as u8; 3]);
        lo_imaging::encode_png(&picture)
    };
    let obj = |materials: usize| {
        let uses = |i: usize| format!("usemtl m{i}\nf 1 2 3\n");
        format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{}", (0..materials).map(uses).collect::<String>())
    };
    let read = |materials: &dyn Fn(usize) -> String, count: usize, edge: usize| {
        let mtl: String = (0..count).map(|i| format!("newmtl m{i}\n{}", materials(i))).collect();
        let (large, small) = (png(edge), png(2));
        let resolve = |name: &str| match name {
            "a.mtl" => Ok(mtl.as_bytes().to_vec()),
            "large.png" => Ok(large.clone()),
            _ => Ok(small.clone()),
        };
        Model::from_obj_bytes(obj(count).as_bytes(), &resolve, &LoadOptions::default()).unwrap()
    };
    let shared = read(&|_| "map_Kd large.png\nmap_d a.png\nmap_Pm a.png\nmap_Pr b.png\n".to_owned(), 5, 16);
    assert_eq!((shared.textures.len(), shared.warnings.len()), (3, 0));
    assert!(shared.materials.iter().all(|m| m.base_color_texture == shared.materials[0].base_color_texture));
    // Each mask requires another copy of the large image, 4096² pixels; the budget allows slightly more than four.
    let hostile = read(&|i| format!("map_Kd large.png\nmap_d {i}.png\n"), 8, 4096);
    let pixels: usize = hostile.textures.iter().map(|t| t.levels[0].pixels().len()).sum();
    assert!(pixels <= (8192 * 8192) + 16 * (png(4096).len() + 8 * png(2).len() + obj(8).len()), "{pixels}");
    assert!(hostile.warnings.iter().any(|w| w.to_string().ends_with("have too many pixels")), "{:?}", hostile.warnings);
}

/// Reads one triangle with the material `a`, whose statements are given.
fn material(mtl: &str) -> crate::Material {
    let mtl = format!("newmtl a\n{mtl}");
    let png = lo_imaging::encode_png(&lo_imaging::Image::new(1, 1, vec![[255, 0, 0]]));
    let resolve = |name: &str| Ok(if name == "a.mtl" { mtl.as_bytes().to_vec() } else { png.clone() });
    let obj = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
    Model::from_obj_bytes(obj.as_bytes(), &resolve, &LoadOptions::default()).unwrap().materials[0].clone()
}

#[test]
fn opacity_by_d_and_tr() {
    for (mtl, alpha) in [
        ("Tr 1", 0.0),
        ("Tr 0.25", 0.75),
        ("Tr 0", 1.0),
        ("d 0\nTr 1", 0.0),
        ("d 0.5\nTr 0.5", 0.5),
        ("d -halo 0.5", 0.5),
        // Programs that write the opacity as `Tr`, too, and ones that write 0 for both.
        ("d 1\nTr 1", 1.0),
        ("Tr 1\nd 1", 1.0),
        ("d 0\nTr 0", 1.0),
    ] {
        let material = material(mtl);
        assert_eq!(material.base_color[3], alpha, "{mtl}");
        assert_eq!(material.alpha_mode == AlphaMode::Blend, alpha < 1.0, "{mtl}");
    }
}

#[test]
fn a_black_colour_does_not_hide_its_image() {
    let textured = material("Kd 0 0 0\nKs 0.5 0.5 0.5\nmap_Kd a.png");
    assert_eq!((textured.base_color, textured.metallic), ([1.0; 4], 0.0));
    assert!(textured.base_color_texture.is_some());
    assert_eq!(material("Kd 0.5 0.5 0.5\nmap_Kd a.png").base_color, [0.5, 0.5, 0.5, 1.0], "a tint stays");
    assert_eq!(material("Kd 0 0 0").base_color, [0.0, 0.0, 0.0, 1.0], "black stays black without an image");
}

#[test]
fn statements_and_names_in_other_case() {
    let mtl = "NEWMTL Red\nkd 0.5 0 0\nNS 98\nKS 0.5 0.5 0.5\nD 0.25\nMAP_KE a.png\n";
    let png = lo_imaging::encode_png(&lo_imaging::Image::new(1, 1, vec![[255, 0, 0]]));
    let resolve = |name: &str| Ok(if name == "a.mtl" { mtl.as_bytes().to_vec() } else { png.clone() });
    let obj = "MTLLIB a.mtl\nV 0 0 0\nV 1 0 0\nV 0 1 0\nVT 0 0\nVN 0 0 1\nUSEMTL RED\nF 1/1/1 2/1/1 3/1/1\n";
    let model = Model::from_obj_bytes(obj.as_bytes(), &resolve, &LoadOptions::default()).unwrap();
    assert_eq!(model.warnings, []);
    let red = &model.materials[0];
    assert_eq!((red.name.as_str(), red.base_color), ("Red", [0.5, 0.0, 0.0, 0.25]));
    assert!((red.roughness - 0.02_f32.powf(0.25)).abs() < 1e-6 && red.emissive_texture.is_some());
}

#[test]
fn files_in_other_case_are_found() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("Some.MTL"), MTL).unwrap();
    let path = folder.path().join("quad.obj");
    std::fs::write(&path, QUAD).unwrap();
    let model = Model::load(&path, &LoadOptions::default()).unwrap();
    assert_eq!(model.materials[0].base_color, [0.5, 0.0, 0.0, 0.25]);
}

#[test]
fn transparent_materials_beside_visible_ones_are_named() {
    let mtl = "newmtl seen\nKd 1 1 1\nnewmtl gone\nd 0\nnewmtl unused\nd 0\n";
    let resolve = |_: &str| Ok(mtl.as_bytes().to_vec());
    let read = |faces: &str| {
        let obj = format!("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{faces}");
        Model::from_obj_bytes(obj.as_bytes(), &resolve, &LoadOptions::default()).unwrap().warnings
    };
    let materials = vec!["gone".to_owned()];
    let mixed = read("usemtl seen\nf 1 2 3\nusemtl gone\nf 1 3 2\n");
    assert_eq!(mixed, [MeshWarning::TransparentMaterials { materials }]);
    assert_eq!(read("usemtl gone\nf 1 2 3\n"), [], "the renderer reports an object of which nothing is visible");
}
