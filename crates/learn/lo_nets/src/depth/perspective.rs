use burn::module::Module;
use burn::nn::conv::Conv2d;
use burn::tensor::{Device, Tensor, TensorData, activation::relu, module::adaptive_avg_pool2d};
use lo_geometry::{FieldCell, LensEstimate, Perspective, PerspectiveField};
use lo_random::Stream;

use crate::conv::conv2d;
use crate::depth::decoder::ConvStage;
use crate::depth::layers::conv;
use crate::layers::Linear;

/// Side of a cell of the field, in pixels of the photo.
pub(super) const CELL: usize = 8;
const CHANNELS: usize = 32;
/// Range of log certainty, for differences from 1 down to half a degree.
const LOG_CERTAINTY: [f64; 2] = [0.0, 4.7];

/// Grid of cells that predicts the lens, and channels of each cell.
const LENS_CELLS: [usize; 2] = [4, 6];
const LENS_CHANNELS: usize = 32;
const LENS_HIDDEN: usize = 128;
/// Logarithm of [`lo_geometry::Camera::half_extent`] of a 70° lens, the initial prediction.
const LOG_HALF_EXTENT: f64 = -0.356_6;
/// Range of the logarithm of the lens's deviation: 3 % to 45 %.
const LOG_DEVIATION: [f64; 2] = [-3.5, -0.8];

/// Head from the encoder's last features to the lens. Sizes of objects and proportions of rooms hold information that
/// directions do not.
#[derive(Module, Debug)]
pub struct LensHead {
    /// 1 × 1 convolution.
    pub conv: Conv2d,
    /// Fully connected layer over all cells.
    pub hidden: Linear,
    /// Fully connected layer to the two numbers of [`PerspectiveOutput::lens`].
    pub output: Linear,
}

impl LensHead {
    fn new(channels: usize, stream: &mut Stream, device: &Device) -> Self {
        Self {
            conv: conv([channels, LENS_CHANNELS], 1, 1, true, stream, device),
            hidden: Linear::with_bias([LENS_CELLS[0] * LENS_CELLS[1] * LENS_CHANNELS, LENS_HIDDEN], stream, device),
            output: Linear::constant(LENS_HIDDEN, &[LOG_HALF_EXTENT as f32, LOG_DEVIATION[1] as f32], device),
        }
    }

    /// Maps the encoder's last features `[channels, images, rows, columns]` to `[images, 2]`.
    fn forward(&self, features: Tensor<4>) -> Tensor<2> {
        let cells = adaptive_avg_pool2d(relu(conv2d(features, &self.conv)), LENS_CELLS);
        let predicted = self.output.forward(relu(self.hidden.forward(cells.swap_dims(0, 1).flatten(1, 3))));
        let log_deviation = predicted.clone().narrow(1, 1, 1);
        let [least, most] = LOG_DEVIATION;
        // Straight-through, as with certainties below.
        let clamp_offset = (log_deviation.clone().clamp(least, most) - log_deviation.clone()).detach();
        Tensor::cat(vec![predicted.narrow(1, 0, 1), log_deviation + clamp_offset], 1)
    }
}

/// Head from the depth decoder's features at 1/8 to the perspective field: up direction, latitude and certainty of each
/// cell (Jin et al., CVPR 2023; Veicht et al., ECCV 2024).
#[derive(Module, Debug)]
pub struct PerspectiveHead {
    /// 3 × 3 stage.
    pub stage: ConvStage,
    /// Convolution to the channels of [`PerspectiveOutput`].
    pub output: Conv2d,
    /// Prediction of the lens from the whole photo. `None` where it was not trained.
    pub lens: Option<LensHead>,
}

/// Perspective field. Tensors are `[channels, images, rows, columns]` with cells of 8 × 8 pixels.
#[derive(Clone, Debug)]
pub struct PerspectiveOutput {
    /// Unit direction of up in the image, as right and up: 2 channels.
    pub up: Tensor<4>,
    /// Sine of the latitude above the horizon: 1 channel.
    pub latitude_sin: Tensor<4>,
    /// Logarithm of the inverse expected difference of direction and latitude: 2 channels.
    pub log_certainty: Tensor<4>,
    /// Logarithms of [`lo_geometry::Camera::half_extent`] and of its relative deviation, `[images, 2]`.
    pub lens: Option<Tensor<2>>,
    size: [usize; 2],
}

impl PerspectiveHead {
    /// Creates a head for the channels of the decoder and of the encoder's last features.
    pub(super) fn new([decoded, encoded]: [usize; 2], stream: &mut Stream, device: &Device) -> Self {
        Self {
            stage: ConvStage::new([decoded, CHANNELS], stream, device),
            output: conv([CHANNELS, 5], 3, 1, true, stream, device),
            lens: Some(LensHead::new(encoded, stream, device)),
        }
    }

    /// Predicts from the decoder's `features[channels, images, rows, columns]` of photos of `size` (width, height), and
    /// the encoder's last features.
    pub(super) fn forward(&self, features: Tensor<4>, encoded: Tensor<4>, size: [usize; 2]) -> PerspectiveOutput {
        let [columns, rows] = size.map(|side| side.div_ceil(CELL));
        let x = conv2d(self.stage.forward(features), &self.output).narrow(2, 0, rows).narrow(3, 0, columns);
        let up = x.clone().narrow(0, 0, 2);
        // The initial prediction is a level camera.
        let level = Tensor::<4>::from_data(TensorData::new(vec![0.0f32, 1.0], [2, 1, 1, 1]), &up.device());
        let up = up + level;
        let norm = (up.clone().square().sum_dim(0) + 1e-6).sqrt();
        let log_certainty = x.clone().narrow(0, 3, 2);
        let [least, most] = LOG_CERTAINTY;
        // Straight-through clamp: a clamped value would otherwise get no gradient and stay outside of the range.
        let clamp_offset = (log_certainty.clone().clamp(least, most) - log_certainty.clone()).detach();
        PerspectiveOutput {
            up: up / norm,
            latitude_sin: x.narrow(0, 2, 1).tanh(),
            log_certainty: log_certainty + clamp_offset,
            lens: self.lens.as_ref().map(|head| head.forward(encoded)),
            size,
        }
    }
}

/// Returns the position `[right, up]` of a cell's centre relative to the image's centre, in halves of its longer side.
fn cell_position([width, height]: [usize; 2], column: usize, row: usize) -> [f64; 2] {
    let half = 0.5 * width.max(height) as f64;
    let middle = |cell: usize, side: usize| ((cell * CELL) as f64 + 0.5 * CELL as f64 - 0.5 * side as f64) / half;
    [middle(column, width), -middle(row, height)]
}

impl PerspectiveOutput {
    /// Returns field and lens of the first photo.
    pub fn field(&self) -> PerspectiveField {
        let lens = self.lens.as_ref().map(|lens| {
            let predicted: Vec<f32> = lens.clone().inner().narrow(0, 0, 1).into_data().iter().collect();
            LensEstimate { log_half_extent: predicted[0].into(), deviation: f64::from(predicted[1]).exp() }
        });
        PerspectiveField { cells: self.cells(), lens }
    }

    fn cells(&self) -> Vec<FieldCell> {
        let [_, _, rows, columns] = self.up.dims();
        let first =
            |tensor: &Tensor<4>| -> Vec<f32> { tensor.clone().inner().narrow(1, 0, 1).into_data().iter().collect() };
        let (up, latitude, certainty) = (first(&self.up), first(&self.latitude_sin), first(&self.log_certainty));
        let cell = |i: usize| {
            let pair = |values: &[f32]| [values[i], values[rows * columns + i]].map(f64::from);
            FieldCell {
                at: cell_position(self.size, i % columns, i / columns),
                up: pair(&up),
                latitude_sin: latitude[i].into(),
                certainty: pair(&certainty).map(f64::exp),
            }
        };
        (0..rows * columns).map(cell).collect()
    }
}

/// Returns the negative log-likelihood of the true fields.
///
/// Differences of direction and latitude follow Laplace distributions of the predicted widths. Means are over the cells
/// of photos with a known camera. Where the lens is predicted as a whole, the negative log-likelihood of a normal
/// distribution is added.
///
/// # Panics
/// Where the number of cameras differs from that of photos.
pub fn perspective_loss(output: &PerspectiveOutput, truths: &[Option<Perspective>]) -> Tensor<1> {
    let [_, images, rows, columns] = output.up.dims();
    assert_eq!(truths.len(), images, "as many cameras as photos");
    let device = output.up.device();
    let field = |of: &Perspective, cell: usize| of.at(cell_position(output.size, cell % columns, cell / columns));
    let constant = |channels: usize, value: &dyn Fn(&Perspective, usize, usize) -> f32| {
        let cells = (0..channels).flat_map(|channel| {
            truths.iter().flat_map(move |truth| {
                (0..rows * columns).map(move |cell| truth.as_ref().map_or(0.0, |truth| value(truth, channel, cell)))
            })
        });
        let size = [channels, images, rows, columns];
        Tensor::<4>::from_data(TensorData::new::<f32, _>(cells.collect(), size), &device)
    };
    let up = constant(2, &|truth, channel, cell| field(truth, cell).0[channel] as f32);
    let latitude = constant(1, &|truth, _, cell| field(truth, cell).1 as f32);
    let known = constant(1, &|_, _, _| 1.0);
    let count = (truths.iter().flatten().count() * rows * columns).max(1) as f32;
    // The chord between two unit vectors equals the angle where it is small.
    let up_difference = ((output.up.clone() - up).square().sum_dim(0) + 1e-6).sqrt();
    let latitude_difference = (output.latitude_sin.clone() - latitude).abs();
    let differences = Tensor::cat(vec![up_difference, latitude_difference], 0);
    let likelihood = differences * output.log_certainty.clone().exp() - output.log_certainty.clone();
    let field = (likelihood * known).sum() / count;
    match &output.lens {
        Some(lens) => field + lens_loss(lens, truths),
        None => field,
    }
}

fn lens_loss(lens: &Tensor<2>, truths: &[Option<Perspective>]) -> Tensor<1> {
    let column = |value: &dyn Fn(&Perspective) -> f32| {
        let values: Vec<f32> = truths.iter().map(|truth| truth.as_ref().map_or(0.0, value)).collect();
        Tensor::<2>::from_data(TensorData::new(values, [truths.len(), 1]), &lens.device())
    };
    let (truth, known) = (column(&|truth| truth.half_extent.ln() as f32), column(&|_| 1.0));
    let log_deviation = lens.clone().narrow(1, 1, 1);
    let difference = (lens.clone().narrow(1, 0, 1) - truth) / log_deviation.clone().exp();
    let likelihood = difference.square() * 0.5 + log_deviation;
    (likelihood * known).sum() / truths.iter().flatten().count().max(1) as f32
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Adam;
    use crate::testing::numbers;

    const SIZE: [usize; 2] = [60, 40];

    fn true_camera() -> Perspective {
        let up = lo_geometry::Vec3::new(0.1, 0.9, -0.3).normalize();
        Perspective { up, half_extent: 0.8 }
    }

    /// A field that matches a camera exactly, with the given certainty.
    fn field(of: &Perspective, certainty: f32, device: &Device) -> PerspectiveOutput {
        let cells: Vec<_> = (0..5).flat_map(|row| (0..8).map(move |column| (column, row))).collect();
        let values = |value: &dyn Fn(([f64; 2], f64)) -> f64| -> Vec<f32> {
            cells.iter().map(|&(column, row)| value(of.at(cell_position(SIZE, column, row))) as f32).collect()
        };
        let tensor = |values: Vec<f32>| {
            let channels = values.len() / 40;
            Tensor::<4>::from_data(TensorData::new(values, [channels, 1, 5, 8]), device)
        };
        PerspectiveOutput {
            up: tensor([values(&|field| field.0[0]), values(&|field| field.0[1])].concat()),
            latitude_sin: tensor(values(&|field| field.1)),
            log_certainty: tensor(vec![certainty.ln(); 80]),
            lens: None,
            size: SIZE,
        }
    }

    #[test]
    fn a_cameras_field_is_fitted_by_that_camera() {
        let output = field(&true_camera(), 10.0, &Device::flex());
        let found = Perspective::fit(&output.field(), None).unwrap().camera;
        assert!(found.up.angle_between(true_camera().up) < 1e-3, "{found:?}");
        assert!((found.half_extent - 0.8).abs() < 0.01, "{found:?}");
        // The first cell's centre is 26 pixels left of the image's centre and 16 above it.
        assert_eq!(output.cells()[0].at, [-26.0 / 30.0, 16.0 / 30.0]);
    }

    #[test]
    fn loss_is_the_laplace_likelihood() {
        let device = Device::flex();
        let loss = |of: &Perspective, certainty: f32, truth| {
            f64::from(perspective_loss(&field(of, certainty, &device), &[truth]).into_scalar::<f32>())
        };
        let exact = loss(&true_camera(), 10.0, Some(true_camera()));
        // Zero differences, apart from the ε in the root: 10 · 10⁻³ − ln 10, and −ln 10.
        assert!((exact - (0.01 - 2.0 * 10f64.ln())).abs() < 1e-3, "{exact}");
        let level = Perspective { up: lo_geometry::Vec3::Y, ..true_camera() };
        assert!(loss(&level, 10.0, Some(true_camera())) > loss(&level, 2.0, Some(true_camera())));
        assert_eq!(loss(&level, 10.0, None), 0.0);
    }

    #[test]
    fn head_learns_a_camera() {
        let device = Device::flex().autodiff();
        let mut head = PerspectiveHead::new([4, 4], &mut lo_random::stream(1, "test", 0), &device);
        let positions: Vec<f32> = (0..4)
            .flat_map(|channel| {
                (0..40).map(move |i| match channel {
                    0 => (i % 8) as f32 / 4.0 - 1.0,
                    1 => (i / 8) as f32 / 2.0 - 1.0,
                    _ => 1.0,
                })
            })
            .collect();
        let features = Tensor::<4>::from_data(TensorData::new(positions, [4, 1, 5, 8]), &device);
        let (mut adam, mut losses) = (Adam::default(), Vec::new());
        for _ in 0..60 {
            let loss =
                perspective_loss(&head.forward(features.clone(), features.clone(), SIZE), &[Some(true_camera())]);
            losses.push(numbers(loss.clone().inner())[0]);
            head = adam.step(head, &loss.backward(), 1e-2);
        }
        assert!(losses[59] < losses[0] - 2.0, "{losses:?}");
        let found = Perspective::fit(&head.forward(features.clone(), features, SIZE).field(), None).unwrap().camera;
        assert!(found.up.angle_between(true_camera().up).to_degrees() < 5.0, "{found:?}");
    }

    #[test]
    fn certainty_outside_of_its_range_is_trained() {
        let device = Device::flex().autodiff();
        let features = Tensor::<4>::from_data(TensorData::new(vec![0.5f32; 160], [4, 1, 5, 8]), &device);
        // Certainty of both channels far below the range with a consistent truth, and far above with contradictory
        // truths.
        for (start, truths) in [(-0.5, [Some(true_camera()); 2]), (5.0, [true_camera(), upside_down()].map(Some))] {
            let mut head = PerspectiveHead::new([4, 4], &mut lo_random::stream(1, "test", 0), &device);
            let bias = head.output.bias.take().unwrap();
            let shift = Tensor::<1>::from_data(TensorData::new(vec![0.0, 0.0, 0.0, start, start], [5]), &device);
            head.output.bias = Some(bias.map(|bias| (bias * 0.0 + shift).detach().require_grad()));
            let certainties = |head: &PerspectiveHead| -> f64 {
                numbers(head.forward(features.clone(), features.clone(), SIZE).log_certainty.inner())
                    .iter()
                    .sum::<f64>()
                    / 80.0
            };
            let before = certainties(&head);
            let mut adam = Adam::default();
            for step in 0..60 {
                let loss =
                    perspective_loss(&head.forward(features.clone(), features.clone(), SIZE), &[truths[step % 2]]);
                head = adam.step(head, &loss.backward(), 1e-2);
            }
            let after = certainties(&head);
            assert!(if start < 0.0 { after > before + 0.3 } else { after < before - 0.3 }, "{start}: {before} {after}");
        }
    }

    fn upside_down() -> Perspective {
        Perspective { up: lo_geometry::Vec3::new(0.1, -0.9, 0.3).normalize(), half_extent: 0.8 }
    }
}
