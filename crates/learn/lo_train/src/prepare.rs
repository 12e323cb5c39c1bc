//! How each stage makes its examples, ahead of its steps.

use std::collections::HashMap;

use burn::tensor::{Device, Tensor, TensorData};
use lo_dataset::Sample;
use lo_nets::depth::panorama_image;
use lo_random::RngExt;

use crate::augmentation::{AugmentationConfig, Variation};
use crate::example::{DepthExample, ExpectedExample, KnownDepth, LightExample, RayCounts, Unusable};
use crate::learner::Learner;
use crate::phases::{DepthPhase, LightPhase};

/// For stage 1.
pub(crate) fn depth_examples(
    phase: &DepthPhase,
    augmentation: &AugmentationConfig,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<DepthExample, Unusable> + Send + use<> {
    let (width, augmentation) = (phase.photo_width, augmentation.clone());
    move |sample, epoch| {
        let (variation, variant) = augmentation.of(seed, sample, epoch);
        let example = DepthExample::new(sample, &variation, width)?;
        let mut stream = Variation::stream(seed, "style", sample, variant);
        Ok(DepthExample { photo: augmentation.style.apply(&example.photo, &mut stream), ..example })
    }
}

/// For stage 2: the light network's example, and the global lighting feature of the depth network as it is now.
pub(crate) fn light_examples(
    phase: &LightPhase,
    augmentation: &AugmentationConfig,
    learner: &Learner,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<(LightExample, Vec<f32>), Unusable> + Send + use<> {
    let (network, phase, augmentation) = (learner.network.clone(), phase.clone(), augmentation.clone());
    let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
    // The depth network does not change in this stage.
    let depth_net = learner.depth.average.clone();
    let mut features = HashMap::<(u64, u64), Vec<f32>>::new();
    move |sample, epoch| {
        let (variation, variant) = augmentation.of(seed, sample, epoch);
        let mut stream = Variation::stream(seed, "light example", sample, epoch);
        let shares = [phase.predicted_share, phase.sensor_share];
        let [predicted, sensor] = shares.map(|share| stream.random::<f32>() < share);
        let photo = || depth_net.network_input(&variation.photo(&sample.photo));
        let output = predicted.then(|| depth_net.forward(&[&photo()]));
        let predicted_m = output.as_ref().map(|output| output.depth_m(&variation.camera(&sample.camera)));
        let depth = match &predicted_m {
            Some(predicted_m) => KnownDepth::Predicted(predicted_m),
            None if sensor => KnownDepth::Sensor,
            None => KnownDepth::True,
        };
        let mut example = LightExample::new(sample, &variation, depth, &network, rays, &mut stream)?;
        let values = |global: Tensor<2>| global.into_data().iter().collect::<Vec<f32>>();
        let feature = || values(depth_net.global_feature(&photo()));
        let global = match output {
            Some(output) => values(output.global),
            None if augmentation.variants == 0 => feature(),
            None => features.entry((lo_random::hash(sample.id.as_bytes()), variant)).or_insert_with(feature).clone(),
        };
        let features = Tensor::from_data(TensorData::new(global.clone(), [1, global.len()]), &Device::flex());
        let map = panorama_image(depth_net.panorama.forward(features));
        example.input = example.input.with_up(example.up).with_map(map);
        Ok((example, global))
    }
}

/// For the network of expected light.
pub(crate) fn expected_examples(
    augmentation: &AugmentationConfig,
    learner: &Learner,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<ExpectedExample, Unusable> + Send + use<> {
    let (augmentation, depth_net) = (augmentation.clone(), learner.depth.average.clone());
    move |sample, epoch| ExpectedExample::new(sample, &augmentation.of(seed, sample, epoch).0, &depth_net)
}

/// For stage 3.
pub(crate) fn joint_examples(
    phase: &LightPhase,
    augmentation: &AugmentationConfig,
    learner: &Learner,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<JointExample, Unusable> + Send + use<> {
    let (network, phase, augmentation) = (learner.network.clone(), phase.clone(), augmentation.clone());
    let longer_side = learner.depth.net.longer_side();
    move |sample, epoch| {
        let variation = augmentation.of(seed, sample, epoch).0;
        let depth = DepthExample::new(sample, &variation, longer_side)?;
        let mut stream = Variation::stream(seed, "light example", sample, epoch);
        let (predicted, sensor) = (stream.random::<f32>(), stream.random::<f32>());
        let light = if predicted < phase.predicted_share {
            None
        } else {
            let known = if sensor < phase.sensor_share { KnownDepth::Sensor } else { KnownDepth::True };
            let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
            Some(LightExample::new(sample, &variation, known, &network, rays, &mut stream)?)
        };
        let sample = Sample { radiance: None, normal: None, albedo: None, ..sample.clone() };
        Ok(JointExample { sample, variation, epoch, depth, light })
    }
}

/// A sample whose light example has to wait for the depth network.
pub(crate) struct JointExample {
    pub sample: Sample,
    pub variation: Variation,
    pub epoch: u64,
    pub depth: DepthExample,
    /// Where depth is known already.
    pub light: Option<LightExample>,
}
