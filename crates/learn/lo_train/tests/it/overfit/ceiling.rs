//! Upper bound of an octree's quality at a given depth: node colours fitted to the panoramas by gradient descent
//! through the renderer, without a network.

use lo_cone::{Cone, ConeSample, ConeTracer, SampleGradient, Settings};
use lo_octree::LightOctree;
use lo_train::sample_panorama_rays;

use super::scene::Scene;

const RAYS: usize = 1 << 15;
const LEARNING_RATE: f32 = 0.1;
/// Adam's β₁ and β₂.
const BETAS: (f32, f32) = (0.9, 0.99);

/// An unconstrained parameter with Adam's moments.
#[derive(Clone, Copy, Default)]
struct Fitted {
    raw: f32,
    mean: f32,
    mean_square: f32,
}

/// Fits the true octree by `steps` of Adam on the squared error of log(1 + radiance).
pub fn fitted_octree(scene: &Scene, steps: usize) -> LightOctree {
    let mut light = scene.truth.clone();
    let first = light.octree.full_depth() as usize;
    let start = |rgba: &[f32; 4]| -> [Fitted; 4] {
        let opacity = rgba[3].clamp(1e-3, 0.995);
        let raw = |c: usize| if c < 3 { rgba[c].max(1e-3).ln() } else { (opacity / (1.0 - opacity)).ln() };
        std::array::from_fn(|c| Fitted { raw: raw(c), ..Fitted::default() })
    };
    let mut fitted: Vec<Vec<[Fitted; 4]>> =
        light.rgba[first..].iter().map(|level| level.iter().map(start).collect()).collect();
    for step in 0..steps {
        for (rgba, fitted) in light.rgba[first..].iter_mut().flatten().zip(fitted.iter().flatten()) {
            *rgba = std::array::from_fn(|c| feature(c, fitted[c].raw).0);
        }
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let rays = sample_panorama_rays(scene.views(), RAYS, &mut lo_random::stream(11, "ceiling", step as u64));
        let gradients = gradients(&tracer, &rays.cones, &rays.radiance);
        let rate = LEARNING_RATE / (1.0 + 8.0 * step as f32 / steps as f32);
        let corrections = (1.0 - BETAS.0.powi(step as i32 + 1), 1.0 - BETAS.1.powi(step as i32 + 1));
        for (fitted, gradient) in fitted.iter_mut().flatten().zip(gradients[first..].iter().flatten()) {
            for (c, value) in fitted.iter_mut().enumerate() {
                let gradient = gradient[c] * feature(c, value.raw).1;
                value.mean += (1.0 - BETAS.0) * (gradient - value.mean);
                value.mean_square += (1.0 - BETAS.1) * (gradient * gradient - value.mean_square);
                value.raw -= rate * value.mean / corrections.0 / ((value.mean_square / corrections.1).sqrt() + 1e-12);
            }
        }
    }
    light
}

/// Returns radiance e^raw or opacity σ(raw), and its derivative.
fn feature(channel: usize, raw: f32) -> (f32, f32) {
    if channel < 3 {
        (raw.exp(), raw.exp())
    } else {
        let share = 1.0 / (1.0 + (-raw).exp());
        (share.min(lo_octree::MAX_ALPHA), share * (1.0 - share))
    }
}

fn gradients(tracer: &ConeTracer, cones: &[Cone], radiance: &[[f32; 3]]) -> Vec<Vec<[f32; 4]>> {
    let mut samples = vec![ConeSample::default(); cones.len()];
    let slope = |got: f32, expected: f32| (got.ln_1p() - expected.ln_1p()) / (1.0 + got) / cones.len() as f32;
    let loss = |index: usize, sample: &ConeSample| SampleGradient {
        radiance: std::array::from_fn(|c| slope(sample.radiance[c], radiance[index][c])),
        ..SampleGradient::default()
    };
    tracer.trace_with_gradients(cones, &mut samples, &loss).rgba
}
