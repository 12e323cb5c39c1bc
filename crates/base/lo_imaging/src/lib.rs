//! Image input and output, colour, spherical projections, spherical harmonics and mirror balls.
//!
//! Radiance is linear, with Rec. 709 primaries, in relative units: 1.0 is the photo's white. Row 0 is the top row.

mod atomic;
mod bars;
mod chromaticity;
mod cmyk;
mod color;
mod color_profile;
mod contact_sheet;
mod cubemap;
mod depth;
mod encoded_image;
mod encoded_photo;
mod equirectangular;
mod error;
mod exif;
mod exr_read;
mod exr_write;
mod finite;
mod format;
mod gain_map;
mod gain_map_read;
mod generator;
mod heic;
mod image;
mod jpeg;
mod jpeg_xl;
mod main_light;
mod npy;
mod npz;
mod partial_panorama;
mod perspective;
mod pfm;
mod photo;
mod photo_file;
mod photo_note;
mod photo_tags;
mod projection;
mod raster;
mod raster_decoder;
mod read;
mod read_file;
mod resize;
mod rgbe;
mod sh;
mod source_color;
mod stored_depth;
mod stored_photo;
mod tone;
mod truncated;
mod unreadable;
mod write;
mod xmp;
mod y4m_write;

pub use crate::exif::{FocalLength, PhotoExposure};
pub use crate::image::{DepthMap, Image, RadianceImage};
pub use atomic::{temporary_beside, write_atomically};
pub use bars::BlackBars;
pub use color::{linear_from_srgb, linear_from_srgb8, luminance, srgb_from_linear, srgb8_from_linear};
pub use color_profile::ColorProfile;
pub use contact_sheet::{CONTACT_SHEET_BACKGROUND, contact_sheet, photo_tile};
pub use cubemap::{Cubemap, cubemap_from_equirectangular, equirectangular_from_cubemap};
pub use depth::DepthFile;
pub use encoded_image::MAX_PIXELS;
pub use encoded_photo::{EncodedPhoto, PhotoEncoding};
pub use equirectangular::{
    mean_luminance, reorient, reorient_depth, resize_equirectangular, rotate_equirectangular,
    rotate_equirectangular_nearest, sample_equirectangular,
};
pub use error::ImageError;
pub use exr_read::ExrChannels;
pub use exr_write::{ChannelGroup, EnvironmentLayout, ExrOptions};
pub use format::Format;
pub use gain_map::{GainMap, GainMapParameters};
pub use generator::GENERATOR;
pub use main_light::{MainLight, main_light, split_main_light};
pub use partial_panorama::PartialPanorama;
pub use perspective::{
    equirectangular_from_perspective, perspective_from_equirectangular, sample_clamped, view_rotation,
};
pub use photo::Photo;
pub use photo_file::PhotoFile;
pub use photo_note::PhotoNote;
pub use projection::SpecialProjection;
pub use read::{
    depth_from_bytes, exr_channels_from_bytes, inverse_depth_from_bytes, photo_from_bytes, radiance_from_bytes,
    read_depth, read_depth_file, read_exr_channels, read_inverse_depth, read_photo, read_radiance, read_rgba8,
    rgba8_from_bytes, size_from_bytes,
};
pub use read_file::{open_regular_file, read_regular_file, read_regular_text};
pub use resize::{resize, resize_depth};
pub use sh::Sh9;
pub use tone::ToneCurve;
pub use write::{
    JPEG_QUALITY, encode_exr, encode_photo, encode_png, encode_png_rgba, encode_rgba8, encode_srgb8, write_depth,
    write_exr, write_photo, write_png16, write_radiance, write_rgba8, write_srgb8, write_tone_mapped,
};
pub use y4m_write::Y4mWriter;
