//! Upsamples a draft's objects and shadows into a larger photo, so that the room stays sharp during a movement.

use lo_imaging::{Image, RadianceImage, linear_from_srgb8, srgb8_from_linear};
use lo_insert::Composite;
use rayon::prelude::*;

/// Entries of the table of sRGB codes, indexed by the square root of the linear value.
const CODES: usize = 4096;

/// Patches are aligned to JPEG blocks of this size, pixels.
const BLOCK: usize = 16;

/// The region of an image that differs from the photo.
#[derive(Clone, Debug, PartialEq)]
pub struct ImagePatch {
    /// Column and row of the first pixel.
    pub at: [usize; 2],
    /// sRGB codes; one block of the photo if nothing differs.
    pub image: Image<[u8; 3]>,
}

/// Composites the upsampled layers of a draft over a larger photo of the same view, in the region that they affect.
/// `exposure` is that of the scene's frame.
pub(crate) fn draft_patch(photo: &Image<[u8; 3]>, composite: &Composite, exposure: f32) -> ImagePatch {
    let layers = CompositeLayers { composite, width: composite.alpha.width(), height: composite.alpha.height() };
    let [left, top, right, bottom] = layers.changed().unwrap_or([0; 4]);
    let (width, height) = (photo.width(), photo.height());
    let scale = [layers.width as f32 / width as f32, layers.height as f32 / height as f32];
    let span = |first: usize, end: usize, scale: f32, limit: usize| {
        let from = ((first as f32 / scale) as usize).min(limit - 1) / BLOCK * BLOCK;
        (from, ((end as f32 / scale).ceil() as usize).max(from + 1).next_multiple_of(BLOCK).min(limit))
    };
    let ((from_x, to_x), (from_y, to_y)) = (span(left, right, scale[0], width), span(top, bottom, scale[1], height));
    let mut part = Image::from_fn(to_x - from_x, to_y - from_y, |x, y| photo[(from_x + x, from_y + y)]);
    let codes: Vec<u8> = (0..CODES).map(|i| srgb8_from_linear((i as f32 / (CODES - 1) as f32).powi(2))).collect();
    let linear: Vec<f32> = (0..=255).map(linear_from_srgb8).collect();
    part.pixels_mut().par_chunks_mut(to_x - from_x).enumerate().for_each(|(y, row)| {
        let y = from_y + y;
        let v = (y as f32 + 0.5) * scale[1] - 0.5;
        for (x, pixel) in row.iter_mut().enumerate() {
            let x = from_x + x;
            let u = (x as f32 + 0.5) * scale[0] - 0.5;
            let Some(LayerSample { ratio, reflection, alpha, object }) = layers.at(u, v) else { continue };
            for c in 0..3 {
                let under = linear[usize::from(pixel[c])] * ratio[c] + reflection[c] / exposure;
                let value = under.max(0.0) * (1.0 - alpha) + object[c] / exposure;
                pixel[c] = codes[(value.clamp(0.0, 1.0).sqrt() * (CODES - 1) as f32 + 0.5) as usize];
            }
        }
    });
    ImagePatch { at: [from_x, from_y], image: part }
}

struct CompositeLayers<'a> {
    composite: &'a Composite,
    width: usize,
    height: usize,
}

/// Interpolated layers at a point.
#[derive(Clone, Copy, Default)]
struct LayerSample {
    ratio: [f32; 3],
    reflection: [f32; 3],
    alpha: f32,
    object: [f32; 3],
}

impl CompositeLayers<'_> {
    fn is_changed(&self, i: usize) -> bool {
        let Composite { alpha, shadow_ratio, reflection, .. } = self.composite;
        let reflects = reflection.as_ref().is_some_and(|reflection| reflection.pixels()[i] != [0.0; 3]);
        alpha.pixels()[i] > 0.0 || shadow_ratio.pixels()[i] != [1.0; 3] || reflects
    }

    /// Returns left, top, right and bottom of the affected region, padded by a pixel; `None` if it is empty.
    fn changed(&self) -> Option<[usize; 4]> {
        let of_row = |y: usize| {
            let row = y * self.width;
            let first = (0..self.width).find(|x| self.is_changed(row + x))?;
            let last = (first..self.width).rev().find(|x| self.is_changed(row + x))?;
            Some([first, y, last + 1, y + 1])
        };
        let around = |a: [usize; 4], b: [usize; 4]| [a[0].min(b[0]), a[1].min(b[1]), a[2].max(b[2]), a[3].max(b[3])];
        let [left, top, right, bottom] = (0..self.height).into_par_iter().filter_map(of_row).reduce_with(around)?;
        Some([
            left.saturating_sub(1),
            top.saturating_sub(1),
            (right + 1).min(self.width),
            (bottom + 1).min(self.height),
        ])
    }

    /// Interpolates bilinearly, with pixel centres at integers; `None` if no neighbour is affected.
    fn at(&self, u: f32, v: f32) -> Option<LayerSample> {
        let (u, v) = (u.clamp(0.0, (self.width - 1) as f32), v.clamp(0.0, (self.height - 1) as f32));
        let (x, y) = (u as usize, v as usize);
        let (fx, fy) = (u - x as f32, v - y as f32);
        let (x1, y1) = ((x + 1).min(self.width - 1), (y + 1).min(self.height - 1));
        let corners = [
            (y * self.width + x, (1.0 - fx) * (1.0 - fy)),
            (y * self.width + x1, fx * (1.0 - fy)),
            (y1 * self.width + x, (1.0 - fx) * fy),
            (y1 * self.width + x1, fx * fy),
        ];
        if !corners.iter().any(|&(i, _)| self.is_changed(i)) {
            return None;
        }
        let Composite { object, alpha, shadow_ratio, reflection, .. } = self.composite;
        let mut sum = LayerSample::default();
        for (i, weight) in corners {
            let add = |sum: &mut [f32; 3], image: &RadianceImage| {
                sum.iter_mut().zip(image.pixels()[i]).for_each(|(sum, value)| *sum += weight * value);
            };
            sum.alpha += weight * alpha.pixels()[i];
            add(&mut sum.ratio, shadow_ratio);
            add(&mut sum.object, object);
            reflection.iter().for_each(|reflection| add(&mut sum.reflection, reflection));
        }
        Some(sum)
    }
}

#[cfg(test)]
mod tests {
    use lo_imaging::Photo;

    use super::*;

    fn composite(width: usize, height: usize) -> Composite {
        let in_object = |x: usize, y: usize| x == 5 && y == 4;
        Composite {
            image: Photo::Srgb8(Image::new(1, 1, vec![[0; 3]])),
            object: RadianceImage::from_fn(
                width,
                height,
                |x, y| if in_object(x, y) { [0.2, 0.4, 0.6] } else { [0.0; 3] },
            ),
            alpha: Image::from_fn(width, height, |x, y| if in_object(x, y) { 1.0 } else { 0.0 }),
            shadow_ratio: RadianceImage::from_fn(
                width,
                height,
                |x, y| if y == 4 && x > 5 { [0.5; 3] } else { [1.0; 3] },
            ),
            reflection: None,
            grain: None,
            passes: None,
            occlusion: Image::new(width, height, vec![0.0; width * height]),
        }
    }

    fn whole(photo: &Image<[u8; 3]>, part: &ImagePatch) -> Image<[u8; 3]> {
        let mut image = photo.clone();
        for (y, row) in part.image.pixels().chunks(part.image.width()).enumerate() {
            row.iter().enumerate().for_each(|(x, &pixel)| image[(part.at[0] + x, part.at[1] + y)] = pixel);
        }
        image
    }

    #[test]
    fn nothing_changed_is_a_block_of_the_photo() {
        let photo = Image::from_fn(40, 24, |x, y| [x as u8, y as u8, 0]);
        let nothing = Composite {
            shadow_ratio: RadianceImage::new(16, 12, vec![[1.0; 3]; 192]),
            alpha: Image::new(16, 12, vec![0.0; 192]),
            ..composite(16, 12)
        };
        let part = draft_patch(&photo, &nothing, 1.0);
        assert_eq!((part.at, part.image.width(), part.image.height()), ([0, 0], 16, 16));
        assert_eq!(whole(&photo, &part), photo);
    }

    #[test]
    fn at_the_same_size_it_is_the_composite() {
        let photo = Image::from_fn(16, 12, |x, y| [(x * 9) as u8, (y * 20) as u8, 90]);
        let image = whole(&photo, &draft_patch(&photo, &composite(16, 12), 1.0));
        assert_eq!(image[(5, 4)], [0.2, 0.4, 0.6].map(srgb8_from_linear));
        let half = photo[(8, 4)].map(|code| srgb8_from_linear(0.5 * linear_from_srgb8(code)));
        assert!(image[(8, 4)].iter().zip(half).all(|(&a, b)| a.abs_diff(b) <= 1), "{:?} {half:?}", image[(8, 4)]);
        assert_eq!(image[(2, 4)], photo[(2, 4)]);
    }

    #[test]
    fn the_photo_stays_sharp_where_nothing_is_changed() {
        let photo = Image::from_fn(64, 48, |x, y| [if (x + y) % 2 == 0 { 250 } else { 5 }; 3]);
        let part = draft_patch(&photo, &composite(16, 12), 2.0);
        assert_eq!((part.at, part.image.width(), part.image.height()), ([16, 0], 48, 32));
        let image = whole(&photo, &part);
        // Column 5 and row 4 of the draft cover columns 20 to 23 and rows 16 to 19, plus a draft pixel around for
        // interpolation.
        let same = |x: usize, y: usize| image[(x, y)] == photo[(x, y)];
        assert!((0..64).all(|x| (0..12).chain(24..48).all(|y| same(x, y))));
        assert!((0..14).all(|x| (0..48).all(|y| same(x, y))));
        // Radiance over exposure: 0.1, 0.2, 0.3 in the middle of the object.
        let middle = image[(21, 17)];
        assert!(middle[0] < middle[1] && middle[1] < middle[2] && middle[2] < 200, "{middle:?}");
    }
}
