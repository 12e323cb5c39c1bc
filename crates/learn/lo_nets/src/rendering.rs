//! Differentiable rendering: cone tracing of the network's output as an operation with gradients (`docs/method.md` §3).

use std::fmt;
use std::sync::Arc;

use burn::tensor::Tensor;
use lo_cone::{Cone, ConeSample, ConeTracer, SampleGradient, Settings, TracerError};
use lo_geometry::Cube;
use lo_octree::{LightOctree, Octree};

use crate::cpu_ops::{Kernel, Number, unary};

/// Channels of a cone sample.
pub const SAMPLE_CHANNELS: usize = 5;

/// Renders `cones` in an octree whose non-empty nodes hold `rgba`.
///
/// `rgba[rows, 4]` is linear RGB and opacity of all levels from the full depth on, concatenated. Returns `[cones, 5]`:
/// radiance (3), expected distance in metres, opacity. Gradients are exact except where tracing clamps opacity.
///
/// # Errors
/// Settings out of range.
///
/// # Panics
/// Where the octree has another number of rows, or the tensor is not on the CPU.
pub fn render(
    rgba: Tensor<2>,
    octree: Octree,
    cube: Cube,
    cones: Arc<[Cone]>,
    settings: Settings,
) -> Result<Tensor<2>, TracerError> {
    // The tracer requires levels above the full depth, but never samples them.
    let full_depth = octree.full_depth() as usize;
    let values: Vec<f32> = rgba.clone().inner().into_data().iter().collect();
    let mut rows = values.as_chunks::<4>().0.iter().copied();
    let counts: Vec<usize> = octree.levels().iter().map(|level| level.nonempty).collect();
    let levels = counts.iter().enumerate().map(|(depth, &count)| match depth < full_depth {
        true => vec![[0.0; 4]; count],
        false => rows.by_ref().take(count).collect(),
    });
    let light = LightOctree { rgba: levels.collect(), octree, cube, seen: Vec::new(), lobes: None };
    assert_eq!(values.len() / 4, counts[full_depth..].iter().sum::<usize>(), "RGBα of every non-empty node");
    let tracer = ConeTracer::new(&light, settings)?;
    Ok(unary(rgba, RenderKernel(Arc::new(PreparedRendering { tracer, full_depth, cones }))))
}

/// Tracer and cones, built once for forward and backward pass.
struct PreparedRendering {
    tracer: ConeTracer,
    full_depth: usize,
    cones: Arc<[Cone]>,
}

/// Traces the octree in `PreparedRendering`, which holds the same values as the kernel's input.
#[derive(Clone)]
struct RenderKernel(Arc<PreparedRendering>);

impl fmt::Debug for RenderKernel {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "RenderKernel({} cones)", self.0.cones.len())
    }
}

impl Kernel for RenderKernel {
    fn output_size(&self, _: &[[usize; 2]]) -> [usize; 2] {
        [self.0.cones.len(), SAMPLE_CHANNELS]
    }

    fn forward<T: Number>(&self, _: &[&[T]], _: &[[usize; 2]]) -> Vec<T> {
        let mut samples = vec![ConeSample::default(); self.0.cones.len()];
        self.0.tracer.trace_batch(&self.0.cones, &mut samples);
        let channels =
            samples.iter().flat_map(|s| [s.radiance[0], s.radiance[1], s.radiance[2], s.distance_m, s.opacity]);
        channels.map(|value| T::from_f64(f64::from(value))).collect()
    }

    fn backward<T: Number>(&self, _: &[&[T]], _: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        let rows = gradient.as_chunks::<SAMPLE_CHANNELS>().0.iter().map(|row| row.map(|value| value.as_f64() as f32));
        let d_samples: Vec<SampleGradient> = rows
            .map(|[r, g, b, distance_m, opacity]| SampleGradient { radiance: [r, g, b], distance_m, opacity })
            .collect();
        let gradients = self.0.tracer.trace_backward(&self.0.cones, &d_samples);
        let rows = gradients.rgba[self.0.full_depth..].iter().flatten().flatten();
        vec![rows.map(|&value| T::from_f64(f64::from(value))).collect()]
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use burn::tensor::TensorData;
    use lo_geometry::Vec3;

    use super::*;
    use crate::graph::uneven_octree;
    use crate::testing::{numbers, recording_device, values};

    fn scene() -> (Octree, Vec<f64>, Arc<[Cone]>) {
        let mut octree = uneven_octree();
        let finest = octree.levels().last().unwrap().len();
        octree.set_nonempty(&(0..finest).map(|node| node % 3 == 0).collect::<Vec<_>>()).unwrap();
        let rows: usize = octree.levels()[1..].iter().map(|level| level.nonempty).sum();
        let rgba = values(4 * rows, 3).iter().map(|v| 0.4 + 0.25 * v).collect();
        let directions = lo_geometry::fibonacci_sphere(60);
        let cone = |direction: Vec3| Cone { origin: Vec3::new(0.51, 0.47, 0.53), direction, tan_half_angle: 0.05 };
        (octree, rgba, directions.into_iter().map(cone).collect())
    }

    const CUBE: Cube = Cube { origin_m: Vec3::ZERO, edge_m: 1.0 };

    #[test]
    fn rendering_equals_the_tracer_and_its_gradient_finite_differences() {
        let (octree, rgba, cones) = scene();
        let device = recording_device();
        let of = |values: &[f64]| {
            let values: Vec<f32> = values.iter().map(|&v| v as f32).collect();
            let rows = values.len() / 4;
            Tensor::<2>::from_data(TensorData::new(values, [rows, 4]), &device)
        };
        let samples = |rgba: Tensor<2>| render(rgba, octree.clone(), CUBE, cones.clone(), Settings::default()).unwrap();
        let factors = of(&values(4 * cones.len(), 5)).reshape([-1]);
        let loss = |rgba: Tensor<2>| {
            let seen = samples(rgba).narrow(1, 0, 4).reshape([-1]);
            (seen * factors.clone()).sum()
        };
        let point = of(&rgba).require_grad();
        let gradients = loss(point.clone()).backward();
        let got = numbers(point.grad(&gradients).unwrap());
        let largest = got.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        let mut touched = 0;
        for index in (0..rgba.len()).step_by(7) {
            let at = |step: f64| {
                let mut moved = rgba.clone();
                moved[index] += step;
                numbers(loss(of(&moved).inner()))[0]
            };
            // Tolerance: f32 sums of 240 terms are exact to 1e-5, over a step of 0.02. `lo_cone` checks exact
            // derivatives in f64.
            let expected = (at(0.01) - at(-0.01)) / 0.02;
            assert!((got[index] - expected).abs() < 3e-3 * largest, "{index}: {} {expected}", got[index]);
            touched += usize::from(expected.abs() > 1e-2 * largest);
        }
        assert!(touched > 10, "{touched} values matter");
    }
}
