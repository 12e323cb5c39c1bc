//! Texture atlas of radiance at the corners of quads: 2 × 2 texels per quad.
//!
//! Texture coordinates of the corners are texel centres. Linear filtering then interpolates exactly between the
//! corners, and never samples another quad.

use lo_imaging::Image;

/// Layout of the quads in the texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Atlas {
    columns: usize,
    rows: usize,
}

/// Texel of each corner within its quad.
const TEXELS: [[usize; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];

impl Atlas {
    /// Creates a nearly square layout for a number of quads.
    pub fn new(quads: usize) -> Self {
        let columns = (1..).find(|n| n * n >= quads).expect("some square is larger").max(1);
        Self { columns, rows: quads.div_ceil(columns).max(1) }
    }

    /// Returns texture coordinates of the corners of a quad, from the upper left.
    pub fn uvs(self, quad: usize) -> [[f32; 2]; 4] {
        let of_texel = |texel: usize, texels: usize| (texel as f32 + 0.5) / texels as f32;
        let (x, y) = (2 * (quad % self.columns), 2 * (quad / self.columns));
        TEXELS.map(|[dx, dy]| [of_texel(x + dx, 2 * self.columns), of_texel(y + dy, 2 * self.rows)])
    }

    /// Fills the texture with `texel(quad, corner)`, and with `empty` where there is no quad.
    pub fn image<T: Copy>(self, quads: usize, empty: T, texel: impl Fn(usize, usize) -> T) -> Image<T> {
        Image::from_fn(2 * self.columns, 2 * self.rows, |x, y| {
            let quad = y / 2 * self.columns + x / 2;
            let corner = TEXELS.iter().position(|t| *t == [x % 2, y % 2]).expect("all four texels are corners");
            if quad < quads { texel(quad, corner) } else { empty }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_corner_finds_its_own_texel() {
        for quads in [0, 1, 2, 5, 9, 10, 100] {
            let atlas = Atlas::new(quads);
            let image = atlas.image(quads, None, |quad, corner| Some((quad, corner)));
            assert!(image.width().abs_diff(image.height()) <= image.width() / 2, "{quads}");
            for quad in 0..quads {
                for (corner, [u, v]) in atlas.uvs(quad).into_iter().enumerate() {
                    let (x, y) = (u * image.width() as f32, v * image.height() as f32);
                    assert!((x.fract() - 0.5).abs() < 1e-3 && (y.fract() - 0.5).abs() < 1e-3);
                    assert_eq!(image[(x as usize, y as usize)], Some((quad, corner)));
                }
            }
            assert_eq!(image.pixels().iter().flatten().count(), 4 * quads);
        }
    }
}
