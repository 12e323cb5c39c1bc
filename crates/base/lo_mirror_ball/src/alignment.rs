use super::BallError;
use super::exposures::{BracketPhoto, same_size};
use lo_imaging::{Image, Photo};

/// Largest longer side, in pixels, at which photos are compared.
const COMPARED_SIDE: usize = 1024;
/// Smallest shorter side, in pixels, of the coarsest pyramid level.
const COARSEST_SIDE: usize = 24;
/// Least share of pixels that must be well exposed in both photos.
const MIN_SHARE: f64 = 0.02;

/// Measures the shift of each photo against the first one, in pixels.
///
/// Searches from coarse to fine for the integer shift that best aligns the pixels well exposed in both. The resolution
/// is 1/1024 of the longer side. `None` for a photo with too few such pixels.
///
/// # Errors
/// No photo, photos of different sizes, or a wrong number of stops.
pub fn misalignment_px(photos: &[Photo], stops: &[f64]) -> Result<Vec<Option<f64>>, BallError> {
    let [width, height] = same_size(photos)?;
    if stops.len() != photos.len() {
        return Err(BallError::Exposures { photos: photos.len(), exposures: stops.len() });
    }
    let factor = width.max(height).div_ceil(COMPARED_SIDE);
    let pyramids: Vec<Vec<LogImage>> =
        photos.iter().zip(stops).map(|(photo, &stop)| pyramid(photo, stop, factor)).collect();
    Ok(pyramids.iter().map(|other| Some(shift(&pyramids[0], other)? * factor as f64)).collect())
}

/// Logarithm of radiance, and weight 1 for well-exposed pixels; 0 and 0 for others.
type LogImage = Image<[f32; 2]>;

fn pyramid(photo: &Photo, stop: f64, factor: usize) -> Vec<LogImage> {
    let bracket_photo = BracketPhoto::new(photo);
    let (width, height) = (photo.width().div_ceil(factor), photo.height().div_ceil(factor));
    let gain = (stop * std::f64::consts::LN_2) as f32;
    let finest = LogImage::from_fn(width, height, |x, y| {
        let sample = bracket_photo.sample(y * factor * photo.width() + x * factor);
        let green = sample.linear[1];
        let good = !sample.clipped && green > 0.0 && sample.code[1] > 16.0 / 255.0;
        if good { [green.ln() - gain, 1.0] } else { [0.0; 2] }
    });
    let mut levels = vec![finest];
    while let Some(last) = levels.last().filter(|last| last.width().min(last.height()) >= 2 * COARSEST_SIDE) {
        let half = LogImage::from_fn(last.width() / 2, last.height() / 2, |x, y| {
            let mut sum = [0.0; 2];
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let [value, count] = last[(2 * x + dx, 2 * y + dy)];
                sum = [sum[0] + value, sum[1] + count];
            }
            // pixels at the border of well-exposed regions depend on where that border is
            if sum[1] >= 3.0 { [sum[0] / sum[1], 1.0] } else { [0.0; 2] }
        });
        levels.push(half);
    }
    levels
}

/// Returns the length of the shift between two pyramids, in pixels of the finest level.
fn shift(first: &[LogImage], other: &[LogImage]) -> Option<f64> {
    let mut found = [0i64; 2];
    for (a, b) in first.iter().zip(other).rev() {
        let around = |&[x, y]: &[i64; 2]| {
            (-2..=2).flat_map(move |dy| (-2..=2).map(move |dx| [2 * x + dx, 2 * y + dy])).collect::<Vec<_>>()
        };
        let costs = around(&found).into_iter().filter_map(|at| Some((difference(a, b, at)?, at)));
        let best = costs.min_by(|a, b| a.0.total_cmp(&b.0).then_with(|| length(a.1).total_cmp(&length(b.1))));
        // without a comparison at this level, keep the shift of the coarser one
        found = best.map_or([2 * found[0], 2 * found[1]], |(_, at)| at);
    }
    difference(first.first()?, other.first()?, found)?;
    Some(length(found))
}

fn length([x, y]: [i64; 2]) -> f64 {
    (x as f64).hypot(y as f64)
}

/// Mean absolute deviation of the differences of the logarithms from their mean.
fn difference(a: &LogImage, b: &LogImage, [dx, dy]: [i64; 2]) -> Option<f64> {
    let (width, height) = (a.width() as i64, a.height() as i64);
    let pairs = || {
        (0.max(-dy)..height.min(height - dy)).flat_map(move |y| {
            (0.max(-dx)..width.min(width - dx)).filter_map(move |x| {
                let [one, known] = a[(x as usize, y as usize)];
                let [two, also] = b[((x + dx) as usize, (y + dy) as usize)];
                (known * also > 0.0).then_some(f64::from(two - one))
            })
        })
    };
    let (sum, count) = pairs().fold((0.0, 0usize), |(sum, count), d| (sum + d, count + 1));
    if (count as f64) < MIN_SHARE * (width * height) as f64 || count < 50 {
        return None;
    }
    let mean = sum / count as f64;
    Some(pairs().map(|d| (d - mean).abs()).sum::<f64>() / count as f64)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_imaging::{RadianceImage, resize, srgb8_from_linear};

    #[test]
    fn shifts_of_a_real_photo_are_found_at_other_exposures() {
        let photo = lo_imaging::read_radiance(lo_testdata::asset("library_color.jpg")).unwrap();
        let photo = resize(&photo, 480, 360);
        let shot = |dx: usize, dy: usize, gain: f32| {
            let cut = RadianceImage::from_fn(400, 300, |x, y| photo[(x + 30 + dx, y + 30 + dy)]);
            Photo::Srgb8(cut.map(|rgb| rgb.map(|v| srgb8_from_linear(v * gain))))
        };
        let photos = [shot(0, 0, 1.0), shot(0, 0, 0.25), shot(3, 4, 0.25), shot(24, 7, 2.0)];
        let found = misalignment_px(&photos, &[0.0, -2.0, -2.0, 1.0]).unwrap();
        assert_eq!(found, [Some(0.0), Some(0.0), Some(5.0), Some(25.0)]);
        let dark = Photo::Srgb8(Image::new(400, 300, vec![[0; 3]; 400 * 300]));
        assert_eq!(misalignment_px(&[photos[0].clone(), dark], &[0.0, -20.0]).unwrap()[1], None);
    }
}
