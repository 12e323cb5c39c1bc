//! Textures of furniture and carpets: wood, cloth, leather, pile.

use lo_geometry::smoothstep;

use super::{Noise, Swatch, mix, scaled};

const SIZE: usize = 256;

/// Veneer or solid wood with the grain along v.
pub(crate) fn wood(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    let dark = scaled(color, 0.62);
    Swatch::new([SIZE, SIZE], [0.6, 1.2], move |u, v| {
        let bend = noise.octaves(u, v, [3, 2], 3);
        let ring = 0.5 + 0.5 * (bend * 40.0).sin();
        let fibre = noise.derived(5).octaves(u, v, [100, 5], 2) - 0.5;
        let flame = noise.derived(9).octaves(u, v, [6, 2], 2);
        let shade = 0.3 * ring * flame + 0.12 + 0.2 * fibre;
        scaled(mix(color, dark, shade), 1.1)
    })
}

/// Woven cloth with threads `thread_m` apart, slightly mottled.
pub(crate) fn weave(seed: u64, color: [f32; 3], thread_m: f32) -> Swatch {
    let noise = Noise::new(seed);
    let threads = 64i32;
    let size = threads as f32 * thread_m;
    Swatch::new([SIZE, SIZE], [size, size], move |u, v| {
        let (x, y) = (u * threads as f32, v * threads as f32);
        let over = (x.floor() as i32 + y.floor() as i32).rem_euclid(2) == 0;
        let bow = |t: f32| (t.fract() * std::f32::consts::PI).sin();
        let (thread, lit) = if over { (x.floor() as i32, bow(x)) } else { (-1 - y.floor() as i32, bow(y)) };
        let yarn = 0.8 + 0.4 * noise.at(thread.rem_euclid(257), 3);
        let mottle = noise.derived(4).octaves(u, v, [8, 8], 3) - 0.5;
        scaled(color, (0.72 + 0.42 * lit) * yarn * (1.0 + 0.25 * mottle))
    })
}

/// Pile carpet: speckled, with broad variation in the lie of the pile.
pub(crate) fn carpet(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    Swatch::new([SIZE, SIZE], [1.2, 1.2], move |u, v| {
        let tuft = noise.octaves(u, v, [128, 128], 1);
        let lie = noise.derived(6).octaves(u, v, [4, 4], 4) - 0.5;
        scaled(color, (0.65 + 0.7 * tuft) * (1.0 + 0.3 * lie))
    })
}

/// Grained leather with a patina.
pub(crate) fn leather(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    let crease = move |u: f32, v: f32| {
        let cell = noise.octaves(u, v, [40, 40], 2);
        smoothstep(0.0, 0.12, (cell - 0.5).abs())
    };
    Swatch::new([SIZE, SIZE], [0.5, 0.5], move |u, v| {
        let patina = noise.derived(3).octaves(u, v, [3, 3], 4) - 0.5;
        scaled(color, (0.85 + 0.2 * crease(u, v)) * (1.0 + 0.4 * patina))
    })
    .with_roughness(move |u, v| 1.0 - 0.25 * crease(u, v))
}

/// A whole rug of size `size_m`: plain, striped, chequered, with diamonds or with a medallion.
pub(crate) fn rug(seed: u64, size_m: [f32; 2], colors: [[f32; 3]; 3]) -> Swatch {
    let noise = Noise::new(seed);
    let kind = (noise.at(2, 9) * 5.0) as u32;
    let repeats = 5.0 + (noise.at(4, 4) * 8.0).floor();
    let border_m = 0.08 + 0.14 * noise.at(1, 7);
    Swatch::new([SIZE, SIZE], size_m, move |u, v| {
        let edge_m = (u.min(1.0 - u) * size_m[0]).min(v.min(1.0 - v) * size_m[1]);
        let (x, y) = (u - 0.5, v - 0.5);
        let pattern = match kind {
            0 => colors[0],
            1 => colors[((v * repeats) as usize) % 3],
            2 => colors[usize::from(((u * repeats).floor() + (v * repeats).floor()) as i32 % 2 == 0)],
            3 => {
                let diamond = ((x.abs() + y.abs()) * repeats * 2.0).fract();
                if diamond < 0.25 { colors[1] } else { colors[0] }
            }
            _ => {
                let angle = y.atan2(x);
                let radius = x.hypot(y) * (1.0 + 0.12 * (12.0 * angle).cos());
                let ring = (radius * repeats * 2.4) as usize;
                colors[if radius < 0.42 { ring % 3 } else { 0 }]
            }
        };
        let bordered = if kind > 2 && edge_m < border_m {
            colors[if edge_m > 0.4 * border_m && edge_m < 0.7 * border_m { 1 } else { 2 }]
        } else {
            pattern
        };
        let tuft = 0.75 + 0.5 * noise.derived(2).octaves(u, v, [120, 120], 1);
        let lie = 1.0 + 0.3 * (noise.derived(3).octaves(u, v, [4, 4], 3) - 0.5);
        scaled(bordered, tuft * lie)
    })
}
