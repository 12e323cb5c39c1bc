//! Small datasets in published layouts, for tests: of this crate and, included by path, of training.

use std::path::Path;

use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{DepthMap, ExrOptions, Image, RadianceImage, write_depth, write_radiance, write_srgb8};

pub fn hdr(path: &Path, image: &RadianceImage) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write_radiance(path, image, &ExrOptions::default()).unwrap();
}

/// Radiance that encodes the direction: its components, shifted to be positive.
pub fn direction_map(width: usize, height: usize) -> RadianceImage {
    Image::from_fn(width, height, |x, y| (pixel_direction(x, y, width, height) * 0.5 + Vec3::splat(0.6)).to_array())
}

/// Writes two houses of FutureHouse, the first with probes.
pub fn futurehouse(root: &Path) {
    for house in ["000123", "000777"] {
        let cubemaps = root.join(house).join("ue4_result").join("CubemapData");
        let (width, height) = (256, 128);
        let map = direction_map(width, height);
        hdr(&cubemaps.join("0_image.hdr"), &map);
        // A box room of 4 × 3 × 6 m: 0.2 units are a metre. A skylight has no depth.
        let depth = Image::from_fn(width, height, |x, y| {
            let direction = pixel_direction(x, y, width, height);
            [if direction.y > 0.97 { 0.0 } else { room_distance(direction) / 5.0 }; 3]
        });
        hdr(&cubemaps.join("0_depth.hdr"), &depth);
        for what in ["albedo", "normal", "roughness", "metallic", "mask"] {
            hdr(&cubemaps.join(format!("0_{what}.hdr")), &Image::new(width, height, vec![[0.5; 3]; width * height]));
        }
    }
    // A grid of 8 × 4 probes, each with its own brightness, rotated by 180° from the panorama.
    let light = Image::from_fn(8 * 32, 4 * 16, |x, y| {
        let (column, row) = (x / 32, y / 16);
        let back = pixel_direction((x % 32 + 16) % 32, y % 16, 32, 16);
        [(1 + column + 8 * row) as f32, back.x + 1.5, 0.3]
    });
    hdr(&root.join("000123").join("ue4_result").join("LightProbeData").join("0_light.exr"), &light);
}

/// Returns the distance from the centre of a box with half sizes 2, 1.5 and 3 m.
pub fn room_distance(d: Vec3) -> f32 {
    (2.0 / d.x.abs()).min(1.5 / d.y.abs()).min(3.0 / d.z.abs())
}

/// Writes a sequence of HD1 with three frames. The camera moves along its −Z, half a metre per frame.
pub fn interiornet(root: &Path) -> std::path::PathBuf {
    let truth = root.join("GroundTruth_HD1-HD6").join("3FO4_Bedroom").join("velocity_angular_1_1");
    std::fs::create_dir_all(&truth).unwrap();
    let mut lines =
        "#camera model: pinhole\n#camera info: f, cx, cy, dist.coeff[0..2]\n# w x y z\n# position\n# resolution\n3\n"
            .to_owned();
    // Upright in a world whose Z is up: rotated by 90° about X, so that −Z becomes +Y.
    let q = std::f64::consts::FRAC_1_SQRT_2;
    for i in 0..3 {
        lines += &format!("30 24 16 0 0 0 {q} {q} 0 0 1 {} 1.5 48 32\n", 0.5 * f64::from(i));
    }
    std::fs::write(truth.join("cam0.ccam"), lines).unwrap();
    let sequence = root.join("HD1").join("3FO4_Bedroom").join("original_1_1");
    for i in 0..3 {
        let at = |what: &str| {
            let folder = sequence.join(what).join("data");
            std::fs::create_dir_all(&folder).unwrap();
            folder.join(format!("{i}.png"))
        };
        write_srgb8(at("cam0"), &Image::new(48, 32, vec![[100 + i, 90, 80]; 48 * 32]), 90, lo_imaging::GENERATOR)
            .unwrap();
        // A wall 3 m in front of the first camera: distance along each ray.
        let z = 3.0 - 0.5 * f64::from(i);
        let camera = lo_geometry::Camera::new(30.0, 30.0, 24.0, 16.0, 48, 32).unwrap();
        let distance: DepthMap =
            Image::from_fn(48, 32, |x, y| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, z).length());
        write_depth(at("depth0"), &distance, lo_imaging::GENERATOR).unwrap();
        if i != 1 {
            write_srgb8(
                at("cam0_pano"),
                &Image::new(64, 32, vec![[200, 128, 10 * i]; 64 * 32]),
                90,
                lo_imaging::GENERATOR,
            )
            .unwrap();
        }
    }
    truth.join("cam0.ccam")
}

/// Writes two scenes of InteriorVerse, each with one image, of both fields of view.
pub fn interiorverse(root: &Path) {
    for (part, hfov_deg) in [("dataset_85", 85.0f32), ("dataset_120", 120.0)] {
        let tan = (0.5 * hfov_deg).to_radians().tan();
        for scene in ["scene_a", "scene_b"] {
            let at = |what: &str| root.join(part).join(scene).join(format!("000_{what}.exr"));
            // A wall 2 m ahead, with a window without depth.
            hdr(&at("im"), &Image::from_fn(64, 48, |x, y| [0.2 + 0.01 * x as f32, 0.3, 0.1 + 0.005 * y as f32]));
            hdr(&at("depth"), &Image::from_fn(64, 48, |x, _| [if x < 8 { f32::INFINITY } else { 2000.0 + tan }; 3]));
            hdr(&at("albedo"), &Image::new(64, 48, vec![[0.5, 0.4, 0.3]; 64 * 48]));
        }
        std::fs::write(root.join(part).join("train.txt"), "scene_a\n").unwrap();
        std::fs::write(root.join(part).join("test.txt"), "scene_b\n").unwrap();
    }
}
