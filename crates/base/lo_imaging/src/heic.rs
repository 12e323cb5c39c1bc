//! HEIC and HEIF photos coded by HEVC (ISO/IEC 23008-12), as phones write them.

use heifer::hdr::APPLE_GAIN_MAP;
use heifer::heifer_hevc_dec::nal::NalUnit;
use heifer::heifer_hevc_dec::params::{ParameterSets, Sps};
use heifer::heifer_isobmff::boxes::{ColorInfo, Property};
use heifer::heifer_isobmff::{HeifFile, Item, ItemId};
use heifer::{Error, Options};
use image::{DynamicImage, ImageBuffer, RgbImage};

use crate::encoded_image::EncodedImage;
use crate::source_color::{self, SourceColor};
use crate::stored_photo::{StoredPhoto, usable_color, usable_gain_map};
use crate::{GainMap, GainMapParameters, Image, ImageError, PhotoNote, gain_map_read};

/// Most levels of images that derive from each other (a grid from its tiles), as in the decoder.
const MOST_LEVELS: u32 = 4;

/// Most bytes of the parameters of a gain map; three channels have 142.
const MOST_PARAMETERS: usize = 4096;

/// Reads the primary image, upright, with its colour space, gain map and metadata.
pub(crate) fn photo(source: EncodedImage, notes: &mut Vec<PhotoNote>) -> Result<StoredPhoto, ImageError> {
    let file = parse(source)?;
    let metadata = heifer::item_metadata(&file, file.primary_id).unwrap_or_default();
    let color = match &metadata.icc_profile {
        Some(icc) => source_color::of_icc(icc),
        None => code_points(&file).map_or(Ok(SourceColor::Srgb), |(primaries, transfer)| {
            source_color::of_code_points(primaries, transfer).ok_or("its code points (nclx) are reserved")
        }),
    };
    let color = usable_color(color, notes);
    let gain_map = usable_gain_map(gain_map(source, &file), notes);
    Ok(StoredPhoto { pixels: pixels(source, &file)?, color, exif: metadata.exif, xmp: metadata.xmp, gain_map })
}

/// Decodes the primary image, upright: RGB of 8 bits, or of 16 bits if more than 8 are stored.
pub(crate) fn samples(source: EncodedImage) -> Result<DynamicImage, ImageError> {
    pixels(source, &parse(source)?)
}

/// Returns width and height before rotation, after cropping.
pub(crate) fn size(source: EncodedImage) -> Result<[u32; 2], ImageError> {
    let file = parse(source)?;
    let [width, height] = stored_size(source, &file)?;
    let cropped = file.item_properties(file.primary_id).into_iter().flatten().find_map(|property| match property {
        Property::CleanAperture { width, height, .. } => Some([width, height].map(|&(size, unit)| size / unit.max(1))),
        _ => None,
    });
    let [w, h] = cropped.unwrap_or([width, height]);
    Ok([w.min(width), h.min(height)])
}

/// Returns width and height before rotation and cropping.
fn stored_size(source: EncodedImage, file: &HeifFile) -> Result<[u32; 2], ImageError> {
    let size = file.image_size(file.primary_id).map_err(|e| source.invalid(e))?;
    let (width, height) = size.ok_or_else(|| source.invalid("the image states no size"))?;
    source.check_size(width.into(), height.into())?;
    Ok([width, height])
}

fn parse(source: EncodedImage<'_>) -> Result<HeifFile<'_>, ImageError> {
    HeifFile::parse(source.bytes).map_err(|e| source.invalid(e))
}

fn pixels(source: EncodedImage, file: &HeifFile) -> Result<DynamicImage, ImageError> {
    let [width, height] = stored_size(source, file)?;
    let most = most_coded(width, height);
    check_coded_size(source, file, file.primary_id, most)?;
    let options = options(most);
    let failed = |error| match error {
        Error::Unsupported(feature) => source.unsupported(feature),
        error => source.invalid(error),
    };
    let no_samples = || source.invalid("the image has fewer samples than pixels");
    if bits(file) == Some(8) {
        let image = heifer::decode_rgba8(source.bytes, &options).map_err(failed)?;
        let rgb: Vec<u8> = image.data.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
        return Ok(RgbImage::from_raw(image.width, image.height, rgb).ok_or_else(no_samples)?.into());
    }
    let image = heifer::decode_with_options(source.bytes, &options).map_err(failed)?;
    let most = u32::from(image.max_value());
    let deepen = |v: u16| ((u32::from(v) * 65535 + most / 2) / most) as u16;
    let rgb: Vec<u16> = image.data.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b].map(deepen)).collect();
    let buffer = ImageBuffer::from_raw(image.width, image.height, rgb).ok_or_else(no_samples)?;
    Ok(DynamicImage::ImageRgb16(buffer))
}

fn options(max_pixels: u64) -> Options {
    Options { max_pixels, max_threads: rayon::current_num_threads() }
}

/// Most pixels that may be coded for an image: tiles reach beyond its edges, and it has auxiliary images.
fn most_coded(width: u32, height: u32) -> u64 {
    4 * u64::from(width) * u64::from(height) + (4 << 20)
}

/// Rejects an image of which the coded parts have more pixels than it needs, before any of them is decoded.
fn check_coded_size(source: EncodedImage, file: &HeifFile, item: ItemId, most: u64) -> Result<(), ImageError> {
    let mut left = most;
    let mut open = vec![(item, 0)];
    while let Some((item, level)) = open.pop() {
        if let Some(sps) = parameters(file, item) {
            let pixels = u64::from(sps.pic_width_in_luma_samples) * u64::from(sps.pic_height_in_luma_samples);
            left = left
                .checked_sub(pixels.max(1))
                .ok_or_else(|| source.invalid("its tiles have more pixels than the image"))?;
        }
        if level < MOST_LEVELS {
            open.extend(file.referenced_items(item, b"dimg").iter().map(|&part| (part, level + 1)));
            open.extend(file.referencing_items(item, b"auxl").into_iter().map(|part| (part, level + 1)));
        }
    }
    Ok(())
}

/// Returns the first sequence parameter set of a coded image.
fn parameters(file: &HeifFile, item: ItemId) -> Option<Sps> {
    let mut sets = ParameterSets::default();
    for unit in &file.hevc_config(item).ok()??.nal_units {
        sets.add(&NalUnit::parse(unit).ok()?).ok()?;
    }
    sets.sps.into_iter().flatten().next()
}

/// Returns the first result for the primary image and the first ones that it derives from.
fn first<T>(file: &HeifFile, of: impl Fn(ItemId) -> Option<T>) -> Option<T> {
    let mut at = Some(file.primary_id);
    for _ in 0..=MOST_LEVELS {
        let item = at?;
        if let Some(found) = of(item) {
            return Some(found);
        }
        at = file.referenced_items(item, b"dimg").first().copied();
    }
    None
}

/// Returns the bits per luma sample of the coded image.
fn bits(file: &HeifFile) -> Option<u8> {
    first(file, |item| file.hevc_config(item).ok().flatten().map(|config| config.bit_depth_luma))
}

/// Returns primaries and transfer characteristics (ITU-T H.273) by the container, else by the bit stream; those of sRGB
/// where they are unspecified.
fn code_points(file: &HeifFile) -> Option<(u8, u8)> {
    let (primaries, transfer) = first(file, |item| {
        let stated = file.item_properties(item).ok()?.find_map(|property| match property {
            Property::Color(ColorInfo::Nclx { primaries, transfer, .. }) => {
                Some((u8::try_from(*primaries).ok()?, u8::try_from(*transfer).ok()?))
            }
            _ => None,
        });
        stated.or_else(|| {
            let vui = parameters(file, item)?.vui?;
            Some((vui.colour_primaries, vui.transfer_characteristics))
        })
    })?;
    let primaries = if primaries == UNSPECIFIED { 1 } else { primaries };
    let transfer = if VIDEO_CURVES.contains(&transfer) { SRGB_CURVE } else { transfer };
    Some((primaries, transfer))
}

/// Code point of primaries and transfer characteristics that are not specified.
const UNSPECIFIED: u8 = 2;

/// Code point of sRGB's curve.
const SRGB_CURVE: u8 = 13;

/// Transfer characteristics that mean sRGB's curve in photos: unspecified, and those of BT.709, BT.601 and BT.2020,
/// which libultrahdr (before August 2026) and video encoders write beside sRGB's values.
const VIDEO_CURVES: [u8; 5] = [UNSPECIFIED, 1, 6, 14, 15];

/// Returns the photo's gain map, `None` without one, or why it cannot be used.
fn gain_map(source: EncodedImage, file: &HeifFile) -> Option<Result<GainMap, &'static str>> {
    let is_iso = |item: &&Item| {
        item.item_type.0 == *b"tmap" && file.referenced_items(item.id, b"dimg").first() == Some(&file.primary_id)
    };
    if let Some(item) = file.items.iter().find(is_iso) {
        return Some(iso_gain_map(source, file, item.id));
    }
    let is_apple = |&item: &ItemId| {
        let mut properties = file.item_properties(item).into_iter().flatten();
        properties.any(|property| matches!(property, Property::AuxiliaryType(kind) if kind == APPLE_GAIN_MAP))
    };
    let items = file.referencing_items(file.primary_id, b"auxl");
    let item = *items.iter().find(|item| is_apple(item))?;
    Some(most_of_map(source, file, item).and_then(|most| {
        let map = heifer::hdr::read_gain_map_with_options(source.bytes, &options(most)).map_err(|_| DAMAGED)?;
        apple_gain_map(&map.ok_or("the photo does not state its headroom")?)
    }))
}

/// Checks the size of a gain map's picture, and returns the most pixels that may be coded for it.
fn most_of_map(source: EncodedImage, file: &HeifFile, item: ItemId) -> Result<u64, &'static str> {
    let (width, height) = file.image_size(item).ok().flatten().ok_or("its picture states no size")?;
    let most = most_coded(width, height);
    source
        .check_size(width.into(), height.into())
        .and_then(|()| check_coded_size(source, file, item, most))
        .map_err(|_| "its picture is too large")?;
    Ok(most)
}

const DAMAGED: &str = "its picture is damaged";

/// Reads a derived image `tmap` (ISO 21496-1, annex C; ISO/IEC 23008-12).
fn iso_gain_map(source: EncodedImage, file: &HeifFile, item: ItemId) -> Result<GainMap, &'static str> {
    let &[_, map] = file.referenced_items(item, b"dimg") else { return Err("it does not name one picture") };
    let payload = file.item_data(item).map_err(|_| "its parameters are damaged")?;
    if payload.len() > MOST_PARAMETERS {
        return Err("its parameters are too long");
    }
    let (&version, parameters) = payload.split_first().ok_or("it has no parameters")?;
    if version != 0 {
        return Err("its version is newer than this program");
    }
    let parameters = gain_map_read::from_iso(parameters)?;
    if !parameters.is_valid() {
        return Err("its parameters are out of range");
    }
    most_of_map(source, file, map)?;
    let picture = heifer::decode_item(file, map, 1).map_err(|_| DAMAGED)?;
    let (width, height) = (picture.width as usize, picture.height as usize);
    let image = Image::new(width, height, picture.to_rgb8().as_chunks::<3>().0.to_vec());
    Ok(GainMap { image, parameters })
}

/// Converts Apple's gain map, of which the gain is `1 + (headroom − 1) · share`, to one with a logarithmic scale.
fn apple_gain_map(map: &heifer::GainMap) -> Result<GainMap, &'static str> {
    let (width, height) = (map.width as usize, map.height as usize);
    if map.headroom.is_nan() || map.headroom <= 1.0 || map.data.len() != width * height || map.data.is_empty() {
        return Err("it brightens nothing");
    }
    let most = map.headroom.log2();
    let share = |gain: f32| (1.0 + (map.headroom - 1.0) * gain).log2() / most;
    let pixels = map.data.iter().map(|&gain| [(share(gain) * 255.0).round() as u8; 3]).collect();
    let parameters = GainMapParameters {
        max_log2: [most; 3],
        offset_sdr: [0.0; 3],
        offset_hdr: [0.0; 3],
        ..GainMapParameters::default()
    };
    if !parameters.is_valid() {
        return Err("its headroom is out of range");
    }
    Ok(GainMap { image: Image::new(width, height, pixels), parameters })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn apples_gain_becomes_logarithmic() {
        let map = heifer::GainMap { width: 3, height: 1, data: vec![0.0, 0.5, 1.0], headroom: 4.0 };
        let read = apple_gain_map(&map).unwrap();
        for (x, gain) in [1.0f32, 2.5, 4.0].into_iter().enumerate() {
            let radiance = read.radiance([1.0; 3], [(x as f32 + 0.5) / 3.0, 0.5])[0];
            assert!((radiance / gain - 1.0).abs() < 0.01, "{radiance} instead of {gain}");
        }
        assert!(apple_gain_map(&heifer::GainMap { headroom: 1.0, ..map.clone() }).is_err());
        assert!(apple_gain_map(&heifer::GainMap { headroom: f32::INFINITY, ..map }).is_err());
    }
}
