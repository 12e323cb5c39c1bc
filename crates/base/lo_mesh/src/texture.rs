use lo_imaging::{Image, ImageError};

use crate::{MeshError, Wrap};

/// Largest edge of a texture, in pixels.
const LARGEST_EDGE: u32 = 8192;

/// A decoded image with its mip levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Mip levels, finest first, each half the size of the previous one, down to one pixel. RGBA as stored in the file.
    pub levels: Vec<Image<[u8; 4]>>,
    /// Whether RGB is sRGB colour (base colour, emission) and not linear data (roughness, normals).
    pub srgb: bool,
}

impl Texture {
    /// Decodes an image in a format of [`lo_imaging::read_rgba8`] and computes its mip levels.
    ///
    /// # Errors
    /// [`MeshError::Texture`] with `name` if the bytes are not an image, or one of more than 8192 pixels a side.
    pub fn from_bytes(name: &str, bytes: &[u8], srgb: bool) -> Result<Self, MeshError> {
        Self::decode(name, bytes, srgb, &mut TextureBudget::new(bytes.len()))
    }

    /// Like [`Texture::from_bytes`], for one of several textures of a mesh.
    pub(crate) fn decode(name: &str, bytes: &[u8], srgb: bool, budget: &mut TextureBudget) -> Result<Self, MeshError> {
        let failed = |reason: String| MeshError::Texture { name: name.to_owned(), reason };
        let unnamed = |error: ImageError| {
            let text = error.to_string();
            failed(text.strip_prefix(&format!("{name}: ")).unwrap_or(&text).to_owned())
        };
        let [width, height] = lo_imaging::size_from_bytes(bytes, name).map_err(unnamed)?;
        if width == 0 || height == 0 || width > LARGEST_EDGE || height > LARGEST_EDGE {
            let limit = format!("it has {width} × {height} pixels; the limit is {LARGEST_EDGE} a side");
            return Err(failed(limit));
        }
        budget.spend(width as usize * height as usize).map_err(failed)?;
        let image = lo_imaging::rgba8_from_bytes(bytes, name).map_err(unnamed)?;
        Ok(Self::from_image(image, srgb))
    }

    /// Creates a texture and its mip levels from an image with at least one pixel.
    ///
    /// Each pixel is the mean over its area. Colours are averaged in linear light, weighted by alpha; other data as
    /// stored.
    pub fn from_image(finest: Image<[u8; 4]>, srgb: bool) -> Self {
        let mut levels = vec![finest];
        while let Some(last) = levels.last()
            && last.width() * last.height() > 1
        {
            let next = halved(last, srgb);
            levels.push(next);
        }
        Self { levels, srgb }
    }

    /// Samples linear RGBA at texture coordinates, v down. `level` 0 is the finest; fractions interpolate two levels.
    pub fn sample(&self, uv: [f32; 2], wrap: [Wrap; 2], level: f32, nearest: bool) -> [f32; 4] {
        let last = self.levels.len() - 1;
        let level = if level.is_finite() { level.clamp(0.0, last as f32) } else { last as f32 };
        let fine = (level as usize).min(last);
        if fine == 0 && level == 0.0 && nearest {
            return self.texel(0, uv, wrap);
        }
        let near = self.bilinear(fine, uv, wrap);
        let mix = level - fine as f32;
        if mix == 0.0 {
            return near;
        }
        let far = self.bilinear(fine + 1, uv, wrap);
        std::array::from_fn(|c| near[c] + (far[c] - near[c]) * mix)
    }

    fn texel(&self, level: usize, uv: [f32; 2], wrap: [Wrap; 2]) -> [f32; 4] {
        let image = &self.levels[level];
        let (x, y) = (texel_position(uv[0], image.width()), texel_position(uv[1], image.height()));
        let at = (
            wrap_index(x.floor() as i64, image.width(), wrap[0]),
            wrap_index(y.floor() as i64, image.height(), wrap[1]),
        );
        linear(image[at], self.srgb)
    }

    fn bilinear(&self, level: usize, uv: [f32; 2], wrap: [Wrap; 2]) -> [f32; 4] {
        let image = &self.levels[level];
        let x = texel_position(uv[0], image.width()) - 0.5;
        let y = texel_position(uv[1], image.height()) - 0.5;
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = ((x - left) as f32, (y - top) as f32);
        let columns = [0, 1].map(|d| wrap_index(left as i64 + d, image.width(), wrap[0]));
        let rows = [0, 1].map(|d| wrap_index(top as i64 + d, image.height(), wrap[1]));
        let mut sum = [0.0; 4];
        for (row, wy) in rows.into_iter().zip([1.0 - fy, fy]) {
            for (column, wx) in columns.into_iter().zip([1.0 - fx, fx]) {
                let value = linear(image[(column, row)], self.srgb);
                for c in 0..4 {
                    sum[c] += value[c] * (wx * wy);
                }
            }
        }
        sum
    }
}

/// Budget of pixels for the textures of one mesh.
///
/// Kilobytes of constant colour decode to many pixels, and one image may be used many times. The budget grows with the
/// size of the mesh's files.
pub(crate) struct TextureBudget {
    pixels_left: usize,
}

impl TextureBudget {
    /// Pixels per byte that photographic images rarely exceed.
    const PIXELS_PER_BYTE: usize = 16;

    /// Creates a budget of one image of the largest size, plus that of `bytes`.
    pub(crate) fn new(bytes: usize) -> Self {
        let mut budget = Self { pixels_left: (LARGEST_EDGE * LARGEST_EDGE) as usize };
        budget.grow(bytes);
        budget
    }

    /// Adds the size of another file to the budget.
    pub(crate) fn grow(&mut self, bytes: usize) {
        self.pixels_left = self.pixels_left.saturating_add(bytes.saturating_mul(Self::PIXELS_PER_BYTE));
    }

    pub(crate) fn spend(&mut self, pixels: usize) -> Result<(), String> {
        let left = self.pixels_left.checked_sub(pixels);
        self.pixels_left = left.ok_or_else(|| "the textures of this mesh have too many pixels".to_owned())?;
        Ok(())
    }
}

/// Position in texels, in f64: for coordinates far outside [0, 1], f32 cannot resolve texels.
fn texel_position(coordinate: f32, size: usize) -> f64 {
    if coordinate.is_nan() {
        return 0.0;
    }
    // Beyond 1e12 repeats texels are not resolved.
    f64::from(coordinate.clamp(-1e12, 1e12)) * size as f64
}

/// Applies the addressing mode to a column or row index.
fn wrap_index(index: i64, size: usize, wrap: Wrap) -> usize {
    let size = size as i64;
    let inside = match wrap {
        Wrap::Repeat => index.rem_euclid(size),
        Wrap::Clamp => index.clamp(0, size - 1),
        Wrap::Mirror => {
            let twice = index.rem_euclid(2 * size);
            twice.min(2 * size - 1 - twice)
        }
    };
    inside as usize
}

fn linear([r, g, b, a]: [u8; 4], srgb: bool) -> [f32; 4] {
    if srgb {
        let [r, g, b] = [r, g, b].map(lo_imaging::linear_from_srgb8);
        [r, g, b, f32::from(a) / 255.0]
    } else {
        [r, g, b, a].map(|x| f32::from(x) / 255.0)
    }
}

/// Computes the next mip level: each pixel is the mean over its area.
fn halved(image: &Image<[u8; 4]>, srgb: bool) -> Image<[u8; 4]> {
    let columns = shares(image.width());
    let rows = shares(image.height());
    Image::from_fn(columns.len(), rows.len(), |x, y| {
        let (mut colour, mut plain, mut alpha, mut area) = ([0.0; 3], [0.0; 3], 0.0, 0.0);
        for &(row, wy) in &rows[y] {
            for &(column, wx) in &columns[x] {
                let [r, g, b, a] = linear(image[(column, row)], srgb);
                let (weight, p) = (wx * wy, [r, g, b]);
                for c in 0..3 {
                    let value = p[c] * weight;
                    plain[c] += value;
                    colour[c] += value * a;
                }
                alpha += a * weight;
                area += weight;
            }
        }
        let rgb = match (srgb, alpha > 0.0) {
            (true, true) => colour.map(|c| c / alpha),
            _ => plain.map(|c| c / area),
        };
        let code = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
        let [r, g, b] = rgb.map(|c| if srgb { lo_imaging::srgb8_from_linear(c) } else { code(c) });
        [r, g, b, code(alpha / area)]
    })
}

/// Returns, for each pixel of the coarser line, the pixels of the finer line that it covers and their shares.
fn shares(size: usize) -> Vec<Vec<(usize, f32)>> {
    let half = (size / 2).max(1);
    let step = size as f32 / half as f32;
    (0..half)
        .map(|i| {
            let (from, to) = (i as f32 * step, (i + 1) as f32 * step);
            (from as usize..size)
                .map(|k| (k, (to.min((k + 1) as f32) - from.max(k as f32)).max(0.0)))
                .take_while(|&(k, _)| (k as f32) < to)
                .filter(|&(_, share)| share > 0.0)
                .collect()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn grey(width: usize, height: usize, codes: &[u8], srgb: bool) -> Texture {
        Texture::from_image(Image::new(width, height, codes.iter().map(|&c| [c, c, c, 255]).collect()), srgb)
    }

    #[test]
    fn bilinear_weights_by_hand() {
        // Texel centres are at u = 1/4 and 3/4; 0.375 is a quarter of the way between them.
        let texture = grey(2, 2, &[0, 255, 0, 255], false);
        let at = |u: f32, v: f32, wrap: Wrap| texture.sample([u, v], [wrap; 2], 0.0, false)[0];
        assert!((at(0.375, 0.5, Wrap::Repeat) - 0.25).abs() < 1e-6);
        assert!((at(0.25, 0.1, Wrap::Repeat) - 0.0).abs() < 1e-6);
        // At the left border, repeating mixes half of the last column; the other modes do not.
        assert!((at(0.0, 0.5, Wrap::Repeat) - 0.5).abs() < 1e-6);
        assert_eq!(at(0.0, 0.5, Wrap::Clamp), 0.0);
        assert_eq!(at(0.0, 0.5, Wrap::Mirror), 0.0);
        assert_eq!(at(-7.0, 0.5, Wrap::Clamp), 0.0);
        // The second copy of a mirrored image is reversed and begins with white.
        assert!((at(1.25, 0.5, Wrap::Mirror) - 1.0).abs() < 1e-6);
        assert!((at(1.25, 0.5, Wrap::Repeat) - 0.0).abs() < 1e-6);
        assert_eq!(texture.sample([0.499, 0.5], [Wrap::Repeat; 2], 0.0, true)[0], 0.0);
        assert_eq!(texture.sample([0.501, 0.5], [Wrap::Repeat; 2], 0.0, true)[0], 1.0);
    }

    #[test]
    fn mip_levels_average_light_not_codes() {
        // Half white, half black: linear 0.5 is sRGB code 188 (187.5); as linear data 128.
        let colour = grey(2, 1, &[0, 255], true);
        assert_eq!(colour.levels[1].pixels(), [[188, 188, 188, 255]]);
        let numbers = grey(2, 1, &[0, 255], false);
        assert_eq!(numbers.levels[1].pixels(), [[128, 128, 128, 255]]);
        // Half way between the levels of linear data: (1 + 128/255) / 2 at the white texel's centre.
        let mixed = numbers.sample([0.75, 0.5], [Wrap::Clamp; 2], 0.5, false)[0];
        assert!((mixed - (1.0 + 128.0 / 255.0) / 2.0).abs() < 1e-6);
        // Transparent pixels do not bleed into the colour.
        let cut_out = Texture::from_image(Image::new(2, 1, vec![[200, 10, 10, 255], [0, 255, 0, 0]]), true);
        assert_eq!(cut_out.levels[1].pixels(), [[200, 10, 10, 128]]);
    }

    #[test]
    fn odd_sizes_keep_the_mean() {
        // 3 × 1 becomes 1 × 1: each texel has weight 1/3. 5 × 1 becomes 2 × 1: two and a half texels each.
        assert_eq!(grey(3, 1, &[0, 60, 240], false).levels[1].pixels()[0][0], 100);
        let five = grey(5, 1, &[10, 20, 200, 50, 60], false);
        let codes: Vec<u8> = five.levels[1].pixels().iter().map(|p| p[0]).collect();
        assert_eq!(codes, [(130.0_f32 / 2.5).round() as u8, (210.0_f32 / 2.5).round() as u8]);
        let sizes: Vec<(usize, usize)> =
            grey(5, 3, &[7; 15], true).levels.iter().map(|l| (l.width(), l.height())).collect();
        assert_eq!(sizes, [(5, 3), (2, 1), (1, 1)]);
    }

    #[test]
    fn huge_and_broken_pictures_are_refused() {
        let error = |bytes: &[u8]| Texture::from_bytes("t.png", bytes, true).unwrap_err().to_string();
        assert!(error(b"no picture").starts_with("texture t.png: "));
        // A PNG header that declares 60000 × 60000 pixels.
        let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR".to_vec();
        png.extend([0, 0, 0xea, 0x60, 0, 0, 0xea, 0x60, 8, 6, 0, 0, 0]);
        png.extend([0; 40]);
        assert!(error(&png).starts_with("texture t.png: "), "{}", error(&png));
    }

    #[test]
    fn far_away_coordinates_give_numbers() {
        let texture = grey(3, 2, &[1, 2, 3, 4, 5, 6], true);
        for u in [f32::MAX, f32::MIN, f32::NAN, f32::INFINITY, 1e20, -0.0] {
            for wrap in [Wrap::Repeat, Wrap::Mirror, Wrap::Clamp] {
                for level in [0.0, 0.7, 99.0, f32::NAN, -1.0] {
                    for nearest in [false, true] {
                        let sample = texture.sample([u, -u], [wrap; 2], level, nearest);
                        assert!(sample.iter().all(|x| (0.0..=1.0).contains(x)), "{sample:?} at {u}, level {level}");
                    }
                }
            }
        }
    }
}
