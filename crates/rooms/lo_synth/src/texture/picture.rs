//! Textures of paintings and screens.

use lo_geometry::smoothstep;

use super::{Noise, Swatch, mix, scaled};
use crate::chance::tone;

const SIZE: usize = 128;

/// A painting over `[0, 1]²`, with or without a mount.
///
/// Shows a landscape, stripes of colour, shapes, a dark portrait or ink on paper.
pub(crate) fn painting(seed: u64) -> Swatch {
    let noise = Noise::new(seed);
    let kind = (noise.at(1, 1) * 5.0) as u32;
    let hue = 360.0 * noise.at(2, 2);
    let vivid = 0.2 + 0.6 * noise.at(3, 3);
    let mount = if noise.at(4, 4) < 0.45 { 0.06 + 0.12 * noise.at(5, 5) } else { 0.0 };
    Swatch::new([SIZE, SIZE], [1.0, 1.0], move |u, v| {
        if u.min(1.0 - u).min(v.min(1.0 - v)) < mount {
            return [0.72, 0.71, 0.68];
        }
        let cloud = noise.derived(9).octaves(u, v, [4, 4], 5);
        match kind {
            0 => {
                let ridge =
                    |n: u32, base: f32, height: f32| v > base - height * noise.derived(n).octaves(u, 0.3, [3, 1], 4);
                let sky = mix(tone(210.0, 0.5, 0.35), tone(35.0, 0.3, 0.6), smoothstep(0.0, 0.6, v + 0.3 * cloud));
                if ridge(1, 0.85, 0.25) {
                    scaled(tone(hue, 0.5, 0.08), 0.6 + cloud)
                } else if ridge(2, 0.65, 0.4) {
                    tone(hue, 0.35, 0.2)
                } else {
                    sky
                }
            }
            1 => {
                let stripe = (u * 7.0 + 0.3 * cloud) as i32;
                tone(hue + 50.0 * noise.at(stripe, 3), vivid, 0.08 + 0.5 * noise.at(stripe, 4))
            }
            2 => {
                let mut color = tone(hue, 0.15, 0.6);
                for k in 0..6 {
                    let center = [noise.at(k, 10), noise.at(k, 11)];
                    let radius = 0.08 + 0.2 * noise.at(k, 12);
                    let inside = if noise.at(k, 13) < 0.5 {
                        (u - center[0]).hypot(v - center[1]) < radius
                    } else {
                        (u - center[0]).abs().max((v - center[1]).abs()) < radius
                    };
                    if inside {
                        color = tone(hue + 200.0 * noise.at(k, 14), vivid, 0.05 + 0.4 * noise.at(k, 15));
                    }
                }
                color
            }
            3 => {
                let head = (1.6 * (u - 0.5)).hypot(1.2 * (v - 0.38));
                let chest = (u - 0.5).hypot(1.1 * (v - 1.0));
                let ground = scaled(tone(hue, 0.4, 0.06), 0.6 + cloud);
                let coat = mix(tone(hue + 120.0, 0.4, 0.05), ground, smoothstep(0.36, 0.4, chest));
                mix(tone(25.0, 0.4, 0.3), coat, smoothstep(0.19, 0.23, head))
            }
            _ => {
                let stroke = (noise.octaves(u, v, [3, 3], 3) - 0.5).abs();
                mix([0.05, 0.05, 0.06], [0.7, 0.68, 0.63], smoothstep(0.01, 0.035, stroke))
            }
        }
    })
}

/// Content of a monitor or television, from 0 to 0.88 of its white.
pub(crate) fn screen(seed: u64) -> Swatch {
    let noise = Noise::new(seed);
    let hue = 360.0 * noise.at(1, 2);
    let film = noise.at(2, 2) < 0.45;
    Swatch::new([SIZE, SIZE], [1.0, 1.0], move |u, v| {
        if film {
            let light = noise.octaves(u, v, [2, 2], 5);
            return scaled(tone(hue + 120.0 * noise.derived(2).smooth(u, v, [2, 2]), 0.6, 0.45), light * light * 1.8);
        }
        if v < 0.05 {
            return tone(hue, 0.6, 0.2);
        }
        if u < 0.2 {
            return [0.12, 0.13, 0.15];
        }
        let line = (v * 30.0).fract();
        let end = 0.35 + 0.6 * noise.at((v * 30.0) as i32, 8);
        let word = noise.at((u * 70.0) as i32, (v * 30.0) as i32) < 0.75;
        if line > 0.35 && line < 0.75 && u < end && word { [0.1, 0.1, 0.12] } else { [0.82, 0.83, 0.86] }
    })
}
