use burn::module::Module;
use burn::tensor::ops::PadMode;
use burn::tensor::{Device, Tensor, TensorData};
use lo_geometry::{Camera, PerspectiveField};
use lo_imaging::{DepthMap, Image, RadianceImage, linear_from_srgb8, srgb8_from_linear};
use serde::{Deserialize, Serialize};

use crate::depth::decoder::EIGHTH_CHANNELS;
use crate::depth::{
    DepthDecoder, Encoder, EncoderKind, GlobalEncoder, PanoramaDecoder, PerspectiveHead, PerspectiveOutput,
};

/// Range of predicted extents in metres.
const EXTENT_RANGE_M: [f64; 2] = [0.02, 200.0];

/// Default for the maximum number of pixels on a photo's longer side.
///
/// Networks infer distance from sizes in pixels, so inference must use the training resolution. Light needs no finer
/// depth: at 4 m, a pixel is 2 cm wide.
pub const LONGER_SIDE: usize = 240;

/// Lower limit of the mean of a photo's channel, linear.
const MIN_CHANNEL_MEAN: f64 = 1e-3;

/// The encoder halves the resolution five times.
const SIZE_MULTIPLE: usize = 32;

/// Depth network (`docs/method.md` §4): depth of every pixel, global lighting feature and single map.
#[derive(Module, Debug)]
pub struct DepthNet {
    /// Image encoder.
    pub encoder: Encoder,
    /// Depth decoder.
    pub decoder: DepthDecoder,
    /// Encoder of the global lighting feature `f_L`.
    pub global: GlobalEncoder,
    /// Decoder of the single map, a panorama at the camera.
    pub panorama: PanoramaDecoder,
    /// Perspective field of the camera. `None` where it was not trained.
    pub perspective: Option<PerspectiveHead>,
    #[module(skip)]
    kind: EncoderKind,
    #[module(skip)]
    longer_side: usize,
}

/// Configuration of a depth network, as stored in weight files.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct DepthNetConfig {
    /// Image encoder.
    #[serde(default)]
    pub encoder: EncoderKind,
    /// Whether the perspective field was trained.
    #[serde(default)]
    pub perspective: bool,
    /// Whether the lens was trained to be predicted from the whole photo.
    #[serde(default)]
    pub lens: bool,
    /// Maximum number of pixels on the longer side of photos.
    #[serde(default = "default_longer_side")]
    pub longer_side: usize,
}

fn default_longer_side() -> usize {
    LONGER_SIDE
}

impl DepthNetConfig {
    /// Creates a network of this configuration, as a target for stored weights.
    pub fn blank(self, global_features: usize, device: &Device) -> DepthNet {
        let mut net = DepthNet::new(self.encoder, global_features, 0, device).with_longer_side(self.longer_side);
        if !self.perspective {
            net.perspective = None;
        }
        if let Some(head) = net.perspective.as_mut().filter(|_| !self.lens) {
            head.lens = None;
        }
        net
    }
}

/// Output of the depth network.
#[derive(Debug)]
pub struct DepthOutput {
    /// Log extent, `[1, images, height, width]`: depth along the optical axis times [`Camera::half_extent`], in metres.
    ///
    /// The extent is half the length that the image's longer side spans at a pixel's depth. Sizes in the image
    /// determine it independently of the focal length (canonical camera of Yin et al., "Metric3D", ICCV 2023).
    pub log_extent: Tensor<4>,
    /// Global lighting features, `[images, features]`.
    pub global: Tensor<2>,
    /// Perspective fields of the cameras, where trained.
    pub perspective: Option<PerspectiveOutput>,
}

/// Returns the size of a photo scaled down to at most `longer_side` pixels on its longer side. Never enlarges.
pub fn size_within([width, height]: [usize; 2], longer_side: usize) -> [usize; 2] {
    let longer = width.max(height);
    if longer <= longer_side {
        return [width, height];
    }
    [width, height].map(|side| (side * longer_side).div_ceil(longer))
}

/// Scales an sRGB photo down to at most `longer_side` pixels on its longer side.
///
/// # Panics
/// Where the photo has no pixels.
pub fn photo_within(photo: &Image<[u8; 3]>, longer_side: usize) -> Image<[u8; 3]> {
    let size = [photo.width(), photo.height()];
    let [width, height] = size_within(size, longer_side);
    if [width, height] == size {
        return photo.clone();
    }
    lo_imaging::resize(&photo.map(|rgb| rgb.map(linear_from_srgb8)), width, height)
        .map(|rgb| rgb.map(srgb8_from_linear))
}

/// Converts the first of a decoder's panoramas, `[3, panoramas, height, width]`, to an image.
pub fn panorama_image(panoramas: Tensor<4>) -> RadianceImage {
    let [_, _, height, width] = panoramas.dims();
    let values: Vec<f32> = panoramas.inner().narrow(1, 0, 1).into_data().iter().collect();
    RadianceImage::from_fn(width, height, |x, y| [0, 1, 2].map(|c| values[(c * height + y) * width + x]))
}

impl DepthNet {
    /// Creates a network with weights drawn from `seed` and an `f_L` of length `global_features`.
    pub fn new(encoder: EncoderKind, global_features: usize, seed: u64, device: &Device) -> Self {
        let mut stream = lo_random::stream(seed, "depth network", 0);
        let (stream, channels) = (&mut stream, encoder.feature_channels());
        Self {
            encoder: encoder.init(stream, device),
            decoder: DepthDecoder::new(channels, stream, device),
            global: GlobalEncoder::new([channels[4], global_features], stream, device),
            panorama: PanoramaDecoder::new(global_features, stream, device),
            perspective: Some(PerspectiveHead::new([EIGHTH_CHANNELS, channels[4]], stream, device)),
            kind: encoder,
            longer_side: LONGER_SIDE,
        }
    }

    /// Sets the maximum number of pixels on a photo's longer side.
    #[must_use]
    pub fn with_longer_side(self, longer_side: usize) -> Self {
        Self { longer_side, ..self }
    }

    /// Returns the maximum number of pixels on a photo's longer side.
    pub fn longer_side(&self) -> usize {
        self.longer_side
    }

    /// Scales a photo to the network's resolution.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn network_input(&self, photo: &Image<[u8; 3]>) -> Image<[u8; 3]> {
        photo_within(photo, self.longer_side)
    }

    /// Returns the network's configuration.
    pub fn config(&self) -> DepthNetConfig {
        DepthNetConfig {
            encoder: self.kind,
            perspective: self.perspective.is_some(),
            lens: self.perspective.as_ref().is_some_and(|head| head.lens.is_some()),
            longer_side: self.longer_side,
        }
    }

    /// Returns the kind of encoder.
    pub fn encoder_kind(&self) -> EncoderKind {
        self.kind
    }

    /// Predicts from sRGB photos of equal size.
    ///
    /// # Panics
    /// Where there are no photos, a photo has no pixels, or their sizes differ.
    pub fn forward(&self, photos: &[&Image<[u8; 3]>]) -> DepthOutput {
        self.decoded(photos, self.encoder.forward(self.input(photos)))
    }

    /// Predicts as [`DepthNet::forward`] does, and returns the encoder's features at 1/2, 1/4, 1/8, 1/16 and 1/32 of
    /// the photos' resolution after padding to multiples of 32.
    ///
    /// # Panics
    /// As [`DepthNet::forward`].
    pub fn forward_with_features(&self, photos: &[&Image<[u8; 3]>]) -> (DepthOutput, [Tensor<4>; 5]) {
        let features = self.encoder.forward(self.input(photos));
        (self.decoded(photos, features.clone()), features)
    }

    /// Predicts as [`DepthNet::forward`] does, without gradients into the encoder.
    ///
    /// # Panics
    /// As [`DepthNet::forward`].
    pub fn forward_detached(&self, photos: &[&Image<[u8; 3]>]) -> DepthOutput {
        // `Tensor::detach` would keep the encoder's recorded operations in memory.
        let device = self.decoder.output.weight.lazy_device();
        let features = self.encoder.valid().forward(self.input(photos).inner());
        self.decoded(photos, features.map(|feature| Tensor::from_data(feature.into_data(), &device)))
    }

    fn decoded(&self, photos: &[&Image<[u8; 3]>], features: [Tensor<4>; 5]) -> DepthOutput {
        let (width, height) = (photos[0].width(), photos[0].height());
        let global = self.global.forward(features[4].clone(), self.log_colour(photos));
        let [least, most] = EXTENT_RANGE_M.map(f64::ln);
        let [half, quarter, .., last] = features.clone();
        let eighth = self.decoder.to_eighth(features);
        let perspective = self.perspective.as_ref().map(|head| head.forward(eighth.clone(), last, [width, height]));
        let log_extent = self.decoder.from_eighth(eighth, [quarter, half]).narrow(2, 0, height).narrow(3, 0, width);
        DepthOutput { log_extent: log_extent.clamp(least, most), global, perspective }
    }

    /// Predicts a photo's perspective field. Empty where the network was not trained for it.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn perspective_field(&self, photo: &Image<[u8; 3]>) -> PerspectiveField {
        self.field(photo, self.encoder.forward(self.input(&[photo])))
    }

    /// Predicts the perspective field from the encoder's features.
    fn field(&self, photo: &Image<[u8; 3]>, features: [Tensor<4>; 5]) -> PerspectiveField {
        let Some(head) = &self.perspective else { return PerspectiveField::default() };
        let last = features[4].clone();
        head.forward(self.decoder.to_eighth(features), last, [photo.width(), photo.height()]).field()
    }

    /// Predicts the global lighting feature, `[1, features]`, and the perspective field, without depth.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn global_and_perspective(&self, photo: &Image<[u8; 3]>) -> (Tensor<2>, PerspectiveField) {
        let features = self.encoder.forward(self.input(&[photo]));
        let global = self.global.forward(features[4].clone(), self.log_colour(&[photo]));
        (global, self.field(photo, features))
    }

    /// Predicts the global lighting feature alone, `[1, features]`.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn global_feature(&self, photo: &Image<[u8; 3]>) -> Tensor<2> {
        let [.., features] = self.encoder.forward(self.input(&[photo]));
        self.global.forward(features, self.log_colour(&[photo]))
    }

    /// Returns the logarithms of the photos' mean linear colours, `[images, 3]`.
    fn log_colour(&self, photos: &[&Image<[u8; 3]>]) -> Tensor<2> {
        let of = |photo: &&Image<[u8; 3]>| {
            let sum = |c: usize| photo.pixels().iter().map(|rgb| f64::from(linear_from_srgb8(rgb[c]))).sum::<f64>();
            [0, 1, 2].map(|c| (sum(c) / photo.pixels().len() as f64).max(MIN_CHANNEL_MEAN).ln() as f32)
        };
        let values = photos.iter().flat_map(of).collect();
        let device = self.decoder.output.weight.lazy_device();
        Tensor::from_data(TensorData::new::<f32, _>(values, [photos.len(), 3]), &device)
    }

    /// Returns normalised photos `[3, images, height, width]`, padded to multiples of 32.
    fn input(&self, photos: &[&Image<[u8; 3]>]) -> Tensor<4> {
        let (width, height) = (photos[0].width(), photos[0].height());
        assert!(width > 0 && height > 0, "photos must have pixels");
        assert!(
            photos.iter().all(|photo| (photo.width(), photo.height()) == (width, height)),
            "photos must have equal sizes"
        );
        let [mean, deviation] = self.kind.normalisation();
        let normal = |c: usize| move |pixel: &[u8; 3]| (f32::from(pixel[c]) / 255.0 - mean[c]) / deviation[c];
        let channels = (0..3).flat_map(|c| photos.iter().flat_map(move |photo| photo.pixels().iter().map(normal(c))));
        let device = self.decoder.output.weight.lazy_device();
        let size = [3, photos.len(), height, width];
        let x = Tensor::<4>::from_data(TensorData::new::<f32, _>(channels.collect(), size), &device);
        let missing = |size: usize| size.next_multiple_of(SIZE_MULTIPLE) - size;
        // Padding repeats the last rows and columns, so that it introduces no edge.
        x.pad((0, missing(width), 0, missing(height)), PadMode::Edge)
    }
}

impl DepthOutput {
    /// Returns the first photo's perspective field. Empty where the network was not trained for it.
    pub fn field(&self) -> PerspectiveField {
        self.perspective.as_ref().map(PerspectiveOutput::field).unwrap_or_default()
    }

    /// Returns the first photo's depth along the optical axis in metres, as taken by `camera`.
    pub fn depth_m(&self, camera: &Camera) -> DepthMap {
        let [_, _, height, width] = self.log_extent.dims();
        let values: Vec<f32> = self.log_extent.clone().inner().narrow(1, 0, 1).into_data().iter().collect();
        let extent = camera.half_extent() as f32;
        DepthMap::new(width, height, values.into_iter().map(|log| log.exp() / extent).collect())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_imaging::RadianceImage;

    use super::*;
    use crate::depth::{PatchGan, depth_losses, panorama_loss};
    use crate::{
        Adam,
        checkpoint::{Checkpoint, Precision},
    };

    fn photo(width: usize, height: usize) -> Image<[u8; 3]> {
        Image::from_fn(width, height, |x, y| {
            [(3 * x) as u8, (5 * y) as u8, if (x / 8 + y / 8) % 2 == 0 { 200 } else { 30 }]
        })
    }

    /// Camera of 90°, whose extent is one metre at a depth of one metre.
    fn camera() -> Camera {
        Camera::from_hfov_deg(90.0, 64, 32).unwrap()
    }

    #[test]
    fn depth_scales_with_focal_length() {
        let output = DepthNet::new(EncoderKind::default(), 16, 1, &Device::flex()).forward(&[&photo(64, 32)]);
        let (wide, upright) = (camera(), Camera::from_hfov_deg(53.130_102, 32, 64).unwrap());
        let long = Camera { fx: 3.0 * wide.fx, fy: 3.0 * wide.fy, ..wide };
        let [near, far, other] = [wide, long, upright].map(|camera| output.depth_m(&camera).pixels()[77]);
        assert!((far / near - 3.0).abs() < 1e-5, "{near} {far}");
        // 32 pixels wide at 53.13°: the same focal length of 32 pixels and the same longer side as the wide camera.
        assert!((other / near - 1.0).abs() < 1e-5, "{near} {other}");
    }

    #[test]
    fn large_photos_are_scaled_down() {
        let net = DepthNet::new(EncoderKind::EfficientNetLite0, 16, 1, &Device::flex());
        let size = |net: &DepthNet, width, height| {
            let seen = net.network_input(&photo(width, height));
            (seen.width(), seen.height())
        };
        assert_eq!(
            (size(&net, 480, 320), size(&net, 301, 480), size(&net, 240, 200)),
            ((240, 160), (151, 240), (240, 200))
        );
        assert_eq!(net.network_input(&photo(64, 32)), photo(64, 32));
        let finer = net.with_longer_side(320);
        assert_eq!((finer.longer_side(), size(&finer, 480, 320)), (320, (320, 214)));
    }

    #[test]
    fn any_size_gives_depth_and_light() {
        let net = DepthNet::new(EncoderKind::default(), 16, 1, &Device::flex());
        for (width, height) in [(50, 37), (64, 32), (1, 1)] {
            let output = net.forward(&[&photo(width, height)]);
            let depth = output.depth_m(&camera());
            assert_eq!((depth.width(), depth.height()), (width, height));
            assert!(depth.pixels().iter().all(|z| (0.019..201.0).contains(z)));
            assert_eq!(output.global.dims(), [1, 16]);
        }
        let panorama = net.panorama.forward(net.forward(&[&photo(64, 32)]).global);
        assert_eq!(panorama.dims(), [3, 1, 64, 128]);
        assert!(panorama.into_data().iter::<f32>().all(|c| c.is_finite() && c >= 0.0));
    }

    #[test]
    fn global_light_scales_with_the_photos_brightness() {
        let net = DepthNet::new(EncoderKind::EfficientNetLite0, 16, 1, &Device::flex());
        // Linear 0.5 is 187.52, rounded to 188, in sRGB.
        let photos = [Image::from_fn(40, 30, |x, _| if x < 20 { [188, 255, 0] } else { [188, 0, 0] })];
        let global: Vec<f32> = net.forward(&[&photos[0]]).global.into_data().iter().collect();
        let expected = [0.503f32.ln(), 0.5f32.ln(), 1e-3f32.ln()];
        assert!(global[13..].iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-3), "{global:?}");
        // With the decoder's input weights cleared, radiance is proportional to the photo's brightness.
        let of = |scale: f32| {
            let mut decoder = net.panorama.clone();
            decoder.input.weights = decoder.input.weights.map(|weights| weights * 0.0);
            let features = (0..16).map(|i| if i < 13 { 0.3 } else { scale.ln() }).collect::<Vec<f32>>();
            let features = Tensor::<2>::from_data(TensorData::new(features, [1, 16]), &Device::flex());
            panorama_image(decoder.forward(features)).pixels()[700][1]
        };
        assert!((of(2.0) / of(0.5) - 4.0).abs() < 1e-3, "{} {}", of(2.0), of(0.5));
    }

    #[test]
    fn batches_equal_single_photos() {
        let net = DepthNet::new(EncoderKind::default(), 16, 1, &Device::flex());
        let photos = [photo(50, 37), photo(50, 37).map(|&[r, g, b]| [b, r, g])];
        let together = net.forward(&photos.each_ref());
        let values = |tensor: Tensor<4>| tensor.into_data().iter::<f32>().collect::<Vec<_>>();
        let panoramas = values(net.panorama.forward(together.global.clone()).swap_dims(0, 1));
        for (i, photo) in photos.iter().enumerate() {
            let alone = net.forward(&[photo]);
            let panorama = values(net.panorama.forward(alone.global.clone()));
            let pairs = [
                (values(together.log_extent.clone().narrow(1, i, 1)), values(alone.log_extent)),
                (panoramas[i * panorama.len()..][..panorama.len()].to_vec(), panorama),
            ];
            for (got, expected) in pairs {
                assert!(got.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-5 * (1.0 + b.abs())), "photo {i}");
            }
        }
        let different = net.forward(&[&photos[0]]).log_extent - net.forward(&[&photos[1]]).log_extent;
        assert!(different.abs().mean().into_scalar::<f32>() > 1e-3);
    }

    #[test]
    fn training_lowers_losses_and_saves_statistics() {
        let device = Device::flex().autodiff();
        let (mut net, mut discriminator) =
            (DepthNet::new(EncoderKind::default(), 16, 1, &device), PatchGan::new(2, &device));
        let photo = photo(64, 32);
        let truth = DepthMap::from_fn(64, 32, |x, _| 1.0 + x as f32 * 0.1);
        let sky = RadianceImage::from_fn(128, 64, |_, y| [if y < 20 { 8.0 } else { 0.2 }; 3]);
        let constant = |channels: usize, value: f32| {
            let values = vec![value; channels * 64 * 128];
            Tensor::<4>::from_data(TensorData::new(values, [channels, 1, 64, 128]), &device)
        };
        let (mut adam, mut discriminator_adam) = (Adam::default(), Adam::default());
        let (mut losses, mut discriminator_losses) = (Vec::new(), Vec::new());
        for _ in 0..6 {
            let output = net.forward(&[&photo]);
            let [log_depth, _, variance] = depth_losses(output.log_extent, &[&truth]);
            let generated = net.panorama.forward(output.global);
            let adversarial = discriminator.generator_loss(generated.clone(), constant(4, 0.0));
            let loss = log_depth
                + variance * 0.5
                + panorama_loss(generated.clone(), &[Some(&sky)])[0].clone()
                + adversarial * 0.01;
            losses.push(loss.clone().inner().into_scalar::<f32>());
            net = adam.step(net, &loss.backward(), 1e-3);
            let loss = discriminator.discriminator_loss(constant(3, 1.0), generated, constant(4, 0.0));
            discriminator_losses.push(loss.clone().inner().into_scalar::<f32>());
            discriminator = discriminator_adam.step(discriminator, &loss.backward(), 1e-3);
        }
        assert!(losses[5] < 0.9 * losses[0], "{losses:?}");
        assert!(discriminator_losses[5] < discriminator_losses[0], "{discriminator_losses:?}");
        // Statistics saved right after a training step are those that inference uses.
        let folder = tempfile::tempdir().unwrap();
        let mut checkpoint = Checkpoint::default();
        checkpoint.add_module("depth", &net);
        checkpoint.write(folder.path().join("depth.safetensors"), Precision::Full).unwrap();
        let read = Checkpoint::read(folder.path().join("depth.safetensors")).unwrap();
        let other = read.load_module("depth", DepthNet::new(EncoderKind::default(), 16, 9, &Device::flex())).unwrap();
        assert_eq!(other.forward(&[&photo]).depth_m(&camera()), net.valid().forward(&[&photo]).depth_m(&camera()));
    }
}
