//! G-buffer: the first surface seen by each pixel beyond panes and mirrors.

use lo_geometry::Vec3;

use crate::View;
use crate::baked::BakedWorld;
use crate::traced_world::SurfaceInteraction;

/// Maximum number of panes and mirrors along a view ray.
const MAX_MIRRORS: u32 = 8;

/// Result of one view ray.
#[derive(Clone, Copy)]
pub(crate) struct GBufferSample {
    /// Surface to be shaded, beyond panes and mirrors.
    pub surface: Option<SurfaceInteraction>,
    /// Share of its light that reaches the eye.
    pub tint: Vec3,
    /// Radiance that needs no shading: sky, emission, reflections in panes.
    pub light: Vec3,
    /// Path length from the eye to the surface.
    pub travelled_m: f32,
    /// Width of the pixel at the surface.
    pub footprint_m: f32,
    /// Distance along the ray to the first surface that is not a clear pane. 0 where there is none.
    pub distance_m: f32,
    pub direction: Vec3,
    /// World normal of that surface.
    pub normal: Vec3,
    pub albedo: Vec3,
    /// Whether the very first surface is a clear pane or a mirror.
    pub specular: bool,
}

/// Traces a view ray to the surface to be shaded.
pub(crate) fn trace_view_ray(baked: &BakedWorld, view: &View, u: f32, v: f32) -> GBufferSample {
    let world = baked.world();
    let mut ray = view.ray(u, v);
    let mut run = ray;
    let angle = view.pixel_angle_rad();
    let mut sample = GBufferSample {
        surface: None,
        tint: Vec3::ONE,
        light: Vec3::ZERO,
        travelled_m: 0.0,
        footprint_m: 0.0,
        distance_m: 0.0,
        direction: ray.direction,
        normal: Vec3::ZERO,
        albedo: Vec3::ZERO,
        specular: false,
    };
    let (mut travelled_m, mut first_found) = (0.0, false);
    for step in 0..MAX_MIRRORS {
        let Some(hit) = world.hit(&ray) else {
            if world.sky.is_open(&run, world.far_m) {
                sample.light += sample.tint * world.sky.radiance_with_sun(ray.direction);
            }
            return sample;
        };
        travelled_m += hit.distance_m;
        let surface = world.interaction(&hit, &ray, travelled_m * angle);
        let mirror = surface.mirror.max_element() > 0.5 && !surface.pane;
        sample.specular |= step == 0 && (surface.pane || mirror);
        if !surface.pane && !first_found {
            first_found = true;
            sample.distance_m = travelled_m;
            sample.normal = surface.normal;
            sample.albedo = surface.base_color;
        }
        sample.light += sample.tint * surface.emission;
        let goes_through = surface.pass.max_element() > 0.5;
        if !goes_through && !mirror {
            sample.travelled_m = travelled_m;
            sample.footprint_m = travelled_m * angle;
            sample.surface = Some(surface);
            return sample;
        }
        sample.light += sample.tint * baked.scattered_from_cache(&surface);
        if goes_through {
            if surface.mirror != Vec3::ZERO {
                let reflection = baked.light_along(surface.ray(surface.mirrored()));
                sample.light += sample.tint * surface.mirror * reflection;
            }
            sample.tint *= surface.pass;
            ray = surface.ray(ray.direction);
        } else {
            sample.tint *= surface.mirror;
            ray = surface.ray(surface.mirrored());
            run = ray;
        }
    }
    sample
}

/// Plane of the surface seen by a pixel.
#[derive(Clone, Copy)]
pub(crate) struct Facet {
    pub position: Vec3,
    pub normal: Vec3,
}

impl Facet {
    pub(crate) fn of(surface: &SurfaceInteraction) -> Self {
        Self { position: surface.position, normal: surface.geometric_normal }
    }

    /// Whether light sampled on another facet can be reused for this one, whose pixel is `footprint_m` wide.
    #[inline]
    pub(crate) fn is_like(&self, footprint_m: f32, other: &Self) -> bool {
        let above = (other.position - self.position).dot(self.normal).abs();
        self.normal.dot(other.normal) > 0.9 && above < footprint_m + 2e-3
    }
}
