//! Both networks as they are shipped and used: one file of weights that says what they are.

use std::path::Path;

use burn::tensor::{Device, Tensor};
use lo_events::Warning;
use lo_geometry::{Camera, Cube, Perspective, PerspectiveFit, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::{LightOctree, RadiancePoint};
use serde::Deserialize;

use crate::checkpoint::{Checkpoint, CheckpointError, Precision};
use crate::conv::in_pool;
use crate::depth::{DepthNet, DepthNetConfig, EncoderKind, panorama_image};
use crate::expected::{ExpectedLightGuess, ExpectedLightNet, PhotoStatistics};
use crate::flat::flattened;
use crate::light::{
    Growth, LightConfigError, LightError, LightInput, LightNet, LightNetConfig, PhotoView, SeenDetail, VisiblePoint,
};
use crate::second_look;

/// The depth network's name in a checkpoint, and in the checkpoint's state that of what says which encoder it has.
pub const DEPTH_NET: &str = "depth_net";
/// The light network's name in a checkpoint, and its configuration's in the checkpoint's state.
pub const LIGHT_NET: &str = "light_net";
/// Name of the network of expected light in a checkpoint.
pub const EXPECTED_NET: &str = "expected_light";

/// The depth and the light network, which share the global lighting feature.
///
/// What of it speaks of tensors, devices and checkpoints is for training, and hidden from the documentation of the facade.
#[derive(Debug)]
pub struct Networks {
    /// Depth and global light from a photo.
    #[doc(hidden)]
    pub depth: DepthNet,
    /// The room's light from what is seen.
    #[doc(hidden)]
    pub light: LightNet,
    /// The energy of the light around a photo; `None` in weights that have not learned it.
    #[doc(hidden)]
    pub expected: Option<ExpectedLightNet>,
    /// Shape of the light network; also gives the length of the global lighting feature of both.
    pub config: LightNetConfig,
}

/// What a photo tells of the light outside of it: `f_L`.
#[derive(Clone, Debug)]
pub struct GlobalLight(Tensor<2>);

/// What the networks tell of a photo before anything is known of the room.
#[derive(Debug)]
pub struct PhotoGuess {
    /// Metres along the optical axis, with at most [`DepthNet::longer_side`] pixels on the longer side.
    pub depth_m: DepthMap,
    /// The light around it.
    pub light: GlobalLight,
    /// How its camera was held, where the networks have learned that.
    pub held: Option<PerspectiveFit>,
}

/// What is seen of a room.
#[derive(Clone, Copy, Debug)]
pub struct SeenRoom<'a> {
    /// What the cameras see, the points of one after those of another, in the first camera's axes.
    pub points: &'a [VisiblePoint],
    /// The cameras.
    pub views: &'a [PhotoView],
    /// Part of the world that the octree covers.
    pub cube: Cube,
    /// Unit vector against gravity.
    pub up: Vec3,
}

/// The light of a whole room.
#[derive(Clone, Debug, PartialEq)]
pub struct CompletedLight {
    /// Radiance and opacity, and what the photo saw of each node.
    pub light: LightOctree,
    /// `confidence[d][row]` of each node, in (0, 1]: e^−(expected error of log(1 + radiance)).
    pub confidence: Vec<Vec<f32>>,
    /// What was not done as predicted.
    pub warnings: Vec<Warning>,
}

impl Networks {
    /// Untrained networks with weights drawn from `seed`.
    ///
    /// # Errors
    /// A configuration out of range, with the field's name.
    #[doc(hidden)]
    pub fn new(
        encoder: EncoderKind,
        config: &LightNetConfig,
        seed: u64,
        device: &Device,
    ) -> Result<Self, LightConfigError> {
        let light = LightNet::new(config, seed, device)?;
        Ok(Self {
            depth: DepthNet::new(encoder, config.global_features, seed, device),
            light,
            expected: None,
            config: config.clone(),
        })
    }

    /// Adds the weights of both networks, and to the checkpoint's state the encoder and the light network's configuration.
    #[doc(hidden)]
    pub fn add_to(&self, checkpoint: &mut Checkpoint) {
        checkpoint.add_module(DEPTH_NET, &self.depth);
        checkpoint.add_module(LIGHT_NET, &self.light);
        if let Some(expected) = &self.expected {
            checkpoint.add_module(EXPECTED_NET, expected);
        }
        checkpoint.state[DEPTH_NET] = serde_json::json!(self.depth.config());
        checkpoint.state[LIGHT_NET] = serde_json::json!(self.config);
    }

    /// The networks of a checkpoint; what else it holds does not matter.
    ///
    /// # Errors
    /// Says which configuration is missing or wrong, and which weights are missing, too much or of another shape.
    #[doc(hidden)]
    pub fn from_checkpoint(mut checkpoint: Checkpoint, device: &Device) -> Result<Self, CheckpointError> {
        let problem = |module: &str, what| CheckpointError::Weights { module: module.to_owned(), problems: vec![what] };
        let config = &checkpoint.state[LIGHT_NET];
        let wrong = |what: String| problem(LIGHT_NET, what);
        if config.is_null() {
            return Err(wrong("the file's metadata holds no configuration of that name".to_owned()));
        }
        let depth_config = &checkpoint.state[DEPTH_NET];
        let mut config = config.clone();
        // What was a choice once, files of that time say; networks that did without are no more.
        let knows_up = config.as_object_mut().and_then(|fields| fields.remove("knows_up"));
        if depth_config.is_null() || depth_config["colour"] == false || knows_up == Some(false.into()) {
            return Err(problem(DEPTH_NET, OF_BEFORE.to_owned()));
        }
        let depth_config = DepthNetConfig::deserialize(depth_config)
            .map_err(|error| problem(DEPTH_NET, format!("its configuration: {error}")))?;
        if !LONGER_SIDES.contains(&depth_config.longer_side) {
            let side = depth_config.longer_side;
            return Err(problem(DEPTH_NET, format!("its configuration: longer_side is {side}")));
        }
        let config: LightNetConfig =
            serde_json::from_value(config).map_err(|error| wrong(format!("its configuration: {error}")))?;
        config.validate().map_err(|error| wrong(format!("its configuration: {error}")))?;
        let (described, held) = (config.weights(), checkpoint.values_of(LIGHT_NET));
        // A few bytes must not make us allocate gigabytes.
        if described > 2 * held {
            return Err(wrong(format!("its configuration describes {described} weights, but the file holds {held}")));
        }
        let light = LightNet::new(&config, 0, device).map_err(|error| wrong(format!("its configuration: {error}")))?;
        let light = checkpoint.take_module(LIGHT_NET, light)?;
        let depth = checkpoint.take_module(DEPTH_NET, depth_config.blank(config.global_features, device))?;
        let learned = checkpoint.values_of(EXPECTED_NET) > 0;
        let expected = || checkpoint.take_module(EXPECTED_NET, ExpectedLightNet::new(0, device));
        let expected = learned.then(expected).transpose()?;
        Ok(Self { depth, light, expected, config })
    }

    /// Reads a file of weights, of whichever precision, for use: without gradients, on the CPU.
    ///
    /// # Errors
    /// Of the file, and of [`Networks::from_checkpoint`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        Self::from_checkpoint(Checkpoint::read(path)?, &Device::flex())
    }

    /// [`Networks::read`] of a file's bytes; messages call it `name`.
    ///
    /// # Errors
    /// As of a file.
    pub fn from_bytes(bytes: &[u8], name: &str) -> Result<Self, CheckpointError> {
        Self::from_checkpoint(Checkpoint::from_bytes(bytes, name)?, &Device::flex())
    }

    /// Writes a file of weights, whole or not at all.
    ///
    /// # Errors
    /// The file system's.
    pub fn write(&self, path: impl AsRef<Path>, precision: Precision) -> Result<(), CheckpointError> {
        let mut checkpoint = Checkpoint::default();
        self.add_to(&mut checkpoint);
        checkpoint.write(path, precision)
    }

    /// Depth in an sRGB photo that this camera made, the light around it, and how the camera was held.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn guess(&self, photo: &Image<[u8; 3]>, camera: &Camera) -> PhotoGuess {
        in_pool(|| {
            let output = self.depth.forward(&[&self.depth.network_input(photo)]);
            let second = self.depth.forward(&[&self.second_picture(photo)]);
            let depth_m = second_look::mean_depth(&output.depth_m(camera), &second.depth_m(camera));
            let depth_m = flattened(&second_look::without_grain(&depth_m), camera);
            let field = output.field().with_mirrored(&second.field());
            let held = Perspective::fit(&field, Some(camera.half_extent()));
            PhotoGuess { depth_m, light: GlobalLight(output.global), held }
        })
    }

    /// The expected light around a linear photo with its depth, camera and the unit vector against gravity in the camera's axes; `None` where the weights
    /// have not learned it.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn expected_light(
        &self,
        photo: &RadianceImage,
        depth_m: &DepthMap,
        camera: &Camera,
        up: Vec3,
    ) -> Option<ExpectedLightGuess> {
        let net = self.expected.as_ref()?;
        in_pool(|| Some(net.guess(&PhotoStatistics::new(photo, depth_m, camera, up))))
    }

    /// The light around an sRGB photo whose depth is known.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn global_light(&self, photo: &Image<[u8; 3]>) -> GlobalLight {
        in_pool(|| GlobalLight(self.depth.global_feature(&self.depth.network_input(photo))))
    }

    /// The light around an sRGB photo whose depth is known, and how its camera was held, by its lens ([`Camera::half_extent`]); that `None` where the
    /// weights are of before networks learned it. By one look of the encoder for both, and a second one for the camera.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn light_and_camera(&self, photo: &Image<[u8; 3]>, half_extent: f64) -> (GlobalLight, Option<PerspectiveFit>) {
        in_pool(|| {
            let (global, field) = self.depth.beside_depth(&self.depth.network_input(photo));
            let second = self.depth.perspective_field(&self.second_picture(photo));
            (GlobalLight(global), Perspective::fit(&field.with_mirrored(&second), Some(half_extent)))
        })
    }

    /// How the camera of an sRGB photo was held and its lens, with the lens that is known, if one is ([`Camera::half_extent`]); `None` where the
    /// weights are of before networks learned it.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn perspective(&self, photo: &Image<[u8; 3]>, half_extent: Option<f64>) -> Option<PerspectiveFit> {
        in_pool(|| {
            let field = self.depth.perspective_field(&self.depth.network_input(photo));
            let second = self.depth.perspective_field(&self.second_picture(photo));
            Perspective::fit(&field.with_mirrored(&second), half_extent)
        })
    }

    /// What the second look sees.
    fn second_picture(&self, photo: &Image<[u8; 3]>) -> Image<[u8; 3]> {
        second_look::picture(photo, self.depth.longer_side())
    }

    /// The panorama at the camera that the global lighting decoder makes of an sRGB photo, its centre along the camera's view.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn single_map(&self, photo: &Image<[u8; 3]>) -> RadianceImage {
        let global = self.global_light(photo).0;
        in_pool(|| panorama_image(self.depth.panorama.forward(global)))
    }

    /// The light of the whole room, the octree grown by the network's own predictions.
    ///
    /// `global` is the first camera's. What is guessed, is guessed from what the first camera sees. `seed` places the points that carry the global light. Where `octree_depth` is greater than the network's own depth, what
    /// is seen is that fine, and what is not ends above it.
    ///
    /// # Errors
    /// Points that are not finite; predictions that are not; a depth that no octree can have.
    ///
    /// # Panics
    /// Where the views have more points than there are.
    pub fn complete(
        &self,
        seen: &SeenRoom<'_>,
        global: GlobalLight,
        octree_depth: u32,
        seed: u64,
    ) -> Result<CompletedLight, LightError> {
        let &SeenRoom { points, views, cube, up } = seen;
        in_pool(|| {
            let input = LightInput::of_photos(points, views, cube, &self.config, seed)?;
            let map = panorama_image(self.depth.panorama.forward(global.0.clone()));
            let input = self.config.told(input, up, map);
            let mut output = self.light.forward(&input, Some(global.0), Growth::Predicted)?;
            let warnings = std::mem::take(&mut output.warnings);
            let (mut light, mut confidence) = output.into_light()?;
            if octree_depth > self.config.depth {
                let points: Vec<RadiancePoint> = points.iter().map(VisiblePoint::radiance_point).collect();
                let (fine, _) = LightOctree::from_points(&points, cube, octree_depth, self.config.full_depth)?;
                let detail = SeenDetail { coarse: &input.visible, fine: &fine, free: &input.free };
                detail.refine(&mut light, &mut confidence)?;
            }
            Ok(CompletedLight { light, confidence, warnings })
        })
    }
}

/// What is said of files of networks that did without the photo's colour or gravity.
const OF_BEFORE: &str =
    "the file is of networks of before 26 November 2026, which did not know the photo's colour and gravity; train anew";

/// Pixels on the longer side that photos may be looked at in; more costs memory that a file of weights must not ask for.
const LONGER_SIDES: std::ops::RangeInclusive<usize> = 32..=1024;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::checkpoint::FORMAT_VERSION;

    fn config() -> LightNetConfig {
        let small = LightNetConfig { depth: 5, full_depth: 3, channels: 8, max_channels: 16, ..Default::default() };
        LightNetConfig { blocks: 1, bottleneck: 2, head_channels: 8, global_features: 6, ..small }
    }

    fn camera(photo: &Image<[u8; 3]>) -> Camera {
        Camera::from_hfov_deg(70.0, photo.width() as u32, photo.height() as u32).unwrap()
    }

    fn checkpoint(config: &LightNetConfig, seed: u64) -> Checkpoint {
        let mut checkpoint = Checkpoint::default();
        Networks::new(EncoderKind::default(), config, seed, &Device::flex()).unwrap().add_to(&mut checkpoint);
        checkpoint
    }

    fn refusal(checkpoint: &Checkpoint) -> String {
        Networks::from_checkpoint(checkpoint.clone(), &Device::flex()).unwrap_err().to_string()
    }

    #[test]
    fn a_file_of_weights_comes_back_in_both_precisions() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.safetensors");
        let networks = Networks::new(EncoderKind::default(), &config(), 3, &Device::flex()).unwrap();
        let photo = Image::from_fn(64, 32, |x, y| [(3 * x) as u8, (7 * y) as u8, 90]);
        let depth_m = networks.guess(&photo, &camera(&photo)).depth_m;
        networks.write(&path, Precision::Full).unwrap();
        let read = Networks::read(&path).unwrap();
        assert_eq!((&read.config, read.guess(&photo, &camera(&photo)).depth_m), (&config(), depth_m.clone()));
        networks.write(&path, Precision::Half).unwrap();
        let half = Networks::read(&path).unwrap().guess(&photo, &camera(&photo)).depth_m;
        let close = |(a, b): (&f32, &f32)| (a / b).ln().abs() < 0.05;
        assert!(half != depth_m && half.pixels().iter().zip(depth_m.pixels()).all(close));
        let state = Checkpoint::read(&path).unwrap().state;
        assert_eq!((FORMAT_VERSION, &state["light_net"]["depth"]), (1, &serde_json::json!(5)));
    }

    #[test]
    fn networks_of_before_are_refused_by_their_names() {
        let mut old = checkpoint(&config(), 3);
        old.state[DEPTH_NET]["colour"] = serde_json::json!(false);
        let error = refusal(&old);
        assert!(error.contains("\"depth_net\"") && error.contains("of before"), "{error}");
        old.state[DEPTH_NET] = serde_json::Value::Null;
        assert_eq!(refusal(&old), error);
        let mut chosen = checkpoint(&config(), 3);
        chosen.state[LIGHT_NET]["knows_up"] = serde_json::json!(false);
        assert_eq!(refusal(&chosen), error);
        chosen.state[LIGHT_NET]["knows_up"] = serde_json::json!(true);
        assert_eq!(Networks::from_checkpoint(chosen, &Device::flex()).unwrap().config, config());
    }

    #[test]
    fn light_alone_is_that_beside_depth() {
        let networks = Networks::new(EncoderKind::default(), &config(), 3, &Device::flex()).unwrap();
        let photo = Image::from_fn(70, 41, |x, y| [(3 * x) as u8, (7 * y) as u8, 90]);
        let [beside, alone] = [networks.guess(&photo, &camera(&photo)).light, networks.global_light(&photo)];
        assert_eq!(beside.0.into_data(), alone.0.into_data());
    }

    #[test]
    fn the_configuration_knows_the_number_of_weights() {
        for config in [config(), LightNetConfig { full_depth: 5, ..config() }, LightNetConfig::default()] {
            let mut checkpoint = Checkpoint::default();
            checkpoint.add_module(LIGHT_NET, &LightNet::new(&config, 1, &Device::flex()).unwrap());
            assert_eq!(config.weights(), checkpoint.values_of(LIGHT_NET));
        }
    }

    #[test]
    fn weights_of_something_else_are_named() {
        let whole = checkpoint(&config(), 1);
        let error = refusal(&Checkpoint::default());
        assert!(error.contains("\"light_net\"") && error.contains("no configuration"), "{error}");
        let with = |key: &str, value: serde_json::Value| {
            let mut other = whole.clone();
            other.state[LIGHT_NET][key] = value;
            refusal(&other)
        };
        let error = with("blocks", serde_json::json!(16));
        assert!(error.contains("describes") && error.contains("the file holds"), "{error}");
        let error = with("depth", serde_json::json!(12));
        assert!(error.contains("depth is 12"), "{error}");
        let error = with("colour", serde_json::json!("red"));
        assert!(error.contains("colour"), "{error}");
        let error = with("global_features", serde_json::json!(7));
        assert!(error.contains("\"light_net.global.weights\" has the shape [6, 8], not [7, 8]"), "{error}");
        let mut huge = whole.clone();
        huge.state[DEPTH_NET]["longer_side"] = serde_json::json!(100_000);
        assert!(refusal(&huge).contains("longer_side is 100000"), "{}", refusal(&huge));
        let mut more = whole.clone();
        more.insert("light_net.hat", &[2], vec![0.0; 2]);
        assert!(refusal(&more).contains("\"light_net.hat\" is not part of it"));
        let mut light_only = Checkpoint::default();
        light_only.state = whole.state.clone();
        light_only.add_module(LIGHT_NET, &LightNet::new(&config(), 1, &Device::flex()).unwrap());
        let error = refusal(&light_only);
        assert!(error.contains("\"depth_net.encoder.conv0.weight\" is missing") && error.contains("more"), "{error}");
    }
}
