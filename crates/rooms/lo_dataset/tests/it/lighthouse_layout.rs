//! A small test set in Lighthouse's layout, for tests: of this crate and, included by path, of the evaluation.

use std::fs::File;
use std::path::Path;

use lo_geometry::{Camera, Vec3, pixel_direction};
use npyz::WriterBuilder;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Size of the photo.
pub const SIZE: [usize; 2] = [40, 30];

/// Returns the camera of the photo.
pub fn camera() -> Camera {
    Camera::new(30.0, 31.0, 19.0, 15.5, SIZE[0] as u32, SIZE[1] as u32).unwrap()
}

/// Returns an sRGB value for each direction in the axes of a camera that looks along −Z.
pub fn color(direction: Vec3) -> [f32; 3] {
    (direction * 0.4 + Vec3::splat(0.5)).to_array()
}

/// Arrays of a file: names, sizes and values.
pub type Arrays = Vec<(&'static str, Vec<u64>, Vec<f32>)>;

/// Returns the arrays of a photo with a wall 3 m ahead and a panorama 1 m ahead of the camera.
pub fn arrays() -> Arrays {
    let [width, height] = SIZE;
    let camera = camera();
    let pixels = || (0..height).flat_map(|y| (0..width).map(move |x| (x as f64 + 0.5, y as f64 + 0.5)));
    let photo = pixels().flat_map(|(u, v)| color(camera.direction(u, v))).collect();
    let distance = pixels().map(|(u, v)| camera.unproject(u, v, 3.0).length()).collect();
    let directions = (0..24).flat_map(|y| (0..48).map(move |x| pixel_direction(x, y, 48, 24)));
    let panorama = directions.flat_map(color).collect();
    // The world's +Z is up, and the camera looks along +Y.
    let pose = |y: f32| vec![1.0, 0.0, 0.0, 0.5, 0.0, 0.0, 1.0, y, 0.0, 1.0, 0.0, 1.5, 0.0, 0.0, 0.0, 1.0];
    vec![
        ("ref_image", vec![1, height as u64, width as u64, 3], photo),
        ("ref_depth", vec![1, height as u64, width as u64], distance),
        ("intrinsics", vec![1, 3, 3], vec![30.0, 0.0, 19.0, 0.0, 31.0, 15.5, 0.0, 0.0, 1.0]),
        ("ref_pose", vec![1, 4, 4], pose(-2.0)),
        ("env_image", vec![1, 24, 48, 3], panorama),
        ("env_pose", vec![1, 4, 4], pose(-1.0)),
    ]
}

/// Writes a `.npz` file.
pub fn write(path: &Path, arrays: &Arrays) {
    let mut zip = ZipWriter::new(File::create(path).unwrap());
    for (name, sizes, values) in arrays {
        zip.start_file(format!("{name}.npy"), SimpleFileOptions::default()).unwrap();
        let options = npyz::WriteOptions::<f32>::new().default_dtype().shape(sizes).writer(&mut zip);
        let mut array = options.begin_nd().unwrap();
        array.extend(values.iter().copied()).unwrap();
        array.finish().unwrap();
    }
    zip.finish().unwrap();
}
