//! Photos and textures from PNG, JPEG, WebP, TIFF, BMP, GIF and PNM.

use image::metadata::Orientation;
use image::{DynamicImage, ImageDecoder};
use rayon::prelude::*;

use crate::color::linear_from_srgb;
use crate::encoded_image::EncodedImage;
use crate::exif::{self, FocalLength, PhotoExposure, is_adobe_rgb};
use crate::jpeg::JpegSegments;
use crate::raster_decoder::{decoder, invalid, orientation, samples};
use crate::source_color::{self, SourceColor};
use crate::stored_photo::{StoredPhoto, usable_color, usable_gain_map};
use crate::{
    ColorProfile, EncodedPhoto, Format, GainMap, Image, ImageError, PartialPanorama, Photo, PhotoEncoding, PhotoFile,
    PhotoNote, RadianceImage, cmyk, gain_map_read, heic, jpeg_xl, truncated, xmp,
};

/// Decodes 8-bit RGBA, upright. Colour profiles are ignored: glTF's textures are sRGB.
pub(crate) fn rgba8(source: EncodedImage) -> Result<Image<[u8; 4]>, ImageError> {
    let decoded = match source.format {
        Format::Heic => heic::samples(source)?,
        Format::JpegXl => jpeg_xl::samples(source)?,
        _ => samples(source)?,
    };
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    Ok(Image::new(width, height, pixels_of(decoded.into_rgba8().into_raw())))
}

/// Decodes a photo with its colour space, gain map and metadata, upright.
pub(crate) fn photo(source: EncodedImage) -> Result<PhotoFile, ImageError> {
    let mut notes = Vec::new();
    let StoredPhoto { pixels, color, mut exif, xmp, gain_map } = match source.format {
        Format::Heic => heic::photo(source, &mut notes)?,
        Format::JpegXl => jpeg_xl::photo(source, &mut notes)?,
        _ => stored(source, &mut notes)?,
    };
    let focal = exif.as_deref().map(FocalLength::from_exif).unwrap_or_default();
    let exposure = exif.as_deref().map(PhotoExposure::from_exif).unwrap_or_default();
    if let Some(exif) = &mut exif {
        let _ = Orientation::remove_from_exif_chunk(exif);
    }
    let panorama = match xmp.as_deref().and_then(PartialPanorama::from_xmp) {
        Some(Err(reason)) => {
            notes.push(PhotoNote::UnusablePanorama { reason });
            None
        }
        place => place.and_then(Result::ok),
    };
    let xmp = xmp.map(xmp::with_upright_orientation).unwrap_or_default();
    let metadata = Metadata { exif: exif.unwrap_or_default(), xmp, gain_map };
    let photo = combine(pixels, color, metadata);
    if let Photo::Encoded8(encoded) = &photo
        && encoded.encoding.gain_map.is_some()
    {
        notes.push(gain_note(encoded));
    }
    Ok(PhotoFile { focal, exposure, notes, panorama, ..PhotoFile::new(photo) })
}

/// Reads what a file of the crate `image` states.
fn stored(source: EncodedImage, notes: &mut Vec<PhotoNote>) -> Result<StoredPhoto, ImageError> {
    let mut decoder = decoder(source)?;
    // unreadable metadata must not fail the image
    let exif = match source.format {
        // `image` 0.25.10 does not read it
        Format::Tiff => exif::of_tiff(source.bytes),
        _ => decoder.exif_metadata().ok().flatten(),
    };
    let xmp = decoder.xmp_metadata().ok().flatten();
    let icc = match source.format {
        // `image` 0.25.10 does not find it
        Format::Tiff => source_color::icc_of_tiff(source.bytes),
        _ => decoder.icc_profile().ok().flatten(),
    };
    let orientation = orientation(&mut decoder, exif.as_deref());
    let stated = source_color::of(source, icc.as_deref(), exif.as_deref().is_some_and(is_adobe_rgb));
    let mut color = usable_color(stated, notes);
    let cmyk = match &color {
        SourceColor::Table(table) if table.is_cmyk() => cmyk::samples(source)?.map(|samples| (table, samples)),
        _ => None,
    };
    let mut decoded = match cmyk {
        Some((table, samples)) => {
            let (width, height) = decoder.dimensions();
            let converted = table.srgb8(&samples).ok_or_else(|| source.invalid("its CMYK profile"))?;
            color = SourceColor::Srgb;
            let buffer = image::RgbImage::from_raw(width, height, converted.into_flattened());
            DynamicImage::from(buffer.ok_or_else(|| source.invalid("its CMYK samples do not match its size"))?)
        }
        None => DynamicImage::from_decoder(decoder).map_err(|e| invalid(source, e))?,
    };
    let segments = (source.format == Format::Jpeg).then(|| JpegSegments::read(source.bytes));
    if segments.as_ref().is_some_and(|segments| segments.end.is_none()) {
        let rows = truncated::missing_rows(&decoded);
        let missing = rows as f64 / f64::from(decoded.height());
        if missing > MOST_MISSING {
            return Err(
                source.invalid(format!("the file is cut off: {:.0} % of the picture is missing", 100.0 * missing))
            );
        }
        notes.push(PhotoNote::Truncated { missing });
        if rows > 0 {
            decoded = truncated::blacken(decoded, rows);
        }
    }
    let gain_map = segments.and_then(|segments| gain_map_read::read(source, &segments));
    let gain_map = usable_gain_map(gain_map, notes).map(|map| oriented(map, orientation));
    decoded.apply_orientation(orientation);
    Ok(StoredPhoto { pixels: decoded, color, exif, xmp, gain_map })
}

/// Most of a cut-off picture that may be missing.
const MOST_MISSING: f64 = 0.6;

struct Metadata {
    exif: Vec<u8>,
    xmp: Vec<u8>,
    gain_map: Option<GainMap>,
}

fn oriented(map: GainMap, orientation: Orientation) -> GainMap {
    let (width, height) = (map.image.width() as u32, map.image.height() as u32);
    let samples = map.image.into_pixels().into_flattened();
    let buffer = image::RgbImage::from_raw(width, height, samples).expect("an image has all its samples");
    let mut turned = DynamicImage::from(buffer);
    turned.apply_orientation(orientation);
    let (width, height) = (turned.width() as usize, turned.height() as usize);
    GainMap { image: Image::new(width, height, pixels_of(turned.into_rgb8().into_raw())), ..map }
}

/// Measures how much the gain map brightens a photo.
fn gain_note(photo: &EncodedPhoto) -> PhotoNote {
    let pixels = photo.image.pixels();
    let (above, most) = pixels
        .par_iter()
        .enumerate()
        .map(|(index, &pixel)| photo.radiance_of(pixel, index).into_iter().fold(0.0f32, f32::max))
        .map(|brightest| (usize::from(brightest > 1.0), brightest))
        .reduce(|| (0, 1.0), |a, b| (a.0 + b.0, a.1.max(b.1)));
    PhotoNote::GainMap { share: above as f64 / pixels.len() as f64, stops: most.log2() }
}

/// Combines pixels with their colour space. 8-bit images stay as they are, deeper ones become linear light; float TIFF
/// is already linear.
///
/// Alpha is dropped, since photos have none; the colours stored beneath transparent pixels are kept.
fn combine(decoded: DynamicImage, color: SourceColor, metadata: Metadata) -> Photo {
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let deep = decoded.color().bytes_per_pixel() / decoded.color().channel_count() > 1;
    if !deep {
        let mut image = Image::new(width, height, pixels_of(decoded.into_rgb8().into_raw()));
        let profile = match color {
            SourceColor::Profile(profile) => Some(*profile),
            SourceColor::Hdr(profile, scale) => {
                return Photo::Linear(linear16(&image.map(|p| p.map(|v| u16::from(v) * 257)), &profile, scale));
            }
            SourceColor::Table(table) => {
                let padded: Vec<[u8; 4]> = image.pixels().iter().map(|&[r, g, b]| [r, g, b, 255]).collect();
                image = table.srgb8(&padded).map_or(image, |srgb| Image::new(width, height, srgb));
                None
            }
            SourceColor::Srgb => None,
        };
        let Metadata { exif, mut xmp, gain_map } = metadata;
        if gain_map.is_some() {
            // it announces a gain map, which composites do not have
            xmp.clear();
        }
        return Photo::encoded8(image, PhotoEncoding { profile, gain_map, exif, xmp });
    }
    match decoded {
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            let image = RadianceImage::new(width, height, pixels_of(decoded.into_rgb32f().into_raw()));
            Photo::Linear(match color {
                SourceColor::Profile(profile) => image.map(|&pixel| profile.rec709_from_linear(pixel)),
                _ => image,
            })
        }
        _ => {
            let image = Image::new(width, height, pixels_of::<u16, 3>(decoded.into_rgb16().into_raw()));
            Photo::Linear(match color {
                SourceColor::Profile(profile) => linear16(&image, &profile, 1.0),
                SourceColor::Hdr(profile, scale) => linear16(&image, &profile, scale),
                SourceColor::Srgb | SourceColor::Table(_) => {
                    let table: Vec<f32> = (0..=u16::MAX).map(|v| linear_from_srgb(f32::from(v) / 65535.0)).collect();
                    by_pixel(&image, |p| p.map(|v| table[usize::from(v)]))
                }
            })
        }
    }
}

/// Converts 16-bit values to linear light, times `scale`.
fn linear16(image: &Image<[u16; 3]>, profile: &ColorProfile, scale: f32) -> RadianceImage {
    let tables = profile.tables16();
    by_pixel(image, |p| {
        let linear = [0, 1, 2].map(|c| tables[c][usize::from(p[c])]);
        profile.rec709_from_linear(linear).map(|v| (v * scale).max(0.0))
    })
}

fn by_pixel(image: &Image<[u16; 3]>, linear: impl Fn([u16; 3]) -> [f32; 3] + Sync) -> RadianceImage {
    let pixels = image.pixels().par_iter().map(|&pixel| linear(pixel)).collect();
    Image::new(image.width(), image.height(), pixels)
}

/// Groups samples into pixels, without a copy if possible: a photo of 50 megapixels has 150 MB.
fn pixels_of<T: bytemuck::Pod, const N: usize>(samples: Vec<T>) -> Vec<[T; N]>
where
    [T; N]: bytemuck::Pod,
{
    bytemuck::try_cast_vec(samples).unwrap_or_else(|(_, samples)| samples.as_chunks::<N>().0.to_vec())
}
