//! Light as a sum of spherical Gaussians.

use std::f32::consts::PI;

use burn::tensor::{Tensor, TensorData};
use lo_geometry::{Vec3, pixel_direction};

/// A lobe a · e^(λ (ξ·ω − 1)).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gaussian {
    /// Unit axis ξ.
    pub axis: Vec3,
    /// Sharpness λ.
    pub sharpness: f32,
    /// Radiance along the axis, linear RGB.
    pub intensity: [f32; 3],
}

impl Gaussian {
    /// Returns the radiance from a unit direction.
    pub fn radiance(&self, direction: Vec3) -> [f32; 3] {
        let value = (self.sharpness * (self.axis.dot(direction) - 1.0)).exp();
        self.intensity.map(|a| a * value)
    }

    /// Returns the integral over the sphere, 2π a (1 − e^(−2λ)) / λ.
    pub fn integral(&self) -> [f32; 3] {
        let share = 2.0 * PI * -(-2.0 * self.sharpness).exp_m1() / self.sharpness;
        self.intensity.map(|a| a * share)
    }
}

/// Evaluates lobes on the pixels of an equirectangular map: `[3, points, height, width]`.
///
/// `axes[points · lobes, 3]` are unit vectors, `sharpness[points · lobes, 1]`, `intensity[points · lobes, 3]`.
pub(crate) fn render(
    axes: Tensor<2>,
    sharpness: Tensor<2>,
    intensity: Tensor<2>,
    lobes: usize,
    [width, height]: [usize; 2],
) -> Tensor<4> {
    let points = axes.dims()[0] / lobes;
    let directions = directions([width, height]);
    let place = (&axes.device(), axes.dtype());
    let directions = Tensor::<2>::from_data(TensorData::new(directions, [3, width * height]), place);
    let values = ((axes.matmul(directions) - 1.0) * sharpness).exp();
    let values = values.reshape([points, lobes, width * height]);
    let intensity = intensity.reshape([points, lobes, 3]).swap_dims(1, 2);
    intensity.matmul(values).swap_dims(0, 1).reshape([3, points, height, width])
}

/// Returns the directions of a map's pixels as `[3, pixels]`.
pub(crate) fn directions([width, height]: [usize; 2]) -> Vec<f32> {
    let all: Vec<Vec3> = (0..width * height).map(|i| pixel_direction(i % width, i / width, width, height)).collect();
    let axis = |of: fn(&Vec3) -> f32| all.iter().map(of).collect::<Vec<f32>>();
    [axis(|d| d.x), axis(|d| d.y), axis(|d| d.z)].concat()
}

#[cfg(test)]
mod tests {
    use lo_geometry::pixel_solid_angle_sr;
    use lo_nets::Device;

    use super::*;
    use crate::testing::{assert_gradient, numbers, values};

    const LOBES: [Gaussian; 2] = [
        Gaussian { axis: Vec3::new(0.6, -0.48, 0.64), sharpness: 3.0, intensity: [2.0, 1.0, 0.5] },
        Gaussian { axis: Vec3::new(0.0, 1.0, 0.0), sharpness: 40.0, intensity: [0.1, 7.0, 20.0] },
    ];

    fn tensors(lobes: &[Gaussian]) -> [Tensor<2>; 3] {
        let device = Device::flex();
        let rows = |values: Vec<f32>| {
            let width = values.len() / lobes.len();
            Tensor::from_data(TensorData::new(values, [lobes.len(), width]), &device)
        };
        [
            rows(lobes.iter().flat_map(|lobe| lobe.axis.to_array()).collect()),
            rows(lobes.iter().map(|lobe| lobe.sharpness).collect()),
            rows(lobes.iter().flat_map(|lobe| lobe.intensity).collect()),
        ]
    }

    #[test]
    fn the_integral_is_the_closed_form() {
        let [axes, sharpness, intensity] = tensors(&LOBES);
        let (width, height) = (128, 64);
        // One point with two lobes.
        let map = numbers(render(axes, sharpness, intensity, 2, [width, height]));
        for c in 0..3 {
            let pixel = |i: usize| map[c * width * height + i] * pixel_solid_angle_sr(i / width, width, height);
            let sum: f32 = (0..width * height).map(pixel).sum();
            let expected: f32 = LOBES.iter().map(|lobe| lobe.integral()[c]).sum();
            assert!((sum / expected - 1.0).abs() < 5e-3, "{c}: {sum} {expected}");
            let direction = pixel_direction(77, 12, width, height);
            let expected: f32 = LOBES.iter().map(|lobe| lobe.radiance(direction)[c]).sum();
            assert!((map[(c * height + 12) * width + 77] - expected).abs() < 1e-5 * (1.0 + expected));
        }
    }

    #[test]
    fn points_do_not_mix() {
        let [axes, sharpness, intensity] = tensors(&LOBES);
        let map = numbers(render(axes, sharpness, intensity, 1, [8, 4]));
        for (point, lobe) in LOBES.iter().enumerate() {
            let expected = lobe.radiance(pixel_direction(3, 1, 8, 4));
            (0..3).for_each(|c| assert!((map[((c * 2 + point) * 4 + 1) * 8 + 3] - expected[c]).abs() < 1e-5));
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let [axes, sharpness, intensity] = tensors(&LOBES);
        let weights = values(3 * 2 * 32, 5);
        let weigh = |map: Tensor<4>| {
            let place = (&map.device(), map.dtype());
            let weights = Tensor::<4>::from_data(TensorData::new(weights.clone(), [3, 2, 4, 8]), place);
            (map * weights).sum()
        };
        let fixed = |x: &Tensor<2>, like: &Tensor<2>| {
            Tensor::<2>::from_data(x.clone().into_data().convert::<f64>(), (&like.device(), like.dtype()))
        };
        let (a, s, i) = (&axes, &sharpness, &intensity);
        assert_gradient(axes.clone(), |x| weigh(render(x.clone(), fixed(s, &x), fixed(i, &x), 1, [8, 4])));
        assert_gradient(sharpness.clone(), |x| weigh(render(fixed(a, &x), x.clone(), fixed(i, &x), 1, [8, 4])));
        assert_gradient(intensity.clone(), |x| weigh(render(fixed(a, &x), fixed(s, &x), x.clone(), 1, [8, 4])));
    }
}
