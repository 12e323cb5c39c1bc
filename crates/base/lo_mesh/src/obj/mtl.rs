//! Conversion of MTL materials to metallic-roughness.
//!
//! | MTL | metallic-roughness |
//! | --- | --- |
//! | `Kd`, `map_Kd` | base colour (linear numbers, sRGB image); a black `Kd` does not darken an image |
//! | `Pr`, `Pm`, `map_Pr`, `map_Pm` | roughness, metallic |
//! | `Ns` without `Pr` | roughness (2 / (Ns + 2))^¼: Beckmann α of a Blinn-Phong lobe (Walter 2007), α = roughness² |
//! | `Ks` 0, or `illum` 0 or 1, without `Pr` | roughness 1 |
//! | `Kd` black, `Ks` above 0.2, no `Pm`, no `map_Kd` | metal of colour `Ks` |
//! | `Ke`, `map_Ke` | emission |
//! | `d`, `Tr`; `map_d` | blended alpha, of both the more opaque one; alpha cut out at 0.5 |
//! | `norm`, `map_Kn`; `map_Bump`, `bump` of a normal map | normal texture, +Y up; height maps are ignored |
//!
//! Statements are read in any case, as many programs write them.

use std::collections::{HashMap, HashSet};

use lo_imaging::Image;

use super::lines::{clean, in_lower_case, logical_lines};
use crate::model::Resolver;
use crate::texture::TextureBudget;
use crate::{AlphaMode, Material, MeshWarning, Model, Texture, TextureRef, Wrap};

/// Reads the material libraries of an OBJ; missing or invalid ones become warnings.
pub(super) fn read_libraries(
    names: &[String],
    resolve: &Resolver,
    obj_bytes: usize,
    model: &mut Model,
) -> HashMap<String, Material> {
    let mut loader = TextureLoader {
        resolve,
        known: HashMap::new(),
        counted: HashSet::new(),
        budget: TextureBudget::new(obj_bytes),
        textures: Vec::new(),
        warnings: Vec::new(),
    };
    let mut materials = HashMap::new();
    for name in names {
        // Some exporters write several names on one line, others write names with spaces.
        match resolve(name) {
            Ok(bytes) => read_library(&bytes, &mut loader, &mut materials),
            Err(whole) => {
                for part in name.split_ascii_whitespace() {
                    match resolve(part) {
                        Ok(bytes) => read_library(&bytes, &mut loader, &mut materials),
                        Err(_) => {
                            let (file, reason) = (part.to_owned(), whole.to_string());
                            loader.warnings.push(MeshWarning::MaterialFile { file, reason });
                        }
                    }
                }
            }
        }
    }
    model.textures = loader.textures;
    model.warnings.extend(loader.warnings);
    materials
}

fn read_library(bytes: &[u8], loader: &mut TextureLoader, materials: &mut HashMap<String, Material>) {
    let mut entry: Option<MtlMaterial> = None;
    for (_, line) in logical_lines(bytes) {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((&line, ""));
        let rest = rest.trim();
        if keyword.eq_ignore_ascii_case("newmtl") {
            if let Some(done) = entry.replace(MtlMaterial { name: rest.to_owned(), ..MtlMaterial::default() }) {
                materials.insert(done.name.clone(), done.into_material(loader));
            }
        } else if let Some(entry) = &mut entry {
            entry.line(keyword, rest);
        }
    }
    if let Some(done) = entry {
        materials.insert(done.name.clone(), done.into_material(loader));
    }
}

/// Statements of one `newmtl`.
#[derive(Default)]
struct MtlMaterial {
    name: String,
    diffuse: Option<[f32; 3]>,
    specular: Option<[f32; 3]>,
    emissive: Option<[f32; 3]>,
    exponent: Option<f32>,
    roughness: Option<f32>,
    metallic: Option<f32>,
    /// Opacity by `d`.
    dissolve: Option<f32>,
    /// Transparency by `Tr`.
    transparency: Option<f32>,
    illumination: Option<u32>,
    /// Arguments of map statements, by lower-case keyword.
    maps: HashMap<String, String>,
}

impl MtlMaterial {
    fn line(&mut self, keyword: &str, rest: &str) {
        let number =
            || rest.split_ascii_whitespace().next().and_then(|w| w.parse::<f32>().ok()).filter(|x| x.is_finite());
        let keyword = in_lower_case(keyword);
        match &*keyword {
            "kd" => self.diffuse = color(rest),
            "ks" => self.specular = color(rest),
            "ke" => self.emissive = color(rest),
            "ns" => self.exponent = number(),
            "pr" => self.roughness = number(),
            "pm" => self.metallic = number(),
            "d" => self.dissolve = opacity(rest),
            "tr" => self.transparency = number(),
            "illum" => self.illumination = rest.parse().ok(),
            _ if keyword.starts_with("map_") || keyword == "bump" || keyword == "norm" => {
                self.maps.insert(keyword.into_owned(), rest.to_owned());
            }
            _ => {}
        }
    }

    /// Opacity by `d` and `Tr`. By the format `Tr` is 1 − `d`, but some programs write `d` under both names, or 0 for
    /// both: of two statements, the more opaque one counts.
    fn alpha(&self) -> f32 {
        let by_transparency = self.transparency.map(|transparency| 1.0 - transparency);
        let opacities = [self.dissolve, by_transparency].into_iter().flatten();
        opacities.reduce(f32::max).unwrap_or(1.0).clamp(0.0, 1.0)
    }

    fn into_material(self, loader: &mut TextureLoader) -> Material {
        let is_black = |color: &[f32; 3]| color.iter().all(|&x| x < 0.01);
        let has_image = self.maps.contains_key("map_kd");
        let white = if has_image { [1.0; 3] } else { [0.8; 3] };
        let diffuse = self.diffuse.filter(|diffuse| !(has_image && is_black(diffuse))).unwrap_or(white);
        let specular = self.specular.unwrap_or([0.0; 3]);
        let is_metal = self.metallic.is_none() && is_black(&diffuse) && specular.iter().any(|&x| x > 0.2);
        let is_matte = matches!(self.illumination, Some(0 | 1)) || specular.iter().all(|&x| x == 0.0);
        let from_exponent = self.exponent.map(|ns| (2.0 / (ns.max(0.0) + 2.0)).powf(0.25));
        let roughness = self.roughness.or(if is_matte && !is_metal { Some(1.0) } else { from_exponent });
        let [r, g, b] = if is_metal { specular } else { diffuse };
        let alpha = self.alpha();
        let map = |keys: &[&str]| keys.iter().find_map(|&key| self.maps.get(key));

        let cut_out = map(&["map_d"]).filter(|_| !self.maps.contains_key("map_tr"));
        let (map_pr, map_pm) = (map(&["map_pr"]), map(&["map_pm"]));
        Material {
            base_color: [r, g, b, alpha],
            base_color_texture: match (map(&["map_kd"]), cut_out) {
                (Some(color), None) => loader.get(color, true),
                (color, Some(alpha)) => loader.with_alpha(color, alpha),
                (None, None) => None,
            },
            metallic: self.metallic.unwrap_or(if is_metal || map_pm.is_some() { 1.0 } else { 0.0 }).clamp(0.0, 1.0),
            roughness: if self.roughness.is_none() && map_pr.is_some() {
                1.0
            } else {
                roughness.unwrap_or(0.9).clamp(0.0, 1.0)
            },
            metallic_roughness_texture: loader.metallic_roughness(map_pm, map_pr),
            normal_texture: match map(&["norm", "map_kn"]) {
                Some(normal) => loader.get(normal, false),
                None => map(&["map_bump", "bump"]).and_then(|bump| loader.normal_map(bump)),
            },
            emissive: self.emissive.unwrap_or(if self.maps.contains_key("map_ke") { [1.0; 3] } else { [0.0; 3] }),
            emissive_texture: map(&["map_ke"]).and_then(|emissive| loader.get(emissive, true)),
            alpha_mode: match (cut_out, alpha < 1.0) {
                (Some(_), _) => AlphaMode::Mask { cutoff: 0.5 },
                (None, true) => AlphaMode::Blend,
                (None, false) => AlphaMode::Opaque,
            },
            name: self.name,
            ..Material::default()
        }
    }
}

/// Parses the argument of `d`: a number, after an optional `-halo`.
fn opacity(rest: &str) -> Option<f32> {
    let opacity: f32 = rest.split_ascii_whitespace().find(|&word| word != "-halo")?.parse().ok()?;
    opacity.is_finite().then_some(opacity)
}

/// Parses one or three numbers; negative and non-finite ones become 0.
fn color(rest: &str) -> Option<[f32; 3]> {
    let values: Vec<f32> = rest.split_ascii_whitespace().map_while(|w| w.parse().ok()).collect();
    let rgb = match values[..] {
        [grey] => [grey; 3],
        [r, g, b, ..] => [r, g, b],
        _ => return None,
    };
    Some(rgb.map(|x| if x.is_finite() { x.max(0.0) } else { 0.0 }))
}

/// Parsed arguments of a map statement.
struct MapArguments {
    file: String,
    reference: TextureRef,
}

impl MapArguments {
    /// Splits options (`-s 2 2 1`, `-o …`, `-clamp on`; others are skipped) from the file name, which may have spaces.
    fn parse(text: &str) -> Self {
        let (mut scale, mut offset) = ([1.0_f32; 2], [0.0_f32; 2]);
        let mut reference = TextureRef::new(0);
        let mut rest = text.trim();
        while let Some(option) = rest.strip_prefix('-') {
            let (name, after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
            rest = after.trim_start();
            let most = match name {
                "s" | "o" | "t" => 3,
                "mm" => 2,
                _ => 1,
            };
            let mut words: Vec<&str> = Vec::new();
            while words.len() < most {
                let (word, after) = rest.split_once(char::is_whitespace).unwrap_or((rest, ""));
                if most > 1 && word.parse::<f32>().is_err() {
                    break;
                }
                words.push(word);
                rest = after.trim_start();
                if rest.is_empty() {
                    break;
                }
            }
            let pair = |missing: f32| [0, 1].map(|i| words.get(i).and_then(|w| w.parse().ok()).unwrap_or(missing));
            match name {
                "s" => scale = pair(1.0),
                "o" => offset = pair(0.0),
                "clamp" if words == ["on"] => reference.wrap = [Wrap::Clamp; 2],
                _ => {}
            }
        }
        // MTL transforms coordinates with v up; ours is down.
        let matrix = [scale[0], 0.0, offset[0], 0.0, scale[1], 1.0 - scale[1] - offset[1]];
        if matrix.iter().all(|x| x.is_finite()) {
            reference.uv_transform = matrix;
        }
        Self { file: clean(rest.as_bytes()).into_owned(), reference }
    }
}

/// Identity of a texture: its image files and how they are combined.
#[derive(Clone, PartialEq, Eq, Hash)]
enum TextureKey {
    Plain { file: String, srgb: bool },
    WithAlpha { color: Option<String>, alpha: String },
    MetallicRoughness { metallic: Option<String>, roughness: Option<String> },
}

/// Loads textures; creates each one once.
struct TextureLoader<'a> {
    resolve: &'a Resolver<'a>,
    /// Texture indices; `None` for a texture that could not be created.
    known: HashMap<TextureKey, Option<usize>>,
    /// Image files already counted in the budget.
    counted: HashSet<String>,
    budget: TextureBudget,
    textures: Vec<Texture>,
    warnings: Vec<MeshWarning>,
}

impl TextureLoader<'_> {
    fn get(&mut self, arguments: &str, srgb: bool) -> Option<TextureRef> {
        let MapArguments { file, reference } = MapArguments::parse(arguments);
        let key = TextureKey::Plain { file: file.clone(), srgb };
        let texture = self.get_or_create(key, |loader| loader.load(&file, srgb))?;
        Some(TextureRef { texture, ..reference })
    }

    /// Returns the index of a texture; `None`, with a warning the first time, if it cannot be created.
    fn get_or_create(&mut self, key: TextureKey, make: impl FnOnce(&mut Self) -> Option<Texture>) -> Option<usize> {
        if let Some(&known) = self.known.get(&key) {
            return known;
        }
        let made = make(self).map(|texture| {
            self.textures.push(texture);
            self.textures.len() - 1
        });
        self.known.insert(key, made);
        made
    }

    fn load(&mut self, file: &str, srgb: bool) -> Option<Texture> {
        let texture = match (self.resolve)(file) {
            Ok(bytes) => {
                if self.counted.insert(file.to_owned()) {
                    self.budget.grow(bytes.len());
                }
                Texture::decode(file, &bytes, srgb, &mut self.budget).map_err(|error| error.to_string())
            }
            Err(error) => Err(error.to_string()),
        };
        texture.map_err(|reason| self.warn_ignored(file, &reason)).ok()
    }

    fn warn_ignored(&mut self, name: &str, reason: &str) {
        self.warnings.push(MeshWarning::texture(name, reason));
    }

    /// Creates a texture combined from other images, which counts towards the budget.
    fn combine(
        &mut self,
        name: &str,
        (width, height): (usize, usize),
        srgb: bool,
        pixel: impl FnMut(usize, usize) -> [u8; 4],
    ) -> Option<Texture> {
        if let Err(reason) = self.budget.spend(width * height) {
            self.warn_ignored(name, &reason);
            return None;
        }
        Some(Texture::from_image(Image::from_fn(width, height, pixel), srgb))
    }

    /// Returns a bump map that is really a normal map (mostly blue); a height map gives a warning.
    fn normal_map(&mut self, arguments: &str) -> Option<TextureRef> {
        let reference = self.get(arguments, false)?;
        let [r, g, b, _] = self.textures[reference.texture].levels.last()?.pixels()[0];
        if b > 160 && b > r.saturating_add(30) && b > g.saturating_add(30) {
            return Some(reference);
        }
        self.warnings.push(MeshWarning::BumpMap { map: arguments.to_owned() });
        None
    }

    /// Combines the colour of one image with alpha from the brightness of another.
    fn with_alpha(&mut self, color: Option<&String>, alpha: &str) -> Option<TextureRef> {
        let plain = color.and_then(|color| self.get(color, true));
        let MapArguments { file, reference } = MapArguments::parse(alpha);
        let color = plain.as_ref().and(color).map(|color| MapArguments::parse(color).file);
        let combined = self.get_or_create(TextureKey::WithAlpha { color, alpha: file.clone() }, |loader| {
            let mask = loader.load(&file, false)?;
            let mask = &mask.levels[0];
            let color = plain.as_ref().map(|plain| loader.textures[plain.texture].levels[0].clone());
            let (width, height) = color.as_ref().map_or((mask.width(), mask.height()), |c| (c.width(), c.height()));
            loader.combine(&file, (width, height), true, |x, y| {
                let [r, g, b, _] = color.as_ref().map_or([255; 4], |color| color[(x, y)]);
                [r, g, b, mask[(x * mask.width() / width, y * mask.height() / height)][0]]
            })
        });
        match combined {
            Some(texture) => Some(TextureRef { texture, ..plain.unwrap_or(reference) }),
            None => plain,
        }
    }

    /// Combines two grey images to glTF's channels: roughness in green, metalness in blue.
    fn metallic_roughness(&mut self, metallic: Option<&String>, roughness: Option<&String>) -> Option<TextureRef> {
        let reference = MapArguments::parse(roughness.or(metallic)?).reference;
        let [metallic, roughness] = [metallic, roughness].map(|text| text.map(|text| MapArguments::parse(text).file));
        let key = TextureKey::MetallicRoughness { metallic: metallic.clone(), roughness: roughness.clone() };
        let texture = self.get_or_create(key, |loader| {
            let [metallic, roughness] =
                [metallic, roughness].map(|file| file.and_then(|file| Some((loader.load(&file, false)?, file))));
            let (size, name) = roughness.as_ref().or(metallic.as_ref())?;
            let (width, height) = (size.levels[0].width(), size.levels[0].height());
            let sample = |texture: &Option<(Texture, String)>, x: usize, y: usize| {
                texture.as_ref().map_or(255, |(texture, _)| {
                    let image = &texture.levels[0];
                    image[(x * image.width() / width, y * image.height() / height)][0]
                })
            };
            loader.combine(name, (width, height), false, |x, y| {
                [255, sample(&roughness, x, y), sample(&metallic, x, y), 255]
            })
        })?;
        Some(TextureRef { texture, ..reference })
    }
}
