//! NumPy's `.npy` (numpy.lib.format, versions 1 to 3): two-dimensional arrays of f2, f4, f8 and u2, either byte order.

use std::io::{self, Write};

use crate::encoded_image::EncodedImage;
use crate::stored_depth::StoredDepth;
use crate::{DepthMap, ImageError};

pub(crate) fn decode(source: EncodedImage) -> Result<StoredDepth, ImageError> {
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
    let (header, data) = rest.split_at_checked(length).ok_or_else(early)?;
    let header = String::from_utf8_lossy(header);

    let descr = value_of(&header, "descr").map(|v| v.trim_matches(['\'', '"'])).unwrap_or_default();
    let fortran = value_of(&header, "fortran_order").unwrap_or_default() == "True";
    let shape = value_of(&header, "shape").unwrap_or_default();
    let sides: Vec<u64> = shape.trim_matches(['(', ')']).split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let [height, width] = sides[..] else {
        return Err(source.unsupported(format!("shape {}; depth needs two dimensions (height, width)", clip(shape))));
    };
    source.check_size(width, height)?;
    let (order, kind) = descr.split_at_checked(1).unwrap_or(("", descr));
    let big = match order {
        "<" | "=" | "|" => false,
        ">" => true,
        _ => return Err(source.invalid(format!("unknown data type “{}”", clip(descr)))),
    };
    let bytes: usize = match kind {
        "f2" | "u2" => 2,
        "f4" => 4,
        "f8" => 8,
        _ => return Err(source.unsupported(format!("data type {}; depth needs f2, f4, f8 or u2", clip(kind)))),
    };
    let (width, height) = (width as usize, height as usize);
    let data = data.get(..width * height * bytes).ok_or_else(|| {
        source.invalid(format!("only {} of {} bytes of pixel data", data.len(), width * height * bytes))
    })?;
    let sample = |index: usize| {
        let mut raw = [0u8; 8];
        raw[..bytes].copy_from_slice(&data[index * bytes..][..bytes]);
        if big {
            raw[..bytes].reverse();
        }
        let [a, b, c, d, ..] = raw;
        match kind {
            "f2" => half::f16::from_le_bytes([a, b]).to_f32(),
            "u2" => f32::from(u16::from_le_bytes([a, b])),
            "f4" => f32::from_le_bytes([a, b, c, d]),
            _ => f64::from_le_bytes(raw) as f32,
        }
    };
    let values = DepthMap::from_fn(width, height, |x, y| sample(if fortran { x * height + y } else { y * width + x }));
    Ok(StoredDepth { values, integers: kind == "u2" })
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
