//! Tone mapping for losses.

use burn::tensor::Tensor;

/// With this value, the curve is within 0.06 of sRGB between black and white.
const MU: f32 = 20.0;

/// Applies the μ-law ln(1 + μ L) / ln(1 + μ) (Kalantari & Ramamoorthi, "Deep high dynamic range imaging of dynamic
/// scenes", SIGGRAPH 2017). Radiance is in units of the photo's white and has no upper limit.
pub(crate) fn tone<const D: usize>(radiance: Tensor<D>) -> Tensor<D> {
    (radiance * MU).log1p() / MU.ln_1p()
}
