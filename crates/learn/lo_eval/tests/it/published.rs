//! Spheres against images that Blender rendered for the published protocol.

use std::path::PathBuf;

use lo_eval::spheres::{Material, SphereView, single_sphere};
use lo_geometry::{Vec3, uv_from_direction};
use lo_imaging::{Image, RadianceImage, read_radiance};

/// The published camera: 16 radii away, 2 up; its image has 960 × 540 pixels.
const VIEW: SphereView = SphereView { eye: Vec3::new(16.0, 2.0, 0.0), focal_px: 960.0 * 85.0 / 36.0 };

/// Reads the square around the sphere in a published image, 282 pixels wide; `None` without the files.
fn published(name: &str) -> Option<RadianceImage> {
    let Some(folder) = std::env::var_os("STYLELIGHT_EXAMPLE") else {
        eprintln!("set STYLELIGHT_EXAMPLE to example/ground_truth/stylelight of DiffusionLight-evaluation");
        return None;
    };
    let picture = read_radiance(PathBuf::from(folder).join(name).join("abandoned_bakery_4k.exr")).unwrap();
    assert_eq!((picture.width(), picture.height()), (960, 540));
    Some(Image::from_fn(282, 282, |x, y| picture[(x + 339, y + 129)]))
}

/// Reconstructs the panorama from the mirror sphere.
fn panorama(mirror: &RadianceImage) -> RadianceImage {
    let (width, height) = (256, 128);
    let (forward, middle) = (-VIEW.eye.normalize(), 141.0);
    let right = forward.cross(Vec3::Y).normalize();
    let up = right.cross(forward);
    let mut sums = vec![[0.0f32; 4]; width * height];
    for (index, rgb) in mirror.pixels().iter().enumerate() {
        let (x, y) = ((index % 282) as f32 + 0.5 - middle, middle - (index / 282) as f32 - 0.5);
        let direction = (forward * VIEW.focal_px + right * x + up * y).normalize();
        let along = -VIEW.eye.dot(direction);
        let inside = 1.0 - (VIEW.eye + direction * along).length_squared();
        if inside <= 0.01 {
            continue;
        }
        let normal = (VIEW.eye + direction * (along - inside.sqrt())).normalize();
        let uv = uv_from_direction(direction - 2.0 * normal.dot(direction) * normal);
        let pixel =
            ((uv.y * height as f32) as usize).min(height - 1) * width + ((uv.x * width as f32) as usize).min(width - 1);
        let reflectance = 0.8 + 0.2 * (1.0 + normal.dot(direction)).powi(5);
        for c in 0..3 {
            sums[pixel][c] += rgb[c] / reflectance;
        }
        sums[pixel][3] += 1.0;
    }
    // Fill pixels without a ray with the mean of their neighbours.
    for _ in 0..64 {
        let before = sums.clone();
        for i in (0..sums.len()).filter(|&i| before[i][3] == 0.0) {
            let (x, y) = (i % width, i / width);
            let row = |y: usize| y.min(height - 1) * width;
            let near = [
                row(y) + (x + 1) % width,
                row(y) + (x + width - 1) % width,
                row(y + 1) + x,
                row(y.saturating_sub(1)) + x,
            ];
            let known: Vec<[f32; 4]> = near.iter().map(|&j| before[j]).filter(|s| s[3] > 0.0).collect();
            if !known.is_empty() {
                let mean = |c: usize| known.iter().map(|s| s[c] / s[3]).sum::<f32>() / known.len() as f32;
                sums[i] = [mean(0), mean(1), mean(2), 1.0];
            }
        }
    }
    Image::new(width, height, sums.iter().map(|s| [0, 1, 2].map(|c| s[c] / s[3].max(1.0))).collect())
}

#[test]
#[ignore = "needs pictures that are not ours: STYLELIGHT_EXAMPLE=… cargo test -p lo_eval --test it published:: -- --ignored"]
fn rough_and_diffuse_spheres_are_blenders_under_what_its_mirror_shows() {
    let Some(mirror) = published("mirror") else { return };
    let light = panorama(&mirror);
    for (name, material, tolerance) in [
        ("mirror", Material::Mirror { reflectance: 0.8 }, 0.15),
        ("matte_silver", Material::Metal { reflectance: 0.8, roughness: 0.3271 }, 0.1),
        ("diffuse", Material::Plastic { albedo: 0.8, roughness: 0.364 }, 0.1),
    ] {
        let theirs = published(name).unwrap();
        let transport = single_sphere(material, VIEW);
        let ours = transport.picture(transport.render(&light).pixels(), [f32::NAN; 3]);
        let step = 282 / ours.width();
        let [mut error, mut square, mut both, mut own, mut count] = [0.0f64; 5];
        for (x, y) in (0..ours.height()).flat_map(|y| (0..ours.width()).map(move |x| (x, y))) {
            let (left, top) = ((x * 282) / ours.width(), (y * 282) / ours.height());
            let rim = (x as f32 + 0.5 - 0.5 * ours.width() as f32).hypot(y as f32 + 0.5 - 0.5 * ours.height() as f32);
            if ours[(x, y)][0].is_nan() || rim > 0.47 * ours.width() as f32 {
                continue;
            }
            for c in 0..3 {
                let square_mean: f32 = (0..step * step)
                    .map(|i| theirs[((left + i % step).min(281), (top + i / step).min(281))][c])
                    .sum::<f32>()
                    / (step * step) as f32;
                let (a, b) = (f64::from(square_mean), f64::from(ours[(x, y)][c]));
                error += (a - b).powi(2);
                square += a * a;
                both += a * b;
                own += b * b;
                count += 1.0;
            }
        }
        let relative = (error / square).sqrt();
        eprintln!("{name}: relative RMS difference {relative:.4}, scale {:.4}, {count} values", both / own);
        assert!(relative < tolerance, "{name}: {relative}");
    }
}
