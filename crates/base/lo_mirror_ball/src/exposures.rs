use rayon::prelude::*;

use super::BallError;
use lo_imaging::{EncodedPhoto, Image, Photo, PhotoExposure, RadianceImage, linear_from_srgb8, srgb_from_linear};

/// An HDR image merged from a bracket of photos.
#[derive(Clone, Debug, PartialEq)]
pub struct MergedPhotos {
    /// Linear radiance; 1 is the first photo's white.
    pub radiance: RadianceImage,
    /// Pixels that are clipped in every photo: their radiance is a lower bound.
    pub clipped: Image<bool>,
}

/// sRGB value from which a channel counts as clipped (`docs/method.md` §1.2).
const CLIPPED: f32 = 250.0 / 255.0;
/// sRGB value up to which a channel counts as black.
const BLACK: f32 = 4.0 / 255.0;
/// Range of sRGB values in which exposures are compared.
const COMPARED: std::ops::Range<f32> = 20.0 / 255.0..230.0 / 255.0;
/// Least number of samples to compare two exposures.
const MIN_SAMPLES: usize = 100;
/// Number of pixels sampled to compare two photos.
const MAX_COMPARED_PIXELS: usize = 400_000;
/// Deviation from the median ratio, in stops, beyond which a sample is an outlier: something moved.
const MOVED_STOPS: f64 = 0.5;

/// Computes the exposure of each photo relative to the first from EXIF, in stops; more is brighter.
///
/// `None` unless every photo states its exposure time. Aperture and sensitivity count as equal unless every photo
/// states them.
pub fn stops_from_exif(shots: &[PhotoExposure]) -> Option<Vec<f64>> {
    let all = |of: fn(&PhotoExposure) -> Option<f64>| shots.iter().map(of).collect::<Option<Vec<f64>>>();
    let times = all(|shot| shot.time_s)?;
    let ones = || vec![1.0; shots.len()];
    let f_numbers = all(|shot| shot.f_number).unwrap_or_else(ones);
    let isos = all(|shot| shot.iso).unwrap_or_else(ones);
    let stops: Vec<f64> =
        times.iter().zip(&f_numbers).zip(&isos).map(|((time, n), iso)| (time * iso / (n * n)).log2()).collect();
    Some(stops.iter().map(|stop| stop - stops[0]).collect())
}

/// Estimates the exposure of each photo relative to the first from pixels, in stops.
///
/// Compares photos that are neighbours in brightness on pixels well exposed in both: the weighted mean of the
/// logarithms of their ratios, without outliers of half a stop from the median.
///
/// # Errors
/// No photo, photos of different sizes, or neighbours without enough such pixels.
pub fn estimate_stops(photos: &[Photo]) -> Result<Vec<f64>, BallError> {
    let pixels = same_size(photos)?.iter().product();
    let bracket: Vec<BracketPhoto> = photos.iter().map(BracketPhoto::new).collect();
    let step = usize::div_ceil(pixels, MAX_COMPARED_PIXELS).max(1);
    let mut order: Vec<(usize, f64)> = bracket.iter().map(|photo| photo.brightness(pixels, step)).enumerate().collect();
    order.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut stops = vec![0.0; photos.len()];
    for pair in order.windows(2) {
        let [dark, bright] = [pair[0].0, pair[1].0];
        let ratio = compare(&bracket[dark], &bracket[bright], pixels, step)
            .map_err(|pixels| BallError::NothingInCommon { photos: [dark.min(bright), dark.max(bright)], pixels })?;
        stops[bright] = stops[dark] + ratio;
    }
    Ok(stops.iter().map(|stop| stop - stops[0]).collect())
}

/// Merges photos with relative exposures `stops`: per channel, the weighted mean of value ÷ exposure.
///
/// The weight is the hat function of Debevec & Malik 1997 (eq. 4) over sRGB values: 0 if any channel is at least 250 of
/// 255, or this one at most 4. A channel without weight in any photo is taken from the longest exposure that is not
/// clipped, else from the shortest one.
///
/// Photos with values above 1 are HDR: none of their pixels is clipped, and all have the same weight. Negative values
/// become 0.
///
/// # Errors
/// No photo, photos of different sizes, a wrong number of stops, or pixels that are NaN or infinite.
pub fn merge_exposures(photos: &[Photo], stops: &[f64]) -> Result<MergedPhotos, BallError> {
    let [width, height] = same_size(photos)?;
    let finite = stops.iter().filter(|stop| stop.is_finite() && stop.abs() <= MAX_STOPS).count();
    if finite != photos.len() || stops.len() != photos.len() {
        return Err(BallError::Exposures { photos: photos.len(), exposures: finite.min(stops.len()) });
    }
    photos.iter().enumerate().try_for_each(|(index, photo)| check_finite(index, photo))?;
    let mut order: Vec<usize> = (0..photos.len()).collect();
    order.sort_by(|&a, &b| stops[a].total_cmp(&stops[b]));
    let bracket: Vec<(BracketPhoto, f32)> = order
        .iter()
        .map(|&photo| (BracketPhoto::new(&photos[photo]), (stops[0] - stops[photo]).exp2() as f32))
        .collect();
    let merged = (0..width * height).into_par_iter().map(|pixel| merge_pixel(&bracket, pixel)).unzip();
    let (radiance, clipped): (Vec<[f32; 3]>, Vec<bool>) = merged;
    Ok(MergedPhotos {
        radiance: RadianceImage::new(width, height, radiance),
        clipped: Image::new(width, height, clipped),
    })
}

/// Largest exposure in stops: no camera exceeds it, and f32 holds it.
const MAX_STOPS: f64 = 40.0;

fn merge_pixel(bracket: &[(BracketPhoto, f32)], pixel: usize) -> ([f32; 3], bool) {
    let [mut sum, mut weights] = [[0.0f32; 3]; 2];
    // from the shortest exposure to the longest
    let mut kept = None;
    let mut shortest = [0.0; 3];
    for (index, (photo, gain)) in bracket.iter().enumerate() {
        let sample = photo.sample(pixel);
        let radiance = sample.linear.map(|v| v * gain);
        if index == 0 {
            shortest = radiance;
        }
        if !sample.clipped {
            kept = Some(radiance);
        }
        for c in 0..3 {
            sum[c] += sample.weights[c] * radiance[c];
            weights[c] += sample.weights[c];
        }
    }
    let without_weight = kept.unwrap_or(shortest);
    let mixed = [0, 1, 2].map(|c| if weights[c] > 0.0 { sum[c] / weights[c] } else { without_weight[c] });
    (mixed, kept.is_none())
}

/// A photo of a bracket.
pub(super) struct BracketPhoto<'a> {
    photo: &'a Photo,
    /// Whether white is clipped; not for HDR photos.
    clips: bool,
}

/// A pixel of a bracket photo.
pub(super) struct ExposureSample {
    /// Linear light, not negative.
    pub linear: [f32; 3],
    /// sRGB values.
    pub code: [f32; 3],
    /// Weights of the channels in the merge.
    weights: [f32; 3],
    /// Whether any channel is clipped.
    pub clipped: bool,
}

impl<'a> BracketPhoto<'a> {
    pub fn new(photo: &'a Photo) -> Self {
        let clips = match photo {
            Photo::Srgb8(_) | Photo::Encoded8(_) => true,
            Photo::Linear(image) => !image.pixels().par_iter().flatten_iter().any(|&v| v > 1.0),
        };
        Self { photo, clips }
    }

    pub fn sample(&self, pixel: usize) -> ExposureSample {
        let (linear, code) = match self.photo {
            Photo::Srgb8(image) => {
                let stored = image.pixels()[pixel];
                (stored.map(linear_from_srgb8), stored.map(|v| f32::from(v) / 255.0))
            }
            Photo::Encoded8(EncodedPhoto { image, encoding }) => {
                let stored = image.pixels()[pixel];
                (encoding.linear(stored).map(|v| v.max(0.0)), stored.map(|v| f32::from(v) / 255.0))
            }
            Photo::Linear(image) => {
                let linear = image.pixels()[pixel].map(|v| v.max(0.0));
                (linear, if self.clips { linear.map(srgb_from_linear) } else { [0.5; 3] })
            }
        };
        if !self.clips {
            return ExposureSample { linear, code, weights: [1.0; 3], clipped: false };
        }
        let greatest = code.into_iter().fold(0.0, f32::max);
        let weights = code.map(|v| (v - BLACK).min(CLIPPED - greatest).max(0.0));
        ExposureSample { linear, code, weights, clipped: greatest >= CLIPPED }
    }

    /// Mean over pixels of the sum of channels: sRGB values, or logarithms for HDR.
    fn brightness(&self, pixels: usize, step: usize) -> f64 {
        let sums: Vec<f64> = (0..pixels)
            .step_by(step)
            .map(|pixel| {
                let ExposureSample { linear, code, .. } = self.sample(pixel);
                let values = if self.clips { code } else { linear.map(|v| (1.0 + v).ln()) };
                f64::from(values[0] + values[1] + values[2])
            })
            .collect();
        sums.iter().sum::<f64>() / sums.len().max(1) as f64
    }
}

/// Returns the exposure of `bright` relative to `dark` in stops; as error, the number of samples if there are too few.
fn compare(dark: &BracketPhoto, bright: &BracketPhoto, pixels: usize, step: usize) -> Result<f64, usize> {
    let mut ratios = Vec::new();
    for pixel in (0..pixels).step_by(step) {
        let (a, b) = (dark.sample(pixel), bright.sample(pixel));
        if a.clipped || b.clipped {
            continue;
        }
        for c in 0..3 {
            let good = |sample: &ExposureSample| COMPARED.contains(&sample.code[c]) && sample.linear[c] > 0.0;
            if good(&a) && good(&b) {
                let ratio = (f64::from(b.linear[c]) / f64::from(a.linear[c])).log2();
                ratios.push((ratio, f64::from(a.weights[c]) * f64::from(b.weights[c])));
            }
        }
    }
    if ratios.len() < MIN_SAMPLES {
        return Err(ratios.len());
    }
    let middle = ratios.len() / 2;
    let median = ratios.select_nth_unstable_by(middle, |a, b| a.0.total_cmp(&b.0)).1.0;
    let near = ratios.iter().filter(|(ratio, _)| (ratio - median).abs() <= MOVED_STOPS);
    let (sum, weights) = near.fold((0.0, 0.0), |(sum, weights), (ratio, w)| (sum + ratio * w, weights + w));
    Ok(if weights > 0.0 { sum / weights } else { median })
}

pub(super) fn same_size(photos: &[Photo]) -> Result<[usize; 2], BallError> {
    let size = |photo: &Photo| [photo.width(), photo.height()];
    let first = photos.first().map(size).filter(|[width, height]| width * height > 0).ok_or(BallError::NoPhoto)?;
    match photos.iter().position(|photo| size(photo) != first) {
        Some(photo) => Err(BallError::Sizes { photo, size: size(&photos[photo]), first }),
        None => Ok(first),
    }
}

fn check_finite(index: usize, photo: &Photo) -> Result<(), BallError> {
    let Photo::Linear(image) = photo else { return Ok(()) };
    let bad = image.pixels().par_iter().position_first(|pixel| !pixel.iter().all(|v| v.is_finite()));
    bad.map_or(Ok(()), |at| Err(BallError::NotFinite { photo: index, x: at % image.width(), y: at / image.width() }))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_imaging::srgb8_from_linear;

    /// A step wedge: radiance from 0.001 to 100 by column, coloured.
    fn wedge() -> RadianceImage {
        let at = |x: usize| 0.001 * 1e5f32.powf(x as f32 / 399.0);
        RadianceImage::from_fn(400, 40, |x, _| [at(x), 0.7 * at(x), 0.4 * at(x)])
    }

    fn shot(radiance: &RadianceImage, stops: f32) -> Photo {
        Photo::Srgb8(radiance.map(|rgb| rgb.map(|v| srgb8_from_linear(v * stops.exp2()))))
    }

    #[test]
    fn a_bracket_gives_back_the_light() {
        let wedge = wedge();
        let stops = [0.0, -3.0, -6.0, 4.0];
        let photos: Vec<Photo> = stops.iter().map(|&stop| shot(&wedge, stop)).collect();
        let estimated = estimate_stops(&photos).unwrap();
        for (got, expected) in estimated.iter().zip(stops) {
            // 2 % of an exposure
            assert!((got - f64::from(expected)).abs() < 1.02f64.log2(), "{estimated:?}");
        }
        let merged = merge_exposures(&photos, &stops.map(f64::from)).unwrap();
        for x in 0..400 {
            let (got, truth) = (merged.radiance[(x, 3)], wedge[(x, 3)]);
            // the shortest exposure clips at 2^6 × (250 / 255)^2.2 of the first photo's white
            assert_eq!(
                merged.clipped[(x, 3)],
                truth[0] * 2f32.powi(-6) >= lo_imaging::linear_from_srgb(CLIPPED - 0.5 / 255.0),
                "{x}"
            );
            if !merged.clipped[(x, 3)] && truth[2] > 0.01 {
                // half an 8-bit step, with weights that exclude the darkest ones
                assert!((0..3).all(|c| (got[c] / truth[c] - 1.0).abs() < 0.04), "{x}: {got:?} {truth:?}");
            } else if merged.clipped[(x, 3)] {
                assert!(got[0] <= truth[0] * 1.02 && got[0] > 60.0, "{x}: a lower bound, {got:?} {truth:?}");
            }
        }
    }

    #[test]
    fn exif_tells_relative_exposures() {
        let shot = |time_s: f64, f_number: Option<f64>, iso: Option<f64>| PhotoExposure {
            time_s: Some(time_s),
            f_number,
            iso,
        };
        let stops =
            stops_from_exif(&[shot(0.01, Some(4.0), Some(100.0)), shot(0.04, Some(5.6569), Some(400.0))]).unwrap();
        assert!((stops[1] - 3.0).abs() < 1e-4 && stops[0] == 0.0, "{stops:?}");
        // one photo does not state its aperture
        let stops = stops_from_exif(&[shot(0.01, Some(4.0), None), shot(0.04, None, None)]).unwrap();
        assert!((stops[1] - 2.0).abs() < 1e-9);
        assert_eq!(stops_from_exif(&[shot(0.01, None, None), PhotoExposure::default()]), None);
    }

    #[test]
    fn what_cannot_be_merged_is_named() {
        let wedge = wedge();
        let photos = [shot(&wedge, 0.0), Photo::Srgb8(Image::new(2, 2, vec![[9; 3]; 4]))];
        assert_eq!(
            merge_exposures(&photos, &[0.0, 1.0]),
            Err(BallError::Sizes { photo: 1, size: [2, 2], first: [400, 40] })
        );
        assert_eq!(merge_exposures(&[], &[]), Err(BallError::NoPhoto));
        let one = [shot(&wedge, 0.0)];
        assert_eq!(merge_exposures(&one, &[f64::NAN]), Err(BallError::Exposures { photos: 1, exposures: 0 }));
        assert_eq!(merge_exposures(&one, &[]), Err(BallError::Exposures { photos: 1, exposures: 0 }));
        let mut bad = wedge.clone();
        bad[(7, 5)][1] = f32::NAN;
        assert_eq!(
            merge_exposures(&[one[0].clone(), Photo::Linear(bad)], &[0.0, 0.0]),
            Err(BallError::NotFinite { photo: 1, x: 7, y: 5 })
        );
        // 12 stops apart a tenth of the wedge's range is not well exposed in both
        let far = [
            Photo::Srgb8(Image::new(20, 20, vec![[0; 3]; 400])),
            Photo::Srgb8(Image::new(20, 20, vec![[255; 3]; 400])),
        ];
        assert_eq!(estimate_stops(&far), Err(BallError::NothingInCommon { photos: [0, 1], pixels: 0 }));
    }

    #[test]
    fn pictures_of_high_range_are_never_clipped() {
        let wedge = wedge();
        let merged = merge_exposures(&[Photo::Linear(wedge.clone())], &[0.0]).unwrap();
        assert!(merged.radiance == wedge && merged.clipped.pixels().iter().all(|clipped| !clipped));
    }
}
