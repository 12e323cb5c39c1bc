//! Textures of printed matter over `[0, 1]²`: pages, covers, labels, keys, clothes.

use super::{Noise, Swatch, mix, scaled};
use crate::chance::tone;

const SIZE: usize = 128;
const PAPER: [f32; 3] = [0.8, 0.79, 0.76];
const INK: [f32; 3] = [0.04, 0.04, 0.05];

/// Whether a stroke of random lettering covers `(u, v)`.
///
/// A letter has three by five dots; `letters` of them cover `u` in [0, 1].
fn lettering(noise: Noise, line: i32, letters: f32, u: f32, v: f32) -> bool {
    if !(0.0..1.0).contains(&u) || !(0.0..1.0).contains(&v) {
        return false;
    }
    let x = u * letters;
    let letter = x.floor() as i32;
    let (a, b) = (((x - x.floor()) * 4.0) as i32, (v * 5.0) as i32);
    a < 3 && (noise.at(letter * 4 + a, line * 8 + b) < 0.6 || a == 0)
}

/// A printed or handwritten page, 1.5 times as high as wide.
pub(crate) fn page(seed: u64) -> Swatch {
    let noise = Noise::new(seed);
    let columns = if noise.at(1, 1) < 0.3 { 2.0 } else { 1.0 };
    let lines = 26.0 + (noise.at(1, 2) * 22.0).floor();
    let figure = (noise.at(1, 3) < 0.5).then(|| [0.15 + 0.4 * noise.at(1, 4), 0.2 + 0.15 * noise.at(1, 5)]);
    let hue = 360.0 * noise.at(1, 6);
    Swatch::new([SIZE, SIZE * 3 / 2], [1.0, 1.0], move |u, v| {
        if u.min(1.0 - u) < 0.1 || v.min(1.0 - v) < 0.07 {
            return PAPER;
        }
        if v < 0.13 {
            let title = lettering(noise.derived(3), 0, 12.0, (u - 0.15) / 0.6, (v - 0.08) / 0.045);
            return if title { INK } else { PAPER };
        }
        if let Some([top, high]) = figure
            && v > top
            && v < top + high
        {
            let bar = noise.at((u * 14.0) as i32, 40);
            return if (v - top) / high > 1.0 - bar { tone(hue, 0.6, 0.25) } else { PAPER };
        }
        let x = (u - 0.1) / 0.8 * columns;
        let (column, across) = (x.floor(), x - x.floor());
        let line = (v * lines).floor();
        let end = if noise.at(line as i32, 7) < 0.2 { 0.3 + 0.6 * noise.at(line as i32, 8) } else { 0.95 };
        let word = noise.at((x * 11.0) as i32, line as i32 + 100 * column as i32) < 0.85;
        let inked = across < end && across > 0.02 && v * lines - line < 0.5 && word;
        let dots = 0.35 + 0.5 * noise.derived(5).at((u * 90.0) as i32, line as i32);
        if inked { mix(PAPER, INK, dots) } else { PAPER }
    })
}

/// Front of a package, a book or a magazine: areas of strong colour, large lettering, small print.
pub(crate) fn package_front(seed: u64) -> Swatch {
    let noise = Noise::new(seed);
    let hue = 360.0 * noise.at(1, 1);
    let ground = tone(hue, 0.5 + 0.5 * noise.at(1, 2), 0.05 + 0.35 * noise.at(1, 3));
    let field = tone(hue + 60.0 + 240.0 * noise.at(1, 4), 0.85 * noise.at(1, 5), 0.05 + 0.65 * noise.at(1, 6));
    let light = if lo_imaging::luminance(field) > 0.25 { INK } else { [0.8, 0.78, 0.7] };
    let kind = (noise.at(1, 7) * 4.0) as u32;
    let [from, to] = [0.1 + 0.4 * noise.at(2, 1), 0.55 + 0.35 * noise.at(2, 2)];
    let letters = 3.0 + (noise.at(2, 3) * 6.0).floor();
    Swatch::new([SIZE, SIZE], [1.0, 1.0], move |u, v| {
        let within = match kind {
            0 => v > from && v < to,
            1 => (u - 0.5).hypot(v - 0.5 * (from + to)) < 0.42,
            2 => u + 0.6 * v > 0.5 + from,
            _ => v > from && v < to && u > 0.1 && u < 0.9,
        };
        let back = if within { field } else { ground };
        let high = (to - from) * 0.45;
        if lettering(noise.derived(2), 1, letters, (u - 0.14) / 0.72, (v - from - 0.2 * (to - from)) / high) {
            return light;
        }
        let small = v > to + 0.04 && v < 0.95 && (v * 30.0).fract() < 0.5 && u > 0.12 && u < 0.7;
        if small && noise.at((u * 40.0) as i32, (v * 30.0) as i32) < 0.7 {
            return [0.75, 0.74, 0.7];
        }
        let shade = noise.derived(4).octaves(u, v, [3, 3], 3) - 0.5;
        scaled(back, 1.0 + 0.25 * shade)
    })
}

/// Keys of a keyboard in `color`, 15 columns by 5 rows.
pub(crate) fn keys(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    let dark = lo_imaging::luminance(color) < 0.2;
    let (ground, cap) = (scaled(color, 0.45), color);
    let legend = if dark { [0.6; 3] } else { [0.08; 3] };
    Swatch::new([192, 64], [1.0, 1.0], move |u, v| {
        if !(0.04..=0.96).contains(&v) || !(0.01..=0.99).contains(&u) {
            return color;
        }
        let (x, y) = (u * 15.0, v * 5.0);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        // The space bar.
        let wide = y >= 4.0 && (4.0..10.0).contains(&x);
        if fy.min(1.0 - fy) < 0.09 || !wide && fx.min(1.0 - fx) < 0.09 {
            return ground;
        }
        let letter =
            !wide && lettering(noise, (x as i32) + 16 * (y as i32), 1.0, (fx - 0.38) / 0.24, (fy - 0.35) / 0.28);
        if letter { legend } else { cap }
    })
}

/// Cloth of clothes: plain, striped, chequered or dotted.
pub(crate) fn clothing(seed: u64, colors: [[f32; 3]; 2]) -> Swatch {
    let noise = Noise::new(seed);
    let kind = (noise.at(1, 1) * 4.0) as u32;
    let repeats = 4.0 + (noise.at(1, 2) * 10.0).floor();
    Swatch::new([SIZE, SIZE], [0.5, 0.5], move |u, v| {
        let (x, y) = ((u * repeats).fract(), (v * repeats).fract());
        let share = match kind {
            0 => 0.0,
            1 => f32::from(u8::from(y < 0.4)),
            2 => 0.5 * f32::from(u8::from(x < 0.45)) + 0.5 * f32::from(u8::from(y < 0.45)),
            _ => f32::from(u8::from((x - 0.5).hypot(y - 0.5) < 0.2)),
        };
        let fold = noise.derived(3).octaves(u, v, [5, 3], 4) - 0.5;
        let thread = noise.derived(5).octaves(u, v, [120, 120], 1) - 0.5;
        scaled(mix(colors[0], colors[1], share), (1.0 + 0.5 * fold) * (1.0 + 0.25 * thread))
    })
}
