use lo_imaging::{Image, RadianceImage, resize_equirectangular};
use rayon::prelude::*;

/// Linear map from a panorama to the visible pixels of an object lit by it.
#[derive(Clone, Debug)]
pub struct Transport {
    /// Sizes of the resized panoramas; columns index their concatenated pixels.
    maps: Vec<[usize; 2]>,
    /// Size of the image.
    size: [usize; 2],
    /// Pixel of each row in the image.
    positions: Vec<[u16; 2]>,
    /// Index of each row's first entry, and the number of entries.
    starts: Vec<usize>,
    /// Panorama pixel of each entry.
    columns: Vec<u16>,
    /// Weight of each entry.
    weights: Vec<f32>,
}

/// One visible pixel of the object.
pub(super) struct Row {
    pub position: [u16; 2],
    /// Panorama pixel (see [`Transport::new`]) and its weight.
    pub entries: Vec<(u16, f32)>,
}

impl Transport {
    /// Assembles the rows. `maps` are the sizes of the resized panoramas, of at most 65,536 pixels in total.
    pub(super) fn new(maps: Vec<[usize; 2]>, size: [usize; 2], rows: Vec<Row>) -> Self {
        assert!(maps.iter().map(|[width, height]| width * height).sum::<usize>() <= 1 << 16, "columns have 16 bits");
        let mut starts = vec![0];
        let (mut columns, mut weights, mut positions) = (Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            positions.push(row.position);
            for (column, weight) in row.entries {
                columns.push(column);
                weights.push(weight);
            }
            starts.push(columns.len());
        }
        Self { maps, size, positions, starts, columns, weights }
    }

    /// Renders the visible pixels, as an image one pixel high, under a panorama in the world's orientation.
    ///
    /// # Panics
    /// If the panorama has no pixels.
    pub fn render(&self, panorama: &RadianceImage) -> RadianceImage {
        let light: Vec<[f32; 3]> = self
            .maps
            .iter()
            .flat_map(|&[width, height]| resize_equirectangular(panorama, width, height).into_pixels())
            .collect();
        let pixel = |row: usize| {
            let entries = self.starts[row]..self.starts[row + 1];
            let mut sum = [0.0f32; 3];
            for (&column, &weight) in self.columns[entries.clone()].iter().zip(&self.weights[entries]) {
                let rgb = light[usize::from(column)];
                for c in 0..3 {
                    sum[c] += weight * rgb[c];
                }
            }
            sum
        };
        let pixels: Vec<[f32; 3]> = (0..self.positions.len()).into_par_iter().map(pixel).collect();
        RadianceImage::new(pixels.len(), 1, pixels)
    }

    /// Arranges the pixels of [`render`](Self::render) as an image, with `background` elsewhere.
    pub fn picture<T: Copy>(&self, pixels: &[T], background: T) -> Image<T> {
        let [width, height] = self.size;
        let mut picture = Image::new(width, height, vec![background; width * height]);
        for (&[x, y], &pixel) in self.positions.iter().zip(pixels) {
            picture[(usize::from(x), usize::from(y))] = pixel;
        }
        picture
    }
}
