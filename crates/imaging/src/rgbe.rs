//! Radiance RGBE (`.hdr`): Greg Ward, "Real Pixels", Graphics Gems II, and the Radiance file format reference.

use std::io::{self, Write};

use crate::error::Source;
use crate::{ImageError, RadianceImage};

/// Reads any Radiance RGBE picture.
///
/// * Header: variable lines in any order; further `#?` lines and comments are skipped. `EXPOSURE` and `COLORCORR` are
///   undone (the format says that pixels were multiplied by them; several of each multiply). `PRIMARIES`, `GAMMA`,
///   `VIEW`, `SOFTWARE` … do not change pixels: Photoshop writes `PRIMARIES=0 …` and `GAMMA=1`.
/// * `FORMAT` may be missing; `32-bit_rle_xyze` is refused.
/// * Scan lines: flat, old run-length code (1 1 1 n) and new (2 2 hi lo), also mixed.
/// * All eight axis orders of the resolution line.
/// * A pixel is mantissa / 256 · 2^(exponent − 128), as stb, OpenCV and `imageio` read it (Radiance itself adds half a step).
pub(crate) fn decode(source: Source) -> Result<RadianceImage, ImageError> {
    let (header, mut rest) = read_header(source)?;
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
    /// What undoes exposure and colour correction.
    gain: [f32; 3],
    axes: Axes,
}

/// How scan lines lie in the picture; "descends" is meant in our order (x to the right, y downwards).
struct Axes {
    x_is_slow: bool,
    slow_descends: bool,
    fast_descends: bool,
}

fn read_header(source: Source<'_>) -> Result<(Header, &[u8]), ImageError> {
    let mut rest = source.bytes;
    let mut gain = [1.0f64; 3];
    loop {
        let line = next_line(&mut rest).ok_or_else(|| source.invalid("the header has no end"))?;
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
                    ("EXPOSURE", [e]) => [*e; 3],
                    ("COLORCORR", [r, g, b]) => [*r, *g, *b],
                    _ => return Err(source.invalid(format!("{key}={value} is not what the format allows"))),
                };
                if !factors.iter().all(|f| f.is_finite() && *f > 0.0) {
                    return Err(source.invalid(format!("{key}={value} must be positive")));
                }
                for (g, f) in gain.iter_mut().zip(factors) {
                    *g /= f;
                }
            }
            _ => {}
        }
    }
    let line = next_line(&mut rest).ok_or_else(|| source.invalid("no resolution line"))?;
    let bad = || source.invalid(format!("resolution line “{}”", line.trim().chars().take(40).collect::<String>()));
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

/// The next line without its end; `None` where no line end follows (a file cut off).
fn next_line<'a>(rest: &mut &'a [u8]) -> Option<std::borrow::Cow<'a, str>> {
    let end = rest.iter().position(|&b| b == b'\n')?;
    let line = String::from_utf8_lossy(&rest[..end]);
    *rest = &rest[end + 1..];
    Some(line)
}

/// Fills `scanline` from the front of `rest`.
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
            let (&code, tail) = rest.split_first().ok_or("the file ends early")?;
            let run = code > 128;
            let count = usize::from(if run { code - 128 } else { code });
            if count == 0 || x + count > length {
                return Err("a run is longer than the scan line");
            }
            let used = if run { 1 } else { count };
            let (values, tail) = tail.split_at_checked(used).ok_or("the file ends early")?;
            for (i, pixel) in scanline[x..x + count].iter_mut().enumerate() {
                pixel[component] = values[if run { 0 } else { i }];
            }
            x += count;
            *rest = tail;
        }
    }
    Ok(())
}

/// Flat pixels, in which (1, 1, 1, n) repeats the pixel before; repeats in a row are digits of base 256.
fn read_old_scanline(rest: &mut &[u8], scanline: &mut [[u8; 4]]) -> Result<(), &'static str> {
    let (mut x, mut shift) = (0usize, 0u32);
    while x < scanline.len() {
        let (&pixel, tail) = rest.split_first_chunk::<4>().ok_or("the file ends early")?;
        *rest = tail;
        if let [1, 1, 1, n] = pixel {
            let count = usize::from(n).checked_shl(shift).filter(|_| shift < 32).ok_or("a repeat is too long")?;
            let previous = *x.checked_sub(1).and_then(|x| scanline.get(x)).ok_or("a repeat has nothing to repeat")?;
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

/// Writes new-style run-length code (flat where the format allows no other: widths below 8 and from 32768).
///
/// RGBE knows neither sign nor NaN: negative values and NaN become 0, +∞ and values beyond 1.7e38 the largest value.
/// The three channels share an exponent: each keeps an error of up to 1/256 of the greatest.
pub(crate) fn encode(image: &RadianceImage, out: &mut impl Write) -> io::Result<()> {
    let (width, height) = (image.width(), image.height());
    write!(out, "#?RADIANCE\nSOFTWARE=lightoctree\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n")?;
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
    // a run of fewer than 4 costs as much as it saves
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
    // exponent with greatest = m · 2^exponent, m in [0.5, 1), from the bits: exact where log2 might round
    let mut exponent = (greatest.to_bits() >> 23) as i32 - 126;
    let mut scale = (8.0 - f64::from(exponent)).exp2();
    if (f64::from(greatest) * scale).round() > 255.0 {
        exponent += 1;
        scale *= 0.5;
    }
    if exponent > 127 {
        // rounding up would leave the format
        (exponent, scale) = (127, scale * 2.0);
    }
    let byte = |v: f32| (f64::from(v) * scale).round().min(255.0) as u8;
    [byte(rgb[0]), byte(rgb[1]), byte(rgb[2]), (exponent + 128) as u8]
}
