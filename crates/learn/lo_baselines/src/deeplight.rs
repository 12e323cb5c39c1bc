//! LeGendre et al. 2019, "DeepLight": one panorama of low resolution, learned through the look of three balls.

use burn::module::Module;
use burn::tensor::{Device, Tensor, TensorData};
use lo_imaging::{RadianceImage, resize_equirectangular};
use lo_random::Stream;

use crate::example::{BaselineExample, PROBE_MAP};
use crate::features::{FeatureBatch, FeatureShape};
use crate::global::MapNet;
use crate::losses::{Losses, Term};
use crate::spheres::{BallMaterial, Balls};

/// Channels from 4 × 8 to 16 × 32 pixels.
pub(crate) const CHANNELS: [usize; 3] = [192, 96, 48];

/// Exponent of the curve that a camera's picture of the balls has.
const GAMMA: f32 = 1.0 / 2.2;

/// Smallest value before the curve, whose slope at 0 is infinite.
const DARK: f64 = 1e-3;

/// Network of LeGendre et al. 2019.
#[derive(Module, Debug)]
pub struct DeepLightNet {
    /// Decoder of the panorama.
    pub map: MapNet,
}

impl DeepLightNet {
    pub(crate) fn new(shape: FeatureShape, stream: &mut Stream, device: &Device) -> Self {
        Self { map: MapNet::new(shape, &CHANNELS, 3, stream, device) }
    }

    pub(crate) fn losses(&self, batch: &FeatureBatch, examples: &[&BaselineExample]) -> Losses {
        let device = batch.global.device();
        let map = self.map.radiance(batch);
        let truth = low_panoramas(examples, &device);
        let balls = balls();
        let term = |name: &'static str, material: BallMaterial, weight: f32| {
            let matrix = balls.matrix(material, &device);
            let [got, truth] = [&map, &truth].map(|map| pictured(look(map.clone(), matrix.clone())));
            Term::new(name, (got - truth).abs().mean(), weight)
        };
        // Weights by which the three have about the same gradient at the beginning.
        Losses::new([
            term("mirror", BallMaterial::Mirror, 0.2),
            term("silver", BallMaterial::Silver, 0.3),
            term("matte", BallMaterial::Matte, 0.5),
        ])
    }

    pub(crate) fn predict(&self, batch: &FeatureBatch) -> RadianceImage {
        lo_nets::depth::panorama_image(self.map.radiance(batch))
    }
}

/// Returns the balls, which are prepared once.
fn balls() -> &'static Balls {
    static BALLS: std::sync::OnceLock<Balls> = std::sync::OnceLock::new();
    BALLS.get_or_init(|| Balls::new(PROBE_MAP))
}

/// Returns the look of a ball under panoramas `[3, images, height, width]`: `[3 · images, ball's pixels]`.
fn look(map: Tensor<4>, matrix: Tensor<2>) -> Tensor<2> {
    let [channels, images, height, width] = map.dims();
    map.reshape([channels * images, height * width]).matmul(matrix)
}

/// Returns what a camera records: clipped at white, with a gamma curve.
fn pictured(radiance: Tensor<2>) -> Tensor<2> {
    radiance.clamp(DARK, 1.0).powf_scalar(GAMMA)
}

/// Returns the true panoramas at the camera, `[3, images, 16, 32]`.
pub(crate) fn low_panoramas(examples: &[&BaselineExample], device: &Device) -> Tensor<4> {
    let [width, height] = PROBE_MAP;
    let maps: Vec<RadianceImage> =
        examples.iter().map(|example| resize_equirectangular(&example.panorama, width, height)).collect();
    let channel = |c: usize| maps.iter().flat_map(move |map| map.pixels().iter().map(move |rgb| rgb[c]));
    let values: Vec<f32> = (0..3).flat_map(channel).collect();
    Tensor::from_data(TensorData::new(values, [3, maps.len(), height, width]), device)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradient, numbers, values};

    #[test]
    fn the_balls_of_a_clipped_lamp_tell_its_brightness_by_the_matte_one() {
        let device = Device::flex();
        // Behind the camera, above.
        let map = |lamp: f32| {
            let values = (0..3 * 512).map(|i| if i % 512 == 6 * 32 + 2 { lamp } else { 0.1 }).collect::<Vec<f32>>();
            Tensor::<4>::from_data(TensorData::new(values, [3, 1, 16, 32]), &device)
        };
        let difference = |material| {
            let matrix = balls().matrix(material, &device);
            let [a, b] = [map(20.0), map(40.0)].map(|map| pictured(look(map, matrix.clone())));
            numbers((a - b).abs().mean())[0]
        };
        let [mirror, _, matte] = BallMaterial::ALL.map(difference);
        assert!(matte > 0.03 && matte > 3.0 * mirror, "{matte} {mirror}");
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let start: Vec<f32> = values(3 * 512, 2).into_iter().map(|v| 0.3 + 0.1 * v).collect();
        let at = Tensor::<4>::from_data(TensorData::new(start, [3, 1, 16, 32]), &Device::flex());
        assert_gradient(at, |map| {
            let matrix = balls().matrix(BallMaterial::Silver, &Device::flex()).into_data();
            let matrix = Tensor::<2>::from_data(matrix, (&map.device(), map.dtype()));
            pictured(look(map, matrix)).square().sum()
        });
    }
}
