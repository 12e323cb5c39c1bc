//! Wear, patterns and relief of the finishes.

use lo_mesh::{Texture, TextureRef};
use lo_random::RngExt;

use super::{Finish, Palette};
use crate::chance::{between, chance, tone};
use crate::texture;

impl Palette {
    /// Applies wear to the materials from index `first` on, if the room is worn.
    pub(super) fn apply_wear_from(&mut self, first: usize, finish: Finish) {
        let Some(amount) = self.wear else { return };
        for material in first..self.materials.len() {
            let made = &self.materials[material];
            // A material shared with another finish is worn already.
            if made.normal_texture.is_none() && made.metallic == 0.0 && made.transmission == 0.0 {
                self.apply_wear(material, finish, amount);
            }
        }
    }

    fn apply_wear(&mut self, index: usize, finish: Finish, amount: f32) {
        let mut random = lo_random::stream(self.seed, &format!("synth wear {finish:?} {index}"), self.index);
        let seed: u64 = random.random();
        let amount = amount * between(&mut random, 0.3, 1.0);
        let Some((depth_m, pattern_share)) = relief_parameters(finish, &self.materials[index].name) else { return };
        let colors = [(); 3].map(|()| {
            let hue = if chance(&mut random, 0.5) { self.style.hue_deg } else { self.style.accent_deg };
            tone(hue, between(&mut random, 0.0, 0.7), between(&mut random, 0.05, 0.7))
        });
        if chance(&mut random, pattern_share) {
            let cell_m = between(&mut random, 0.04, 0.4);
            let mut material = std::mem::take(&mut self.materials[index]);
            self.apply_swatch(&mut material, texture::pattern(seed, colors, cell_m));
            self.materials[index] = material;
        }
        let material = &self.materials[index];
        if material.base_color_texture.is_none() {
            let [r, g, b, _] = material.base_color;
            let mut material = std::mem::take(&mut self.materials[index]);
            material.base_color = [1.0; 4];
            self.apply_swatch(&mut material, texture::painted(seed, [r, g, b]));
            self.materials[index] = material;
        }
        let Some(color) = self.materials[index].base_color_texture.clone() else { return };
        let levels = &self.textures[color.texture].levels;
        let worn = texture::apply_wear(&levels[0], seed ^ 1, amount);
        // The next coarser level is used, because single texels are noise.
        let clean = &levels[1.min(levels.len() - 1)];
        // The texture transform holds the inverse of the size in metres.
        let [width_m, height_m] =
            [color.uv_transform[0], color.uv_transform[4]].map(|scale| 1.0 / scale.abs().max(1e-3));
        let texel_m = [width_m / clean.width() as f32, height_m / clean.height() as f32];
        let normals = texture::normal_map(clean, texel_m, depth_m);
        self.textures[color.texture] = Texture::from_image(worn, true);
        self.textures.push(Texture::from_image(normals, false));
        self.materials[index].normal_texture = Some(TextureRef { texture: self.textures.len() - 1, ..color });
    }
}

/// Relief depth in metres and share of patterned surfaces of a finish; `None` for finishes without wear.
fn relief_parameters(finish: Finish, name: &str) -> Option<(f32, f32)> {
    Some(match finish {
        Finish::Wall | Finish::AccentWall => {
            let depth_m = match name {
                "brick" => 0.006,
                "concrete" => 0.003,
                _ => 0.0015,
            };
            (depth_m, 0.12)
        }
        Finish::WallTiles => (0.002, 0.15),
        Finish::Floor => (if name == "carpet" { 0.004 } else { 0.0012 }, 0.25),
        Finish::Ceiling => (0.001, 0.0),
        Finish::Wood | Finish::SecondWood | Finish::Worktop | Finish::HallFloor => (0.00025, 0.0),
        Finish::Trim | Finish::DoorLeaf | Finish::WindowFrame | Finish::Lacquer | Finish::Fronts => (0.0004, 0.0),
        Finish::Upholstery | Finish::SecondUpholstery | Finish::Linen => (0.0008, 0.35),
        Finish::Leather => (0.001, 0.0),
        Finish::Cardboard => (0.001, 0.0),
        _ => return None,
    })
}
