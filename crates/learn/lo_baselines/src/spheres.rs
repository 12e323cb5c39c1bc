//! Balls lit by a panorama, as seen from afar: a linear map from the panorama to the balls' pixels.

use std::f32::consts::{FRAC_1_PI, TAU};

use burn::tensor::{Device, Tensor, TensorData};
use lo_bsdf::Ggx;
use lo_geometry::{Vec3, direction_from_uv, pixel_solid_angle_sr, uv_from_direction};
use lo_imaging::RadianceImage;

/// Pixels across a ball.
const SIDE: usize = 24;

/// Directions along each side of a panorama's pixel over which reflection is averaged.
const SAMPLES: usize = 4;

/// Roughness of the silver ball, as in the evaluation's spheres.
const SILVER_ROUGHNESS: f32 = 0.3271;

/// Surface of a ball.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BallMaterial {
    /// Perfect mirror.
    Mirror,
    /// Rough metal: GGX of reflectance 1.
    Silver,
    /// Lambertian of albedo 1.
    Matte,
}

/// Three balls in front of the photo's camera, in orthographic view along −Z.
#[derive(Clone, Debug)]
pub struct Balls {
    size: [usize; 2],
    /// For each material, `[panorama's pixels, ball's pixels]`.
    transport: [Vec<f32>; 3],
    pixels: usize,
}

impl BallMaterial {
    /// All materials.
    pub const ALL: [Self; 3] = [Self::Mirror, Self::Silver, Self::Matte];
}

impl Balls {
    /// Prepares the balls for panoramas of this width and height.
    pub fn new(size: [usize; 2]) -> Self {
        let normals = normals();
        Self {
            size,
            transport: BallMaterial::ALL.map(|material| transport(material, size, &normals)),
            pixels: normals.len(),
        }
    }

    /// Returns the middle of each pixel of a ball, right and up, in radii.
    pub fn positions() -> Vec<[f32; 2]> {
        normals().into_iter().map(|normal| [normal.x, normal.y]).collect()
    }

    /// Returns the look of a ball under a panorama of the prepared size: one value for each of
    /// [`positions`](Self::positions).
    ///
    /// # Panics
    /// For other sizes.
    pub fn render(&self, material: BallMaterial, map: &RadianceImage) -> Vec<[f32; 3]> {
        assert_eq!([map.width(), map.height()], self.size, "the prepared size");
        let mut seen = vec![[0.0; 3]; self.pixels];
        for (rgb, weights) in map.pixels().iter().zip(self.transport[material as usize].chunks_exact(self.pixels)) {
            for (seen, weight) in seen.iter_mut().zip(weights) {
                (0..3).for_each(|c| seen[c] += weight * rgb[c]);
            }
        }
        seen
    }

    /// Returns the matrix of a material as a tensor `[panorama's pixels, ball's pixels]`.
    pub fn matrix(&self, material: BallMaterial, device: &Device) -> Tensor<2> {
        let values = self.transport[material as usize].clone();
        Tensor::from_data(TensorData::new(values, [self.size[0] * self.size[1], self.pixels]), device)
    }
}

/// Returns the normals of the pixels of a ball, row by row.
fn normals() -> Vec<Vec3> {
    let at = |i: usize| 2.0 * (i as f32 + 0.5) / SIDE as f32 - 1.0;
    let pixels = (0..SIDE * SIDE).map(|i| [at(i % SIDE), -at(i / SIDE)]);
    let normal = |[x, y]: [f32; 2]| {
        let rest = 1.0 - x * x - y * y;
        (rest > 0.0).then(|| Vec3::new(x, y, rest.sqrt()))
    };
    pixels.filter_map(normal).collect()
}

fn transport(material: BallMaterial, [width, height]: [usize; 2], normals: &[Vec3]) -> Vec<f32> {
    let mut matrix = vec![0.0; width * height * normals.len()];
    let mut add = |texel: usize, pixel: usize, weight: f32| matrix[texel * normals.len() + pixel] += weight;
    for (pixel, &normal) in normals.iter().enumerate() {
        if material == BallMaterial::Mirror {
            let towards = 2.0 * normal.z * normal - Vec3::Z;
            for (texel, weight) in bilinear(towards, [width, height]) {
                add(texel, pixel, weight);
            }
            continue;
        }
        for (texel, light, solid_angle_sr) in directions([width, height]) {
            let cosine = normal.dot(light);
            if cosine > 0.0 {
                let reflected = match material {
                    BallMaterial::Silver => {
                        Ggx::from_roughness(SILVER_ROUGHNESS).reflection_cos(normal, Vec3::Z, light).0
                    }
                    _ => FRAC_1_PI * cosine,
                };
                add(texel, pixel, reflected * solid_angle_sr);
            }
        }
    }
    matrix
}

/// Returns evenly spread directions of all pixels of a panorama: pixel, direction, solid angle.
fn directions([width, height]: [usize; 2]) -> impl Iterator<Item = (usize, Vec3, f32)> {
    let (columns, rows) = (SAMPLES * width, SAMPLES * height);
    (0..columns * rows).map(move |i| {
        let (x, y) = (i % columns, i / columns);
        let uv = [(x as f32 + 0.5) / columns as f32, (y as f32 + 0.5) / rows as f32];
        let texel = y / SAMPLES * width + x / SAMPLES;
        (texel, direction_from_uv(uv.into()), pixel_solid_angle_sr(y, columns, rows))
    })
}

/// Returns the pixels around a direction with their weights, as [`lo_imaging::sample_equirectangular`] interpolates
/// except at the poles.
fn bilinear(direction: Vec3, [width, height]: [usize; 2]) -> [(usize, f32); 4] {
    let uv = uv_from_direction(direction);
    let (x, y) = (uv.x * width as f32 - 0.5, uv.y * height as f32 - 0.5);
    let (fx, fy) = (x - x.floor(), y - y.floor());
    let column = |dx: i64| (x.floor() as i64 + dx).rem_euclid(width as i64) as usize;
    let row = |dy: i64| (y.floor() as i64 + dy).clamp(0, height as i64 - 1) as usize;
    let entry = |dx: i64, dy: i64, weight: f32| (row(dy) * width + column(dx), weight);
    [
        entry(0, 0, (1.0 - fx) * (1.0 - fy)),
        entry(1, 0, fx * (1.0 - fy)),
        entry(0, 1, (1.0 - fx) * fy),
        entry(1, 1, fx * fy),
    ]
}

/// Returns the weights by which rows of a panorama count, by solid angle, with mean 1.
pub(crate) fn row_weights(height: usize) -> Vec<f32> {
    let width = 2 * height;
    (0..height).map(|y| pixel_solid_angle_sr(y, width, height) * height as f32 / (2.0 * TAU / width as f32)).collect()
}

#[cfg(test)]
mod tests {
    use lo_geometry::pixel_direction;

    use super::*;
    use crate::testing::numbers;

    fn look(material: BallMaterial, light: impl Fn(Vec3) -> f32) -> Vec<(Vec3, f32)> {
        let balls = Balls::new([32, 16]);
        let map = RadianceImage::from_fn(32, 16, |x, y| [light(pixel_direction(x, y, 32, 16)); 3]);
        let seen = balls.render(material, &map);
        // The tensor is the same map.
        let green = map.pixels().iter().map(|rgb| rgb[1]).collect::<Vec<f32>>();
        let green = Tensor::<2>::from_data(TensorData::new(green, [1, 512]), &Device::flex());
        for (got, seen) in numbers(green.matmul(balls.matrix(material, &Device::flex()))).iter().zip(&seen) {
            assert!((got - seen[1]).abs() < 1e-4 * (1.0 + seen[1]));
        }
        normals().into_iter().zip(seen.into_iter().map(|rgb| rgb[1])).collect()
    }

    #[test]
    fn balls_in_even_light_are_white() {
        for (material, least) in
            [(BallMaterial::Mirror, 0.999), (BallMaterial::Silver, 0.8), (BallMaterial::Matte, 0.99)]
        {
            for (normal, seen) in look(material, |_| 1.0) {
                // Rough metal loses light to masking towards the rim.
                let least = if normal.z < 0.4 { 0.5 * least } else { least };
                assert!((least..1.02).contains(&seen), "{material:?} {normal}: {seen}");
            }
        }
    }

    #[test]
    fn shading_under_a_smooth_sky_is_the_closed_form() {
        // L = 1 + ω·a: a matte ball has 1 + 2/3 n·a; a mirror has 1 + r·a.
        let towards = Vec3::new(0.36, 0.48, -0.8);
        let sky = |d: Vec3| 1.0 + d.dot(towards);
        for (normal, seen) in look(BallMaterial::Matte, sky) {
            assert!((seen - (1.0 + 2.0 / 3.0 * normal.dot(towards))).abs() < 0.01, "{normal}: {seen}");
        }
        for (normal, seen) in look(BallMaterial::Mirror, sky) {
            let reflected = 2.0 * normal.z * normal - Vec3::Z;
            assert!((seen - sky(reflected)).abs() < 0.06, "{normal}: {seen}");
        }
    }

    #[test]
    fn row_weights_have_mean_one() {
        let weights = row_weights(16);
        assert!((weights.iter().sum::<f32>() / 16.0 - 1.0).abs() < 1e-5);
        assert!((weights[0] / weights[8] - (PIXEL_0 / PIXEL_8)).abs() < 1e-3);
    }

    /// Solid angles between the edges of rows 0 and 8 of 16.
    const PIXEL_0: f32 = 1.0 - 0.980_785_25;
    const PIXEL_8: f32 = 0.195_090_32;
}
