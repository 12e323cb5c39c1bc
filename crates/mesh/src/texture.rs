use imaging::Image;

use crate::{MeshError, Wrap};

/// Largest edge of a texture in pixels.
const LARGEST_EDGE: u32 = 8192;

/// A decoded picture with its mip levels.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Finest first, each half as wide and high as the one before, down to one pixel; RGBA as stored in the file.
    pub levels: Vec<Image<[u8; 4]>>,
    /// RGB holds sRGB colour (base colour, emission), not numbers (roughness, normals).
    pub srgb: bool,
}

impl Texture {
    /// Decodes PNG, JPEG, WebP and the other picture formats of `imaging`, and makes the mip levels.
    ///
    /// # Errors
    /// [`MeshError::Texture`] with `name` where the bytes are no picture or one of more than 8192 pixels a side.
    pub fn from_bytes(name: &str, bytes: &[u8], srgb: bool) -> Result<Self, MeshError> {
        Self::decode(name, bytes, srgb, &mut TextureBudget::new(bytes.len()))
    }

    /// As [`Texture::from_bytes`], for one of several textures of a mesh.
    pub(crate) fn decode(name: &str, bytes: &[u8], srgb: bool, budget: &mut TextureBudget) -> Result<Self, MeshError> {
        let failed = |reason: String| MeshError::Texture { name: name.to_owned(), reason };
        let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
            .with_guessed_format()
            .map_err(|error| failed(error.to_string()))?;
        let mut limits = image::Limits::default();
        limits.max_image_width = Some(LARGEST_EDGE);
        limits.max_image_height = Some(LARGEST_EDGE);
        reader.limits(limits);
        let picture = reader.decode().map_err(|error| failed(error.to_string()))?.to_rgba8();
        let (width, height) = (picture.width() as usize, picture.height() as usize);
        if width == 0 || height == 0 {
            return Err(failed("the picture has no pixels".to_owned()));
        }
        budget.spend(width * height).map_err(failed)?;
        let pixels = picture.into_raw().chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect();
        Ok(Self::from_image(Image::new(width, height, pixels), srgb))
    }

    /// Makes the mip levels: the mean over each pixel's area, of light (not of its sRGB code) weighted by alpha for
    /// colours, of the numbers as they are otherwise. The picture must have a pixel.
    pub fn from_image(finest: Image<[u8; 4]>, srgb: bool) -> Self {
        let decode = decode_table(srgb);
        let mut levels = vec![finest];
        while let Some(last) = levels.last()
            && last.width() * last.height() > 1
        {
            let next = halved(last, &decode, srgb);
            levels.push(next);
        }
        Self { levels, srgb }
    }

    /// Linear RGBA at texture coordinates, v down. `level` 0 is the finest; between levels the two are mixed.
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
        let at =
            (wrapped(x.floor() as i64, image.width(), wrap[0]), wrapped(y.floor() as i64, image.height(), wrap[1]));
        linear(image[at], self.srgb)
    }

    fn bilinear(&self, level: usize, uv: [f32; 2], wrap: [Wrap; 2]) -> [f32; 4] {
        let image = &self.levels[level];
        let x = texel_position(uv[0], image.width()) - 0.5;
        let y = texel_position(uv[1], image.height()) - 0.5;
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = ((x - left) as f32, (y - top) as f32);
        let columns = [0, 1].map(|d| wrapped(left as i64 + d, image.width(), wrap[0]));
        let rows = [0, 1].map(|d| wrapped(top as i64 + d, image.height(), wrap[1]));
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

/// Pixels that the textures of one mesh may still take. Kilobytes of constant colour unpack to many pixels, and one
/// picture may be named many times; what a mesh may take grows with the bytes of its files.
pub(crate) struct TextureBudget {
    pixels_left: usize,
}

impl TextureBudget {
    /// Pixels per byte that hardly any photographic picture exceeds.
    const PIXELS_PER_BYTE: usize = 16;

    /// One picture of the largest size, and more the more bytes there are.
    pub(crate) fn new(bytes: usize) -> Self {
        let mut budget = Self { pixels_left: (LARGEST_EDGE * LARGEST_EDGE) as usize };
        budget.grow(bytes);
        budget
    }

    /// Takes note of another file.
    pub(crate) fn grow(&mut self, bytes: usize) {
        self.pixels_left = self.pixels_left.saturating_add(bytes.saturating_mul(Self::PIXELS_PER_BYTE));
    }

    fn spend(&mut self, pixels: usize) -> Result<(), String> {
        let left = self.pixels_left.checked_sub(pixels);
        self.pixels_left = left.ok_or_else(|| "the pictures of this mesh unpack to too many pixels".to_owned())?;
        Ok(())
    }
}

/// Position in texels; f64 because coordinates far outside [0, 1] would lose the texel in f32.
fn texel_position(coordinate: f32, size: usize) -> f64 {
    f64::from(coordinate) * size as f64
}

/// Column or row that `index` means.
fn wrapped(index: i64, size: usize, wrap: Wrap) -> usize {
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
        let table = &*SRGB_TO_LINEAR;
        [table[r as usize], table[g as usize], table[b as usize], f32::from(a) / 255.0]
    } else {
        [r, g, b, a].map(|x| f32::from(x) / 255.0)
    }
}

static SRGB_TO_LINEAR: std::sync::LazyLock<[f32; 256]> =
    std::sync::LazyLock::new(|| std::array::from_fn(|code| linear_from_srgb(code as f32 / 255.0)));

/// IEC 61966-2-1.
pub(crate) fn linear_from_srgb(code: f32) -> f32 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}

fn srgb_from_linear(value: f32) -> f32 {
    if value <= 0.003_130_8 { value * 12.92 } else { 1.055 * value.powf(1.0 / 2.4) - 0.055 }
}

fn decode_table(srgb: bool) -> [f32; 256] {
    if srgb { *SRGB_TO_LINEAR } else { std::array::from_fn(|code| code as f32 / 255.0) }
}

/// The next mip level: each pixel the mean over its share of the picture's area.
fn halved(image: &Image<[u8; 4]>, decode: &[f32; 256], srgb: bool) -> Image<[u8; 4]> {
    let columns = shares(image.width());
    let rows = shares(image.height());
    Image::from_fn(columns.len(), rows.len(), |x, y| {
        let (mut colour, mut plain, mut alpha, mut area) = ([0.0; 3], [0.0; 3], 0.0, 0.0);
        for &(row, wy) in &rows[y] {
            for &(column, wx) in &columns[x] {
                let p = image[(column, row)];
                let (weight, a) = (wx * wy, f32::from(p[3]) / 255.0);
                for c in 0..3 {
                    let value = decode[p[c] as usize] * weight;
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
        let [r, g, b] = rgb.map(|c| code(if srgb { srgb_from_linear(c) } else { c }));
        [r, g, b, code(alpha / area)]
    })
}

/// For each pixel of the halved line, the pixels of the finer line that it covers and how much of each.
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
