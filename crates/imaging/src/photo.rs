use crate::{Image, RadianceImage};

/// The pixels of a photo as they came: 8-bit pictures stay 8-bit, so that what is not changed can be written back bit by bit.
#[derive(Clone, Debug, PartialEq)]
pub enum Photo {
    /// 8-bit sRGB (IEC 61966-2-1), EXIF orientation applied.
    Srgb8(Image<[u8; 3]>),
    /// Linear Rec. 709 radiance, from 16-bit or HDR files.
    Linear(RadianceImage),
}

impl Photo {
    /// Width in pixels.
    pub fn width(&self) -> usize {
        match self {
            Self::Srgb8(image) => image.width(),
            Self::Linear(image) => image.width(),
        }
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        match self {
            Self::Srgb8(image) => image.height(),
            Self::Linear(image) => image.height(),
        }
    }
}
