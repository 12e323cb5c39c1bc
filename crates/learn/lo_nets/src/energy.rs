//! Energy losses: compare the irradiance on surfaces of all orientations.
//!
//! Irradiance is linear in radiance. For a lamp with several possible positions, the loss is lowest where each position
//! has its share of the light, and omitting the lamp is penalised.

use std::f32::consts::PI;

use burn::tensor::Tensor;
use lo_geometry::{Vec3, fibonacci_sphere, pixel_direction, pixel_solid_angle_sr};

/// Number of surface normals at which irradiance is compared.
pub(crate) const NORMALS: usize = 96;

/// Rec. 709 luminance weights.
pub(crate) const LUMINANCE: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Share of the mean irradiance that is added before logarithms, so that dark values hardly count.
const DARK: f32 = 0.05;

/// Upper limit of a squared logarithm.
const MAX_SQUARE: f32 = 4.0;

/// Weight of the colour difference relative to the logarithmic one.
const COLOUR: f32 = 2.0;

/// Irradiance over π for each normal, under a batch of panoramas: one `[panoramas, NORMALS]` tensor per channel.
pub(crate) type Irradiance = [Tensor<2>; 3];

/// Returns irradiance over π at each normal of [`fibonacci_sphere`] by unit radiance from each direction:
/// `[directions, NORMALS]`. Each direction comes with its solid angle.
pub(crate) fn cosines(directions: impl Iterator<Item = (Vec3, f32)>) -> Vec<f32> {
    let normals = fibonacci_sphere(NORMALS);
    let of = |(direction, solid_angle_sr): (Vec3, f32)| {
        normals.iter().map(move |normal| normal.dot(direction).max(0.0) * solid_angle_sr / PI).collect::<Vec<_>>()
    };
    directions.flat_map(of).collect()
}

/// Returns [`cosines`] for the pixels of an equirectangular panorama of this size.
pub(crate) fn panorama_cosines(width: usize, height: usize) -> Vec<f32> {
    cosines((0..width * height).map(|i| {
        let (x, y) = (i % width, i / width);
        (pixel_direction(x, y, width, height), pixel_solid_angle_sr(y, width, height))
    }))
}

/// Returns the luminance.
pub(crate) fn light([r, g, b]: &Irradiance) -> Tensor<2> {
    let [kr, kg, kb] = LUMINANCE;
    r.clone() * kr + g.clone() * kg + b.clone() * kb
}

/// Returns the mean squared difference of the logarithms of luminance.
pub(crate) fn log_difference(got: &Irradiance, truth: &Irradiance) -> Tensor<1> {
    let (got, truth) = (light(got), light(truth));
    let mean = truth.clone().mean_dim(1) + 1e-6;
    let log = |light: Tensor<2>| (light + mean.clone() * DARK).log();
    (log(got) - log(truth)).square().clamp_max(MAX_SQUARE).mean()
}

/// Returns the mean angle between the colours, approximately in radians.
pub(crate) fn colour_difference(got: &Irradiance, truth: &Irradiance) -> Tensor<1> {
    let dot = |a: &Irradiance, b: &Irradiance| {
        a[0].clone() * b[0].clone() + a[1].clone() * b[1].clone() + a[2].clone() * b[2].clone()
    };
    let lengths = (dot(got, got) * dot(truth, truth) + 1e-12).sqrt();
    // The chord between unit vectors equals the angle where it is small.
    ((dot(got, truth) / lengths).neg() + (1.0 + 1e-5)).clamp_min(1e-6).mul_scalar(2.0).sqrt().mean()
}

/// Returns the weighted sum of logarithmic and colour difference.
pub(crate) fn difference(got: &Irradiance, truth: &Irradiance) -> Tensor<1> {
    log_difference(got, truth) + colour_difference(got, truth) * COLOUR
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;

    use super::*;
    use crate::testing::{numbers, recording_device};

    #[test]
    fn a_lamp_of_uncertain_position_is_kept() {
        // A lamp is at one of two positions. Without knowing which, the best panorama has half of it at both.
        let positions = [Vec3::X, Vec3::NEG_X];
        let sphere = fibonacci_sphere(500);
        let directions = sphere.iter().map(|&d| (d, 4.0 * PI / 500.0));
        let device = recording_device();
        let cosines = Tensor::<2>::from_data(TensorData::new(cosines(directions), [500, NORMALS]), &device);
        let under = |lamps: [f32; 2]| -> Irradiance {
            let radiance = |d: &Vec3| {
                let lit = positions.iter().zip(lamps).map(|(p, lamp)| if p.dot(*d) > 0.97 { lamp } else { 0.0 });
                0.3 + lit.sum::<f32>()
            };
            let row = Tensor::<2>::from_data(
                TensorData::new(sphere.iter().map(radiance).collect::<Vec<f32>>(), [1, 500]),
                &device,
            );
            [0; 3].map(|_| row.clone().matmul(cosines.clone()))
        };
        let cost = |lamps: [f32; 2]| {
            let truths = [[40.0, 0.0], [0.0, 40.0]];
            truths.map(|truth| numbers(log_difference(&under(lamps), &under(truth)).inner())[0]).iter().sum::<f64>()
        };
        let spread = cost([20.0, 20.0]);
        assert!(spread < 0.7 * cost([0.0, 0.0]) && spread < cost([40.0, 0.0]), "{spread}");
        assert!(cost([8.0, 8.0]) < cost([1.0, 1.0]) && cost([20.0, 20.0]) < cost([80.0, 80.0]));
        let [even, lit] = [under([0.0, 0.0]), under([40.0, 0.0])];
        assert!(numbers(colour_difference(&even, &lit).inner())[0] < 0.01, "both are grey");
        let red = [lit[0].clone(), lit[1].clone() * 0.0, lit[2].clone() * 0.0];
        let angle = numbers(colour_difference(&red, &lit).inner())[0];
        // Grey and red are arccos(1 / √3) apart: a chord of √(2 − 2 / √3).
        assert!((angle - (2.0 - 2.0 / 3f64.sqrt()).sqrt()).abs() < 1e-3, "{angle}");
        assert!(numbers(difference(&lit, &lit).inner())[0] < 0.02);
    }
}
