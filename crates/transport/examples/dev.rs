#[path = "../tests/support/mod.rs"]
mod support;
use geometry::Vec3;
use lightoctree_transport::*;
use std::time::Instant;
use support::*;
fn save(name: &str, image: &imaging::RadianceImage, scale: f32) {
    let px = image.map(|p| {
        p.map(|v| {
            imaging::srgb8_from_linear({
                let x = v * scale;
                x / (1.0 + x)
            })
        })
    });
    std::fs::write(name, imaging::encode_png(&px)).ok();
}
fn cpu() -> f64 {
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    let f: Vec<&str> = s.rsplit(')').next().unwrap().split_whitespace().collect();
    f[11].parse::<f64>().unwrap() / 100.0
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let which = args[1].as_str();
    let spp: u32 = args[2].parse().unwrap();
    let dir = "/tmp/tr";
    std::fs::create_dir_all(dir).unwrap();
    let world = match which {
        "cornell" => cornell(),
        "furnace" => furnace(0.7, 0.3),
        "night" => living_room(&RoomLight { sky: [0.01; 3], sun: None, lamps: true }),
        "day" => living_room(&RoomLight { sky: [3.0, 4.0, 5.5], sun: None, lamps: false }),
        _ => living_room(&RoomLight { sky: [3.0, 4.0, 5.5], sun: Some([400000.0, 350000.0, 300000.0]), lamps: true }),
    };
    println!("{} triangles", world.model.triangles.len());
    let mut settings = BakeSettings::default();
    if let Some(s) = std::env::var("SPACING").ok() {
        settings.spacing_m = s.parse().unwrap();
    }
    if let Some(s) = std::env::var("GATHER").ok() {
        settings.gather_rays = s.parse().unwrap();
    }
    if let Some(s) = std::env::var("LIGHT").ok() {
        settings.light_rays = s.parse().unwrap();
    }
    let (t, c) = (Instant::now(), cpu());
    let baked = BakedWorld::bake(world.clone(), &settings).unwrap();
    println!("bake {:.2} s wall {:.2} cpu", t.elapsed().as_secs_f64(), cpu() - c);
    let (t, c) = (Instant::now(), cpu());
    let points = baked.radiance_points(0.08);
    println!("points {} {:.2} s wall {:.2} cpu", points.len(), t.elapsed().as_secs_f64(), cpu() - c);
    let views = [
        panorama(Vec3::new(0.3, 1.2, 0.6), 128),
        photo(Vec3::new(1.8, 1.5, 1.6), 0.7, -0.15, [480, 320]),
        photo(Vec3::new(-1.5, 1.2, -1.2), 3.6, -0.1, [480, 320]),
    ];
    let tracer = PathTracer::new(world, 1).unwrap();
    for (i, view) in views.iter().enumerate() {
        let (t, c) = (Instant::now(), cpu());
        let r = baked.render(view);
        println!("view {i} {:.2} s wall {:.2} cpu mean {}", t.elapsed().as_secs_f64(), cpu() - c, mean(&r.radiance));
        let white = 0.7 / mean(&r.radiance).max(1e-9);
        save(&format!("{dir}/{which}_{i}.png"), &r.radiance, white);
        if spp > 0 && i < 2 {
            let small = match view {
                View::Pinhole { .. } => photo(Vec3::new(1.8, 1.5, 1.6), 0.7, -0.15, [240, 160]),
                v => v.clone(),
            };
            let file = format!("{dir}/{which}_{i}_ref{spp}.bin");
            let truth = match std::fs::read(&file) {
                Ok(b) => {
                    let (w, h) = small.size();
                    imaging::Image::new(
                        w,
                        h,
                        b.chunks(12)
                            .map(|c| {
                                std::array::from_fn(|k| f32::from_le_bytes(c[4 * k..4 * k + 4].try_into().unwrap()))
                            })
                            .collect(),
                    )
                }
                Err(_) => {
                    let (t, c) = (Instant::now(), cpu());
                    let truth = tracer.render(&small, spp);
                    println!("ref {:.2} s wall {:.2} cpu", t.elapsed().as_secs_f64(), cpu() - c);
                    std::fs::write(
                        &file,
                        truth.pixels().iter().flatten().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>(),
                    )
                    .unwrap();
                    truth
                }
            };
            let r = baked.render(&small);
            println!(
                "view {i} psnr {:.2} mean {} truth {} ratio {:.4}",
                psnr_db(&r.radiance, &truth),
                mean(&r.radiance),
                mean(&truth),
                mean(&r.radiance) / mean(&truth)
            );
            save(&format!("{dir}/{which}_{i}_truth.png"), &truth, white);
            save(&format!("{dir}/{which}_{i}_ours.png"), &r.radiance, white);
            let w = mean(&truth);
            let d: Vec<[f32; 3]> = r
                .radiance
                .pixels()
                .iter()
                .zip(truth.pixels())
                .map(|(a, b)| std::array::from_fn(|k| 0.5 + 5.0 * (a[k] / (a[k] + w) - b[k] / (b[k] + w))))
                .collect();
            let (dw, dh) = small.size();
            let img =
                imaging::Image::new(dw, dh, d.iter().map(|p| p.map(|v| (v.clamp(0.0, 1.0) * 255.0) as u8)).collect());
            std::fs::write(format!("{dir}/{which}_{i}_diff.png"), imaging::encode_png(&img)).ok();
        }
    }
}
