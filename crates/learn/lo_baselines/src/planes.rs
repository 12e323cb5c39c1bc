use burn::tensor::{Device, Tensor, TensorData};
use lo_geometry::Vec3;
use lo_nets::checkpoint::Checkpoint;

/// An image of any number of channels, stored channel by channel, then row by row.
#[derive(Clone, Debug, PartialEq)]
pub struct Planes {
    /// Channels, rows, columns.
    pub size: [usize; 3],
    /// One value for each channel and pixel.
    pub values: Vec<f32>,
}

impl Planes {
    /// Creates an image from a function of channel, row and column.
    pub fn from_fn(size: [usize; 3], value: impl Fn(usize, usize, usize) -> f32) -> Self {
        let [channels, rows, columns] = size;
        let area = rows * columns;
        let at = |i: usize| value(i / area, i % area / columns, i % columns);
        Self { size, values: (0..channels * area).map(at).collect() }
    }

    /// Returns the only image of a tensor `[channels, 1, rows, columns]`.
    pub fn from_tensor(tensor: Tensor<4>) -> Self {
        let [channels, images, rows, columns] = tensor.dims();
        debug_assert_eq!(images, 1);
        Self { size: [channels, rows, columns], values: tensor.into_data().iter().collect() }
    }

    /// Returns the value of a channel, row and column.
    pub fn at(&self, channel: usize, row: usize, column: usize) -> f32 {
        let [_, rows, columns] = self.size;
        self.values[(channel * rows + row) * columns + column]
    }

    /// Returns the first three channels of a pixel.
    pub fn vector(&self, row: usize, column: usize) -> Vec3 {
        Vec3::from_array([0, 1, 2].map(|channel| self.at(channel, row, column)))
    }

    /// Returns images of one size as a tensor `[channels, images, rows, columns]`.
    ///
    /// # Panics
    /// Without images, and where sizes differ.
    pub fn stack(images: &[&Self], device: &Device) -> Tensor<4> {
        let [channels, rows, columns] = images[0].size;
        assert!(images.iter().all(|image| image.size == images[0].size), "images of a batch have one size");
        let area = rows * columns;
        let values = (0..channels).flat_map(|channel| {
            images.iter().flat_map(move |image| image.values[channel * area..][..area].iter().copied())
        });
        let size = [channels, images.len(), rows, columns];
        Tensor::from_data(TensorData::new(values.collect::<Vec<f32>>(), size), device)
    }

    pub(crate) fn add_to(&self, checkpoint: &mut Checkpoint, name: &str) {
        checkpoint.insert(name, &self.size, self.values.clone());
    }

    pub(crate) fn read(checkpoint: &Checkpoint, name: &str) -> Option<Self> {
        let (_, shape) = checkpoint.shapes().find(|(own, _)| *own == name)?;
        Some(Self { size: shape.try_into().ok()?, values: checkpoint.values(name)?.to_vec() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stack_is_channel_by_channel() {
        let image = |offset: f32| Planes::from_fn([2, 1, 3], |c, _, x| offset + 10.0 * c as f32 + x as f32);
        let stack = Planes::stack(&[&image(0.0), &image(100.0)], &Device::flex());
        let values: Vec<f32> = stack.clone().into_data().iter().collect();
        assert_eq!(values, [0., 1., 2., 100., 101., 102., 10., 11., 12., 110., 111., 112.]);
        assert_eq!(Planes::from_tensor(stack.narrow(1, 1, 1)), image(100.0));
        assert_eq!(image(0.0).at(1, 0, 2), 12.0);
    }
}
