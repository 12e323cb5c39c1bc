//! Features of a photo by the frozen depth network: the input of all baselines.

use burn::tensor::{Device, Tensor, TensorData};
use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage, linear_from_srgb8, resize};
use lo_nets::conv::in_pool;
use lo_nets::depth::DepthNet;
use serde::{Deserialize, Serialize};

use crate::planes::Planes;

/// Side of a cell in pixels of the network's input: local light is predicted for each cell.
pub const CELL: usize = 8;

/// Number of values at the end of the global lighting feature: the photo's log mean linear colour.
const COLOUR: usize = 3;

/// Channels of a photo's features.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FeatureShape {
    /// Encoder's channels at 1/8 of the photo's resolution.
    pub eighth: usize,
    /// Encoder's channels at 1/16.
    pub sixteenth: usize,
    /// Encoder's channels at 1/32.
    pub last: usize,
    /// Length of the global lighting feature `f_L`, which ends with the photo's log mean linear colour.
    pub global: usize,
}

/// Features of a photo, and its predicted surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoFeatures {
    /// Encoder's features at 1/8, one value for each cell.
    pub eighth: Planes,
    /// Encoder's features at 1/16.
    pub sixteenth: Planes,
    /// Encoder's features at 1/32.
    pub last: Planes,
    /// The photo's linear colour, the mean over each cell; 0 beyond the photo.
    pub photo: Planes,
    /// Predicted surface point at the middle of each cell, in the photo's frame, metres; 0 beyond the photo.
    pub points_m: Planes,
    /// Global lighting feature `f_L`.
    pub global: Vec<f32>,
    /// Rows and columns of cells whose middle is in the photo. The others are padding.
    pub shown: [usize; 2],
}

impl PhotoFeatures {
    /// Computes the features of an sRGB photo by the frozen depth network.
    ///
    /// # Panics
    /// Where the photo has no pixels.
    pub fn new(depth_net: &DepthNet, photo: &Image<[u8; 3]>, camera: &Camera) -> Self {
        in_pool(|| {
            let input = depth_net.network_input(photo);
            let (output, [_, _, eighth, sixteenth, last]) = depth_net.forward_with_features(&[&input]);
            let camera = camera.resized(input.width() as u32, input.height() as u32);
            let depth = output.depth_m(&camera);
            let [eighth, sixteenth, last] = [eighth, sixteenth, last].map(Planes::from_tensor);
            let [_, rows, columns] = eighth.size;
            let shown = [input.height(), input.width()].map(shown_cells);
            let linear = input.map(|rgb| rgb.map(linear_from_srgb8));
            let points_m = surface_points(&depth, &camera, [rows, columns], shown);
            let global = output.global.into_data().iter().collect();
            let photo = cell_means(&linear, [rows, columns]);
            Self { eighth, sixteenth, last, photo, points_m, global, shown }
        })
    }

    /// Returns the channels.
    pub fn shape(&self) -> FeatureShape {
        let [eighth, sixteenth, last] = [&self.eighth, &self.sixteenth, &self.last].map(|planes| planes.size[0]);
        FeatureShape { eighth, sixteenth, last, global: self.global.len() }
    }

    /// Returns the rows and columns of all cells, including padding.
    pub fn cells(&self) -> [usize; 2] {
        [self.eighth.size[1], self.eighth.size[2]]
    }

    /// Returns the means of an image of the photo's field of view over the cells, `[3, rows, columns]`; 0 beyond it.
    pub fn cell_means(&self, depth_net: &DepthNet, image: &RadianceImage) -> Planes {
        let size = lo_nets::depth::size_within([image.width(), image.height()], depth_net.longer_side());
        let image = if size == [image.width(), image.height()] { image } else { &resize(image, size[0], size[1]) };
        cell_means(image, self.cells())
    }

    /// Returns the predicted surface points of all shown cells with their rows and columns.
    pub fn surface(&self) -> Vec<([usize; 2], Vec3)> {
        let [rows, columns] = self.shown;
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| [row, column]));
        cells.map(|[row, column]| ([row, column], self.points_m.vector(row, column))).collect()
    }
}

/// Returns the surface points at the middle of the shown cells, `[3, rows, columns]`.
fn surface_points(depth: &DepthMap, camera: &Camera, [rows, columns]: [usize; 2], shown: [usize; 2]) -> Planes {
    let middle = |cell: usize, size: usize| (cell * CELL + CELL / 2).min(size - 1);
    Planes::from_fn([3, rows, columns], |axis, row, column| {
        if row >= shown[0] || column >= shown[1] {
            return 0.0;
        }
        let (x, y) = (middle(column, depth.width()), middle(row, depth.height()));
        camera.unproject(x as f64, y as f64, f64::from(depth[(x, y)]))[axis]
    })
}

/// Returns how many cells have their middle in `size` pixels, at least one.
fn shown_cells(size: usize) -> usize {
    size.saturating_sub(CELL / 2).div_ceil(CELL).max(1)
}

/// Returns the means of an image over the cells; 0 beyond the image.
fn cell_means(image: &RadianceImage, [rows, columns]: [usize; 2]) -> Planes {
    let mut sums = Planes::from_fn([3, rows, columns], |_, _, _| 0.0);
    let mut counts = vec![0.0f32; rows * columns];
    for y in 0..image.height() {
        for x in 0..image.width() {
            let cell = (y / CELL).min(rows - 1) * columns + (x / CELL).min(columns - 1);
            counts[cell] += 1.0;
            (0..3).for_each(|c| sums.values[c * rows * columns + cell] += image[(x, y)][c]);
        }
    }
    for (i, sum) in sums.values.iter_mut().enumerate() {
        *sum /= counts[i % counts.len()].max(1.0);
    }
    sums
}

/// Features of photos of one size as tensors.
#[derive(Clone, Debug)]
pub struct FeatureBatch {
    /// `[channels, images, rows, columns]` at 1/8.
    pub eighth: Tensor<4>,
    /// `[channels, images, rows, columns]` at 1/16.
    pub sixteenth: Tensor<4>,
    /// `[channels, images, rows, columns]` at 1/32.
    pub last: Tensor<4>,
    /// Linear colours of the cells, `[3, images, rows, columns]`.
    pub photo: Tensor<4>,
    /// Global lighting features, `[images, features]`.
    pub global: Tensor<2>,
    /// Logarithms of the photos' mean linear colours, `[images, 3]`.
    pub log_colour: Tensor<2>,
}

impl FeatureBatch {
    /// Creates a batch.
    ///
    /// # Panics
    /// Without photos, and where their sizes differ.
    pub fn new(photos: &[&PhotoFeatures], device: &Device) -> Self {
        let stack = |planes: fn(&PhotoFeatures) -> &Planes| {
            Planes::stack(&photos.iter().map(|photo| planes(photo)).collect::<Vec<_>>(), device)
        };
        let length = photos[0].global.len();
        let global: Vec<f32> = photos.iter().flat_map(|photo| photo.global.iter().copied()).collect();
        let global = Tensor::<2>::from_data(TensorData::new(global, [photos.len(), length]), device);
        Self {
            eighth: stack(|photo| &photo.eighth),
            sixteenth: stack(|photo| &photo.sixteenth),
            last: stack(|photo| &photo.last),
            photo: stack(|photo| &photo.photo),
            log_colour: global.clone().narrow(1, length - COLOUR, COLOUR),
            global,
        }
    }

    /// Returns a batch of one of the images.
    pub fn image(&self, image: usize) -> Self {
        let of = |planes: &Tensor<4>| planes.clone().narrow(1, image, 1);
        Self {
            eighth: of(&self.eighth),
            sixteenth: of(&self.sixteenth),
            last: of(&self.last),
            photo: of(&self.photo),
            global: self.global.clone().narrow(0, image, 1),
            log_colour: self.log_colour.clone().narrow(0, image, 1),
        }
    }

    /// Returns the number of images, rows and columns of cells.
    pub fn size(&self) -> [usize; 3] {
        let [_, images, rows, columns] = self.eighth.dims();
        [images, rows, columns]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_nets::depth::EncoderKind;

    use super::*;

    #[test]
    fn cells_are_blocks_of_the_networks_input() {
        let photo = Image::from_fn(90, 60, |x, y| [(2 * x) as u8, (4 * y) as u8, 77]);
        let net = DepthNet::new(EncoderKind::EfficientNetLite0, 16, 1, &Device::flex());
        let camera = Camera::from_hfov_deg(70.0, 90, 60).unwrap();
        let features = PhotoFeatures::new(&net, &photo, &camera);
        // 90 × 60 is padded to 96 × 64.
        assert_eq!((features.cells(), features.shown), ([8, 12], [7, 11]));
        assert_eq!(features.shape(), FeatureShape { eighth: 40, sixteenth: 112, last: 320, global: 16 });
        let expected = (0..8).map(|i| linear_from_srgb8(2 * (16 + i))).sum::<f32>() / 8.0;
        assert!((features.photo.at(0, 3, 2) - expected).abs() < 1e-5);
        let surface = features.surface();
        assert_eq!(surface.len(), 77);
        let depth = net.forward(&[&photo]).depth_m(&camera);
        for (cell, point) in surface {
            let (u, v, depth_m) = camera.project(point).unwrap();
            assert_eq!([v, u].map(|pixel| (pixel / CELL as f64) as usize), cell);
            let expected = depth[((u + 0.01) as usize, (v + 0.01) as usize)];
            assert!((depth_m as f32 / expected - 1.0).abs() < 1e-4, "{cell:?}: {depth_m} {expected}");
        }
        assert_eq!(features.points_m.vector(7, 3), Vec3::ZERO, "padding");
        let means = features.cell_means(&net, &photo.map(|rgb| rgb.map(linear_from_srgb8)));
        assert_eq!(means, features.photo);
    }
}
