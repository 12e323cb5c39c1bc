//! Rendered views against the path tracer. PSNR is computed on images under the tone curve x / (1 + x), with x in units
//! of the true image's mean. The reference's own noise is excluded.

use crate::support::{RoomLight, cornell, living_room, mean, panorama, psnr_db};
use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use lo_synth::{Interior, SynthConfig};
use lo_transport::{BakeSettings, BakedWorld, PathTracer, View, World};

struct Agreement {
    psnr_db: f32,
    /// Mean over the true mean.
    mean: f32,
    /// Mean over the true mean, in the darkest third of the pixels.
    shadow: f32,
}

fn compare(world: &World, view: &View, samples: u32) -> Agreement {
    let [truth, other] = [1, 2].map(|seed| PathTracer::new(world.clone(), seed).unwrap().render(view, samples));
    let found = BakedWorld::bake(world.clone(), &BakeSettings::default()).unwrap().render(view).radiance;
    let agreement = Agreement {
        psnr_db: psnr_db(&found, [&truth, &other]),
        mean: mean(&found) / mean(&truth),
        shadow: 0.5 * (shadow(&found, [&truth, &other]) + shadow(&found, [&other, &truth])),
    };
    let Agreement { psnr_db, mean, shadow } = agreement;
    eprintln!("{psnr_db:.2} dB, mean × {mean:.4}, shadow × {shadow:.4}");
    agreement
}

/// Returns the ratio of means over the pixels whose 5 × 5 surroundings are darkest. A second reference selects them.
/// Selection by the first would favour pixels that are dark by its noise.
fn shadow(found: &RadianceImage, [truth, other]: [&RadianceImage; 2]) -> f32 {
    let (width, height) = (truth.width() as i64, truth.height() as i64);
    let around = |image: &RadianceImage, i: i64| -> f32 {
        let near = (-2..=2_i64).flat_map(|dy| (-2..=2_i64).map(move |dx| (dx, dy)));
        near.map(|(dx, dy)| {
            let (x, y) = ((i % width + dx).rem_euclid(width), (i / width + dy).clamp(0, height - 1));
            image[(x as usize, y as usize)].iter().sum::<f32>()
        })
        .sum()
    };
    let mut order: Vec<i64> = (0..width * height).collect();
    order.sort_by(|&a, &b| around(other, a).total_cmp(&around(other, b)));
    let dark = &order[..order.len() / 3];
    let sum = |image: &RadianceImage| -> f64 {
        dark.iter().map(|&i| f64::from(image.pixels()[i as usize].iter().sum::<f32>())).sum()
    };
    (sum(found) / sum(truth)) as f32
}

#[test]
fn a_small_cornell_box_agrees() {
    let agreement = compare(&cornell(), &panorama(Vec3::new(1.0, 2.6, 0.6), 48), 48);
    assert!(agreement.psnr_db > 35.0 && (agreement.mean - 1.0).abs() < 0.02);
    assert!((agreement.shadow - 1.0).abs() < 0.05);
}

#[test]
#[ignore = "minutes: cargo test --release -p lo_transport --test it reference:: -- --ignored --nocapture"]
fn rooms_agree() {
    let lamps = RoomLight { sky: [0.01; 3], sun: None, lamps: true };
    let sky = RoomLight { sky: [3.0, 4.0, 5.5], sun: None, lamps: false };
    let sun = RoomLight { sky: [3.0, 4.0, 5.5], sun: Some([400_000.0, 350_000.0, 300_000.0]), lamps: true };
    let mut worlds = vec![("cornell", cornell(), Vec3::new(1.0, 2.6, 0.6))];
    for (name, light) in [("night", lamps), ("day", sky), ("sun", sun)] {
        worlds.push((name, living_room(&light), Vec3::new(0.3, 1.2, 0.6)));
    }
    let agree = |name: &str, agreement: Agreement| {
        let Agreement { psnr_db, mean, shadow } = agreement;
        let good = psnr_db > 35.0 && (mean - 1.0).abs() < 0.02 && (shadow - 1.0).abs() < 0.05;
        (!good).then(|| format!("{name}: {psnr_db:.2} dB, mean × {mean:.4}, shadow × {shadow:.4}"))
    };
    let mut wrong = Vec::new();
    for (name, world, position) in worlds {
        eprint!("{name}: ");
        wrong.extend(agree(name, compare(&world, &panorama(position, 64), 256)));
    }
    // Generated rooms: a dining room by day, a bathroom under spots, a night with two lamps.
    for index in [3, 5, 7] {
        let interior = Interior::generate(11, index, &SynthConfig::default()).unwrap();
        let position = interior.probe_positions(&interior.camera_poses(1)[0], 1)[0];
        eprint!("{}: ", interior.id);
        wrong.extend(agree(&interior.id, compare(&interior.world, &panorama(position, 64), 1024)));
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
