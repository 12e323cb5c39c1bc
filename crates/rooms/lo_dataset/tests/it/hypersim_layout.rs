//! A small dataset in Hypersim's layout, for tests: of this crate and, included by path, of training.

use std::path::Path;

use hdf5_pure::FileBuilder;
use lo_geometry::{Camera, DMat3, DQuat, DVec3, Vec3};

/// Length of the scene's unit, metres: an inch.
const UNIT_M: f64 = 0.0254;

/// Half the edges of the room, metres; +Z is up.
pub const HALF_M: Vec3 = Vec3::new(2.0, 3.0, 1.5);

const SIZE: [usize; 2] = [64, 48];

/// Returns the radiance of the room's walls: it tells the position.
pub fn radiance(position_m: Vec3) -> [f32; 3] {
    (position_m * 0.2 + Vec3::splat(0.8)).to_array()
}

/// Returns the lens of the first scene as a pinhole camera, and its axes in the stored camera's.
pub fn lens() -> (Camera, DQuat) {
    let camera = Camera::new(56.0, 56.0, 34.0, 18.0, SIZE[0] as u32, SIZE[1] as u32).unwrap();
    (camera, DQuat::from_rotation_x(0.2) * DQuat::from_rotation_y(-0.05))
}

/// Returns the position in metres and the rotation of a frame's stored camera: it looks along +Y and a little down.
pub fn pose(frame: usize) -> (DVec3, DQuat) {
    let turn = DQuat::from_rotation_z(0.4 * frame as f64) * DQuat::from_rotation_x(1.4);
    (DVec3::new(0.3 * frame as f64 - 0.5, -0.4, 0.1), turn)
}

/// Writes one array of 32-bit numbers in compressed chunks, as images are stored, or of 64-bit ones.
fn array(path: &Path, shape: &[u64], values: &[f64]) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    let is_image = path.to_string_lossy().contains("frame.");
    let mut file = FileBuilder::new();
    let dataset = file.create_dataset("dataset");
    if is_image {
        let values: Vec<f32> = values.iter().map(|&v| v as f32).collect();
        let chunk: Vec<u64> = shape.iter().map(|&size| size.div_ceil(3)).collect();
        dataset.with_f32_data(&values).with_shape(shape).with_chunks(&chunk).with_deflate(4);
    } else {
        dataset.with_f64_data(values).with_shape(shape);
    }
    file.write(path).unwrap();
}

/// Writes a scene with `frames` frames, seen through a lens.
fn scene(root: &Path, name: &str, frames: usize, (camera, tilt): (Camera, DQuat)) {
    let scene = root.join(name);
    let detail = scene.join("_detail");
    let (mut positions, mut orientations) = (Vec::new(), Vec::new());
    for frame in 0..frames {
        let (position_m, turn) = pose(frame);
        positions.extend((position_m / UNIT_M).to_array());
        orientations.extend(DMat3::from_quat(turn).transpose().to_cols_array());
        let (mut colours, mut distances) = (Vec::new(), Vec::new());
        for (y, x) in (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| (y, x))) {
            let local = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let direction = (turn * tilt).as_quat() * local;
            let origin = position_m.as_vec3();
            let to_wall = (HALF_M.copysign(direction) - origin) / direction;
            let distance_m = to_wall.min_element();
            colours.extend(radiance(origin + direction * distance_m).map(f64::from));
            // A window without depth.
            distances.push(if x < 6 && y < 6 { f64::NAN } else { f64::from(distance_m) });
        }
        let images = scene.join("images");
        let file = |kind: &str, what: &str| {
            images.join(format!("scene_cam_00_{kind}_hdf5")).join(format!("frame.{frame:04}.{what}.hdf5"))
        };
        let [width, height] = SIZE.map(|size| size as u64);
        array(&file("final", "color"), &[height, width, 3], &colours);
        array(&file("final", "diffuse_reflectance"), &[height, width, 3], &vec![0.5; colours.len()]);
        array(&file("geometry", "depth_meters"), &[height, width], &distances);
    }
    let count = frames as u64;
    array(&detail.join("cam_00").join("camera_keyframe_positions.hdf5"), &[count, 3], &positions);
    array(&detail.join("cam_00").join("camera_keyframe_orientations.hdf5"), &[count, 3, 3], &orientations);
    let metadata = format!("parameter_name,parameter_value\nmeters_per_asset_unit,{UNIT_M}\n");
    std::fs::write(detail.join("metadata_scene.csv"), metadata).unwrap();
}

/// Writes two scenes: one of five frames with a tilted lens, whose third frame is excluded, and one of two frames whose
/// image is sheared.
pub fn write(root: &Path) {
    let lens = lens();
    scene(root, "ai_001_001", 5, lens);
    scene(root, "ai_001_002", 2, lens);
    let ray = |u: f64, v: f64| {
        let (camera, tilt) = lens;
        tilt * DVec3::new((u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy, -1.0)
    };
    let [width, height] = SIZE.map(|size| size as f64);
    let [middle, right, up] = [(0.5, 0.5), (1.0, 0.5), (0.5, 0.0)].map(|(x, y)| ray(x * width, y * height));
    let matrix = DMat3::from_cols(right - middle, up - middle, middle);
    let sheared = matrix * DMat3::from_cols(DVec3::X, DVec3::new(0.05, 1.0, 0.0), DVec3::Z);
    let mut cameras = "scene_name,settings_output_img_height,settings_output_img_width".to_owned();
    for (row, column) in (0..3).flat_map(|row| (0..3).map(move |column| (row, column))) {
        cameras += &format!(",M_cam_from_uv_{row}{column}");
    }
    for (name, matrix) in [("ai_001_001", matrix), ("ai_001_002", sheared)] {
        cameras += &format!("\n{name},{height:.1},{width:.1}");
        for value in matrix.transpose().to_cols_array() {
            cameras += &format!(",{value}");
        }
    }
    std::fs::write(root.join("metadata_camera_parameters.csv"), cameras + "\n").unwrap();
    let head = "scene_name,camera_name,frame_id,included_in_public_release,exclude_reason,split_partition_name\n";
    let line = |frame: usize| match frame {
        2 => "ai_001_001,cam_00,2,False,CONTENT FLAGGED FOR REMOVAL,\n".to_owned(),
        frame => format!("ai_001_001,cam_00,{frame},True,,train\n"),
    };
    let list: String = (0..5).map(line).collect();
    std::fs::write(root.join("metadata_images_split_scene_v1.csv"), head.to_owned() + &list).unwrap();
}
