//! Active depth sensors: structured light and time of flight.

use lo_imaging::DepthMap;
use lo_random::{RngExt, Stream};
use rand_distr::{Distribution, StandardNormal};

use crate::depth_view::{DepthView, NEAREST_M};

/// Baseline of projector and camera, in metres (Khoshelham & Elberink 2012).
pub(crate) const BASELINE_M: f32 = 0.075;

/// Quantisation step of the Kinect's inverse depth, in 1/m (ibid., section 3.2: 2.85e-5 /cm for one level of the
/// normalised disparity).
const DISPARITY_STEP: f32 = 2.85e-3;

/// Simulates a Kinect v1 (Khoshelham & Elberink, "Accuracy and Resolution of Kinect Depth Data for Indoor Mapping
/// Applications", Sensors 2012): random error 1.425e-3 z² metres, steps of 2.85e-3 z² metres. Grazing surfaces follow
/// Nguyen, Izadi & Lovell, "Modeling Kinect Sensor Noise", 3DIMPVT 2012 (readings end near 70–80°).
pub(crate) fn structured_light(
    view: &DepthView,
    range_m: f32,
    noise: f32,
    least_return: f32,
    stream: &mut Stream,
) -> DepthMap {
    let (width, height) = (view.depth_m.width(), view.depth_m.height());
    let focal_baseline = view.camera.fx as f32 * BASELINE_M;
    let mut measured = DepthMap::new(width, height, vec![0.0; width * height]);
    for y in 0..height {
        // The projector is to the right, so its shadows lie left of nearer objects. Scanning from the right, a pixel is
        // lit while its disparity is at least that of every nearer pixel, minus the pixels between.
        let mut horizon = f32::NEG_INFINITY;
        for x in (0..width).rev() {
            let (normal, tilt): (f32, f32) = (StandardNormal.sample(stream), stream.random());
            let z = view.depth_m[(x, y)];
            let disparity = if z > 0.0 { focal_baseline / z } else { 0.0 };
            // Half a pixel, so that slanted surfaces do not shadow themselves.
            let shaded = disparity + 0.5 < horizon - (width - x) as f32;
            horizon = horizon.max(disparity + (width - x) as f32);
            let Some((cosine, returned)) = view.returned(x, y) else { continue };
            // The correlation window covers two surfaces.
            let torn = view.across_edge(x, y).is_some() && tilt < 0.7;
            let grazing = cosine < 0.2 + 0.15 * tilt;
            if shaded || torn || grazing || returned < least_return {
                continue;
            }
            let noisy = z + normal * noise * 1.425e-3 * z * z;
            let steps = (1.0 / (DISPARITY_STEP * noisy.max(1e-3))).round();
            let quantised = 1.0 / (DISPARITY_STEP * steps.max(1.0));
            if (NEAREST_M..=range_m).contains(&quantised) {
                measured[(x, y)] = quantised;
            }
        }
    }
    measured
}

/// Simulates a Kinect v2: noise by the fit of Fankhauser et al., "Kinect v2 for Mobile Robot Navigation: Evaluation and
/// Modeling", ICAR 2015 (σ = 1.5 − 0.5 z + 0.3 z² + 0.1 z^1.5 θ² / (π/2 − θ)² millimetres), more where little light
/// returns. Flying pixels between two surfaces at their edge. Rounded to millimetres.
pub(crate) fn time_of_flight(
    view: &DepthView,
    range_m: f32,
    noise: f32,
    least_return: f32,
    stream: &mut Stream,
) -> DepthMap {
    DepthMap::from_fn(view.depth_m.width(), view.depth_m.height(), |x, y| {
        let (normal, mix): (f32, f32) = (StandardNormal.sample(stream), stream.random());
        let Some((cosine, returned)) = view.returned(x, y) else { return 0.0 };
        if returned < least_return || cosine < 0.1 {
            return 0.0;
        }
        let z = match view.across_edge(x, y) {
            // A pixel that sees both sides. Half of them are detected and dropped.
            Some(_) if mix > 0.75 => return 0.0,
            Some(other) if mix > 0.5 => {
                let z = view.depth_m[(x, y)];
                z + (other - z) * (mix - 0.5) * 2.0
            }
            _ => view.depth_m[(x, y)],
        };
        let angle = cosine.acos();
        let sigma_mm = 1.5 - 0.5 * z
            + 0.3 * z * z
            + 0.1 * z.powf(1.5) * (angle / (std::f32::consts::FRAC_PI_2 - angle).max(0.02)).powi(2);
        // Shot noise: the published fit holds for bright walls; a white one at 4 m returns 1/16.
        let dim = (0.03 / returned).sqrt().clamp(1.0, 8.0);
        let noisy = z + normal * noise * dim * 1e-3 * sigma_mm.max(0.5);
        let millimetres = (noisy * 1000.0).round() / 1000.0;
        if (NEAREST_M..=range_m).contains(&millimetres) { millimetres } else { 0.0 }
    })
}
