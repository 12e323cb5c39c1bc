use std::sync::Arc;

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use lo_dual::GraphNode;
use lo_octree::Octree;
use lo_random::Stream;

use crate::graph::{Activation, GraphLevel, RowMap, select_rows};
use crate::layers::{DownSample, GraphConv, Head, Linear, Norm, ResBlock, UpSample};
use crate::light::channels::columns::CARRIER;
use crate::light::channels::{LOBE_CHANNELS, RAW_CHANNELS};
use crate::light::growth::{Occupancy, close_sides, max_splits};
use crate::light::lobes::lobes;
use crate::light::radiance::RAW_BIAS;
use crate::light::{
    Growth, LevelOutput, LightConfigError, LightError, LightInput, LightNetConfig, LightOutput, NODE_FEATURES,
    NodeLight, ObservedLight,
};

/// Initial logit of a node's occupancy: most of a room is air.
const SPLIT_BIAS: f32 = -2.0;

/// Light network: a U-Net over dual octree graphs whose decoder grows its own octree (Wang et al. 2022).
#[derive(Module, Debug)]
pub struct LightNet {
    /// Projection of `f_L`, appended to a node's features.
    pub global: Linear,
    /// Convolution from node features to the finest stage's channels.
    pub input: GraphConv,
    /// Normalisation of its output.
    pub input_norm: Norm,
    /// Encoder stages, the finest first.
    pub encoder: Vec<BlockStage>,
    /// Layers between the encoder's stages, the finest first.
    pub down: Vec<DownSample>,
    /// Layers between the decoder's stages, the coarsest first.
    pub up: Vec<UpSample>,
    /// Decoder stages after the coarsest, the coarsest first.
    pub decoder: Vec<BlockStage>,
    /// Occupancy heads, for each depth from the full depth on.
    pub prediction: Vec<Head>,
    /// Heads of radiance, opacity and error, for each depth from the full depth on.
    pub regression: Vec<Head>,
    full_depth: usize,
    max_nodes: usize,
    /// Logit of a fixed share of the single map, where the network does not predict it.
    fixed_map_share: Option<f64>,
}

/// A stage of residual blocks.
#[derive(Module, Debug)]
pub struct BlockStage {
    /// Blocks in order.
    pub blocks: Vec<ResBlock>,
}

impl BlockStage {
    fn new(config: &LightNetConfig, depth: u32, stream: &mut Stream, device: &Device) -> Self {
        let channels = config.stage_channels(depth);
        let size = [channels, channels / config.bottleneck];
        let block = |_| ResBlock::new(size, config.depths(depth), config.channels_per_group, stream, device);
        Self { blocks: (0..config.blocks).map(block).collect() }
    }

    /// `[nodes, channels] → [nodes, channels]`.
    pub fn forward(&self, x: Tensor<2>, level: &Arc<GraphLevel>) -> Tensor<2> {
        self.blocks.iter().fold(x, |x, block| block.forward(x, level))
    }
}

impl LightNet {
    /// Creates a network with weights drawn from `seed`.
    ///
    /// # Errors
    /// Names the configuration field that is out of range.
    pub fn new(config: &LightNetConfig, seed: u64, device: &Device) -> Result<Self, LightConfigError> {
        config.validate()?;
        let mut stream = lo_random::stream(seed, "light network", 0);
        let stream = &mut stream;
        let groups = config.channels_per_group;
        let width = |depth| config.stage_channels(depth);
        let stages: Vec<u32> = config.stages().collect();
        let inputs = NODE_FEATURES + config.global_channels;
        let own = if config.map_share.is_some() { RAW_CHANNELS - 1 } else { RAW_CHANNELS };
        let raw_bias: Vec<f32> =
            RAW_BIAS[..own].iter().copied().chain([0.0; LOBE_CHANNELS]).take(config.raw_channels()).collect();
        let head = |depth, bias: &[f32], stream: &mut Stream| {
            Head::new([width(depth), config.head_channels], bias, groups, stream, device)
        };
        Ok(Self {
            global: Linear::new([config.global_features, config.global_channels], stream, device),
            input: GraphConv::new([inputs, width(config.depth)], config.depths(config.depth), stream, device),
            input_norm: Norm::new(width(config.depth), groups, device),
            encoder: stages.iter().rev().map(|&depth| BlockStage::new(config, depth, stream, device)).collect(),
            down: (stages.windows(2).rev())
                .map(|pair| DownSample::new([width(pair[1]), width(pair[0])], groups, stream, device))
                .collect(),
            up: (stages.windows(2))
                .map(|pair| UpSample::new([width(pair[0]), width(pair[1])], groups, stream, device))
                .collect(),
            decoder: stages[1..].iter().map(|&depth| BlockStage::new(config, depth, stream, device)).collect(),
            prediction: stages.iter().map(|&depth| head(depth, &[SPLIT_BIAS], stream)).collect(),
            regression: stages.iter().map(|&depth| head(depth, &raw_bias, stream)).collect(),
            full_depth: config.full_depth as usize,
            max_nodes: config.node_budget(),
            fixed_map_share: config.map_share.map(|share| {
                let share = f64::from(share).clamp(1e-6, 1.0 - 1e-6);
                (share / (1.0 - share)).ln()
            }),
        })
    }

    /// Predicts the light of the whole room from the observations and an optional `f_L` `[1, features]`.
    ///
    /// # Errors
    /// An input or a true octree of other depths than the network's; predictions that are not finite.
    pub fn forward(
        &self,
        input: &LightInput,
        global: Option<Tensor<2>>,
        growth: Growth,
    ) -> Result<LightOutput, LightError> {
        self.check_depths("the input", &input.octree)?;
        if let Growth::Truth(truth) = growth {
            self.check_depths("the octree to grow along", truth)?;
        }
        let skips = self.encode(input, global);
        self.decode(input, skips, growth)
    }

    /// Returns the device of the weights.
    pub fn device(&self) -> Device {
        self.input.weights.val().device()
    }

    fn depth(&self) -> u32 {
        (self.full_depth + self.up.len()) as u32
    }

    fn check_depths(&self, what: &'static str, octree: &Octree) -> Result<(), LightError> {
        let (got_full, got) = (octree.full_depth(), octree.depth());
        let (full, depth) = (self.full_depth as u32, self.depth());
        if (got_full, got) == (full, depth) {
            Ok(())
        } else {
            Err(LightError::Depths { what, got_full, got, full, depth })
        }
    }

    /// Returns the features of the encoder's stages, the coarsest first.
    fn encode(&self, input: &LightInput, global: Option<Tensor<2>>) -> Vec<Tensor<2>> {
        let weights = self.input.weights.val();
        let options = (&weights.device(), weights.dtype());
        let finest = &input.levels[input.levels.len() - 1];
        let features = TensorData::new(input.features.clone(), [finest.len(), NODE_FEATURES]);
        let features = Tensor::<2>::from_data(features, options);
        let carried = match global {
            // Adds `f_L` to nodes in proportion to their share of carriers.
            Some(global) => {
                let share = features.clone().slice([0..finest.len(), CARRIER..CARRIER + 1]);
                share.matmul(self.global.forward(global))
            }
            None => Tensor::zeros([finest.len(), self.global.weights.dims()[1]], options),
        };
        let x = self.input.forward(Tensor::cat(vec![features, carried], 1), finest);
        let mut x = self.input_norm.forward(x, Activation::Relu);
        let mut skips = Vec::new();
        for (i, level) in input.levels.iter().rev().enumerate() {
            x = self.encoder[i].forward(x, level);
            skips.push(x.clone());
            if let Some(down) = self.down.get(i) {
                x = down.forward(x, level);
            }
        }
        skips.reverse();
        skips
    }

    fn decode(&self, input: &LightInput, skips: Vec<Tensor<2>>, growth: Growth) -> Result<LightOutput, LightError> {
        let mut octree = Octree::full(self.full_depth as u32)?;
        let mut level = GraphLevel::full(&octree);
        let (mut levels, mut warnings) = (Vec::new(), Vec::new());
        let mut skips = skips.into_iter();
        let mut x = skips.next().expect("the coarsest stage");
        for (stage, depth) in (self.full_depth as u32..=self.depth()).enumerate() {
            if stage > 0 {
                x = self.up[stage - 1].forward(x, &level);
                let skip = skips.next().expect("one for each stage");
                x = x + select_rows(skip, &same_nodes(&input.octree, &input.levels[stage], &octree, &level));
                x = self.decoder[stage - 1].forward(x, &level);
            }
            let finest = RowMap::new((level.graph.first_finest() as u32..level.len() as u32).map(Some), level.len());
            let own = select_rows(x.clone(), &finest);
            let logits = self.prediction[stage].forward(own.clone());
            let last = depth == self.depth();
            let occupancy = match growth {
                Growth::Truth(truth) => Occupancy::from_truth(truth, depth),
                Growth::Predicted => {
                    let logits: Vec<f32> = logits.clone().inner().into_data().iter::<f32>().collect();
                    if !logits.iter().all(|logit| logit.is_finite()) {
                        return Err(LightError::NotFinite { what: "split predictions", depth });
                    }
                    let splits = self.max_nodes.saturating_sub(level.len()) / 7;
                    let max_count = || max_splits(splits, &input.visible.octree, depth, self.depth());
                    Occupancy::predicted(&logits, &octree, input, if last { usize::MAX } else { max_count() })
                }
            };
            warnings.extend(occupancy.warning);
            let mut nonempty = occupancy.nonempty.clone();
            if stage == 0 && matches!(growth, Growth::Predicted) {
                close_sides(&mut nonempty, depth, input);
            }
            octree.set_nonempty(&nonempty)?;
            let observed = ObservedLight::of_level(&octree, depth, input);
            let occupied = (0..nonempty.len() as u32).filter(|&node| nonempty[node as usize]);
            let raw = select_rows(own, &RowMap::new(occupied.map(Some), finest.len()));
            let raw = self.regression[stage].forward(raw);
            let raw = match self.fixed_map_share {
                Some(share) => with_column(raw, RAW_CHANNELS - 1, share),
                None => raw,
            };
            let mut light = NodeLight(observed.clone()).apply(raw.clone().narrow(1, 0, RAW_CHANNELS));
            if raw.dims()[1] > RAW_CHANNELS {
                light = Tensor::cat(vec![light, lobes(raw.narrow(1, RAW_CHANNELS, LOBE_CHANNELS), &observed)], 1);
            }
            levels.push(LevelOutput { logits, light, observed });
            if !last {
                octree.grow(&occupancy.nonempty)?;
                level = level.extended(&octree);
            }
        }
        Ok(LightOutput { octree, cube: input.cube(), levels, warnings })
    }
}

/// Inserts a column of `value` before column `at` of `x[rows, columns]`.
fn with_column(x: Tensor<2>, at: usize, value: f64) -> Tensor<2> {
    let [rows, columns] = x.dims();
    let column = Tensor::full([rows, 1], value, (&x.device(), x.dtype()));
    let before = x.clone().narrow(1, 0, at);
    let parts = if columns > at { vec![before, column, x.narrow(1, at, columns - at)] } else { vec![before, column] };
    Tensor::cat(parts, 1)
}

/// Matches the nodes of one octree's graph to those of another, for skip connections.
fn same_nodes(from: &Octree, from_level: &GraphLevel, to: &Octree, to_level: &GraphLevel) -> Arc<RowMap> {
    let keys = |octree: &Octree, level: &GraphLevel| -> Vec<(u32, u32)> {
        let key = |node: &GraphNode| (node.depth, octree.levels()[node.depth as usize].keys[node.index as usize]);
        level.graph.nodes().iter().map(key).collect()
    };
    // Both are sorted by depth and key.
    let mut sources = (0..).zip(keys(from, from_level)).peekable();
    let sources = keys(to, to_level).into_iter().map(|wanted| {
        while sources.next_if(|(_, key)| *key < wanted).is_some() {}
        sources.next_if(|(_, key)| *key == wanted).map(|(row, _)| row)
    });
    RowMap::new(sources, from_level.len())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use burn::module::{ModuleMapper, ModuleVisitor, Param};
    use burn::tensor::{DType, Gradients};
    use lo_cone::{Cone, ConeTracer, Settings};
    use lo_geometry::{Camera, Cube, Vec3};
    use lo_imaging::RadianceImage;
    use lo_octree::{LightOctree, MAX_ALPHA, Provenance, RadiancePoint};

    use super::*;
    use crate::layers::glorot;
    use crate::light::{LightLossConfig, LightLosses, NetworkWarning, Rays, VisiblePoint};
    use crate::testing::{numbers, recording_device, values};

    fn config(depth: u32) -> LightNetConfig {
        let small = LightNetConfig {
            channels: 8,
            max_channels: 16,
            blocks: 1,
            bottleneck: 2,
            head_channels: 8,
            ..Default::default()
        };
        LightNetConfig { depth, full_depth: 3, global_features: 4, global_channels: 2, ..small }
    }

    /// The inside of a box-shaped room, each wall in its own colour.
    fn room() -> (Vec<RadiancePoint>, Cube) {
        let point = |i: u32| {
            let [u, v] = [0.754_877_7, 0.569_840_3f64].map(|a| (2.0 * (0.5 + a * f64::from(i)).fract() - 1.0) as f32);
            let face = i as usize % 6;
            let mut p = [3.1 * u, 2.9 * v, if face < 3 { -2.7 } else { 2.7 }];
            p.rotate_right(face % 3);
            let radiance = std::array::from_fn(|c| 0.2 + 0.3 * ((face + c) % 3) as f32);
            RadiancePoint { position_m: Vec3::from(p), radiance, provenance: Provenance::Inferred }
        };
        ((0..20_000).map(point).collect(), Cube::centred(Vec3::ZERO, 8.0))
    }

    fn input(config: &LightNetConfig) -> (LightInput, LightOctree) {
        let (points, cube) = room();
        let camera = Camera::from_hfov_deg(80.0, 48, 32).unwrap();
        let in_view = |p: &&RadiancePoint| {
            camera.project(p.position_m).is_some_and(|(u, v, _)| (0.0..48.0).contains(&u) && (0.0..32.0).contains(&v))
        };
        let visible = |p: &RadiancePoint| VisiblePoint {
            position_m: p.position_m,
            radiance: p.radiance,
            normal: Vec3::ZERO,
            certain: true,
        };
        let seen: Vec<VisiblePoint> = points.iter().filter(in_view).map(visible).collect();
        let truth = LightOctree::from_points(&points, cube, config.depth, config.full_depth).unwrap().0;
        (LightInput::new(&seen, &camera, cube, config, 7).unwrap(), truth)
    }

    #[test]
    fn untrained_networks_close_the_room() {
        let config = config(5);
        let (input, _) = input(&config);
        let output =
            LightNet::new(&config, 3, &Device::flex()).unwrap().forward(&input, None, Growth::Predicted).unwrap();
        let (light, _) = output.into_light().unwrap();
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        for place in [Vec3::ZERO, Vec3::new(1.5, -1.0, 1.8)] {
            let opacity = tracer.panorama(place, 64, 32).opacity;
            let least = opacity.pixels().iter().fold(1.0f32, |least, &opacity| least.min(opacity));
            assert!(least > 0.9, "{least} from {place}");
        }
    }

    #[test]
    fn untrained_networks_keep_observed_light() {
        let config = config(5);
        let (input, truth) = input(&config);
        let net = LightNet::new(&config, 3, &Device::flex()).unwrap();
        let output = net.forward(&input, None, Growth::Truth(&truth.octree)).unwrap();
        let (light, confidence) = output.into_light().unwrap();
        assert_eq!(light.octree, truth.octree);
        assert!(light.rgba[5].iter().all(|rgba| rgba[3] == MAX_ALPHA), "the initial opacity is 0.98");
        let finest = &light.octree.levels()[5];
        let mut seen = 0;
        for (node, &row) in finest.rows.iter().enumerate().filter(|(_, row)| **row >= 0) {
            if light.seen[5][row as usize] == 255 {
                let known = input.visible.octree.find(5, finest.keys[node]).unwrap();
                let expected = input.visible.node_rgba(5, known).unwrap();
                let got = light.rgba[5][row as usize];
                assert!(got.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{got:?} {expected:?}");
                seen += 1;
            }
        }
        assert!(seen > 50, "{seen} leaves are seen");
        assert!(confidence.iter().flatten().all(|&c| c > 0.0 && c <= 1.0));
        assert_eq!(
            confidence.iter().map(Vec::len).collect::<Vec<_>>(),
            light.rgba.iter().map(Vec::len).collect::<Vec<_>>()
        );
    }

    #[test]
    fn growth_respects_the_budget_and_is_deterministic() {
        let config = LightNetConfig { max_nodes: Some(4000), ..config(6) };
        let (input, _) = input(&config);
        let net = LightNet::new(&config, 3, &Device::flex()).unwrap();
        let mut all_split = net.clone();
        for head in &mut all_split.prediction {
            head.output = Linear::constant(config.head_channels, &[5.0], &Device::flex());
        }
        let output = all_split.forward(&input, None, Growth::Predicted).unwrap();
        let nodes = GraphLevel::all(&output.octree).pop().unwrap().len();
        assert!(nodes <= 4000 + 3 * 7, "{nodes}");
        let over = |warning: &NetworkWarning| matches!(warning, NetworkWarning::NodeBudget { .. });
        assert!(output.warnings.iter().any(over), "{:?}", output.warnings);
        let (visible, grown) = (&input.visible.octree, &output.octree);
        let kept = |depth: u32| {
            let level = &visible.levels()[depth as usize];
            let occupied = level.keys.iter().zip(&level.rows).filter(|(_, row)| **row >= 0);
            occupied.map(|(&key, _)| grown.find(depth, key).is_some()).collect::<Vec<bool>>()
        };
        assert!((3..=6).flat_map(kept).all(|kept| kept), "observed nodes are kept");
        let run = || net.forward(&input, None, Growth::Predicted).unwrap().into_light().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
        assert_eq!(run(), pool.install(run), "independent of the thread count");
    }

    /// Randomises the last layers of the heads: they start at 0, which blocks gradients and gives lobes no direction.
    fn with_random_heads(mut net: LightNet, device: &Device) -> LightNet {
        let mut stream = lo_random::stream(4, "test", 0);
        for head in net.prediction.iter_mut().chain(&mut net.regression) {
            let [inputs, outputs] = head.output.weights.dims();
            head.output.weights = glorot([inputs, outputs], [inputs, outputs], &mut stream, device);
        }
        net
    }

    #[test]
    fn lobes_are_evaluated_from_each_rays_origin() {
        let config = LightNetConfig { lobes: true, ..config(5) };
        let (input, truth) = input(&config);
        let net = with_random_heads(LightNet::new(&config, 3, &Device::flex()).unwrap(), &Device::flex());
        let output = net.forward(&input, None, Growth::Truth(&truth.octree)).unwrap();
        let apexes = [Vec3::ZERO, Vec3::new(0.9, -0.7, 1.1)];
        let cone = |origin: Vec3, direction: Vec3| Cone { origin, direction, tan_half_angle: 0.02 };
        let cones: Vec<Cone> =
            lo_geometry::fibonacci_sphere(300).into_iter().flat_map(|d| apexes.map(|apex| cone(apex, d))).collect();
        let found = numbers(output.rendered(&cones, Settings::default()).unwrap());
        let levels: Vec<Vec<f64>> = output.levels.iter().map(|level| numbers(level.light.clone())).collect();
        let (mut light, _) = output.into_light().unwrap();
        // Restores the opacities that `into_light` rounded up.
        for (rgba, level) in light.rgba[3..].iter_mut().zip(&levels) {
            rgba.iter_mut().zip(level.chunks(8)).for_each(|(rgba, row)| rgba[3] = row[3] as f32);
        }
        let plain = LightOctree { lobes: None, ..light.clone() };
        // Mean relative difference from tracing the finished octree.
        let difference = |light: &LightOctree| {
            let tracers = apexes.map(|apex| ConeTracer::new(&light.seen_from(apex), Settings::default()).unwrap());
            let expected = cones.iter().enumerate().map(|(i, cone)| f64::from(tracers[i % 2].trace(cone).radiance[1]));
            let pairs: Vec<(f64, f64)> = expected.enumerate().map(|(i, e)| (found[5 * i + 1], e)).collect();
            pairs.iter().map(|(a, b)| (a - b).abs()).sum::<f64>() / pairs.iter().map(|(_, b)| b).sum::<f64>()
        };
        assert!(difference(&light) < 1e-4, "{}", difference(&light));
        assert!(difference(&plain) > 0.02, "{}", difference(&plain));
    }

    /// Converts parameters to f64 and perturbs one of them.
    struct Wide {
        nudged: Option<(usize, usize, f64)>,
        visited: usize,
    }

    impl ModuleMapper for Wide {
        fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
            let (id, tensor, mapper) = param.consume();
            let (device, dims) = (tensor.device(), tensor.dims());
            let mut values = numbers(tensor.inner());
            if let Some((_, index, step)) = self.nudged.filter(|(parameter, ..)| *parameter == self.visited) {
                values[index] += step;
            }
            self.visited += 1;
            let wide = Tensor::from_data(TensorData::new(values, dims), (&device, DType::F64));
            let wide = if device.is_autodiff() { wide.require_grad() } else { wide };
            Param::from_mapped_value(id, wide, mapper)
        }
    }

    /// Collects the gradients of all parameters.
    struct Gather<'a>(&'a Gradients, Vec<Vec<f64>>);

    impl ModuleVisitor for Gather<'_> {
        fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
            self.1.push(param.val().grad(self.0).map(numbers).unwrap_or_default());
        }
    }

    #[test]
    fn gradients_of_the_whole_network_equal_finite_differences() {
        let config = LightNetConfig { channels: 4, max_channels: 8, ..config(5) };
        gradients_equal_finite_differences(&config);
        gradients_equal_finite_differences(&LightNetConfig { map_share: Some(0.25), ..config.clone() });
        gradients_equal_finite_differences(&LightNetConfig { lobes: true, ..config.clone() });
        gradients_equal_finite_differences(&LightNetConfig { lobes: true, map_share: Some(0.25), ..config });
    }

    fn gradients_equal_finite_differences(config: &LightNetConfig) {
        let (input, truth) = input(config);
        let device = recording_device();
        let net = with_random_heads(LightNet::new(config, 3, &device).unwrap(), &device);
        let loss = |net: &LightNet| {
            let weights = net.input.weights.val();
            let (device, dtype) = (weights.device(), weights.dtype());
            let constant = |rows: usize, columns: usize, seed| {
                Tensor::<2>::from_data(TensorData::new(values(rows * columns, seed), [rows, columns]), (&device, dtype))
            };
            let output = net.forward(&input, Some(constant(1, 4, 1)), Growth::Truth(&truth.octree)).unwrap();
            let parts = output.levels.into_iter().flat_map(|level| [level.logits, level.light]).map(|part| {
                let [rows, columns] = part.dims();
                (part * constant(rows, columns, 2)).sum()
            });
            parts.reduce(|a, b| a + b).unwrap()
        };
        let wide = net.clone().map(&mut Wide { nudged: None, visited: 0 });
        let gradients = loss(&wide).backward();
        let mut gather = Gather(&gradients, Vec::new());
        wide.visit(&mut gather);
        let at = |parameter: usize, index: usize, step: f64| {
            let moved = net.valid().map(&mut Wide { nudged: Some((parameter, index, step)), visited: 0 });
            numbers(loss(&moved).inner())[0]
        };
        for (parameter, got) in gather.1.iter().enumerate() {
            let largest = got.iter().fold(0.0f64, |a, b| a.max(b.abs()));
            let index = (0..got.len()).max_by(|&a, &b| got[a].abs().total_cmp(&got[b].abs())).unwrap();
            let expected = (at(parameter, index, 1e-6) - at(parameter, index, -1e-6)) / 2e-6;
            assert!((got[index] - expected).abs() <= 1e-5 * largest, "{parameter}: {} {expected}", got[index]);
        }
    }

    #[test]
    fn training_step_does_not_depend_on_thread_count() {
        let config = config(5);
        let (input, truth) = input(&config);
        let cone = |direction| Cone { origin: Vec3::ZERO, direction, tan_half_angle: 0.02 };
        let rays: Rays = lo_geometry::fibonacci_sphere(3000).into_iter().map(|d| (cone(d), [0.4; 3], 2.5)).collect();
        let run = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let net = LightNet::new(&config, 3, &recording_device()).unwrap();
                let output = net.forward(&input, None, Growth::Truth(&truth.octree)).unwrap();
                let none = std::iter::empty().collect();
                let losses = LightLosses::new(&output, &truth, &rays, &none, Settings::default()).unwrap();
                let gradients = losses.total(&LightLossConfig::default()).backward();
                let mut gather = Gather(&gradients, Vec::new());
                net.visit(&mut gather);
                gather.1
            })
        };
        assert_eq!(run(1), run(3));
    }

    #[test]
    fn fixed_map_share_equals_the_predicted_one() {
        let learned = config(5);
        let (input, truth) = input(&learned);
        let map = RadianceImage::from_fn(16, 8, |x, _| [0.5 + x as f32; 3]);
        let input = input.with_map(map);
        let light = |map_share| {
            let config = LightNetConfig { map_share, ..learned.clone() };
            let net = LightNet::new(&config, 3, &Device::flex()).unwrap();
            numbers(net.forward(&input, None, Growth::Truth(&truth.octree)).unwrap().levels.pop().unwrap().light)
        };
        let close = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-3 * (1.0 + b.abs()));
        assert!(close(&light(None), &light(Some(0.4))), "the initial share");
        assert!(!close(&light(None), &light(Some(0.9))));
    }

    #[test]
    fn another_cubes_truth_is_refused() {
        let config = config(5);
        let (input, mut truth) = input(&config);
        let net = LightNet::new(&config, 3, &Device::flex()).unwrap();
        let output = net.forward(&input, None, Growth::Truth(&truth.octree)).unwrap();
        truth.cube.edge_m += 1.0;
        let none: Rays = std::iter::empty().collect();
        let error = LightLosses::new(&output, &truth, &none, &none, Settings::default()).unwrap_err();
        assert!(matches!(error, LightError::Cubes { .. }), "{error}");
    }

    #[test]
    fn empty_input_is_valid_and_wrong_depths_are_named() {
        let config = config(5);
        let camera = Camera::from_hfov_deg(80.0, 48, 32).unwrap();
        let nothing = LightInput::new(&[], &camera, Cube::centred(Vec3::ZERO, 8.0), &config, 7).unwrap();
        let net = LightNet::new(&config, 3, &Device::flex()).unwrap();
        let (light, _) = net.forward(&nothing, None, Growth::Predicted).unwrap().into_light().unwrap();
        assert!(light.rgba[5].iter().all(|row| row.iter().all(|v| v.is_finite())));
        let deeper = LightNetConfig { depth: 6, ..config };
        let (input, _) = input(&deeper);
        let error = net.forward(&input, None, Growth::Predicted).unwrap_err();
        assert!(error.to_string().contains("depths 3 to 6"), "{error}");
    }
}
