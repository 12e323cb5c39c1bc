use lo_imaging::{Image, RadianceImage, resize_equirectangular};
use rayon::prelude::*;

/// Linear map from a panorama to the visible pixels of something under it.
#[derive(Clone, Debug)]
pub struct Transport {
    /// Sizes of the panoramas that weights refer to, one after the other.
    maps: Vec<[usize; 2]>,
    /// Size of the picture.
    size: [usize; 2],
    /// Where in the picture each row's pixel lies.
    places: Vec<[u16; 2]>,
    /// Where each row's entries begin, and one more.
    starts: Vec<usize>,
    /// Pixel of the panoramas, and its weight.
    columns: Vec<u16>,
    weights: Vec<f32>,
}

/// One visible pixel.
pub(super) struct Row {
    pub place: [u16; 2],
    /// Pixel of the maps (see [`Transport::new`]) and its weight.
    pub entries: Vec<(u16, f32)>,
}

impl Transport {
    /// `maps`: sizes of the resized panoramas that entries count through; together they have at most 65,536 pixels.
    pub(super) fn new(maps: Vec<[usize; 2]>, size: [usize; 2], rows: Vec<Row>) -> Self {
        assert!(maps.iter().map(|[width, height]| width * height).sum::<usize>() <= 1 << 16, "columns are 16 bits");
        let mut starts = vec![0];
        let (mut columns, mut weights, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            places.push(row.place);
            for (column, weight) in row.entries {
                columns.push(column);
                weights.push(weight);
            }
            starts.push(columns.len());
        }
        Self { maps, size, places, starts, columns, weights }
    }

    /// Radiance of the visible pixels, as a picture one pixel high, under a panorama of any size in the world's orientation.
    ///
    /// # Panics
    /// Where the panorama has no pixels.
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
        let pixels: Vec<[f32; 3]> = (0..self.places.len()).into_par_iter().map(pixel).collect();
        RadianceImage::new(pixels.len(), 1, pixels)
    }

    /// Puts what [`render`](Self::render) gave where it belongs; `background` elsewhere.
    pub fn picture<T: Copy>(&self, pixels: &[T], background: T) -> Image<T> {
        let [width, height] = self.size;
        let mut picture = Image::new(width, height, vec![background; width * height]);
        for (&[x, y], &pixel) in self.places.iter().zip(pixels) {
            picture[(usize::from(x), usize::from(y))] = pixel;
        }
        picture
    }
}
