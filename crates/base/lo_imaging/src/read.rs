use std::path::Path;

use crate::depth::DepthFile;
use crate::encoded_image::EncodedImage;
use crate::exr_read::{self, ExrChannels};
use crate::pfm::Pfm;
use crate::read_file::read_regular_file;
use crate::unreadable::{self, Unreadable};
use crate::{
    DepthMap, Format, Image, ImageError, Photo, PhotoFile, PhotoNote, RadianceImage, depth, finite, heic, jpeg_xl, pfm,
    raster, raster_decoder, rgbe,
};

/// Size limit of files: more than an image of [`MAX_PIXELS`](crate::MAX_PIXELS) can need.
const MAX_FILE_BYTES: u64 = 16 << 30;

/// Reads a photo: PNG, JPEG, WebP, TIFF, BMP, GIF (first frame), PNM, HEIC and JPEG XL, upright, as sRGB or by
/// their colour profile; HDR, EXR and PFM as linear radiance.
///
/// The format is detected from the content, else from the extension. 8-bit images stay 8-bit; palettes are resolved,
/// grey becomes RGB, and alpha is dropped (the stored colour stays). Colour profiles, gain maps, EXIF and XMP of 8-bit
/// photos become [`Photo::Encoded8`]; deeper ones are converted to linear Rec. 709 by their profile.
///
/// Infinite radiance becomes the largest finite value of the file, NaN becomes 0; [`PhotoFile::notes`] says so.
///
/// Sizes are checked before memory is allocated: at most [`MAX_PIXELS`](crate::MAX_PIXELS), at most 4 megapixels + 1100
/// pixels for each byte of the file, and at most 64 megapixels + 64 pixels for each byte.
///
/// # Errors
/// [`ImageError`] for unreadable, unrecognised, damaged, unsupported and too large files.
pub fn read_photo(path: impl AsRef<Path>) -> Result<PhotoFile, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    photo_from_bytes(&bytes, &name)
}

/// Like [`read_photo`], from memory. `name` appears in errors; its extension is used if the content is not recognised.
pub fn photo_from_bytes(bytes: &[u8], name: &str) -> Result<PhotoFile, ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP, GIF, PNM, HEIC, JPEG XL, HDR, EXR or PFM")?;
    catch_decoder_panic(source, || match source.format {
        Format::Hdr | Format::Exr | Format::Pfm => {
            let mut notes = Vec::new();
            let mut image = decode_radiance(source, &mut notes)?;
            let replaced = finite::replace(&mut image);
            notes.extend(replaced.map_err(|_| source.invalid("it has no finite value"))?);
            Ok(PhotoFile { notes, ..PhotoFile::new(Photo::Linear(image)) })
        }
        _ => raster::photo(source),
    })
}

/// Reads linear radiance from Radiance `.hdr`, OpenEXR or PFM. Other formats of [`read_photo`] are linearised.
///
/// Values are as stored (a lossy EXR may have some just below zero), with three exceptions: the `EXPOSURE` and
/// `COLORCORR` of a `.hdr` are undone, an EXR whose `chromaticities` are not Rec. 709 is converted, and values that are
/// not finite are replaced as in [`read_photo`].
///
/// EXR: reads the data window of the first part with `R G B` (plain, else of a layer), else of the first part with `Y`,
/// else the only channel as grey. Scan lines and tiles; half, float and uint; no compression, RLE, ZIP, ZIPS, PIZ,
/// PXR24, B44, B44A, DWAA, DWAB.
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
/// Integers of 16-bit PNG, PGM, TIFF, NPY and NPZ are divided by `units_per_metre` (default 1000). Floats of EXR (`Z`,
/// `depth`, `Y`, `R`), PFM, TIFF, NPY and NPZ are divided by `units_per_metre` (default 1). Of an NPZ's arrays, the one
/// named `depth`, or as other programs name it, is read.
///
/// 0, negative values, NaN, ∞ and values from 100 km on mean "no reading" and become 0.
///
/// # Errors
/// As for [`read_photo`]; also a scale that is not positive, and files with negative depths only, whose axis points the
/// other way.
pub fn read_depth(path: impl AsRef<Path>, units_per_metre: Option<f64>) -> Result<DepthMap, ImageError> {
    read_depth_file(path, units_per_metre).map(|file| file.depth_m)
}

/// Like [`read_depth`], with the units of the file.
pub fn read_depth_file(path: impl AsRef<Path>, units_per_metre: Option<f64>) -> Result<DepthFile, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    let source = open(&bytes, &name, DEPTH_FORMATS)?;
    catch_decoder_panic(source, || depth::decode(source, units_per_metre))
}

/// Like [`read_depth`], from memory.
pub fn depth_from_bytes(bytes: &[u8], name: &str, units_per_metre: Option<f64>) -> Result<DepthMap, ImageError> {
    let source = open(bytes, name, DEPTH_FORMATS)?;
    catch_decoder_panic(source, || depth::decode(source, units_per_metre)).map(|file| file.depth_m)
}

/// Reads inverse depth or disparity in any unit and with any offset, as stored; larger is nearer.
///
/// Formats are those of [`read_depth`], also grey images of 8 bits. Values that are NaN or infinite become NaN.
///
/// # Errors
/// As for [`read_photo`]; also colour images.
pub fn read_inverse_depth(path: impl AsRef<Path>) -> Result<Image<f32>, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    inverse_depth_from_bytes(&bytes, &name)
}

/// Like [`read_inverse_depth`], from memory.
pub fn inverse_depth_from_bytes(bytes: &[u8], name: &str) -> Result<Image<f32>, ImageError> {
    let source = open(bytes, name, DEPTH_FORMATS)?;
    catch_decoder_panic(source, || depth::decode_inverse(source))
}

/// Formats of depth, for errors.
const DEPTH_FORMATS: &str = "16-bit PNG, PGM, EXR, PFM, TIFF, NPY or NPZ";

/// Reads 8-bit RGBA (PNG, JPEG, WebP, TIFF, BMP, GIF, PNM, HEIC, JPEG XL) with straight alpha; 255 if there is none.
pub fn read_rgba8(path: impl AsRef<Path>) -> Result<Image<[u8; 4]>, ImageError> {
    let (bytes, name) = read_file(path.as_ref())?;
    rgba8_from_bytes(&bytes, &name)
}

/// Like [`read_rgba8`], from memory, for textures of meshes.
pub fn rgba8_from_bytes(bytes: &[u8], name: &str) -> Result<Image<[u8; 4]>, ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP, GIF, PNM, HEIC or JPEG XL")?;
    catch_decoder_panic(source, || raster::rgba8(source))
}

/// Reads width and height from the header of an image in the formats of [`read_rgba8`].
///
/// The size is as stored, before the EXIF orientation is applied.
pub fn size_from_bytes(bytes: &[u8], name: &str) -> Result<[u32; 2], ImageError> {
    let source = open(bytes, name, "PNG, JPEG, WebP, TIFF, BMP, GIF, PNM, HEIC or JPEG XL")?;
    catch_decoder_panic(source, || match source.format {
        Format::Heic => heic::size(source),
        Format::JpegXl => jpeg_xl::size(source),
        _ => raster_decoder::size(source),
    })
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

fn decode_radiance(source: EncodedImage, notes: &mut Vec<PhotoNote>) -> Result<RadianceImage, ImageError> {
    match source.format {
        Format::Hdr => rgbe::decode(source, notes),
        Format::Exr => exr_read::decode_radiance(source),
        _ => Ok(match pfm::decode(source)? {
            Pfm::Color(image) => image,
            Pfm::Grey(image) => image.map(|&v| [v; 3]),
        }),
    }
}

fn open<'a>(bytes: &'a [u8], name: &'a str, expected: &'static str) -> Result<EncodedImage<'a>, ImageError> {
    if let Some(Unreadable { format, way_out }) = unreadable::recognise(bytes, name) {
        return Err(ImageError::NotRead { name: name.to_owned(), format, way_out });
    }
    let format = Format::detect(bytes, name);
    let format = format.ok_or_else(|| ImageError::UnknownFormat { name: name.to_owned(), expected })?;
    Ok(EncodedImage { bytes, name, format })
}

fn read_file(path: &Path) -> Result<(Vec<u8>, String), ImageError> {
    let bytes =
        read_regular_file(path, MAX_FILE_BYTES).map_err(|source| ImageError::Io { path: path.to_owned(), source })?;
    Ok((bytes, path.display().to_string()))
}
