//! Real depth maps beside the shipped network's: what is right is quiet, what is wrong is named.

use lo_imaging::DepthMap;
use lo_testdata::{asset, shared_data};

use super::*;
use crate::given_depth::compare;
use crate::prepared_input::PreparedInput;

/// A photo with measured depth.
fn frame(photo: &std::path::Path, depth: &std::path::Path, scale: f64, intrinsics: Option<[f64; 4]>) -> Frame {
    let photo = lo_imaging::read_photo(photo).unwrap().photo;
    let depth_m = lo_imaging::read_depth(depth, Some(scale)).unwrap();
    let (width, height) = (photo.width() as u32, photo.height() as u32);
    let camera = match intrinsics {
        Some([fx, fy, cx, cy]) => Camera::new(fx, fy, cx, cy, width, height),
        None => Camera::from_hfov_deg(71.6, width, height),
    };
    Frame::new(photo, depth_m, camera.unwrap(), 1.0).unwrap()
}

/// All real photos with depth, and their names.
fn frames() -> Vec<(String, Frame)> {
    let library = frame(&asset("library_color.jpg"), &asset("library_lidar_depth.png"), 1000.0, None);
    let mut frames = vec![("library".to_owned(), library)];
    let Some(folder) = shared_data("rgbd_more", "comparison of real depth maps with the network's") else {
        return frames;
    };
    let list = std::fs::read_to_string(folder.join("frames.json")).unwrap();
    for entry in serde_json::from_str::<serde_json::Value>(&list).unwrap().as_array().unwrap() {
        let file = |key: &str| folder.join(entry[key].as_str().unwrap());
        let intrinsics = std::array::from_fn(|i| entry["intrinsics"][i].as_f64().unwrap());
        let scale = entry["depth_scale"].as_f64().unwrap();
        let name = entry["color"].as_str().unwrap().to_owned();
        frames.push((name, frame(&file("color"), &file("depth"), scale, Some(intrinsics))));
    }
    frames
}

#[test]
fn real_depth_is_quiet_and_wrong_depth_is_named() {
    let networks = crate::weights::shipped_networks().unwrap();
    let frames = frames();
    let (mut loud, mut inverse, mut mirrored, mut scaled) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (name, frame) in &frames {
        let input = Input::MeasuredDepth(frame.clone());
        let working = PreparedInput::new(input, None, &mut lo_events::ignore).unwrap().working;
        let own_m = networks.predict(&working.photo.srgb8(), &frame.camera).depth_m;
        let warning = |change: &dyn Fn(f32) -> f32| {
            let given_m: DepthMap = working.depth_m.map(|&z| if z > 0.0 { change(z) } else { 0.0 });
            compare(&given_m, &own_m)
        };
        loud.extend(warning(&|z| z).map(|warning| format!("{name}: {warning:?}")));
        let found = warning(&|z| 4.0 / z);
        if !matches!(found, Some(EstimateWarning::InverseDepth { .. })) {
            inverse.push(format!("{name}: {found:?}"));
        }
        let found = compare(&working.depth_m.mirrored(), &own_m);
        if !matches!(found, Some(EstimateWarning::MirroredDepth { .. })) {
            mirrored.push(format!("{name}: {found:?}"));
        }
        for scale in [5.0, 0.2] {
            let found = warning(&|z| scale * z);
            if !matches!(found, Some(EstimateWarning::DepthScale { .. })) {
                scaled.push(format!("{name} × {scale}: {found:?}"));
            }
        }
    }
    let count = frames.len();
    eprintln!("of {count} frames, not named: inverse {inverse:#?}, mirrored {mirrored:#?}, scaled {scaled:#?}");
    assert!(loud.is_empty(), "{loud:#?}");
    // Some rooms are symmetric.
    assert!(3 * mirrored.len() <= count, "{mirrored:#?}");
    // A wall seen from the front has no order of depths, and the network's own scale may be off.
    assert!(10 * inverse.len() <= count && 10 * scaled.len() <= 2 * count, "{inverse:#?} {scaled:#?}");
}
