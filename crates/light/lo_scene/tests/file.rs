//! Tests of the scene file: round trip, an independent reader, and damaged files.
#![allow(clippy::unwrap_used)]

use std::sync::Arc;

use lo_geometry::{Camera, Cube, Plane, Quat, RigidTransform, Vec3};
use lo_imaging::{GainMap, GainMapParameters, Image, Photo, PhotoEncoding, RadianceImage};
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::{
    AddedLight, AnalyticLight, CameraSource, Completion, EmitterEdit, Estimate, EstimateOrigin, ExpectedLight, Frame,
    InferredLight, LightChange, LightColor, LightEdits, LightMode, LightShape, LightTuning, MAX_FILE_BYTES,
    MAX_LIGHT_EDITS, ObjectDisplay, OtherPhoto, PanoramaContribution, PanoramaImage, PanoramaSource, Room, RoomPlane,
    SceneError, SceneFile, SceneObjects, Side,
};
use proptest::prelude::*;

fn scene(linear: bool) -> SceneFile {
    let (width, height) = (12, 8);
    let photo = if linear {
        Photo::Linear(Image::from_fn(width, height, |x, y| [x as f32 * 0.37, y as f32, 3.25]))
    } else {
        Photo::Srgb8(Image::from_fn(width, height, |x, y| [x as u8, y as u8, 200]))
    };
    let depth_m = Image::from_fn(6, 4, |x, y| if x == 2 && y == 1 { 0.0 } else { 1.0 + 0.1 * x as f32 });
    let camera = Camera::new(10.123_456_789_012_3, 10.2, 6.1, 3.9, width as u32, height as u32).unwrap();
    let frame = Frame::new(photo, depth_m, camera, 1.25).unwrap();
    let point = |i: usize| RadiancePoint {
        position_m: Vec3::new((i * 7 % 31) as f32, (i * 3 % 29) as f32, (i * 5 % 23) as f32) * 0.1 - Vec3::splat(1.0),
        radiance: [i as f32 * 0.1, 0.5, 2.0],
        provenance: if i.is_multiple_of(3) { Provenance::Inferred } else { Provenance::Observed },
    };
    let points: Vec<RadiancePoint> = (0..40).map(point).collect();
    let light = LightOctree::from_points(&points, Cube::centred(Vec3::ZERO, 5.3), 4, 2).unwrap().0;
    let plane = Plane { normal: Vec3::Y, offset_m: -1.51 };
    let room = Room { up: Vec3::Y, planes: vec![RoomPlane { side: Side::Floor, plane, measured: true }] };
    let sources = vec!["/home/somebody/photo.jpg".to_owned(), "C:\\pictures\\depth.png".to_owned()];
    let origin = EstimateOrigin { completion: Completion::Shell, sources, ..EstimateOrigin::default() };
    Estimate { room: Some(room), origin, ..Estimate::observed_only(light, frame) }.into()
}

fn estimate_of(scene: &mut SceneFile) -> &mut Estimate {
    Arc::make_mut(&mut scene.estimate)
}

#[test]
fn a_photo_keeps_profile_gain_map_and_metadata() {
    let Some(inputs) = lo_testdata::shared_data("inputs", "scenes of photos with a profile") else { return };
    let Photo::Encoded8(p3) = lo_imaging::read_photo(inputs.join("p3.png")).unwrap().photo else { panic!() };
    let map = Image::from_fn(3, 2, |x, y| [x as u8 * 90, y as u8 * 200, 7]);
    let encoding = |parameters| PhotoEncoding {
        profile: p3.encoding.profile.clone(),
        gain_map: Some(GainMap { image: map.clone(), parameters }),
        exif: b"II*\0\x08\0\0\0\0\0".to_vec(),
        xmp: b"<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"/>".to_vec(),
    };
    let mut scene = scene(false);
    let Photo::Srgb8(image) = scene.estimate.frame.photo.clone() else { panic!() };
    let mut with = |parameters| {
        estimate_of(&mut scene).frame.photo = Photo::encoded8(image.clone(), encoding(parameters));
        SceneFile::from_bytes(&scene.to_bytes(lo_imaging::GENERATOR).unwrap())
            .map(|back| (back.estimate.frame.photo == scene.estimate.frame.photo, back))
    };
    let (same, back) = with(GainMapParameters::default()).unwrap();
    assert!(same);
    let frame = &back.estimate.frame;
    assert_eq!(frame.photo.linear_at((3, 2)), frame.photo.radiance()[(3, 2)]);
    let error = with(GainMapParameters { gamma: [0.0; 3], ..GainMapParameters::default() }).unwrap_err();
    assert!(error.to_string().contains("gain map"), "{error}");
}

#[test]
fn only_whole_scenes_are_complete() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.scene");
    assert!(!SceneFile::is_complete(&path).unwrap(), "a missing file");
    let bytes = scene(false).to_bytes(lo_imaging::GENERATOR).unwrap();
    std::fs::write(&path, &bytes).unwrap();
    assert!(SceneFile::is_complete(&path).unwrap());
    for length in [0, 7, 8, 9, 200, bytes.len() - 1] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(!SceneFile::is_complete(&path).unwrap(), "{length} bytes of {}", bytes.len());
    }
    std::fs::write(&path, [&bytes[..], &[0]].concat()).unwrap();
    assert!(!SceneFile::is_complete(&path).unwrap(), "a byte more");
    // As after a crash of a file system: the length of the file, without its content.
    std::fs::write(&path, vec![0; bytes.len()]).unwrap();
    assert!(!SceneFile::is_complete(&path).unwrap(), "zeros");
    std::fs::write(
        &path,
        safetensors::serialize(Vec::<(&str, safetensors::tensor::TensorView<'_>)>::new(), None).unwrap(),
    )
    .unwrap();
    assert!(!SceneFile::is_complete(&path).unwrap(), "another safetensors file");
    assert!(SceneFile::is_complete(folder.path()).is_err(), "a folder");
}

#[test]
fn a_scene_comes_back_and_gives_the_same_bytes() {
    for linear in [false, true] {
        let scene = scene(linear);
        let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
        let back = SceneFile::from_bytes(&bytes).unwrap();
        assert_eq!(back.estimate.origin.sources, ["photo.jpg", "depth.png"]);
        let mut same = back.clone();
        estimate_of(&mut same).origin.sources.clone_from(&scene.estimate.origin.sources);
        assert_eq!(same, scene);
        assert_eq!(back.to_bytes(lo_imaging::GENERATOR).unwrap(), bytes);
        assert_eq!(scene.to_bytes(lo_imaging::GENERATOR).unwrap(), bytes);
    }
}

#[test]
fn files_appear_whole_and_errors_name_the_path() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("room.safetensors");
    let scene = scene(false);
    scene.write(&path, lo_imaging::GENERATOR).unwrap();
    assert_eq!(SceneFile::read(&path).unwrap().estimate.light, scene.estimate.light);
    let missing = SceneFile::read(&folder.path().join("none")).unwrap_err().to_string();
    assert!(missing.contains("none"), "{missing}");
    assert!(scene.write(&folder.path().join("no/folder.safetensors"), lo_imaging::GENERATOR).is_err());
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn where_the_camera_comes_from_comes_back() {
    let mut scene = scene(false);
    estimate_of(&mut scene).origin.up_deviation_deg = Some(2.5);
    for source in [CameraSource::Exif, CameraSource::Network { deviation_deg: 4.5 }] {
        estimate_of(&mut scene).origin.camera_source = Some(source);
        let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
        let back = SceneFile::from_bytes(&bytes).unwrap();
        assert_eq!(
            (back.estimate.origin.camera_source, back.estimate.origin.up_deviation_deg),
            (Some(source), Some(2.5))
        );
    }
    estimate_of(&mut scene).origin.up_deviation_deg = Some(-1.0);
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    assert!(SceneFile::from_bytes(&bytes).unwrap_err().to_string().contains("is not a valid angle"));
}

#[test]
fn what_networks_say_of_their_work_comes_back() {
    let mut scene = scene(false);
    let rows = scene.estimate.light.rgba.iter().map(Vec::len);
    let confidence = rows.map(|rows| (0..rows).map(|row| (7 * row) as u8).collect()).collect();
    let estimate = estimate_of(&mut scene);
    (estimate.origin.predicted_depth, estimate.confidence) = (true, Some(confidence));
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    let back = SceneFile::from_bytes(&bytes).unwrap().estimate;
    assert_eq!((back.origin.predicted_depth, &back.confidence), (true, &scene.estimate.confidence));
    // in the metadata the quotes are escaped
    let missing = bytes.windows(12).position(|window| window == b"\"confidence\"").unwrap();
    let mut damaged = bytes.clone();
    damaged[missing + 3] = b'x';
    assert!(matches!(SceneFile::from_bytes(&damaged), Err(SceneError::MissingTensor("confidence"))));
    estimate_of(&mut scene).confidence.as_mut().unwrap()[2].pop();
    let error = SceneFile::from_bytes(&scene.to_bytes(lo_imaging::GENERATOR).unwrap()).unwrap_err().to_string();
    assert!(error.contains("confidence") && error.contains("feature rows"), "{error}");
}

#[test]
fn what_a_panorama_gave_comes_back_and_leaves_other_files_as_they_are() {
    let plain = scene(false);
    let without = plain.to_bytes(lo_imaging::GENERATOR).unwrap();
    assert!(!without.windows(8).any(|window| window == b"panorama"));
    let share =
        plain.estimate.light.rgba.iter().map(|rows| (0..rows.len()).map(|row| (11 * row) as u8).collect()).collect();
    let source = PanoramaSource {
        file: "/home/somebody/theta.hdr".to_owned(),
        position_m: Vec3::new(0.25, -0.1, -1.3),
        yaw_deg: -73.4,
        pitch_deg: 1.25,
        roll_deg: -0.4,
        exposure_ev: -1.73,
        confidence: 0.81,
        clipped: true,
    };
    // Above the range of half precision, and dim.
    let radiance = RadianceImage::from_fn(32, 16, |x, y| [1e6 / (1 + x * x + y * y) as f32, 0.1, 0.0]);
    let image = Some(PanoramaImage::new(&radiance, Quat::from_rotation_y(0.3)));
    let mut scene = plain;
    estimate_of(&mut scene).panorama = Some(PanoramaContribution { source, share, image });
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    let back = SceneFile::from_bytes(&bytes).unwrap().estimate.panorama.clone().unwrap();
    let contribution = estimate_of(&mut scene).panorama.as_mut().unwrap();
    assert_eq!((&back.share, &back.source.file[..]), (&contribution.share, "theta.hdr"));
    contribution.source.file = "theta.hdr".to_owned();
    assert_eq!(back.source, contribution.source);
    assert_eq!(back.image, contribution.image);
    let kept = &contribution.image.as_ref().unwrap().radiance;
    let same = |a: &f32, b: &f32| (a - b).abs() <= 1e-3 * b.abs();
    assert!(kept.pixels().as_flattened().iter().zip(radiance.pixels().as_flattened()).all(|(a, b)| same(a, b)));
    contribution.share[3].pop();
    let error = SceneFile::from_bytes(&scene.to_bytes(lo_imaging::GENERATOR).unwrap()).unwrap_err().to_string();
    assert!(error.contains("panorama_share") && error.contains("feature rows"), "{error}");
    estimate_of(&mut scene).panorama.as_mut().unwrap().source.confidence = 1.5;
    let error = SceneFile::from_bytes(&scene.to_bytes(lo_imaging::GENERATOR).unwrap()).unwrap_err().to_string();
    assert!(error.contains("confidence"), "{error}");
}

#[test]
fn expected_light_comes_back_and_is_checked() {
    let radiance = RadianceImage::from_fn(64, 32, |x, y| [0.1 + x as f32, 0.2 + y as f32, 0.0]);
    let expected = ExpectedLight::new(&radiance, Quat::from_rotation_x(0.2), 3.25);
    let mut scene = scene(false);
    estimate_of(&mut scene).expected = Some(expected);
    let back = SceneFile::from_bytes(&scene.to_bytes(lo_imaging::GENERATOR).unwrap()).unwrap();
    assert_eq!(back.estimate.expected, scene.estimate.expected);
    estimate_of(&mut scene).expected.as_mut().unwrap().contrast_stops = 99.0;
    let error = SceneFile::from_bytes(&scene.to_bytes(lo_imaging::GENERATOR).unwrap()).unwrap_err().to_string();
    assert!(error.contains("contrast_stops"), "{error}");
}

fn edits() -> LightEdits {
    let rectangle = LightShape::Rectangle {
        centre_m: Vec3::new(0.1, 1.2, -2.3),
        direction: Vec3::NEG_Y,
        across: Vec3::X,
        size_m: [1.2, 0.3],
        two_sided: false,
    };
    let sun = LightShape::Sun { direction: Vec3::new(0.6, 0.8, 0.0), angular_radius_deg: 0.27, of_photo: false };
    let of_photo = LightShape::Sun { direction: Vec3::new(0.0, 0.8, 0.6), angular_radius_deg: 0.27, of_photo: true };
    let added = |id: &str, shape, radiance| AddedLight {
        id: id.to_owned(),
        light: AnalyticLight { shape, radiance },
        change: LightChange::NONE,
    };
    let change = LightChange {
        on: false,
        scale: 2.5,
        color: Some(LightColor::Kelvin(3000.0)),
        at_m: Some(Vec3::new(0.0, 1.0, 0.1)),
    };
    LightEdits {
        emitters: vec![EmitterEdit { id: "L1".to_owned(), found_at_m: Vec3::new(0.3, 0.2, 0.1), change }],
        added: vec![
            added("A1", rectangle, [3.0, 2.0, 1.0]),
            added("A2", sun, [1e5, 1e5, 9e4]),
            added("A3", of_photo, [1e5; 3]),
        ],
        inferred: Some(InferredLight {
            light: LightMode::Expected,
            tuning: LightTuning { contrast: 0.7, warmth_ev: -0.5, white: Some([1.5, 0.25]) },
        }),
    }
}

#[test]
fn edits_of_light_lie_beside_the_estimate() {
    let plain = scene(false);
    let without = plain.to_bytes(lo_imaging::GENERATOR).unwrap();
    let scene = SceneFile { light_edits: edits(), ..plain.clone() };
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    let mut back = SceneFile::from_bytes(&bytes).unwrap();
    assert_eq!((&back.light_edits, &back.estimate.light), (&scene.light_edits, &plain.estimate.light));
    assert_eq!(back.to_bytes(lo_imaging::GENERATOR).unwrap(), bytes);
    back.light_edits = LightEdits::default();
    assert!(back.to_bytes(lo_imaging::GENERATOR).unwrap() == without, "without edits the file is as it was");
}

/// Replaces [`edits`] in the bytes of a scene file.
fn with_edits(bytes: &[u8], by: &LightEdits) -> Vec<u8> {
    let (length, rest) = bytes.split_at(8);
    let (header, tensors) = rest.split_at(u64::from_le_bytes(length.try_into().unwrap()) as usize);
    // The metadata is a string of JSON in JSON.
    let quoted = |edits: &LightEdits| {
        let text = serde_json::to_string(&serde_json::to_string(edits).unwrap()).unwrap();
        text.trim_matches('"').to_owned()
    };
    let header = std::str::from_utf8(header).unwrap();
    assert!(header.contains(&quoted(&edits())));
    let header = header.replace(&quoted(&edits()), &quoted(by));
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), tensors].concat()
}

#[test]
fn edits_out_of_range_are_named() {
    let scene = SceneFile { light_edits: edits(), ..scene(false) };
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    let wrong = |change: &dyn Fn(&mut LightEdits), what: &str| {
        let mut light_edits = edits();
        change(&mut light_edits);
        let read = SceneFile::from_bytes(&with_edits(&bytes, &light_edits)).unwrap_err().to_string();
        let written =
            SceneFile { light_edits, ..scene.clone() }.to_bytes(lo_imaging::GENERATOR).unwrap_err().to_string();
        assert!(read.contains(what) && written == read, "{read}; {written}");
    };
    let inferred = |edits: &mut LightEdits, tuning: LightTuning| {
        edits.inferred = Some(InferredLight { light: LightMode::Plausible, tuning });
    };
    let usual = LightTuning::default();
    wrong(&|edits| inferred(edits, LightTuning { contrast: 3.5, ..usual }), "inferred light: the contrast");
    wrong(&|edits| inferred(edits, LightTuning { warmth_ev: -5.0, ..usual }), "inferred light: the warmth");
    wrong(&|edits| edits.emitters[0].change.scale = -1.0, "edited light L1: the scale");
    wrong(&|edits| edits.emitters[0].change.color = Some(LightColor::Kelvin(1.0)), "edited light L1: the colour");
    wrong(&|edits| edits.emitters[0].change.color = Some(LightColor::Rgb([0.0; 3])), "edited light L1: the colour");
    wrong(&|edits| edits.emitters[0].change.at_m = Some(Vec3::splat(1e9)), "edited light L1: the position");
    wrong(&|edits| edits.emitters[0].id = "a/b".to_owned(), "invalid name of an edited light: \"a/b\"");
    wrong(&|edits| edits.emitters[0].id = "A2".to_owned(), "light A2 is edited twice");
    wrong(&|edits| edits.added[0].light.radiance[1] = -1.0, "edited light A1: the radiance");
    wrong(&|edits| edits.added = vec![edits.added[0].clone(); MAX_LIGHT_EDITS + 1], "257 edited lights");
    let shape = |edits: &mut LightEdits, shape| edits.added[0].light.shape = shape;
    let sphere = |centre_m, radius_m| LightShape::Sphere { centre_m, radius_m };
    wrong(&|edits| shape(edits, sphere(Vec3::ZERO, 0.0)), "the size");
    wrong(&|edits| shape(edits, sphere(Vec3::splat(1e6), 0.1)), "the position");
    let sun = |direction, angular_radius_deg| LightShape::Sun { direction, angular_radius_deg, of_photo: false };
    wrong(&|edits| shape(edits, sun(Vec3::Y, 90.0)), "the size");
    wrong(&|edits| shape(edits, sun(Vec3::splat(1.0), 0.3)), "the direction");
}

fn objects() -> SceneObjects {
    let file = |bytes: &[u8]| Arc::from(bytes);
    SceneObjects {
        layout: r#"[{"mesh":"a.obj","pixel":[1,2]}]"#.to_owned(),
        files: [("a.obj".to_owned(), file(b"v 0 0 0")), ("a.obj/a.mtl".to_owned(), file(b""))].into(),
        shown: ObjectDisplay { floor_gloss: 0.25, frames: Some(7), fps: 30, time_s: 1.5 },
    }
}

#[test]
fn objects_lie_beside_the_rest_and_leave_other_files_as_they_are() {
    let plain = scene(false);
    let without = plain.to_bytes(lo_imaging::GENERATOR).unwrap();
    assert!(!without.windows(7).any(|window| window == b"objects"));
    let scene = SceneFile { objects: objects(), ..plain.clone() };
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    let mut back = SceneFile::from_bytes(&bytes).unwrap();
    assert_eq!((&back.objects, &back.estimate.light), (&scene.objects, &plain.estimate.light));
    assert_eq!(back.to_bytes(lo_imaging::GENERATOR).unwrap(), bytes);
    back.objects = SceneObjects::default();
    assert!(back.to_bytes(lo_imaging::GENERATOR).unwrap() == without, "without objects the file is as it was");
    // An independent reader gets the files unchanged.
    let tensors = safetensors::SafeTensors::deserialize(&bytes).unwrap();
    assert_eq!(tensors.tensor("objects.0").unwrap().data(), b"v 0 0 0");
    assert_eq!(tensors.tensor("objects").unwrap().data(), scene.objects.layout.as_bytes());
}

#[test]
fn objects_that_are_damaged_are_named() {
    let refused = |change: &dyn Fn(&mut SceneObjects), what: &str| {
        let mut objects = objects();
        change(&mut objects);
        let error = SceneFile { objects, ..scene(false) }.to_bytes(lo_imaging::GENERATOR).unwrap_err().to_string();
        assert!(error.contains("objects") && error.contains(what), "{error}");
    };
    refused(&|objects| objects.shown.floor_gloss = f32::NAN, "gloss");
    refused(&|objects| objects.shown.frames = Some(0), "frames");
    refused(&|objects| objects.shown.fps = 0, "frames per second");
    refused(&|objects| objects.shown.time_s = -1.0, "times");
    for name in ["", "../a", "a//b", "a/b/c", "a\\b", "a\nb", ".."] {
        refused(&|objects| drop(objects.files.insert(name.into(), Arc::from(&b""[..]))), "not a valid file name");
    }
    let many =
        |objects: &mut SceneObjects| objects.files = (0..1001).map(|i| (i.to_string(), Arc::from(&b""[..]))).collect();
    refused(&many, "1001 files");
    let bytes = SceneFile { objects: objects(), ..scene(false) }.to_bytes(lo_imaging::GENERATOR).unwrap();
    for (from, to, what) in [
        ("\"objects.1\":", "\"objects.9\":", "objects.1 with a.obj/a.mtl is missing"),
        ("\"objects\":{\"dtype", "\"objectx\":{\"dtype", "their layout is missing"),
        ("a.obj/a.mtl", "a.obj/../tl", "not a valid"),
        ("\\\"fps\\\":30", "\\\"fps\\\":-3", "metadata: invalid value"),
        ("[{\"mesh\"", "[{\u{7f}mes\u{7f}\"", ""),
    ] {
        let mut bytes = bytes.clone();
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        match SceneFile::from_bytes(&bytes) {
            Err(error) => assert!(error.to_string().contains(what), "{error}"),
            // This crate does not interpret layouts.
            Ok(scene) => assert!(what.is_empty() && scene.objects.layout.contains('\u{7f}')),
        }
    }
    let mut bytes = bytes.clone();
    let at = bytes.windows(8).position(|window| window == b"[{\"mesh\"").unwrap();
    bytes[at] = 0xff;
    assert!(SceneFile::from_bytes(&bytes).unwrap_err().to_string().contains("UTF-8"));
}

/// An independent reader, written from the description of the safetensors format: 8 bytes of length, JSON, data.
#[test]
fn the_layout_is_what_the_documentation_says() {
    let scene = scene(false);
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
    let data = |name: &str| {
        let range = &header[name]["data_offsets"];
        &bytes[8 + length + range[0].as_u64().unwrap() as usize..8 + length + range[1].as_u64().unwrap() as usize]
    };
    let metadata: serde_json::Value =
        serde_json::from_str(header["__metadata__"]["lightoctree"].as_str().unwrap()).unwrap();
    assert_eq!(metadata["format_version"], 1);
    assert_eq!(metadata["camera"]["fx"], 10.123_456_789_012_3);
    assert_eq!(metadata["octree"]["depth"], 4);
    assert_eq!(metadata["completion"], "shell");
    assert_eq!(metadata["room"]["planes"][0]["side"], "floor");
    assert_eq!(metadata["sources"], serde_json::json!(["photo.jpg", "depth.png"]));
    assert_eq!(header["photo"]["shape"], serde_json::json!([8, 12, 3]));
    assert_eq!(header["photo"]["dtype"], "U8");
    assert_eq!(&data("photo")[3 * 13..3 * 14], &[1, 1, 200]);
    assert_eq!(header["depth_m"]["shape"], serde_json::json!([4, 6]));
    assert_eq!(data("depth_m")[4 * 5..4 * 6], 1.5f32.to_le_bytes());
    let leaves = data("octree.4.rgba");
    assert_eq!(leaves.len(), scene.estimate.light.rgba[4].len() * 16);
    assert_eq!(leaves[..4], scene.estimate.light.rgba[4][0][0].to_le_bytes());
}

#[test]
fn truncated_files_are_errors_at_every_length() {
    let bytes = scene(false).to_bytes(lo_imaging::GENERATOR).unwrap();
    for length in (0..bytes.len()).step_by(7).chain([bytes.len() - 1]) {
        assert!(SceneFile::from_bytes(&bytes[..length]).is_err(), "{length} of {} bytes", bytes.len());
    }
}

#[test]
fn wrong_headers_are_named() {
    let bytes = scene(false).to_bytes(lo_imaging::GENERATOR).unwrap();
    let error = |from: &str, to: &str| {
        assert_eq!(from.len(), to.len());
        let mut bytes = bytes.clone();
        let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect(from);
        bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
        SceneFile::from_bytes(&bytes).unwrap_err().to_string()
    };
    let cases = [
        ("{\\\"format_version\\\":1", "{\\\"format_version\\\":7", "version"),
        ("\"lightoctree\":", "\"lightoctrex\":", "lightoctree"),
        ("\"photo\":", "\"phot_\":", "photo"),
        ("\"depth_m\":", "\"depth_x\":", "depth_m"),
        ("[4,6]", "[6,4]", "aspect"),
        ("\\\"exposure\\\":1.25", "\\\"exposure\\\":-1.2", "exposure"),
        ("\\\"fx\\\":10", "\\\"fx\\\":-1", "focal"),
        ("\\\"depth\\\":4", "\\\"depth\\\":9", "octree"),
        ("octree.4.rgba", "octree.4.rgbx", "octree.4.rgba"),
        ("\\\"up\\\":[0.0,1.0,0.0]", "\\\"up\\\":[0.0,9.0,0.0]", "unit"),
    ];
    for (from, to, word) in cases {
        let error = error(from, to);
        assert!(error.contains(word), "{from} → {to}: {error}");
    }
    let huge = [u64::MAX.to_le_bytes().as_slice(), b"{}"].concat();
    assert!(matches!(SceneFile::from_bytes(&huge), Err(SceneError::Container(_))));
    let empty = [2u64.to_le_bytes().as_slice(), b"{}"].concat();
    assert!(matches!(SceneFile::from_bytes(&empty), Err(SceneError::NoMetadata { .. })));
}

/// Sets a number of the metadata, addressed by a JSON pointer.
fn with_number(bytes: &[u8], pointer: &str, number: serde_json::Value) -> Vec<u8> {
    let (length, rest) = bytes.split_at(8);
    let (header, tensors) = rest.split_at(u64::from_le_bytes(length.try_into().unwrap()) as usize);
    let mut header: serde_json::Value = serde_json::from_slice(header).unwrap();
    // The metadata is a string of JSON in JSON.
    let text = header.pointer_mut("/__metadata__/lightoctree").unwrap();
    let mut metadata: serde_json::Value = serde_json::from_str(text.as_str().unwrap()).unwrap();
    *metadata.pointer_mut(pointer).expect(pointer) = number;
    *text = metadata.to_string().into();
    let header = header.to_string();
    [&(header.len() as u64).to_le_bytes()[..], header.as_bytes(), tensors].concat()
}

#[test]
fn numbers_out_of_range_are_named() {
    let mut scene = scene(false);
    let estimate = estimate_of(&mut scene);
    estimate.origin.up_deviation_deg = Some(2.5);
    estimate.origin.camera_source = Some(CameraSource::Network { deviation_deg: 4.5 });
    let first_from_camera = RigidTransform { rotation: Quat::IDENTITY, translation_m: Vec3::new(1.0, 0.5, -0.5) };
    let camera = estimate.frame.camera;
    estimate.other_photos = vec![OtherPhoto { first_from_camera, camera, exposure: 1.5 }];
    let radiance = RadianceImage::from_fn(32, 16, |x, y| [1.0 + x as f32, 0.1 * y as f32, 0.0]);
    estimate.expected = Some(ExpectedLight::new(&radiance, Quat::from_rotation_x(0.2), 3.25));
    let source = PanoramaSource {
        file: "theta.hdr".to_owned(),
        position_m: Vec3::new(0.25, -0.1, -1.3),
        yaw_deg: -73.4,
        pitch_deg: 1.25,
        roll_deg: -0.4,
        exposure_ev: -1.73,
        confidence: 0.81,
        clipped: true,
    };
    let share = estimate.light.rgba.iter().map(|rows| vec![0; rows.len()]).collect();
    let image = Some(PanoramaImage::new(&radiance, Quat::IDENTITY));
    estimate.panorama = Some(PanoramaContribution { source, share, image });
    scene.light_edits.inferred = Some(InferredLight {
        light: LightMode::Plausible,
        tuning: LightTuning { white: Some([3.5, 4.5]), ..LightTuning::default() },
    });
    scene.objects = objects();
    let bytes = scene.to_bytes(lo_imaging::GENERATOR).unwrap();
    assert!(SceneFile::from_bytes(&with_number(&bytes, "/exposure", 1.5.into())).is_ok());
    let cases: [(&str, Vec<f64>, &str); 28] = [
        ("/octree/cube/edge_m", vec![1e19, 1e7, 1e-30, 0.0, -8.0], "the cube's edge must be from"),
        ("/octree/cube/origin_m/1", vec![1e19, -1e7], "the cube's edge must be from"),
        ("/octree/depth", vec![11.0], "depth"),
        ("/octree/full_depth", vec![9.0], "full depth"),
        ("/camera/fx", vec![0.001, 1e-300, 1e9, -10.0], "focal lengths of a 12 × 8 image must be from 0.16 to 12000"),
        ("/camera/fy", vec![0.001, 1e9], "focal lengths"),
        ("/camera/cx", vec![-0.5, 1e300], "principal point"),
        ("/camera/width", vec![4e9], "camera is that of a 4000000000 × 8 image"),
        ("/camera_source/deviation_deg", vec![-1.0, 1e30], "expected angular error"),
        ("/exposure", vec![0.0, 1e-30, 1e30], "the exposure must be within ± 40 stops"),
        ("/room/up/1", vec![0.5, 1e30], "the room's directions"),
        ("/room/planes/0/plane/offset_m", vec![1e5, -1e30], "its planes be within 10 km"),
        ("/up_deviation_deg", vec![-1.0, 361.0], "expected angular error"),
        ("/other_photos/0/first_from_camera/translation_m/2", vec![1e5, -1e30], "its other photos"),
        ("/other_photos/0/first_from_camera/rotation/0", vec![0.5], "its other photos"),
        ("/other_photos/0/camera/fx", vec![0.001], "its other photos"),
        ("/other_photos/0/exposure", vec![1e30], "its other photos"),
        ("/panorama/position_m/0", vec![1e5], "the panorama's position"),
        ("/panorama/yaw_deg", vec![1e30], "the panorama's position, angles"),
        ("/panorama/exposure_ev", vec![101.0], "the panorama's position, angles, exposure"),
        ("/panorama_picture/scale", vec![0.5, 1e30], "the scale or rotation of its panorama"),
        ("/panorama_picture/scale", vec![1e13], "tensor panorama, value "),
        ("/expected_light/scale", vec![1e30], "the scale or rotation of its expected_light"),
        ("/expected_light/contrast_stops", vec![-1.0, 17.0], "contrast_stops"),
        ("/light_edits/guessed/white/0", vec![-1.0, 1e30], "inferred light: the white pixel"),
        ("/objects/fps", vec![0.0, 1001.0], "frames per second"),
        ("/objects/time_s", vec![-1.0, 1e30], "times must be from"),
        ("/objects/floor_gloss", vec![-0.1, 1e30], "gloss"),
    ];
    for (pointer, numbers, what) in cases {
        for number in numbers {
            let value = if number.fract() == 0.0 && (0.0..5e9).contains(&number) {
                (number as u64).into()
            } else {
                number.into()
            };
            let error = match SceneFile::from_bytes(&with_number(&bytes, pointer, value)) {
                Ok(_) => panic!("{pointer} = {number} is read"),
                Err(error) => error.to_string(),
            };
            assert!(error.contains(what), "{pointer} = {number}: {error}");
        }
    }
}

#[test]
fn a_linear_photo_that_is_written_can_be_read() {
    let mut scene = scene(true);
    let Photo::Linear(image) = &scene.estimate.frame.photo else { panic!() };
    let mut image = image.clone();
    image[(3, 2)] = [f32::NAN, f32::INFINITY, -1.0];
    let Frame { depth_m, camera, exposure, .. } = scene.estimate.frame.clone();
    estimate_of(&mut scene).frame = Frame::new(Photo::Linear(image), depth_m, camera, exposure).unwrap();
    let back = SceneFile::from_bytes(&scene.to_bytes(lo_imaging::GENERATOR).unwrap()).unwrap();
    assert_eq!(back.estimate.frame, scene.estimate.frame);
}

#[test]
fn only_regular_files_are_read() {
    let error = SceneFile::read(std::path::Path::new("/dev/zero")).unwrap_err().to_string();
    assert!(cfg!(not(unix)) || error.ends_with("only regular files are read"), "{error}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.scene");
    // A sparse file.
    std::fs::File::create(&path).unwrap().set_len(MAX_FILE_BYTES + 1).unwrap();
    let error = SceneFile::read(&path).unwrap_err().to_string();
    assert!(error.contains("large.scene") && error.contains("too large"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn flipped_bits_never_panic(flips in prop::collection::vec((0usize..1_000_000, 0u8..8), 1..6), header in any::<bool>()) {
        let mut bytes = scene(header).to_bytes(lo_imaging::GENERATOR).unwrap();
        let reach = if header { 6000.min(bytes.len()) } else { bytes.len() };
        for (at, bit) in flips {
            bytes[at % reach] ^= 1 << bit;
        }
        // Either the damage is detected, or it changed an unconstrained value; then the scene must be writable again.
        if let Ok(scene) = SceneFile::from_bytes(&bytes) {
            prop_assert!(scene.to_bytes(lo_imaging::GENERATOR).is_ok());
        }
    }

    #[test]
    fn noise_is_an_error(noise in prop::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(SceneFile::from_bytes(&noise).is_err());
    }
}
