//! Writes the seed files of every target to `corpus/TARGET`; run `cargo run --example seeds` in this folder.
//!
//! Seeds have a few hundred bytes. The fuzzer needs a valid file of each format to start from, since it hardly finds
//! one.

use std::io::Cursor;
use std::path::Path;
use std::sync::Arc;

use exr::compression::Compression;
use image::{DynamicImage, GrayImage, ImageFormat, Luma, Rgb, RgbImage, Rgba, RgbaImage};
use lo_dataset::{DatasetError, Metadata, NovelView, Record, Shot, write_shard};
use lo_geometry::{Camera, Cube, Plane, Quat, Vec3};
use lo_imaging as imaging;
use lo_imaging::{DepthMap, ExrOptions, Image, Photo, RadianceImage};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{
    AnalyticLight, Completion, EmitterEdit, Estimate, EstimateOrigin, ExpectedLight, Frame, LightChange, LightColor,
    LightEdits, LightShape, ObjectDisplay, Room, RoomPlane, SceneFile, SceneObjects, Side,
};

type Result<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;

fn main() -> Result {
    let corpus = Path::new("corpus");
    for target in ["scene", "image", "mesh", "shard", "depth_model", "poses", "plan", "options", "viewer"] {
        std::fs::create_dir_all(corpus.join(target))?;
    }
    scenes(&corpus.join("scene"))?;
    pictures(&corpus.join("image"))?;
    exr_files(&corpus.join("image"))?;
    meshes(&corpus.join("mesh"))?;
    shards(&corpus.join("shard"))?;
    depth_models(&corpus.join("depth_model"))?;
    poses(&corpus.join("poses"))?;
    plans(&corpus.join("plan"))?;
    texts(&corpus.join("options"))?;
    messages(&corpus.join("viewer"))
}

/// Copies the smallest of the crate's own fixtures.
fn depth_models(folder: &Path) -> Result {
    for entry in std::fs::read_dir("../crates/learn/lo_depth_models/tests/fixtures")? {
        let entry = entry?;
        let name = entry.file_name();
        if name.to_string_lossy().ends_with(".onnx") && entry.metadata()?.len() < 3000 {
            std::fs::copy(entry.path(), folder.join(name))?;
        }
    }
    Ok(())
}

/// Writes plans of a box, of a furnished room, and of one without a ceiling.
fn plans(folder: &Path) -> Result {
    let floor = r#""floor":[[10,24],[28,23],[42,25],[60,24]]"#;
    let start = r#"{"width":64,"camera_height_m":1.5,"height_from":"a door""#;
    let uprights = r#""uprights":[{"base":[[12,28],[20,27]],"height_m":0.75,"from_m":0.1}]"#;
    let tops = r#""tops":[{"outline":[[12,25],[20,24],[19,22],[13,23]],"height_m":0.75}]"#;
    let unknown = r#""unknown":[[[30,10],[34,10],[34,15],[30,15]]]"#;
    std::fs::write(folder.join("box"), format!(r#"{start},"ceiling_m":2.6,{floor}}}"#))?;
    std::fs::write(
        folder.join("furnished"),
        format!(r#"{start},"ceiling_m":2.6,{floor},{uprights},{tops},{unknown}}}"#),
    )?;
    std::fs::write(
        folder.join("open"),
        format!(r#"{start},"ceiling_m":null,"wall_top_m":3.0,"place":"yard",{floor}}}"#),
    )?;
    Ok(())
}

/// Writes a room with every kind of file.
fn shards(folder: &Path) -> Result {
    let shot = Shot {
        position_m: Vec3::Y,
        rotation: Quat::IDENTITY,
        gains: [1.0; 3],
        camera: Camera::new(4.0, 4.0, 2.0, 2.0, 4, 4)?,
        photo: Image::from_fn(4, 4, |x, y| [60 * x as u8, 60 * y as u8, 200]),
        jpeg: None,
        radiance: Some(Image::new(4, 4, vec![[0.5; 3]; 16])),
        depth_m: Some(Image::new(4, 4, vec![1.5; 16])),
        sensor_depth_m: Some(Image::new(2, 2, vec![1.5; 4])),
        normal: Some(Image::new(4, 4, vec![[0.0, 0.0, 1.0]; 16])),
        albedo: Some(Image::new(4, 4, vec![[0.5; 3]; 16])),
        views: vec![0],
        metadata: Metadata::new(),
    };
    let view = NovelView {
        position_m: Vec3::ZERO,
        rotation: Quat::IDENTITY,
        radiance: Image::new(4, 2, vec![[1e6; 3]; 8]),
        depth_m: Some(Image::new(4, 2, vec![2.0; 8])),
    };
    let point = RadiancePoint { position_m: Vec3::X, radiance: [1.0; 3], provenance: Provenance::Inferred };
    let record = Record {
        key: "a".into(),
        scene_id: "a".into(),
        up: Some(Vec3::Y),
        points: vec![point, RadiancePoint { position_m: Vec3::Z, ..point }],
        point_area_m2: Some(0.01),
        views: vec![view],
        shots: vec![shot],
        metadata: Metadata::new(),
    };
    Ok(write_shard::<DatasetError>(&folder.join("room.tar"), std::iter::once(Ok(record)), "seeds")?)
}

fn scenes(folder: &Path) -> Result {
    let photos = [
        ("srgb8", Photo::Srgb8(Image::from_fn(4, 4, |x, y| [60 * x as u8, 60 * y as u8, 200]))),
        ("linear", Photo::Linear(Image::from_fn(4, 4, |x, y| [x as f32, y as f32, 0.5]))),
    ];
    for (name, photo) in photos {
        let depth_m = DepthMap::from_fn(4, 4, |x, y| 1.0 + 0.1 * (x + y) as f32);
        let frame = Frame::new(photo, depth_m, Camera::new(4.0, 4.0, 2.0, 2.0, 4, 4)?, 1.0)?;
        let point = |i: u8| RadiancePoint {
            position_m: Vec3::new(f32::from(i), f32::from(i % 2), -f32::from(i % 3)) * 0.4,
            radiance: [1.0, 0.5, f32::from(i)],
            provenance: if i < 3 { Provenance::Observed } else { Provenance::Inferred },
        };
        let points: Vec<RadiancePoint> = (0..5).map(point).collect();
        let (light, _) = LightOctree::from_points(&points, Cube::centred(Vec3::ZERO, 4.0), 5, 1)?;
        let plane = Plane { normal: Vec3::Y, offset_m: -1.5 };
        let room = Room { up: Vec3::Y, planes: vec![RoomPlane { side: Side::Floor, plane, measured: true }] };
        let sources = vec!["photo.jpg".to_owned()];
        let origin = EstimateOrigin { completion: Completion::Shell, sources, ..EstimateOrigin::default() };
        let plain = SceneFile::from(Estimate { room: Some(room), origin, ..Estimate::observed_only(light, frame) });
        plain.write(&folder.join(format!("{name}.scene")), "seeds")?;
        let edited = SceneFile { light_edits: light_edits(name == "srgb8")?, ..plain };
        edited.write(&folder.join(format!("{name}_edited.scene")), "seeds")?;
        if name == "srgb8" {
            let radiance = RadianceImage::from_fn(8, 4, |x, y| [0.5 + x as f32, 0.5 + y as f32, 1.0]);
            let expected = Some(ExpectedLight::new(&radiance, Quat::IDENTITY, 3.0));
            let mut inferred = edited.clone();
            let estimate = Arc::make_mut(&mut inferred.estimate);
            (estimate.origin.completion, estimate.expected) = (Completion::Network, expected);
            inferred.write(&folder.join("srgb8_expected.scene"), "seeds")?;
            SceneFile { objects: objects(), ..edited }.write(&folder.join("srgb8_objects.scene"), "seeds")?;
        }
    }
    Ok(())
}

/// A mesh with the file that it refers to, and a moving built-in one.
fn objects() -> SceneObjects {
    let layout = r#"[{"mesh":"a.obj","pixel":[2,3]},{"mesh":"builtin:sphere","path":{"keyframes":[{"time_s":0,"pixel":[1,3]}]}}]"#;
    let file = |name: &str, text: &str| (name.to_owned(), Arc::from(text.as_bytes()));
    let obj = "mtllib a.mtl\nusemtl red\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    SceneObjects {
        layout: layout.to_owned(),
        files: [file("a.obj", obj), file("a.obj/a.mtl", "newmtl red\nKd 1 0 0\n")].into(),
        shown: ObjectDisplay { floor_gloss: 0.5, frames: Some(3), fps: 12, time_s: 0.5 },
    }
}

/// One light of each shape, and optionally an emitter, which these scenes do not have.
fn light_edits(emitter: bool) -> Result<LightEdits> {
    let change = LightChange {
        on: false,
        scale: 2.0,
        color: Some(LightColor::Kelvin(3000.0)),
        at_m: Some(Vec3::new(0.1, 0.2, -0.3)),
    };
    let edit = EmitterEdit { id: "L1".to_owned(), found_at_m: Vec3::new(1.6, 0.0, -0.4), change };
    let emitters = emitter.then_some(edit).into_iter().collect();
    let mut edits = LightEdits { emitters, ..LightEdits::default() };
    let rectangle = LightShape::Rectangle {
        centre_m: Vec3::Y,
        direction: Vec3::NEG_Y,
        across: Vec3::X,
        size_m: [0.5, 0.25],
        two_sided: true,
    };
    let sphere = LightShape::Sphere { centre_m: Vec3::NEG_Z, radius_m: 0.1 };
    let sun = |of_photo| LightShape::Sun { direction: Vec3::Y, angular_radius_deg: 0.27, of_photo };
    for shape in [rectangle, sphere, sun(false), sun(true)] {
        edits.add(AnalyticLight { shape, radiance: [3.0, 2.0, 1.0] }).ok_or("few lights")?;
    }
    Ok(edits)
}

fn pictures(folder: &Path) -> Result {
    let radiance = RadianceImage::from_fn(9, 4, |x, y| [x as f32, if y < 2 { 0.5 } else { y as f32 }, 3.0]);
    let depth_m = DepthMap::from_fn(6, 4, |x, y| 0.5 + (x + y) as f32 * 0.1);
    let rgb = RgbImage::from_fn(6, 4, |x, y| Rgb([40 * x as u8, 60 * y as u8, 128]));
    let rgba = RgbaImage::from_fn(6, 4, |x, y| Rgba([40 * x as u8, 60 * y as u8, 128, 200]));
    let grey = GrayImage::from_fn(6, 4, |x, y| Luma([40 * x as u8 + y as u8]));
    let deep = DynamicImage::from(rgb.clone()).into_rgb16();
    let deep_grey = DynamicImage::from(grey.clone()).into_luma16();

    for name in ["new_runs.hdr", "color.pfm"] {
        imaging::write_radiance(folder.join(name), &radiance, &ExrOptions::default())?;
    }
    for name in ["depth.pfm", "depth.npy", "depth.png", "depth.exr"] {
        imaging::write_depth(folder.join(name), &depth_m, imaging::GENERATOR)?;
    }
    std::fs::write(folder.join("flat.hdr"), b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\nEXPOSURE=2\n\n-Y 2 +X 2\n\x80\x40\0\x81\xff\0\x01\x80\x80\x40\0\x81\xff\0\x01\x80")?;
    std::fs::write(
        folder.join("old_runs.hdr"),
        b"#?RGBE\n\n+X 2 -Y 4\n\x80\x40\0\x81\x01\x01\x01\x03\x80\x40\0\x81\x01\x01\x01\x03",
    )?;
    std::fs::write(folder.join("ascii.pgm"), b"P2\n# grey\n3 2\n65535\n1 2 3 400 500 60000\n")?;

    let save = |name: &str, picture: DynamicImage, format: ImageFormat| -> Result {
        Ok(picture.save_with_format(folder.join(name), format)?)
    };
    save("rgb8.png", rgb.clone().into(), ImageFormat::Png)?;
    save("rgba8.png", rgba.clone().into(), ImageFormat::Png)?;
    save("rgb16.png", deep.clone().into(), ImageFormat::Png)?;
    save("grey8.png", grey.clone().into(), ImageFormat::Png)?;
    save("rgb.jpg", rgb.clone().into(), ImageFormat::Jpeg)?;
    save("grey.jpg", grey.clone().into(), ImageFormat::Jpeg)?;
    save("lossless.webp", rgba.clone().into(), ImageFormat::WebP)?;
    save("rgb.bmp", rgb.clone().into(), ImageFormat::Bmp)?;
    save("rgba.bmp", rgba.clone().into(), ImageFormat::Bmp)?;
    save("rgb.tif", rgb.clone().into(), ImageFormat::Tiff)?;
    save("rgb16.tif", deep.into(), ImageFormat::Tiff)?;
    save("depth16.tif", deep_grey.clone().into(), ImageFormat::Tiff)?;
    save("rgb.ppm", rgb.into(), ImageFormat::Pnm)?;
    save("depth16.pgm", deep_grey.into(), ImageFormat::Pnm)?;

    for name in ["display_p3.heic", "pq.heic", "display_p3.jxl", "linear.jxl", "lossy.jxl", "pq.jxl"] {
        let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/base/lo_imaging/tests/files").join(name);
        std::fs::copy(from, folder.join(name))?;
    }

    use tiff::encoder::{Compression, TiffEncoder, colortype};
    for (name, compression) in [
        ("float.tif", Compression::Uncompressed),
        ("float_lzw.tif", Compression::Lzw),
        ("float_deflate.tif", Compression::Deflate(Default::default())),
        ("float_packbits.tif", Compression::Packbits),
    ] {
        let mut bytes = Cursor::new(Vec::new());
        let mut encoder = TiffEncoder::new(&mut bytes)?.with_compression(compression);
        encoder.write_image::<colortype::Gray32Float>(6, 4, depth_m.pixels())?;
        std::fs::write(folder.join(name), bytes.into_inner())?;
    }
    Ok(())
}

fn exr_files(folder: &Path) -> Result {
    use exr::image::{Blocks, Encoding, Image, Layer, SpecificChannels};
    use exr::prelude::{LayerAttributes, LineOrder, Vec2, WritableImage, f16};
    let tiles = Blocks::Tiles(Vec2(8, 8));
    for (name, compression, blocks) in [
        ("none.exr", Compression::Uncompressed, Blocks::ScanLines),
        ("rle.exr", Compression::RLE, Blocks::ScanLines),
        ("zips.exr", Compression::ZIP1, Blocks::ScanLines),
        ("zip.exr", Compression::ZIP16, Blocks::ScanLines),
        ("piz.exr", Compression::PIZ, Blocks::ScanLines),
        ("pxr24.exr", Compression::PXR24, Blocks::ScanLines),
        ("b44.exr", Compression::B44, Blocks::ScanLines),
        ("b44a.exr", Compression::B44A, Blocks::ScanLines),
        ("tiles.exr", Compression::ZIP16, tiles),
    ] {
        let channels = SpecificChannels::rgb(|Vec2(x, y): Vec2<usize>| {
            (f16::from_f32(x as f32 * 0.25), f16::from_f32(y as f32), (x * y) as f32)
        });
        let encoding = Encoding { compression, blocks, line_order: LineOrder::Increasing };
        let layer = Layer::new((12, 10), LayerAttributes::default(), encoding, channels);
        let mut bytes = Cursor::new(Vec::new());
        Image::from_layer(layer).write().non_parallel().to_buffered(&mut bytes)?;
        std::fs::write(folder.join(name), bytes.into_inner())?;
    }
    Ok(())
}

/// The target's first byte chooses the format.
const GLTF: u8 = 0;
const OBJ: u8 = 1;
const PLY: u8 = 2;
const STL: u8 = 3;

fn meshes(folder: &Path) -> Result {
    let save = |name: &str, format: u8, bytes: &[u8]| std::fs::write(folder.join(name), [&[format], bytes].concat());
    let picture = imaging::encode_png(&Image::from_fn(2, 2, |x, y| [200 * x as u8, 200 * y as u8, 255]));

    // Three corners with normals and texture coordinates, then their indices, then the image.
    let corners: [[f32; 8]; 3] = [
        [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
        [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0],
    ];
    let mut buffer: Vec<u8> = corners.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    buffer.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    buffer.extend(&picture);
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    save("square.glb", GLTF, &glb(&triangle_json(buffer.len(), picture.len(), ""), &buffer))?;
    let uri = format!(r#","uri":"data:application/octet-stream;base64,{}""#, base64(&buffer));
    save("embedded.gltf", GLTF, triangle_json(buffer.len(), picture.len(), &uri).as_bytes())?;
    // Both images of a specular-glossiness material, glass, and an extension that is only named.
    let materials = r#""extensions":{"KHR_materials_pbrSpecularGlossiness":{"diffuseFactor":[0.9,0.8,0.7,0.6],"diffuseTexture":{"index":0},"specularFactor":[0.5,0.4,0.3],"glossinessFactor":0.7,"specularGlossinessTexture":{"index":0}},"KHR_materials_transmission":{"transmissionFactor":0.5,"transmissionTexture":{"index":0}},"KHR_materials_clearcoat":{"clearcoatFactor":1},"#;
    let embedded = triangle_json(buffer.len(), picture.len(), &uri);
    let extended = embedded.replacen(
        r#""extensions":{"KHR_materials_emissive"#,
        &format!("{materials}\"KHR_materials_emissive"),
        1,
    );
    save("extensions.gltf", GLTF, extended.as_bytes())?;
    // The target returns the mesh's own bytes for every file that it refers to.
    save("external.gltf", GLTF, triangle_json(buffer.len(), picture.len(), r#","uri":"a.bin""#).as_bytes())?;
    save("sparse.gltf", GLTF, SPARSE.as_bytes())?;

    save("square.obj", OBJ, b"mtllib a.mtl\nv 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 1 1 0 0 0 1\nv 0 1 0 1 1 1\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl wood\ns 1\nf 1/1/1 2/2/1 3/3/1 -1\nf 4//1 3//1 \\\n 2//1\n")?;
    // Both OBJ and MTL: the target returns the same bytes for the library.
    save("material.obj", OBJ, b"mtllib a\nnewmtl m\nKd 0.5 0.2 0.1\nKs 1 1 1\nNs 50\nPr 0.3\nd 0.5\nillum 2\nmap_Kd -s 2 2 -clamp on a.png\nbump -bm 0.5 b.png\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 2 2 0\nv 0.5 0.5 0\nf 1 2 4 3 5\n")?;
    save("other_case.obj", OBJ, b"MTLLIB a\nNEWMTL m\nkd 0 0 0\nD 0\nTR 1\nMAP_KD a.png\nnewmtl n\nTr 0.5\nd -halo 0.5\nUSEMTL M\nV 0 0 0\nV 1 0 0\nV 0 1 0\nF 1 2 3\nusemtl n\nf 1 3 2\n")?;
    save("ascii.ply", PLY, b"ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty float s\nproperty float t\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 255 0 0 0 0\n1 0 0 0 255 0 1 0\n1 1 0 0 0 255 1 1\n0 1 0 9 9 9 0 1\n4 0 1 2 3\n")?;
    let corners = [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    for (name, order, big) in [("little.ply", "little", false), ("big.ply", "big", true)] {
        let mut ply = format!("ply\nformat binary_{order}_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement tristrips 1\nproperty list int int vertex_indices\nend_header\n").into_bytes();
        ply.extend(corners.iter().flatten().flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() }));
        ply.extend([3i32, 0, 1, 2].iter().flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() }));
        save(name, PLY, &ply)?;
    }
    save("ascii.stl", STL, b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid a\n")?;
    let mut stl = vec![b' '; 80];
    stl.extend(2u32.to_le_bytes());
    for corners in [corners, [[1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0]]] {
        stl.extend([0; 12]);
        stl.extend(corners.iter().flatten().flat_map(|v| v.to_le_bytes()));
        stl.extend([0; 2]);
    }
    save("binary.stl", STL, &stl)?;
    Ok(())
}

fn triangle_json(buffer_bytes: usize, picture_bytes: usize, uri: &str) -> String {
    let view = |offset: usize, bytes: usize, rest: &str| {
        format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{bytes}{rest}}}"#)
    };
    let accessor = |kind: &str, offset: usize| {
        format!(r#"{{"bufferView":0,"byteOffset":{offset},"componentType":5126,"type":"{kind}","count":3}}"#)
    };
    let (vertices, indices, picture) =
        (view(0, 96, r#","byteStride":32"#), view(96, 6, ""), view(104, picture_bytes, ""));
    let (positions, normals, uvs) = (accessor("VEC3", 0), accessor("VEC3", 12), accessor("VEC2", 24));
    format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
"nodes":[{{"children":[1],"translation":[0,0,-1]}},{{"mesh":0,"rotation":[0,0,0.6,0.8],"scale":[1,2,-1]}}],
"meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2}},"indices":3,"material":0}}]}}],
"materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0.5,0.2,0.9],"baseColorTexture":{{"index":0,"extensions":{{"KHR_texture_transform":{{"offset":[0.1,0],"rotation":0.5,"scale":[2,2]}}}}}},"roughnessFactor":0.4}},
"normalTexture":{{"index":0,"scale":0.5}},"emissiveFactor":[1,1,1],"alphaMode":"MASK","alphaCutoff":0.3,"extensions":{{"KHR_materials_emissive_strength":{{"emissiveStrength":3}}}}}}],
"textures":[{{"source":0,"sampler":0}}],"samplers":[{{"wrapS":33071,"wrapT":33648,"magFilter":9728}}],"images":[{{"bufferView":2}}],
"accessors":[{positions},{normals},{uvs},{{"bufferView":1,"componentType":5123,"type":"SCALAR","count":3}}],
"bufferViews":[{vertices},{indices},{picture}],"buffers":[{{"byteLength":{buffer_bytes}{uri}}}]}}"#
    )
}

/// Four corners of a sparse accessor over zeros, as a strip; the bytes are 1, 2, 3 and three corners.
const SPARSE: &str = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,2,0,0,1]}],
"meshes":[{"primitives":[{"attributes":{"POSITION":0},"mode":5}]}],
"accessors":[{"componentType":5126,"type":"VEC3","count":4,"sparse":{"count":3,"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":1}}}],
"bufferViews":[{"buffer":0,"byteLength":3},{"buffer":0,"byteOffset":4,"byteLength":36}],
"buffers":[{"byteLength":40,"uri":"data:;base64,AQIDAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAgD8AAIA/AAAAAA=="}]}"#;

fn glb(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut bytes = [b"glTF".as_slice(), &2u32.to_le_bytes()].concat();
    bytes.extend((28 + json.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", binary)] {
        bytes.extend((chunk.len() as u32).to_le_bytes());
        bytes.extend(kind);
        bytes.extend(chunk);
    }
    bytes
}

fn base64(bytes: &[u8]) -> String {
    let digits = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let group = |three: &[u8]| {
        let [a, b, c] = std::array::from_fn(|i| u32::from(three.get(i).copied().unwrap_or_default()));
        let word = a << 16 | b << 8 | c;
        let digit =
            move |i: usize| if i > three.len() { '=' } else { digits[(word >> (18 - 6 * i)) as usize & 63].into() };
        std::array::from_fn::<char, 4, _>(digit)
    };
    bytes.chunks(3).flat_map(group).collect()
}

/// Writes a pose file of each format.
fn poses(folder: &Path) -> Result {
    let matrix = "1,0,0,0,0,1,0,1.5,0,0,1,0,0,0,0,1";
    let rows = "[[1,0,0,0],[0,1,0,1.5],[0,0,1,0],[0,0,0,1]]";
    let polycam: Vec<String> =
        matrix.split(',').take(12).enumerate().map(|(i, v)| format!(r#""t_{}{}":{v}"#, i / 4, i % 4)).collect();
    for (name, text) in [
        ("own.json", format!(r#"{{"axes":"opencv","world_up":[0,1,0],"photos":[{{"file":"a.jpg","world_from_camera":{rows},"hfov_deg":65,"exposure_ev":0}},{{"file":"b.jpg","rotation_xyzw":[0,0.6,0,0.8],"position_m":[1,0,0],"intrinsics":{{"fx":500,"fy":500,"cx":320,"cy":240}},"exposure_ev":0.5}}]}}"#)),
        ("record3d.json", r#"{"w":720,"h":960,"fps":60,"K":[700,0,0,0,700,0,360,480,1],"perFrameIntrinsicCoeffs":[[700,700,360,480],[701,701,360,480]],"poses":[[0,0,0,1,0,0,0],[0,0.6,0,0.8,0.1,0,0]]}"#.into()),
        ("scanner.json", format!(r#"{{"cameraPoseARFrame":[{matrix}],"intrinsics":[1400,0,960,0,1400,720,0,0,1]}}"#)),
        ("polycam.json", format!(r#"{{{},"fx":700,"fy":700,"cx":512,"cy":384,"width":1024,"height":768}}"#, polycam.join(","))),
        ("transforms.json", format!(r#"{{"applied_scale":0.5,"camera_angle_x":1.1,"frames":[{{"file_path":"./a.jpg","transform_matrix":{rows}}},{{"file_path":"b","transform_matrix":{rows},"fl_x":600,"w":640,"h":480}}]}}"#)),
        ("distorted.json", r#"{"camera_model":"OPENCV_FISHEYE","fl_x":300,"w":640,"h":480,"k1":0.05,"k2":0.01}"#.into()),
        ("cameras.txt", "# Camera list\n1 OPENCV 640 480 500 510 320 240 -0.2 0.05 0.001 0.002\n2 SIMPLE_RADIAL 640 480 500 320 240 0.1\n".into()),
        ("track.chan", "# frame tx ty tz rx ry rz\n0 0 1.5 0 0 0 0\n1 0.1 1.5 0 -10 20 5\n".into()),
        ("track_lens.chan", "0 0 1.5 0 0 0 0 40\n1 0.1 1.5 0 -10 20 5 39.5\n".into()),
        ("images.txt", "# Image list\n1 1 0 0 0 0 0 0 1 a.jpg\n10.5 20 -1 30 40 7\n2 0.8 0 0.6 0 3 -2 -1 1 b.jpg\n\n".into()),
        ("camera.usda", "#usda 1.0\n(\n metersPerUnit = 0.01\n upAxis = \"Z\"\n)\ndef Xform \"a\"\n{\n float3 xformOp:rotateXYZ = (10, 20, 30)\n uniform token[] xformOpOrder = [\"xformOp:rotateXYZ\"]\n def Camera \"c\"\n {\n  float focalLength.timeSamples = { 0: 35, 1: 36 }\n  quatf xformOp:orient = (1, 0, 0, 0)\n  double3 xformOp:translate.timeSamples = { 0: (0, 0, 0), 2: (1, 0, 0) }\n  uniform token[] xformOpOrder = [\"xformOp:translate\", \"!invert!xformOp:orient\"]\n }\n}\n".into()),
        ("trajectory.txt", "# time tx ty tz qx qy qz qw\n1.0 0 0 0 0 0 0 1\n2.01 0.1 0 0 0 0.6 0 0.8\n".into()),
    ] {
        std::fs::write(folder.join(name), text)?;
    }
    Ok(())
}

fn texts(folder: &Path) -> Result {
    for (name, text) in [
        (
            "estimate",
            "estimate\nroom.jpg\n--depth\ndepth.png\n--intrinsics\n525,525,319.5,239.5\n--up\n0,1,-0.1\n-o\nroom.scene",
        ),
        ("envmap", "envmap\nroom.scene\n--at\n0,-0.5,-2\n--size\n256x128\n-o\nprobe.exr"),
        ("probes", "probes\nroom.scene\n--grid\n4,2,4\n-o\nprobes\n--force"),
        ("insert", "insert\nroom.scene\n--mesh\nmug.glb\n--pixel\n320,240\n--material\ngold\n-o\nout.png"),
        ("export", "export\nroom.scene\n--to\nglb\n-o\nroom.glb"),
        ("preset", "brushed-steel"),
        (
            "material",
            r##"{"preset":"gold","base_color":"#c02020","roughness":0.4,"emissive":[1,2,0.5],"alpha":0.5,"alpha_mode":"mask","normal_texture":"up.png"}"##,
        ),
        (
            "path",
            r#"{"interpolation":"catmull-rom","keyframes":[{"time_s":0,"position_m":[0,-1,-3],"yaw_deg":0},{"time_s":1.5,"pixel":[320,400],"yaw_deg":90}]}"#,
        ),
        (
            "layout",
            r#"{"objects":[{"mesh":"table.glb","name":"table","pixel":[320,400],"height_m":0.4,"yaw_deg":20,"material":"gold"},{"mesh":"cup.obj","on":"table","scale":0.1,"material":{"roughness":0.2}},{"mesh":"car.ply","path":{"keyframes":[{"time_s":0,"position_m":[0,-1,-3]},{"time_s":1,"pixel":[320,400]}]},"align":"none"},{"mesh":"box.stl","path":"way.json"},{"mesh":"box.stl","position_m":[0,0,-2],"unit":"mm"}]}"#,
        ),
        (
            "insert_several",
            "insert\nroom.scene\n--mesh\na.glb\n--pixel\n320,240\n--mesh\nb.obj\n--at\n0,-1,-2\n--height\n0.3\n-o\nout.png",
        ),
        ("points.csv", "x,y,z,name\n# a comment\n0,-0.5,-2,desk\n1,0,-1\n\"1\",2,3,\"a, b\"\n"),
    ] {
        std::fs::write(folder.join(name), text)?;
    }
    Ok(())
}

/// Writes a session with every command, and one with gestures.
fn messages(folder: &Path) -> Result {
    let commands = [
        r#"{"do":"add","mesh":"builtin:sphere","pixel":[2,3],"material":{"preset":"gold","roughness":0.3}}"#,
        r#"{"do":"duplicate","object":1}"#,
        r#"{"do":"rename","object":1,"name":"ball"}"#,
        r#"{"do":"place","object":1,"place":{"position":[0,-1,-2]}}"#,
        r#"{"do":"size","object":2,"size":{"height":0.5}}"#,
        r#"{"do":"turn","object":2,"yaw_deg":30}"#,
        r#"{"do":"align","object":2,"align":"none"}"#,
        r##"{"do":"material","object":2,"material":{"base_color":"#c02020","metallic":1}}"##,
        r#"{"do":"floor-gloss","gloss":0.5}"#,
        r#"{"do":"contrast","factor":0.7}"#,
        r#"{"do":"inferred-light","light":"expected"}"#,
        r#"{"do":"warmth","ev":-0.5}"#,
        r#"{"do":"white","pixel":[2,2]}"#,
        r#"{"do":"white","pixel":null}"#,
        r#"{"do":"set-light","light":"A1","change":{"on":true,"scale":2,"color":{"kelvin":3000},"at_m":[0,1,-1]}}"#,
        r#"{"do":"add-light","new":{"sun":{"azimuth_deg":20,"elevation_deg":45,"strength":2,"angle_deg":1,"kelvin":5500}}}"#,
        r#"{"do":"remove-light","light":"A2"}"#,
        r#"{"do":"reset-lights"}"#,
        r#"{"do":"set-key","object":2,"time_s":0}"#,
        r#"{"do":"set-key","object":2,"time_s":1.5}"#,
        r#"{"do":"move-key","object":2,"from_s":1.5,"to_s":2}"#,
        r#"{"do":"delete-key","object":2,"time_s":0}"#,
        r#"{"do":"interpolate","object":2,"interpolation":"catmull-rom"}"#,
        r#"{"do":"frames","frames":48,"fps":24}"#,
        r#"{"do":"delete","object":2}"#,
    ];
    let lines: Vec<String> = commands.map(|command| format!(r#"{{"type":"command","command":{command}}}"#)).into();
    std::fs::write(folder.join("commands"), lines.join("\n"))?;
    let gestures = [
        lines[0].as_str(),
        r#"{"type":"preview","sequence":1,"command":{"do":"drag","object":1,"to":[1.5,3.5]}}"#,
        r#"{"type":"commit"}"#,
        r#"{"type":"preview","sequence":2,"command":{"do":"turn","object":1,"yaw_deg":-90}}"#,
        r#"{"type":"cancel"}"#,
        r#"{"type":"preview","sequence":3,"command":{"do":"warmth","ev":1.25}}"#,
        r#"{"type":"commit"}"#,
        r#"{"type":"undo"}"#,
        r#"{"type":"redo"}"#,
        r#"{"type":"probe","pixel":[2,2],"lift_m":0.1,"exposure_ev":1}"#,
        r#"{"type":"overlay","what":"levels"}"#,
        r#"{"type":"seek","time_s":0.5,"sequence":4}"#,
        r#"{"type":"stop-film"}"#,
        r#"{"type":"stop"}"#,
        r#"{"type":"close"}"#,
    ];
    Ok(std::fs::write(folder.join("gestures"), gestures.join("\n"))?)
}
