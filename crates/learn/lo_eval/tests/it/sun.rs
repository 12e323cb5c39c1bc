//! Where the sun shines in photos of sunny generated rooms, and how strong it is, told by the photo and where the sun stands.

use lightoctree::lo_lights::Sunlit;
use lightoctree::mesh::PreparedModel;
use lightoctree::scene::{Frame, Scene};
use lightoctree::{EstimateOptions, Input, sun_of_photo};
use lo_dataset::{Generator, GeneratorConfig};
use lo_geometry::{Ray, Vec3};
use lo_imaging::{DepthMap, Image, Photo, luminance};
use lo_synth::{CameraPose, Weather};

use crate::{median, shipped};

const FAR_M: f32 = 100.0;

/// Of every so many pixels it is asked whether the sun shines there.
const STRIDE: usize = 4;

/// Rooms in which the sun shines on less of the photo than this are passed over.
const MIN_LIT: f64 = 0.005;

/// Whether the sun shines on what a pixel shows; `None` where it shows nothing.
fn is_lit(model: &PreparedModel, view: &CameraPose, sun: Vec3, (x, y): (usize, usize)) -> Option<bool> {
    let is_glass = |triangle: u32| {
        let model = model.model();
        model.materials[model.triangle_materials[triangle as usize] as usize].transmission > 0.0
    };
    let meets = |mut ray: Ray| {
        for _ in 0..8 {
            let hit = model.intersect_both_sides(&ray, FAR_M)?;
            if !is_glass(hit.triangle) {
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

/// Intersection over union of what is in the sun and what is found to be; 0 where nothing is found.
fn overlap(truth: &Image<Option<bool>>, scene: &Scene, sun: Vec3) -> f64 {
    let Some(found) = Sunlit::new(&scene.frame.working().without_flying_pixels(), sun) else { return 0.0 };
    let lit = found.lit();
    let (mut both, mut one) = (0.0, 0.0);
    for y in 0..truth.height() {
        for x in 0..truth.width() {
            let Some(truth_here) = truth[(x, y)] else { continue };
            let own = lit[(x * lit.width() / truth.width(), y * lit.height() / truth.height())] > 0.5;
            both += f64::from(u8::from(truth_here && own));
            one += f64::from(u8::from(truth_here || own));
        }
    }
    both / one
}

#[test]
#[ignore = "two minutes: cargo test --release -p lo_eval --test it sun:: -- --ignored --nocapture; SUN_SEED chooses other rooms"]
fn sun_patches_of_generated_rooms() {
    let mut config = GeneratorConfig { shots: 1, ..GeneratorConfig::default() };
    config.room.crop_size = [480, 320];
    config.room.weather_weights = [(Weather::Clear, 0.8), (Weather::Sunset, 0.2)].into();
    let seed = std::env::var("SUN_SEED").map_or(7003, |seed| seed.parse().unwrap());
    let generator = Generator::new(seed, config).unwrap();
    let estimator = shipped();
    let names = ["true depth", "sensor depth", "photo alone"];
    let [mut overlaps, mut strengths] = [const { [const { Vec::new() }; 3] }; 2];
    for index in 0..60 {
        let interior = generator.interior(index).unwrap();
        let view = interior.camera_poses(1)[0];
        let model = PreparedModel::new(interior.world.model.clone());
        let Some(sun) = interior.world.outdoors.sun else { continue };
        let (columns, rows) = (view.camera.width as usize / STRIDE, view.camera.height as usize / STRIDE);
        let pixel = |x: usize, y: usize| is_lit(&model, &view, sun.direction, (x * STRIDE, y * STRIDE));
        let truth = Image::from_fn(columns, rows, pixel);
        let lit = truth.pixels().iter().filter(|lit| **lit == Some(true)).count();
        let share = lit as f64 / (columns * rows) as f64;
        if share < MIN_LIT {
            continue;
        }
        let record = generator.record(index).unwrap();
        let (sample, gains) = (record.sample(0), record.shots[0].gains);
        let radiance: [f32; 3] = std::array::from_fn(|c| sun.radiance[c] * gains[c]);
        let strength = luminance(radiance) * std::f32::consts::PI * sun.angular_radius_rad.powi(2);
        let direction = view.pose.rotation.inverse() * sun.direction;
        let photo = Photo::Srgb8(sample.photo.clone());
        let measured = |depth: &Option<DepthMap>| {
            Input::MeasuredDepth(Frame::new(photo.clone(), depth.clone().unwrap(), sample.camera, 1.0).unwrap())
        };
        let alone = Input::Photo { photo: photo.clone(), camera: sample.camera };
        let inputs = [measured(&sample.depth_m), measured(&sample.sensor_depth_m), alone];
        print!("room {index}: {:.1} % in the sun, strength {strength:.1}", 100.0 * share);
        for (way, input) in inputs.into_iter().enumerate() {
            let options = EstimateOptions::default();
            let scene = estimator.estimate(input, &options, &mut lightoctree::events::ignore).unwrap();
            overlaps[way].push(overlap(&truth, &scene, direction));
            print!("; {}: overlap {:.2}", names[way], overlaps[way].last().unwrap());
            if let Some(found) = sun_of_photo(&scene, direction, 0.27) {
                let ratio = luminance(found.light.radiance) * found.light.extent() / strength;
                print!(", strength × {ratio:.2}{}", if found.clipped { " at the least" } else { "" });
                strengths[way].push(f64::from(ratio));
            }
        }
        println!();
    }
    for (name, (overlaps, strengths)) in names.into_iter().zip(overlaps.iter().zip(&strengths)) {
        let (found, photos) = (strengths.len(), overlaps.len());
        let (overlap, strength) = (median(overlaps.clone()), median(strengths.clone()));
        println!("{name}: sun patches in {found} of {photos} photos, overlap {overlap:.2}, strength × {strength:.2}");
        assert!(overlap > 0.2 && (0.2..2.0).contains(&strength), "{name}");
    }
}
