use std::path::Path;

use crate::exif::{FocalLength, ShotExposure};
use crate::exr_read::{self, ExrChannels};
use crate::pfm::Pfm;
use crate::source::Source;
use crate::{DepthMap, Format, Image, ImageError, Photo, RadianceImage, depth, pfm, raster, rgbe};

/// Largest file that is read: beyond what [`MAX_PIXELS`](crate::MAX_PIXELS) can need.
const MAX_FILE_BYTES: u64 = 16 << 30;

/// A photo and what its file says about the lens and the exposure.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoFile {
    /// The pixels, upright.
    pub photo: Photo,
    /// The lens, where EXIF tells.
    pub focal: FocalLength,
    /// How much light the shot let in, where EXIF tells.
    pub exposure: ShotExposure,
}

impl PhotoFile {
    /// Focal length in pixels of this photo, as [`FocalLength::focal_px`]. The photo is upright; pixels are square.
    pub fn focal_px(&self) -> Option<f64> {
        self.focal.focal_px(self.photo.width() as u32, self.photo.height() as u32)
    }

    /// Horizontal field of view of this photo in degrees, as [`FocalLength::hfov_deg`].
    pub fn hfov_deg(&self) -> Option<f64> {
        self.focal.hfov_deg(self.photo.width() as u32, self.photo.height() as u32)
    }
}

/// Reads a photo: PNG, JPEG, WebP, TIFF, BMP, PNM as sRGB, EXIF orientation applied; HDR, EXR, PFM as linear radiance.
///
/// The content decides on the format, then the extension. 8-bit pictures stay 8-bit; palettes are resolved, grey becomes
/// RGB, alpha is dropped (the stored colour stays), embedded colour profiles are ignored. Sizes are checked before memory is
/// taken: at most [`MAX_PIXELS`](crate::MAX_PIXELS), and at most 4 megapixels + 1100 pixels for each byte of the file.
pub fn read_photo(path: impl AsRef<Path>) -> Result<PhotoFile, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    photo_from_bytes(&bytes, &name)
}

/// As [`read_photo`], from memory; `name` appears in errors and its extension helps where the content says nothing.
pub fn photo_from_bytes(bytes: &[u8], name: &str) -> Result<PhotoFile, ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP, PNM, HDR, EXR or PFM")?;
    guarded(source, || match source.format {
        Format::Hdr | Format::Exr | Format::Pfm => {
            let photo = Photo::Linear(decode_radiance(source)?);
            Ok(PhotoFile { photo, focal: FocalLength::default(), exposure: ShotExposure::default() })
        }
        _ => {
            let (picture, focal, exposure) = raster::decode(source)?;
            Ok(PhotoFile { photo: raster::photo(picture), focal, exposure })
        }
    })
}

/// Reads linear radiance: Radiance `.hdr`, OpenEXR, PFM; everything else that [`read_photo`] reads is linearised.
///
/// Values are as stored (a lossy EXR may hold some just below zero), but the `EXPOSURE` and `COLORCORR` of a `.hdr` are
/// undone, and an EXR whose `chromaticities` are not Rec. 709 is converted. Of an EXR the data window of the first part with
/// `R G B` (plain, else of a layer) is read, else `Y`, else the only channel as grey.
///
/// EXR: scan lines and tiles, half, float and uint; no compression, RLE, ZIP, ZIPS, PIZ, PXR24, B44, B44A, DWAA, DWAB.
/// Deep data, HTJ2K and subsampled chroma give [`ImageError::Unsupported`].
pub fn read_radiance(path: impl AsRef<Path>) -> Result<RadianceImage, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    radiance_from_bytes(&bytes, &name)
}

/// As [`read_radiance`], from memory.
pub fn radiance_from_bytes(bytes: &[u8], name: &str) -> Result<RadianceImage, ImageError> {
    photo_from_bytes(bytes, name).map(|file| file.photo.into_radiance())
}

/// Reads depth in metres: 16-bit PNG, PGM, TIFF and NPY integers (÷ `units_per_metre`, 1000 when not given), and floats
/// from EXR (`Z`, `depth`, `Y`, `R`), PFM, TIFF, NPY (÷ `units_per_metre`, 1 when not given).
///
/// 0, negative values, NaN, ∞ and anything from 100 km on mean "no reading" and become 0. A file in which nothing but
/// negative values is valid gives an error: its axis points the other way.
pub fn read_depth(path: impl AsRef<Path>, units_per_metre: Option<f64>) -> Result<DepthMap, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    depth_from_bytes(&bytes, &name, units_per_metre)
}

/// As [`read_depth`], from memory.
pub fn depth_from_bytes(bytes: &[u8], name: &str, units_per_metre: Option<f64>) -> Result<DepthMap, ImageError> {
    let source = open(bytes, name, "16-bit PNG, PGM, EXR, PFM, TIFF or NPY")?;
    guarded(source, || depth::decode(source, units_per_metre))
}

/// Reads 8-bit RGBA (PNG, JPEG, WebP, TIFF, BMP, PNM): straight alpha, 255 where the file has none.
pub fn read_rgba8(path: impl AsRef<Path>) -> Result<Image<[u8; 4]>, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    rgba8_from_bytes(&bytes, &name)
}

/// As [`read_rgba8`], from memory: textures of meshes.
pub fn rgba8_from_bytes(bytes: &[u8], name: &str) -> Result<Image<[u8; 4]>, ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP or PNM")?;
    guarded(source, || Ok(raster::rgba8(raster::decode(source)?.0)))
}

/// Width and height of a picture of those formats, from its head alone; as they are stored, before an orientation turns them.
pub fn size_from_bytes(bytes: &[u8], name: &str) -> Result<[u32; 2], ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP or PNM")?;
    guarded(source, || raster::size(source))
}

/// Reads every channel of the first part of an OpenEXR file, and its texts.
pub fn read_exr_channels(path: impl AsRef<Path>) -> Result<ExrChannels, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    exr_channels_from_bytes(&bytes, &name)
}

/// As [`read_exr_channels`], from memory.
pub fn exr_channels_from_bytes(bytes: &[u8], name: &str) -> Result<ExrChannels, ImageError> {
    let source = Source { bytes, name, format: Format::Exr };
    guarded(source, || exr_read::decode_channels(source))
}

/// Turns a panic into an error: with overflow checks `exr` 1.74 panics on damaged B44 blocks, and a file must never end a
/// program. Nothing outlives a failed decoder.
fn guarded<T>(source: Source, decode: impl FnOnce() -> Result<T, ImageError>) -> Result<T, ImageError> {
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(decode))
        .unwrap_or_else(|_| Err(source.invalid("its decoder failed")))
}

fn decode_radiance(source: Source) -> Result<RadianceImage, ImageError> {
    match source.format {
        Format::Hdr => rgbe::decode(source),
        Format::Exr => exr_read::decode_radiance(source),
        _ => Ok(match pfm::decode(source)? {
            Pfm::Color(image) => image,
            Pfm::Grey(image) => image.map(|&v| [v; 3]),
        }),
    }
}

fn open<'a>(bytes: &'a [u8], name: &'a str, expected: &'static str) -> Result<Source<'a>, ImageError> {
    let format = Format::detect(bytes, name);
    let format = format.ok_or_else(|| ImageError::UnknownFormat { name: name.to_owned(), expected })?;
    Ok(Source { bytes, name, format })
}

fn read_file(path: &Path) -> Result<(Vec<u8>, String), ImageError> {
    let io = |source| ImageError::Io { path: path.to_owned(), source };
    let metadata = std::fs::metadata(path).map_err(io)?;
    if metadata.is_dir() {
        return Err(io(std::io::ErrorKind::IsADirectory.into()));
    }
    if metadata.len() > MAX_FILE_BYTES {
        return Err(io(std::io::Error::other(format!("{} bytes are too many for an image", metadata.len()))));
    }
    Ok((std::fs::read(path).map_err(io)?, path.display().to_string()))
}
