//! From a photo's features to features of every cell.

use burn::module::Module;
use burn::tensor::{Device, Int, Tensor, TensorData};
use lo_nets::conv::upsample_nearest;
use lo_nets::depth::ConvStage;
use lo_random::Stream;

use crate::features::{FeatureBatch, FeatureShape};

/// Channels at 1/16.
const BETWEEN: usize = 128;

/// Channels of every cell.
pub(crate) const CELL_CHANNELS: usize = 64;

/// Decoder with skip connections from 1/32 to 1/8, given a vector for the whole photo.
#[derive(Module, Debug)]
pub struct DenseDecoder {
    /// Stage at 1/16.
    pub sixteenth: ConvStage,
    /// Stage at 1/8.
    pub eighth: ConvStage,
}

impl DenseDecoder {
    /// Creates a decoder with a vector of length `global`.
    pub(crate) fn new(shape: FeatureShape, global: usize, stream: &mut Stream, device: &Device) -> Self {
        let inputs = shape.last + global + shape.sixteenth;
        Self {
            sixteenth: ConvStage::new([inputs, BETWEEN], stream, device),
            eighth: ConvStage::new([BETWEEN + shape.eighth + 3, CELL_CHANNELS], stream, device),
        }
    }

    /// Returns `[CELL_CHANNELS, images, rows, columns]`. `global` has one vector for each image.
    pub(crate) fn forward(&self, batch: &FeatureBatch, global: Tensor<2>) -> Tensor<4> {
        let [_, images, rows, columns] = batch.last.dims();
        let length = global.dims()[1];
        let everywhere = global.swap_dims(0, 1).reshape([length, images, 1, 1]).expand([length, images, rows, columns]);
        let x = Tensor::cat(vec![batch.last.clone(), everywhere], 0);
        let x = self.sixteenth.forward(upsample_nearest(x, Some(batch.sixteenth.clone())));
        let skip = Tensor::cat(vec![batch.eighth.clone(), batch.photo.clone()], 0);
        self.eighth.forward(upsample_nearest(x, Some(skip)))
    }
}

/// Cells of a batch of images.
#[derive(Clone, Debug)]
pub(crate) struct Cells {
    /// Image, row and column of each.
    pub at: Vec<[usize; 3]>,
}

impl Cells {
    /// Returns all shown cells of one image.
    pub fn of_photo([rows, columns]: [usize; 2]) -> Self {
        Self { at: (0..rows).flat_map(|row| (0..columns).map(move |column| [0, row, column])).collect() }
    }

    /// Returns the values of `x[channels, images, rows, columns]` at the cells, `[cells, channels]`.
    pub fn of(&self, x: Tensor<4>) -> Tensor<2> {
        let [channels, images, rows, columns] = x.dims();
        let index = |&[image, row, column]: &[usize; 3]| ((image * rows + row) * columns + column) as i32;
        let indices = TensorData::new(self.at.iter().map(index).collect::<Vec<i32>>(), [self.at.len()]);
        let indices = Tensor::<1, Int>::from_data(indices, &x.device());
        x.reshape([channels, images * rows * columns]).select(1, indices).swap_dims(0, 1)
    }

    /// Returns the rows of `x[images, length]` that belong to the cells, `[cells, length]`.
    pub fn of_images(&self, x: Tensor<2>) -> Tensor<2> {
        let indices = TensorData::new(self.at.iter().map(|at| at[0] as i32).collect::<Vec<i32>>(), [self.at.len()]);
        let indices = Tensor::<1, Int>::from_data(indices, &x.device());
        x.select(0, indices)
    }

    /// Returns the cells' positions in their image, from −1 to 1: `[cells, 2]`.
    pub fn positions(&self, [rows, columns]: [usize; 2], device: &Device) -> Tensor<2> {
        let at = |i: usize, count: usize| 2.0 * (i as f32 + 0.5) / count as f32 - 1.0;
        let values: Vec<f32> =
            self.at.iter().flat_map(|&[_, row, column]| [at(column, columns), at(row, rows)]).collect();
        Tensor::from_data(TensorData::new(values, [self.at.len(), 2]), device)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::planes::Planes;

    #[test]
    fn cells_are_found_again() {
        let images =
            [0, 1].map(|i| Planes::from_fn([2, 3, 4], move |c, y, x| (1000 * i + 100 * c + 10 * y + x) as f32));
        let x = Planes::stack(&[&images[0], &images[1]], &Device::flex());
        let cells = Cells { at: vec![[1, 2, 3], [0, 1, 0]] };
        let values: Vec<f32> = cells.of(x).into_data().iter().collect();
        assert_eq!(values, [1023.0, 1123.0, 10.0, 110.0]);
        let vectors = Tensor::<2>::from_data([[1.0, 2.0], [3.0, 4.0]], &Device::flex());
        let values: Vec<f32> = cells.of_images(vectors).into_data().iter().collect();
        assert_eq!(values, [3.0, 4.0, 1.0, 2.0]);
        let values: Vec<f32> = cells.positions([3, 4], &Device::flex()).into_data().iter().collect();
        assert_eq!(values, [0.75, 2.0 * 2.5 / 3.0 - 1.0, -0.75, 0.0]);
    }
}
