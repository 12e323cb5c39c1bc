//! Conversion of `KHR_materials_pbrSpecularGlossiness` to metallic-roughness, as published with the extension
//! (KhronosGroup/glTF, `extensions/2.0/Archived/KHR_materials_pbrSpecularGlossiness/examples`).

use super::material_json::SpecularGlossiness;
use super::texture_loader::TextureLoader;
use crate::{Material, MeshError, Texture, TextureRef};

/// Reflectance of dielectrics at normal incidence.
const DIELECTRIC: f32 = 0.04;

/// Brightness above [`DIELECTRIC`] up to which a specular colour is that of a dielectric.
const TOLERANCE: f32 = 1e-3;

/// Returns `material` with base colour, metalness and roughness of a specular-glossiness material.
///
/// Images are converted texel by texel, since metalness depends on both of them. If they have different texture
/// coordinates, each is combined with the mean of the other.
pub(super) fn convert(
    given: &SpecularGlossiness,
    material: Material,
    textures: &mut TextureLoader,
) -> Result<Material, MeshError> {
    let diffuse_texture = textures.optional(given.diffuse_texture.as_ref(), true)?;
    let specular_texture = textures.optional(given.specular_glossiness_texture.as_ref(), true)?;
    let [r, g, b, alpha] = given.diffuse_factor;
    let (base_color, metallic) = metallic_from_specular([r, g, b], given.specular_factor);
    let constant = Material {
        base_color: [base_color[0], base_color[1], base_color[2], alpha],
        metallic,
        roughness: 1.0 - given.glossiness_factor,
        ..material
    };
    let is_dielectric = brightness(given.specular_factor) <= DIELECTRIC + TOLERANCE;
    match (&diffuse_texture, &specular_texture) {
        (None, None) => Ok(constant),
        (Some(_), None) if is_dielectric => {
            let dimmed = given.diffuse_factor.map(|factor| factor * diffuse_share(given.specular_factor));
            let base_color = [dimmed[0].min(1.0), dimmed[1].min(1.0), dimmed[2].min(1.0), alpha];
            Ok(Material { base_color, base_color_texture: diffuse_texture, metallic: 0.0, ..constant })
        }
        _ => Ok(with_images(given, constant, [diffuse_texture, specular_texture], textures)),
    }
}

/// Returns `constant` with converted images.
fn with_images(
    given: &SpecularGlossiness,
    constant: Material,
    [diffuse, specular]: [Option<TextureRef>; 2],
    textures: &mut TextureLoader,
) -> Material {
    let images = Images { given, diffuse, specular };
    let place = |first: &Option<TextureRef>, second: &Option<TextureRef>| first.as_ref().or(second.as_ref()).cloned();
    let base_at = place(&images.diffuse, &images.specular);
    let rough_at = place(&images.specular, &images.diffuse);
    let mut compute = |at: Option<TextureRef>, srgb: bool, pixel: &dyn Fn(Texel) -> [u8; 4]| {
        let at = at?;
        let finest = &textures.textures[at.texture].levels[0];
        let (width, height) = (finest.width(), finest.height());
        let texture =
            textures.compute("of a specular-glossiness material", (width, height), srgb, |textures, x, y| {
                pixel(images.texel(textures, &at, [x, y], [width, height]))
            })?;
        Some(TextureRef { texture, ..at })
    };
    let code = |value: f32| (value * 255.0).round() as u8;
    let base_color_texture = compute(base_at, true, &|texel| {
        let ([r, g, b], _) = metallic_from_specular(texel.diffuse, texel.specular);
        let [r, g, b] = [r, g, b].map(lo_imaging::srgb8_from_linear);
        [r, g, b, code(texel.alpha)]
    });
    let metallic_roughness_texture = compute(rough_at, false, &|texel| {
        let (_, metallic) = metallic_from_specular(texel.diffuse, texel.specular);
        [255, code(1.0 - texel.glossiness), code(metallic), 255]
    });
    let [.., alpha] = constant.base_color;
    Material {
        // The factors are part of the computed textures.
        base_color: if base_color_texture.is_some() { [1.0, 1.0, 1.0, alpha] } else { constant.base_color },
        metallic: if metallic_roughness_texture.is_some() { 1.0 } else { constant.metallic },
        roughness: if metallic_roughness_texture.is_some() { 1.0 } else { constant.roughness },
        base_color_texture,
        metallic_roughness_texture,
        ..constant
    }
}

/// A specular-glossiness material with its images.
struct Images<'a> {
    given: &'a SpecularGlossiness,
    diffuse: Option<TextureRef>,
    specular: Option<TextureRef>,
}

/// Linear values of a material at one texel; alpha without its factor.
struct Texel {
    diffuse: [f32; 3],
    alpha: f32,
    specular: [f32; 3],
    glossiness: f32,
}

impl Images<'_> {
    /// Returns the values at a texel of an image of `size` that is placed as `at`.
    fn texel(&self, textures: &[Texture], at: &TextureRef, [x, y]: [usize; 2], [width, height]: [usize; 2]) -> Texel {
        let value = |reference: &Option<TextureRef>| {
            let Some(reference) = reference else { return [1.0; 4] };
            let levels = &textures[reference.texture].levels;
            let is_same_place = (reference.uv_set, reference.uv_transform) == (at.uv_set, at.uv_transform);
            let image = if is_same_place { &levels[0] } else { &levels[levels.len() - 1] };
            let [r, g, b, a] = image[(x * image.width() / width, y * image.height() / height)];
            let [r, g, b] = [r, g, b].map(lo_imaging::linear_from_srgb8);
            [r, g, b, f32::from(a) / 255.0]
        };
        let ([r, g, b, alpha], [sr, sg, sb, gloss]) = (value(&self.diffuse), value(&self.specular));
        let ([dr, dg, db, _], specular) = (self.given.diffuse_factor, self.given.specular_factor);
        Texel {
            diffuse: [r * dr, g * dg, b * db],
            alpha,
            specular: [sr * specular[0], sg * specular[1], sb * specular[2]],
            glossiness: gloss * self.given.glossiness_factor,
        }
    }
}

/// Converts linear diffuse and specular colours to a base colour and a metalness.
fn metallic_from_specular(diffuse: [f32; 3], specular: [f32; 3]) -> ([f32; 3], f32) {
    const LEAST: f32 = 1e-6;
    let scale = diffuse_share(specular);
    let metallic = metalness(brightness(diffuse) * scale, brightness(specular));
    let color = |channel: usize| {
        let of_diffuse = diffuse[channel] * scale / (1.0 - metallic).max(LEAST);
        let of_specular = (specular[channel] - DIELECTRIC * (1.0 - metallic)) / metallic.max(LEAST);
        (of_diffuse + (of_specular - of_diffuse) * metallic * metallic).clamp(0.0, 1.0)
    };
    ([0, 1, 2].map(color), metallic)
}

/// Returns the diffuse reflection relative to that of a dielectric of the same base colour.
fn diffuse_share(specular: [f32; 3]) -> f32 {
    (1.0 - specular.into_iter().fold(0.0, f32::max)) / (1.0 - DIELECTRIC)
}

/// Solves the quadratic equation for the metalness that gives both brightnesses. `diffuse` is scaled by
/// [`diffuse_share`].
fn metalness(diffuse: f32, specular: f32) -> f32 {
    if specular <= DIELECTRIC {
        return 0.0;
    }
    let b = diffuse + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let discriminant = (b * b - 4.0 * DIELECTRIC * c).max(0.0);
    ((discriminant.sqrt() - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

/// Perceived brightness of a linear colour, as in the published conversion.
fn brightness([r, g, b]: [f32; 3]) -> f32 {
    (0.299 * r * r + 0.587 * g * g + 0.114 * b * b).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_near(found: ([f32; 3], f32), color: [f32; 3], metallic: f32) {
        let difference =
            found.0.iter().zip(color).map(|(a, b)| (a - b).abs()).fold((found.1 - metallic).abs(), f32::max);
        assert!(difference < 1e-3, "{found:?} against {color:?}, {metallic}");
    }

    #[test]
    fn dielectrics_and_metals_keep_their_colour() {
        assert_near(metallic_from_specular([0.5, 0.25, 0.1], [0.04; 3]), [0.5, 0.25, 0.1], 0.0);
        // A metal has no diffuse reflection, and its specular colour is its base colour.
        assert_near(metallic_from_specular([0.0; 3], [1.0, 0.766, 0.336]), [1.0, 0.766, 0.336], 1.0);
        // The default of the extension, white and fully specular: a mirror.
        assert_near(metallic_from_specular([1.0; 3], [1.0; 3]), [1.0; 3], 1.0);
    }

    #[test]
    fn a_half_metal_is_the_one_that_gives_both_colours() {
        // Metallic-roughness to specular-glossiness: specular = lerp(0.04, base, m); diffuse = base · (1 − m) · 0.96
        // ÷ (1 − max(specular)), both grey.
        let (base, metallic) = (0.6_f32, 0.3_f32);
        let specular = 0.04 + (base - 0.04) * metallic;
        let diffuse = base * (1.0 - metallic) * 0.96 / (1.0 - specular);
        let (_, found) = metallic_from_specular([diffuse; 3], [specular; 3]);
        assert!((found - metallic).abs() < 1e-3, "{found}");
    }
}
