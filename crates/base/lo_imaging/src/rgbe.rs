//! Radiance RGBE (`.hdr`): Greg Ward, "Real Pixels", Graphics Gems II, and the Radiance file format reference.

use std::io::{self, Write};

use crate::encoded_image::EncodedImage;
use crate::generator::printable;
use crate::{ImageError, PhotoNote, RadianceImage};

/// Decodes any Radiance RGBE image.
///
/// * Header: variables in any order; further `#?` lines and comments are skipped. `EXPOSURE` and `COLORCORR` are
///   undone, since pixels were multiplied by them; repeated ones multiply. `PRIMARIES`, `GAMMA`, `VIEW`, `SOFTWARE` …
///   are ignored: Photoshop writes `PRIMARIES=0 …` and `GAMMA=1`.
/// * `FORMAT` may be missing; `32-bit_rle_xyze` is unsupported.
/// * Scan lines: flat, old run-length encoding (1 1 1 n) and new (2 2 hi lo), also mixed.
/// * All eight axis orders of the resolution line.
/// * A pixel is mantissa / 256 · 2^(exponent − 128), as in stb, OpenCV and `imageio`; Radiance itself adds half a step.
pub(crate) fn decode(source: EncodedImage, notes: &mut Vec<PhotoNote>) -> Result<RadianceImage, ImageError> {
    let (header, mut rest) = read_header(source, notes)?;
    let Header { lines, length, gain, axes } = header;
    let (width, height) = if axes.x_is_slow { (lines, length) } else { (length, lines) };
    source.check_size(width as u64, height as u64)?;

    let table: [f32; 256] = std::array::from_fn(|e| if e == 0 { 0.0 } else { (e as f64 - 136.0).exp2() as f32 });
    let mut pixels = vec![[0.0f32; 3]; width * height];
    let mut scanline = vec![[0u8; 4]; length];
    for slow in 0..lines {
        read_scanline(&mut rest, &mut scanline)
            .map_err(|reason| source.invalid(format!("scan line {slow} of {lines}: {reason}")))?;
        let slow = if axes.slow_descends { lines - 1 - slow } else { slow };
        for (fast, [r, g, b, e]) in scanline.iter().copied().enumerate() {
            let fast = if axes.fast_descends { length - 1 - fast } else { fast };
            let index = if axes.x_is_slow { fast * width + slow } else { slow * width + fast };
            let scale = table[usize::from(e)];
            pixels[index] =
                [f32::from(r) * scale * gain[0], f32::from(g) * scale * gain[1], f32::from(b) * scale * gain[2]];
        }
    }
    Ok(RadianceImage::new(width, height, pixels))
}

struct Header {
    /// Scan lines in the file.
    lines: usize,
    /// Pixels of a scan line.
    length: usize,
    /// Factors that undo exposure and colour correction.
    gain: [f32; 3],
    axes: Axes,
}

/// Order of scan lines and their pixels in the image; "descends" refers to our order (x to the right, y downwards).
struct Axes {
    x_is_slow: bool,
    slow_descends: bool,
    fast_descends: bool,
}

fn read_header<'a>(source: EncodedImage<'a>, notes: &mut Vec<PhotoNote>) -> Result<(Header, &'a [u8]), ImageError> {
    let mut rest = source.bytes;
    let mut gain = [1.0f64; 3];
    loop {
        let line = next_line(&mut rest).ok_or_else(|| source.invalid("the header is not terminated"))?;
        let line = line.trim();
        if line.is_empty() {
            break;
        }
        let Some((key, value)) = line.split_once('=').filter(|_| !line.starts_with('#')) else { continue };
        let value = value.trim();
        match key.trim() {
            "FORMAT" if value != "32-bit_rle_rgbe" => return Err(source.unsupported(format!("FORMAT={value}"))),
            key @ ("EXPOSURE" | "COLORCORR") => {
                let numbers: Vec<f64> = value.split_whitespace().filter_map(|n| n.parse().ok()).collect();
                let factors = match (key, numbers.as_slice()) {
                    ("EXPOSURE", [e]) => Some([*e; 3]),
                    ("COLORCORR", [r, g, b]) => Some([*r, *g, *b]),
                    _ => None,
                };
                // beyond these no pixel stays in the range of a float
                match factors.filter(|factors| factors.iter().all(|f| (1e-30..=1e30).contains(f))) {
                    Some(factors) => gain.iter_mut().zip(factors).for_each(|(g, f)| *g /= f),
                    None => notes.push(PhotoNote::IgnoredHeader { line: format!("{key}={value}") }),
                }
            }
            _ => {}
        }
    }
    let line = next_line(&mut rest).ok_or_else(|| source.invalid("missing resolution line"))?;
    let clipped: String = line.trim().chars().take(40).collect();
    let bad = || source.invalid(format!("invalid resolution line “{clipped}”"));
    let mut words = line.split_whitespace();
    let mut axis = || {
        let (sign, name) = words.next()?.split_at_checked(1)?;
        let descends = match (sign, name) {
            ("-", "X") | ("+", "Y") => true,
            ("+", "X") | ("-", "Y") => false,
            _ => return None,
        };
        Some((name == "X", descends, words.next()?.parse::<u32>().ok()? as usize))
    };
    let (x_is_slow, slow_descends, lines) = axis().ok_or_else(bad)?;
    let (x_is_fast, fast_descends, length) = axis().ok_or_else(bad)?;
    if x_is_slow == x_is_fast {
        return Err(bad());
    }
    let axes = Axes { x_is_slow, slow_descends, fast_descends };
    Ok((Header { lines, length, gain: gain.map(|g| g as f32), axes }, rest))
}

/// Returns the next line without its end; `None` if no line end follows (a truncated file).
fn next_line<'a>(rest: &mut &'a [u8]) -> Option<std::borrow::Cow<'a, str>> {
    let end = rest.iter().position(|&b| b == b'\n')?;
    let line = String::from_utf8_lossy(&rest[..end]);
    *rest = &rest[end + 1..];
    Some(line)
}

/// Decodes a scan line from the front of `rest`.
fn read_scanline(rest: &mut &[u8], scanline: &mut [[u8; 4]]) -> Result<(), &'static str> {
    let length = scanline.len();
    let new_rle = (8..0x8000).contains(&length)
        && matches!(rest.first_chunk(), Some(&[2, 2, hi, lo]) if usize::from(hi) << 8 | usize::from(lo) == length);
    if !new_rle {
        return read_old_scanline(rest, scanline);
    }
    *rest = &rest[4..];
    for component in 0..4 {
        let mut x = 0;
        while x < length {
            let (&code, tail) = rest.split_first().ok_or("unexpected end of file")?;
            let run = code > 128;
            let count = usize::from(if run { code - 128 } else { code });
            if count == 0 || x + count > length {
                return Err("a run is empty or longer than the scan line");
            }
            let used = if run { 1 } else { count };
            let (values, tail) = tail.split_at_checked(used).ok_or("unexpected end of file")?;
            for (i, pixel) in scanline[x..x + count].iter_mut().enumerate() {
                pixel[component] = values[if run { 0 } else { i }];
            }
            x += count;
            *rest = tail;
        }
    }
    Ok(())
}

/// Decodes flat pixels, in which (1, 1, 1, n) repeats the previous pixel; consecutive repeats are digits of base 256.
fn read_old_scanline(rest: &mut &[u8], scanline: &mut [[u8; 4]]) -> Result<(), &'static str> {
    let (mut x, mut shift) = (0usize, 0u32);
    while x < scanline.len() {
        let (&pixel, tail) = rest.split_first_chunk::<4>().ok_or("unexpected end of file")?;
        *rest = tail;
        if let [1, 1, 1, n] = pixel {
            let count = usize::from(n).checked_shl(shift).filter(|_| shift < 32).ok_or("a repeat is too long")?;
            let previous =
                *x.checked_sub(1).and_then(|x| scanline.get(x)).ok_or("a repeat without a previous pixel")?;
            let end = x.checked_add(count).filter(|&end| end <= scanline.len());
            scanline[x..end.ok_or("a repeat is longer than the scan line")?].fill(previous);
            x += count;
            shift += 8;
        } else {
            scanline[x] = pixel;
            x += 1;
            shift = 0;
        }
    }
    Ok(())
}

/// Writes new-style run-length encoding; flat pixels for widths below 8 and from 32768, where the format requires it.
///
/// RGBE has neither sign nor NaN: negative values and NaN become 0, +∞ and values beyond 1.7e38 the largest value. The
/// three channels share an exponent: each has an error of up to 1/256 of the greatest.
pub(crate) fn encode(image: &RadianceImage, generator: &str, out: &mut impl Write) -> io::Result<()> {
    let (width, height) = (image.width(), image.height());
    write!(out, "#?RADIANCE\nSOFTWARE={}\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n", printable(generator))?;
    let mut scanline = Vec::with_capacity(4 * width + 4);
    for row in image.pixels().chunks_exact(width) {
        let row: Vec<[u8; 4]> = row.iter().map(|&rgb| rgbe_from_rgb(rgb)).collect();
        if !(8..0x8000).contains(&width) {
            out.write_all(row.as_flattened())?;
            continue;
        }
        scanline.clear();
        scanline.extend_from_slice(&[2, 2, (width >> 8) as u8, width as u8]);
        for component in 0..4 {
            let values: Vec<u8> = row.iter().map(|pixel| pixel[component]).collect();
            encode_runs(&values, &mut scanline);
        }
        out.write_all(&scanline)?;
    }
    Ok(())
}

fn encode_runs(values: &[u8], out: &mut Vec<u8>) {
    // a run of fewer than 4 saves nothing
    let run_at = |x: usize| values[x..].iter().take(127).take_while(|&&v| v == values[x]).count();
    let mut x = 0;
    while x < values.len() {
        let run = run_at(x);
        if run >= 4 {
            out.extend_from_slice(&[128 + run as u8, values[x]]);
            x += run;
            continue;
        }
        let start = x;
        while x < values.len() && x - start < 128 && (x == start || run_at(x) < 4) {
            x += 1;
        }
        out.push((x - start) as u8);
        out.extend_from_slice(&values[start..x]);
    }
}

fn rgbe_from_rgb(rgb: [f32; 3]) -> [u8; 4] {
    // up to 255/256 · 2^127, the greatest value of the format
    let rgb = rgb.map(|v| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.694_745e38) });
    let greatest = rgb[0].max(rgb[1]).max(rgb[2]);
    if greatest < 1e-38 {
        return [0; 4];
    }
    // exponent with greatest = m · 2^exponent, m in [0.5, 1), from the bits, since log2 may round
    let mut exponent = (greatest.to_bits() >> 23) as i32 - 126;
    let mut scale = (8.0 - f64::from(exponent)).exp2();
    if (f64::from(greatest) * scale).round() > 255.0 {
        exponent += 1;
        scale *= 0.5;
    }
    if exponent > 127 {
        // rounding up would exceed the format's range
        (exponent, scale) = (127, scale * 2.0);
    }
    let byte = |v: f32| (f64::from(v) * scale).round().min(255.0) as u8;
    [byte(rgb[0]), byte(rgb[1]), byte(rgb[2]), (exponent + 128) as u8]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Format;

    fn read(bytes: &[u8]) -> Result<RadianceImage, ImageError> {
        decode(EncodedImage { bytes, name: "test.hdr", format: Format::Hdr }, &mut Vec::new())
    }

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        [header.as_bytes(), data].concat()
    }

    /// (128, 64, 0) / 256 · 2^(129 − 128) = 1, 0.5, 0
    const A: [u8; 4] = [128, 64, 0, 129];
    const A_RGB: [f32; 3] = [1.0, 0.5, 0.0];
    const B: [u8; 4] = [255, 0, 1, 128];
    const B_RGB: [f32; 3] = [255.0 / 256.0, 0.0, 1.0 / 256.0];

    #[test]
    fn flat_and_old_runs() {
        let header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 4\n";
        let flat = read(&file(header, [A, B, A, B].as_flattened())).unwrap();
        assert_eq!(flat.pixels(), [A_RGB, B_RGB, A_RGB, B_RGB]);
        let run = read(&file(header, [A, [1, 1, 1, 2], B].as_flattened())).unwrap();
        assert_eq!(run.pixels(), [A_RGB, A_RGB, A_RGB, B_RGB]);
        // digits of base 256: 3 + 1 · 256 repeats
        let long = file("#?RGBE\n\n-Y 1 +X 261\n", [A, [1, 1, 1, 3], [1, 1, 1, 1], B].as_flattened());
        let long = read(&long).unwrap();
        assert_eq!((long[(259, 0)], long[(260, 0)]), (A_RGB, B_RGB));
        for bad in [[[1, 1, 1, 2], A, A], [A, A, [1, 1, 1, 3]], [A, [1, 1, 1, 0], [1, 1, 1, 255]]] {
            assert!(read(&file(header, bad.as_flattened())).is_err());
        }
        // five repeats in a row shift beyond 32 bits
        let endless = [A, [1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 0], [1, 1, 1, 1]];
        assert!(read(&file(header, endless.as_flattened())).is_err());
    }

    #[test]
    fn new_runs_mixed_with_flat_lines() {
        // red: run of 8; green: 3 literals, run of 5; blue: 8 literals; exponent: run of 8
        let mut data = vec![2, 2, 0, 8, 136, 128, 3, 64, 64, 64, 133, 64, 8, 0, 0, 0, 0, 0, 0, 0, 0, 136, 129];
        data.extend([B; 8].as_flattened());
        let image = read(&file("#?RADIANCE\n\n-Y 2 +X 8\n", &data)).unwrap();
        assert_eq!(image.pixels()[..8], [A_RGB; 8]);
        assert_eq!(image.pixels()[8..], [B_RGB; 8]);
        // a run of nine in eight columns, and one of none
        for bad in [[2, 2, 0, 8, 137, 128], [2, 2, 0, 8, 0, 0]] {
            assert!(read(&file("#?RADIANCE\n\n-Y 1 +X 8\n", &bad)).is_err());
        }
    }

    #[test]
    fn headers_of_the_wild() {
        for header in [
            "#?RADIANCE\n#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n",
            "#?RADIANCE\nGAMMA=1\nPRIMARIES=0 0 0 0 0 0 0 0\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n",
            "#?RADIANCE\r\n# comment = with equals\r\nFORMAT=32-bit_rle_rgbe\r\n\r\n-Y 1 +X 1\n",
            "#?RGBE\nFORMAT = 32-bit_rle_rgbe\nVIEW= -vtv\nEXPOSURE=1.0\n\n-Y 1 +X 1\n",
        ] {
            assert_eq!(read(&file(header, &A)).unwrap().pixels(), [A_RGB], "{header}");
        }
        // radiance was multiplied by the exposures: reading divides
        for line in ["EXPOSURE=0", "EXPOSURE=x", "EXPOSURE=inf", "COLORCORR=1 2"] {
            let bytes = file(&format!("#?RADIANCE\n{line}\n\n-Y 1 +X 1\n"), &A);
            let mut notes = Vec::new();
            decode(EncodedImage { bytes: &bytes, name: "test.hdr", format: Format::Hdr }, &mut notes).unwrap();
            assert_eq!(notes, [PhotoNote::IgnoredHeader { line: line.into() }]);
        }
        let exposed = read(&file("#?RADIANCE\nEXPOSURE=2\nEXPOSURE= 4\nCOLORCORR=1 2 1\n\n-Y 1 +X 1\n", &A)).unwrap();
        assert_eq!(exposed.pixels(), [[1.0 / 8.0, 0.5 / 16.0, 0.0]]);
        for (header, says) in [
            ("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\n", "xyze"),
            ("#?RADIANCE\n\n-Y 1 +Y 1\n", "resolution"),
            ("#?RADIANCE\n\n-Y -1 +X 1\n", "resolution"),
            ("#?RADIANCE\n\nhello\n", "resolution"),
            ("#?RADIANCE\nFORMAT=", "not terminated"),
        ] {
            let error = read(&file(header, &A)).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
    }

    #[test]
    fn all_axis_orders() {
        // the image A B over B B, as each order stores it
        let orders = [
            ("-Y 2 +X 2", [A, B, B, B]),
            ("-Y 2 -X 2", [B, A, B, B]),
            ("+Y 2 +X 2", [B, B, A, B]),
            ("+Y 2 -X 2", [B, B, B, A]),
            ("+X 2 -Y 2", [A, B, B, B]),
            ("+X 2 +Y 2", [B, A, B, B]),
            ("-X 2 -Y 2", [B, B, A, B]),
            ("-X 2 +Y 2", [B, B, B, A]),
        ];
        for (order, pixels) in orders {
            let image = read(&file(&format!("#?RADIANCE\n\n{order}\n"), pixels.as_flattened())).unwrap();
            assert_eq!(image.pixels(), [A_RGB, B_RGB, B_RGB, B_RGB], "{order}");
        }
        // 3 columns of 2: column by column from the left, each from the top
        let image = read(&file("#?RADIANCE\n\n+X 3 -Y 2\n", [A, B, B, A, A, A].as_flattened())).unwrap();
        assert_eq!((image.width(), image.height()), (3, 2));
        assert_eq!(image.pixels(), [A_RGB, B_RGB, A_RGB, B_RGB, A_RGB, A_RGB]);
    }

    #[test]
    fn the_greatest_and_smallest_values() {
        assert_eq!(rgbe_from_rgb([1.0, 0.5, 0.0]), A);
        assert_eq!(rgbe_from_rgb([0.0; 3]), [0; 4]);
        assert_eq!(rgbe_from_rgb([1e-40; 3]), [0; 4]);
        assert_eq!(rgbe_from_rgb([f32::MAX, 0.0, f32::NAN]), [255, 0, 0, 255]);
        // 0.999 rounds up to the next exponent
        assert_eq!(rgbe_from_rgb([0.999, 0.0, 0.0]), [128, 0, 0, 129]);
        let dark = read(&file("#?RADIANCE\n\n-Y 1 +X 1\n", &[128, 0, 0, 1])).unwrap();
        assert_eq!(dark.pixels()[0][0], (-128f64).exp2() as f32);
    }
}
