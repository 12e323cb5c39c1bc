//! The colour space that an image file states.

use std::io::Cursor;

use crate::Format;
use crate::chromaticity::REC709;
use crate::color_profile::{ColorProfile, IccKind, MAX_PROFILE_BYTES, TableProfile, read_icc};
use crate::encoded_image::EncodedImage;

/// Meaning of an image's stored values.
pub(crate) enum SourceColor {
    /// sRGB, stated or assumed.
    Srgb,
    /// Curves and primaries.
    Profile(Box<ColorProfile>),
    /// Curves and primaries of HDR video; linear values times the factor are radiance, with the reference white at 1.
    Hdr(Box<ColorProfile>, f32),
    /// Tables that convert to sRGB.
    Table(Box<TableProfile>),
}

/// Peak of the perceptual quantizer over the reference white of ITU-R BT.2408-7, in cd/m².
const PQ_SCALE: f32 = 10_000.0 / 203.0;

/// Linear scene value of 1 over that of the reference white, a signal of 0.75 (ITU-R BT.2408-7), of hybrid log-gamma.
const HLG_SCALE: f32 = 1.0 / 0.265;

/// PNG's value of gAMA that writers of sRGB use (PNG 3, 11.3.2.5), with the rounding of common programs.
const SRGB_GAMMA: std::ops::RangeInclusive<f32> = 0.450..=0.460;

/// Determines the colour space by a PNG's chunks, the ICC profile, or EXIF. The error says why a profile is unusable.
pub(crate) fn of(source: EncodedImage, icc: Option<&[u8]>, is_adobe_rgb: bool) -> Result<SourceColor, &'static str> {
    if source.format == Format::Png {
        return of_png(source);
    }
    match icc {
        Some(icc) => of_icc(icc),
        None if is_adobe_rgb => Ok(profile(ColorProfile::adobe_rgb())),
        None => Ok(SourceColor::Srgb),
    }
}

/// Returns the ICC profile of a TIFF (TIFF/EP, tag 34675).
pub(crate) fn icc_of_tiff(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut decoder = tiff::decoder::Decoder::new(Cursor::new(bytes)).ok()?;
    decoder.get_tag_u8_vec(tiff::tags::Tag::IccProfile).ok()
}

pub(crate) fn of_icc(icc: &[u8]) -> Result<SourceColor, &'static str> {
    if icc.len() > MAX_PROFILE_BYTES {
        return Err("it is too large");
    }
    match read_icc(icc) {
        Some(IccKind::Matrix(profile)) => Ok(SourceColor::Profile(profile)),
        Some(IccKind::Table(table)) => Ok(SourceColor::Table(table)),
        None => Err("it is damaged or of an unsupported kind"),
    }
}

/// Returns the colour space of code points of ITU-T H.273, `None` for reserved ones.
pub(crate) fn of_code_points(primaries: u8, transfer: u8) -> Option<SourceColor> {
    if (primaries, transfer) == (1, 13) {
        return Some(SourceColor::Srgb);
    }
    let profile = Box::new(ColorProfile::from_code_points(primaries, transfer)?);
    Some(match transfer {
        16 => SourceColor::Hdr(profile, PQ_SCALE),
        18 => SourceColor::Hdr(profile, HLG_SCALE),
        _ => SourceColor::Profile(profile),
    })
}

fn profile(profile: Option<ColorProfile>) -> SourceColor {
    profile.map_or(SourceColor::Srgb, |profile| SourceColor::Profile(Box::new(profile)))
}

/// Reads cICP, iCCP, sRGB, and gAMA with cHRM, in this order (PNG 3, 4.3).
fn of_png(source: EncodedImage) -> Result<SourceColor, &'static str> {
    let mut decoder = png::Decoder::new(Cursor::new(source.bytes));
    decoder.set_limits(png::Limits { bytes: 2 * MAX_PROFILE_BYTES });
    decoder.set_ignore_text_chunk(true);
    // the pixels' decoder reports a damaged header
    let Ok(reader) = decoder.read_info() else { return Ok(SourceColor::Srgb) };
    let info = reader.info();
    if let Some(points) = info.coding_independent_code_points {
        let color = of_code_points(points.color_primaries, points.transfer_function);
        return color.ok_or("its code points (cICP) are reserved");
    }
    if let Some(icc) = &info.icc_profile {
        return of_icc(icc);
    }
    if has_profile_chunk(source.bytes) {
        return Err("it is damaged or too large");
    }
    if info.srgb.is_some() {
        return Ok(SourceColor::Srgb);
    }
    let gamma = info.gama_chunk.map(png::ScaledFloat::into_value);
    let primaries = info.chrm_chunk.map(|chrm| {
        let xy = |(x, y): (png::ScaledFloat, png::ScaledFloat)| [x.into_value(), y.into_value()];
        [xy(chrm.red), xy(chrm.green), xy(chrm.blue), xy(chrm.white)]
    });
    // The value means sRGB's curve beside sRGB's primaries, and a power beside others.
    let other = primaries
        .filter(|p| p.iter().flatten().zip(REC709.iter().flatten()).any(|(a, b)| (f64::from(*a) - b).abs() > 2e-3));
    let gamma = gamma.filter(|g| other.is_some() || !SRGB_GAMMA.contains(g));
    let primaries = other;
    if gamma.is_none() && primaries.is_none() {
        return Ok(SourceColor::Srgb);
    }
    let exponent = match gamma {
        Some(gamma) if (0.05..=5.0).contains(&gamma) => Some(1.0 / gamma),
        Some(_) => return Err("its gamma (gAMA) is out of range"),
        None => None,
    };
    let stated = ColorProfile::from_gamma(exponent, primaries).ok_or("its primaries (cHRM) are invalid")?;
    Ok(if stated.is_srgb() { SourceColor::Srgb } else { SourceColor::Profile(Box::new(stated)) })
}

/// Whether a PNG has a profile chunk before its pixels.
fn has_profile_chunk(bytes: &[u8]) -> bool {
    let mut at = 8;
    while let Some(&[a, b, c, d, ref name @ ..]) = bytes.get(at..at + 8) {
        match name {
            b"iCCP" => return true,
            b"IDAT" => return false,
            _ => at = at.saturating_add(12 + u32::from_be_bytes([a, b, c, d]) as usize),
        }
    }
    false
}
