use lo_imaging::{Image, RadianceImage};

/// Fills pixels without data (`observed` is 0) smoothly from their surroundings, across the seam (push–pull).
///
/// Averages observed pixels over ever coarser levels, then interpolates back. Works on ln(1 + radiance) so that a
/// lamp beside a hole does not light all of it. Without any observed pixel the map becomes black.
pub(super) fn fill_unobserved(map: &mut RadianceImage, observed: &Image<f32>) {
    if observed.pixels().iter().all(|&k| k > 0.0) {
        return;
    }
    let mut levels = vec![Image::new(
        map.width(),
        map.height(),
        map.pixels()
            .iter()
            .zip(observed.pixels())
            .map(|(rgb, &observed)| if observed > 0.0 { weighted(rgb.map(f32::ln_1p), 1.0) } else { [0.0; 4] })
            .collect(),
    )];
    while let Some(last) = levels.last().filter(|last| last.width() > 2 || last.height() > 1) {
        levels.push(coarser(last));
    }
    let mut filled = levels.pop().map(|coarsest| coarsest.map(normalised)).unwrap_or_else(|| Image::new(0, 0, vec![]));
    while let Some(level) = levels.pop() {
        filled = Image::from_fn(level.width(), level.height(), |x, y| {
            let here = level[(x, y)];
            if here[3] >= 1.0 {
                return normalised(&here);
            }
            let around = smooth(&filled, x, y);
            [0, 1, 2].map(|c| here[c] + (1.0 - here[3]) * around[c])
        });
    }
    for ((rgb, filled), &observed) in map.pixels_mut().iter_mut().zip(filled.pixels()).zip(observed.pixels()) {
        if observed <= 0.0 {
            *rgb = filled.map(f32::exp_m1);
        }
    }
}

/// ln(1 + radiance) times the weight, and the weight.
type WeightedPixel = [f32; 4];

fn weighted(rgb: [f32; 3], weight: f32) -> WeightedPixel {
    [rgb[0] * weight, rgb[1] * weight, rgb[2] * weight, weight]
}

fn normalised(value: &WeightedPixel) -> [f32; 3] {
    if value[3] > 0.0 { [0, 1, 2].map(|c| value[c] / value[3]) } else { [0.0; 3] }
}

/// Merges 2 × 2 pixels to one with a weight of at most 1.
fn coarser(level: &Image<WeightedPixel>) -> Image<WeightedPixel> {
    let (width, height) = (level.width().div_ceil(2), level.height().div_ceil(2));
    Image::from_fn(width, height, |x, y| {
        let mut sum = [0.0f32; 4];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let (x, y) = (2 * x + dx, 2 * y + dy);
            if x < level.width() && y < level.height() {
                let value = level[(x, y)];
                (0..4).for_each(|c| sum[c] += value[c]);
            }
        }
        // one observed pixel of four gives the coarse one full weight
        let scale = if sum[3] > 1.0 { 1.0 / sum[3] } else { 1.0 };
        sum.map(|v| v * scale)
    })
}

/// Interpolates the coarser level at a pixel of the finer one: quadratic B-spline over 3 × 3, wrapped at the seam,
/// clamped at the poles.
fn smooth(coarse: &Image<[f32; 3]>, x: usize, y: usize) -> [f32; 3] {
    let (width, height) = (coarse.width() as i64, coarse.height() as i64);
    // a fine pixel is a quarter of a coarse pixel off the centre of its coarse one
    let taps =
        |index: usize| if index.is_multiple_of(2) { [0.28125, 0.6875, 0.03125] } else { [0.03125, 0.6875, 0.28125] };
    let (across, down) = (taps(x), taps(y));
    let mut sum = [0.0; 3];
    for (j, &wy) in down.iter().enumerate() {
        let row = ((y / 2) as i64 + j as i64 - 1).clamp(0, height - 1) as usize;
        for (i, &wx) in across.iter().enumerate() {
            let column = ((x / 2) as i64 + i as i64 - 1).rem_euclid(width) as usize;
            let value = coarse[(column, row)];
            (0..3).for_each(|c| sum[c] += wx * wy * value[c]);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hole_in_a_ramp_is_filled_between_its_sides() {
        let truth = |y: usize| 0.2 + 0.01 * y as f32;
        let mut map = RadianceImage::from_fn(128, 64, |_, y| [truth(y), 2.0 * truth(y), 0.1]);
        // across the seam
        let hole = |x: usize, y: usize| !(10..118).contains(&x) && (20..44).contains(&y);
        let observed = Image::from_fn(128, 64, |x, y| if hole(x, y) { 0.0 } else { 1.0 });
        let before = map.clone();
        for (x, y) in (0..64).flat_map(|y| (0..128).map(move |x| (x, y))) {
            if hole(x, y) {
                map[(x, y)] = [f32::NAN; 3];
            }
        }
        fill_unobserved(&mut map, &observed);
        for (x, y) in (0..64).flat_map(|y| (0..128).map(move |x| (x, y))) {
            let (got, expected) = (map[(x, y)], before[(x, y)]);
            if hole(x, y) {
                // the ramp's range over the hole is 0.24: at most half of that at its centre
                assert!((got[0] - expected[0]).abs() < 0.12 && (got[2] - 0.1).abs() < 1e-5, "{x} {y}: {got:?}");
                let neighbour = map[((x + 1) % 128, y)][0];
                assert!((got[0] - neighbour).abs() < 0.05, "{x} {y}: {got:?} beside {neighbour}");
            } else {
                assert_eq!(got, expected);
            }
        }
    }

    #[test]
    fn nothing_known_stays_black_and_one_pixel_fills_all() {
        let mut map = RadianceImage::new(6, 3, vec![[5.0; 3]; 18]);
        fill_unobserved(&mut map, &Image::new(6, 3, vec![0.0; 18]));
        assert!(map.pixels().iter().all(|rgb| *rgb == [0.0; 3]));
        let mut map = RadianceImage::new(7, 5, vec![[3.0; 3]; 35]);
        fill_unobserved(&mut map, &Image::from_fn(7, 5, |x, y| if (x, y) == (3, 2) { 1.0 } else { 0.0 }));
        assert!(map.pixels().iter().all(|rgb| (rgb[0] - 3.0).abs() < 1e-4), "{map:?}");
    }
}
