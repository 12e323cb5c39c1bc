//! Readers of published datasets, on small fixtures in the published layouts and on real panoramas.

use std::path::Path;
use std::sync::Arc;

use lo_dataset::{
    CropModel, Dataset, DatasetLayout, InteriorNet, Panoramas, Sample, ShardFolder, Shards, Split, convert_to_shards,
    indices_of,
};
use lo_geometry::{Vec3, pixel_direction, uv_from_direction};
use lo_imaging::{DepthMap, Image, linear_from_srgb8, sample_equirectangular, write_depth, write_srgb8};
use lo_testdata::{panoramas, shared_data};

use crate::hypersim_layout;
use crate::layouts::{direction_map, futurehouse, hdr, interiornet, interiorverse, room_distance};
use crate::lighthouse_layout;

/// Small photos, three per panorama.
fn small() -> CropModel {
    CropModel {
        width: 48,
        height: 32,
        panorama_height: 16,
        crops: 3,
        hfov_deg: lo_sensor::Interval::new(60.0, 80.0),
        seed: 5,
        ..CropModel::default()
    }
}

/// Asserts that the sample's panorama has the radiance of the photo's pixels.
fn assert_panorama_agrees(sample: &Sample, view: usize) {
    let radiance = sample.radiance.as_ref().unwrap();
    for (x, y) in [(5, 5), (24, 16), (40, 28)] {
        let direction = sample.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let there =
            sample_equirectangular(&sample.views[view].radiance, sample.views[view].rotation.inverse() * direction);
        for c in 0..3 {
            let (a, b) = (there[c], radiance[(x, y)][c]);
            assert!((a - b).abs() < 0.05 * b + 0.01, "({x}, {y}) channel {c}: {a} in the panorama, {b} in the photo");
        }
    }
}

#[test]
fn futurehouse_in_its_published_layout() {
    let folder = tempfile::tempdir().unwrap();
    futurehouse(folder.path());
    assert_eq!(DatasetLayout::detect(folder.path()).unwrap(), DatasetLayout::FutureHouse);
    let dataset = DatasetLayout::FutureHouse.open(folder.path(), small()).unwrap();
    assert_eq!(dataset.len(), 6);
    assert_eq!((dataset.scene_id(0), dataset.scene_id(5)), ("000123".into(), "000777".into()));
    let sample = dataset.get(1).unwrap();
    assert_eq!((sample.id.as_str(), sample.scene_id.as_str()), ("000123-0-1", "000123"));
    assert_panorama_agrees(&sample, 0);
    // Depth is along the axis: the point is on the box.
    let depth = sample.depth_m.as_ref().unwrap();
    let point = sample.camera.unproject(24.5, 16.5, f64::from(depth[(24, 16)]));
    let in_room = sample.views[0].rotation.inverse() * point;
    assert!((in_room.length() / room_distance(in_room.normalize()) - 1.0).abs() < 0.1, "{in_room}");
    assert!(sample.albedo.is_some() && sample.normal.is_none());
    // A surface point for each pixel, on the box, and where depth has a hole, near it.
    assert_eq!(sample.points.len(), 256 * 128);
    for point in &sample.points {
        let direction = sample.views[0].rotation.inverse() * point.position_m.normalize();
        let off = point.position_m.length() / room_distance(direction) - 1.0;
        assert!(off.abs() < if direction.y > 0.97 { 0.1 } else { 0.01 }, "{off} at {direction}");
    }
    // The other house has no probes.
    assert_eq!(dataset.get(4).unwrap().views.len(), 1);
    let all: Vec<Sample> = (0..3).map(|i| dataset.get(i).unwrap()).collect();
    assert!(all.iter().any(|sample| sample.views.len() > 1));
    for sample in &all {
        for view in &sample.views[1..] {
            // The probe's number, from its brightness, gives its position in the room.
            let gains: Vec<f32> = serde_json::from_value(sample.metadata["gains"].clone()).unwrap();
            let number = (view.radiance[(0, 0)][0] / gains[0]).round() as usize - 1;
            let expected = pixel_direction(number % 8, number / 8, 8, 4);
            let got = view.rotation.inverse() * view.position_m;
            assert!(got.normalize().dot(expected) > 0.999, "probe {number}");
            // The grid's rotation was undone: the second channel encodes the direction's x.
            let shown = view.radiance[(3, 8)][1] / gains[1];
            assert!((shown - 1.5 - pixel_direction(3, 8, 32, 16).x).abs() < 0.02, "{shown}");
            // Distances are those to the box's faces; the probe is on one of them, by the coarse panorama's depth.
            let distance_m = view.depth_m.as_ref().unwrap();
            let half = Vec3::new(2.0, 1.5, 3.0);
            let mut errors: Vec<f32> = Vec::new();
            for y in 0..16 {
                for x in 0..32 {
                    let direction = pixel_direction(x, y, 32, 16);
                    let far = ((half * direction.signum() - got) / direction).min_element();
                    if far > 0.5 && distance_m[(x, y)] > 0.0 {
                        errors.push((distance_m[(x, y)] - far).abs());
                    }
                }
            }
            errors.sort_by(f32::total_cmp);
            assert!(errors.len() > 100 && errors[errors.len() / 2] < 0.2, "{} {errors:?}", errors.len());
        }
    }
}

#[test]
fn futurehouse_has_its_published_split_also_as_shards() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    futurehouse(&data);
    let open = || DatasetLayout::FutureHouse.open(&data, small());
    let splits = |dataset: &dyn Dataset| [0, 3].map(|index| dataset.split(index));
    // Without the authors' file, by the houses' names.
    assert_eq!(splits(&*open().unwrap()), ["000123", "000777"].map(Split::of));
    let file = folder.path().join("split.json");
    std::fs::write(&file, r#"{"train": ["0"], "val": ["000777"], "test": ["000123"]}"#).unwrap();
    let dataset: Arc<dyn Dataset> = open().unwrap().into();
    assert_eq!(splits(&*dataset), [Split::Test, Split::Validation]);
    assert_eq!(indices_of(&*dataset, Some(Split::Train), None), [0usize; 0]);
    let at = folder.path().join("shards");
    let shards = ShardFolder::open(&at, "samples", &serde_json::json!({}), false).unwrap();
    convert_to_shards(&shards, &dataset, 4, 1, &mut lo_events::ignore).unwrap();
    assert_eq!(splits(&Shards::open(&at).unwrap()), [Split::Test, Split::Validation]);
    std::fs::write(&file, r#"{"train": ["000777"], "val": ["000777"], "test": []}"#).unwrap();
    let error = open().err().unwrap().to_string();
    assert_eq!(error, format!("{}: split: 000777 is in two parts", file.display()));
    std::fs::write(&file, "[]").unwrap();
    assert!(open().err().unwrap().to_string().contains("split.json: split: "));
}

#[test]
fn crops_are_drawn_anew_in_each_epoch_where_asked() {
    let folder = tempfile::tempdir().unwrap();
    futurehouse(folder.path());
    let open = |anew_each_epoch| {
        let model = CropModel { anew_each_epoch, ..small() };
        DatasetLayout::FutureHouse.open(folder.path(), model).unwrap()
    };
    let (fixed, anew) = (open(false), open(true));
    for index in [0, 4] {
        let first = fixed.get(index).unwrap();
        assert!(fixed.get_in_epoch(index, 7).unwrap() == first && anew.get(index).unwrap() == first);
        let later = anew.get_in_epoch(index, 1).unwrap();
        assert!(later.id == first.id && later.camera != first.camera && later.photo != first.photo);
        assert!(anew.get_in_epoch(index, 1).unwrap() == later, "the same in the same epoch");
    }
}

#[test]
fn futurehouse_errors_name_the_file_and_the_field() {
    let folder = tempfile::tempdir().unwrap();
    futurehouse(folder.path());
    let cubemaps = folder.path().join("000123").join("ue4_result").join("CubemapData");
    let message = || DatasetLayout::FutureHouse.open(folder.path(), small()).unwrap().get(0).unwrap_err().to_string();
    let depth = cubemaps.join("0_depth.hdr");
    hdr(&depth, &Image::new(32, 16, vec![[0.2; 3]; 512]));
    assert_eq!(message(), format!("{}: size: 32 × 16 pixels, but the panorama has 256 × 128", depth.display()));
    hdr(&depth, &Image::new(256, 128, vec![[9.0; 3]; 256 * 128]));
    assert!(message().ends_with("0_depth.hdr: depth: no value within (0, 2], which is 0 to 10 m"), "{}", message());
    std::fs::remove_file(&depth).unwrap();
    assert!(message().contains("0_depth.hdr"));
    hdr(&cubemaps.join("0_image.hdr"), &Image::new(32, 32, vec![[0.2; 3]; 1024]));
    assert!(message().ends_with("0_image.hdr: size: 32 × 32 pixels; a panorama is twice as wide as high"));
}

#[test]
fn interiornet_in_its_published_layout() {
    let folder = tempfile::tempdir().unwrap();
    interiornet(folder.path());
    assert_eq!(DatasetLayout::detect(folder.path()).unwrap(), DatasetLayout::InteriorNet);
    let dataset = DatasetLayout::InteriorNet.open(folder.path(), small()).unwrap();
    assert_eq!((dataset.len(), dataset.scene_id(2)), (3, "3FO4_Bedroom".into()));
    let first = dataset.get(0).unwrap();
    assert_eq!(first.id, "3FO4_Bedroom-original_1_1-0");
    assert_eq!((first.camera.fx, first.camera.width), (30.0, 48));
    // Distances along the rays have become the wall's depth.
    assert!(first.depth_m.as_ref().unwrap().pixels().iter().all(|z| (z - 3.0).abs() < 2e-3));
    assert!((first.up.unwrap() - Vec3::Y).length() < 1e-5);
    // Its own panorama, and the third frame's a metre ahead.
    assert_eq!(first.views.len(), 2);
    assert!(first.views[0].position_m.length() < 1e-6);
    assert!((first.views[1].position_m - Vec3::new(0.0, 0.0, -1.0)).length() < 1e-5, "{}", first.views[1].position_m);
    assert!((first.views[1].rotation * Vec3::X - Vec3::X).length() < 1e-5);
    assert!((first.views[0].radiance[(9, 9)][0] - linear_from_srgb8(200)).abs() < 1e-4);
    // Surface points of all three frames, on the wall.
    assert_eq!(first.points.len(), 3 * 12 * 8);
    assert!(first.points.iter().all(|point| (point.position_m.z + 3.0).abs() < 3e-3), "{:?}", first.points[0]);
    assert!((first.points[0].radiance[0] - linear_from_srgb8(100)).abs() < 1e-6);
    assert_eq!(first.points[0].provenance, lo_octree::Provenance::Observed);
    assert!(first.has_clipped_panoramas());
    assert_eq!(dataset.get(1).unwrap().views.len(), 1, "the second frame has no panorama and sees the third");
    assert_eq!(dataset.get(2).unwrap().views.len(), 1, "positions behind the camera are not observed");
    // A sequence alone needs its cameras beside it.
    let sequence = folder.path().join("HD1").join("3FO4_Bedroom").join("original_1_1");
    assert!(DatasetLayout::InteriorNet.open(&sequence, small()).err().unwrap().to_string().contains("no cam0.ccam"));
}

#[test]
fn interiornet_as_lighthouse_chooses() {
    let folder = tempfile::tempdir().unwrap();
    interiornet(folder.path());
    let open = || InteriorNet::open(folder.path(), 5).unwrap().as_lighthouse(folder.path());
    let dataset = open().unwrap();
    // The third frame's panorama, a metre ahead of the first, is nearer than the wall's nearest half percent.
    let none = dataset.get(0).unwrap();
    assert_eq!((none.views.len(), none.photo.width(), none.photo.height()), (0, 320, 240));
    assert!((none.camera.hfov_deg() - 2.0 * (24.0f64 / 30.0).atan().to_degrees()).abs() < 1e-9);
    // With a near corner it is between the nearest and the farthest surface.
    let depth = folder.path().join("HD1/3FO4_Bedroom/original_1_1/depth0/data/0.png");
    let near = DepthMap::from_fn(48, 32, |x, y| if x < 6 && y < 6 { 0.8 } else { 3.0 });
    write_depth(&depth, &near, lo_imaging::GENERATOR).unwrap();
    let ahead = dataset.get(0).unwrap();
    assert_eq!((ahead.views.len(), ahead.views[0].radiance.width()), (1, 240));
    assert!((ahead.views[0].position_m - Vec3::new(0.0, 0.0, -1.0)).length() < 1e-5);
    // Dark photos and near surfaces do not qualify.
    write_depth(&depth, &near.map(|&z| if z < 1.0 { 0.09 } else { z }), lo_imaging::GENERATOR).unwrap();
    assert_eq!(dataset.get(0).unwrap().views.len(), 0);
    write_depth(&depth, &near, lo_imaging::GENERATOR).unwrap();
    let photo = folder.path().join("HD1/3FO4_Bedroom/original_1_1/cam0/data/0.png");
    write_srgb8(&photo, &Image::new(48, 32, vec![[20; 3]; 48 * 32]), 90, lo_imaging::GENERATOR).unwrap();
    assert_eq!(dataset.get(0).unwrap().views.len(), 0);
    let scene = folder.path().join("HD1/3FO4_Bedroom");
    std::fs::rename(scene.join("original_1_1"), scene.join("random_1_1")).unwrap();
    assert!(open().err().unwrap().to_string().ends_with("contains sequences with random light alone"));
}

#[test]
fn interiornet_errors_name_the_line() {
    let folder = tempfile::tempdir().unwrap();
    let cameras = interiornet(folder.path());
    let good = std::fs::read_to_string(&cameras).unwrap();
    let message = |text: String| {
        std::fs::write(&cameras, text).unwrap();
        let error = DatasetLayout::InteriorNet.open(folder.path(), small()).err().unwrap().to_string();
        error.strip_prefix(&cameras.display().to_string()).unwrap().to_owned()
    };
    assert_eq!(message(good.replacen("30 24 16", "30 x 16", 1)), ": line 7: `x` is not a number");
    assert_eq!(message(good.replacen(" 48 32\n", "\n", 1)), ": line 7: 13 numbers; expected 15");
    let negative = message(good.replacen("30 24 16", "-30 24 16", 1));
    assert!(negative.starts_with(": line 7: focal lengths of a 48 × 32 image must be from"), "{negative}");
    assert!(message(good.replacen(" 0 0 1 0 ", " 5 0 1 0 ", 1)).contains("is not a unit quaternion"));
    let cut: String = good.lines().take(8).map(|line| format!("{line}\n")).collect();
    assert!(message(cut).starts_with(": lines: 2 cameras for 3 images in "));
    std::fs::write(&cameras, &good).unwrap();
    let photo = folder.path().join("HD1/3FO4_Bedroom/original_1_1/cam0/data/0.png");
    write_srgb8(&photo, &Image::new(4, 4, vec![[0; 3]; 16]), 90, lo_imaging::GENERATOR).unwrap();
    let error = DatasetLayout::InteriorNet.open(folder.path(), small()).unwrap().get(0).unwrap_err().to_string();
    assert_eq!(error, format!("{}: size: 4 × 4 pixels, but cam0.ccam has 48 × 32", photo.display()));
}

#[test]
fn lighthouse_in_its_published_layout() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("00007.npz");
    lighthouse_layout::write(&path, &lighthouse_layout::arrays());
    assert_eq!(DatasetLayout::detect(folder.path()).unwrap(), DatasetLayout::Lighthouse);
    let dataset = DatasetLayout::Lighthouse.open(folder.path(), small()).unwrap();
    assert_eq!((dataset.len(), dataset.scene_id(0), dataset.split(0)), (1, "00007".into(), Split::Test));
    let sample = dataset.get(0).unwrap();
    assert_eq!((sample.id.as_str(), sample.camera), ("00007", lighthouse_layout::camera()));
    assert!(sample.has_clipped_panoramas() && (sample.up.unwrap() - Vec3::Y).length() < 1e-5);
    assert!(sample.depth_m.as_ref().unwrap().pixels().iter().all(|z| (z - 3.0).abs() < 1e-4));
    let view = &sample.views[0];
    assert!((view.position_m - Vec3::new(0.0, 0.0, -1.0)).length() < 1e-5, "{}", view.position_m);
    assert!((view.rotation * Vec3::X - Vec3::X).length() < 1e-5 && (view.rotation * Vec3::Y - Vec3::Y).length() < 1e-5);
    // Photo and panorama, of one pose but for the position, show the same colours in the same directions.
    for (x, y) in [(2, 3), (19, 15), (36, 27)] {
        let direction = sample.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        let shown = sample_equirectangular(&view.radiance, direction);
        for (shown, photo) in shown.into_iter().zip(sample.photo[(x, y)]) {
            let photo = linear_from_srgb8(photo);
            assert!((shown - photo).abs() < 0.02, "({x}, {y}): {shown} {photo}");
        }
    }
    assert_eq!((view.radiance.width(), view.radiance.height()), (48, 24));
}

#[test]
fn lighthouse_errors_name_the_array() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.npz");
    let message = |change: &dyn Fn(&mut lighthouse_layout::Arrays)| {
        let mut arrays = lighthouse_layout::arrays();
        change(&mut arrays);
        lighthouse_layout::write(&path, &arrays);
        let error = DatasetLayout::Lighthouse.open(folder.path(), small()).unwrap().get(0).unwrap_err().to_string();
        error.strip_prefix(&format!("{}: ", path.display())).unwrap().to_owned()
    };
    assert_eq!(message(&|arrays| arrays[0].2[7] = 200.0), "ref_image: the value 200 is outside 0 to 1");
    assert!(message(&|arrays| drop(arrays.remove(1))).starts_with("ref_depth: "));
    let transposed = message(&|arrays| arrays[1].1.swap(1, 2));
    assert_eq!(transposed, "ref_depth: shape [40, 30], but the photo has 30 × 40 pixels");
    assert_eq!(message(&|arrays| arrays[2].1 = vec![9]), "intrinsics: shape [9]; 2 dimensions are expected");
    assert!(message(&|arrays| arrays[2].2[0] = -30.0).starts_with("intrinsics: focal lengths"));
    let right_handed = message(&|arrays| (2..11).step_by(4).for_each(|i| arrays[3].2[i] *= -1.0));
    assert_eq!(right_handed, "ref_pose: its axes are not those of a left-handed camera that looks along +Z");
    assert!(message(&|arrays| arrays[4].1 = vec![1, 48, 24, 3]).starts_with("env_image: 24 × 48 pixels"));
    std::fs::write(&path, b"PK").unwrap();
    let error = DatasetLayout::Lighthouse.open(folder.path(), small()).unwrap().get(0).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: archive: ", path.display())), "{error}");
}

#[test]
fn interiorverse_in_its_published_layout() {
    let folder = tempfile::tempdir().unwrap();
    interiorverse(folder.path());
    assert_eq!(DatasetLayout::detect(folder.path()).unwrap(), DatasetLayout::InteriorVerse);
    let dataset = DatasetLayout::InteriorVerse.open(folder.path(), small()).unwrap();
    let ids: Vec<String> = (0..dataset.len()).map(|index| dataset.get(index).unwrap().id).collect();
    assert_eq!(ids, ["scene_a-000-120", "scene_b-000-120", "scene_a-000-85", "scene_b-000-85"]);
    let splits: Vec<Split> = (0..4).map(|index| dataset.split(index)).collect();
    assert_eq!(splits, [Split::Train, Split::Test, Split::Train, Split::Test]);
    for (index, hfov_deg) in [(1, 120.0), (2, 85.0)] {
        let sample = dataset.get(index).unwrap();
        assert!((sample.camera.hfov_deg() - hfov_deg).abs() < 1e-9);
        let depth_m = sample.depth_m.as_ref().unwrap();
        assert!(depth_m[(3, 9)] == 0.0 && (depth_m[(30, 9)] - 2.0).abs() < 0.01, "{}", depth_m[(30, 9)]);
        let (radiance, gains) = (sample.radiance.as_ref().unwrap(), &sample.metadata["photo"]);
        assert!((radiance[(40, 5)][0] / radiance[(0, 5)][0] - 3.0).abs() < 0.01, "{gains}");
        assert!(sample.albedo.is_some() && sample.views.is_empty() && sample.points.is_empty());
    }
    // One of the two folders is a dataset as well.
    let part = folder.path().join("dataset_85");
    assert_eq!(DatasetLayout::detect(&part).unwrap(), DatasetLayout::InteriorVerse);
    assert_eq!(DatasetLayout::InteriorVerse.open(&part, small()).unwrap().len(), 2);
    let depth = part.join("scene_a").join("000_depth.exr");
    hdr(&depth, &Image::new(32, 24, vec![[2000.0; 3]; 32 * 24]));
    let error = DatasetLayout::InteriorVerse.open(&part, small()).unwrap().get(0).unwrap_err().to_string();
    assert!(error.ends_with("000_depth.exr: size: 32 × 24 pixels, but the image has 64 × 48"), "{error}");
}

#[test]
fn hypersim_in_its_published_layout() {
    let folder = tempfile::tempdir().unwrap();
    hypersim_layout::write(folder.path());
    assert_eq!(DatasetLayout::detect(folder.path()).unwrap(), DatasetLayout::Hypersim);
    let open = || DatasetLayout::Hypersim.open(folder.path(), small());
    let dataset = open().unwrap();
    // The third frame is excluded by the list, two are of a sheared image.
    assert_eq!((dataset.len(), dataset.left_out()), (4, 3));
    assert!((0..4).all(|index| dataset.split(index) == Split::Train));
    let (camera, tilt) = hypersim_layout::lens();
    for (index, frame, id) in [(0, 0, "ai_001_001-cam_00-0000"), (3, 4, "ai_001_001-cam_00-0004")] {
        let sample = dataset.get(index).unwrap();
        assert_eq!((&sample.id[..], &sample.scene_id[..]), (id, "ai_001_001"));
        let found = sample.camera;
        let pairs = [(found.fx, camera.fx), (found.fy, camera.fy), (found.cx, camera.cx), (found.cy, camera.cy)];
        assert!(pairs.iter().all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
        assert!(sample.albedo.is_some() && sample.views.is_empty());
        // The points of all frames are on the room's walls and have their light, but for the photo's gains.
        let (position_m, turn) = hypersim_layout::pose(frame);
        let to_world = (turn * tilt).as_quat();
        assert!((to_world * sample.up.unwrap() - Vec3::Z).length() < 1e-5);
        let mut ranges = [[f32::MAX, f32::MIN]; 3];
        for point in &sample.points {
            let world_m = position_m.as_vec3() + to_world * point.position_m;
            let on_wall = (world_m.abs() / hypersim_layout::HALF_M).max_element();
            assert!((on_wall - 1.0).abs() < 1e-3, "{world_m}");
            let light = hypersim_layout::radiance(world_m);
            for (range, gain) in ranges.iter_mut().zip([0, 1, 2].map(|c| point.radiance[c] / light[c])) {
                *range = [range[0].min(gain), range[1].max(gain)];
            }
        }
        assert!(ranges.iter().all(|[low, high]| high / low < 1.01), "{ranges:?}");
        assert_eq!((sample.points.len(), sample.depth_m.as_ref().unwrap()[(2, 2)]), (4 * 48 - 4, 0.0));
    }

    // Both lists are needed.
    for list in ["metadata_images_split_scene_v1.csv", "metadata_camera_parameters.csv"] {
        std::fs::remove_file(folder.path().join(list)).unwrap();
        let error = open().err().unwrap().to_string();
        assert!(error.contains(&format!("{list}: is missing")) && error.contains("ml-hypersim"), "{error}");
    }
}

#[test]
fn hypersim_errors_name_the_file_and_the_field() {
    let folder = tempfile::tempdir().unwrap();
    hypersim_layout::write(folder.path());
    let open = || DatasetLayout::Hypersim.open(folder.path(), small());
    let scene = folder.path().join("ai_001_001");
    let depth = scene.join("images/scene_cam_00_geometry_hdf5/frame.0001.depth_meters.hdf5");
    std::fs::write(&depth, b"\x89HDF\r\n\x1a\n and nothing else").unwrap();
    let error = open().unwrap().get(1).unwrap_err().to_string();
    assert!(error.starts_with(&format!("{}: dataset: ", depth.display())), "{error}");
    let list = folder.path().join("metadata_images_split_scene_v1.csv");
    let text = std::fs::read_to_string(&list).unwrap();
    for (changed, expected) in [
        (text.replace(",4,True,,train", ",4,True,,test"), "line 6: ai_001_001 is in two parts"),
        (text.replace(",3,True", ",3,maybe"), "line 5: included `maybe`, part `train`"),
        (text.replace(",True,,train", ",False,,"), "all frames are left out: 7"),
    ] {
        std::fs::write(&list, changed).unwrap();
        let error = open().err().unwrap().to_string();
        assert!(error.ends_with(expected), "{error}");
    }
    std::fs::write(&list, text).unwrap();
    let metadata = scene.join("_detail/metadata_scene.csv");
    std::fs::write(&metadata, "parameter_name,parameter_value\nmeters_per_asset_unit,-1\n").unwrap();
    let error = open().err().unwrap().to_string();
    assert!(error.starts_with(&format!("{}: meters_per_asset_unit: ", metadata.display())), "{error}");
}

#[test]
fn laval_scenes_by_their_description() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("kitchen");
    hdr(&scene.join("crop.exr"), &Image::from_fn(48, 32, |x, _| [x as f32; 3]));
    hdr(&scene.join("probe0.exr"), &direction_map(64, 32));
    let write = |text: &str| std::fs::write(scene.join("scene.json"), text).unwrap();
    let text =
        r#"{"photo": "crop.exr", "hfov_deg": 60, "probes": [{"file": "probe0.exr", "u": 36, "v": 16, "depth_m": 2}]}"#;
    write(text);
    assert_eq!(DatasetLayout::detect(folder.path()).unwrap(), DatasetLayout::LavalVarying);
    let dataset = DatasetLayout::LavalVarying.open(folder.path(), small()).unwrap();
    let sample = dataset.get(0).unwrap();
    // A quarter of the width right of the centre: 2 m · tan 30° / 2.
    assert!((sample.views[0].position_m - Vec3::new(0.57735, 0.0, -2.0)).length() < 1e-4);
    let (light, probe) = (sample.radiance.unwrap(), &sample.views[0].radiance);
    assert!(light[(40, 3)][0] / light[(20, 3)][0] > 1.9 && probe[(128, 64)][0] > 0.0);
    let message = |text: String| {
        write(&text);
        dataset.get(0).unwrap_err().to_string()
    };
    assert!(
        message(text.replace("\"u\": 36", "\"u\": 99"))
            .ends_with("scene.json: probes[0].u: 99 is outside the photo's 48 pixels")
    );
    assert!(
        message(text.replace("\"depth_m\": 2", "\"depth_m\": 0")).ends_with("probes[0].depth_m: 0 is not positive")
    );
    assert!(message(text.replace("probe0.exr", "gone.exr")).contains("gone.exr"));
    assert!(message(text.replace("hfov_deg", "fov")).contains("unknown field `fov`"));
}

#[test]
fn crops_of_the_real_panoramas() {
    crops_show_their_panorama(&panoramas(), 1, (0, "lebombo_256-0"));
    let Some(folder) = shared_data("hdr", "crops of 14 real panoramas") else { return };
    crops_show_their_panorama(&folder, 14, (14, "lebombo_1k-0"));
}

#[test]
fn plans_give_photos_of_panoramas_depth() {
    let folder = tempfile::tempdir().unwrap();
    hdr(&folder.path().join("box.hdr"), &direction_map(256, 128));
    hdr(&folder.path().join("other.hdr"), &direction_map(64, 32));
    // The box room of 4 × 3 × 6 m: its lower corners as seen from its centre.
    let corner = |x: f32, z: f32| {
        let uv = uv_from_direction(Vec3::new(x, -1.5, z).normalize());
        [uv.x * 256.0, uv.y * 128.0]
    };
    let floor = [corner(-2.0, -3.0), corner(2.0, -3.0), corner(2.0, 3.0), corner(-2.0, 3.0)];
    let plan = serde_json::json!({"width": 256, "camera_height_m": 1.5, "height_from": "made up", "ceiling_m": 3.0,
        "wall_top_m": null, "floor": floor, "unknown": [[[-10, 0], [266, 0], [266, 20], [-10, 20]]]});
    std::fs::write(folder.path().join("box.json"), plan.to_string()).unwrap();
    let dataset = Panoramas::open(folder.path(), small()).unwrap().with_plans(folder.path()).unwrap();
    for index in 0..3 {
        let sample = dataset.get(index).unwrap();
        let depth_m = sample.depth_m.unwrap();
        let up = sample.up.unwrap();
        let back = sample.views[0].rotation.inverse();
        for (x, y) in [(3, 4), (24, 16), (44, 30)] {
            let direction = sample.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let expected = -direction.z * room_distance(back * direction);
            let steep = direction.dot(up) > 0.85;
            let depth_m = depth_m[(x, y)];
            assert!(steep || (depth_m / expected - 1.0).abs() < 0.05, "({x}, {y}): {depth_m} m, not {expected} m");
        }
        // A point for each pixel, also where depth is unknown, on the room's faces and with their radiance.
        assert_eq!(sample.points.len(), 256 * 128);
        for point in sample.points.iter().step_by(97) {
            let direction = back * point.position_m.normalize();
            assert!((point.position_m.length() / room_distance(direction) - 1.0).abs() < 1e-3);
            let gains = sample.metadata["gains"].as_array().unwrap();
            let green = (0.5 * direction.y + 0.6) * gains[1].as_f64().unwrap() as f32;
            assert!((point.radiance[1] / green - 1.0).abs() < 0.02, "{} {green}", point.radiance[1]);
        }
    }
    let other = dataset.get(3).unwrap();
    assert_eq!(dataset.split(3), Split::of("other"));
    assert!(other.depth_m.is_none() && other.points.is_empty(), "{} has no plan", other.id);
    std::fs::write(folder.path().join("box.json"), "{}").unwrap();
    let open = || Panoramas::open(folder.path(), small()).unwrap().with_plans(folder.path()).unwrap_err().to_string();
    assert!(open().contains("box.json: plan: missing field `width`"), "{}", open());
    std::fs::remove_file(folder.path().join("box.json")).unwrap();
    assert!(open().contains("no plan (NAME.json) of any of the panoramas"), "{}", open());
}

#[test]
fn panoramas_of_one_place_share_its_photos_and_their_part() {
    let folder = tempfile::tempdir().unwrap();
    let mut plan = serde_json::json!({"width": 64, "camera_height_m": 1.5, "height_from": "made up", "wall_top_m": 3.0,
        "floor": [[10, 25], [30, 25], [50, 25]]});
    for (name, place) in [("a", Some("hall")), ("b", None), ("c", Some("hall"))] {
        hdr(&folder.path().join(name).with_extension("hdr"), &direction_map(64, 32));
        plan["place"] = place.into();
        std::fs::write(folder.path().join(name).with_extension("json"), plan.to_string()).unwrap();
    }
    let model = CropModel { crops: 5, ..small() };
    let dataset = Panoramas::open(folder.path(), model).unwrap().with_plans(folder.path()).unwrap();
    let ids: Vec<String> = (0..dataset.len()).map(|index| dataset.get(index).unwrap().id).collect();
    assert_eq!(ids, ["a-0", "a-1", "b-0", "b-1", "b-2", "b-3", "b-4", "c-0", "c-1", "c-2"]);
    assert!((0..dataset.len()).all(|index| ids[index].starts_with(&*dataset.scene_id(index))));
    let parts: Vec<Split> = (0..dataset.len()).map(|index| dataset.split(index)).collect();
    let [hall, own] = ["hall", "b"].map(Split::of);
    assert_eq!(parts, [hall, hall, own, own, own, own, own, hall, hall, hall]);
    assert!(dataset.get(10).is_err());
}

/// Checks the crops of a folder with `panoramas` panoramas. `named` is the index of a sample and its expected id.
fn crops_show_their_panorama(folder: &Path, panoramas: usize, named: (usize, &str)) {
    assert_eq!(DatasetLayout::detect(folder).unwrap(), DatasetLayout::Panoramas);
    let model = CropModel { width: 48, height: 32, panorama_height: 128, crops: 2, ..CropModel::default() };
    let dataset = DatasetLayout::Panoramas.open(folder, model).unwrap();
    assert_eq!(dataset.len(), 2 * panoramas);
    assert_eq!(dataset.get(named.0).unwrap().id, named.1);
    for index in 0..dataset.len() {
        let sample = dataset.get(index).unwrap();
        let mean: f64 = sample.photo.pixels().iter().flatten().map(|&v| f64::from(linear_from_srgb8(v))).sum::<f64>()
            / (3 * 48 * 32) as f64;
        // The result of an automatic exposure within ±0.7 stops of its target; lower where highlights limit it.
        assert!((0.03..0.6).contains(&mean), "{}: {mean}", sample.id);
        let light = sample.radiance.as_ref().unwrap();
        assert!(light.pixels().iter().flatten().all(|v| v.is_finite() && *v >= 0.0));
        assert_eq!(sample.views.len(), 1);
    }
    // Photo and ground truth agree: the same light in another projection and resolution.
    let fine = CropModel { hfov_deg: lo_sensor::Interval::new(60.0, 60.0), crops: 1, width: 24, height: 16, ..model };
    let sample = DatasetLayout::Panoramas.open(folder, fine).unwrap().get(panoramas.min(3) - 1).unwrap();
    let radiance = sample.radiance.as_ref().unwrap();
    let (mut sum, mut reference) = (0.0, 0.0);
    for y in 0..16 {
        for x in 0..24 {
            let direction = sample.camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let there =
                sample_equirectangular(&sample.views[0].radiance, sample.views[0].rotation.inverse() * direction);
            sum += (there[1] - radiance[(x, y)][1]).abs();
            reference += radiance[(x, y)][1];
        }
    }
    assert!(sum / reference < 0.2, "{}", sum / reference);
}

#[test]
fn frames_are_photos_with_measured_depth() {
    let folder = tempfile::tempdir().unwrap();
    let list = folder.path().join("frames.json");
    let photo = Image::from_fn(32, 24, |x, y| [(8 * x) as u8, (10 * y) as u8, 90]);
    write_srgb8(folder.path().join("a.png"), &photo, 90, "test").unwrap();
    let depth = DepthMap::from_fn(16, 12, |x, _| if x < 8 { 2.0 } else { 0.0 });
    write_depth(folder.path().join("d.png"), &depth, "test").unwrap();
    let entry = |scale: f64, intrinsics: &str| {
        let text = format!(
            r#"[{{"color": "a.png", "depth": "d.png", "depth_scale": {scale}, "intrinsics": {intrinsics}, "room": "hall", "licence": "MIT"}}]"#
        );
        std::fs::write(&list, text).unwrap();
    };
    entry(500.0, "[30, 31, 16.5, 11.5]");
    for path in [folder.path(), &list] {
        assert_eq!(DatasetLayout::detect(path).unwrap(), DatasetLayout::Frames);
        let dataset = DatasetLayout::Frames.open(path, small()).unwrap();
        let sample = dataset.get(0).unwrap();
        assert_eq!((dataset.len(), &*dataset.scene_id(0), &*sample.id), (1, "hall", "a"));
        assert_eq!((sample.photo.width(), sample.camera.fy, sample.camera.cx), (32, 31.0, 16.5));
        // Written in millimetres, read as 500 units per metre: twice as far.
        let depth_m = sample.depth_m.unwrap();
        assert_eq!((depth_m.width(), depth_m[(3, 5)], depth_m[(30, 5)]), (32, 4.0, 0.0));
        assert!(dataset.get(1).is_err());
    }
    let message = || match DatasetLayout::Frames.open(&list, small()) {
        Err(error) => error.to_string(),
        Ok(dataset) => dataset.get(0).unwrap_err().to_string(),
    };
    entry(0.0, "[30, 31, 16.5, 11.5]");
    assert!(message().ends_with("frames.json: depth_scale of a.png: 0 is not positive and finite"), "{}", message());
    entry(500.0, "[-30, 31, 16.5, 11.5]");
    assert!(message().contains("intrinsics of a.png"), "{}", message());
    entry(500.0, "[30, 31]");
    assert!(message().contains("frames.json: frames: invalid length 2"), "{}", message());
    std::fs::write(&list, "[]").unwrap();
    assert!(message().ends_with("frames.json: frames: the list is empty"), "{}", message());
}

#[test]
fn unknown_folders_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("letter.txt"), "dear").unwrap();
    let message = DatasetLayout::detect(folder.path()).unwrap_err().to_string();
    assert!(message.ends_with(
        "unknown dataset layout; supported are frames, shards, futurehouse, lighthouse, interiornet, interiorverse, hypersim, laval-varying, panoramas"
    ));
    assert!(DatasetLayout::detect(&folder.path().join("nowhere")).is_err());
}
