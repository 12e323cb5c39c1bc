use lo_bsdf::dielectric_f0;
use lo_geometry::Vec3;

use crate::repair::face_normal;
use crate::{AlphaMode, Hit, Material, Model, TextureRef, Volume};

/// Material and normals at a point of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePoint {
    /// Position, in model or world units.
    pub position: Vec3,
    /// Unit normal of the triangle, facing the viewer.
    pub geometric_normal: Vec3,
    /// Unit normal from vertex normals and normal texture, facing the viewer.
    pub shading_normal: Vec3,
    /// Base colour, linear RGB.
    pub base_color: [f32; 3],
    /// Coverage in [0, 1], by the material's alpha mode.
    pub alpha: f32,
    /// Share of the light not reflected at the surface that passes through it.
    pub transmission: f32,
    /// Interior of a solid, which refracts.
    pub volume: Option<Volume>,
    /// Index of refraction.
    pub ior: f32,
    /// Reflectance at normal incidence where it is not metal, linear RGB.
    pub dielectric_f0: [f32; 3],
    /// Strength of the clear coat, from 0 to 1.
    pub clearcoat: f32,
    /// Perceptual roughness of the clear coat.
    pub clearcoat_roughness: f32,
    /// Colour of the sheen, linear RGB.
    pub sheen: [f32; 3],
    /// Perceptual roughness of the sheen.
    pub sheen_roughness: f32,
    /// Whether the viewer sees the triangle's front, which is the outside of a solid.
    pub is_front: bool,
    /// Metalness, from 0 to 1.
    pub metallic: f32,
    /// Perceptual roughness, from 0 to 1.
    pub roughness: f32,
    /// Ambient occlusion, from 0 to 1.
    pub occlusion: f32,
    /// Emitted radiance, linear RGB.
    pub emissive: [f32; 3],
    /// Whether the base colour is shown without lighting.
    pub unlit: bool,
}

/// Smallest cosine of the shading normal with the direction to the viewer and with the geometric normal.
const MIN_COSINE: f32 = 1e-3;

impl Model {
    /// Returns material and normals at a hit, in model coordinates.
    ///
    /// `direction` is the ray's unit direction. `footprint` is the width of the ray's footprint in model units (pixel
    /// width times distance), over which textures are averaged; 0 takes the finest mip level.
    ///
    /// # Panics
    /// If `hit` is not one of this model.
    pub fn surface(&self, hit: &Hit, direction: Vec3, footprint: f32) -> SurfacePoint {
        let point = self.point(hit);
        let points = point.vertices.map(|v| self.positions[v]);
        let face = face_normal(points);
        let cosine = -face.dot(direction);
        let side = if cosine < 0.0 { -1.0 } else { 1.0 };
        let material = &self.materials[self.triangle_materials[hit.triangle as usize] as usize];
        let detail = TextureDetail { world_area: triangle_area(points), footprint, cosine: cosine.abs() };
        let color = self.color(&point, material, Some(&detail));
        let [_, green, blue, _] = self.texture(&point, &material.metallic_roughness_texture, Some(&detail));
        let [red, ..] = self.texture(&point, &material.occlusion_texture, Some(&detail));
        let emission = self.texture(&point, &material.emissive_texture, Some(&detail));
        let normal = self.normal(&point, material, face, &detail) * side;
        let geometric_normal = face * side;
        SurfacePoint {
            position: interpolate_vec3(&point, points),
            geometric_normal,
            shading_normal: towards_viewer(normal, geometric_normal, -direction),
            base_color: [color[0], color[1], color[2]],
            alpha: coverage(material.alpha_mode, color[3]),
            transmission: material.transmission,
            volume: material.volume,
            ior: material.ior,
            dielectric_f0: material.specular.map(|factor| (factor * dielectric_f0(material.ior)).min(1.0)),
            clearcoat: material.clearcoat,
            clearcoat_roughness: material.clearcoat_roughness,
            sheen: material.sheen,
            sheen_roughness: material.sheen_roughness,
            is_front: side > 0.0,
            metallic: (material.metallic * blue).clamp(0.0, 1.0),
            roughness: (material.roughness * green).clamp(0.0, 1.0),
            occlusion: 1.0 + material.occlusion_strength * (red - 1.0),
            emissive: std::array::from_fn(|c| material.emissive[c] * emission[c]),
            unlit: material.unlit,
        }
    }

    /// Returns the coverage of the surface at a hit, from the finest mip level: 0 is transparent, 1 opaque.
    ///
    /// # Panics
    /// If `hit` is not one of this model.
    pub fn alpha(&self, hit: &Hit) -> f32 {
        let material = &self.materials[self.triangle_materials[hit.triangle as usize] as usize];
        if material.alpha_mode == AlphaMode::Opaque {
            return 1.0;
        }
        coverage(material.alpha_mode, self.color(&self.point(hit), material, None)[3])
    }

    fn point(&self, hit: &Hit) -> BarycentricPoint {
        let [v, w] = hit.barycentric;
        BarycentricPoint {
            vertices: self.triangles[hit.triangle as usize].map(|v| v as usize),
            weights: [1.0 - v - w, v, w],
        }
    }

    /// Base colour and alpha: factor × texture × vertex colour.
    fn color(&self, point: &BarycentricPoint, material: &Material, detail: Option<&TextureDetail>) -> [f32; 4] {
        let texture = self.texture(point, &material.base_color_texture, detail);
        let vertex =
            if self.colors.is_empty() { [1.0; 4] } else { interpolate(point, point.vertices.map(|v| self.colors[v])) };
        std::array::from_fn(|c| material.base_color[c] * texture[c] * vertex[c])
    }

    /// Value of a texture at a point; 1 without a texture.
    fn texture(
        &self,
        point: &BarycentricPoint,
        reference: &Option<TextureRef>,
        detail: Option<&TextureDetail>,
    ) -> [f32; 4] {
        let Some(reference) = reference else {
            return [1.0; 4];
        };
        let uvs = point.vertices.map(|v| {
            let uv = self.uvs.get(reference.uv_set).and_then(|set| set.get(v));
            reference.transform(uv.copied().unwrap_or_default())
        });
        let uv = interpolate(point, uvs);
        let Some(texture) = self.textures.get(reference.texture) else {
            return [1.0; 4];
        };
        let finest = &texture.levels[0];
        let texels = (finest.width() * finest.height()) as f32;
        let level = detail.map_or(0.0, |detail| detail.level(uv_area(uvs) * texels));
        texture.sample(uv, reference.wrap, level, reference.nearest)
    }

    /// Unit normal on the front side.
    fn normal(&self, point: &BarycentricPoint, material: &Material, face: Vec3, detail: &TextureDetail) -> Vec3 {
        let smooth = interpolate_vec3(point, point.vertices.map(|v| self.normals[v])).normalize_or(face);
        if material.normal_texture.is_none() || self.tangents.is_empty() {
            return smooth;
        }
        let tangents = point.vertices.map(|v| self.tangents[v]);
        let along = interpolate_vec3(point, tangents.map(|[x, y, z, _]| Vec3::new(x, y, z)));
        let tangent = (along - smooth * smooth.dot(along)).normalize_or_zero();
        if tangent == Vec3::ZERO {
            return smooth;
        }
        let bitangent = smooth.cross(tangent) * tangents[0][3];
        let [r, g, b, _] = self.texture(point, &material.normal_texture, Some(detail)).map(|x| x * 2.0 - 1.0);
        let bent = tangent * (r * material.normal_scale) + bitangent * (g * material.normal_scale) + smooth * b;
        bent.normalize_or(smooth)
    }
}

/// A point of a triangle: vertex indices and barycentric weights.
struct BarycentricPoint {
    vertices: [usize; 3],
    weights: [f32; 3],
}

fn interpolate_vec3(point: &BarycentricPoint, values: [Vec3; 3]) -> Vec3 {
    values[0] * point.weights[0] + values[1] * point.weights[1] + values[2] * point.weights[2]
}

fn interpolate<const N: usize>(point: &BarycentricPoint, values: [[f32; N]; 3]) -> [f32; N] {
    std::array::from_fn(|c| (0..3).map(|k| values[k][c] * point.weights[k]).sum())
}

/// Size of a triangle and of the ray's footprint on it, to select the mip level.
struct TextureDetail {
    world_area: f32,
    footprint: f32,
    cosine: f32,
}

impl TextureDetail {
    /// Selects the mip level by ray cones (Akenine-Möller et al. 2019, Ray Tracing Gems ch. 20, eq. 34).
    fn level(&self, texel_area: f32) -> f32 {
        if self.footprint <= 0.0 || texel_area <= 0.0 {
            return 0.0;
        }
        // Texels per model unit times the footprint, which a slanted surface stretches.
        let texels = (texel_area / self.world_area).sqrt() * self.footprint / self.cosine.max(0.05);
        texels.log2().max(0.0)
    }
}

fn triangle_area([a, b, c]: [Vec3; 3]) -> f32 {
    let [a, b, c] = [a, b, c].map(Vec3::as_dvec3);
    ((b - a).cross(c - a).length() * 0.5).max(f64::from(f32::MIN_POSITIVE)) as f32
}

fn uv_area([a, b, c]: [[f32; 2]; 3]) -> f32 {
    ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs() * 0.5
}

/// Share of light that the surface blocks.
fn coverage(mode: AlphaMode, alpha: f32) -> f32 {
    match mode {
        AlphaMode::Opaque => 1.0,
        AlphaMode::Mask { cutoff } => {
            if alpha >= cutoff {
                1.0
            } else {
                0.0
            }
        }
        AlphaMode::Blend => alpha.clamp(0.0, 1.0),
    }
}

/// Bends the normal as little as needed to face the viewer and stay on the geometric normal's side.
fn towards_viewer(normal: Vec3, geometric: Vec3, to_viewer: Vec3) -> Vec3 {
    let mut bent = normal;
    for axis in [geometric, to_viewer] {
        let cosine = bent.dot(axis);
        if cosine < MIN_COSINE {
            bent = (bent + axis * (MIN_COSINE - cosine)).normalize_or(geometric);
        }
    }
    if bent.dot(geometric) > 0.0 { bent } else { geometric }
}

#[cfg(test)]
#[path = "surface_tests.rs"]
mod tests;
