//! Textures of floors and walls.

use lo_geometry::smoothstep;

use super::{Noise, Swatch, mix, scaled};

const SIZE: usize = 256;

/// Floor boards or parquet along v, each `width_m` wide, staggered.
pub(crate) fn planks(seed: u64, color: [f32; 3], width_m: f32) -> Swatch {
    let noise = Noise::new(seed);
    let (across, along) = (8, 2);
    let size_m = [across as f32 * width_m, if width_m > 0.1 { 2.4 } else { 1.0 }];
    let joint = 0.0012 / width_m;
    let cell = move |u: f32, v: f32| {
        let column = (u * across as f32).floor() as i32;
        let shift = noise.derived(9).at(column.rem_euclid(across), 0);
        let y = v * along as f32 + shift;
        let row = (y.floor() as i32).rem_euclid(along);
        let x = u * across as f32 - column as f32;
        let edge = x.min(1.0 - x) < joint || (y - y.floor()) < joint * width_m * along as f32 / size_m[1] * 8.0;
        (column.rem_euclid(across), row, edge)
    };
    Swatch::new([SIZE, SIZE], size_m, move |u, v| {
        let (column, row, edge) = cell(u, v);
        if edge {
            return scaled(color, 0.45);
        }
        let plank = 0.82 + 0.36 * noise.derived(1).at(column, row);
        let shift = noise.derived(2).at(column, row);
        let grain = noise.derived(3).octaves(u, v + shift, [64, 4], 2) - 0.5;
        let figure = noise.derived(4).smooth(u + shift, v, [24, 3]);
        let ring = (figure * 22.0).sin() * 0.5;
        let warm = [1.0, 0.98 - 0.05 * shift, 0.95 - 0.1 * shift];
        let value = plank * (1.0 + 0.28 * grain + 0.07 * ring);
        std::array::from_fn(|c| color[c] * value * warm[c])
    })
    .with_roughness(move |u, v| {
        let (column, row, edge) = cell(u, v);
        if edge { 1.0 } else { 0.85 + 0.15 * noise.derived(5).at(column, row) }
    })
}

/// Tiles of size `tile_m` with joints. `variation` in [0, 1] is the colour variation between and within tiles.
pub(crate) fn tiles(seed: u64, color: [f32; 3], tile_m: [f32; 2], variation: f32) -> Swatch {
    let noise = Noise::new(seed);
    let number = [4i32, 4];
    let size_m = [tile_m[0] * number[0] as f32, tile_m[1] * number[1] as f32];
    let bond = if noise.at(1, 1) < 0.35 && tile_m[0] != tile_m[1] { 0.5 } else { 0.0 };
    let grout = if lo_imaging::luminance(color) > 0.3 { [0.42, 0.41, 0.39] } else { [0.2, 0.19, 0.18] };
    let joint_m = 0.0025;
    let at = move |u: f32, v: f32| {
        let y = v * number[1] as f32;
        let row = y.floor() as i32;
        let x = u * number[0] as f32 + bond * (row.rem_euclid(2)) as f32;
        let column = (x.floor() as i32).rem_euclid(number[0]);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let edge_m = (fx.min(1.0 - fx) * tile_m[0]).min(fy.min(1.0 - fy) * tile_m[1]);
        (column, row.rem_euclid(number[1]), edge_m)
    };
    Swatch::new([SIZE, SIZE], size_m, move |u, v| {
        let (column, row, edge_m) = at(u, v);
        let shift = noise.derived(3).at(column, row);
        let tile = 1.0 + variation * 0.3 * (noise.at(column, row) - 0.5);
        let cloud = noise.derived(2).octaves(u + shift, v + 0.7 * shift, [6, 6], 4) - 0.5;
        let face = scaled(color, tile * (1.0 + variation * 0.9 * cloud));
        mix(grout, face, smoothstep(joint_m * 0.5, joint_m, edge_m))
    })
    .with_roughness(move |u, v| 1.0 - 0.72 * smoothstep(joint_m * 0.5, joint_m, at(u, v).2))
}

/// Painted plaster: nearly uniform, uneven from the roller and from age.
pub(crate) fn plaster(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    Swatch::new([SIZE, SIZE], [2.0, 2.0], move |u, v| {
        let stain = noise.octaves(u, v, [3, 3], 3) - 0.5;
        let grain = noise.derived(7).octaves(u, v, [96, 96], 2) - 0.5;
        scaled(color, 1.0 + 0.05 * stain + 0.07 * grain)
    })
}

/// Wallpaper in two colours: stripes, ornaments, waves or a fine weave.
pub(crate) fn wallpaper(seed: u64, color: [f32; 3], second: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    let kind = (noise.at(5, 5) * 4.0) as u32;
    let repeats = [8.0, 6.0, 4.0][(noise.at(6, 6) * 2.99) as usize];
    Swatch::new([SIZE, SIZE], [1.06, 1.06], move |u, v| {
        let (x, y) = (u * repeats, v * repeats);
        let pattern = match kind {
            0 => smoothstep(-0.1, 0.1, (x * std::f32::consts::TAU).sin()),
            1 => {
                let shift = if (y.floor() as i32).rem_euclid(2) == 0 { 0.0 } else { 0.5 };
                let (a, b) = ((x + shift).fract() - 0.5, y.fract() - 0.5);
                let angle = b.atan2(a);
                let radius = a.hypot(b) * (1.25 + 0.4 * (5.0 * angle).cos());
                smoothstep(0.34, 0.3, radius) * smoothstep(0.1, 0.14, radius)
            }
            2 => {
                let wave = (y * std::f32::consts::TAU).sin() * 0.25;
                let line = ((x + wave).fract() - 0.5).abs();
                smoothstep(0.1, 0.07, line)
            }
            _ => noise.octaves(u, v, [128, 16], 2) * 0.5,
        };
        let grain = noise.derived(7).octaves(u, v, [128, 128], 1) - 0.5;
        scaled(mix(color, second, 0.8 * pattern), 1.0 + 0.06 * grain)
    })
}

/// Stone: marble with veins, granite with grains or terrazzo with chips.
pub(crate) fn stone(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    let kind = (noise.at(3, 3) * 3.0) as u32;
    Swatch::new([SIZE, SIZE], [1.2, 1.2], move |u, v| match kind {
        0 => {
            let bend = noise.octaves(u, v, [3, 3], 4);
            let vein = ((bend + noise.derived(20).octaves(u, v, [2, 2], 3) - 1.0) * 24.0).abs();
            let fine = noise.derived(30).octaves(u, v, [12, 12], 3) - 0.5;
            scaled(color, 0.75 + 0.28 * smoothstep(0.0, 0.9, vein) + 0.12 * fine)
        }
        1 => {
            let grain = noise.octaves(u, v, [90, 90], 2);
            let dark = smoothstep(0.42, 0.32, noise.derived(4).smooth(u, v, [120, 120]));
            scaled(color, (0.7 + 0.6 * grain) * (1.0 - 0.5 * dark))
        }
        _ => {
            let chip = noise.smooth(u, v, [60, 60]);
            let hue = noise.derived(8).at((u * 60.0) as i32, (v * 60.0) as i32);
            let stone = mix(scaled(color, 0.55), [0.6, 0.5, 0.4], hue);
            mix(color, stone, smoothstep(0.62, 0.68, chip))
        }
    })
}

/// Fair-faced concrete or screed: clouds and pores.
pub(crate) fn concrete(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    Swatch::new([SIZE, SIZE], [2.4, 2.4], move |u, v| {
        let cloud = noise.octaves(u, v, [4, 4], 5) - 0.5;
        let pore = smoothstep(0.86, 0.93, noise.derived(17).smooth(u, v, [80, 80]));
        scaled(color, (1.0 + 0.5 * cloud) * (1.0 - 0.3 * pore))
    })
}

/// Brickwork in running bond, bricks of 24 × 7.1 cm and 1 cm joints.
pub(crate) fn bricks(seed: u64, color: [f32; 3]) -> Swatch {
    let noise = Noise::new(seed);
    let number = [4i32, 12];
    let size_m = [1.0, 0.97];
    Swatch::new([SIZE, SIZE], size_m, move |u, v| {
        let y = v * number[1] as f32;
        let row = y.floor() as i32;
        let x = u * number[0] as f32 + 0.5 * row.rem_euclid(2) as f32;
        let column = (x.floor() as i32).rem_euclid(number[0]);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let wobble = 0.004 * (noise.derived(2).octaves(u, v, [24, 24], 2) - 0.5);
        let edge_m = (fx.min(1.0 - fx) * 0.25).min(fy.min(1.0 - fy) * 0.081) + wobble;
        let tile = 0.7 + 0.6 * noise.at(column, row.rem_euclid(number[1]));
        let grain = 0.8 + 0.4 * noise.derived(3).octaves(u, v, [40, 40], 3);
        mix([0.45, 0.43, 0.4], scaled(color, tile * grain), smoothstep(0.004, 0.007, edge_m))
    })
}
