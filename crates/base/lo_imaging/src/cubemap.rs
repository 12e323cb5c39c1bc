//! Cubemaps in OpenEXR's layout (`ImfEnvmap.h`): six faces seen from inside, in the order +X −X +Y −Y +Z −Z, stacked
//! vertically.
//!
//! Pixel centres are at +0.5 as elsewhere in this crate, whereas OpenEXR's helper puts those of the border on the edge.
//!
//! | face | to the right | downwards |
//! | --- | --- | --- |
//! | +X | +Z | −Y |
//! | −X | −Z | −Y |
//! | +Y | +X | −Z |
//! | −Y | +X | +Z |
//! | +Z | −X | −Y |
//! | −Z | +X | −Y |

use lo_geometry::{Vec3, direction_from_uv};

use crate::perspective::{render, sample_clamped, samples_per_side};
use crate::{Image, RadianceImage, sample_equirectangular};

/// Forward, right and down of each face.
const FACES: [[Vec3; 3]; 6] = [
    [Vec3::X, Vec3::Z, Vec3::NEG_Y],
    [Vec3::NEG_X, Vec3::NEG_Z, Vec3::NEG_Y],
    [Vec3::Y, Vec3::X, Vec3::NEG_Z],
    [Vec3::NEG_Y, Vec3::X, Vec3::Z],
    [Vec3::Z, Vec3::NEG_X, Vec3::NEG_Y],
    [Vec3::NEG_Z, Vec3::X, Vec3::NEG_Y],
];

/// A cubemap: six square faces of one size, in OpenEXR's order and orientation (+X −X +Y −Y +Z −Z, seen from inside).
#[derive(Clone, Debug, PartialEq)]
pub struct Cubemap {
    /// The faces, square and of equal size.
    pub faces: [RadianceImage; 6],
}

/// Converts an equirectangular map to a cubemap with faces of `face_size`² pixels; averages where the map is finer.
///
/// # Panics
/// If the map has no pixels.
pub fn cubemap_from_equirectangular(map: &RadianceImage, face_size: usize) -> Cubemap {
    let size = face_size as f32;
    // at a face's centre a pixel spans 2 / size radians
    let samples = samples_per_side(2.0 / size * map.width() as f32 / std::f32::consts::TAU);
    let faces = FACES.map(|[forward, right, down]| {
        render(face_size, face_size, samples, |x, y| {
            let (s, t) = (2.0 * x / size - 1.0, 2.0 * y / size - 1.0);
            sample_equirectangular(map, forward + s * right + t * down)
        })
    });
    Cubemap { faces }
}

/// Converts a cubemap to an equirectangular map; averages where the cubemap is finer. Lookups are bilinear within a
/// face.
///
/// # Panics
/// If the faces have no pixels.
pub fn equirectangular_from_cubemap(cube: &Cubemap, width: usize, height: usize) -> RadianceImage {
    let size = cube.faces[0].width() as f32;
    let samples = samples_per_side(std::f32::consts::TAU / width as f32 * size / 2.0);
    render(width, height, samples, |x, y| {
        let direction = direction_from_uv((x / width as f32, y / height as f32).into());
        let (face, s, t) = face_of(direction);
        sample_clamped(&cube.faces[face], 0.5 * (s + 1.0) * size, 0.5 * (t + 1.0) * size)
    })
}

impl Cubemap {
    /// Stacks the faces vertically, as OpenEXR stores them (`envmap` = cube): `n` × `6 n` pixels.
    pub fn strip(&self) -> RadianceImage {
        let size = self.faces[0].width();
        Image::from_fn(size, 6 * size, |x, y| self.faces[y / size][(x, y % size)])
    }

    /// Exchanges the faces of ±Z, for programs whose +Z is our −Z: Unity and others with Direct3D's cubemaps.
    ///
    /// The faces themselves stay: seen from inside, Direct3D's are upright as OpenEXR's are.
    pub fn left_handed(mut self) -> Self {
        self.faces.swap(4, 5);
        self
    }

    /// Inverse of [`Cubemap::strip`]; `None` if the image is not six times as high as wide.
    pub fn from_strip(strip: &RadianceImage) -> Option<Self> {
        let size = strip.width();
        let face = |face: usize| Image::from_fn(size, size, |x, y| strip[(x, face * size + y)]);
        (size > 0 && strip.height() == 6 * size).then(|| Self { faces: std::array::from_fn(face) })
    }

    /// Unfolds the cubemap into a cross of `4 n` × `3 n` pixels, for viewing.
    ///
    /// The middle row is −X −Z +X +Z; +Y is above and −Y below −Z; the rest is black.
    pub fn cross(&self) -> RadianceImage {
        let size = self.faces[0].width();
        let face = |column: usize, row: usize| match (column, row) {
            (1, 0) => Some(2),
            (0, 1) => Some(1),
            (1, 1) => Some(5),
            (2, 1) => Some(0),
            (3, 1) => Some(4),
            (1, 2) => Some(3),
            _ => None,
        };
        Image::from_fn(4 * size, 3 * size, |x, y| {
            face(x / size, y / size).map_or([0.0; 3], |face| self.faces[face][(x % size, y % size)])
        })
    }
}

/// Returns the face that a direction hits, and the position on it: to the right and downwards in `[−1, 1]`.
fn face_of(direction: Vec3) -> (usize, f32, f32) {
    let magnitude = direction.abs();
    let axis = match magnitude.max_element() {
        m if m == magnitude.x => 0,
        m if m == magnitude.y => 1,
        _ => 2,
    };
    let face = 2 * axis + usize::from(direction[axis] < 0.0);
    let [forward, right, down] = FACES[face];
    let depth = direction.dot(forward);
    (face, direction.dot(right) / depth, direction.dot(down) / depth)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perspective::{direction_map, worst_angle};
    use lo_geometry::pixel_direction;

    /// Direction of a pixel of OpenEXR's cubemap, from the two switches of ImfEnvmap.cpp, with pixel centres at +0.5.
    fn openexr_direction(x: usize, y: usize, size: usize) -> Vec3 {
        let position = |p: usize| 2.0 * (p as f32 + 0.5) / size as f32 - 1.0;
        let (i, j) = (position(x), position(y % size));
        match y / size {
            0 => Vec3::new(1.0, -j, i),
            1 => Vec3::new(-1.0, -j, -i),
            2 => Vec3::new(i, 1.0, -j),
            3 => Vec3::new(i, -1.0, j),
            4 => Vec3::new(-i, -j, 1.0),
            _ => Vec3::new(i, -j, -1.0),
        }
    }

    #[test]
    fn faces_lie_as_openexr_says() {
        let cube = cubemap_from_equirectangular(&direction_map(512, 256), 32);
        let strip = cube.strip();
        assert_eq!((strip.width(), strip.height()), (32, 192));
        assert_eq!(Cubemap::from_strip(&strip), Some(cube));
        let worst = worst_angle(&strip, |x, y| openexr_direction(x, y, 32));
        assert!(worst < 3e-3, "{worst}");
    }

    #[test]
    fn there_and_back() {
        let cube = cubemap_from_equirectangular(&direction_map(512, 256), 128);
        let back = equirectangular_from_cubemap(&cube, 128, 64);
        let worst = worst_angle(&back, |x, y| pixel_direction(x, y, 128, 64));
        // at an edge of the cube the lookup is clamped half a face pixel short: 1/128 of the face's half width
        assert!(worst < 8e-3, "{worst}");
    }

    #[test]
    fn the_cross_joins_its_faces() {
        let cube = cubemap_from_equirectangular(&direction_map(256, 128), 16);
        let cross = cube.cross();
        assert_eq!((cross.width(), cross.height()), (64, 48));
        let at = |x: usize, y: usize| Vec3::from_array(cross[(x, y)]).normalize();
        // neighbours across every fold are neighbours on the sphere: 1/8 of a half face apart
        for i in 0..16 {
            let folds = [((16 + i, 15), (16 + i, 16)), ((16 + i, 31), (16 + i, 32))];
            let sides = [((15, 16 + i), (16, 16 + i)), ((31, 16 + i), (32, 16 + i)), ((47, 16 + i), (48, 16 + i))];
            for ((ax, ay), (bx, by)) in folds.into_iter().chain(sides) {
                assert!(at(ax, ay).angle_between(at(bx, by)) < 0.13);
            }
        }
        assert_eq!(cross[(0, 0)], [0.0; 3]);
    }
}
