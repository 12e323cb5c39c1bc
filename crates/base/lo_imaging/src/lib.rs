//! Image input and output, colour, spherical projections, spherical harmonics and mirror balls.
//!
//! Radiance is linear, with Rec. 709 primaries, in relative units: 1.0 is the photo's white. Row 0 is the top row.

mod atomic;
mod chromaticity;
mod color;
mod contact_sheet;
mod cubemap;
mod depth;
mod encoded_image;
mod equirectangular;
mod error;
mod exif;
mod exr_read;
mod exr_write;
mod format;
mod generator;
mod image;
mod main_light;
mod npy;
mod perspective;
mod pfm;
mod photo;
mod raster;
mod read;
mod resize;
mod rgbe;
mod sh;
mod stored_depth;
mod tone;
mod write;
mod y4m_write;

pub use crate::exif::{FocalLength, PhotoExposure};
pub use crate::image::{DepthMap, Image, RadianceImage};
pub use atomic::{temporary_beside, write_atomically};
pub use color::{linear_from_srgb, linear_from_srgb8, luminance, srgb_from_linear, srgb8_from_linear};
pub use contact_sheet::{CONTACT_SHEET_BACKGROUND, contact_sheet, photo_tile};
pub use cubemap::{Cubemap, cubemap_from_equirectangular, equirectangular_from_cubemap};
pub use encoded_image::MAX_PIXELS;
pub use equirectangular::{
    reorient, reorient_depth, resize_equirectangular, rotate_equirectangular, rotate_equirectangular_nearest,
    sample_equirectangular,
};
pub use error::ImageError;
pub use exr_read::ExrChannels;
pub use exr_write::{ChannelGroup, EnvironmentLayout, ExrOptions};
pub use format::Format;
pub use generator::GENERATOR;
pub use main_light::{MainLight, main_light};
pub use perspective::{
    equirectangular_from_perspective, perspective_from_equirectangular, sample_clamped, view_rotation,
};
pub use photo::Photo;
pub use read::{
    PhotoFile, depth_from_bytes, exr_channels_from_bytes, photo_from_bytes, radiance_from_bytes, read_depth,
    read_exr_channels, read_photo, read_radiance, read_rgba8, rgba8_from_bytes, size_from_bytes,
};
pub use resize::{resize, resize_depth};
pub use sh::Sh9;
pub use tone::ToneCurve;
pub use write::{
    JPEG_QUALITY, encode_exr, encode_photo, encode_png, encode_png_rgba, encode_rgba8, encode_srgb8, write_depth,
    write_exr, write_photo, write_png16, write_radiance, write_rgba8, write_srgb8, write_tone_mapped,
};
pub use y4m_write::Y4mWriter;
