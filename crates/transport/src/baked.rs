use std::f32::consts::PI;

use geometry::{Ray, Vec3};

use crate::bake::Cache;
use crate::points::SurfacePoints;
use crate::scene::{Scene, Surface};
use crate::{BakeSettings, Rendering, TransportError, View, World, bsdf, points, render};

/// A world with the light on all its surfaces.
pub struct BakedWorld {
    scene: Scene,
    cache: Cache,
    settings: BakeSettings,
}

/// What a ray leaves out because light samples bring it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sampled {
    /// Sees all, the sun's disc too.
    Nothing,
    /// Lamps and sun.
    Lamps,
    /// Lamps, sun, portals and sheets lit from behind.
    All,
}

impl BakedWorld {
    /// Spreads points over all surfaces and finds the light that falls on them. The result is the same to the bit for
    /// every number of threads.
    ///
    /// # Errors
    /// See [`TransportError`].
    pub fn bake(world: World, settings: &BakeSettings) -> Result<Self, TransportError> {
        settings.check()?;
        let scene = Scene::new(world)?;
        let cache = Cache::bake(&scene, settings)?;
        Ok(Self { scene, cache, settings: settings.clone() })
    }

    /// Renders a view: light of lamps, sky and sun is sampled at each pixel, all other light on matte surfaces comes
    /// from the cache, gloss and mirrors are traced.
    pub fn render(&self, view: &View) -> Rendering {
        render::render(self, view)
    }

    /// The model, ready for rays.
    pub fn prepared(&self) -> &mesh::PreparedModel {
        &self.scene.prepared
    }

    /// Radiance leaving all surfaces that light reaches, both sides of thin sheets, as the mean over the directions of
    /// each side. Every octree leaf of edge `leaf_m` that such a surface crosses holds a point, but for corners that it
    /// barely touches.
    pub fn radiance_points(&self, leaf_m: f32) -> SurfacePoints {
        points::spread(self, leaf_m)
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    pub(crate) fn cache(&self) -> &Cache {
        &self.cache
    }

    pub(crate) fn settings(&self) -> &BakeSettings {
        &self.settings
    }

    /// Light that leaves a surface towards the viewer without being mirrored or passed straight on, all from the cache.
    pub(crate) fn scattered_from_cache(&self, surface: &Surface) -> Vec3 {
        if surface.diffuse == Vec3::ZERO && surface.through == Vec3::ZERO && !surface.is_glossy() {
            return Vec3::ZERO;
        }
        let cache = &self.cache;
        let near = cache.surfels.near(surface.position, surface.geometric_normal, cache.surfels.part(surface.triangle));
        let arriving = near.mean(|surfel| cache.direct[surfel] + cache.indirect[surfel]);
        let gloss = if surface.is_glossy() {
            let cosine = surface.normal.dot(surface.view);
            bsdf::specular_albedo(surface.f0, surface.roughness, cosine) * surface.coverage
        } else {
            Vec3::ZERO
        };
        let mut light = arriving * (surface.diffuse + gloss);
        if surface.through != Vec3::ZERO {
            light += surface.through * near.mean(|surfel| cache.behind[surfel]);
        }
        light / PI
    }

    /// Radiance that arrives along a ray, from the cache, without what is sampled as a light elsewhere.
    pub(crate) fn light_along(&self, mut ray: Ray, sampled: Sampled) -> Vec3 {
        const MOST_MIRRORS: u32 = 6;
        let (mut light, mut tint, mut straight) = (Vec3::ZERO, Vec3::ONE, true);
        let mut run = ray;
        for _ in 0..MOST_MIRRORS {
            let Some(hit) = self.scene.hit(&ray) else {
                let sky = &self.scene.sky;
                if !sky.is_open(&run, self.scene.far_m) {
                    return light;
                }
                if sampled == Sampled::Nothing {
                    light += tint * sky.radiance_with_sun(ray.direction);
                } else if !(sampled == Sampled::All && straight && !sky.portals.is_empty()) {
                    light += tint * sky.radiance(ray.direction);
                }
                return light;
            };
            let surface = self.scene.surface(&hit, &ray, hit.distance_m * 0.005);
            if sampled == Sampled::Nothing || !straight {
                light += tint * surface.emission;
            }
            light += tint * self.scattered_from_cache(&surface);
            if sampled == Sampled::All && straight && surface.emission == Vec3::ZERO {
                // The light of sheets, which the cache knows too.
                let emitters = &self.cache.lighting.emitters;
                let sheet = emitters.of(&hit).map(|e| emitters.radiance(e, surface.geometric_normal));
                light -= tint * sheet.unwrap_or_default();
            }
            // The stronger way is followed; the weaker one is left out where it is weak.
            if surface.pass.max_element() >= surface.mirror.max_element() {
                tint *= surface.pass;
                ray = surface.ray(ray.direction);
            } else {
                tint *= surface.mirror;
                ray = surface.ray(surface.mirrored());
                run = ray;
                straight = false;
            }
            if tint.max_element() < 1e-3 {
                break;
            }
        }
        light
    }
}
