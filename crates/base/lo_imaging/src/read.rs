use std::path::Path;

use crate::encoded_image::EncodedImage;
use crate::exif::{FocalLength, PhotoExposure};
use crate::exr_read::{self, ExrChannels};
use crate::pfm::Pfm;
use crate::read_file::read_regular_file;
use crate::{DepthMap, Format, Image, ImageError, Photo, RadianceImage, depth, pfm, raster, rgbe};

/// Size limit of files: more than an image of [`MAX_PIXELS`](crate::MAX_PIXELS) can need.
const MAX_FILE_BYTES: u64 = 16 << 30;

/// A photo with its file's metadata on lens and exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoFile {
    /// The pixels, upright.
    pub photo: Photo,
    /// Lens tags, as far as EXIF has them.
    pub focal: FocalLength,
    /// Exposure tags, as far as EXIF has them.
    pub exposure: PhotoExposure,
}

impl PhotoFile {
    /// Focal length in pixels of this photo, as in [`FocalLength::focal_px`]. The photo is upright; pixels are square.
    pub fn focal_px(&self) -> Option<f64> {
        self.focal.focal_px(self.photo.width() as u32, self.photo.height() as u32)
    }

    /// Horizontal field of view of this photo in degrees, as in [`FocalLength::hfov_deg`].
    pub fn hfov_deg(&self) -> Option<f64> {
        self.focal.hfov_deg(self.photo.width() as u32, self.photo.height() as u32)
    }
}

/// Reads a photo: PNG, JPEG, WebP, TIFF, BMP and PNM as sRGB with EXIF orientation applied; HDR, EXR and PFM as linear
/// radiance.
///
/// The format is detected from the content, else from the extension. 8-bit images stay 8-bit; palettes are resolved,
/// grey becomes RGB, alpha is dropped (the stored colour stays), and embedded colour profiles are ignored.
///
/// Sizes are checked before memory is allocated: at most [`MAX_PIXELS`](crate::MAX_PIXELS), and at most 4 megapixels +
/// 1100 pixels for each byte of the file.
///
/// # Errors
/// [`ImageError`] for unreadable, unrecognised, damaged, unsupported and too large files.
pub fn read_photo(path: impl AsRef<Path>) -> Result<PhotoFile, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    photo_from_bytes(&bytes, &name)
}

/// Like [`read_photo`], from memory. `name` appears in errors; its extension is used if the content is not recognised.
pub fn photo_from_bytes(bytes: &[u8], name: &str) -> Result<PhotoFile, ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP, PNM, HDR, EXR or PFM")?;
    catch_decoder_panic(source, || match source.format {
        Format::Hdr | Format::Exr | Format::Pfm => {
            let photo = Photo::Linear(decode_radiance(source)?);
            Ok(PhotoFile { photo, focal: FocalLength::default(), exposure: PhotoExposure::default() })
        }
        _ => {
            let (decoded, focal, exposure) = raster::decode(source)?;
            Ok(PhotoFile { photo: raster::photo(decoded), focal, exposure })
        }
    })
}

/// Reads linear radiance from Radiance `.hdr`, OpenEXR or PFM. Other formats of [`read_photo`] are linearised.
///
/// Values are as stored (a lossy EXR may have some just below zero), with two exceptions: the `EXPOSURE` and
/// `COLORCORR` of a `.hdr` are undone, and an EXR whose `chromaticities` are not Rec. 709 is converted.
///
/// EXR: reads the data window of the first part with `R G B` (plain, else of a layer), else `Y`, else the only channel
/// as grey. Scan lines and tiles; half, float and uint; no compression, RLE, ZIP, ZIPS, PIZ, PXR24, B44, B44A, DWAA,
/// DWAB.
///
/// # Errors
/// As for [`read_photo`]; [`ImageError::Unsupported`] for deep data, HTJ2K and subsampled chroma.
pub fn read_radiance(path: impl AsRef<Path>) -> Result<RadianceImage, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    radiance_from_bytes(&bytes, &name)
}

/// Like [`read_radiance`], from memory.
pub fn radiance_from_bytes(bytes: &[u8], name: &str) -> Result<RadianceImage, ImageError> {
    photo_from_bytes(bytes, name).map(|file| file.photo.into_radiance())
}

/// Reads depth in metres.
///
/// Integers of 16-bit PNG, PGM, TIFF and NPY are divided by `units_per_metre` (default 1000). Floats of EXR (`Z`,
/// `depth`, `Y`, `R`), PFM, TIFF and NPY are divided by `units_per_metre` (default 1).
///
/// 0, negative values, NaN, ∞ and values from 100 km on mean "no reading" and become 0.
///
/// # Errors
/// As for [`read_photo`]; also a scale that is not positive, and files with negative depths only, whose axis points the
/// other way.
pub fn read_depth(path: impl AsRef<Path>, units_per_metre: Option<f64>) -> Result<DepthMap, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    depth_from_bytes(&bytes, &name, units_per_metre)
}

/// Like [`read_depth`], from memory.
pub fn depth_from_bytes(bytes: &[u8], name: &str, units_per_metre: Option<f64>) -> Result<DepthMap, ImageError> {
    let source = open(bytes, name, "16-bit PNG, PGM, EXR, PFM, TIFF or NPY")?;
    catch_decoder_panic(source, || depth::decode(source, units_per_metre))
}

/// Reads 8-bit RGBA (PNG, JPEG, WebP, TIFF, BMP, PNM) with straight alpha, 255 if the file has none.
pub fn read_rgba8(path: impl AsRef<Path>) -> Result<Image<[u8; 4]>, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    rgba8_from_bytes(&bytes, &name)
}

/// Like [`read_rgba8`], from memory, for textures of meshes.
pub fn rgba8_from_bytes(bytes: &[u8], name: &str) -> Result<Image<[u8; 4]>, ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP or PNM")?;
    catch_decoder_panic(source, || Ok(raster::rgba8(raster::decode(source)?.0)))
}

/// Reads width and height from the header of an image in the formats of [`read_rgba8`].
///
/// The size is as stored, before the EXIF orientation is applied.
pub fn size_from_bytes(bytes: &[u8], name: &str) -> Result<[u32; 2], ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP or PNM")?;
    catch_decoder_panic(source, || raster::size(source))
}

/// Reads every channel and text attribute of the first part of an OpenEXR file.
pub fn read_exr_channels(path: impl AsRef<Path>) -> Result<ExrChannels, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    exr_channels_from_bytes(&bytes, &name)
}

/// Like [`read_exr_channels`], from memory.
pub fn exr_channels_from_bytes(bytes: &[u8], name: &str) -> Result<ExrChannels, ImageError> {
    let source = EncodedImage { bytes, name, format: Format::Exr };
    catch_decoder_panic(source, || exr_read::decode_channels(source))
}

/// Converts a decoder's panic to an error: with overflow checks `exr` 1.74 panics on damaged B44 blocks, and a file
/// must never abort the program.
///
/// Unwind safe, since no state of a failed decoder is kept.
fn catch_decoder_panic<T>(
    source: EncodedImage,
    decode: impl FnOnce() -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(source.invalid("the decoder failed")))
}

fn decode_radiance(source: EncodedImage) -> Result<RadianceImage, ImageError> {
    match source.format {
        Format::Hdr => rgbe::decode(source),
        Format::Exr => exr_read::decode_radiance(source),
        _ => Ok(match pfm::decode(source)? {
            Pfm::Color(image) => image,
            Pfm::Grey(image) => image.map(|&v| [v; 3]),
        }),
    }
}

fn open<'a>(bytes: &'a [u8], name: &'a str, expected: &'static str) -> Result<EncodedImage<'a>, ImageError> {
    let format = Format::detect(bytes, name);
    let format = format.ok_or_else(|| ImageError::UnknownFormat { name: name.to_owned(), expected })?;
    Ok(EncodedImage { bytes, name, format })
}

fn read_file(path: &Path) -> Result<(Vec<u8>, String), ImageError> {
    let bytes =
        read_regular_file(path, MAX_FILE_BYTES).map_err(|source| ImageError::Io { path: path.to_owned(), source })?;
    Ok((bytes, path.display().to_string()))
}
