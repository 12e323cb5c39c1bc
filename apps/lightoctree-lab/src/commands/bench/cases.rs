//! Benchmark cases: preparation and timed function.

use std::hint::black_box;
use std::path::Path;

use anyhow::Context;
use lightoctree::{Estimator, Input, LitScene};
use lightoctree_cli::commands::demo;
use lightoctree_cli::progress::Stages;
use lo_cone::{Cone, ConeSample, ConeTracer, SampleGradient, Sampling, Settings};
use lo_events as events;
use lo_geometry::{Camera, Cube, Vec3, pixel_direction};
use lo_imaging::{Image, Photo};
use lo_insert::{Align, Inserter, Instance, Lighting, Placement, Quality};
use lo_octree as octree;
use lo_octree::{LightOctree, Provenance, RadiancePoint};
use lo_scene::Frame;
use lo_train::peer_cases::{self, Work};

use super::input::{self, load};

/// Octree depths of all peers.
const DEPTH: u32 = 7;
const FULL_DEPTH: u32 = 4;
/// Size of the peers' panorama.
const WIDTH: usize = 256;
const HEIGHT: usize = 128;

/// A benchmark case.
pub struct Case {
    pub name: &'static str,
    pub prepare: fn() -> anyhow::Result<Prepared>,
}

/// A function to time; `run` returns the number of nodes processed.
pub struct Prepared {
    pub run: Box<dyn FnMut() -> Option<usize>>,
}

/// All cases, in the kit's order and with its names. The last two are not part of the kit.
pub const CASES: &[Case] = &[
    Case { name: "octree_build_d7", prepare: || build("rgbd", false) },
    Case { name: "octree_build_neigh_d7", prepare: || build("rgbd", true) },
    Case { name: "octree_build_d7_room", prepare: || build("room", false) },
    Case { name: "octree_build_neigh_d7_room", prepare: || build("room", true) },
    Case { name: "graph_build_d6", prepare: || graph_build("rgbd", 6) },
    Case { name: "graph_build_d7", prepare: || graph_build("rgbd", 7) },
    Case { name: "graph_build_d7_room", prepare: || graph_build("room", 7) },
    Case { name: "graph_conv_d7_c32_fwd", prepare: || graph_conv(7, 32, false) },
    Case { name: "graph_conv_d7_c32_fwdbwd", prepare: || graph_conv(7, 32, true) },
    Case { name: "graph_conv_d6_c64_fwd", prepare: || graph_conv(6, 64, false) },
    Case { name: "graph_conv_d6_c64_fwdbwd", prepare: || graph_conv(6, 64, true) },
    Case { name: "graph_conv_d5_c128_fwd", prepare: || graph_conv(5, 128, false) },
    Case { name: "graph_conv_d5_c128_fwdbwd", prepare: || graph_conv(5, 128, true) },
    Case { name: "graph_unet_d6_fwd", prepare: || graph_unet(6, false) },
    Case { name: "graph_unet_d6_train", prepare: || graph_unet(6, true) },
    Case { name: "graph_unet_d7_fwd", prepare: || graph_unet(7, false) },
    Case { name: "graph_unet_d7_train", prepare: || graph_unet(7, true) },
    Case { name: "densenet121_480x320_fwd", prepare: || Ok(peer_cases::densenet(false).into()) },
    Case { name: "densenet121_480x320_train", prepare: || Ok(peer_cases::densenet(true).into()) },
    Case { name: "panorama_fwd", prepare: || panorama(false) },
    Case { name: "panorama_fwdbwd", prepare: || panorama(true) },
    Case { name: "estimate_panorama", prepare: estimate_panorama },
    Case { name: "insert_draft", prepare: insert_draft },
];

/// Cube of the peers' octrees.
const CUBE: Cube = Cube { origin_m: Vec3::NEG_ONE, edge_m: 2.0 };

impl From<Work> for Prepared {
    fn from(Work { mut run, nodes }: Work) -> Self {
        let run = move || {
            run();
            nodes
        };
        Self { run: Box::new(run) }
    }
}

/// Loads a point cloud of the kit.
fn cloud(name: &str) -> anyhow::Result<Vec<RadiancePoint>> {
    let folder = input::folder()?;
    let (positions, _) = load(&folder, &format!("{name}_unit"))?;
    let (colors, _) = load(&folder, &format!("{name}_color"))?;
    let points = positions.chunks_exact(3).zip(colors.chunks_exact(3)).map(|(p, c)| RadiancePoint {
        position_m: Vec3::new(p[0], p[1], p[2]),
        radiance: [c[0], c[1], c[2]],
        provenance: Provenance::Observed,
    });
    Ok(points.collect())
}

fn graph_build(name: &str, depth: u32) -> anyhow::Result<Prepared> {
    let (light, _) = LightOctree::from_points(&cloud(name)?, CUBE, depth, FULL_DEPTH)?;
    Ok(peer_cases::graph_build(light.octree).into())
}

fn graph_conv(depth: u32, channels: usize, backward: bool) -> anyhow::Result<Prepared> {
    let (light, _) = LightOctree::from_points(&cloud("rgbd")?, CUBE, DEPTH, FULL_DEPTH)?;
    Ok(peer_cases::graph_convolution(&light.octree, depth, channels, backward).into())
}

fn graph_unet(depth: u32, train: bool) -> anyhow::Result<Prepared> {
    Ok(peer_cases::graph_unet(&cloud("rgbd")?, CUBE, depth, train)?.into())
}

fn build(name: &str, neighbours: bool) -> anyhow::Result<Prepared> {
    let points = cloud(name)?;
    let run = move || {
        let (light, _) =
            LightOctree::from_points(&points, CUBE, DEPTH, FULL_DEPTH).expect("the kit's clouds make an octree");
        if neighbours {
            black_box(light.octree.all_neighbours());
        }
        Some(light.octree.levels().iter().map(|level| level.keys.len()).sum())
    };
    Ok(Prepared { run: Box::new(run) })
}

fn panorama(backward: bool) -> anyhow::Result<Prepared> {
    let folder = input::folder()?;
    let light = room_octree(&folder)?;
    let nodes = light.octree.levels()[FULL_DEPTH as usize..].iter().map(|level| level.nonempty).sum();
    let origin = probe(&folder)?;
    // The kit samples the nearest node.
    let tracer = ConeTracer::new(&light, Settings { sampling: Sampling::Nearest, ..Settings::default() })?;
    let cones = panorama_cones(origin);
    let mut samples = vec![ConeSample::default(); cones.len()];
    let run = move || {
        if backward {
            // The kit's output gradient is 1.
            let ones = SampleGradient { radiance: [1.0; 3], ..SampleGradient::default() };
            black_box(tracer.trace_with_gradients(&cones, &mut samples, &|_, _| ones));
        } else {
            tracer.trace_batch(&cones, &mut samples);
            black_box(&samples);
        }
        Some(nodes)
    };
    Ok(Prepared { run: Box::new(run) })
}

/// Returns the kit's cones. Their half-angle is the pixel pitch; our panoramas use half of it, and more steps.
fn panorama_cones(origin: Vec3) -> Vec<Cone> {
    let tan_half_angle = (std::f32::consts::TAU / WIDTH as f32).tan();
    (0..WIDTH * HEIGHT)
        .map(|i| Cone { origin, direction: pixel_direction(i % WIDTH, i / WIDTH, WIDTH, HEIGHT), tan_half_angle })
        .collect()
}

/// Converts the kit's 128³ RGBα volume, index [x][y][z], to an octree.
fn room_octree(folder: &Path) -> anyhow::Result<LightOctree> {
    let (volume, shape) = load(folder, "room_rgba128")?;
    let side = 1u32 << DEPTH;
    anyhow::ensure!(
        shape == [u64::from(side), u64::from(side), u64::from(side), 4],
        "room_rgba128.npy has the shape {shape:?}"
    );
    let mut leaves: Vec<(u32, [f32; 4])> = volume
        .chunks_exact(4)
        .enumerate()
        .filter(|(_, rgba)| rgba[3] > 0.0)
        .map(|(i, rgba)| {
            let i = i as u32;
            let key = octree::key_from_xyz([i / (side * side), i / side % side, i % side]);
            (key, [rgba[0], rgba[1], rgba[2], rgba[3]])
        })
        .collect();
    leaves.sort_unstable_by_key(|leaf| leaf.0);
    let (keys, rgba): (Vec<u32>, Vec<[f32; 4]>) = leaves.into_iter().unzip();
    let seen = vec![u8::MAX; keys.len()];
    Ok(LightOctree::from_leaves(keys, rgba, seen, CUBE, DEPTH, FULL_DEPTH)?)
}

fn probe(folder: &Path) -> anyhow::Result<Vec3> {
    #[derive(serde::Deserialize)]
    struct Input {
        probe_unit: [f32; 3],
    }
    let path = folder.join("input.json");
    let text = std::fs::read_to_string(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let input: Input =
        serde_json::from_str(&text).with_context(|| format!("{} has no valid probe_unit", path.display()))?;
    Ok(Vec3::from_array(input.probe_unit))
}

/// Estimates a scene from the built-in photo and renders one panorama.
fn estimate_panorama() -> anyhow::Result<Prepared> {
    let without = Estimator::without_networks();
    let run = move || {
        let scene = demo::frame()
            .and_then(|frame| demo::estimate(&mut Stages::new(true), Input::MeasuredDepth(frame), &without))
            .expect("the built-in photo gives a scene");
        let tracer = ConeTracer::new(&scene.light, Settings::default()).expect("the default settings are valid");
        black_box(tracer.panorama(Vec3::new(0.0, -0.5, -1.5), WIDTH, HEIGHT));
        Some(scene.light.rgba[FULL_DEPTH as usize..].iter().map(Vec::len).sum())
    };
    Ok(Prepared { run: Box::new(run) })
}

/// Renders one frame of an object of about 20,000 pixels in the built-in photo at 480 × 320, draft quality.
fn insert_draft() -> anyhow::Result<Prepared> {
    let mut scene =
        demo::estimate(&mut Stages::new(true), Input::MeasuredDepth(demo::frame()?), &Estimator::without_networks())?;
    scene.frame = cropped(&scene.frame.at_resolution(480, 360), 320)?;
    let model = demo::model("gold")?;
    let inserter = Inserter::new(&LitScene::as_estimated(scene.clone()), Lighting::Octree, Quality::Draft)?;
    let mut turn = 0.0;
    let base = Placement::rest_on_pixel(&scene, 240.0, 250.0, Align::Gravity)?.scaled(INSERT_SCALE);
    let run = move || {
        turn += 0.1;
        let composite = inserter
            .render(&[Instance::new(&model, base.turned(turn))], &mut events::ignore)
            .expect("the built-in mesh can be inserted");
        Some(composite.alpha.pixels().iter().filter(|alpha| **alpha > 0.0).count())
    };
    Ok(Prepared { run: Box::new(run) })
}

/// Scale of the built-in mesh at which it covers about 20,000 of 480 × 320 pixels, metres per unit.
const INSERT_SCALE: f32 = 0.8;

/// Crops a frame with photo and depth of one resolution to its central `height` rows.
fn cropped(frame: &Frame, height: usize) -> anyhow::Result<Frame> {
    fn rows<T: Copy>(image: &Image<T>, top: usize, height: usize) -> Image<T> {
        Image::from_fn(image.width(), height, |x, y| image[(x, y + top)])
    }
    let top = (frame.depth_m.height() - height) / 2;
    let photo = match &frame.photo {
        Photo::Linear(image) => Photo::Linear(rows(image, top, height)),
        photo => Photo::Srgb8(rows(&photo.srgb8(), top, height)),
    };
    let c = frame.camera;
    let camera = Camera::new(c.fx, c.fy, c.cx, c.cy - top as f64, c.width, height as u32)?;
    Ok(Frame::new(photo, rows(&frame.depth_m, top, height), camera, frame.exposure)?)
}
