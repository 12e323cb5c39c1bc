use rayon::prelude::*;

use crate::{PhotoNote, RadianceImage};

/// All values of an image are infinite or NaN.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NoFiniteValue;

/// Replaces infinite values by the largest finite one of the image, and −∞ and NaN by 0.
///
/// Returns how many there were, if there were any. An image without finite values is left as it is, and is an error.
pub(crate) fn replace(image: &mut RadianceImage) -> Result<Option<PhotoNote>, NoFiniteValue> {
    let values = image.pixels().as_flattened();
    let (infinite, nan, largest) = values
        .par_iter()
        .map(|v| match v {
            v if v.is_nan() => (0, 1, 0.0),
            v if v.is_infinite() => (1, 0, 0.0),
            v => (0, 0, v.abs()),
        })
        .reduce(|| (0usize, 0usize, 0.0f32), |a, b| (a.0 + b.0, a.1 + b.1, a.2.max(b.2)));
    if infinite + nan == 0 {
        return Ok(None);
    }
    if infinite + nan == values.len() {
        return Err(NoFiniteValue);
    }
    let finite = |v: f32| match v {
        f32::INFINITY => largest,
        v if v.is_finite() => v,
        _ => 0.0,
    };
    image.pixels_mut().par_iter_mut().for_each(|pixel| *pixel = pixel.map(finite));
    Ok(Some(PhotoNote::NotFinite { infinite, nan, largest }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn infinite_pixels_become_the_brightest() {
        let mut image = RadianceImage::new(2, 1, vec![[f32::INFINITY, 1.0, f32::NAN], [3.5, f32::NEG_INFINITY, 0.0]]);
        assert_eq!(replace(&mut image), Ok(Some(PhotoNote::NotFinite { infinite: 2, nan: 1, largest: 3.5 })));
        assert_eq!(image.pixels(), [[3.5, 1.0, 0.0], [3.5, 0.0, 0.0]]);
        assert_eq!(replace(&mut image), Ok(None));
        assert_eq!(replace(&mut RadianceImage::new(1, 1, vec![[f32::NAN; 3]])), Err(NoFiniteValue));
    }
}
