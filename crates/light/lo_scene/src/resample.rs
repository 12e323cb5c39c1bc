//! Resampling of photos.

use lo_imaging::{Image, Photo, RadianceImage, linear_from_srgb8};
use rayon::prelude::*;

/// Long side of the working resolution in pixels; 3:2 photos then have the paper's 480 × 320 = 153,600 points.
const WORKING_LONG_SIDE: f64 = 480.0;

/// Largest number of pixels of the working resolution.
const WORKING_POINTS: f64 = 153_600.0;

/// Returns a photo without depth at the working resolution of estimation; see
/// [`Frame::working`](crate::Frame::working).
///
/// # Panics
/// If the photo has no pixels.
pub fn working_photo(photo: &Photo) -> Photo {
    let (width, height) = working_size(photo);
    resized_photo(photo, width, height)
}

/// Returns width and height of the working resolution.
pub(crate) fn working_size(photo: &Photo) -> (usize, usize) {
    let (width, height) = (photo.width() as f64, photo.height() as f64);
    let scale = (WORKING_LONG_SIDE / width.max(height)).min((WORKING_POINTS / (width * height)).sqrt()).min(1.0);
    (((width * scale) as usize).max(1), ((height * scale) as usize).max(1))
}

/// Resizes a photo: each new pixel is the mean linear value over its footprint (box filter with exact edge weights).
/// A photo of that size stays unchanged.
///
/// 8-bit photos are converted row by row, so that a 50-megapixel photo never needs 600 MB of floats.
pub fn resized_photo(photo: &Photo, width: usize, height: usize) -> Photo {
    match photo {
        photo if (photo.width(), photo.height()) == (width, height) => photo.clone(),
        Photo::Srgb8(image) => Photo::Linear(boxed(image, width, height, |_, p| p.map(linear_from_srgb8))),
        Photo::Encoded8(photo) => {
            Photo::Linear(boxed(&photo.image, width, height, |index, p| photo.radiance_of(p, index)))
        }
        Photo::Linear(image) => {
            let finite = |c: f32| if c.is_finite() { c.max(0.0) } else { 0.0 };
            Photo::Linear(boxed(image, width, height, |_, p| p.map(finite)))
        }
    }
}

fn boxed<T: Copy + Sync>(
    image: &Image<T>,
    width: usize,
    height: usize,
    linear: impl Fn(usize, T) -> [f32; 3] + Sync,
) -> RadianceImage {
    let columns: Vec<Footprint> = (0..width).map(|x| Footprint::new(x, width, image.width())).collect();
    let rows: Vec<Vec<[f32; 3]>> = (0..height)
        .into_par_iter()
        .map(|y| {
            let footprint = Footprint::new(y, height, image.height());
            let mut sums = vec![[0.0f32; 3]; image.width()];
            for (row, weight) in footprint.weights() {
                let first = row * image.width();
                let line = &image.pixels()[first..first + image.width()];
                for (x, (sum, &pixel)) in sums.iter_mut().zip(line).enumerate() {
                    let value = linear(first + x, pixel);
                    for c in 0..3 {
                        sum[c] += weight * value[c];
                    }
                }
            }
            let mean = |column: &Footprint| {
                let mut total = [0.0; 3];
                for (x, weight) in column.weights() {
                    for c in 0..3 {
                        total[c] += weight * sums[x][c];
                    }
                }
                total
            };
            columns.iter().map(mean).collect()
        })
        .collect();
    Image::new(width, height, rows.into_iter().flatten().collect())
}

/// The source pixels that a new pixel covers, along one axis.
struct Footprint {
    start: f64,
    end: f64,
    last: usize,
}

impl Footprint {
    fn new(index: usize, count: usize, source: usize) -> Self {
        let scale = source as f64 / count as f64;
        Self { start: index as f64 * scale, end: (index + 1) as f64 * scale, last: source - 1 }
    }

    /// Returns source indices with weights that sum to 1.
    fn weights(&self) -> impl Iterator<Item = (usize, f32)> {
        let (start, end, last) = (self.start, self.end, self.last);
        (start as usize..=(end.ceil() as usize).saturating_sub(1).clamp(start as usize, last)).map(move |i| {
            let overlap = end.min((i + 1) as f64) - start.max(i as f64);
            (i, (overlap / (end - start)) as f32)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn means_are_kept() {
        let photo_in = Photo::Linear(Image::from_fn(7, 5, |x, y| [x as f32, y as f32, 1.0]));
        let small = resized_photo(&photo_in, 3, 2).into_radiance();
        let mean = |image: &RadianceImage, c: usize| {
            image.pixels().iter().map(|p| p[c]).sum::<f32>() / image.pixels().len() as f32
        };
        for (c, expected) in [(0, 3.0), (1, 2.0), (2, 1.0)] {
            assert!((mean(&small, c) - expected).abs() < 1e-5);
        }
    }
}
