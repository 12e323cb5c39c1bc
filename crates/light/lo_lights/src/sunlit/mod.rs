//! Sunlit regions of a scene, from the sun patches that a photo shows.
//!
//! The window through which the sun enters is usually outside the photo. But a sun ray that passes a point in the air
//! would continue to the surface behind it, which the photo shows. So a point is in the sun where the sun ray through
//! it ends in a sun patch.

mod edges;
mod label;
mod support;

use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_scene::Frame;

use crate::image_change::bilinear;
use edges::{Edge, edges, log_luminance};
use label::label;

pub use support::{ShadowSupport, shadow_support};

/// Least number of edges of a sun patch.
const MIN_EDGES: usize = 30;

/// Tolerance within which a point is on the surface of its pixel: metres, and metres per metre of depth.
const ON_SURFACE: (f32, f32) = (0.01, 0.01);

/// Greatest thickness of surfaces; rays that are further behind a surface pass it. In metres, and metres per metre of
/// depth.
const BEHIND: (f32, f32) = (0.15, 0.1);

/// Step along a ray, as a share of the distance from the camera, and greatest length of rays in metres.
const STEP: f32 = 0.01;
const REACH_M: f32 = 8.0;

/// Number of bisections that refine a hit.
const BISECTIONS: usize = 6;

/// Value of a clipped channel as a share of the exposure: 250 of 255 in linear light, as in [`Frame::clipped`].
const CLIPPED: f32 = 0.956;

/// Surfaces of a photo on which the sun shines.
#[derive(Clone, Debug, PartialEq)]
pub struct Sunlit {
    sun: Vec3,
    lit: Image<f32>,
    depth_m: DepthMap,
    camera: Camera,
    edges: Vec<SunEdge>,
}

/// The surface that the photo shows in the direction of a point.
struct VisibleSurface {
    /// Position in pixels.
    at: Vec2,
    depth_m: f32,
    /// Distance of the point behind the surface, in metres.
    past_m: f32,
}

/// Contrast between a sun patch and the shade beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunEdge {
    /// Position in the shade beside the patch, in metres.
    pub shaded_m: Vec3,
    /// Unit normal there.
    pub normal: Vec3,
    /// Radiance in the sun divided by that in the shade, per channel.
    pub ratio: Vec3,
    /// Whether the photo is clipped in the sun, per channel; the ratio is then a lower bound.
    pub clipped: [bool; 3],
}

impl Sunlit {
    /// Finds sunlit surfaces from the edges of sun patches. `sun` is the unit vector towards the sun. Returns `None` if
    /// there are too few edges.
    ///
    /// `seen` is the frame at the working resolution ([`Frame::working`]) without flying pixels, with its
    /// [`Frame::normals`].
    pub fn new(seen: &Frame, normals: &Image<Option<Vec3>>, sun: Vec3) -> Option<Self> {
        let radiance = seen.radiance();
        if (radiance.width(), radiance.height()) != (normals.width(), normals.height()) {
            return None;
        }
        let log = log_luminance(&radiance);
        let edges = edges(seen, &log, normals, sun);
        if edges.len() < MIN_EDGES {
            return None;
        }
        let mut lit = label(seen, &log, &edges);
        for (lit, normal) in lit.pixels_mut().iter_mut().zip(normals.pixels()) {
            *lit &= normal.is_none_or(|normal| normal.dot(sun) > 0.0);
        }
        let clipped = seen.clipped();
        let of_edge = |edge: &Edge| {
            let [lit, shaded] = [edge.lit, edge.shaded].map(|side| Vec3::from(radiance[side.pixel]));
            SunEdge {
                shaded_m: edge.shaded.position_m,
                normal: edge.shaded.normal,
                ratio: lit / shaded.max(Vec3::splat(1e-4)),
                clipped: lit.to_array().map(|value| clipped[edge.lit.pixel] && value >= CLIPPED * seen.exposure),
            }
        };
        let edges = edges.iter().map(of_edge).collect();
        Some(Self { sun, lit: softened(&lit), depth_m: seen.depth_m.clone(), camera: seen.depth_camera(), edges })
    }

    /// Returns the share of the sun on the surface of each pixel, from 0 to 1; values in between are at edges of
    /// patches.
    pub fn lit(&self) -> &Image<f32> {
        &self.lit
    }

    /// Returns the contrasts at the edges of the patches.
    pub fn edges(&self) -> &[SunEdge] {
        &self.edges
    }

    /// Returns the share of the sun at a point, from 0 to 1: on the surface that the photo shows there, or on the
    /// surface behind it as seen from the sun. Returns `None` where the photo does not show that surface.
    pub fn share_at(&self, point: Vec3) -> Option<f32> {
        let limit = |(fixed, share): (f32, f32), shown: &VisibleSurface| fixed + share * shown.depth_m;
        if let Some(shown) = self.visible(point).filter(|shown| shown.past_m.abs() < limit(ON_SURFACE, shown)) {
            return Some(self.lit_at(&shown));
        }
        let (mut before_m, mut along_m) = (0.0, 0.0);
        while along_m < REACH_M {
            let at = point - self.sun * along_m;
            let hit = self.visible(at).filter(|shown| (0.0..limit(BEHIND, shown)).contains(&shown.past_m));
            if let Some(mut hit) = hit {
                for _ in 0..BISECTIONS {
                    let middle_m = 0.5 * (before_m + along_m);
                    match self.visible(point - self.sun * middle_m).filter(|shown| shown.past_m >= 0.0) {
                        Some(nearer) => (along_m, hit) = (middle_m, nearer),
                        None => before_m = middle_m,
                    }
                }
                return Some(self.lit_at(&hit));
            }
            before_m = along_m;
            along_m += STEP * at.z.abs().max(0.2);
        }
        None
    }

    /// Returns the surface that the photo shows in the direction of a point; `None` outside the photo and at holes.
    fn visible(&self, point: Vec3) -> Option<VisibleSurface> {
        let (u, v, depth_m) = self.camera.project(point)?;
        let inside = self.camera.contains(u, v);
        let shown_m = inside.then(|| self.depth_m[(u as usize, v as usize)]).filter(|&shown_m| shown_m > 0.0)?;
        Some(VisibleSurface { at: Vec2::new(u as f32, v as f32), depth_m: shown_m, past_m: depth_m as f32 - shown_m })
    }

    /// Returns the interpolated share of the sun at a surface.
    fn lit_at(&self, shown: &VisibleSurface) -> f32 {
        bilinear(&self.lit, shown.at, |a, b, share| a + (b - a) * share)
    }
}

/// Blurs with weights 1, 2, 1 in both directions.
fn softened(lit: &Image<bool>) -> Image<f32> {
    let (width, height) = (lit.width(), lit.height());
    let value = |x: usize, y: usize| f32::from(u8::from(lit[(x, y)]));
    let along = |a: f32, b: f32, c: f32| 0.25 * (a + 2.0 * b + c);
    let row = |x: usize, y: usize| along(value(x.saturating_sub(1), y), value(x, y), value((x + 1).min(width - 1), y));
    Image::from_fn(width, height, |x, y| along(row(x, y.saturating_sub(1)), row(x, y), row(x, (y + 1).min(height - 1))))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::sync::OnceLock;

    use lo_imaging::Photo;
    use proptest::prelude::*;

    use super::*;

    const WIDTH: usize = 240;
    const HEIGHT: usize = 160;
    const FLOOR_M: f32 = -0.9;
    const WALL_M: f32 = -4.0;
    const SUN: Vec3 = Vec3::new(0.36, 0.8, 0.48);

    fn camera() -> Camera {
        Camera::from_hfov_deg(70.0, WIDTH as u32, HEIGHT as u32).unwrap()
    }

    /// Returns the surface at a pixel: the floor, or the wall behind it.
    fn shown(x: usize, y: usize) -> Vec3 {
        let direction = camera().direction(x as f64 + 0.5, y as f64 + 0.5);
        let floor = if direction.y < 0.0 { FLOOR_M / direction.y } else { f32::INFINITY };
        direction * floor.min(WALL_M / direction.z)
    }

    fn in_patch(at: Vec3) -> bool {
        (-0.5..0.8).contains(&at.x) && (-3.0..-2.2).contains(&at.z)
    }

    /// A floor with a sun patch of this contrast to the shade, and a rug half as bright as the floor.
    fn frame(ratio: f32) -> Frame {
        let photo = Image::from_fn(WIDTH, HEIGHT, |x, y| {
            let at = shown(x, y);
            let rug = if at.x > 0.2 { 0.5 } else { 1.0 };
            let on_floor = at.y < FLOOR_M + 1e-3;
            let light = if on_floor && in_patch(at) { ratio } else { 1.0 };
            [0.12 * light * rug, 0.1 * light * rug, 0.08 * light * rug]
        });
        let depth_m = DepthMap::from_fn(WIDTH, HEIGHT, |x, y| -shown(x, y).z);
        Frame::new(Photo::Linear(photo), depth_m, camera(), 1.0).unwrap()
    }

    fn found(ratio: f32, sun: Vec3) -> Option<Sunlit> {
        let seen = frame(ratio);
        Sunlit::new(&seen, &seen.normals(), sun)
    }

    fn sunlit() -> &'static Sunlit {
        static SUNLIT: OnceLock<Sunlit> = OnceLock::new();
        SUNLIT.get_or_init(|| found(6.0, SUN).unwrap())
    }

    #[test]
    fn patches_are_found_across_changes_of_albedo() {
        let sunlit = sunlit();
        let (mut wrong, mut lit) = (0, 0);
        for y in 0..HEIGHT {
            for x in 0..WIDTH {
                let at = shown(x, y);
                let truth = at.y < FLOOR_M + 1e-3 && in_patch(at);
                lit += usize::from(truth);
                wrong += usize::from((sunlit.lit()[(x, y)] > 0.5) != truth);
            }
        }
        assert!(wrong < lit / 20, "{wrong} wrong, {lit} in the sun");
        let edges = sunlit.edges();
        let right = edges
            .iter()
            .filter(|edge| (edge.ratio / 6.0 - 1.0).abs().max_element() < 1e-3 && edge.clipped == [false; 3]);
        assert!(right.count() as f32 > 0.8 * edges.len() as f32);
    }

    #[test]
    fn without_patches_there_is_nothing() {
        assert_eq!(found(1.0, SUN), None);
        // Seen from below the floor, nothing faces the sun.
        assert_eq!(found(6.0, -SUN), None);
    }

    proptest! {
        /// A point in the air is in the sun where the photo shows that its shadow would fall into a patch.
        #[test]
        fn the_sun_shines_in_the_air_above_patches(x in -1.0f32..1.2, z in -3.4f32..-2.0, height_m in 0.0f32..0.6) {
            let sunlit = sunlit();
            let below = Vec3::new(x, FLOOR_M, z);
            let edge_m = [x + 0.5, x - 0.8, z + 3.0, z + 2.2].into_iter().map(f32::abs).fold(f32::INFINITY, f32::min);
            let share = sunlit.share_at(below + SUN * (height_m / SUN.y));
            // Two pixels of the floor.
            if edge_m > 0.12 {
                prop_assert_eq!(share.map(|share| share > 0.5), Some(in_patch(below)));
            }
        }
    }

    #[test]
    fn surfaces_outside_the_photo_have_no_share() {
        let sunlit = sunlit();
        assert_eq!(sunlit.share_at(Vec3::new(0.0, 0.0, 4.0)), None);
        assert_eq!(sunlit.share_at(Vec3::new(-3.0, FLOOR_M, -0.5)), None);
    }
}
