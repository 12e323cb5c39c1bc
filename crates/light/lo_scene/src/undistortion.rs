use lo_geometry::{Camera, Distortion};
use lo_imaging::{DepthMap, EncodedPhoto, GainMap, Image, Photo, linear_from_srgb8, srgb8_from_linear};
use rayon::prelude::*;

/// Undoes a lens distortion: a pinhole camera in place of a distorted one, and the images that it takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Undistortion {
    /// Focal lengths and principal point of the distorted photo.
    distorted: Camera,
    distortion: Distortion,
    /// The pinhole camera of the undistorted images. It has the photo's size.
    pub camera: Camera,
}

/// Reasons why a distortion cannot be undone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum UndistortionError {
    /// A coefficient is NaN or infinite.
    #[error("a coefficient of the lens distortion is not finite")]
    NotFinite,
    /// The coefficients fold the image over within the photo.
    #[error("the lens distortion folds the photo over: check the order of its coefficients and the focal length")]
    Folded,
}

/// Largest tangent of half the angle across the undistorted image: 100°. More would be mostly stretched borders.
const MAX_HALF_EXTENT: f64 = 1.2;

/// Smallest focal length of the undistorted image, as a share of the photo's.
const MIN_ZOOM: f64 = 0.5;

/// Largest half extent of a distorted photo, whose fisheye has focal lengths of a hundredth of its side.
const MAX_DISTORTED_HALF_EXTENT: f64 = 50.0;

/// Steps of the bisection, each of which halves the error of the focal length.
const STEPS: u32 = 50;

impl Undistortion {
    /// Chooses the pinhole camera with the widest view that the distorted photo fills, up to 100°.
    ///
    /// # Errors
    /// If coefficients are not finite or fold the photo over.
    pub fn new(distorted: Camera, distortion: Distortion) -> Result<Self, UndistortionError> {
        if !distortion.is_finite() {
            return Err(UndistortionError::NotFinite);
        }
        if distorted.half_extent() > MAX_DISTORTED_HALF_EXTENT {
            return Err(UndistortionError::Folded);
        }
        let zoomed = |zoom: f64| Camera { fx: zoom * distorted.fx, fy: zoom * distorted.fy, ..distorted };
        let max_radius = distortion.max_radius();
        let fills = |zoom: f64| {
            let this = Self { distorted, distortion, camera: zoomed(zoom) };
            border(&distorted).all(|[u, v]| {
                let [x, y] = this.ideal([u, v]);
                let [u, v] = this.shown([u, v]);
                x.hypot(y) < max_radius && distorted.contains(u, v)
            })
        };
        let mut narrow = 4.0f64.max(4.0 * distorted.half_extent() / MAX_HALF_EXTENT);
        let mut wide = MIN_ZOOM.max(distorted.half_extent() / MAX_HALF_EXTENT);
        if !fills(narrow) {
            return Err(UndistortionError::Folded);
        }
        if fills(wide) {
            narrow = wide;
        }
        for _ in 0..STEPS {
            let middle = 0.5 * (narrow + wide);
            if fills(middle) { narrow = middle } else { wide = middle }
        }
        Ok(Self { distorted, distortion, camera: zoomed(narrow) })
    }

    /// Returns focal lengths and principal point of the distorted photo.
    pub fn distorted_camera(&self) -> Camera {
        self.distorted
    }

    /// Returns the distortion of the lens.
    pub fn distortion(&self) -> Distortion {
        self.distortion
    }

    /// Returns the place in the undistorted photo of a place in the distorted one, both in pixels; `None` if the lens
    /// model does not reach it.
    pub fn undistorted_place(&self, [u, v]: [f64; 2]) -> Option<[f64; 2]> {
        let Camera { fx, fy, cx, cy, .. } = self.distorted;
        let [x, y] = self.distortion.undistorted([(u - cx) / fx, (v - cy) / fy])?;
        let Camera { fx, fy, cx, cy, .. } = self.camera;
        Some([fx * x + cx, fy * y + cy])
    }

    /// Returns the photo that the pinhole camera takes, interpolated in linear light. 8-bit photos stay 8-bit.
    pub fn photo(&self, photo: &Photo) -> Photo {
        let (width, height) = (photo.width(), photo.height());
        match photo {
            Photo::Srgb8(image) => {
                let mean = |at| interpolated(image, at, |p| p.map(linear_from_srgb8)).map(srgb8_from_linear);
                Photo::Srgb8(self.resampled(width, height, mean))
            }
            Photo::Encoded8(EncodedPhoto { image, encoding }) => {
                let code = |at| encoding.code(interpolated(image, at, |p| encoding.linear(p)));
                let gain_map = encoding.gain_map.as_ref();
                let gain_map = gain_map.map(|map| GainMap { image: self.nearest(&map.image), ..*map });
                Photo::encoded8(self.resampled(width, height, code), encoding.with_gain_map(gain_map))
            }
            Photo::Linear(image) => Photo::Linear(self.resampled(width, height, |at| interpolated(image, at, |p| p))),
        }
    }

    /// Returns the depth that the pinhole camera sees, along the same axis, by nearest neighbour. The map has its own
    /// resolution.
    pub fn depth(&self, depth: &Image<f32>) -> DepthMap {
        self.nearest(depth)
    }

    /// Resamples a map of any resolution by nearest neighbour.
    fn nearest<T: Copy + Send + Sync>(&self, map: &Image<T>) -> Image<T> {
        let (width, height) = (map.width(), map.height());
        let nearest = |[u, v]: [f64; 2]| map[((u as usize).min(width - 1), (v as usize).min(height - 1))];
        self.resampled(width, height, nearest)
    }

    /// Computes an image of any resolution from the place in the distorted image that shows each pixel's centre.
    fn resampled<T: Send>(&self, width: usize, height: usize, pixel: impl Fn([f64; 2]) -> T + Sync) -> Image<T> {
        let camera = |camera: &Camera| camera.resized(width as u32, height as u32);
        let this = Self { distorted: camera(&self.distorted), camera: camera(&self.camera), ..*self };
        let at = |index: usize| [(index % width) as f64 + 0.5, (index / width) as f64 + 0.5];
        let pixels = (0..width * height).into_par_iter().map(|index| pixel(this.shown(at(index)))).collect();
        Image::new(width, height, pixels)
    }

    /// Ideal coordinates of a place in the undistorted image.
    fn ideal(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let Camera { fx, fy, cx, cy, .. } = self.camera;
        [(u - cx) / fx, (v - cy) / fy]
    }

    /// Place in the distorted image that shows a place of the undistorted one.
    fn shown(&self, at: [f64; 2]) -> [f64; 2] {
        let [x, y] = self.distortion.distorted(self.ideal(at));
        let Camera { fx, fy, cx, cy, .. } = self.distorted;
        [fx * x + cx, fy * y + cy]
    }
}

/// Places along the border of an image.
fn border(camera: &Camera) -> impl Iterator<Item = [f64; 2]> {
    const PLACES: u32 = 64;
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    (0..=PLACES).flat_map(move |place| {
        let share = f64::from(place) / f64::from(PLACES);
        [[share * width, 0.0], [share * width, height], [0.0, share * height], [width, share * height]]
    })
}

/// Interpolates linearly between four pixels; beyond the border the nearest pixel counts.
fn interpolated<T: Copy>(image: &Image<T>, [u, v]: [f64; 2], linear: impl Fn(T) -> [f32; 3]) -> [f32; 3] {
    let axis = |at: f64, size: usize| {
        let at = (at - 0.5).clamp(0.0, (size - 1) as f64);
        (at as usize, (at as usize + 1).min(size - 1), at.fract() as f32)
    };
    let ((left, right, x), (top, bottom, y)) = (axis(u, image.width()), axis(v, image.height()));
    let [a, b, c, d] = [(left, top), (right, top), (left, bottom), (right, bottom)].map(|at| linear(image[at]));
    std::array::from_fn(|i| (1.0 - y) * ((1.0 - x) * a[i] + x * b[i]) + y * ((1.0 - x) * c[i] + x * d[i]))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const CAMERA: Camera = Camera { fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0, width: 320, height: 240 };

    /// Photo of a wall with smooth stripes along `x / z`, by a distorted camera.
    fn stripes(distortion: Distortion) -> Photo {
        Photo::Linear(Image::from_fn(CAMERA.width as usize, CAMERA.height as usize, |x, y| {
            let shown = [(x as f64 + 0.5 - CAMERA.cx) / CAMERA.fx, (y as f64 + 0.5 - CAMERA.cy) / CAMERA.fy];
            let [x, y] = distortion.undistorted(shown).unwrap();
            [(20.0 * x).sin() as f32, (20.0 * y).sin() as f32, 0.0]
        }))
    }

    #[test]
    fn the_undistorted_photo_is_that_of_the_pinhole_camera() {
        for distortion in [
            Distortion::brown(&[-0.25, 0.05]),
            Distortion::brown(&[0.2, 0.0, 0.002, -0.001]),
            Distortion::Fisheye([0.05, 0.01, 0.0, 0.0]),
        ] {
            let undistortion = Undistortion::new(CAMERA, distortion).unwrap();
            let photo = undistortion.photo(&stripes(distortion)).into_radiance();
            for y in 0..240 {
                for x in 0..320 {
                    let [u, v] = undistortion.ideal([x as f64 + 0.5, y as f64 + 0.5]);
                    let expected = [(20.0 * u).sin() as f32, (20.0 * v).sin() as f32];
                    // Linear interpolation of sin 20 x at steps of 1 / 200: 20² / 200² / 8 along each axis, and the
                    // half pixel at the border that is beyond the outermost centres.
                    let error = (photo[(x, y)][0] - expected[0]).abs().max((photo[(x, y)][1] - expected[1]).abs());
                    let is_border = x < 2 || y < 2 || x > 317 || y > 237;
                    assert!(error < if is_border { 0.06 } else { 0.004 }, "{distortion:?}: {error} at {x}, {y}");
                }
            }
        }
    }

    #[test]
    fn the_photo_fills_the_view_up_to_a_limit() {
        // A barrel is widened, a pincushion narrowed, and a fisheye bounded.
        let zoom = |distortion, camera| Undistortion::new(camera, distortion).unwrap().camera.fx / 300.0;
        assert!(zoom(Distortion::brown(&[-0.25, 0.05]), CAMERA) < 0.97);
        assert!(zoom(Distortion::brown(&[0.25]), CAMERA) > 1.03);
        let wide = Camera { fx: 100.0, fy: 100.0, ..CAMERA };
        let camera = Undistortion::new(wide, Distortion::Fisheye([0.0; 4])).unwrap().camera;
        assert!((camera.half_extent() - MAX_HALF_EXTENT).abs() < 1e-6, "{camera:?}");
        // No distortion leaves all pixels as they are.
        let same = Undistortion::new(CAMERA, Distortion::brown(&[])).unwrap();
        assert!((same.camera.fx - 300.0).abs() < 1e-3, "{same:?}");
    }

    #[test]
    fn depth_of_another_resolution_is_undistorted_alike() {
        let distortion = Distortion::brown(&[-0.25, 0.05]);
        let undistortion = Undistortion::new(CAMERA, distortion).unwrap();
        // Depth of 1 left of an ideal x of 0.2, 2 right of it.
        let small = CAMERA.resized(80, 60);
        let given = Image::from_fn(80, 60, |x, y| {
            let shown = [(x as f64 + 0.5 - small.cx) / small.fx, (y as f64 + 0.5 - small.cy) / small.fy];
            if distortion.undistorted(shown).unwrap()[0] < 0.2 { 1.0 } else { 2.0 }
        });
        let depth = undistortion.depth(&given);
        let edge = undistortion.camera.resized(80, 60).fx * 0.2 + 40.0;
        for y in 0..60 {
            for x in (0..80).filter(|x| (*x as f64 + 0.5 - edge).abs() > 1.0) {
                assert_eq!(depth[(x, y)], if (x as f64) < edge { 1.0 } else { 2.0 }, "{x}, {y}");
            }
        }
    }

    #[test]
    fn impossible_distortions_are_errors() {
        let error = |distortion| Undistortion::new(CAMERA, distortion).unwrap_err();
        assert_eq!(error(Distortion::brown(&[f64::NAN])), UndistortionError::NotFinite);
        assert_eq!(error(Distortion::brown(&[0.0, 0.0, 40.0])), UndistortionError::Folded);
        for focal in [1e-300, 1e-3] {
            let tiny = Camera { fx: focal, fy: focal, ..CAMERA };
            assert_eq!(Undistortion::new(tiny, Distortion::brown(&[0.1])), Err(UndistortionError::Folded));
        }
    }
}
