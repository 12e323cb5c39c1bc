//! Sizes of both networks, counted from the shapes of their weights: tables of `docs/method.md` §4.3 and §5.9.
//!
//! `cargo test --release -p lo_train --test it size -- --ignored --nocapture` prints the tables.

use std::collections::BTreeMap;

use burn::module::Module;
use lo_dataset::{Generator, GeneratorConfig};
use lo_geometry::{Cube, Vec3};
use lo_imaging::Image;
use lo_nets::Device;
use lo_nets::checkpoint::Checkpoint;
use lo_nets::depth::{DepthNet, EncoderKind};
use lo_nets::graph::GraphLevel;
use lo_nets::light::{LightInput, LightNet, LightNetConfig, VisiblePoint};
use lo_octree::LightOctree;

/// Size of one part of a network.
#[derive(Clone, Copy, Default)]
struct Cost {
    parameters: usize,
    /// Multiplications plus additions for one photo.
    operations: usize,
}

/// Returns the costs by part. `rows` maps a tensor to its part and the number of rows or pixels that it is applied to.
fn costs(module: &impl Module, rows: impl Fn(&[&str], &[usize]) -> (String, usize)) -> BTreeMap<String, Cost> {
    let mut checkpoint = Checkpoint::default();
    checkpoint.add_module("net", module);
    let mut costs = BTreeMap::<String, Cost>::new();
    for (name, shape) in checkpoint.shapes() {
        let path: Vec<&str> = name.split('.').skip(1).collect();
        if path.last().is_some_and(|last| last.starts_with("running")) {
            continue;
        }
        let (part, rows) = rows(&path, shape);
        let values: usize = shape.iter().product();
        let cost = costs.entry(part).or_default();
        cost.parameters += values;
        // Matrices and kernels only; scales and biases are not counted.
        if matches!(path.last(), Some(&"weight" | &"weights")) {
            cost.operations += 2 * values * rows;
        }
    }
    costs
}

fn index(part: &str) -> usize {
    part.parse().unwrap()
}

/// Blocks of EfficientNet-Lite2 after the first, by output resolution: 1/4, 1/8, 1/16, 1/32. The first block of each
/// halves the resolution after its expansion.
const LITE2_BLOCKS: [usize; 4] = [3, 3, 8, 6];

/// Returns the costs of the depth network for a photo of this size.
fn depth_costs(net: &DepthNet, [width, height]: [usize; 2]) -> BTreeMap<String, Cost> {
    let pixels = |scale: usize| width.div_ceil(scale) * height.div_ceil(scale);
    let scales = LITE2_BLOCKS.iter().zip([4, 8, 16, 32]);
    let lite2: Vec<usize> = scales.flat_map(|(&blocks, scale)| vec![scale; blocks]).collect();
    let encoder = |scale: usize| format!("{} encoder 1/{scale}", scale.ilog2());
    costs(net, |path, _| match path {
        ["encoder", "conv0" | "norm0" | "stem" | "first", ..] => (encoder(2), pixels(2)),
        ["encoder", "blocks", i, "expand", ..] => {
            let halves = index(i) == 0 || lite2[index(i) - 1] != lite2[index(i)];
            (encoder(lite2[index(i)]), pixels(lite2[index(i)] >> u32::from(halves)))
        }
        ["encoder", "blocks", i, "reduce", ..] => (encoder(lite2[index(i)]), pixels(lite2[index(i)])),
        ["encoder", "blocks" | "transitions", i, ..] => (encoder(4 << index(i)), pixels(4 << index(i))),
        ["encoder", ..] => (encoder(32), pixels(32)),
        ["decoder", "stages", i, ..] => {
            let scale = 16 >> index(i);
            (format!("{} decoder 1/{scale}", 6 + index(i)), pixels(scale))
        }
        ["decoder", ..] => ("Z decoder 1/1".into(), pixels(1)),
        ["perspective", ..] => ("Z camera".into(), pixels(8)),
        ["global", "conv", ..] => ("Z global light".into(), pixels(32)),
        ["global", ..] => ("Z global light".into(), 1),
        // Runs in training, and once per photo for the light network.
        ["panorama", "stages", i, ..] => ("Z panorama".into(), (16 << index(i)) * (8 << index(i))),
        ["panorama", "output", ..] => ("Z panorama".into(), 64 * 128),
        ["panorama", ..] => ("Z panorama".into(), 1),
        other => panic!("{other:?} belongs to no part"),
    })
}

/// Returns the costs of the light network; `input` has the graphs of visible points, `grown` is the completed room.
fn light_costs(
    net: &LightNet,
    config: &LightNetConfig,
    input: &LightInput,
    grown: &LightOctree,
) -> BTreeMap<String, Cost> {
    let levels = GraphLevel::all(&grown.octree);
    let (seen, last) = (&input.levels, levels.len() - 1);
    let split = |levels: &[std::sync::Arc<GraphLevel>], stage: usize| {
        levels[stage].refinement.as_ref().map_or(0, |refinement| refinement.split.len())
    };
    let part = |kind: &str, stage: usize| format!("{kind} {}", config.full_depth as usize + stage);
    // Products with one-hot node depths are computed once per distinct depth only.
    let graph_conv = |rows: usize, stage: usize, shape: &[usize]| {
        let types = if stage > 0 { stage + 1 } else { 0 };
        rows * shape[0].saturating_sub(7 * types) / shape[0]
    };
    costs(net, |path, shape| match path {
        ["global", ..] => ("input".into(), 1),
        ["input", ..] => ("input".into(), graph_conv(seen[last].len(), last, shape)),
        ["input_norm", ..] => ("input".into(), 0),
        ["encoder", i, ..] => {
            let stage = last - index(i);
            (part("encoder", stage), graph_conv(seen[stage].len(), stage, shape))
        }
        ["down", i, "weights"] => (part("encoder", last - index(i)), split(seen, last - index(i))),
        ["down", i, ..] => (part("encoder", last - index(i)), seen[last - index(i) - 1].len()),
        ["up", i, "weights"] => (part("decoder", index(i) + 1), split(&levels, index(i) + 1)),
        ["up", i, ..] => (part("decoder", index(i) + 1), levels[index(i) + 1].len()),
        ["decoder", i, ..] => {
            let stage = index(i) + 1;
            (part("decoder", stage), graph_conv(levels[stage].len(), stage, shape))
        }
        [heads @ ("prediction" | "regression"), i, ..] => {
            let level = &grown.octree.levels()[config.full_depth as usize + index(i)];
            (part("heads", index(i)), if *heads == "prediction" { level.len() } else { level.nonempty })
        }
        other => panic!("{other:?} belongs to no part"),
    })
}

fn total(costs: &BTreeMap<String, Cost>) -> Cost {
    costs.values().fold(Cost::default(), |sum, cost| Cost {
        parameters: sum.parameters + cost.parameters,
        operations: sum.operations + cost.operations,
    })
}

fn print(costs: &BTreeMap<String, Cost>) {
    for (part, cost) in costs.iter().chain([(&"total".to_owned(), &total(costs))]) {
        println!("| {part} | {} | {:.3} |", cost.parameters, cost.operations as f64 / 1e9);
    }
}

/// Returns the parameters, and the multiplications in 10⁹ for a square photo of this side.
fn encoder_size(kind: EncoderKind, side: usize) -> (usize, f64) {
    let costs = depth_costs(&DepthNet::new(kind, 64, 1, &Device::flex()), [side, side]);
    let encoder: BTreeMap<String, Cost> = costs.into_iter().filter(|(part, _)| part.contains("encoder")).collect();
    (total(&encoder).parameters, total(&encoder).operations as f64 / 2e9)
}

#[test]
fn encoders_have_the_published_sizes() {
    // torchvision's model card: 7,978,856 parameters, 2.83 G multiplications; without the classifier's
    // 1024 · 1000 + 1000.
    let (parameters, multiplications) = encoder_size(EncoderKind::DenseNet121, 224);
    assert_eq!(parameters, 7_978_856 - 1_025_000);
    assert!((multiplications - 2.83).abs() < 0.02, "{multiplications}");
    // TensorFlow's model card of EfficientNet-Lite2: 6.1 million parameters, 0.86 G multiplications at 260 × 260;
    // without the head's convolution 352 · 1280 on 9 × 9 pixels, its norm, and the classifier's 1280 · 1000 + 1000.
    let (parameters, multiplications) = encoder_size(EncoderKind::EfficientNetLite2, 260);
    let head = 352 * 1280 + 2 * 1280 + 1280 * 1000 + 1000;
    assert!((parameters + head).abs_diff(6_100_000) < 50_000, "{parameters}");
    let head = (352 * 1280 * 81 + 1280 * 1000) as f64 / 1e9;
    assert!((multiplications + head - 0.86).abs() < 0.02, "{multiplications}");
}

#[test]
#[ignore = "prints tables; see the head of the file"]
fn tables() {
    println!("depth network, 320 × 214\n| part | parameters | GFLOP |\n| --- | --- | --- |");
    print(&depth_costs(&DepthNet::new(EncoderKind::EfficientNetLite2, 64, 1, &Device::flex()), [320, 214]));
    // The shipped network's widths, and the default ones.
    for (depth, channels) in [(6, 64), (7, 32), (8, 32)] {
        let config = LightNetConfig { depth, channels, ..LightNetConfig::default() };
        let settings = GeneratorConfig { shots: 1, panoramas: 1, octree_depth: depth, ..GeneratorConfig::default() };
        let sample = Generator::new(7, settings).unwrap().record(0).unwrap().sample(0);
        let photo = Image::from_fn(sample.photo.width(), sample.photo.height(), |x, y| {
            sample.photo[(x, y)].map(lo_imaging::linear_from_srgb8)
        });
        let depth_m = sample.depth_m.as_ref().unwrap();
        let seen = VisiblePoint::from_photo(&photo, depth_m, sample.normal.as_ref(), &sample.camera, 0.99);
        let positions = || sample.points.iter().map(|p| p.position_m);
        let (low, high) = (positions().reduce(Vec3::min).unwrap(), positions().reduce(Vec3::max).unwrap());
        let cube = Cube::centred(0.5 * (low + high), 1.02 * (high - low).max_element());
        let input = LightInput::new(&seen, &sample.camera, cube, &config, 7).unwrap();
        let truth = LightOctree::from_points(&sample.points, cube, depth, config.full_depth).unwrap().0;
        let nodes = |levels: &[std::sync::Arc<GraphLevel>]| levels.iter().map(|l| l.len()).collect::<Vec<_>>();
        let (seen, whole) = (nodes(&input.levels), nodes(&GraphLevel::all(&truth.octree)));
        println!(
            "\nlight network, d = {depth}, {channels} channels: graph nodes from depth 4, visible {seen:?}, room {whole:?}"
        );
        println!("| part | parameters | GFLOP |\n| --- | --- | --- |");
        let net = LightNet::new(&config, 1, &Device::flex()).unwrap();
        let costs = light_costs(&net, &config, &input, &truth);
        assert_eq!(total(&costs).parameters as u64, config.weights());
        print(&costs);
    }
}
