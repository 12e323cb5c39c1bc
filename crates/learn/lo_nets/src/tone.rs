//! Radiance as pictures show it, for losses.

use burn::tensor::Tensor;

/// So that the curve is that of sRGB up to 0.06 between black and white.
const MU: f32 = 20.0;

/// ln(1 + μ L) / ln(1 + μ): the μ-law of Kalantari & Ramamoorthi, "Deep high dynamic range imaging of dynamic scenes", SIGGRAPH 2017, here in units of the
/// photo's white and without an upper end.
pub(crate) fn tone<const D: usize>(radiance: Tensor<D>) -> Tensor<D> {
    (radiance * MU).log1p() / MU.ln_1p()
}
