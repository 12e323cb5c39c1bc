//! Conversion of a photo to a model's input.

use lo_imaging::Image;
use rayon::prelude::*;

use crate::metric3d::Letterbox;
use crate::recipe::Recipe;
use crate::runtime::Array;
use crate::{AxisOrder, SizeRule};

/// A model's input, and where the photo is in it.
pub(crate) struct Prepared {
    pub array: Array,
    /// Width and height of the photo in the input, without padding.
    pub photo: (usize, usize),
    pub letterbox: Option<Letterbox>,
}

/// Width and height of a model's input.
pub(crate) fn input_size(recipe: &Recipe, photo: (usize, usize)) -> (usize, usize) {
    recipe.size.size(photo)
}

/// Sizes of the input's axes.
pub(crate) fn input_dims(layout: AxisOrder, (width, height): (usize, usize)) -> Vec<usize> {
    match layout {
        AxisOrder::Nchw => vec![1, 3, height, width],
        AxisOrder::Nhwc => vec![1, height, width, 3],
    }
}

/// Resizes, pads and normalises a photo.
///
/// Resizing uses the area mean to shrink and bilinear interpolation to enlarge, on sRGB values as in training.
pub(crate) fn prepared(recipe: &Recipe, photo: &Image<[u8; 3]>) -> Prepared {
    let whole = input_size(recipe, (photo.width(), photo.height()));
    let letterbox = match recipe.size {
        SizeRule::Letterbox { .. } => Some(Letterbox::of((photo.width(), photo.height()), whole)),
        _ => None,
    };
    let size = letterbox.map_or(whole, |letterbox| (letterbox.width, letterbox.height));
    let small = lo_imaging::resize(&photo.map(|pixel| pixel.map(f32::from)), size.0, size.1);
    let (scale, mean, deviation) = (recipe.white / 255.0, recipe.mean, recipe.deviation);
    let padding = recipe.padding.unwrap_or(mean.map(|mean| mean / scale));
    let image = letterbox.map_or_else(|| small.clone(), |letterbox| letterbox.padded(&small, padding));
    let value = |pixel: &[f32; 3], channel: usize| (pixel[channel] * scale - mean[channel]) / deviation[channel];
    let channel = |index: usize| if recipe.bgr { 2 - index } else { index };
    let values = match recipe.layout {
        AxisOrder::Nchw => {
            (0..3).flat_map(|index| image.pixels().iter().map(move |pixel| value(pixel, channel(index)))).collect()
        }
        AxisOrder::Nhwc => image
            .pixels()
            .par_iter()
            .flat_map_iter(|pixel| (0..3).map(move |index| value(pixel, channel(index))))
            .collect(),
    };
    Prepared { array: Array { dims: input_dims(recipe.layout, whole), values }, photo: size, letterbox }
}
