//! Visibility of the objects in the photo: sub-pixel coverage, transparent layers, and real surfaces in front.

use lo_geometry::{Camera, Ray, Vec2, Vec3};
use lo_mesh::SurfacePoint;

use crate::matte::alpha::Matte;
use crate::objects::object::Object;
use crate::objects::tracing::{ObjectHit, Objects};
use crate::pattern::hammersley;
use crate::surface::occluders::Occluders;

/// Side in pixels of the square tiles that one task renders.
pub(crate) const TILE: usize = 32;

/// Transparent layers that a ray passes.
const MAX_LAYERS: usize = 8;

/// Largest number of shading points per pixel.
const MAX_FRAGMENTS: usize = 6;

/// A visible piece of an object within one pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fragment {
    /// Index of the object.
    pub object: usize,
    /// Pixel column and row.
    pub pixel: (usize, usize),
    /// Share of the pixel that it covers, behind everything in front of it.
    pub weight: f32,
    /// Unit vector towards the camera.
    pub view: Vec3,
    pub point: SurfacePoint,
    /// Index of its material in the model.
    pub material: u32,
    depth_m: f32,
    normal: Vec3,
}

/// Visible fragments of a tile.
#[derive(Debug, Default)]
pub(crate) struct TileView {
    pub fragments: Vec<Fragment>,
    pub hidden: Vec<Hidden>,
}

/// Hidden part of an object in a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hidden {
    pub pixel: (usize, usize),
    /// Hidden share of the pixel.
    pub share: f32,
    /// The object, or the farthest of several.
    pub object: usize,
}

/// Returns `count` positions in a pixel, in [0, 1)². The most central is first, because the first one that meets a
/// surface is shaded. Each other is as far as possible from those before it, so that the first half also covers the
/// pixel.
pub(crate) fn coverage_pattern(count: usize) -> Vec<Vec2> {
    let mut places: Vec<Vec2> = (0..count).map(|i| hammersley(i, count)).collect();
    for next in 0..count {
        let (before, rest) = places.split_at_mut(next);
        let nearest =
            |place: &Vec2| before.iter().map(|other| other.distance_squared(*place)).fold(f32::INFINITY, f32::min);
        let off_centre = |place: &Vec2| -place.distance_squared(Vec2::splat(0.5));
        let gain = |place: &Vec2| if next == 0 { off_centre(place) } else { nearest(place) };
        if let Some(best) = (0..rest.len()).max_by(|&a, &b| gain(&rest[a]).total_cmp(&gain(&rest[b]))) {
            rest.swap(0, best);
        }
    }
    places
}

/// Condition under which pixels use fewer samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AdaptiveCoverage {
    /// Never.
    None,
    /// If the first half of the samples agree.
    HalfAgree,
    /// One sample if the neighbours are similar; parts thinner than a pixel may be missed.
    InsideOutline,
}

/// Casts the camera's rays.
pub(crate) struct RayCaster<'a> {
    /// Camera in pixels of the photo.
    pub camera: Camera,
    pub objects: &'a Objects<'a>,
    pub occluders: &'a Occluders,
    /// Matte of each visible object: its hidden shares along the edges of occluders.
    pub mattes: &'a [Option<Matte>],
    /// Positions of the samples within a pixel, see [`coverage_pattern`].
    pub samples: &'a [Vec2],
    pub adaptive_coverage: AdaptiveCoverage,
}

/// Result of the ray through a pixel's centre, for comparison with its neighbours.
#[derive(Clone, Copy)]
struct CentreSample {
    met: ObjectHit,
    ray: Ray,
    depth_m: f32,
    /// Share hidden by real surfaces.
    hidden: f32,
}

impl RayCaster<'_> {
    /// Renders the tile of pixels from `(left, top)` to `(right, bottom)`, exclusive.
    pub fn tile(&self, (left, top, right, bottom): (usize, usize, usize, usize)) -> TileView {
        let mut view = TileView::default();
        let (columns, rows) = (right - left, bottom - top);
        let stride = columns + 2;
        let by_neighbours = self.adaptive_coverage == AdaptiveCoverage::InsideOutline;
        let probes: Vec<Option<CentreSample>> = if by_neighbours {
            (0..stride * (rows + 2))
                .map(|i| {
                    self.centre_sample(left as f64 + (i % stride) as f64 - 0.5, top as f64 + (i / stride) as f64 - 0.5)
                })
                .collect()
        } else {
            Vec::new()
        };
        for y in 0..rows {
            for x in 0..columns {
                let pixel = (left + x, top + y);
                if !by_neighbours {
                    self.pixel(pixel, self.samples.len(), &mut view);
                    continue;
                }
                let centre = (y + 1) * stride + x + 1;
                let alike = |i: usize| alike(probes[centre], probes[i]);
                let uniform = [centre - 1, centre + 1].into_iter().all(alike)
                    && (centre - stride - 1..=centre - stride + 1)
                        .chain(centre + stride - 1..=centre + stride + 1)
                        .all(alike);
                match probes[centre] {
                    _ if !uniform => self.pixel(pixel, self.samples.len(), &mut view),
                    Some(CentreSample { met, hidden: 1.0, .. }) => {
                        view.hidden.push(Hidden { pixel, share: 1.0, object: met.object });
                    }
                    Some(CentreSample { met, ray, hidden, .. }) if !self.objects[met.object].is_see_through => {
                        let first = view.fragments.len();
                        self.add_fragment(pixel, &ray, &met, 1.0 - hidden, first, &mut view);
                        if hidden > 0.0 {
                            view.hidden.push(Hidden { pixel, share: hidden, object: met.object });
                        }
                    }
                    Some(_) => self.pixel(pixel, 1, &mut view),
                    None => {}
                }
            }
        }
        view
    }

    fn centre_sample(&self, u: f64, v: f64) -> Option<CentreSample> {
        let ray = Ray { origin: Vec3::ZERO, direction: self.camera.direction(u, v) };
        let met = self.objects.seen(&ray, 0.0)?;
        let point = ray.at(met.hit.distance_m);
        let edge = self.edge(met.object, (u as usize, v as usize));
        let hidden = edge.unwrap_or_else(|| self.hidden(met.object, u, v, point));
        Some(CentreSample { met, ray, depth_m: -point.z, hidden })
    }

    fn pixel(&self, pixel: (usize, usize), samples: usize, view: &mut TileView) {
        let first = view.fragments.len();
        let (mut hidden, mut hidden_object) = (0.0, 0);
        for i in 0..samples {
            if self.adaptive_coverage == AdaptiveCoverage::HalfAgree
                && 2 * i == samples
                && self.agree(i, samples, hidden, &mut view.fragments[first..])
            {
                hidden *= 2.0;
                break;
            }
            let offset = if samples == 1 { Vec2::splat(0.5) } else { self.samples[i] };
            let (u, v) = (pixel.0 as f64 + f64::from(offset.x), pixel.1 as f64 + f64::from(offset.y));
            let ray = Ray { origin: Vec3::ZERO, direction: self.camera.direction(u, v) };
            let mut free = 1.0 / samples as f32;
            let mut from_m = 0.0;
            // Share hidden by soft edges so far. An edge is in front of all layers of an object and of those behind
            // it.
            let mut behind_edge = 0.0f32;
            for _ in 0..MAX_LAYERS {
                let Some(met) = self.objects.seen(&ray, from_m) else { break };
                let share = match self.edge(met.object, pixel) {
                    Some(edge) if edge > behind_edge => {
                        let rest = (edge - behind_edge) / (1.0 - behind_edge);
                        behind_edge = edge;
                        rest
                    }
                    Some(_) => 0.0,
                    None => self.hidden(met.object, u, v, ray.at(met.hit.distance_m)),
                };
                if share > 0.0 {
                    hidden += free * share;
                    hidden_object = met.object;
                }
                free *= 1.0 - share;
                if free == 0.0 {
                    break;
                }
                free -= self.add_fragment(pixel, &ray, &met, free, first, view);
                from_m = met.hit.distance_m;
                if free * samples as f32 <= 1.0 / 256.0 {
                    break;
                }
            }
        }
        if hidden > 0.0 {
            view.hidden.push(Hidden { pixel, share: hidden, object: hidden_object });
        }
    }

    /// Returns the share of a pixel in which real surfaces hide an object along a soft edge; `None` where depth alone
    /// decides.
    fn edge(&self, object: usize, pixel: (usize, usize)) -> Option<f32> {
        self.mattes[object].as_ref()?.hidden(pixel)
    }

    /// Returns 1 if, by depth, real surfaces hide an object's point at photo position `(u, v)`; else 0.
    fn hidden(&self, object: usize, u: f64, v: f64, point: Vec3) -> f32 {
        let (width, height) = (f64::from(self.camera.width), f64::from(self.camera.height));
        let support = self.objects[object].support.as_ref();
        let hides = self.occluders.hides(u / width, v / height, point, support);
        if hides { 1.0 } else { 0.0 }
    }

    /// Returns whether the first `done` of a pixel's samples agree: nothing, something hidden, or one opaque surface,
    /// whose weight then counts for all samples.
    fn agree(&self, done: usize, samples: usize, hidden: f32, own: &mut [Fragment]) -> bool {
        let all = done as f32 / samples as f32 - 1e-4;
        match own {
            [] => hidden == 0.0 || hidden > all,
            [fragment] if fragment.point.alpha == 1.0 && fragment.weight > all => {
                fragment.weight = 1.0;
                true
            }
            _ => false,
        }
    }

    /// Adds coverage to a similar fragment of the same pixel, or to a new one. Returns the share of the pixel that it
    /// covers, out of the `free` one.
    fn add_fragment(
        &self,
        pixel: (usize, usize),
        ray: &Ray,
        &ObjectHit { object, ref hit }: &ObjectHit,
        free: f32,
        first: usize,
        view: &mut TileView,
    ) -> f32 {
        let placed = &self.objects[object];
        let normal = placed.triangle_normal(hit.triangle);
        let depth_m = -ray.at(hit.distance_m).z;
        let own = &mut view.fragments[first..];
        let material = placed.material_of(hit.triangle);
        let same = |f: &Fragment| {
            f.object == object
                && f.material == material
                && (f.depth_m - depth_m).abs() < 0.02 * depth_m
                && f.normal.dot(normal) > 0.8
        };
        let mut found = own.iter().position(same);
        if found.is_none() && own.len() >= MAX_FRAGMENTS {
            let distance = |f: &Fragment| (f.depth_m - depth_m).abs();
            found = (0..own.len()).min_by(|&a, &b| distance(&own[a]).total_cmp(&distance(&own[b])));
        }
        if let Some(fragment) = found.map(|index| &mut own[index]).filter(|f| f.point.alpha == 1.0) {
            fragment.weight += free;
            return free;
        }
        let footprint_m = hit.distance_m * self.camera.pixel_angle_rad();
        let point = placed.surface(ray, hit, footprint_m);
        let weight = free * point.alpha;
        match found {
            Some(index) => own[index].weight += weight,
            None => {
                let view_direction = -ray.direction;
                let fragment =
                    Fragment { object, pixel, weight, view: view_direction, point, material, depth_m, normal };
                view.fragments.push(fragment);
            }
        }
        weight
    }
}

/// Returns whether any pixel's ray meets an object, regardless of occluders.
pub(crate) fn is_in_view(camera: &Camera, object: &Object, window: (usize, usize, usize, usize)) -> bool {
    let (left, top, right, bottom) = window;
    let meets = |x: usize, y: usize| {
        let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
        object.seen(&Ray { origin: Vec3::ZERO, direction }, 0.0).is_some()
    };
    (top..bottom).any(|y| (left..right).any(|x| meets(x, y)))
}

/// Returns the photo pixels `(left, top, right, bottom)`, the last two exclusive, that contain the whole object.
pub(crate) fn seen_window(camera: &Camera, object: &Object) -> Option<(usize, usize, usize, usize)> {
    let (width, height) = (f64::from(camera.width), f64::from(camera.height));
    let corners = object.corners();
    if corners.iter().all(|corner| corner.z >= 0.0) {
        return None;
    }
    let (mut low, mut high) = ((f64::INFINITY, f64::INFINITY), (f64::NEG_INFINITY, f64::NEG_INFINITY));
    for corner in corners {
        // Partly behind the camera: it may be anywhere in the image.
        let Some((u, v, _)) = camera.project(corner).filter(|(_, _, z)| *z > 1e-3) else {
            return Some((0, 0, camera.width as usize, camera.height as usize));
        };
        low = (low.0.min(u), low.1.min(v));
        high = (high.0.max(u), high.1.max(v));
    }
    let inside = |value: f64, limit: f64| value.clamp(0.0, limit) as usize;
    let window = (
        inside(low.0.floor() - 1.0, width),
        inside(low.1.floor() - 1.0, height),
        inside(high.0.ceil() + 1.0, width),
        inside(high.1.ceil() + 1.0, height),
    );
    (window.0 < window.2 && window.1 < window.3).then_some(window)
}

fn alike(a: Option<CentreSample>, b: Option<CentreSample>) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => {
            a.met.object == b.met.object
                && (a.depth_m - b.depth_m).abs() < 0.02 * a.depth_m
                && (a.hidden - b.hidden).abs() < 1.0
        }
        _ => false,
    }
}
