//! The materials of one room, created on first use.
//!
//! Diffuse reflectances are within measured ranges: white paint 0.75–0.88, light plaster 0.4–0.8, concrete 0.2–0.4,
//! brick 0.1–0.35, light wood 0.3–0.45, oak 0.15–0.3, walnut and mahogany 0.06–0.15, carpets 0.05–0.4 (IES Lighting
//! Handbook, 10th ed., tables of reflectances; CIE 97:2005); soils and plants 0.05–0.2. Base colours of metals are from
//! physicallybased.info. EN 12464-1 recommends ceilings of 0.7–0.9, walls of 0.5–0.8 and floors of 0.2–0.6.

mod finishes;
mod wear;

use std::collections::BTreeMap;

use lo_imaging::Image;
use lo_mesh::{Material, Texture, TextureRef, Wrap};
use lo_random::{RngExt, Stream};

use crate::chance::{between, chance, count, pick, tone, weighted};
use crate::pictures::{Pictures, print_reflectance};
use crate::solids::Paint;
use crate::texture::{self, Swatch};

/// Surface finish in the terms of interior design. Each room draws its own material for a finish.
///
/// Variant names are part of the names of random streams: renaming one changes generated rooms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Finish {
    Wall,
    /// A single wall of another colour or wallpaper.
    AccentWall,
    /// Tiles of bathrooms and above worktops.
    WallTiles,
    Ceiling,
    Floor,
    HallFloor,
    Trim,
    DoorLeaf,
    /// Window sills and frames.
    WindowFrame,
    Wood,
    SecondWood,
    /// Painted furniture.
    Lacquer,
    Fronts,
    Upholstery,
    SecondUpholstery,
    Linen,
    Leather,
    Metal,
    SecondMetal,
    Glass,
    Mirror,
    Ceramic,
    Worktop,
    /// Matt white, for tinting.
    Matte,
    /// Glossy white, for tinting.
    Gloss,
    Leaf,
    Soil,
    Curtain,
    NetCurtain,
    Blind,
    Cardboard,
    Shade,
}

/// Materials and textures of the room's model.
#[derive(Debug)]
pub(crate) struct Palette {
    seed: u64,
    index: u64,
    style: Style,
    finishes: BTreeMap<Finish, u32>,
    /// Materials of prints (pages, covers, …) by kind and number.
    prints: BTreeMap<(&'static str, usize), u32>,
    pub pictures: Pictures,
    /// Whether books and keyboards have printed textures.
    pub has_prints: bool,
    /// Degree of wear in [0, 1]; worn surfaces also have normal maps.
    pub wear: Option<f32>,
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
}

/// Overall lightness of a room's colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Mood {
    /// White walls, light wood.
    Light,
    /// Colours of medium reflectance.
    Warm,
    /// Dark walls and furniture.
    Dark,
}

/// Choices shared by several finishes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Style {
    pub mood: Mood,
    /// Bathrooms: tiles and washable walls instead of carpets.
    pub wet: bool,
    /// Offices and classrooms: hard floors, plain walls.
    pub sober: bool,
    /// Workshops, cellars and halls: bare masonry, screed.
    pub rough: bool,
    hue_deg: f32,
    accent_deg: f32,
}

impl Style {
    pub(crate) fn draw(random: &mut Stream, mood: Mood, wet: bool, sober: bool) -> Self {
        let hue_deg =
            weighted(random, &[(35.0, 3.0), (20.0, 1.5), (210.0, 1.5), (120.0, 1.0), (60.0, 0.7), (0.0, 0.5)]);
        let hue_deg = hue_deg + between(random, -15.0, 15.0);
        Self { mood, wet, sober, rough: false, hue_deg, accent_deg: between(random, 0.0, 360.0) }
    }
}

impl Palette {
    pub(crate) fn new(seed: u64, index: u64, style: Style) -> Self {
        Self {
            seed,
            index,
            style,
            finishes: BTreeMap::new(),
            prints: BTreeMap::new(),
            pictures: Pictures::default(),
            has_prints: false,
            wear: None,
            materials: Vec::new(),
            textures: Vec::new(),
        }
    }

    pub(crate) fn style(&self) -> Style {
        self.style
    }

    /// Returns the material of a finish, independent of the order of requests.
    pub(crate) fn paint(&mut self, finish: Finish) -> Paint {
        let material = match self.finishes.get(&finish) {
            Some(&known) => known,
            None => {
                let mut random = lo_random::stream(self.seed, &format!("synth finish {finish:?}"), self.index);
                let first = self.materials.len();
                let material = self.create(finish, &mut random);
                self.apply_wear_from(first, finish);
                self.finishes.insert(finish, material);
                material
            }
        };
        Paint { material, tint: [1.0; 3] }
    }

    /// Creates an emissive material of linear RGB `radiance`.
    pub(crate) fn emitter(&mut self, name: &str, radiance: [f32; 3]) -> Paint {
        let material = Material { emissive: radiance, base_color: [0.7, 0.7, 0.7, 1.0], ..matte(name) };
        Paint { material: self.push(material), tint: [1.0; 3] }
    }

    /// Returns the matt material called `name`, created on first use, so that surfaces can be found by name.
    pub(crate) fn named(&mut self, name: &str, color: [f32; 3]) -> Paint {
        let known = self.materials.iter().position(|m| m.name == name).map(|m| m as u32);
        let material = known.unwrap_or_else(|| self.plain(name, 0.8, color));
        Paint { material, tint: [1.0; 3] }
    }

    /// Creates the material of a picture over texture coordinates `[0, 1]²`, `aspect` times as wide as high.
    ///
    /// With `screen_radiance`, the radiance of white, it is an emissive screen.
    pub(crate) fn picture(&mut self, seed: u64, aspect: f32, screen_radiance: Option<f32>) -> Paint {
        let real = self.pictures.crop(&mut lo_random::stream(seed, "synth real picture", 0), aspect);
        let material = match screen_radiance {
            None => {
                let mut material = matte("picture");
                self.apply_swatch(&mut material, real.map_or_else(|| texture::painting(seed), |real| on_paper(&real)));
                material
            }
            Some(white) => {
                let mut material = Material { base_color: [0.02, 0.02, 0.02, 1.0], roughness: 0.25, ..matte("screen") };
                let shown = |real: Image<[u8; 3]>| Swatch::from_image(real.map(|&[r, g, b]| [r, g, b, 255]));
                self.apply_swatch(&mut material, real.map_or_else(|| texture::screen(seed), shown));
                material.emissive_texture = material.base_color_texture.take();
                material.emissive = [white; 3];
                material
            }
        };
        Paint { material: self.push(material), tint: [1.0; 3] }
    }

    /// Returns a printed page over `[0, 1]²`.
    pub(crate) fn page(&mut self, random: &mut Stream) -> Paint {
        self.print("page", count(random, 0, 4), |_, random| (0.8, texture::page(random.random())))
    }

    /// Returns the front of a package, a book or a magazine over `[0, 1]²`.
    pub(crate) fn printed_front(&mut self, random: &mut Stream) -> Paint {
        self.print("front", count(random, 0, 9), |palette, random| {
            let real = palette.pictures.crop(random, 1.0);
            let swatch = real.map_or_else(|| texture::package_front(random.random()), |real| on_paper(&real));
            (between(random, 0.25, 0.7), swatch)
        })
    }

    /// Returns the keys of a keyboard over `[0, 1]²`.
    pub(crate) fn keys(&mut self, random: &mut Stream) -> Paint {
        self.print("keys", count(random, 0, 1), |_, random| {
            let albedo = weighted(random, &[(0.03, 0.6), (0.6, 0.4)]);
            (0.6, texture::keys(random.random(), tone(40.0, 0.05, albedo)))
        })
    }

    /// Returns the cloth of a person's clothes.
    pub(crate) fn clothing(&mut self, random: &mut Stream) -> Paint {
        self.print("dress", count(random, 0, 9), |_, random| {
            let color = |random: &mut Stream| {
                tone(between(random, 0.0, 360.0), between(random, 0.0, 0.8), between(random, 0.03, 0.6))
            };
            let colors = [color(random), color(random)];
            (0.95, texture::clothing(random.random(), colors))
        })
    }

    /// Returns print number `number` of a kind, created on first use.
    ///
    /// `kind` is part of the random stream's name.
    fn print(
        &mut self,
        kind: &'static str,
        number: usize,
        make: impl FnOnce(&Self, &mut Stream) -> (f32, Swatch),
    ) -> Paint {
        let material = match self.prints.get(&(kind, number)) {
            Some(&known) => known,
            None => {
                let mut random = lo_random::stream(self.seed, &format!("synth {kind} {number}"), self.index);
                let (roughness, swatch) = make(self, &mut random);
                let material = self.textured(kind, roughness, swatch);
                self.prints.insert((kind, number), material);
                material
            }
        };
        Paint { material, tint: [1.0; 3] }
    }

    /// Creates the material of a rug, with texture coordinates in metres from a corner.
    pub(crate) fn rug(&mut self, random: &mut Stream, size_m: [f32; 2]) -> Paint {
        let dark = self.style.mood == Mood::Dark;
        let hue = if chance(random, 0.5) { self.style.accent_deg } else { self.style.hue_deg };
        let base = tone(hue, between(random, 0.05, 0.5), if dark { 0.1 } else { between(random, 0.12, 0.45) });
        let second = tone(hue + between(random, -60.0, 60.0), 0.4, between(random, 0.05, 0.4));
        let third = tone(hue + 180.0, 0.2, between(random, 0.3, 0.55));
        let mut material = matte("rug");
        self.apply_swatch(&mut material, texture::rug(random.random(), size_m, [base, second, third]));
        Paint { material: self.push(material), tint: [1.0; 3] }
    }

    /// Draws a tint for a small object with a matt or glossy white finish.
    pub(crate) fn tint(&self, random: &mut Stream) -> [f32; 3] {
        let near = [self.style.hue_deg, self.style.accent_deg, between(random, 0.0, 360.0)];
        let hue = pick(random, &near);
        match weighted(random, &[(0, 0.35), (1, 0.3), (2, 0.35)]) {
            0 => tone(hue, between(random, 0.0, 0.1), between(random, 0.5, 0.85)),
            1 => tone(hue, between(random, 0.0, 0.3), between(random, 0.03, 0.15)),
            _ => tone(hue, between(random, 0.3, 0.85), between(random, 0.08, 0.45)),
        }
    }

    fn push(&mut self, material: Material) -> u32 {
        self.materials.push(material);
        self.materials.len() as u32 - 1
    }

    /// Assigns a swatch's textures to a material, for texture coordinates in metres.
    fn apply_swatch(&mut self, material: &mut Material, swatch: Swatch) {
        let [width, height] = swatch.size_m;
        let reference = |texture| TextureRef {
            uv_transform: [1.0 / width, 0.0, 0.0, 0.0, 1.0 / height, 0.0],
            wrap: [Wrap::Repeat; 2],
            ..TextureRef::new(texture)
        };
        let (color, roughness) = swatch.textures();
        self.textures.push(color);
        material.base_color_texture = Some(reference(self.textures.len() - 1));
        if let Some(roughness) = roughness {
            self.textures.push(roughness);
            material.metallic_roughness_texture = Some(reference(self.textures.len() - 1));
            material.metallic = 0.0;
        }
    }

    fn textured(&mut self, name: &str, roughness: f32, swatch: Swatch) -> u32 {
        let mut material = Material { roughness, ..matte(name) };
        self.apply_swatch(&mut material, swatch);
        self.push(material)
    }

    fn plain(&mut self, name: &str, roughness: f32, [r, g, b]: [f32; 3]) -> u32 {
        self.push(Material { roughness, base_color: [r, g, b, 1.0], ..matte(name) })
    }
}

fn on_paper(picture: &Image<[u8; 3]>) -> Swatch {
    Swatch::from_image(print_reflectance(picture))
}

/// Matt white material.
fn matte(name: &str) -> Material {
    Material { name: name.to_owned(), base_color: [1.0; 4], ..Material::default() }
}
