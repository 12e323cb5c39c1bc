//! Where the sun shines in photos of generated rooms, told by the photo and where the sun stands.

use lightoctree::mesh::PreparedModel;
use lightoctree::scene::Frame;
use lightoctree::{EstimateOptions, Input};
use lo_dataset::{Generator, GeneratorConfig};
use lo_geometry::{Ray, Vec3};
use lo_imaging::{Image, Photo};
use lo_lights::Sunlit;
use lo_synth::{CameraPose, Weather};

const FAR_M: f32 = 100.0;

/// Of every so many pixels.
const STRIDE: usize = 4;

/// Whether the sun shines on what a pixel shows; `None` where it shows nothing.
fn is_lit(model: &PreparedModel, view: &CameraPose, sun: Vec3, (x, y): (usize, usize)) -> Option<bool> {
    let opaque = |triangle: u32| {
        let material = &model.model().materials[model.model().triangle_materials[triangle as usize] as usize];
        material.transmission == 0.0
    };
    let meets = |mut ray: Ray| {
        for _ in 0..8 {
            let hit = model.intersect_both_sides(&ray, FAR_M)?;
            if opaque(hit.triangle) {
                return Some(ray.origin + ray.direction * hit.distance_m);
            }
            ray.origin += ray.direction * (hit.distance_m + 1e-3);
        }
        None
    };
    let direction = (view.pose.rotation * view.camera.direction(x as f64 + 0.5, y as f64 + 0.5)).normalize();
    let point = meets(Ray { origin: view.pose.position, direction })?;
    Some(meets(Ray { origin: point - direction * 2e-3, direction: sun }).is_none())
}

fn variable<T: std::str::FromStr>(name: &str, otherwise: T) -> T {
    std::env::var(name).ok().and_then(|text| text.parse().ok()).unwrap_or(otherwise)
}

#[test]
#[ignore = "two minutes: cargo test --release -p lo_eval --test it sun:: -- --ignored --nocapture"]
fn sun_patches_of_generated_rooms() {
    let mut config = GeneratorConfig { shots: 1, ..GeneratorConfig::default() };
    config.room.crop_size = [480, 320];
    config.room.weather_weights = [(Weather::Clear, 0.8), (Weather::Sunset, 0.2)].into();
    let generator = Generator::new(variable("SUN_SEED", 7002), config).unwrap();
    let estimator = super::photos::shipped();
    for index in variable("SUN_FROM", 0)..variable("SUN_TO", 60) {
        let interior = generator.interior(index).unwrap();
        let view = interior.camera_poses(1)[0];
        let model = PreparedModel::new(interior.world.model.clone());
        let Some(sun) = interior.world.outdoors.sun else { continue };
        let (columns, rows) = (view.camera.width as usize / STRIDE, view.camera.height as usize / STRIDE);
        let truth =
            Image::from_fn(columns, rows, |x, y| is_lit(&model, &view, sun.direction, (x * STRIDE, y * STRIDE)));
        let share = truth.pixels().iter().filter(|lit| **lit == Some(true)).count() as f32 / (columns * rows) as f32;
        if share < 0.005 {
            continue;
        }
        let direction = view.pose.rotation.inverse() * sun.direction;
        let record = generator.record(index).unwrap();
        let (sample, gains) = (record.sample(0), record.shots[0].gains);
        let photo = Photo::Srgb8(sample.photo.clone());
        let frame = |depth: &Option<lo_imaging::DepthMap>| {
            Input::MeasuredDepth(Frame::new(photo.clone(), depth.clone().unwrap(), sample.camera, 1.0).unwrap())
        };
        let inputs = [
            ("true", frame(&sample.depth_m)),
            ("sensor", frame(&sample.sensor_depth_m)),
            ("alone", Input::Photo { photo: photo.clone(), camera: sample.camera }),
        ];
        print!("room {index}: lit {share:.3};");
        for (name, input) in inputs {
            let scene =
                estimator.estimate(input, &EstimateOptions::default(), &mut lightoctree::events::ignore).unwrap();
            let seen = scene.frame.working().without_flying_pixels();
            let Some(found) = Sunlit::new(&seen, direction) else {
                print!("  {name}: none");
                continue;
            };
            let (mut both, mut one) = (0, 0);
            for y in 0..rows {
                for x in 0..columns {
                    let Some(truth) = truth[(x, y)] else { continue };
                    let lit = found.lit();
                    let own = lit[(x * lit.width() / columns, y * lit.height() / rows)];
                    both += usize::from(truth && own);
                    one += usize::from(truth || own);
                }
            }
            print!("  {name}: {:.2}", both as f64 / one as f64);
            if let Some(found) = lightoctree::sun_of_photo(&scene, direction, 0.27) {
                let strength = |radiance: [f32; 3]| lo_imaging::luminance(radiance) * found.light.extent();
                let true_extent = std::f32::consts::PI * sun.angular_radius_rad.powi(2);
                let truth = lo_imaging::luminance(std::array::from_fn(|c| sun.radiance[c] * gains[c])) * true_extent;
                print!(
                    " (strength {:.2} of {truth:.1}{})",
                    strength(found.light.radiance) / truth,
                    if found.clipped { ", clipped" } else { "" }
                );
            }
            if let Ok(folder) = std::env::var("SUN_PICTURES") {
                let rgb = sample.photo.clone();
                let lit = found.lit();
                let shown = Image::from_fn(rgb.width(), rgb.height(), |x, y| {
                    let [r, g, b] = rgb[(x, y)];
                    if lit[(x * lit.width() / rgb.width(), y * lit.height() / rgb.height())] {
                        [255, g / 2, b / 2]
                    } else {
                        [r, g, b]
                    }
                });
                let bytes: Vec<u8> = shown.pixels().iter().flatten().copied().collect();
                std::fs::write(
                    format!("{folder}/{index:03}-{name}.ppm"),
                    [format!("P6 {} {} 255\n", rgb.width(), rgb.height()).into_bytes(), bytes].concat(),
                )
                .unwrap();
            }
        }
        println!();
    }
}
