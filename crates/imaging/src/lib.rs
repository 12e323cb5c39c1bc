//! Images: reading and writing every format of the specification, colour, projections of the sphere, spherical harmonics.
//!
//! Linear radiance in Rec. 709 primaries, relative units: 1.0 is the photo's white. Row 0 is the top row.

mod image;
mod photo;

pub use crate::image::{DepthMap, Image, RadianceImage};
pub use photo::Photo;
