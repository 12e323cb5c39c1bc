//! Portable float maps (Paul Debevec, <http://www.pauldebevec.com/Research/HDR/PFM/>).
//!
//! `PF` (RGB) or `Pf` (grey), size, a scale whose sign gives the byte order, then rows from the bottom.

use std::io::{self, Write};

use crate::encoded_image::EncodedImage;
use crate::{DepthMap, ImageError, RadianceImage};

/// The pixels of a PFM, rows from the top. The scale's magnitude is ignored, as by other readers.
pub(crate) enum Pfm {
    Grey(DepthMap),
    Color(RadianceImage),
}

pub(crate) fn decode(source: EncodedImage) -> Result<Pfm, ImageError> {
    let mut rest = source.bytes;
    let mut word = || {
        let start = rest.iter().position(|b| !b.is_ascii_whitespace())?;
        let end = start + rest[start..].iter().position(|b| b.is_ascii_whitespace())?;
        let word = std::str::from_utf8(&rest[start..end]).ok()?;
        // exactly one white space ends the header: the first pixel byte may look like another
        rest = &rest[end + 1..];
        Some(word)
    };
    let color = match word() {
        Some("PF") => true,
        Some("Pf") => false,
        _ => return Err(source.invalid("the header starts with neither “PF” nor “Pf”")),
    };
    let mut size = |what: &str| {
        let number = word().and_then(|w| w.parse::<u32>().ok());
        number.ok_or_else(|| source.invalid(format!("missing or invalid {what}")))
    };
    let (width, height) = (size("width")?, size("height")?);
    let scale = word().and_then(|w| w.parse::<f32>().ok()).filter(|s| s.is_finite() && *s != 0.0);
    let little_endian = scale.ok_or_else(|| source.invalid("missing or invalid scale"))? < 0.0;
    source.check_size(width.into(), height.into())?;

    let (width, height) = (width as usize, height as usize);
    let row_bytes = width * if color { 12 } else { 4 };
    if rest.len() < row_bytes * height {
        return Err(source.invalid(format!("only {} of {} bytes of pixel data", rest.len(), row_bytes * height)));
    }
    let float = |bytes: [u8; 4]| if little_endian { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) };
    let rows = rest[..row_bytes * height].chunks_exact(row_bytes).rev();
    let samples = rows.flat_map(|row| row.as_chunks::<4>().0).map(|&bytes| float(bytes));
    if !color {
        return Ok(Pfm::Grey(DepthMap::new(width, height, samples.collect())));
    }
    let samples: Vec<f32> = samples.collect();
    Ok(Pfm::Color(RadianceImage::new(width, height, samples.as_chunks::<3>().0.to_vec())))
}

/// Writes little-endian colour.
pub(crate) fn encode_color(image: &RadianceImage, out: &mut impl Write) -> io::Result<()> {
    write!(out, "PF\n{} {}\n-1.0\n", image.width(), image.height())?;
    for row in image.pixels().chunks_exact(image.width()).rev() {
        let bytes: Vec<u8> = row.as_flattened().iter().flat_map(|v| v.to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}

/// Writes little-endian grey.
pub(crate) fn encode_grey(image: &DepthMap, out: &mut impl Write) -> io::Result<()> {
    write!(out, "Pf\n{} {}\n-1.0\n", image.width(), image.height())?;
    for row in image.pixels().chunks_exact(image.width()).rev() {
        let bytes: Vec<u8> = row.iter().flat_map(|v| v.to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}
