//! What each pixel sees first, beyond panes and mirrors.

use lo_geometry::Vec3;

use crate::View;
use crate::baked::BakedWorld;
use crate::traced_world::Surface;

/// Most panes and mirrors on the way of a view ray.
const MAX_MIRRORS: u32 = 8;

/// What one view ray sees.
#[derive(Clone, Copy)]
pub(crate) struct Seen {
    /// The surface to be lit, beyond panes and mirrors.
    pub surface: Option<Surface>,
    /// Share of its light that arrives.
    pub tint: Vec3,
    /// Light that needs no more work: sky, emission, reflections in panes.
    pub light: Vec3,
    /// Way from the eye to the surface.
    pub travelled_m: f32,
    /// Width of the pixel at the surface.
    pub footprint_m: f32,
    /// Of the first surface that is no clear pane, along the ray; 0 where there is none.
    pub distance_m: f32,
    pub direction: Vec3,
    /// World normal of that surface.
    pub normal: Vec3,
    pub albedo: Vec3,
    /// The first surface of all is a clear pane or a mirror.
    pub specular: bool,
}

/// Follows a view ray to the surface that is to be lit.
pub(crate) fn look(baked: &BakedWorld, view: &View, u: f32, v: f32) -> Seen {
    let world = baked.world();
    let mut ray = view.ray(u, v);
    let mut run = ray;
    let angle = view.pixel_angle_rad();
    let mut seen = Seen {
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
                seen.light += seen.tint * world.sky.radiance_with_sun(ray.direction);
            }
            return seen;
        };
        travelled_m += hit.distance_m;
        let surface = world.surface(&hit, &ray, travelled_m * angle);
        let mirror = surface.mirror.max_element() > 0.5 && !surface.pane;
        seen.specular |= step == 0 && (surface.pane || mirror);
        if !surface.pane && !first_found {
            first_found = true;
            seen.distance_m = travelled_m;
            seen.normal = surface.normal;
            seen.albedo = surface.base_color;
        }
        seen.light += seen.tint * surface.emission;
        let goes_through = surface.pass.max_element() > 0.5;
        if !goes_through && !mirror {
            seen.travelled_m = travelled_m;
            seen.footprint_m = travelled_m * angle;
            seen.surface = Some(surface);
            return seen;
        }
        seen.light += seen.tint * baked.scattered_from_cache(&surface);
        if goes_through {
            if surface.mirror != Vec3::ZERO {
                let reflection = baked.light_along(surface.ray(surface.mirrored()));
                seen.light += seen.tint * surface.mirror * reflection;
            }
            seen.tint *= surface.pass;
            ray = surface.ray(ray.direction);
        } else {
            seen.tint *= surface.mirror;
            ray = surface.ray(surface.mirrored());
            run = ray;
        }
    }
    seen
}

/// The plane that a pixel sees a bit of.
#[derive(Clone, Copy)]
pub(crate) struct Facet {
    pub position: Vec3,
    pub normal: Vec3,
}

impl Facet {
    pub(crate) fn of(surface: &Surface) -> Self {
        Self { position: surface.position, normal: surface.geometric_normal }
    }

    /// Whether light sampled at another one serves this one, which is `footprint_m` wide.
    #[inline]
    pub(crate) fn is_like(&self, footprint_m: f32, other: &Self) -> bool {
        let above = (other.position - self.position).dot(self.normal).abs();
        self.normal.dot(other.normal) > 0.9 && above < footprint_m + 2e-3
    }
}
