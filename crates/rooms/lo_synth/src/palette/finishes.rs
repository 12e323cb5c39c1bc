//! Materials of the finishes.

use lo_mesh::Material;
use lo_random::{RngExt, Stream};

use super::{Finish, Mood, Palette, Style, matte};
use crate::chance::{between, chance, pick, tone, weighted};
use crate::texture;

impl Palette {
    fn wall_color(&self, random: &mut Stream) -> [f32; 3] {
        let hue = self.style.hue_deg;
        match self.style.mood {
            Mood::Light => tone(hue, between(random, 0.0, 0.1), between(random, 0.68, 0.84)),
            Mood::Warm => tone(hue, between(random, 0.08, 0.35), between(random, 0.38, 0.68)),
            Mood::Dark => tone(hue, between(random, 0.05, 0.4), between(random, 0.06, 0.28)),
        }
    }

    fn wood_color(&self, random: &mut Stream) -> [f32; 3] {
        let light = match self.style.mood {
            Mood::Light => [0.5, 0.35, 0.15],
            Mood::Warm => [0.3, 0.5, 0.2],
            Mood::Dark => [0.1, 0.3, 0.6],
        };
        let [ash, oak, walnut] = light;
        match weighted(random, &[(0, ash), (1, oak), (2, walnut)]) {
            0 => tone(between(random, 39.0, 45.0), between(random, 0.45, 0.6), between(random, 0.3, 0.45)),
            1 => tone(between(random, 36.0, 42.0), between(random, 0.62, 0.75), between(random, 0.15, 0.28)),
            _ => tone(between(random, 27.0, 36.0), between(random, 0.6, 0.75), between(random, 0.05, 0.12)),
        }
    }

    fn cloth_color(&self, random: &mut Stream, accent: bool) -> [f32; 3] {
        let hue = if accent { self.style.accent_deg } else { self.style.hue_deg };
        let low = if self.style.mood == Mood::Dark { 0.03 } else { 0.08 };
        let saturation = if accent { between(random, 0.2, 0.8) } else { between(random, 0.0, 0.35) };
        tone(hue, saturation, between(random, low, if accent { 0.35 } else { 0.5 }))
    }

    fn floor(&mut self, random: &mut Stream) -> u32 {
        let seed = random.random();
        let Style { wet, sober, rough, mood, .. } = self.style;
        let kinds: &[(u32, f32)] = if wet {
            &[(1, 1.0), (3, 0.15)]
        } else if rough {
            &[(4, 0.65), (1, 0.2), (0, 0.15)]
        } else if sober {
            &[(0, 0.2), (2, 0.4), (1, 0.15), (4, 0.25)]
        } else {
            &[(0, 0.55), (1, 0.14), (2, 0.17), (3, 0.06), (4, 0.08)]
        };
        let albedo = if mood == Mood::Dark { between(random, 0.06, 0.2) } else { between(random, 0.15, 0.42) };
        match weighted(random, kinds) {
            0 => {
                let color = self.wood_color(random);
                let width = pick(random, &[0.07, 0.12, 0.14, 0.19]);
                let roughness = between(random, 0.25, 0.6);
                self.textured("floor boards", roughness, texture::planks(seed, color, width))
            }
            1 => {
                let size = pick(random, &[[0.3, 0.3], [0.6, 0.3], [0.6, 0.6], [0.2, 0.2], [0.45, 0.45]]);
                let color = tone(pick(random, &[30.0, 40.0, 210.0]), between(random, 0.0, 0.3), albedo * 1.2);
                let variation = between(random, 0.1, 0.8);
                let roughness = between(random, 0.15, 0.6);
                self.textured("floor tiles", roughness, texture::tiles(seed, color, size, variation))
            }
            2 => {
                let color = tone(pick(random, &[30.0, 210.0, 0.0, 120.0]), between(random, 0.0, 0.4), albedo * 0.8);
                self.textured("carpet", 0.95, texture::carpet(seed, color))
            }
            3 => {
                let color = tone(40.0, between(random, 0.0, 0.15), albedo * 1.2);
                self.textured("stone floor", between(random, 0.1, 0.4), texture::stone(seed, color))
            }
            _ => {
                let color = tone(40.0, 0.06, albedo);
                self.textured("screed", between(random, 0.3, 0.7), texture::concrete(seed, color))
            }
        }
    }

    fn wall(&mut self, random: &mut Stream, accent: bool) -> u32 {
        let seed = random.random();
        let mut color = self.wall_color(random);
        if accent {
            let albedo = between(random, 0.06, 0.4);
            color = tone(self.style.accent_deg, between(random, 0.15, 0.6), albedo);
        }
        let plain = if self.style.sober || self.style.wet { 6.0 } else { 1.6 };
        let shares = if self.style.rough {
            [(0, 0.45), (1, 0.0), (2, 0.3), (3, 0.25)]
        } else {
            [(0, plain), (1, 0.7), (2, if accent { 0.5 } else { 0.06 }), (3, 0.12)]
        };
        match weighted(random, &shares) {
            0 => self.textured("plaster", between(random, 0.7, 0.95), texture::plaster(seed, color)),
            1 => {
                let other = color.map(|c| (c * between(random, 0.7, 1.15)).min(0.85));
                self.textured("wallpaper", 0.9, texture::wallpaper(seed, color, other))
            }
            2 => {
                let painted = chance(random, 0.4);
                let brick = tone(between(random, 8.0, 22.0), 0.65, between(random, 0.12, 0.25));
                let color = if painted { tone(40.0, 0.05, 0.7) } else { brick };
                self.textured("brick", 0.9, texture::bricks(seed, color))
            }
            _ => {
                let color = tone(40.0, 0.05, between(random, 0.22, 0.4));
                self.textured("concrete", 0.8, texture::concrete(seed, color))
            }
        }
    }

    pub(super) fn create(&mut self, finish: Finish, random: &mut Stream) -> u32 {
        let seed: u64 = random.random();
        let dark = self.style.mood == Mood::Dark;
        match finish {
            Finish::Wall => self.wall(random, false),
            Finish::AccentWall => self.wall(random, true),
            Finish::WallTiles => {
                let size = pick(random, &[[0.15, 0.15], [0.2, 0.1], [0.3, 0.6], [0.3, 0.2], [0.1, 0.1]]);
                let light = tone(pick(random, &[40.0, 200.0]), 0.05, between(random, 0.6, 0.8));
                let coloured = tone(self.style.accent_deg, between(random, 0.1, 0.5), between(random, 0.1, 0.5));
                let color = if chance(random, 0.6) { light } else { coloured };
                self.textured("wall tiles", between(random, 0.1, 0.3), texture::tiles(seed, color, size, 0.25))
            }
            Finish::Ceiling => {
                let wooden = !self.style.sober && !self.style.wet && chance(random, 0.06);
                if wooden {
                    let color = self.wood_color(random);
                    return self.textured("wooden ceiling", 0.6, texture::planks(seed, color, 0.12));
                }
                let albedo = if dark { between(random, 0.5, 0.8) } else { between(random, 0.72, 0.87) };
                self.plain("ceiling paint", 0.9, tone(40.0, between(random, 0.0, 0.06), albedo))
            }
            Finish::Floor => self.floor(random),
            Finish::HallFloor => {
                let color = self.wood_color(random);
                self.plain("hall floor", 0.6, color)
            }
            Finish::Trim | Finish::DoorLeaf | Finish::WindowFrame => {
                if chance(random, if dark { 0.5 } else { 0.25 }) {
                    return self.paint(Finish::Wood).material;
                }
                let grey = finish == Finish::WindowFrame && chance(random, 0.2);
                let albedo = if grey { between(random, 0.05, 0.15) } else { between(random, 0.7, 0.84) };
                self.plain("trim paint", between(random, 0.25, 0.5), tone(40.0, between(random, 0.0, 0.06), albedo))
            }
            Finish::Wood | Finish::SecondWood => {
                let color = self.wood_color(random);
                self.textured("wood", between(random, 0.3, 0.65), texture::wood(seed, color))
            }
            Finish::Lacquer | Finish::Fronts => {
                if finish == Finish::Fronts && chance(random, 0.35) {
                    return self.paint(Finish::Wood).material;
                }
                let white = tone(40.0, between(random, 0.0, 0.05), between(random, 0.7, 0.85));
                let color = tone(self.style.accent_deg, between(random, 0.1, 0.5), between(random, 0.05, 0.45));
                let color = if chance(random, if dark { 0.3 } else { 0.65 }) { white } else { color };
                self.plain("lacquer", between(random, 0.12, 0.5), color)
            }
            Finish::Upholstery | Finish::SecondUpholstery => {
                let accent = finish == Finish::SecondUpholstery || chance(random, 0.3);
                let color = self.cloth_color(random, accent);
                let thread = between(random, 0.002, 0.005);
                self.textured("upholstery", 0.9, texture::weave(seed, color, thread))
            }
            Finish::Linen => {
                let white = tone(40.0, 0.05, between(random, 0.6, 0.82));
                let color = if chance(random, 0.6) { white } else { self.cloth_color(random, true) };
                self.textured("linen", 0.9, texture::weave(seed, color, 0.003))
            }
            Finish::Leather => {
                let hues = [20.0, 25.0, 15.0, 0.0];
                let color = tone(pick(random, &hues), between(random, 0.1, 0.7), between(random, 0.02, 0.2));
                self.textured("leather", between(random, 0.3, 0.5), texture::leather(seed, color))
            }
            Finish::Metal | Finish::SecondMetal => self.metal(random),
            Finish::Glass => self.push(Material {
                base_color: [0.94, 0.97, 0.95, 1.0],
                roughness: 0.0,
                transmission: 1.0,
                ..matte("glass")
            }),
            Finish::Mirror => {
                // Silvered glass reflects about 0.9 of the light.
                let base_color = [0.88, 0.89, 0.88, 1.0];
                self.push(Material { base_color, metallic: 1.0, roughness: 0.0, ..matte("mirror") })
            }
            Finish::Ceramic => self.plain("ceramic", 0.08, tone(50.0, 0.03, between(random, 0.72, 0.84))),
            Finish::Worktop => {
                if chance(random, 0.4) {
                    let color = self.wood_color(random);
                    return self.textured("worktop wood", 0.4, texture::wood(seed, color));
                }
                let color = tone(pick(random, &[40.0, 210.0]), 0.06, between(random, 0.04, 0.7));
                self.textured("worktop stone", between(random, 0.08, 0.35), texture::stone(seed, color))
            }
            Finish::Matte => self.plain("matt paint", 0.8, [0.9; 3]),
            Finish::Gloss => self.plain("gloss", 0.2, [0.9; 3]),
            Finish::Leaf => {
                // The lightest leaf; single leaves are tinted darker.
                let color = tone(between(random, 85.0, 130.0), between(random, 0.5, 0.75), between(random, 0.07, 0.19));
                let [r, g, b] = color;
                let base_color = [r, g, b, 1.0];
                self.push(Material { base_color, roughness: 0.5, diffuse_transmission: 0.3, ..matte("leaf") })
            }
            Finish::Soil => self.plain("soil", 1.0, [0.03, 0.022, 0.016]),
            Finish::Curtain | Finish::NetCurtain | Finish::Blind | Finish::Shade => self.translucent(finish, random),
            Finish::Cardboard => self.plain("cardboard", 0.9, tone(30.0, 0.5, between(random, 0.2, 0.32))),
        }
    }

    fn metal(&mut self, random: &mut Stream) -> u32 {
        // Base colours of metals from physicallybased.info; black powder coating is a paint.
        let [r, g, b] = match weighted(random, &[(0, 0.35), (1, 0.2), (2, 0.12), (3, 0.33)]) {
            0 => [0.67, 0.64, 0.6],
            1 => [0.65, 0.69, 0.72],
            2 => [0.89, 0.76, 0.43],
            _ => return self.plain("black steel", between(random, 0.35, 0.6), [0.03, 0.03, 0.032]),
        };
        let roughness = between(random, 0.12, 0.45);
        self.push(Material { base_color: [r, g, b, 1.0], metallic: 1.0, roughness, ..matte("metal") })
    }

    fn translucent(&mut self, finish: Finish, random: &mut Stream) -> u32 {
        let net = finish == Finish::NetCurtain || finish == Finish::Shade;
        let white = tone(45.0, between(random, 0.0, 0.12), between(random, 0.6, 0.82));
        let accent = chance(random, 0.5);
        let coloured = self.cloth_color(random, accent);
        let color = if net || chance(random, 0.45) { white } else { coloured };
        let through = match finish {
            Finish::NetCurtain => between(random, 0.55, 0.7),
            Finish::Shade => between(random, 0.35, 0.5),
            Finish::Curtain => between(random, 0.05, 0.35),
            _ => between(random, 0.0, 0.3),
        };
        let mut material = Material { roughness: 0.95, diffuse_transmission: through, ..matte("cloth") };
        if finish == Finish::Curtain {
            let seed = random.random();
            self.apply_swatch(&mut material, texture::weave(seed, color, 0.003));
        } else {
            material.base_color = [color[0], color[1], color[2], 1.0];
        }
        self.push(material)
    }
}
