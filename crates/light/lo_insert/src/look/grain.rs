use std::sync::Arc;

use lo_imaging::{Photo, srgb_from_linear};
use rayon::prelude::*;

/// Side of the blocks that are measured, pixels: two of JPEG's.
const BLOCK: usize = 16;

/// Most blocks that are measured, evenly distributed.
const MOST_BLOCKS: usize = 6000;

/// Ranges of brightness, of equal width in sRGB's values.
const LEVELS: usize = 8;

/// Share of the blocks of a level that are taken for flat: those that vary least.
const FLAT_SHARE: f64 = 0.15;

/// Fewest flat blocks of a level, of twice as many, and fewest of all for a measurement.
const LEAST_BLOCKS: usize = 4;

/// Values near black and white are clipped, in sRGB's range.
const UNCLIPPED: std::ops::RangeInclusive<f32> = 0.012..=0.985;

/// Share of a block's values that may be clipped.
const MOST_CLIPPED: f32 = 0.01;

/// Standard deviation below which there is no grain, in sRGB's range: less than rounding to 8 bits makes.
const LEAST_DEVIATION: f32 = 0.25 / 255.0;

/// Greatest ratio of the deviations of a level and the next darker one. In sRGB's values, shot noise is nearly the same
/// at all levels, and read noise is stronger in darker ones.
const MOST_RISE_BRIGHTER: f32 = 1.1;

/// Greatest ratio of the deviations of a level and the next brighter one.
const MOST_RISE_DARKER: f32 = 1.5;

/// Levels by which others are judged: curves of cameras flatten noise near black and white.
const REFERENCES: std::ops::Range<usize> = 2..LEVELS - 1;

/// Deviation of a level, over the median, from which others are judged by it: drawn and uniform surfaces have none.
const LEAST_REFERENCE: f32 = 0.25;

/// Share of noise from which a level's blocks are used for the pattern; others show texture.
const LEAST_NOISE_SHARE: f32 = 0.8;

/// Side of the pattern, pixels; it repeats.
const SIDE: usize = 256;

/// Distance of the blocks in the pattern. They overlap by half, so that no edges show.
const STEP: usize = BLOCK / 2;

/// Step of the sequence that chooses blocks, which visits all evenly (Weyl, with the golden ratio).
const GOLDEN_RATIO: f64 = 0.618_033_988_749_894_8;

/// A photo's noise: its strength by brightness and channel, and a pattern of the photo's own noise.
///
/// The pattern is quilted from the residuals of flat blocks, so that it has the photo's spectrum, the correlation of
/// its channels and the traces of its compression. Synthesis by brightness follows AV1's film grain (Norkin and
/// Birkbeck, *Film Grain Synthesis for AV1 Video Codec*, 2018).
#[derive(Clone, Debug)]
pub(crate) struct Grain {
    /// Standard deviation of R, G, B in sRGB's range, at the middle of each level.
    deviation: [[f32; 3]; LEVELS],
    /// Noise of unit variance, [`SIDE`]² pixels, row by row.
    pattern: Arc<[[f32; 3]]>,
}

/// A block of the photo without its linear trend.
struct Block {
    /// Mean of its values, in sRGB's range.
    brightness: f32,
    /// Variance of R, G, B.
    variance: [f32; 3],
    residual: Vec<[f32; 3]>,
}

/// Noise of a level of brightness.
struct Measured {
    level: usize,
    deviation: [f32; 3],
}

impl Measured {
    fn new(level: usize, blocks: &[&Block], rounding: f32) -> Self {
        let mean = |c: usize| blocks.iter().map(|block| block.variance[c]).sum::<f32>() / blocks.len() as f32;
        Self { level, deviation: [0, 1, 2].map(|c| (mean(c) - rounding).max(0.0).sqrt()) }
    }

    fn strength(&self) -> f32 {
        self.deviation.iter().map(|d| d * d).sum::<f32>().sqrt()
    }

    /// Returns the share of the deviation that is noise by the other levels: texture only adds to it.
    fn noise_share(&self, references: &[&Self]) -> f32 {
        let most = |other: &&Self| match self.level.checked_sub(other.level) {
            Some(brighter) => other.strength() * MOST_RISE_BRIGHTER.powi(brighter as i32),
            None => other.strength() * MOST_RISE_DARKER.powi((other.level - self.level) as i32),
        };
        let most = references.iter().map(most).fold(f32::INFINITY, f32::min);
        (most / self.strength().max(f32::MIN_POSITIVE)).min(1.0)
    }
}

impl Grain {
    /// Measures a photo; `None` if it is too small or has no noise.
    pub fn measure(photo: &Photo) -> Option<Self> {
        let blocks = blocks(photo);
        // rounding to 8 bits adds its own variance, to the photo and to the composite
        let rounding = if matches!(photo, Photo::Linear(_)) { 0.0 } else { 1.0 / (12.0 * 255.0 * 255.0) };
        let mut flat: Vec<(usize, Vec<&Block>)> = Vec::new();
        for level in 0..LEVELS {
            let mut of_level: Vec<&Block> = blocks.iter().filter(|block| level_of(block.brightness) == level).collect();
            if of_level.len() < 2 * LEAST_BLOCKS {
                continue;
            }
            let count = ((of_level.len() as f64 * FLAT_SHARE).ceil() as usize).max(LEAST_BLOCKS);
            of_level.sort_by(|a, b| a.variance.iter().sum::<f32>().total_cmp(&b.variance.iter().sum()));
            of_level.truncate(count);
            flat.push((level, of_level));
        }
        let mut measured: Vec<Measured> =
            flat.iter().map(|(level, blocks)| Measured::new(*level, blocks, rounding)).collect();
        let mut strengths: Vec<f32> = measured.iter().map(Measured::strength).collect();
        strengths.sort_by(f32::total_cmp);
        let least = strengths.get(strengths.len() / 2).map_or(0.0, |median| LEAST_REFERENCE * median);
        let is_reference = |level: &&Measured| REFERENCES.contains(&level.level) && level.strength() >= least;
        let references: Vec<&Measured> = measured.iter().filter(is_reference).collect();
        let shares: Vec<f32> = measured.iter().map(|level| level.noise_share(&references)).collect();
        for (level, share) in measured.iter_mut().zip(&shares) {
            level.deviation = level.deviation.map(|deviation| deviation * share);
        }
        let loudest = measured.iter().flat_map(|level| level.deviation).fold(0.0, f32::max);
        if loudest < LEAST_DEVIATION {
            return None;
        }
        let nearest = |level: usize| measured.iter().min_by_key(|other| other.level.abs_diff(level));
        let deviation = std::array::from_fn(|level| nearest(level).map_or([0.0; 3], |nearest| nearest.deviation));
        let clean = flat.iter().zip(&shares).filter(|(_, share)| **share >= LEAST_NOISE_SHARE);
        let normalised: Vec<Vec<[f32; 3]>> =
            clean.flat_map(|((_, blocks), _)| blocks).filter_map(|block| unit(block)).collect();
        (normalised.len() >= LEAST_BLOCKS).then(|| Self { deviation, pattern: quilt(&normalised).into() })
    }

    /// Returns the noise at a pixel of a brightness in sRGB's range.
    pub fn at(&self, (x, y): (usize, usize), brightness: f32) -> [f32; 3] {
        let place = (brightness.clamp(0.0, 1.0) * LEVELS as f32 - 0.5).clamp(0.0, LEVELS as f32 - 1.0);
        let lower = (place as usize).min(LEVELS - 2);
        let share = place - lower as f32;
        let unit = self.pattern[y % SIDE * SIDE + x % SIDE];
        [0, 1, 2].map(|c| {
            let (a, b) = (self.deviation[lower][c], self.deviation[lower + 1][c]);
            unit[c] * (a + (b - a) * share)
        })
    }
}

fn level_of(brightness: f32) -> usize {
    ((brightness * LEVELS as f32) as usize).min(LEVELS - 1)
}

/// Measures blocks all over the photo, on JPEG's grid.
fn blocks(photo: &Photo) -> Vec<Block> {
    let (columns, rows) = (photo.width() / BLOCK, photo.height() / BLOCK);
    let step = ((columns * rows) as f64 / MOST_BLOCKS as f64).sqrt().ceil().max(1.0) as usize;
    let places: Vec<(usize, usize)> =
        (0..rows).step_by(step).flat_map(|y| (0..columns).step_by(step).map(move |x| (x * BLOCK, y * BLOCK))).collect();
    places.into_par_iter().filter_map(|place| block(photo, place)).collect()
}

fn block(photo: &Photo, (left, top): (usize, usize)) -> Option<Block> {
    let pixel = |i: usize| match (left + i % BLOCK, top + i / BLOCK) {
        at if let Photo::Srgb8(image) = photo => image[at].map(|v| f32::from(v) / 255.0),
        at => photo.linear_at(at).map(srgb_from_linear),
    };
    let mut values: Vec<[f32; 3]> = (0..BLOCK * BLOCK).map(pixel).collect();
    let clipped = values.iter().flatten().filter(|v| !UNCLIPPED.contains(v)).count();
    if clipped as f32 > MOST_CLIPPED * (3 * BLOCK * BLOCK) as f32 {
        return None;
    }
    let count = (BLOCK * BLOCK) as f32;
    let mut brightness = 0.0;
    let mut variance = [0.0; 3];
    // a plane by least squares; on a regular grid its terms are independent
    let centred = |i: usize| i as f32 - (BLOCK as f32 - 1.0) / 2.0;
    let spread = (0..BLOCK).map(|i| centred(i).powi(2)).sum::<f32>() * BLOCK as f32;
    for c in 0..3 {
        let mean = values.iter().map(|v| v[c]).sum::<f32>() / count;
        let slope = |at: fn(usize) -> usize| {
            values.iter().enumerate().map(|(i, v)| centred(at(i)) * v[c]).sum::<f32>() / spread
        };
        let (dx, dy) = (slope(|i| i % BLOCK), slope(|i| i / BLOCK));
        for (i, value) in values.iter_mut().enumerate() {
            value[c] -= mean + dx * centred(i % BLOCK) + dy * centred(i / BLOCK);
        }
        brightness += mean / 3.0;
        variance[c] = values.iter().map(|v| v[c] * v[c]).sum::<f32>() / (count - 3.0);
    }
    Some(Block { brightness, variance, residual: values })
}

/// Scales a block to unit variance; `None` if a channel has none.
fn unit(block: &Block) -> Option<Vec<[f32; 3]>> {
    let scale = block.variance.map(|v| 1.0 / v.sqrt());
    scale
        .iter()
        .all(|s| s.is_finite())
        .then(|| block.residual.iter().map(|v| [0, 1, 2].map(|c| v[c] * scale[c])).collect())
}

/// Lays blocks over each other, with weights whose squares add up to 1.
fn quilt(blocks: &[Vec<[f32; 3]>]) -> Vec<[f32; 3]> {
    let weight = |i: usize| (std::f32::consts::PI * (i as f32 + 0.5) / BLOCK as f32).sin();
    let mut pattern = vec![[0.0; 3]; SIDE * SIDE];
    let across = SIDE / STEP;
    for place in 0..across * across {
        let (left, top) = (place % across * STEP, place / across * STEP);
        let chosen = ((place as f64 * GOLDEN_RATIO).fract() * blocks.len() as f64) as usize;
        for (i, value) in blocks[chosen].iter().enumerate() {
            let (x, y) = (i % BLOCK, i / BLOCK);
            let sum = &mut pattern[(top + y) % SIDE * SIDE + (left + x) % SIDE];
            let weight = weight(x) * weight(y);
            (0..3).for_each(|c| sum[c] += weight * value[c]);
        }
    }
    pattern
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_imaging::{Image, RadianceImage, linear_from_srgb};

    /// A normal deviate by a pixel and channel: twelve uniform values less their mean.
    fn normal(x: usize, y: usize, c: usize) -> f32 {
        let mut state = (x as u64) << 40 ^ (y as u64) << 20 ^ c as u64 ^ 0x9e37_79b9_7f4a_7c15;
        let mut next = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((z ^ (z >> 31)) >> 40) as f32 / (1 << 24) as f32
        };
        (0..12).map(|_| next()).sum::<f32>() - 6.0
    }

    /// Deviation of the test photos in sRGB's range, at a brightness.
    fn deviation(brightness: f32) -> [f32; 3] {
        [0.010, 0.006, 0.016].map(|d| d * (1.5 - brightness))
    }

    /// Smooth gradients, in a quarter of the photo with a fine texture, under noise that is smoothed along rows.
    fn noisy(width: usize, height: usize) -> Image<[f32; 3]> {
        let smooth = 1.0 / 2.0f32.sqrt();
        Image::from_fn(width, height, |x, y| {
            let brightness = 0.1 + 0.8 * x as f32 / width as f32;
            let texture = if 2 * y > height && x % 3 == 0 { 0.05 } else { 0.0 };
            let deviation = deviation(brightness);
            [0, 1, 2].map(|c| {
                let noise = smooth * (normal(x, y, c) + normal(x + 1, y, c));
                brightness + texture + deviation[c] * noise
            })
        })
    }

    #[test]
    fn noise_is_measured_by_brightness_and_channel() {
        let image = noisy(640, 480);
        let eight = Photo::Srgb8(image.map(|v| v.map(|v| (v * 255.0).round() as u8)));
        let linear = Photo::Linear(image.map(|v| v.map(linear_from_srgb)));
        for photo in [eight, linear] {
            let grain = Grain::measure(&photo).unwrap();
            for brightness in [0.25, 0.5, 0.75] {
                let mut sums = [0.0f32; 3];
                (0..SIDE * SIDE).for_each(|i| {
                    let noise = grain.at((i % SIDE, i / SIDE), brightness);
                    (0..3).for_each(|c| sums[c] += noise[c] * noise[c]);
                });
                for (sum, expected) in sums.iter().zip(deviation(brightness)) {
                    let ratio = (sum / (SIDE * SIDE) as f32).sqrt() / expected;
                    assert!((ratio - 1.0).abs() < 0.15, "{brightness}: {ratio}");
                }
            }
            // neighbours along a row correlate by 1/2, along a column not, and channels not
            let product = |dx: usize, dy: usize, c: usize, d: usize| {
                let at = |x, y| grain.pattern[y % SIDE * SIDE + x % SIDE];
                let sum: f32 =
                    (0..SIDE * SIDE).map(|i| at(i % SIDE, i / SIDE)[c] * at(i % SIDE + dx, i / SIDE + dy)[d]).sum();
                sum / (SIDE * SIDE) as f32
            };
            for (found, expected) in [
                (product(1, 0, 1, 1), 0.5),
                (product(0, 1, 1, 1), 0.0),
                (product(2, 0, 1, 1), 0.0),
                (product(0, 0, 0, 1), 0.0),
            ] {
                assert!((found - expected).abs() < 0.1, "{found} instead of {expected}");
            }
        }
    }

    #[test]
    fn photos_without_noise_have_no_grain() {
        let clean = Image::from_fn(320, 240, |x, y| [(x / 2) as u8, (y / 2) as u8, 90]);
        assert!(Grain::measure(&Photo::Srgb8(clean)).is_none());
        assert!(Grain::measure(&Photo::Linear(RadianceImage::new(8, 8, vec![[0.5; 3]; 64]))).is_none());
        // all clipped
        let white = Image::from_fn(320, 240, |x, y| [255, 254, 253 + ((x + y) % 2) as u8]);
        assert!(Grain::measure(&Photo::Srgb8(white)).is_none());
    }
}
