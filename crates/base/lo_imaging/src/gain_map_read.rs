//! Gain maps in JPEG files: Ultra HDR 1.x (XMP) and ISO 21496-1.

use image::{DynamicImage, ImageFormat};

use crate::encoded_image::EncodedImage;
use crate::gain_map::{GainMap, GainMapParameters};
use crate::jpeg::JpegSegments;
use crate::xmp::Xmp;
use crate::{Image, raster_decoder};

/// Namespace of Ultra HDR's properties (Adobe gain map specification 1.0).
const HDRGM: &str = "http://ns.adobe.com/hdr-gain-map/1.0/";

/// Prefix of the segment with binary parameters (ISO 21496-1, annex C).
const ISO: &[u8] = b"urn:iso:std:iso:ts:21496:-1\0";

/// Returns the gain map behind a JPEG's first picture, `None` without one, or why it cannot be used.
pub(crate) fn read(source: EncodedImage, first: &JpegSegments) -> Option<Result<GainMap, &'static str>> {
    let first_xmp = first.xmp().and_then(Xmp::parse);
    let announced = first_xmp.as_ref().is_some_and(|xmp| xmp.value(HDRGM, "Version").is_some())
        || first.with_prefix(0xe2, ISO).next().is_some();
    let mut rest = source.bytes.get(first.end?..)?;
    while let Some(start) = rest.windows(3).position(|w| w == [0xff, 0xd8, 0xff]) {
        let bytes = &rest[start..];
        let segments = JpegSegments::read(bytes);
        let xmp = segments.xmp().and_then(Xmp::parse);
        let iso = segments.with_prefix(0xe2, ISO).next();
        let own = xmp.as_ref().filter(|xmp| xmp.value(HDRGM, "Version").is_some());
        let parameters = match (iso, own) {
            (Some(iso), _) => Some(from_iso(iso)),
            (None, Some(xmp)) => Some(from_xmp(xmp)),
            // the first picture's own parameters, or the defaults
            (None, None) => first_xmp.as_ref().filter(|_| announced && is_small(bytes)).map(from_xmp),
        };
        if let Some(parameters) = parameters {
            return Some(parameters.and_then(|parameters| decode(source, bytes, parameters)));
        }
        rest = &bytes[segments.end.unwrap_or(3)..];
    }
    announced.then_some(Err("the file announces one, but has none"))
}

/// Whether a picture's bytes fit to a gain map rather than to a preview.
fn is_small(bytes: &[u8]) -> bool {
    bytes.len() < 64 << 20
}

fn decode(source: EncodedImage, bytes: &[u8], parameters: GainMapParameters) -> Result<GainMap, &'static str> {
    if !parameters.is_valid() {
        return Err("its parameters are out of range");
    }
    let source = EncodedImage { bytes, ..source };
    let decoded = raster_decoder::decoder(source).and_then(|decoder| {
        DynamicImage::from_decoder(decoder).map_err(|e| source.invalid(format!("{:?}: {e}", ImageFormat::Jpeg)))
    });
    let decoded = decoded.map_err(|_| "its picture is damaged")?.into_rgb8();
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let image = Image::new(width, height, decoded.into_raw().as_chunks::<3>().0.to_vec());
    Ok(GainMap { image, parameters })
}

/// Reads the properties of Ultra HDR. Missing ones have their default.
fn from_xmp(xmp: &Xmp<'_>) -> Result<GainMapParameters, &'static str> {
    let triple = |name: &str, default: [f32; 3]| -> Result<[f32; 3], &'static str> {
        let values: Result<Vec<f32>, _> = xmp.values(HDRGM, name).into_iter().map(str::parse).collect();
        match values.map_err(|_| "a parameter is not a number")?.as_slice() {
            [] => Ok(default),
            [one] => Ok([*one; 3]),
            [r, g, b] => Ok([*r, *g, *b]),
            _ => Err("a parameter has neither one nor three values"),
        }
    };
    if xmp.value(HDRGM, "BaseRenditionIsHDR").is_some_and(|v| v.eq_ignore_ascii_case("true")) {
        return Err("its base picture is HDR");
    }
    let default = GainMapParameters::default();
    Ok(GainMapParameters {
        min_log2: triple("GainMapMin", default.min_log2)?,
        max_log2: triple("GainMapMax", default.max_log2)?,
        gamma: triple("Gamma", default.gamma)?,
        offset_sdr: triple("OffsetSDR", default.offset_sdr)?,
        offset_hdr: triple("OffsetHDR", default.offset_hdr)?,
    })
}

/// Reads the binary parameters of ISO 21496-1, annex C.2.
pub(crate) fn from_iso(bytes: &[u8]) -> Result<GainMapParameters, &'static str> {
    const SHORT: &str = "its parameters are cut off";
    let mut rest = bytes;
    let mut take = |count: usize| -> Result<&[u8], &'static str> {
        let (head, tail) = rest.split_at_checked(count).ok_or(SHORT)?;
        rest = tail;
        Ok(head)
    };
    let versions = take(4)?;
    if versions[..2] != [0, 0] {
        return Err("its version is newer than this program");
    }
    let flags = take(1)?[0];
    let (channels, backward, common) = (if flags & 0x80 == 0 { 1 } else { 3 }, flags & 0x04 != 0, flags & 0x08 != 0);
    if backward {
        return Err("its base picture is HDR");
    }
    let mut word = || take(4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]]));
    let common = common.then(&mut word).transpose()?;
    let mut fraction = |signed: bool| -> Result<f32, &'static str> {
        let numerator = word()?;
        let denominator = match common {
            Some(common) => common,
            None => word()?,
        };
        let numerator = if signed { f64::from(numerator as i32) } else { f64::from(numerator) };
        Ok((numerator / f64::from(denominator)) as f32)
    };
    // headroom of the base and of the alternate rendition
    fraction(false)?;
    fraction(false)?;
    let mut values = [[0.0f32; 5]; 3];
    for channel in values.iter_mut().take(channels) {
        for (value, signed) in channel.iter_mut().zip([true, true, false, true, true]) {
            *value = fraction(signed)?;
        }
    }
    if channels == 1 {
        values = [values[0]; 3];
    }
    let column = |index: usize| values.map(|channel| channel[index]);
    Ok(GainMapParameters {
        min_log2: column(0),
        max_log2: column(1),
        gamma: column(2),
        offset_sdr: column(3),
        offset_hdr: column(4),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn binary_parameters_are_read() {
        let mut bytes = vec![0, 0, 0, 0, 0];
        let mut put = |numerator: i32, denominator: u32| {
            bytes.extend(numerator.to_be_bytes());
            bytes.extend(denominator.to_be_bytes());
        };
        for (numerator, denominator) in [(0, 1), (3, 1), (-1, 2), (5, 2), (1, 1), (1, 64), (1, 32)] {
            put(numerator, denominator);
        }
        let read = from_iso(&bytes).unwrap();
        assert_eq!((read.min_log2, read.max_log2, read.gamma), ([-0.5; 3], [2.5; 3], [1.0; 3]));
        assert_eq!((read.offset_sdr, read.offset_hdr), ([1.0 / 64.0; 3], [1.0 / 32.0; 3]));
        for length in 0..bytes.len() {
            assert!(from_iso(&bytes[..length]).is_err());
        }
        // a common denominator
        let mut bytes = vec![0, 0, 0, 0, 0x08];
        for word in [10u32, 0, 30, 0, 20, 10, 1, 1] {
            bytes.extend(word.to_be_bytes());
        }
        assert_eq!(from_iso(&bytes).unwrap().max_log2, [2.0; 3]);
    }

    #[test]
    fn properties_are_read() {
        let packet = br#"<x:xmpmeta xmlns:x="adobe:ns:meta/"><r:RDF xmlns:r="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
            <r:Description xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0" hdrgm:GainMapMax="2.5">
            <hdrgm:Gamma><r:Seq><r:li>1</r:li><r:li>0.5</r:li><r:li>2</r:li></r:Seq></hdrgm:Gamma>
            </r:Description></r:RDF></x:xmpmeta>"#;
        let read = from_xmp(&Xmp::parse(packet).unwrap()).unwrap();
        let expected = GainMapParameters { max_log2: [2.5; 3], gamma: [1.0, 0.5, 2.0], ..GainMapParameters::default() };
        assert_eq!(read, expected);
    }
}
