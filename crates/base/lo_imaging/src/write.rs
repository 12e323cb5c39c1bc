use std::io::{self, Cursor, Write};
use std::path::Path;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};

use crate::atomic::replace_when_written;
use crate::color::srgb_from_linear;
use crate::exr_write::{self, ChannelGroup, ExrOptions};
use crate::generator::{mark_jpeg, mark_png};
use crate::photo_tags::{MAX_SEGMENT, PhotoTags};
use crate::{DepthMap, Format, Image, ImageError, Photo, RadianceImage, ToneCurve, depth, pfm, rgbe};

/// Default JPEG quality: no visible loss.
pub const JPEG_QUALITY: u8 = 95;

/// Writes linear radiance as `.exr`, `.hdr` or `.pfm`. `options` apply to EXR; `.hdr` stores only the generator.
///
/// `.hdr` stores neither negative values nor NaN (both become 0) and rounds to 1/256 of a pixel's greatest channel.
///
/// # Errors
/// [`ImageError`] for another extension, an empty image, invalid options and I/O errors.
pub fn write_radiance(path: impl AsRef<Path>, image: &RadianceImage, options: &ExrOptions) -> Result<(), ImageError> {
    let path = path.as_ref();
    match Format::from_extension(path) {
        Some(Format::Exr) => {
            let size = (image.width(), image.height());
            write_exr(path, size, &[ChannelGroup::rgb("", image)], options)
        }
        Some(Format::Hdr) => {
            check_not_empty(path, Format::Hdr, image)?;
            atomically(path, |out| rgbe::encode(image, &options.generator, out))
        }
        Some(Format::Pfm) => {
            check_not_empty(path, Format::Pfm, image)?;
            atomically(path, |out| pfm::encode_color(image, out))
        }
        _ => Err(ImageError::OutputFormat { path: path.to_owned(), supported: ".exr, .hdr, .pfm" }),
    }
}

/// Writes layers as OpenEXR (32-bit float, or half). Every channel has `(width, height)` pixels.
pub fn write_exr(
    path: impl AsRef<Path>,
    (width, height): (usize, usize),
    groups: &[ChannelGroup],
    options: &ExrOptions,
) -> Result<(), ImageError> {
    checked_exr(path.as_ref(), (width, height), groups, |path| {
        atomically(path, |out| out.write_all(&exr_write::encode((width, height), groups, options)?))
    })
}

/// Like [`write_exr`], to memory; `name` appears in errors.
pub fn encode_exr(
    name: impl AsRef<Path>,
    (width, height): (usize, usize),
    groups: &[ChannelGroup],
    options: &ExrOptions,
) -> Result<Vec<u8>, ImageError> {
    checked_exr(name.as_ref(), (width, height), groups, |path| {
        exr_write::encode((width, height), groups, options)
            .map_err(|source| ImageError::Io { path: path.to_owned(), source })
    })
}

/// Checks for an empty image and converts errors of the encoder.
fn checked_exr<T>(
    path: &Path,
    (width, height): (usize, usize),
    groups: &[ChannelGroup],
    write: impl FnOnce(&Path) -> Result<T, ImageError>,
) -> Result<T, ImageError> {
    let refused = |reason: String| ImageError::Encode { path: path.to_owned(), format: Format::Exr, reason };
    if width == 0 || height == 0 || groups.iter().all(|g| g.channels.is_empty()) {
        return Err(refused("the image has no pixels or no channels".to_owned()));
    }
    write(path).map_err(|error| match error {
        ImageError::Io { source, .. } if source.kind() == io::ErrorKind::InvalidInput => refused(source.to_string()),
        error => error,
    })
}

/// Writes a photo with the name of the writing program, `generator` (not in PFM).
///
/// 8-bit photos become PNG (lossless) or JPEG ([`JPEG_QUALITY`]), with the colour profile, EXIF and XMP of
/// [`Photo::Encoded8`]. Linear photos become 16-bit sRGB PNG or JPEG. Both can also be written as radiance: EXR, HDR or
/// PFM.
pub fn write_photo(path: impl AsRef<Path>, photo: &Photo, generator: &str) -> Result<(), ImageError> {
    let path = path.as_ref();
    match Format::from_extension(path) {
        Some(Format::Png | Format::Jpeg) => write_bytes(path, &encode_photo(path, photo, generator)?),
        Some(Format::Exr | Format::Hdr | Format::Pfm) => write_radiance(path, &photo.radiance(), &named(generator)),
        _ => Err(ImageError::OutputFormat { path: path.to_owned(), supported: ".png, .jpg, .exr, .hdr, .pfm" }),
    }
}

/// Encodes a photo as the PNG or JPEG that [`write_photo`] writes under this name.
pub fn encode_photo(name: impl AsRef<Path>, photo: &Photo, generator: &str) -> Result<Vec<u8>, ImageError> {
    let name = name.as_ref();
    match (photo, Format::from_extension(name)) {
        (Photo::Srgb8(image), _) => encode_srgb8(name, image, JPEG_QUALITY, generator),
        (Photo::Encoded8(photo), _) => {
            encode_rgb8(name, &photo.image, JPEG_QUALITY, generator, &PhotoTags::of(&photo.encoding))
        }
        (Photo::Linear(image), Some(Format::Png)) => {
            let code = |v: f32| (srgb_from_linear(v) * 65535.0 + 0.5) as u16;
            encode_png16(name, &image.map(|rgb| rgb.map(code)), generator)
        }
        (Photo::Linear(image), _) => encode_srgb8(name, &ToneCurve::Clip.map(image, 0.0), JPEG_QUALITY, generator),
    }
}

/// Writes 8-bit sRGB as PNG, or as JPEG with `quality` from 1 to 100. Stores `generator`, the name of the writing
/// program.
pub fn write_srgb8(
    path: impl AsRef<Path>,
    image: &Image<[u8; 3]>,
    quality: u8,
    generator: &str,
) -> Result<(), ImageError> {
    let path = path.as_ref();
    write_bytes(path, &encode_srgb8(path, image, quality, generator)?)
}

/// Encodes 8-bit sRGB as the file that [`write_srgb8`] writes under this name.
pub fn encode_srgb8(
    name: impl AsRef<Path>,
    image: &Image<[u8; 3]>,
    quality: u8,
    generator: &str,
) -> Result<Vec<u8>, ImageError> {
    encode_rgb8(name.as_ref(), image, quality, generator, &PhotoTags::default())
}

fn encode_rgb8(
    path: &Path,
    image: &Image<[u8; 3]>,
    quality: u8,
    generator: &str,
    tags: &PhotoTags,
) -> Result<Vec<u8>, ImageError> {
    let (bytes, color) = (image.pixels().as_flattened(), ExtendedColorType::Rgb8);
    let (width, height) = (image.width() as u32, image.height() as u32);
    match Format::from_extension(path) {
        Some(Format::Png) => {
            let encode = |out: &mut Cursor<Vec<u8>>| {
                tags.on(PngEncoder::new(out), usize::MAX)?.write_image(bytes, width, height, color)
            };
            let mut png = encoded(path, Format::Png, image, encode, generator)?;
            tags.add_xmp_to_png(&mut png);
            Ok(png)
        }
        Some(Format::Jpeg) => {
            let encode = |out: &mut Cursor<Vec<u8>>| {
                let encoder = JpegEncoder::new_with_quality(out, quality.clamp(1, 100));
                tags.on(encoder, MAX_SEGMENT)?.write_image(bytes, width, height, color)
            };
            let mut jpeg = encoded(path, Format::Jpeg, image, encode, generator)?;
            tags.add_xmp_to_jpeg(&mut jpeg);
            Ok(jpeg)
        }
        _ => Err(ImageError::OutputFormat { path: path.to_owned(), supported: ".png, .jpg" }),
    }
}

/// Writes a tone-mapped 8-bit preview (PNG or JPEG) of radiance times 2^`exposure_ev`. Stores `generator`.
pub fn write_tone_mapped(
    path: impl AsRef<Path>,
    image: &RadianceImage,
    curve: ToneCurve,
    exposure_ev: f32,
    generator: &str,
) -> Result<(), ImageError> {
    write_srgb8(path, &curve.map(image, exposure_ev), JPEG_QUALITY, generator)
}

/// Writes 8-bit sRGB with straight alpha as PNG. Stores `generator`, the name of the writing program.
pub fn write_rgba8(path: impl AsRef<Path>, image: &Image<[u8; 4]>, generator: &str) -> Result<(), ImageError> {
    let path = path.as_ref();
    write_bytes(path, &encode_rgba8(path, image, generator)?)
}

/// Like [`write_rgba8`], to memory; `name` appears in errors.
pub fn encode_rgba8(name: impl AsRef<Path>, image: &Image<[u8; 4]>, generator: &str) -> Result<Vec<u8>, ImageError> {
    let (path, bytes) = (name.as_ref(), image.pixels().as_flattened());
    require_png(path)?;
    encoded(path, Format::Png, image, |out| png(out, bytes, image, ExtendedColorType::Rgba8), generator)
}

/// Writes 16-bit sRGB as PNG. Stores `generator`, the name of the writing program.
pub fn write_png16(path: impl AsRef<Path>, image: &Image<[u16; 3]>, generator: &str) -> Result<(), ImageError> {
    let path = path.as_ref();
    write_bytes(path, &encode_png16(path, image, generator)?)
}

fn encode_png16(path: &Path, image: &Image<[u16; 3]>, generator: &str) -> Result<Vec<u8>, ImageError> {
    let bytes: &[u8] = bytemuck::cast_slice(image.pixels().as_flattened());
    require_png(path)?;
    encoded(path, Format::Png, image, |out| png(out, bytes, image, ExtendedColorType::Rgb16), generator)
}

/// Encodes an 8-bit sRGB PNG, for files with embedded images (glTF).
///
/// # Panics
/// If the image has no pixels.
pub fn encode_png(image: &Image<[u8; 3]>) -> Vec<u8> {
    png_bytes(image.pixels().as_flattened(), image, ExtendedColorType::Rgb8)
}

/// Like [`encode_png`], with straight alpha.
///
/// # Panics
/// If the image has no pixels.
pub fn encode_png_rgba(image: &Image<[u8; 4]>) -> Vec<u8> {
    png_bytes(image.pixels().as_flattened(), image, ExtendedColorType::Rgba8)
}

fn png_bytes<T>(samples: &[u8], image: &Image<T>, color: ExtendedColorType) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    png(&mut bytes, samples, image, color).expect("encoding a non-empty image to memory cannot fail");
    bytes.into_inner()
}

/// Writes depth in metres: `.exr` (channel Z, 32-bit), `.pfm`, `.npy`, or `.png` (16-bit millimetres; no reading from
/// 65.536 m on).
///
/// EXR and PNG store `generator`, the name of the writing program.
pub fn write_depth(path: impl AsRef<Path>, depth_m: &DepthMap, generator: &str) -> Result<(), ImageError> {
    let path = path.as_ref();
    match Format::from_extension(path) {
        Some(Format::Exr) => {
            let size = (depth_m.width(), depth_m.height());
            write_exr(path, size, &[ChannelGroup::single("", "Z", depth_m)], &named(generator))
        }
        Some(Format::Pfm) => {
            check_not_empty(path, Format::Pfm, depth_m)?;
            atomically(path, |out| pfm::encode_grey(depth_m, out))
        }
        Some(Format::Npy) => {
            check_not_empty(path, Format::Npy, depth_m)?;
            atomically(path, |out| depth::encode_npy(depth_m, out))
        }
        Some(Format::Png) => {
            let millimetres = depth::millimetres(depth_m);
            let bytes: &[u8] = bytemuck::cast_slice(&millimetres);
            let png = |out: &mut Cursor<Vec<u8>>| png(out, bytes, depth_m, ExtendedColorType::L16);
            write_bytes(path, &encoded(path, Format::Png, depth_m, png, generator)?)
        }
        _ => Err(ImageError::OutputFormat { path: path.to_owned(), supported: ".exr, .png, .pfm, .npy" }),
    }
}

fn named(generator: &str) -> ExrOptions {
    ExrOptions { generator: generator.to_owned(), ..ExrOptions::default() }
}

fn png<T>(
    out: impl io::Write,
    bytes: &[u8],
    image: &Image<T>,
    color: ExtendedColorType,
) -> Result<(), image::ImageError> {
    PngEncoder::new(out).write_image(bytes, image.width() as u32, image.height() as u32, color)
}

fn require_png(path: &Path) -> Result<(), ImageError> {
    match Format::from_extension(path) {
        Some(Format::Png) => Ok(()),
        _ => Err(ImageError::OutputFormat { path: path.to_owned(), supported: ".png" }),
    }
}

fn check_not_empty<T>(path: &Path, format: Format, image: &Image<T>) -> Result<(), ImageError> {
    match image.pixels() {
        [] => Err(ImageError::Encode { path: path.to_owned(), format, reason: "the image has no pixels".to_owned() }),
        _ => Ok(()),
    }
}

/// Encodes in memory, so that encoding errors are distinct from I/O errors.
fn encoded<T>(
    path: &Path,
    format: Format,
    image: &Image<T>,
    encode: impl FnOnce(&mut Cursor<Vec<u8>>) -> Result<(), image::ImageError>,
    generator: &str,
) -> Result<Vec<u8>, ImageError> {
    check_not_empty(path, format, image)?;
    let mut bytes = Cursor::new(Vec::new());
    encode(&mut bytes).map_err(|error| ImageError::Encode {
        path: path.to_owned(),
        format,
        reason: error.to_string(),
    })?;
    let mut bytes = bytes.into_inner();
    match format {
        Format::Png => mark_png(&mut bytes, generator),
        Format::Jpeg => mark_jpeg(&mut bytes, generator),
        _ => {}
    }
    Ok(bytes)
}

fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), ImageError> {
    atomically(path, |out| io::Write::write_all(out, bytes))
}

fn atomically(
    path: &Path,
    write: impl FnOnce(&mut io::BufWriter<&mut std::fs::File>) -> io::Result<()>,
) -> Result<(), ImageError> {
    let named = |source| ImageError::Io { path: path.to_owned(), source };
    replace_when_written(path, |out| write(out).map_err(named), named)
}
