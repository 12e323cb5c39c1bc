//! Real photos, depth and panoramas: those in the repository, and those of the data beside the checkout.

use std::path::{Path, PathBuf};

use lo_geometry::{Orientation, Vec3, fibonacci_sphere};
use lo_testdata::{asset, panoramas, shared_data};

/// The repository's panorama, followed by those beside the checkout.
fn panoramas_here(names: &[&str], untested: &str) -> Vec<PathBuf> {
    let folder = shared_data("hdr", untested);
    let others = folder.iter().flat_map(|folder| names.iter().map(|name| folder.join(name)));
    std::iter::once(panoramas().join(SMALL)).chain(others).collect()
}

/// The repository's panorama: 1024 × 512 averaged to 256 × 128.
const SMALL: &str = "lebombo_256.hdr";

/// Median, 99 % and highest luminance as stated in the data's README, to three digits.
const PANORAMAS: [(&str, [f32; 3]); 14] = [
    ("lebombo_1k.hdr", [0.472, 4.66, 23.31]),
    ("brown_photostudio_02_1k.hdr", [0.287, 15.0, 87.82]),
    ("brown_photostudio_07_1k.hdr", [0.353, 4.61, 54.69]),
    ("blocky_photo_studio_1k.hdr", [0.419, 3.62, 5186.0]),
    ("st_fagans_interior_1k.hdr", [0.488, 2.81, 1111.0]),
    ("dancing_hall_1k.hdr", [0.181, 11.2, 608.3]),
    ("thatch_chapel_1k.hdr", [0.0764, 3.76, 1072.0]),
    ("empty_warehouse_01_1k.hdr", [0.239, 2.68, 400.3]),
    ("autoshop_01_1k.hdr", [0.299, 6.94, 75.15]),
    ("peppermint_powerplant_1k.hdr", [0.067, 6.36, 15.74]),
    ("leadenhall_market_1k.hdr", [0.0909, 16.4, 242.1]),
    ("studio_small_03_1k.hdr", [0.0117, 13.8, 3352.0]),
    ("studio_small_05_1k.hdr", [0.00321, 8.4, 86.5]),
    ("studio_small_01.exr", [0.00472, 0.275, 551.5]),
];

#[test]
fn all_panoramas_load_with_the_published_luminances() {
    // values of the small one from an independent reader in Python
    assert_luminances(&panoramas().join(SMALL), (256, 128), [0.472, 4.56, 12.2]);
    let Some(folder) = shared_data("hdr", "reading of 14 real panoramas") else { return };
    for (name, expected) in PANORAMAS {
        assert_luminances(&folder.join(name), (1024, 512), expected);
    }
}

fn assert_luminances(path: &Path, size: (usize, usize), expected: [f32; 3]) {
    let name = path.display();
    let image = lo_imaging::read_radiance(path).unwrap();
    assert_eq!((image.width(), image.height()), size, "{name}");
    let mut luminance: Vec<f32> = image.pixels().iter().map(|&rgb| lo_imaging::luminance(rgb)).collect();
    luminance.sort_by(f32::total_cmp);
    let count = luminance.len();
    let got = [luminance[count / 2], luminance[count * 99 / 100], luminance[count - 1]];
    for (got, expected) in got.iter().zip(expected) {
        // half a unit of the third digit, and the table's own rounding
        assert!((got / expected - 1.0).abs() < 6e-3, "{name}: {got} against {expected}");
    }
}

#[test]
fn photos_and_their_depth_load() {
    let depth = lo_imaging::read_depth(asset("library_lidar_depth.png"), None).unwrap();
    let (near, far) = depth.pixels().iter().fold((f32::MAX, 0.0f32), |(a, b), &d| (a.min(d), b.max(d)));
    assert!((near - 1.57).abs() < 0.006 && (far - 3.51).abs() < 0.006, "{near} {far}");
    let photo = lo_imaging::read_photo(asset("library_color.jpg")).unwrap();
    assert_eq!((photo.photo.width(), photo.photo.height()), (1920, 1440));
    // a photo instead of depth is rejected with a helpful message
    let error = lo_imaging::read_depth(asset("library_color.jpg"), None).unwrap_err().to_string();
    assert!(error.contains("16-bit PNG"), "{error}");
    let Some(folder) = shared_data("rgbd", "reading of a Kinect's photo and depth with holes") else { return };
    let desk = lo_imaging::read_photo(folder.join("tum_desk_color.png")).unwrap();
    assert!(matches!(desk.photo, lo_imaging::Photo::Srgb8(_)));
    assert_eq!((desk.photo.width(), desk.photo.height()), (640, 480));
    assert_eq!(desk.hfov_deg(), None);
    let depth = lo_imaging::read_depth(folder.join("tum_desk_depth.png"), Some(5000.0)).unwrap();
    let holes = depth.pixels().iter().filter(|&&d| d == 0.0).count() as f64 / (640.0 * 480.0);
    assert!((holes - 0.19).abs() < 0.005, "{holes}");
    let error = lo_imaging::read_depth(folder.join("tum_desk_color.png"), None).unwrap_err().to_string();
    assert!(error.contains("16 bits"), "{error}");
}

#[test]
fn main_lights_of_the_panoramas_are_where_the_pictures_show_them() {
    for path in panoramas_here(&PANORAMAS.map(|(name, _)| name), "main lights of 14 real panoramas") {
        let name = path.display();
        let map = lo_imaging::read_radiance(&path).unwrap();
        let light = lo_imaging::main_light(&map).unwrap_or_else(|| panic!("{name} has lamps or windows"));
        eprintln!("{name}: {light:?}");
        assert!((Vec3::from_array(light.direction).length() - 1.0).abs() < 1e-5, "{name}");
        assert!(light.share > 0.02 && light.share < 1.0, "{name}: {}", light.share);
        // the light must be brighter than its surroundings and turn with the map
        let turned = lo_imaging::reorient(&map, Orientation::Lightoctree, Orientation::Openexr);
        let opposite = lo_imaging::main_light(&turned).unwrap();
        let expected = Orientation::Openexr.map_from_world() * Vec3::from_array(light.direction);
        assert!((Vec3::from_array(opposite.direction) - expected).length() < 1e-4, "{name}");
        assert!((opposite.share - light.share).abs() < 1e-4, "{name}");
    }
}

/// Irradiance by brute-force summation over all pixels in f64.
fn brute_force_irradiance(map: &lo_imaging::RadianceImage, normal: Vec3) -> [f64; 3] {
    let (width, height) = (map.width(), map.height());
    let mut sum = [0.0; 3];
    for (index, pixel) in map.pixels().iter().enumerate() {
        let (longitude, latitude) = (
            ((index % width) as f64 + 0.5) / width as f64 * std::f64::consts::TAU - std::f64::consts::PI,
            std::f64::consts::FRAC_PI_2 - ((index / width) as f64 + 0.5) / height as f64 * std::f64::consts::PI,
        );
        let direction = [latitude.cos() * longitude.sin(), latitude.sin(), -latitude.cos() * longitude.cos()];
        let cosine: f64 = direction.iter().zip(normal.to_array()).map(|(d, n)| d * f64::from(n)).sum();
        let solid_angle = std::f64::consts::TAU / width as f64 * std::f64::consts::PI / height as f64 * latitude.cos();
        for (sum, value) in sum.iter_mut().zip(pixel) {
            *sum += f64::from(*value) * cosine.max(0.0) * solid_angle;
        }
    }
    sum
}

#[test]
fn spherical_harmonics_give_the_irradiance_of_real_light() {
    // Ramamoorthi and Hanrahan 2001, section 2: 9 % of the greatest irradiance at most, 1 to 3 % on average
    let names = ["lebombo_1k.hdr", "dancing_hall_1k.hdr", "peppermint_powerplant_1k.hdr"];
    for path in panoramas_here(&names, "spherical harmonics of three real panoramas") {
        let name = path.display();
        let map = lo_imaging::read_radiance(&path).unwrap();
        let small = lo_imaging::resize_equirectangular(&map, 128, 64);
        let sh = lo_imaging::Sh9::project(&map);
        let normals = fibonacci_sphere(60);
        let (mut error, mut greatest, mut worst) = (0.0, 0.0f64, 0.0f64);
        for &normal in &normals {
            let expected = brute_force_irradiance(&small, normal)[1];
            let difference = (f64::from(sh.irradiance(normal)[1]) - expected).abs();
            error += difference;
            greatest = greatest.max(expected);
            worst = worst.max(difference);
        }
        let (error, worst) = (error / normals.len() as f64 / greatest, worst / greatest);
        eprintln!("{name}: mean error {:.2} %, worst {:.2} %", 100.0 * error, 100.0 * worst);
        assert!(error < 0.03 && worst < 0.09, "{name}: {error} {worst}");
    }
}
