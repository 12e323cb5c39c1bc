//! Arrays in `.npy` format (numpy.lib.format, version 1), and their element types.
//!
//! Implemented here because the reader must reject malicious files: `npyz` 0.9 multiplies a header's shape without an
//! overflow check.

use half::f16;

/// Maximum header length. NumPy's own headers have 118 bytes, rarely more.
const MAX_HEADER_BYTES: usize = 1024;

/// Element of an array.
pub(super) trait Element: Copy {
    /// NumPy's name of the type.
    const DESCR: &'static str;
    /// Size in bytes.
    const BYTES: usize;
    /// Appends it in little-endian order.
    fn put(self, out: &mut Vec<u8>);
    /// Reads it from its bytes.
    fn take(bytes: &[u8]) -> Self;
}

impl Element for i8 {
    const DESCR: &'static str = "|i1";
    const BYTES: usize = 1;

    fn put(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }

    fn take(bytes: &[u8]) -> Self {
        Self::from_le_bytes([bytes[0]])
    }
}

impl Element for u16 {
    const DESCR: &'static str = "<u2";
    const BYTES: usize = 2;

    fn put(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }

    fn take(bytes: &[u8]) -> Self {
        Self::from_le_bytes([bytes[0], bytes[1]])
    }
}

impl Element for f16 {
    const DESCR: &'static str = "<f2";
    const BYTES: usize = 2;

    fn put(self, out: &mut Vec<u8>) {
        out.extend(self.to_le_bytes());
    }

    fn take(bytes: &[u8]) -> Self {
        Self::from_le_bytes([bytes[0], bytes[1]])
    }
}

/// Encodes values in C order. Their number must match the shape.
pub(super) fn encode<T: Element>(shape: &[usize], values: impl Iterator<Item = T>) -> Vec<u8> {
    let shape: String = shape.iter().map(|n| format!("{n}, ")).collect();
    let mut header = format!("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", T::DESCR, shape.trim_end());
    // Magic, version and length take 10 bytes, the line break one. The data begins at a multiple of 64.
    header.extend(std::iter::repeat_n(' ', (64 - (header.len() + 11) % 64) % 64));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.into_bytes());
    values.for_each(|value| value.put(&mut bytes));
    bytes
}

/// Decodes an array of `T` with the given number of axes. Allocates no more memory than the input has.
pub(super) fn decode<T: Element>(bytes: &[u8], axes: usize) -> Result<(Vec<usize>, Vec<T>), String> {
    let (length, rest) = match bytes {
        [0x93, b'N', b'U', b'M', b'P', b'Y', 1, _, low, high, rest @ ..] => {
            (usize::from(u16::from_le_bytes([*low, *high])), rest)
        }
        _ => return Err("not an NPY file of version 1".to_owned()),
    };
    let (header, data) = match rest.split_at_checked(length) {
        Some((header, data)) if length <= MAX_HEADER_BYTES && header.is_ascii() => (header, data),
        _ => return Err(format!("invalid header of {length} bytes")),
    };
    let header = String::from_utf8_lossy(header);
    let value = |key: &str, ends: &[char]| {
        let rest = header.split_once(&format!("'{key}': "))?.1;
        Some(rest.split(ends).next().unwrap_or(rest))
    };
    let descr = value("descr", &[',']).unwrap_or_default().trim_matches('\'');
    if descr != T::DESCR || value("fortran_order", &[',']) != Some("False") {
        return Err(format!("array of {descr:?}; expected {:?} in C order", T::DESCR));
    }
    let text = value("shape", &[')']).unwrap_or_default().trim_start_matches('(');
    let sides: Option<Vec<usize>> =
        text.split(',').map(str::trim).filter(|side| !side.is_empty()).map(|side| side.parse().ok()).collect();
    let shape = sides.filter(|sides| sides.len() == axes).ok_or_else(|| format!("unexpected shape ({text})"))?;
    let needed = shape.iter().try_fold(T::BYTES, |product, &n| product.checked_mul(n));
    if needed != Some(data.len()) {
        return Err(format!("{} bytes of data do not fill the shape {shape:?}", data.len()));
    }
    Ok((shape, data.chunks_exact(T::BYTES).map(T::take).collect()))
}

/// Converts values to half floats scaled by 2^−`exponent`, with the smallest exponent at which all are finite halves.
pub(super) fn halves(values: impl Iterator<Item = f32> + Clone) -> (i32, impl Iterator<Item = f16>) {
    let greatest = values.clone().filter(|v| v.is_finite()).fold(0.0f32, |a, v| a.max(v.abs()));
    let largest_half = f16::MAX.to_f32();
    let exponent = if greatest > largest_half { (greatest / largest_half).log2().ceil() as i32 } else { 0 };
    let scale = (-exponent as f32).exp2();
    // log2 may round down at the very edge.
    (exponent, values.map(move |v| f16::from_f32((v * scale).clamp(-largest_half, largest_half))))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn arrays_come_back() {
        let bytes = encode(&[2, 3], [1u16, 2, 3, 4, 5, 65535].into_iter());
        assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
        assert_eq!(decode::<u16>(&bytes, 2).unwrap(), (vec![2, 3], vec![1, 2, 3, 4, 5, 65535]));
        let signed = encode(&[3], [-128i8, 0, 127].into_iter());
        assert_eq!(decode::<i8>(&signed, 1).unwrap().1, [-128, 0, 127]);
        let half = encode(&[1], [f16::from_f32(0.1)].into_iter());
        assert!((decode::<f16>(&half, 1).unwrap().1[0].to_f32() - 0.1).abs() < 1e-4);
    }

    #[test]
    fn bright_light_gets_an_exponent() {
        let (exponent, codes) = halves([1.0f32, 3e9, 0.0].into_iter());
        let back: Vec<f32> = codes.map(|h| h.to_f32() * (exponent as f32).exp2()).collect();
        assert!(exponent > 0 && (back[1] / 3e9 - 1.0).abs() < 1e-3, "{exponent} {back:?}");
        let (none, _) = halves([65504.0f32].into_iter());
        assert_eq!(none, 0);
    }

    #[test]
    fn hostile_arrays_give_errors() {
        let good = encode(&[4], [1u16, 2, 3, 4].into_iter());
        let message = |bytes: &[u8]| decode::<u16>(bytes, 1).unwrap_err();
        assert_eq!(message(b""), "not an NPY file of version 1");
        assert_eq!(message(&good[..good.len() - 1]), "7 bytes of data do not fill the shape [4]");
        assert_eq!(decode::<u16>(&good, 2).unwrap_err(), "unexpected shape (4,)");
        assert_eq!(decode::<i8>(&good, 1).unwrap_err(), "array of \"<u2\"; expected \"|i1\" in C order");
        let with = |shape: &str| {
            let header = format!("{{'descr': '<u2', 'fortran_order': False, 'shape': {shape}, }}").into_bytes();
            let mut bytes = good[..8].to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header);
            bytes.extend([0; 8]);
            bytes
        };
        assert!(decode::<u16>(&with("(4,)"), 1).is_ok());
        assert!(decode::<u16>(&with("(99999999999999, 99999999999)"), 2).is_err());
        assert!(decode::<u16>(&with("(-4,)"), 1).is_err());
        assert!(decode::<u16>(&with("()"), 1).is_err());
        let mut deep = good[..8].to_vec();
        deep.extend(60_000u16.to_le_bytes());
        deep.extend(vec![b'('; 60_000]);
        assert_eq!(message(&deep), "invalid header of 60000 bytes");
    }
}
