//! Spherical Gaussian lobes of the light network's nodes: the paper's variant "SG" (`docs/method.md` §5.8).

use burn::tensor::{Tensor, TensorData};
use lo_geometry::{Cube, Vec3};
use lo_octree::{MIN_SHARPNESS, Octree, node_middle_m};

use crate::light::ObservedLight;

/// Limit of each component of a lobe: the peak is at most about eighty times the mean.
const MAX_SHARPNESS: f64 = 24.0;

/// Maps `raw[nodes, 3]` to lobes. Observed nodes have none: their radiance towards the camera is known and must not
/// change.
pub(crate) fn lobes(raw: Tensor<2>, observed: &ObservedLight) -> Tensor<2> {
    let unobserved: Vec<f32> = observed.trust().map(|trust| 1.0 - trust).collect();
    let size = [unobserved.len(), 1];
    let unobserved = Tensor::<2>::from_data(TensorData::new(unobserved, size), (&raw.device(), raw.dtype()));
    (raw / MAX_SHARPNESS).tanh() * MAX_SHARPNESS * unobserved
}

/// Returns unit directions from the centres of a depth's non-empty nodes to a viewer, three numbers each.
pub(crate) fn directions_to_viewer(octree: &Octree, cube: Cube, depth: u32, viewer_m: Vec3) -> Vec<f32> {
    let keys = octree.levels()[depth as usize].row_keys();
    keys.flat_map(|key| (viewer_m - node_middle_m(cube, depth, key)).normalize_or_zero().to_array()).collect()
}

/// Returns [`lo_octree::lobe_gain`] of `lobes[nodes, 3]` for unit directions: `[nodes, 1]`.
pub(crate) fn gains(lobes: Tensor<2>, towards: &[f32]) -> Tensor<2> {
    let directions = TensorData::new(towards.to_vec(), lobes.dims());
    let directions = Tensor::<2>::from_data(directions, (&lobes.device(), lobes.dtype()));
    let sharpness = (lobes.clone().square().sum_dim(1) + f64::from(MIN_SHARPNESS).powi(2)).sqrt();
    let norm = sharpness.clone() * 2.0 / ((sharpness.clone() * -2.0).exp().neg() + 1.0);
    ((lobes * directions).sum_dim(1) - sharpness).exp() * norm
}

#[cfg(test)]
mod tests {
    use lo_octree::lobe_gain;

    use super::*;
    use crate::testing::{assert_gradients, numbers, recording_device, values};

    fn directions(count: usize) -> Vec<f32> {
        lo_geometry::fibonacci_sphere(count).into_iter().flat_map(|d| d.to_array()).collect()
    }

    #[test]
    fn gains_equal_the_octrees_and_have_correct_gradients() {
        let towards = directions(30);
        assert_gradients(&[[30, 3]], |[lobes]| gains(lobes * 3.0, &towards));
        let lobes: Vec<f32> = values(90, 1).iter().map(|v| 6.0 * *v as f32).collect();
        let data = TensorData::new(lobes.clone(), [30, 3]);
        let found = numbers(gains(Tensor::from_data(data, &recording_device()), &towards));
        for (i, found) in found.into_iter().enumerate() {
            let at = |from: &[f32]| Vec3::from_slice(&from[3 * i..]);
            let expected = f64::from(lobe_gain(at(&lobes), at(&towards)));
            assert!((found - expected).abs() < 1e-4 * expected.max(1.0), "{found} {expected}");
        }
    }
}
