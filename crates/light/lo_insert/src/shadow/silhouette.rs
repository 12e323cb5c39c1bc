//! The object seen from each light sample, as small shadow maps (Williams 1978, filtered as in Reeves et al. 1987).
//!
//! They move with the object, so that the shadow of one sample has a soft edge that glides over real surfaces instead
//! of hiding one point after the other.

use lo_geometry::{Ray, Vec3, orthonormal_basis};
use lo_mesh::Hit;
use rayon::prelude::*;

use crate::light::samples::{LightSample, Lights, Origin};
use crate::objects::object::Object;

/// Smallest distance of a light from the object for which a map is used, as a multiple of the object's radius.
const NEAREST: f32 = 1.5;

/// Shadow maps of the light samples of every pattern of [`Lights::subset`].
pub(crate) struct Silhouettes {
    /// Maps by pattern and index in its subset; `None` if rays are to be cast.
    maps: Vec<Vec<Option<ShadowMap>>>,
}

struct ShadowMap {
    origin: Origin,
    centre_m: Vec3,
    /// Unit vectors across the map, and from the object to the light.
    right: Vec3,
    up: Vec3,
    towards: Vec3,
    /// Distance from the light to the plane of the map, for lights at finite distance.
    distance_m: f32,
    half_width_m: f32,
    side: usize,
    /// Surfaces that each texel's ray meets.
    texels: Vec<Texel>,
    bias_m: f32,
}

/// Surfaces that a light's ray meets.
#[derive(Clone, Copy)]
struct Texel {
    /// Distance of the nearest surface that blocks it; infinite outside of the object.
    nearest_m: f32,
    /// Distance of the nearest glass.
    glass_m: f32,
    /// Share of the light that passes all glass, linear RGB.
    passed: Vec3,
}

impl Silhouettes {
    /// Renders maps of `side` × `side` texels for `count` samples in each of `patterns`; none if `side` is 0.
    pub fn new(lights: &Lights, count: usize, patterns: usize, object: &Object, side: usize) -> Self {
        if side == 0 {
            return Self { maps: Vec::new() };
        }
        let of_pattern = |pattern| {
            lights.subset(count, pattern, patterns).map(|sample| ShadowMap::new(&sample, object, side)).collect()
        };
        Self { maps: (0..patterns).into_par_iter().map(of_pattern).collect() }
    }

    /// Returns the share of the light of sample `index` of a pattern that the object blocks at a point, linear RGB;
    /// `None` if a ray must be cast.
    pub fn blocked(&self, pattern: usize, index: usize, point: Vec3) -> Option<Vec3> {
        self.maps.get(pattern)?.get(index)?.as_ref().map(|map| map.blocked(point))
    }
}

impl ShadowMap {
    /// Returns `None` for a light inside or very near the object.
    fn new(sample: &LightSample, object: &Object, side: usize) -> Option<Self> {
        let (origin, radius_m) = (sample.origin(), object.radius_m);
        let (towards, distance_m, half_width_m) = match origin {
            Origin::Infinity(direction) => (direction, 0.0, radius_m),
            Origin::Point(position) => {
                let offset = position - object.centre_m;
                let distance_m = offset.length();
                if distance_m < NEAREST * radius_m {
                    return None;
                }
                let sin = radius_m / distance_m;
                (offset / distance_m, distance_m, radius_m / (1.0 - sin * sin).sqrt())
            }
        };
        let basis = orthonormal_basis(towards);
        let mut map = Self {
            origin,
            centre_m: object.centre_m,
            right: basis.x_axis,
            up: basis.y_axis,
            towards,
            distance_m,
            half_width_m,
            side,
            texels: Vec::new(),
            bias_m: 1e-3 * radius_m,
        };
        let texel = |i: usize| {
            let at = |k: usize| ((k as f32 + 0.5) / side as f32 * 2.0 - 1.0) * half_width_m;
            let target = map.centre_m + map.right * at(i % side) + map.up * at(i / side);
            let ray = match origin {
                Origin::Infinity(_) => Ray { origin: target + towards * (2.0 * radius_m), direction: -towards },
                Origin::Point(position) => Ray { origin: position, direction: (target - position).normalize() },
            };
            let distance_m = |hit: Option<Hit>| {
                hit.map_or(f32::INFINITY, |hit| match origin {
                    Origin::Infinity(_) => hit.distance_m - 2.0 * radius_m,
                    Origin::Point(_) => hit.distance_m,
                })
            };
            let nearest_m = distance_m(object.closest(&ray, f32::INFINITY));
            if !object.is_glass {
                return Texel { nearest_m, glass_m: f32::INFINITY, passed: Vec3::ONE };
            }
            let passed = object.passed(&ray, f32::INFINITY).share;
            Texel { nearest_m, glass_m: distance_m(object.first(&ray, f32::INFINITY)), passed }
        };
        map.texels = (0..side * side).map(texel).collect();
        Some(map)
    }

    fn blocked(&self, point: Vec3) -> Vec3 {
        let (offset, along_m, scale) = match self.origin {
            Origin::Infinity(_) => {
                let offset = point - self.centre_m;
                (offset, -offset.dot(self.towards), 1.0)
            }
            Origin::Point(position) => {
                let offset = point - position;
                let depth_m = -offset.dot(self.towards);
                if depth_m <= 0.0 {
                    return Vec3::ZERO;
                }
                (offset, offset.length(), self.distance_m / depth_m)
            }
        };
        let texel = |along: Vec3| (offset.dot(along) * scale / self.half_width_m * 0.5 + 0.5) * self.side as f32 - 0.5;
        let (x, y) = (texel(self.right), texel(self.up));
        let limit = self.side as f32;
        if !(x > -1.0 && y > -1.0 && x < limit && y < limit) {
            return Vec3::ZERO;
        }
        let (left, top) = (x.floor(), y.floor());
        let (fx, fy) = (x - left, y - top);
        let mut blocked = Vec3::ZERO;
        for (dy, wy) in [(0, 1.0 - fy), (1, fy)] {
            for (dx, wx) in [(0, 1.0 - fx), (1, fx)] {
                let (column, row) = (left as isize + dx, top as isize + dy);
                let inside = |k: isize| (0..self.side as isize).contains(&k);
                if inside(column) && inside(row) {
                    let texel = self.texels[row as usize * self.side + column as usize];
                    let before_m = along_m - self.bias_m;
                    blocked += wx
                        * wy
                        * if texel.nearest_m < before_m {
                            Vec3::ONE
                        } else if texel.glass_m < before_m {
                            Vec3::ONE - texel.passed
                        } else {
                            Vec3::ZERO
                        };
                }
            }
        }
        blocked
    }
}
