//! Procedural textures of surfaces: tileable, absolute linear albedo, one to three scales of detail.

mod building;
mod cloth;
mod noise;
mod picture;
mod print;
mod wear;

use lo_imaging::{Image, srgb8_from_linear};
use lo_mesh::Texture;

pub(crate) use building::{bricks, concrete, planks, plaster, stone, tiles, wallpaper};
pub(crate) use cloth::{carpet, leather, rug, weave, wood};
pub(crate) use noise::Noise;
pub(crate) use picture::{painting, screen};
pub(crate) use print::{clothing, keys, package_front, page};
pub(crate) use wear::{apply_wear, normal_map, painted, pattern};

/// A texture and its physical size.
pub(crate) struct Swatch {
    pub color: Image<[u8; 4]>,
    /// Roughness in the green channel, if it varies.
    pub roughness: Option<Image<[u8; 4]>>,
    pub size_m: [f32; 2],
}

impl Swatch {
    /// Creates a swatch by evaluating albedo over `[0, 1)²`.
    pub(crate) fn new(
        [width, height]: [usize; 2],
        size_m: [f32; 2],
        mut albedo: impl FnMut(f32, f32) -> [f32; 3],
    ) -> Self {
        let color = Image::from_fn(width, height, |x, y| {
            let [r, g, b] = albedo((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            let code = |c: f32| srgb8_from_linear(c.clamp(0.003, 0.88));
            [code(r), code(g), code(b), 255]
        });
        Self { color, roughness: None, size_m }
    }

    /// Creates a swatch from an image in sRGB codes, over `[0, 1]²`.
    pub(crate) fn from_image(color: Image<[u8; 4]>) -> Self {
        Self { color, roughness: None, size_m: [1.0; 2] }
    }

    /// Adds roughness by evaluating it over `[0, 1)²`.
    pub(crate) fn with_roughness(mut self, mut roughness: impl FnMut(f32, f32) -> f32) -> Self {
        let (width, height) = (self.color.width(), self.color.height());
        self.roughness = Some(Image::from_fn(width, height, |x, y| {
            let r = roughness((x as f32 + 0.5) / width as f32, (y as f32 + 0.5) / height as f32);
            [255, (r.clamp(0.03, 1.0) * 255.0).round() as u8, 0, 255]
        }));
        self
    }

    /// Converts colour and roughness to textures with mip levels.
    pub(crate) fn textures(self) -> (Texture, Option<Texture>) {
        (Texture::from_image(self.color, true), self.roughness.map(|r| Texture::from_image(r, false)))
    }
}

/// Interpolates linearly from `a` to `b`.
pub(crate) fn mix(a: [f32; 3], b: [f32; 3], share: f32) -> [f32; 3] {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * share)
}

/// Multiplies every channel by `factor`.
pub(crate) fn scaled(color: [f32; 3], factor: f32) -> [f32; 3] {
    color.map(|c| c * factor)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asserts that texels differ across the border no more than inside.
    fn assert_tiles(swatch: &Swatch, name: &str) {
        let image = &swatch.color;
        let (w, h) = (image.width(), image.height());
        let step = |a: [u8; 4], b: [u8; 4]| (0..3).map(|c| (i32::from(a[c]) - i32::from(b[c])).abs()).sum::<i32>();
        let column = |x0: usize, x1: usize| (0..h).map(|y| step(image[(x0, y)], image[(x1, y)])).sum::<i32>();
        let row = |y0: usize, y1: usize| (0..w).map(|x| step(image[(x, y0)], image[(x, y1)])).sum::<i32>();
        let most_column = (1..w).map(|x| column(x - 1, x)).max().unwrap_or(0);
        let most_row = (1..h).map(|y| row(y - 1, y)).max().unwrap_or(0);
        assert!(column(w - 1, 0) <= most_column * 3 / 2 + 64, "{name}: {} {most_column}", column(w - 1, 0));
        assert!(row(h - 1, 0) <= most_row * 3 / 2 + 64, "{name}: {} {most_row}", row(h - 1, 0));
    }

    #[test]
    fn surfaces_have_no_seam() {
        let c = [0.4, 0.3, 0.2];
        for seed in 0..4 {
            assert_tiles(&wood(seed, c), "wood");
            assert_tiles(&planks(seed, c, 0.14), "planks");
            assert_tiles(&tiles(seed, c, [0.3, 0.3], 0.4), "tiles");
            assert_tiles(&plaster(seed, c), "plaster");
            assert_tiles(&wallpaper(seed, c, [0.5, 0.5, 0.4]), "wallpaper");
            assert_tiles(&weave(seed, c, 0.004), "weave");
            assert_tiles(&carpet(seed, c), "carpet");
            assert_tiles(&leather(seed, c), "leather");
            assert_tiles(&stone(seed, c), "stone");
            assert_tiles(&concrete(seed, c), "concrete");
            assert_tiles(&bricks(seed, c), "bricks");
        }
    }

    #[test]
    fn the_mean_albedo_is_what_was_asked_for() {
        let asked = [0.4, 0.3, 0.2];
        let made = [wood(3, asked), plaster(3, asked), weave(3, asked, 0.004), carpet(3, asked), concrete(3, asked)];
        for swatch in made {
            let pixels = swatch.color.pixels();
            for c in 0..3 {
                let sum: f32 = pixels.iter().map(|p| lo_imaging::linear_from_srgb8(p[c])).sum();
                // Detail is multiplicative with a mean of 1 ± 0.2.
                assert!((sum / pixels.len() as f32 / asked[c] - 1.0).abs() < 0.2, "{}", sum / pixels.len() as f32);
            }
        }
    }
}
