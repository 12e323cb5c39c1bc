use std::f32::consts::PI;

use lo_geometry::{Ray, Vec3};

use crate::bake::SurfaceCache;
use crate::traced_world::{SurfaceInteraction, TracedWorld};
use crate::{BakeSettings, TransportError, World};

/// World with baked light on all its surfaces.
pub struct BakedWorld {
    world: TracedWorld,
    cache: SurfaceCache,
    settings: BakeSettings,
}

impl BakedWorld {
    /// Distributes cache points over all surfaces and computes the light that reaches them. The result is bitwise
    /// identical for every number of threads.
    ///
    /// # Errors
    /// See [`TransportError`].
    pub fn bake(world: World, settings: &BakeSettings) -> Result<Self, TransportError> {
        settings.check()?;
        let world = TracedWorld::new(world)?;
        let cache = SurfaceCache::bake(&world, settings)?;
        Ok(Self { world, cache, settings: *settings })
    }

    /// Returns the model, prepared for ray casting.
    pub fn prepared(&self) -> &lo_mesh::PreparedModel {
        &self.world.prepared
    }

    pub(crate) fn world(&self) -> &TracedWorld {
        &self.world
    }

    pub(crate) fn cache(&self) -> &SurfaceCache {
        &self.cache
    }

    pub(crate) fn settings(&self) -> &BakeSettings {
        &self.settings
    }

    /// Returns the light scattered by a surface towards the viewer, from the cache alone. Mirror reflections and
    /// straight transmission are excluded.
    pub(crate) fn scattered_from_cache(&self, surface: &SurfaceInteraction) -> Vec3 {
        if surface.diffuse == Vec3::ZERO && surface.through == Vec3::ZERO && !surface.is_glossy() {
            return Vec3::ZERO;
        }
        let cache = &self.cache;
        let near =
            cache.surfels.near(surface.position, surface.geometric_normal, cache.surfels.component(surface.triangle));
        let arriving = near.mean(|surfel| cache.direct[surfel] + cache.indirect[surfel]);
        let gloss = if surface.is_glossy() {
            let cosine = surface.normal.dot(surface.view);
            lo_bsdf::specular_albedo(surface.f0, surface.roughness, cosine) * surface.coverage
        } else {
            Vec3::ZERO
        };
        let mut light = arriving * (surface.diffuse + gloss);
        if surface.through != Vec3::ZERO {
            light += surface.through * near.mean(|surfel| cache.behind[surfel]);
        }
        light / PI
    }

    /// Returns the radiance along a ray, including the sun's disc. Light on matte surfaces comes from the cache.
    pub(crate) fn light_along(&self, ray: Ray) -> Vec3 {
        self.follow(ray, true, |_, _| 1.0)
    }

    /// Returns the radiance along a ray that is combined with light samples. Of an emitter straight ahead only `share`
    /// counts, given the emitter and its solid angle per area. The sun's disc is excluded.
    pub(crate) fn light_beside_samples(&self, ray: Ray, share: impl Fn(u32, f32) -> f32) -> Vec3 {
        self.follow(ray, false, share)
    }

    fn follow(&self, mut ray: Ray, with_sun: bool, share: impl Fn(u32, f32) -> f32) -> Vec3 {
        const MAX_MIRRORS: u32 = 6;
        let start = ray.origin;
        let sr_per_m2 = |point: Vec3, cosine: f32| cosine / point.distance_squared(start).max(1e-12);
        let (sky, emitters) = (&self.world.sky, &self.cache.lighting.emitters);
        let (mut light, mut tint, mut straight) = (Vec3::ZERO, Vec3::ONE, true);
        let mut run = ray;
        for _ in 0..MAX_MIRRORS {
            let Some(hit) = self.world.hit(&ray) else {
                let portal = sky.portal_crossing(&run, self.world.far_m);
                if portal.is_none() && !sky.portals.is_empty() {
                    return light;
                }
                let emitter = portal.filter(|_| straight).and_then(|(at, crossing)| {
                    Some((emitters.of_portal(at, crossing.along)?, sr_per_m2(crossing.position, crossing.cosine)))
                });
                let own = emitter.map_or(1.0, |(emitter, sr_per_m2)| share(emitter, sr_per_m2));
                let sun = if with_sun { sky.sun_radiance(ray.direction) } else { Vec3::ZERO };
                return light + tint * (sky.radiance(ray.direction) * own + sun);
            };
            let surface = self.world.interaction(&hit, &ray, hit.distance_m * 0.005);
            let own = emitters.of(&hit).filter(|_| straight).map(|emitter| {
                let facing = surface.geometric_normal.dot(ray.direction).abs();
                (emitter, share(emitter, sr_per_m2(surface.position, facing)))
            });
            light += tint * (surface.emission * own.map_or(1.0, |(_, share)| share));
            light += tint * self.scattered_from_cache(&surface);
            if let Some((emitter, share)) = own.filter(|_| surface.emission == Vec3::ZERO) {
                // The cache contains the light of sheets too.
                light -= tint * emitters.radiance(emitter, surface.geometric_normal) * (1.0 - share);
            }
            // Follows the stronger of transmission and reflection; the weaker one is neglected.
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
