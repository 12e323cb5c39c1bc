//! The shipped networks, loaded from one self-describing file of weights.

use std::path::Path;

use burn::tensor::{Device, Tensor};
use lo_geometry::{Camera, Cube, Perspective, PerspectiveFit, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::{LightOctree, RadiancePoint};
use serde::Deserialize;

use crate::checkpoint::{Checkpoint, CheckpointError, Precision};
use crate::conv::in_pool;
use crate::depth::{DepthNet, DepthNetConfig, EncoderKind, panorama_image};
use crate::expected::{ExpectedLight, ExpectedLightNet, PhotoStatistics};
use crate::light::{
    Growth, LightConfigError, LightError, LightInput, LightNet, LightNetConfig, NetworkWarning, ObservedDetail,
    PhotoView, VisiblePoint,
};
use crate::plane_snapping::snap_to_planes;
use crate::test_time_augmentation;

/// Name of the depth network in a checkpoint, and of its configuration in the checkpoint's state.
pub const DEPTH_NET: &str = "depth_net";
/// Name of the light network in a checkpoint, and of its configuration in the checkpoint's state.
pub const LIGHT_NET: &str = "light_net";
/// Name of the expected-light network in a checkpoint.
pub const EXPECTED_NET: &str = "expected_light";

/// Depth, light and expected-light networks. The first two share the global lighting feature.
///
/// Items about tensors, devices and checkpoints serve training. They are hidden from the facade's documentation.
#[derive(Debug)]
pub struct Networks {
    /// Predicts depth and global light from a photo.
    #[doc(hidden)]
    pub depth: DepthNet,
    /// Predicts the room's light from the observed surfaces.
    #[doc(hidden)]
    pub light: LightNet,
    /// Predicts expected light around a photo. `None` in weights that were not trained for it.
    #[doc(hidden)]
    pub expected: Option<ExpectedLightNet>,
    /// Shape of the light network, including the length of the global lighting feature.
    pub config: LightNetConfig,
}

/// Global lighting feature `f_L`: the light outside of a photo, as inferred from it.
#[derive(Clone, Debug)]
pub struct GlobalLight(Tensor<2>);

/// Predictions from a single photo.
#[derive(Debug)]
pub struct PhotoPrediction {
    /// Metres along the optical axis, with at most [`DepthNet::longer_side`] pixels on the longer side.
    pub depth_m: DepthMap,
    /// Global light around the photo.
    pub light: GlobalLight,
    /// Camera orientation and lens. `None` where the networks were not trained to predict them.
    pub perspective: Option<PerspectiveFit>,
}

/// Observed surfaces of a room, and the cameras that observed them.
#[derive(Clone, Copy, Debug)]
pub struct ObservedRoom<'a> {
    /// Visible points in the axes of the first camera, grouped by camera in the order of `views`.
    pub points: &'a [VisiblePoint],
    /// The cameras.
    pub views: &'a [PhotoView],
    /// Part of the world that the octree covers.
    pub cube: Cube,
    /// Unit vector against gravity.
    pub up: Vec3,
}

/// Completed light of a whole room.
#[derive(Clone, Debug, PartialEq)]
pub struct CompletedLight {
    /// Radiance and opacity, with the observed share of each node.
    pub light: LightOctree,
    /// `confidence[d][row]` of each node, in (0, 1]: e^−(expected error of log(1 + radiance)).
    pub confidence: Vec<Vec<f32>>,
    /// Deviations from the prediction.
    pub warnings: Vec<NetworkWarning>,
}

impl Networks {
    /// Creates untrained networks with weights drawn from `seed`.
    ///
    /// # Errors
    /// Names the configuration field that is out of range.
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

    /// Adds the weights, and to the checkpoint's state the configurations of the depth and the light network.
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

    /// Builds the networks from a checkpoint and ignores its other content.
    ///
    /// # Errors
    /// Names the configuration that is missing or wrong, and the weights that are missing, surplus or of another shape.
    #[doc(hidden)]
    pub fn from_checkpoint(mut checkpoint: Checkpoint, device: &Device) -> Result<Self, CheckpointError> {
        let problem = |module: &str, what| CheckpointError::Weights { module: module.to_owned(), problems: vec![what] };
        let config = &checkpoint.state[LIGHT_NET];
        let wrong = |what: String| problem(LIGHT_NET, what);
        if config.is_null() {
            return Err(wrong("the file's metadata has no configuration of that name".to_owned()));
        }
        let depth_config = &checkpoint.state[DEPTH_NET];
        let mut config = config.clone();
        // Older files store this former option. Networks with `false` are no longer supported.
        let knows_up = config.as_object_mut().and_then(|fields| fields.remove("knows_up"));
        if depth_config.is_null() || depth_config["colour"] == false || knows_up == Some(false.into()) {
            return Err(problem(DEPTH_NET, OUTDATED_WEIGHTS.to_owned()));
        }
        let depth_config = DepthNetConfig::deserialize(depth_config)
            .map_err(|error| problem(DEPTH_NET, format!("invalid configuration: {error}")))?;
        if !LONGER_SIDES.contains(&depth_config.longer_side) {
            let (side, least, most) = (depth_config.longer_side, LONGER_SIDES.start(), LONGER_SIDES.end());
            return Err(problem(
                DEPTH_NET,
                format!("invalid configuration: longer_side is {side}; it must be between {least} and {most}"),
            ));
        }
        let config: LightNetConfig =
            serde_json::from_value(config).map_err(|error| wrong(format!("invalid configuration: {error}")))?;
        config.validate().map_err(|error| wrong(format!("invalid configuration: {error}")))?;
        let (described, held) = (config.weights(), checkpoint.values_of(LIGHT_NET));
        // Small files must not cause allocations of gigabytes.
        if described > 2 * held {
            return Err(wrong(format!("the configuration describes {described} weights, but the file has {held}")));
        }
        let light =
            LightNet::new(&config, 0, device).map_err(|error| wrong(format!("invalid configuration: {error}")))?;
        let light = checkpoint.take_module(LIGHT_NET, light)?;
        let depth = checkpoint.take_module(DEPTH_NET, depth_config.blank(config.global_features, device))?;
        let learned = checkpoint.values_of(EXPECTED_NET) > 0;
        let expected = || checkpoint.take_module(EXPECTED_NET, ExpectedLightNet::new(0, device));
        let expected = learned.then(expected).transpose()?;
        Ok(Self { depth, light, expected, config })
    }

    /// Reads a file of weights of either precision for inference: without gradients, on the CPU.
    ///
    /// # Errors
    /// Files that cannot be read, and those of [`Networks::from_checkpoint`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, CheckpointError> {
        Self::from_checkpoint(Checkpoint::read(path)?, &Device::flex())
    }

    /// Reads weights that consist of files in memory, as [`Networks::read`] does from one file. Error messages use the
    /// names as paths.
    ///
    /// # Errors
    /// As [`Networks::read`], and files that overlap.
    pub fn from_parts(parts: &[(&str, &[u8])]) -> Result<Self, CheckpointError> {
        let parts: Vec<_> =
            parts.iter().map(|(name, bytes)| Checkpoint::from_bytes(bytes, name)).collect::<Result<_, _>>()?;
        Self::from_checkpoint(Checkpoint::joined(parts)?, &Device::flex())
    }

    /// Writes a file of weights atomically.
    ///
    /// # Errors
    /// Errors of the file system.
    pub fn write(&self, path: impl AsRef<Path>, precision: Precision) -> Result<(), CheckpointError> {
        let mut checkpoint = Checkpoint::default();
        self.add_to(&mut checkpoint);
        checkpoint.write(path, precision)
    }

    /// Predicts depth, global light and camera orientation from an sRGB photo taken by `camera`.
    ///
    /// Averages over a second, mirrored and coarser pass, filters the depth by a median and snaps it to planes.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn predict(&self, photo: &Image<[u8; 3]>, camera: &Camera) -> PhotoPrediction {
        in_pool(|| {
            let output = self.depth.forward(&[&self.depth.network_input(photo)]);
            let second = self.depth.forward(&[&self.augmented_photo(photo)]);
            let depth_m = test_time_augmentation::mean_depth(&output.depth_m(camera), &second.depth_m(camera));
            let depth_m = snap_to_planes(&test_time_augmentation::median_filtered(&depth_m), camera);
            let field = output.field().with_mirrored(&second.field());
            let perspective = Perspective::fit(&field, Some(camera.half_extent()));
            PhotoPrediction { depth_m, light: GlobalLight(output.global), perspective }
        })
    }

    /// Predicts expected light around a linear photo with its depth and camera. `up` is the unit vector against gravity
    /// in the camera's axes. Returns `None` where the weights were not trained for it.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn expected_light(
        &self,
        photo: &RadianceImage,
        depth_m: &DepthMap,
        camera: &Camera,
        up: Vec3,
    ) -> Option<ExpectedLight> {
        let net = self.expected.as_ref()?;
        in_pool(|| Some(net.predict(&PhotoStatistics::new(photo, depth_m, camera, up))))
    }

    /// Predicts the global light of an sRGB photo whose depth is known.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn global_light(&self, photo: &Image<[u8; 3]>) -> GlobalLight {
        in_pool(|| GlobalLight(self.depth.global_feature(&self.depth.network_input(photo))))
    }

    /// Predicts global light and camera orientation of an sRGB photo with known depth and lens (`half_extent`:
    /// [`Camera::half_extent`]). The orientation is `None` where the weights were not trained for it.
    ///
    /// One encoder pass serves both. A second, augmented pass refines the orientation.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn light_and_camera(&self, photo: &Image<[u8; 3]>, half_extent: f64) -> (GlobalLight, Option<PerspectiveFit>) {
        in_pool(|| {
            let (global, field) = self.depth.global_and_perspective(&self.depth.network_input(photo));
            let second = self.depth.perspective_field(&self.augmented_photo(photo));
            (GlobalLight(global), Perspective::fit(&field.with_mirrored(&second), Some(half_extent)))
        })
    }

    /// Predicts orientation and lens of the camera of an sRGB photo, given its lens where known
    /// ([`Camera::half_extent`]). Returns `None` where the weights were not trained for it.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn perspective(&self, photo: &Image<[u8; 3]>, half_extent: Option<f64>) -> Option<PerspectiveFit> {
        in_pool(|| {
            let field = self.depth.perspective_field(&self.depth.network_input(photo));
            let second = self.depth.perspective_field(&self.augmented_photo(photo));
            Perspective::fit(&field.with_mirrored(&second), half_extent)
        })
    }

    /// Returns the input of the second pass of test-time augmentation.
    fn augmented_photo(&self, photo: &Image<[u8; 3]>) -> Image<[u8; 3]> {
        test_time_augmentation::augmented_photo(photo, self.depth.longer_side())
    }

    /// Decodes the single map of an sRGB photo: the panorama at the camera, centred on the camera's view.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn single_map(&self, photo: &Image<[u8; 3]>) -> RadianceImage {
        let global = self.global_light(photo).0;
        in_pool(|| panorama_image(self.depth.panorama.forward(global)))
    }

    /// Predicts the light of the whole room, on an octree grown by the network's own predictions.
    ///
    /// `global` belongs to the first camera, whose observations alone are the input of inference. `seed` draws the
    /// points that carry the global light. Where `octree_depth` exceeds the network's depth, observed leaves are split
    /// to `octree_depth`; inferred leaves stay coarser.
    ///
    /// # Errors
    /// Points or predictions that are not finite; an unsupported octree depth.
    ///
    /// # Panics
    /// Where the views have more points than there are.
    pub fn complete(
        &self,
        seen: &ObservedRoom<'_>,
        global: GlobalLight,
        octree_depth: u32,
        seed: u64,
    ) -> Result<CompletedLight, LightError> {
        let &ObservedRoom { points, views, cube, up } = seen;
        in_pool(|| {
            let input = LightInput::of_photos(points, views, cube, &self.config, seed)?;
            let map = panorama_image(self.depth.panorama.forward(global.0.clone()));
            let input = input.with_up(up).with_map(map);
            let mut output = self.light.forward(&input, Some(global.0), Growth::Predicted)?;
            let warnings = std::mem::take(&mut output.warnings);
            let (mut light, mut confidence) = output.into_light()?;
            if octree_depth > self.config.depth {
                let points: Vec<RadiancePoint> = points.iter().map(VisiblePoint::radiance_point).collect();
                let (fine, _) = LightOctree::from_points(&points, cube, octree_depth, self.config.full_depth)?;
                let detail = ObservedDetail { coarse: &input.visible, fine: &fine, free: &input.free };
                detail.refine(&mut light, &mut confidence)?;
            }
            Ok(CompletedLight { light, confidence, warnings })
        })
    }
}

/// Reported for weights of networks without the photo's colour or gravity as input.
const OUTDATED_WEIGHTS: &str =
    "the file was written before 26 November 2026, by networks without the photo's colour and gravity; retrain them";

/// Accepted values of `longer_side` in a file of weights. The upper bound limits memory.
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
    fn weights_round_trip_in_both_precisions() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("weights.safetensors");
        let networks = Networks::new(EncoderKind::default(), &config(), 3, &Device::flex()).unwrap();
        let photo = Image::from_fn(64, 32, |x, y| [(3 * x) as u8, (7 * y) as u8, 90]);
        let depth_m = networks.predict(&photo, &camera(&photo)).depth_m;
        networks.write(&path, Precision::Full).unwrap();
        let read = Networks::read(&path).unwrap();
        assert_eq!((&read.config, read.predict(&photo, &camera(&photo)).depth_m), (&config(), depth_m.clone()));
        networks.write(&path, Precision::Half).unwrap();
        let half = Networks::read(&path).unwrap().predict(&photo, &camera(&photo)).depth_m;
        let close = |(a, b): (&f32, &f32)| (a / b).ln().abs() < 0.05;
        assert!(half != depth_m && half.pixels().iter().zip(depth_m.pixels()).all(close));
        let state = Checkpoint::read(&path).unwrap().state;
        assert_eq!((FORMAT_VERSION, &state["light_net"]["depth"]), (1, &serde_json::json!(5)));
    }

    #[test]
    fn outdated_networks_are_refused() {
        let mut old = checkpoint(&config(), 3);
        old.state[DEPTH_NET]["colour"] = serde_json::json!(false);
        let error = refusal(&old);
        assert!(error.contains("\"depth_net\"") && error.contains("written before"), "{error}");
        old.state[DEPTH_NET] = serde_json::Value::Null;
        assert_eq!(refusal(&old), error);
        let mut chosen = checkpoint(&config(), 3);
        chosen.state[LIGHT_NET]["knows_up"] = serde_json::json!(false);
        assert_eq!(refusal(&chosen), error);
        chosen.state[LIGHT_NET]["knows_up"] = serde_json::json!(true);
        assert_eq!(Networks::from_checkpoint(chosen, &Device::flex()).unwrap().config, config());
    }

    #[test]
    fn global_light_alone_equals_that_with_depth() {
        let networks = Networks::new(EncoderKind::default(), &config(), 3, &Device::flex()).unwrap();
        let photo = Image::from_fn(70, 41, |x, y| [(3 * x) as u8, (7 * y) as u8, 90]);
        let [beside, alone] = [networks.predict(&photo, &camera(&photo)).light, networks.global_light(&photo)];
        assert_eq!(beside.0.into_data(), alone.0.into_data());
    }

    #[test]
    fn configuration_counts_weights() {
        for config in [config(), LightNetConfig { full_depth: 5, ..config() }, LightNetConfig::default()] {
            let mut checkpoint = Checkpoint::default();
            checkpoint.add_module(LIGHT_NET, &LightNet::new(&config, 1, &Device::flex()).unwrap());
            assert_eq!(config.weights(), checkpoint.values_of(LIGHT_NET));
        }
    }

    #[test]
    fn mismatched_files_are_refused() {
        let whole = checkpoint(&config(), 1);
        let error = refusal(&Checkpoint::default());
        assert!(error.contains("\"light_net\"") && error.contains("no configuration"), "{error}");
        let with = |key: &str, value: serde_json::Value| {
            let mut other = whole.clone();
            other.state[LIGHT_NET][key] = value;
            refusal(&other)
        };
        let error = with("blocks", serde_json::json!(16));
        assert!(error.contains("describes") && error.contains("the file has"), "{error}");
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
        assert!(refusal(&more).contains("\"light_net.hat\" is not part of the network"));
        let mut light_only = Checkpoint::default();
        light_only.state = whole.state.clone();
        light_only.add_module(LIGHT_NET, &LightNet::new(&config(), 1, &Device::flex()).unwrap());
        let error = refusal(&light_only);
        assert!(error.contains("\"depth_net.encoder.conv0.weight\" is missing") && error.contains("more"), "{error}");
    }
}
