//! Systems of the literature in the evaluation.

use lo_baselines::{BallMaterial, Balls, Baseline, BaselineNet, PhotoFeatures, System, fingerprint};
use lo_dataset::{Dataset, GeneratedDataset, Generator, GeneratorConfig};
use lo_estimate::Estimator;
use lo_eval::spheres::{Material, SphereView, single_sphere};
use lo_eval::{EstimatedLight, Method, MethodError, Scorer, Tools, walk};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::RadianceImage;
use lo_nets::depth::EncoderKind;
use lo_nets::light::LightNetConfig;
use lo_nets::{Device, Networks};
use lo_synth::SynthConfig;

/// The balls of DeepLight's loss against the spheres of the evaluation, which have perspective and finer panoramas.
#[test]
fn balls_look_like_the_evaluations_spheres() {
    // Smooth enough for 32 × 16 pixels; a lamp at the right, above, behind the camera.
    let light = |d: Vec3| 0.4 + 0.3 * d.y + 6.0 * (8.0 * (d.dot(Vec3::new(0.64, 0.48, 0.6)) - 1.0)).exp();
    let map = |width: usize| {
        RadianceImage::from_fn(width, width / 2, |x, y| [light(pixel_direction(x, y, width, width / 2)); 3])
    };
    let balls = Balls::new([32, 16]);
    // From afar, the silhouette is a circle of this radius.
    let (eye, focal_px) = (Vec3::new(0.0, 0.0, 60.0), 6_000.0);
    let radius_px = focal_px / (eye.length_squared() - 1.0f32).sqrt();
    for (own, theirs, tolerance) in [
        (BallMaterial::Mirror, Material::Mirror { reflectance: 1.0 }, 0.12),
        (BallMaterial::Silver, Material::Metal { reflectance: 1.0, roughness: 0.3271 }, 0.12),
        (BallMaterial::Matte, Material::Diffuse { albedo: 1.0 }, 0.03),
    ] {
        let sphere = single_sphere(theirs, SphereView { eye, focal_px });
        let picture = sphere.picture(sphere.render(&map(256)).pixels(), [f32::NAN; 3]);
        let step = 2.0 * radius_px / picture.width() as f32;
        let seen = balls.render(own, &map(32));
        let mut compared = 0;
        for ([right, up], seen) in Balls::positions().into_iter().zip(seen) {
            if right.hypot(up) > 0.85 {
                continue;
            }
            let pixel = |t: f32| (0.5 * picture.width() as f32 + t * radius_px / step) as usize;
            let expected = picture[(pixel(right), pixel(-up))][1];
            assert!(
                (seen[1] - expected).abs() < tolerance * (1.0 + expected),
                "{own:?} {right} {up}: {seen:?} {expected}"
            );
            compared += 1;
        }
        assert!(compared > 250, "{compared}");
    }
}

#[test]
fn every_system_is_scored_and_answers_as_its_publication_does() {
    let room = SynthConfig { crop_size: [96, 64], ..SynthConfig::default() };
    let config =
        GeneratorConfig { room, shots: 1, panoramas: 2, panorama_height: 32, octree_depth: 5, ..Default::default() };
    let sample = GeneratedDataset::new(Generator::new(2, config).unwrap(), 1).get(0).unwrap();
    let network = LightNetConfig { depth: 5, full_depth: 3, channels: 8, max_channels: 16, ..Default::default() };
    let network = LightNetConfig { bottleneck: 2, head_channels: 8, global_features: 8, ..network };
    let networks = || Networks::new(EncoderKind::EfficientNetLite0, &network, 1, &Device::flex()).unwrap();
    let depth_net = networks().depth;
    let features = PhotoFeatures::new(&depth_net, &sample.photo, &sample.camera);
    let made = |system| {
        let net = BaselineNet::new(system, features.shape(), 7, &Device::flex());
        Baseline::new(system, net, features.shape(), fingerprint(&depth_net))
    };
    let baselines = System::ALL.map(made);
    let estimator = Estimator::new(networks());
    let tools = Tools {
        estimator: &estimator,
        profile: None,
        octree_depth: 5,
        seed: 0,
        known: None,
        foreign: None,
        baselines: &baselines,
    };
    for system in System::ALL {
        let method = Method::Baseline(system);
        assert!(method.has_tools(&tools) && method.takes(&sample) && method.name() == system.name());
        let estimate = method.estimate(&sample, &tools).unwrap();
        assert_eq!(matches!(estimate.light, EstimatedLight::Predicted(_)), system.is_local(), "{system}");
        let panoramas = Scorer::panoramas(&sample, &estimate);
        let scores = Scorer::new(None).score(&sample, &estimate, &panoramas);
        for figure in ["psnr_db", "log_rmse", "coherence", "diffuse_rmse", "unseen_psnr_db"] {
            assert!(scores.get(figure).is_some_and(f64::is_finite), "{system}: {figure}");
        }
        // A walk changes nothing where one panorama holds for all points.
        if let Some(walk) = walk(&sample, &estimate) {
            assert!(system.is_local() || walk.largest_step_ratio.is_none(), "{system}");
        }
    }
    let none = Tools { baselines: &[], ..tools };
    let method = Method::Baseline(System::Li2020);
    assert!(!method.has_tools(&none));
    assert!(matches!(method.estimate(&sample, &none), Err(MethodError::Needs("the baseline's weights"))));
}
