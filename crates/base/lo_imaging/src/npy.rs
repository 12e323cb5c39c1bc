//! NumPy's `.npy` (numpy.lib.format, versions 1 to 3): arrays of floats and of integers up to 32 bits, in either byte
//! order.

use std::io::{self, Write};

use crate::encoded_image::EncodedImage;
use crate::stored_depth::StoredDepth;
use crate::{DepthMap, ImageError};

pub(crate) fn decode(source: EncodedImage) -> Result<StoredDepth, ImageError> {
    let Header { kind, is_big_endian, is_fortran, shape, data_at } = Header::parse(source)?;
    let Some([height, width]) = depth_sides(&shape) else {
        let what = "depth needs two dimensions (height, width), besides dimensions of 1 before and after them";
        return Err(source.unsupported(format!("shape {}; {what}", shape_text(&shape))));
    };
    source.check_size(width, height)?;
    let bytes = kind.bytes();
    let (width, height) = (width as usize, height as usize);
    let data = source.bytes.get(data_at..).unwrap_or_default();
    let data = data.get(..width * height * bytes).ok_or_else(|| {
        source.invalid(format!("only {} of {} bytes of pixel data", data.len(), width * height * bytes))
    })?;
    let sample = |index: usize| {
        let mut raw = [0u8; 8];
        raw[..bytes].copy_from_slice(&data[index * bytes..][..bytes]);
        if is_big_endian {
            raw[..bytes].reverse();
        }
        kind.value(raw)
    };
    let at = |x: usize, y: usize| sample(if is_fortran { x * height + y } else { y * width + x });
    Ok(StoredDepth { values: DepthMap::from_fn(width, height, at), integers: kind.is_integer() })
}

/// Header of an array.
pub(crate) struct Header {
    kind: Kind,
    is_big_endian: bool,
    is_fortran: bool,
    /// Length of each dimension.
    pub shape: Vec<u64>,
    /// Offset of the data in the file.
    data_at: usize,
}

impl Header {
    /// Parses the header of a file, of which the data may be missing.
    pub fn parse(source: EncodedImage) -> Result<Self, ImageError> {
        let early = || source.invalid("truncated header");
        let rest = source.bytes.strip_prefix(b"\x93NUMPY").ok_or_else(|| source.invalid("missing NumPy signature"))?;
        let (version, rest) = rest.split_at_checked(2).ok_or_else(early)?;
        let (length, rest) = if version[0] == 1 {
            let (bytes, rest) = rest.split_first_chunk::<2>().ok_or_else(early)?;
            (u16::from_le_bytes(*bytes).into(), rest)
        } else {
            let (bytes, rest) = rest.split_first_chunk::<4>().ok_or_else(early)?;
            (u32::from_le_bytes(*bytes) as usize, rest)
        };
        let header = rest.get(..length).ok_or_else(early)?;
        let data_at = source.bytes.len() - rest.len() + length;
        let header = String::from_utf8_lossy(header);
        let descr = value_of(&header, "descr").map(|v| v.trim_matches(['\'', '"'])).unwrap_or_default();
        let is_fortran = value_of(&header, "fortran_order").unwrap_or_default() == "True";
        let shape = value_of(&header, "shape").unwrap_or_default().trim_matches(['(', ')']);
        let shape = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
        let (order, kind) = descr.split_at_checked(1).unwrap_or(("", descr));
        let is_big_endian = match order {
            "<" | "=" | "|" => false,
            ">" => true,
            _ => return Err(source.invalid(format!("unknown data type “{}”", clip(descr)))),
        };
        let kind = Kind::of(kind).ok_or_else(|| {
            source.unsupported(format!("data type {}; depth needs f2, f4, f8, u1, u2, u4, i2 or i4", clip(kind)))
        })?;
        Ok(Self { kind, is_big_endian, is_fortran, shape, data_at })
    }
}

/// Height and width of a depth map of this shape: two dimensions, besides dimensions of 1 before and after them.
pub(crate) fn depth_sides(mut shape: &[u64]) -> Option<[u64; 2]> {
    while shape.len() > 2 {
        shape = match shape {
            [1, rest @ ..] | [rest @ .., 1] => rest,
            _ => return None,
        };
    }
    <[u64; 2]>::try_from(shape).ok()
}

/// Formats a shape as NumPy does.
pub(crate) fn shape_text(shape: &[u64]) -> String {
    let sides: Vec<String> = shape.iter().take(8).map(u64::to_string).collect();
    format!("({}{})", sides.join(", "), if sides.len() == 1 { "," } else { "" })
}

/// Type of an array's elements.
#[derive(Clone, Copy)]
enum Kind {
    F2,
    F4,
    F8,
    U1,
    U2,
    U4,
    I2,
    I4,
}

impl Kind {
    /// Parses NumPy's name without byte order.
    fn of(name: &str) -> Option<Self> {
        Some(match name {
            "f2" => Self::F2,
            "f4" => Self::F4,
            "f8" => Self::F8,
            "u1" => Self::U1,
            "u2" => Self::U2,
            "u4" => Self::U4,
            "i2" => Self::I2,
            "i4" => Self::I4,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::U1 => 1,
            Self::F2 | Self::U2 | Self::I2 => 2,
            Self::F4 | Self::U4 | Self::I4 => 4,
            Self::F8 => 8,
        }
    }

    fn is_integer(self) -> bool {
        !matches!(self, Self::F2 | Self::F4 | Self::F8)
    }

    /// Converts the little-endian bytes of an element.
    fn value(self, raw: [u8; 8]) -> f32 {
        let [a, b, c, d, ..] = raw;
        match self {
            Self::F2 => half::f16::from_le_bytes([a, b]).to_f32(),
            Self::F4 => f32::from_le_bytes([a, b, c, d]),
            Self::F8 => f64::from_le_bytes(raw) as f32,
            Self::U1 => a.into(),
            Self::U2 => u16::from_le_bytes([a, b]).into(),
            Self::U4 => u32::from_le_bytes([a, b, c, d]) as f32,
            Self::I2 => i16::from_le_bytes([a, b]).into(),
            Self::I4 => i32::from_le_bytes([a, b, c, d]) as f32,
        }
    }
}

/// Returns the text of a key's value in the header's Python dictionary: up to the comma, or a whole tuple.
fn value_of<'a>(header: &'a str, key: &str) -> Option<&'a str> {
    let after = [format!("'{key}'"), format!("\"{key}\"")].iter().find_map(|k| header.split_once(k.as_str()))?.1;
    let value = after.trim_start().strip_prefix(':')?.trim_start();
    let end = if value.starts_with('(') { value.find(')')? + 1 } else { value.find([',', '}'])? };
    Some(value[..end].trim())
}

fn clip(text: &str) -> String {
    text.chars().take(40).collect()
}

/// Writes a float32 array `[height, width]`, format version 1.
pub(crate) fn encode(depth: &DepthMap, out: &mut impl Write) -> io::Result<()> {
    let (height, width) = (depth.height(), depth.width());
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    // signature, version and length take 10 bytes; the data begins at a multiple of 64
    let padding = (63 - (header.len() + 10) % 64) % 64;
    header.extend(std::iter::repeat_n(' ', padding));
    header.push('\n');
    out.write_all(b"\x93NUMPY\x01\x00")?;
    out.write_all(&(header.len() as u16).to_le_bytes())?;
    out.write_all(header.as_bytes())?;
    for row in depth.pixels().chunks_exact(width) {
        let bytes: Vec<u8> = row.iter().flat_map(|v| v.to_le_bytes()).collect();
        out.write_all(&bytes)?;
    }
    Ok(())
}
