//! A baseline as a whole: its network, file of weights, losses and prediction.

use std::path::Path;

use burn::module::Module;
use burn::tensor::Device;
use lo_geometry::Camera;
use lo_imaging::Image;
use lo_nets::Networks;
use lo_nets::checkpoint::{Checkpoint, CheckpointError, Precision};
use lo_nets::conv::in_pool;
use lo_nets::depth::DepthNet;
use serde::{Deserialize, Serialize};

use crate::deeplight::DeepLightNet;
use crate::dense::Cells;
use crate::example::BaselineExample;
use crate::features::{FeatureBatch, FeatureShape, PhotoFeatures};
use crate::gardner::GardnerNet;
use crate::garon::GaronNet;
use crate::li::LiNet;
use crate::lighthouse::LighthouseNet;
use crate::losses::Losses;
use crate::nir::NirNet;
use crate::prediction::{CellLight, Prediction, SurfaceLight};
use crate::{BaselineError, System};

/// Name of a baseline's weights in a file, and of its description in the file's state.
pub const BASELINE: &str = "baseline";

/// Network of any system.
#[derive(Module, Debug)]
#[expect(clippy::large_enum_variant, reason = "there are few in a process, and a burn module cannot be boxed")]
pub enum BaselineNet {
    /// Gardner et al. 2017.
    Gardner(GardnerNet),
    /// Sengupta et al. 2019.
    Nir(NirNet),
    /// LeGendre et al. 2019.
    DeepLight(DeepLightNet),
    /// Garon et al. 2019.
    Garon(GaronNet),
    /// Li et al. 2020.
    Li(LiNet),
    /// Srinivasan et al. 2020.
    Lighthouse(LighthouseNet),
}

/// Description of the weights in their file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Description {
    system: System,
    features: FeatureShape,
    /// [`fingerprint`] of the depth network.
    depth_net: String,
}

/// A trained baseline.
#[derive(Clone, Debug)]
pub struct Baseline {
    net: BaselineNet,
    description: Description,
}

impl BaselineNet {
    /// Creates an untrained network for features of these channels, with weights drawn from `seed`.
    pub fn new(system: System, features: FeatureShape, seed: u64, device: &Device) -> Self {
        let stream = &mut lo_random::stream(seed, system.name(), 0);
        match system {
            System::Gardner2017 => Self::Gardner(GardnerNet::new(features, stream, device)),
            System::Nir2019 => Self::Nir(NirNet::new(features, stream, device)),
            System::DeepLight2019 => Self::DeepLight(DeepLightNet::new(features, stream, device)),
            System::Garon2019 => Self::Garon(GaronNet::new(features, stream, device)),
            System::Li2020 => Self::Li(LiNet::new(features, stream, device)),
            System::Lighthouse2020 => Self::Lighthouse(LighthouseNet::new(features, stream, device)),
        }
    }

    /// Returns the losses on photos of one size, on the network's device. `progress` is the share of training that is
    /// done.
    ///
    /// # Panics
    /// Without examples, with sizes that differ, and without probes where the system needs them.
    pub fn losses(&self, examples: &[&BaselineExample], progress: f32, device: &Device) -> Losses {
        let features: Vec<&PhotoFeatures> = examples.iter().map(|example| &example.features).collect();
        let batch = FeatureBatch::new(&features, device);
        match self {
            Self::Gardner(net) => net.losses(&batch, examples, progress),
            Self::Nir(net) => net.losses(&batch, examples),
            Self::DeepLight(net) => net.losses(&batch, examples),
            Self::Garon(net) => net.losses(&batch, examples),
            Self::Li(net) => net.losses(&batch, examples),
            Self::Lighthouse(net) => net.losses(&batch, examples, progress),
        }
    }

    /// Predicts the light of a photo with these features, on a network that records no gradients.
    pub fn predict(&self, features: &PhotoFeatures) -> Prediction {
        let batch = FeatureBatch::new(&[features], &Device::flex());
        let surface = |light: &dyn Fn(&Cells) -> Vec<CellLight>| {
            let points = features.surface().into_iter().map(|(_, point)| point).collect();
            Prediction::Surface(SurfaceLight { points, light: light(&Cells::of_photo(features.shown)) })
        };
        match self {
            Self::Gardner(net) => Prediction::Map(net.predict(&batch)),
            Self::Nir(net) => Prediction::Map(net.predict(&batch)),
            Self::DeepLight(net) => Prediction::Map(net.predict(&batch)),
            Self::Garon(net) => surface(&|cells| {
                let light = net.predict(&batch, cells);
                light.into_iter().map(|harmonics| CellLight::Harmonics(Box::new(harmonics))).collect()
            }),
            Self::Li(net) => {
                surface(&|cells| net.predict(&batch, cells).into_iter().map(CellLight::Gaussians).collect())
            }
            Self::Lighthouse(net) => Prediction::Volume(net.predict(&batch, features)),
        }
    }
}

/// Returns a hash of all weights of a depth network, hexadecimal, to recognise it.
pub fn fingerprint(depth_net: &DepthNet) -> String {
    let mut weights = Checkpoint::default();
    weights.add_module("", depth_net);
    let names: Vec<String> = weights.shapes().map(|(name, _)| name.to_owned()).collect();
    let values = names.iter().filter_map(|name| weights.values(name)).flatten();
    let hash = lo_random::hash(&values.flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>());
    format!("{hash:016x}")
}

impl Baseline {
    /// Wraps a trained network that records no gradients. `depth_net` is the [`fingerprint`] of the depth network.
    pub fn new(system: System, net: BaselineNet, features: FeatureShape, depth_net: String) -> Self {
        Self { net, description: Description { system, features, depth_net } }
    }

    /// Returns the system.
    pub fn system(&self) -> System {
        self.description.system
    }

    /// Adds weights and description to a checkpoint.
    pub fn add_to(&self, checkpoint: &mut Checkpoint) {
        checkpoint.add_module(BASELINE, &self.net);
        checkpoint.state[BASELINE] = serde_json::json!(self.description);
    }

    /// Writes a file of weights atomically.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn write(&self, path: &Path, precision: Precision) -> Result<(), CheckpointError> {
        let mut checkpoint = Checkpoint::default();
        self.add_to(&mut checkpoint);
        checkpoint.write(path, precision)
    }

    /// Reads a file of weights, or the checkpoint of a run, for prediction by the system `wanted`.
    ///
    /// # Errors
    /// Unreadable files; files of other networks or systems; weights that do not match.
    pub fn read(path: &Path, wanted: System) -> Result<Self, BaselineError> {
        let mut file = Checkpoint::read(path)?;
        if file.state[BASELINE].is_null() {
            return Err(BaselineError::NotABaseline { path: path.to_owned() });
        }
        let description = Description::deserialize(&file.state[BASELINE]).map_err(|error| {
            let problems = vec![format!("invalid description: {error}")];
            CheckpointError::Weights { module: BASELINE.to_owned(), problems }
        })?;
        if description.system != wanted {
            return Err(BaselineError::OtherSystem { path: path.to_owned(), found: description.system, wanted });
        }
        let blank = BaselineNet::new(wanted, description.features, 0, &Device::flex());
        Ok(Self { net: file.take_module(BASELINE, blank)?, description })
    }

    /// Predicts the light of an sRGB photo taken by `camera`, from features of the networks that it was trained with
    /// ([`check`](Self::check)).
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn predict(&self, networks: &Networks, photo: &Image<[u8; 3]>, camera: &Camera) -> Prediction {
        let features = PhotoFeatures::new(&networks.depth, photo, camera);
        in_pool(|| self.net.predict(&features))
    }

    /// Checks that the networks are those whose features the baseline was trained on.
    ///
    /// # Errors
    /// [`BaselineError::OtherFeatures`].
    pub fn check(&self, networks: &Networks) -> Result<(), BaselineError> {
        if fingerprint(&networks.depth) == self.description.depth_net {
            return Ok(());
        }
        Err(BaselineError::OtherFeatures { system: self.system() })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_nets::depth::EncoderKind;
    use lo_nets::light::LightNetConfig;
    use lo_nets::{Adam, LIGHT_NET};

    use super::*;
    use crate::testing::{SHAPE, example, recording_device};

    #[test]
    fn training_lowers_the_loss_of_every_system() {
        let examples = [example(1), example(2)];
        let batch = [&examples[0], &examples[1]];
        for system in System::ALL {
            let device = recording_device();
            let mut net = BaselineNet::new(system, SHAPE, 3, &device);
            let mut adam = Adam::default();
            let total = |net: &BaselineNet| net.losses(&batch, 0.0, &device).total();
            let value = |net: &BaselineNet| total(net).inner().into_scalar::<f32>();
            let before = value(&net);
            let steps = if system == System::Lighthouse2020 { 10 } else { 60 };
            for _ in 0..steps {
                let gradients = total(&net).backward();
                net = adam.step(net, &gradients, 3e-3);
            }
            let after = value(&net);
            let share = if system == System::Lighthouse2020 { 0.95 } else { 0.7 };
            assert!(after < share * before, "{system}: {before} {after}");
        }
    }

    #[test]
    fn a_file_is_of_one_system_and_of_one_depth_network() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.safetensors");
        let config = LightNetConfig {
            depth: 5,
            full_depth: 3,
            channels: 8,
            max_channels: 16,
            global_features: 9,
            ..Default::default()
        };
        let networks = |seed| Networks::new(EncoderKind::EfficientNetLite0, &config, seed, &Device::flex()).unwrap();
        let (own, other) = (networks(1), networks(2));
        let photo = Image::from_fn(96, 64, |x, y| [(2 * x) as u8, (3 * y) as u8, 90]);
        let camera = Camera::from_hfov_deg(70.0, 96, 64).unwrap();
        let shape = PhotoFeatures::new(&own.depth, &photo, &camera).shape();
        for system in System::ALL {
            let net = BaselineNet::new(system, shape, 5, &Device::flex());
            let baseline = Baseline::new(system, net, shape, fingerprint(&own.depth));
            baseline.write(&path, Precision::Full).unwrap();
            let read = Baseline::read(&path, system).unwrap();
            let light = |baseline: &Baseline| baseline.predict(&own, &photo, &camera);
            assert_eq!(light(&read), light(&baseline), "{system}");
            let radiance = light(&read).radiance(lo_geometry::Vec3::ZERO, &[lo_geometry::Vec3::Y]);
            assert!(radiance[0].iter().all(|v| v.is_finite() && *v >= 0.0), "{system}: {radiance:?}");
            assert_eq!(matches!(light(&read), Prediction::Map(_)), !system.is_local());
            read.check(&own).unwrap();
            let error = read.check(&other).unwrap_err().to_string();
            assert!(error.contains("trained on the image features of other weights"), "{error}");
        }
        let error = Baseline::read(&path, System::Garon2019).unwrap_err().to_string();
        assert!(error.ends_with("the weights of lighthouse2020, not of garon2019"), "{error}");
        own.write(&path, Precision::Half).unwrap();
        assert!(!Checkpoint::read(&path).unwrap().state[LIGHT_NET].is_null());
        let error = Baseline::read(&path, System::Li2020).unwrap_err().to_string();
        assert!(error.contains("not the weights of a baseline"), "{error}");
    }
}
