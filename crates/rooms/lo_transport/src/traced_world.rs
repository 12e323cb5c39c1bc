//! World prepared for ray casting: intersections, transmittance and materials.

use std::ops::ControlFlow;

use lo_bsdf::{DIELECTRIC_F0, Ggx, MIRROR_ROUGHNESS, fresnel, pane_reflectance, specular_albedo};
use lo_geometry::{Ray, Vec3};
use lo_mesh::{AlphaMode, Hit, Material, PreparedModel, offset_origin};

use crate::sky::{Sky, is_light};
use crate::{TransportError, World};

/// Largest absolute coordinate, so that nothing overflows.
const FARTHEST_M: f32 = 1e4;

/// Geometry, materials and sky.
pub(crate) struct TracedWorld {
    pub prepared: PreparedModel,
    pub sky: Sky,
    /// Per material: whether nothing passes straight through it.
    solid: Vec<bool>,
    /// Length beyond any distance within the model.
    pub far_m: f32,
}

/// Point of a surface with its material, as seen by a viewer on one side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceInteraction {
    pub position: Vec3,
    /// Triangle normal, towards the viewer.
    pub geometric_normal: Vec3,
    /// Shading normal, towards the viewer.
    pub normal: Vec3,
    /// Unit vector towards the viewer.
    pub view: Vec3,
    pub base_color: Vec3,
    /// Share of irradiance reflected diffusely to the viewer's side, below the specular layer.
    pub diffuse: Vec3,
    /// Share of the other side's irradiance transmitted diffusely to the viewer's side.
    pub through: Vec3,
    /// Specular reflectance at normal incidence. 0 for panes, which only have [`SurfaceInteraction::mirror`].
    pub f0: Vec3,
    pub roughness: f32,
    /// Share of light transmitted straight from behind.
    pub pass: Vec3,
    /// Share of light reflected from the mirrored direction.
    pub mirror: Vec3,
    /// Radiance emitted towards the viewer.
    pub emission: Vec3,
    /// Share of the area that the surface covers (alpha). All shares but [`SurfaceInteraction::f0`] include it.
    pub coverage: f32,
    /// Whether this is a clear pane.
    pub pane: bool,
    pub triangle: u32,
}

impl SurfaceInteraction {
    /// Returns the microfacet distribution of its gloss.
    pub(crate) fn ggx(&self) -> Ggx {
        Ggx::from_roughness(self.roughness)
    }

    /// Returns the glossy BRDF times the cosine of the light's direction, per steradian, without
    /// [`SurfaceInteraction::coverage`].
    pub(crate) fn gloss_cos(&self, light: Vec3) -> Vec3 {
        lo_bsdf::specular_cos(self.f0, self.ggx(), self.normal, self.view, light)
    }

    /// Returns the density per steradian with which [`Ggx::sample`] chooses a direction.
    pub(crate) fn gloss_pdf_per_sr(&self, light: Vec3) -> f32 {
        self.ggx().pdf_per_sr(self.normal, self.view, light)
    }

    /// Whether it has a glossy (non-mirror) specular reflection.
    pub(crate) fn is_glossy(&self) -> bool {
        self.f0 != Vec3::ZERO
    }

    /// Returns a ray that leaves the surface towards `direction`.
    pub(crate) fn ray(&self, direction: Vec3) -> Ray {
        let side = if direction.dot(self.geometric_normal) < 0.0 { -1.0 } else { 1.0 };
        Ray { origin: offset_origin(self.position, self.geometric_normal * side), direction }
    }

    /// Returns the mirrored view direction, kept on the viewer's side of the triangle.
    pub(crate) fn mirrored(&self) -> Vec3 {
        let direction = 2.0 * self.view.dot(self.normal) * self.normal - self.view;
        let below = direction.dot(self.geometric_normal).min(0.0);
        (direction - 2.0 * below * self.geometric_normal).normalize()
    }
}

impl TracedWorld {
    pub(crate) fn new(world: World) -> Result<Self, TransportError> {
        let sky = Sky::new(world.outdoors, &world.portals)?;
        let model = world.model;
        for (index, material) in model.materials.iter().enumerate() {
            if !is_light(material.emissive) {
                let (name, emissive) = (material.name.clone(), material.emissive);
                return Err(TransportError::Emission { index, name, emissive });
            }
        }
        let (vertices, materials) = (model.positions.len().min(model.normals.len()), model.materials.len());
        let usable = |vertex: u32| {
            (vertex as usize) < vertices
                && model.positions[vertex as usize].to_array().iter().all(|x| x.abs() <= FARTHEST_M)
        };
        for (index, triangle) in model.triangles.iter().enumerate() {
            let material = model.triangle_materials.get(index).is_some_and(|&m| (m as usize) < materials);
            if !(material && triangle.iter().all(|&vertex| usable(vertex))) {
                return Err(TransportError::Triangle { index });
            }
        }
        let solid = model.materials.iter().map(is_solid).collect();
        let prepared = PreparedModel::new(model);
        let size = prepared.bounds().size();
        let far_m = if size.is_finite() { size.length().max(1.0) * 4.0 + 2.0 * FARTHEST_M } else { 1.0 };
        Ok(Self { prepared, sky, solid, far_m })
    }

    pub(crate) fn hit(&self, ray: &Ray) -> Option<Hit> {
        self.prepared.intersect_both_sides(ray, self.far_m)
    }

    /// Returns the share of light transmitted straight along the ray within the distance.
    pub(crate) fn transmittance(&self, ray: &Ray, most_m: f32) -> Vec3 {
        let mut passed = Vec3::ONE;
        self.prepared.crossings(ray, most_m, |hit| {
            let material = self.prepared.model().triangle_materials[hit.triangle as usize] as usize;
            passed = if self.solid[material] { Vec3::ZERO } else { passed * self.interaction(hit, ray, 0.0).pass };
            if passed == Vec3::ZERO { ControlFlow::Break(()) } else { ControlFlow::Continue(most_m) }
        });
        passed
    }

    /// Evaluates the material at a hit. `footprint_m` is the width of the ray's footprint.
    pub(crate) fn interaction(&self, hit: &Hit, ray: &Ray, footprint_m: f32) -> SurfaceInteraction {
        let model = self.prepared.model();
        let material = &model.materials[model.triangle_materials[hit.triangle as usize] as usize];
        let point = model.surface(hit, ray.direction, footprint_m);
        let base = Vec3::from(point.base_color).clamp(Vec3::ZERO, Vec3::ONE);
        let view = -ray.direction;
        let cosine = point.shading_normal.dot(view).clamp(0.0, 1.0);
        let mut surface = SurfaceInteraction {
            position: point.position,
            geometric_normal: point.geometric_normal,
            normal: point.shading_normal,
            view,
            base_color: base,
            diffuse: Vec3::ZERO,
            through: Vec3::ZERO,
            f0: Vec3::ZERO,
            roughness: point.roughness,
            pass: Vec3::splat(1.0 - point.alpha),
            mirror: Vec3::ZERO,
            emission: Vec3::ZERO,
            coverage: point.alpha,
            pane: false,
            triangle: hit.triangle,
        };
        if point.unlit {
            surface.emission = base * point.alpha;
            return surface;
        }
        if self.gives_off(hit.triangle, point.geometric_normal) {
            surface.emission = Vec3::from(point.emissive) * point.alpha;
        }
        let clear = if point.metallic < 1.0 { material.transmission.clamp(0.0, 1.0) } else { 0.0 };
        // Share of the light that passes the specular layer and is not absorbed by metal.
        let mut below = base * ((1.0 - point.metallic) * point.alpha);
        if clear > 0.0 {
            let reflected = pane_reflectance(cosine);
            surface.mirror = Vec3::splat(reflected * point.alpha);
            below *= 1.0 - reflected;
            surface.pass += below * clear;
            surface.pane = clear > 0.5;
        } else {
            let f0 = Vec3::splat(DIELECTRIC_F0).lerp(base, point.metallic);
            below *= 1.0 - specular_albedo(Vec3::splat(DIELECTRIC_F0), point.roughness, cosine).x;
            if point.roughness < MIRROR_ROUGHNESS {
                surface.mirror = fresnel(f0, cosine) * point.alpha;
            } else if point.alpha > 0.0 {
                surface.f0 = f0;
            }
        }
        let scattered = below * (1.0 - clear);
        let share = material.diffuse_transmission.clamp(0.0, 1.0);
        surface.diffuse = scattered * (1.0 - share);
        surface.through = scattered * share;
        surface
    }

    /// Whether a triangle has an emissive material.
    pub(crate) fn is_lamp(&self, triangle: u32) -> bool {
        let model = self.prepared.model();
        model.materials[model.triangle_materials[triangle as usize] as usize].emissive != [0.0; 3]
    }

    /// Whether a triangle emits on the side of `normal`.
    pub(crate) fn gives_off(&self, triangle: u32, normal: Vec3) -> bool {
        let model = self.prepared.model();
        let material = &model.materials[model.triangle_materials[triangle as usize] as usize];
        if material.emissive == [0.0; 3] {
            return false;
        }
        let [a, b, c] = model.triangles[triangle as usize].map(|v| model.positions[v as usize]);
        material.double_sided || (b - a).cross(c - a).dot(normal) > 0.0
    }
}

fn is_solid(material: &Material) -> bool {
    material.alpha_mode == AlphaMode::Opaque && (material.transmission <= 0.0 || material.metallic >= 1.0)
}
