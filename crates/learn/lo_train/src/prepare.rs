//! Functions that prepare the examples of each stage on the background thread.

use std::collections::HashMap;

use burn::tensor::{Device, Tensor, TensorData};
use lo_dataset::Sample;
use lo_nets::depth::panorama_image;
use lo_random::RngExt;

use crate::augmentation::{AugmentationConfig, Variation};
use crate::example::{DepthExample, DepthSource, ExpectedExample, LightExample, RayCounts, UnusableSample};
use crate::learner::Learner;
use crate::phases::{DepthPhase, LightPhase};

/// Prepares examples of stage 1.
pub(crate) fn depth_examples(
    phase: &DepthPhase,
    augmentation: &AugmentationConfig,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<DepthExample, UnusableSample> + Send + use<> {
    let (width, augmentation) = (phase.photo_width, augmentation.clone());
    move |sample, epoch| {
        let (variation, variant) = augmentation.variation(seed, sample, epoch);
        let example = DepthExample::new(sample, &variation, width)?;
        let mut stream = Variation::stream(seed, "style", sample, variant);
        Ok(DepthExample { photo: augmentation.style.apply(&example.photo, &mut stream), ..example })
    }
}

/// Prepares examples of stage 2: the light network's example with the depth network's global lighting feature.
pub(crate) fn light_examples(
    phase: &LightPhase,
    augmentation: &AugmentationConfig,
    learner: &Learner,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<(LightExample, Vec<f32>), UnusableSample> + Send + use<> {
    let (network, phase, augmentation) = (learner.network.clone(), phase.clone(), augmentation.clone());
    let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
    // The depth network is fixed in this stage.
    let depth_net = learner.depth.average.clone();
    let mut features = HashMap::<(u64, u64), Vec<f32>>::new();
    move |sample, epoch| {
        let (variation, variant) = augmentation.variation(seed, sample, epoch);
        let mut stream = Variation::stream(seed, "light example", sample, epoch);
        let shares = [phase.predicted_share, phase.sensor_share];
        let [predicted, sensor] = shares.map(|share| stream.random::<f32>() < share);
        let photo = || depth_net.network_input(&variation.photo(&sample.photo));
        let output = predicted.then(|| depth_net.forward(&[&photo()]));
        let predicted_m = output.as_ref().map(|output| output.depth_m(&variation.camera(&sample.camera)));
        let depth = match &predicted_m {
            Some(predicted_m) => DepthSource::Predicted(predicted_m),
            None if sensor => DepthSource::Sensor,
            None => DepthSource::True,
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

/// Prepares examples of the network of expected light.
pub(crate) fn expected_examples(
    augmentation: &AugmentationConfig,
    learner: &Learner,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<ExpectedExample, UnusableSample> + Send + use<> {
    let (augmentation, depth_net) = (augmentation.clone(), learner.depth.average.clone());
    move |sample, epoch| ExpectedExample::new(sample, &augmentation.variation(seed, sample, epoch).0, &depth_net)
}

/// Prepares examples of stage 3.
pub(crate) fn joint_examples(
    phase: &LightPhase,
    augmentation: &AugmentationConfig,
    learner: &Learner,
    seed: u64,
) -> impl FnMut(&Sample, u64) -> Result<JointExample, UnusableSample> + Send + use<> {
    let (network, phase, augmentation) = (learner.network.clone(), phase.clone(), augmentation.clone());
    let longer_side = learner.depth.net.longer_side();
    move |sample, epoch| {
        let variation = augmentation.variation(seed, sample, epoch).0;
        let depth = DepthExample::new(sample, &variation, longer_side)?;
        let mut stream = Variation::stream(seed, "light example", sample, epoch);
        let (predicted, sensor) = (stream.random::<f32>(), stream.random::<f32>());
        let light = if predicted < phase.predicted_share {
            None
        } else {
            let known = if sensor < phase.sensor_share { DepthSource::Sensor } else { DepthSource::True };
            let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
            Some(LightExample::new(sample, &variation, known, &network, rays, &mut stream)?)
        };
        let sample = Sample { radiance: None, normal: None, albedo: None, ..sample.clone() };
        Ok(JointExample { sample, variation, epoch, depth, light })
    }
}

/// An example of stage 3. With predicted depth, its light example is made in the training step.
pub(crate) struct JointExample {
    pub sample: Sample,
    pub variation: Variation,
    pub epoch: u64,
    pub depth: DepthExample,
    /// `None` if depth is to be predicted.
    pub light: Option<LightExample>,
}
