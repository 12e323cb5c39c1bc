use lo_geometry::Vec3;
use lo_imaging::Image;
use lo_scene::Undistortion;
use rayon::prelude::*;

/// Cells along the longer side at whose corners the lens model is inverted. It is smooth, and interpolated in between
/// with an error of some hundredths of a pixel.
const CELLS: usize = 160;

/// Places of a distorted photo's pixels in the undistorted one, to distort layers back.
pub(crate) struct Redistortion {
    /// Place at the corners of cells of `step`² pixels; `None` where the lens model ends.
    grid: Image<Option<[f64; 2]>>,
    step: usize,
    width: usize,
    height: usize,
}

impl Redistortion {
    pub fn new(undistortion: &Undistortion) -> Self {
        let (width, height) = (undistortion.camera.width as usize, undistortion.camera.height as usize);
        let step = width.max(height).div_ceil(CELLS).max(1);
        let (columns, rows) = (width.div_ceil(step) + 1, height.div_ceil(step) + 1);
        let place = |index: usize| {
            undistortion.undistorted_place([index % columns, index / columns].map(|at| (at * step) as f64))
        };
        let places = (0..columns * rows).into_par_iter().map(place).collect();
        Self { grid: Image::new(columns, rows, places), step, width, height }
    }

    /// Distorts a layer of the undistorted photo, interpolated between four pixels. `neutral` is its value outside.
    pub fn layer<T: Layer>(&self, layer: &Image<T>, neutral: T) -> Image<T> {
        let pixel = |index: usize| {
            let at = [index % self.width, index / self.width].map(|at| at as f64 + 0.5);
            self.place(at).map_or(neutral, |place| interpolated(layer, place, neutral))
        };
        Image::new(self.width, self.height, (0..self.width * self.height).into_par_iter().map(pixel).collect())
    }

    /// [`Redistortion::layer`] without interpolation: of the pixel that contains each place.
    pub fn nearest<T: Layer>(&self, layer: &Image<T>, neutral: T) -> Image<T> {
        let pixel = |index: usize| {
            let at = [index % self.width, index / self.width].map(|at| at as f64 + 0.5);
            let place = self.place(at).map(|[u, v]| [u.floor(), v.floor()]);
            let inside = |&[x, y]: &[f64; 2]| {
                (0.0..layer.width() as f64).contains(&x) && (0.0..layer.height() as f64).contains(&y)
            };
            place.filter(inside).map_or(neutral, |[x, y]| layer[(x as usize, y as usize)])
        };
        Image::new(self.width, self.height, (0..self.width * self.height).into_par_iter().map(pixel).collect())
    }

    /// Returns the place in the undistorted photo of a place in the distorted one, in pixels.
    fn place(&self, at: [f64; 2]) -> Option<[f64; 2]> {
        let step = self.step as f64;
        let cell = at.map(|at| (at / step) as usize);
        let [fx, fy] = [0, 1].map(|axis| at[axis] / step - cell[axis] as f64);
        let corner = |dx: usize, dy: usize| self.grid[(cell[0] + dx, cell[1] + dy)];
        let (a, b, c, d) = (corner(0, 0)?, corner(1, 0)?, corner(0, 1)?, corner(1, 1)?);
        let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
        Some([0, 1].map(|axis| mix(mix(a[axis], b[axis], fx), mix(c[axis], d[axis], fx), fy)))
    }
}

/// A value of a layer.
pub(crate) trait Layer: Copy + PartialEq + Send + Sync {
    /// Returns the value at a share `t` of the way to `other`; itself if both are equal.
    fn mix(self, other: Self, t: f32) -> Self;
}

impl Layer for f32 {
    fn mix(self, other: Self, t: f32) -> Self {
        self + (other - self) * t
    }
}

impl Layer for Vec3 {
    fn mix(self, other: Self, t: f32) -> Self {
        self + (other - self) * t
    }
}

/// Interpolates between the four pixels around a place; pixels outside of the layer are neutral.
fn interpolated<T: Layer>(layer: &Image<T>, [u, v]: [f64; 2], neutral: T) -> T {
    let (left, top) = ((u - 0.5).floor(), (v - 0.5).floor());
    let (fx, fy) = ((u - 0.5 - left) as f32, (v - 0.5 - top) as f32);
    let pixel = |dx: f64, dy: f64| {
        let (x, y) = (left + dx, top + dy);
        let inside = (0.0..layer.width() as f64).contains(&x) && (0.0..layer.height() as f64).contains(&y);
        if inside { layer[(x as usize, y as usize)] } else { neutral }
    };
    let upper = pixel(0.0, 0.0).mix(pixel(1.0, 0.0), fx);
    let lower = pixel(0.0, 1.0).mix(pixel(1.0, 1.0), fx);
    upper.mix(lower, fy)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_geometry::{Camera, Distortion};

    #[test]
    fn distorted_layers_are_where_the_lens_shows_them() {
        let camera = Camera::from_hfov_deg(70.0, 320, 240).unwrap();
        let undistortion = Undistortion::new(camera, Distortion::brown(&[-0.2, 0.03, 0.001, -0.002])).unwrap();
        let back = Redistortion::new(&undistortion);
        // columns and rows of the undistorted photo
        let places = Image::from_fn(320, 240, |x, y| Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 1.0));
        let distorted = back.layer(&places, Vec3::ZERO);
        for (x, y) in [(5, 5), (160, 120), (33, 200), (300, 17)] {
            let place = undistortion.undistorted_place([x as f64 + 0.5, y as f64 + 0.5]).unwrap();
            let found = distorted[(x, y)];
            let outside = !(1.0..319.0).contains(&place[0]) || !(1.0..239.0).contains(&place[1]);
            if outside {
                assert!(found.z < 1.0, "{x} {y}: {place:?} {found}");
            } else {
                assert!((f64::from(found.x) - place[0]).abs() < 0.05, "{x} {y}: {place:?} {found}");
                assert!((f64::from(found.y) - place[1]).abs() < 0.05, "{x} {y}: {place:?} {found}");
            }
        }
        // even layers stay exactly even
        assert!(back.layer(&Image::new(320, 240, vec![1.0f32; 320 * 240]), 1.0).pixels().iter().all(|&v| v == 1.0));
    }
}
