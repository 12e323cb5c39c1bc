//! A dense volume of radiance and opacity, and its rendering along rays.

use std::sync::Arc;

use burn::tensor::Tensor;
use lo_geometry::Vec3;
use lo_nets::cpu_ops::{Kernel, Number, unary};
use rayon::prelude::*;

/// Parts into which rays are divided for gradients. Their number is fixed, so that sums do not depend on the threads.
const PARTS: usize = 4;

/// Transmittance below which a ray ends.
const OPAQUE: f64 = 1e-3;

/// A cube of `side`³ voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Corner with the smallest coordinates, in the photo's frame, metres.
    pub corner_m: Vec3,
    /// Edge of a voxel, metres.
    pub voxel_m: f32,
    /// Voxels along an edge.
    pub side: usize,
}

/// Radiance and opacity of every voxel.
#[derive(Clone, Debug, PartialEq)]
pub struct Volume {
    /// Its place.
    pub grid: Grid,
    /// `[4, z, y, x]`: red, green, blue, opacity across one voxel's edge.
    pub values: Vec<f32>,
}

/// A ray in voxels: origin and unit direction.
pub(crate) type VoxelRay = [Vec3; 2];

impl Grid {
    /// Returns a cube around the origin.
    pub fn around_camera(half_edge_m: f32, side: usize) -> Self {
        Self { corner_m: Vec3::splat(-half_edge_m), voxel_m: 2.0 * half_edge_m / side as f32, side }
    }

    /// Returns a position in voxels.
    pub fn voxels(&self, position_m: Vec3) -> Vec3 {
        (position_m - self.corner_m) / self.voxel_m
    }

    /// Returns the index of the voxel that holds a position, the nearest one where it is outside.
    pub fn index(&self, position_m: Vec3) -> usize {
        let [x, y, z] = self.voxels(position_m).to_array().map(|v| (v.max(0.0) as usize).min(self.side - 1));
        (z * self.side + y) * self.side + x
    }

    /// Returns the middle of a voxel.
    pub fn middle_m(&self, index: usize) -> Vec3 {
        let at = [index % self.side, index / self.side % self.side, index / self.side / self.side];
        self.corner_m + Vec3::from_array(at.map(|i| i as f32 + 0.5)) * self.voxel_m
    }
}

impl Volume {
    /// Returns the radiance that arrives at a position from unit directions. Rays that leave the volume see black.
    pub fn radiance(&self, position_m: Vec3, directions: &[Vec3]) -> Vec<[f32; 3]> {
        let origin = self.grid.voxels(position_m);
        let march = March { side: self.grid.side };
        let ray = |&direction: &Vec3| {
            let mut seen = Composite::default();
            march.follow([origin, direction], |corners| {
                let sample = march.sample(&self.values, corners);
                seen.add(sample);
                seen.transmittance > OPAQUE
            });
            seen.radiance.map(|v| v as f32)
        };
        directions.par_iter().map(ray).collect()
    }
}

/// Renders rays through `volume[4, side³]`: radiance `[rays, 3]`.
pub(crate) fn render(volume: Tensor<2>, side: usize, rays: Vec<VoxelRay>) -> Tensor<2> {
    unary(volume, MarchKernel { march: March { side }, rays: Arc::new(rays) })
}

/// The eight voxels around a sample with their weights.
type Corners = [(usize, f64); 8];

/// Radiance in front of what follows along a ray.
struct Composite {
    radiance: [f64; 3],
    transmittance: f64,
}

impl Default for Composite {
    fn default() -> Self {
        Self { radiance: [0.0; 3], transmittance: 1.0 }
    }
}

impl Composite {
    fn add(&mut self, [r, g, b, opacity]: [f64; 4]) {
        let weight = self.transmittance * opacity;
        self.radiance.iter_mut().zip([r, g, b]).for_each(|(sum, value)| *sum += weight * value);
        self.transmittance *= 1.0 - opacity;
    }
}

/// Samples at steps of one voxel, interpolated trilinearly.
#[derive(Clone, Copy, Debug)]
struct March {
    side: usize,
}

impl March {
    /// Calls `visit` for every sample of a ray until it returns false.
    fn follow(self, [origin, direction]: VoxelRay, mut visit: impl FnMut(&Corners) -> bool) {
        let side = self.side as f32;
        let (mut near, mut far) = (0.0f32, f32::MAX);
        for axis in 0..3 {
            let (o, d) = (origin[axis], direction[axis]);
            if d.abs() < 1e-9 {
                if !(0.0..side).contains(&o) {
                    return;
                }
                continue;
            }
            let (a, b) = ((0.0 - o) / d, (side - o) / d);
            (near, far) = (near.max(a.min(b)), far.min(a.max(b)));
        }
        let mut along = near + 0.5;
        while along < far {
            if !visit(&self.corners(origin + direction * along)) {
                return;
            }
            along += 1.0;
        }
    }

    fn corners(self, position: Vec3) -> Corners {
        let most = self.side - 1;
        let axis = |v: f32| {
            let v = f64::from((v - 0.5).clamp(0.0, most as f32));
            let low = (v as usize).min(most.saturating_sub(1));
            (low, v - low as f64)
        };
        let [(x, fx), (y, fy), (z, fz)] = position.to_array().map(axis);
        std::array::from_fn(|corner| {
            let part = |bit: usize, low: usize, share: f64| {
                let upper = corner >> bit & 1 == 1;
                if upper { ((low + 1).min(most), share) } else { (low, 1.0 - share) }
            };
            let ((x, wx), (y, wy), (z, wz)) = (part(0, x, fx), part(1, y, fy), part(2, z, fz));
            ((z * self.side + y) * self.side + x, wx * wy * wz)
        })
    }

    fn sample<T: Number>(self, volume: &[T], corners: &Corners) -> [f64; 4] {
        let count = volume.len() / 4;
        std::array::from_fn(|channel| {
            let plane = &volume[channel * count..][..count];
            corners.iter().map(|&(index, weight)| weight * plane[index].as_f64()).sum()
        })
    }
}

/// [`render`] on slices.
#[derive(Clone, Debug)]
struct MarchKernel {
    march: March,
    rays: Arc<Vec<VoxelRay>>,
}

impl Kernel for MarchKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        assert_eq!(sizes[0], [4, self.march.side.pow(3)], "four channels of a cube");
        [self.rays.len(), 3]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]]) -> Vec<T> {
        let ray = |ray: &VoxelRay| {
            let mut seen = Composite::default();
            self.march.follow(*ray, |corners| {
                seen.add(self.march.sample(inputs[0], corners));
                seen.transmittance > OPAQUE
            });
            seen.radiance.map(T::from_f64)
        };
        self.rays.par_iter().flat_map_iter(ray).collect()
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let (volume, count) = (inputs[0], inputs[0].len() / 4);
        let length = self.rays.len().div_ceil(PARTS).max(1);
        let part = |(rays, gradient): (&[VoxelRay], &[T])| {
            let mut by_volume = vec![T::default(); volume.len()];
            let mut samples: Vec<(Corners, [f64; 4], f64)> = Vec::new();
            for (ray, gradient) in rays.iter().zip(gradient.as_chunks::<3>().0) {
                samples.clear();
                let mut seen = Composite::default();
                self.march.follow(*ray, |corners| {
                    let sample = self.march.sample(volume, corners);
                    samples.push((*corners, sample, seen.transmittance));
                    seen.add(sample);
                    seen.transmittance > OPAQUE
                });
                let gradient = gradient.map(Number::as_f64);
                let dot = |rgb: [f64; 3]| rgb.iter().zip(gradient).map(|(a, b)| a * b).sum::<f64>();
                // What the light behind the current sample adds to the loss.
                let mut behind = 0.0;
                for (corners, [r, g, b, opacity], transmittance) in samples.iter().rev() {
                    let own = dot([*r, *g, *b]);
                    let by_opacity = transmittance * (own - behind);
                    behind = opacity * own + (1.0 - opacity) * behind;
                    let reaching = transmittance * opacity;
                    let all = [gradient[0] * reaching, gradient[1] * reaching, gradient[2] * reaching, by_opacity];
                    for &(index, weight) in corners {
                        for (channel, by_sample) in all.into_iter().enumerate() {
                            let sum = &mut by_volume[channel * count + index];
                            *sum += T::from_f64(weight * by_sample);
                        }
                    }
                }
            }
            by_volume
        };
        let parts: Vec<Vec<T>> = self.rays.par_chunks(length).zip(gradient.par_chunks(3 * length)).map(part).collect();
        let sum = |i: usize| parts.iter().fold(T::default(), |sum, part| sum + part[i]);
        vec![(0..volume.len()).into_par_iter().map(sum).collect()]
    }
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;
    use lo_geometry::fibonacci_sphere;
    use lo_nets::Device;

    use super::*;
    use crate::testing::{assert_gradient, numbers, values};

    #[test]
    fn fog_is_the_closed_form() {
        // Even fog of radiance L and opacity a per voxel: L (1 − (1 − a)ⁿ) after n samples.
        let grid = Grid::around_camera(2.0, 16);
        let (light, opacity) = ([2.0f32, 1.0, 0.5], 0.1f32);
        let voxels = 16 * 16 * 16;
        let channel = |value: f32| std::iter::repeat_n(value, voxels);
        let values = light.into_iter().chain([opacity]).flat_map(channel).collect();
        let volume = Volume { grid, values };
        // From the corner of the room along an axis: 16 voxels.
        let seen = volume.radiance(Vec3::new(-2.0, 0.1, 0.1), &[Vec3::X, Vec3::NEG_X]);
        let expected = 1.0 - 0.9f32.powi(16);
        assert!((0..3).all(|c| (seen[0][c] / light[c] - expected).abs() < 1e-4), "{seen:?}");
        assert_eq!(seen[1], [0.0; 3], "outwards");
    }

    #[test]
    fn a_wall_is_seen_where_it_stands() {
        let grid = Grid::around_camera(3.2, 32);
        let mut volume = Volume { grid, values: vec![0.0; 4 * 32 * 32 * 32] };
        let voxels = 32 * 32 * 32;
        for index in 0..voxels {
            // A wall of x from 1.6 to 2.0 with a lighter upper half. Clear voxels have a colour, too, since both are
            // interpolated.
            let middle = grid.middle_m(index);
            assert_eq!(grid.index(middle), index);
            let value = if middle.y > 0.0 { 3.0 } else { 1.0 };
            (0..3).for_each(|c| volume.values[c * voxels + index] = value);
            volume.values[3 * voxels + index] = f32::from(u8::from((1.6..2.0).contains(&middle.x)));
        }
        for position in [Vec3::ZERO, Vec3::new(0.5, -0.3, 1.0)] {
            for direction in fibonacci_sphere(300) {
                let reach = (1.8 - position.x) / direction.x;
                let hit = position + direction * reach;
                if direction.x < 0.2 || hit.abs().max_element() > 2.9 || hit.y.abs() < 0.4 {
                    continue;
                }
                let seen = volume.radiance(position, &[direction])[0][0];
                let expected = if hit.y > 0.0 { 3.0 } else { 1.0 };
                assert!((seen - expected).abs() < 0.05 * expected, "{direction}: {seen} {expected}");
            }
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        let side = 4;
        let start: Vec<f32> = values(4 * 64, 3).into_iter().map(|v| 0.45 + 0.3 * v).collect();
        let at = Tensor::<2>::from_data(TensorData::new(start, [4, 64]), &Device::flex());
        let rays: Vec<VoxelRay> = fibonacci_sphere(9).into_iter().map(|d| [Vec3::new(1.7, 2.2, 1.9), d]).collect();
        let weights = values(27, 8);
        assert_gradient(at.clone(), |volume| {
            let place = (&volume.device(), volume.dtype());
            let weights = Tensor::<2>::from_data(TensorData::new(weights.clone(), [9, 3]), place);
            (render(volume, side, rays.clone()) * weights).sum()
        });
        // The plain renderer is the same.
        let volume = Volume {
            grid: Grid { corner_m: Vec3::ZERO, voxel_m: 1.0, side },
            values: at.clone().into_data().iter().collect(),
        };
        let directions: Vec<Vec3> = rays.iter().map(|ray| ray[1]).collect();
        let plain = volume.radiance(rays[0][0], &directions).concat();
        for (a, b) in numbers(render(at, side, rays)).iter().zip(plain) {
            assert!((a - b).abs() < 1e-5);
        }
    }
}
