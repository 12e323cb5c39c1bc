//! Where the sun shines, by the patches that it makes on what a photo shows.
//!
//! Nobody sees the window through which it comes. But what it lights in the air it would light on the surface behind, and that the photo shows: a place is in
//! the sun where the ray from the sun through it ends in a sun patch.

mod edges;
mod label;
mod support;

use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_scene::Frame;

use crate::picture::bilinear;
use edges::{Edge, edges, log_luminance};
use label::label;

pub use support::{ShadowSupport, shadow_support};

/// Fewer edges are no sun patch.
const MIN_EDGES: usize = 30;

/// A place this near to what its pixel shows lies on it, metres and metres per metre of depth.
const ON_SURFACE: (f32, f32) = (0.01, 0.01);

/// Rays that pass what they meet by more than this go on behind it, metres and metres per metre of depth.
const BEHIND: (f32, f32) = (0.15, 0.1);

/// Steps along a ray, as a share of the distance from the camera, and how far rays are followed, metres.
const STEP: f32 = 0.01;
const REACH_M: f32 = 8.0;

/// Halvings of the step in which a ray meets a surface.
const BISECTIONS: usize = 6;

/// Channels of a clipped pixel that are, as a share of the exposure: 250 of 255 in linear light, as in [`Frame::clipped`].
const CLIPPED: f32 = 0.956;

/// The surfaces of a photo on which the sun shines.
#[derive(Clone, Debug, PartialEq)]
pub struct Sunlit {
    sun: Vec3,
    lit: Image<f32>,
    depth_m: DepthMap,
    camera: Camera,
    edges: Vec<SunEdge>,
}

/// A place and what the photo shows in its direction.
struct Shown {
    /// In pixels.
    at: Vec2,
    depth_m: f32,
    /// How far the place lies behind that, metres.
    past_m: f32,
}

/// By how much a sun patch is brighter than the shade beside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SunEdge {
    /// In the shade beside the patch, metres.
    pub shaded_m: Vec3,
    /// Unit normal there.
    pub normal: Vec3,
    /// By channel: radiance in the sun over that in the shade.
    pub ratio: Vec3,
    /// By channel: whether the photo is clipped in the sun, so that the ratio is the least that it can be.
    pub clipped: [bool; 3],
}

impl Sunlit {
    /// By the edges of sun patches on surfaces that face the sun, a unit vector towards which is given; `None` where there are hardly any.
    ///
    /// `seen` is the frame at the working resolution ([`Frame::working`]) without flying pixels.
    pub fn new(seen: &Frame, sun: Vec3) -> Option<Self> {
        let (radiance, normals) = (seen.radiance(), seen.normals());
        if (radiance.width(), radiance.height()) != (normals.width(), normals.height()) {
            return None;
        }
        let log = log_luminance(&radiance);
        let edges = edges(seen, &log, &normals, sun);
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

    /// How much of the sun shines on what each pixel shows, 0 to 1; in between at the edges of patches.
    pub fn lit(&self) -> &Image<f32> {
        &self.lit
    }

    /// What the edges of the patches say.
    pub fn edges(&self) -> &[SunEdge] {
        &self.edges
    }

    /// How much of the sun shines at a place, 0 to 1: on the surface that the photo shows there, or on what lies behind it as seen from the sun. `None` where
    /// the photo does not show that.
    pub fn share_at(&self, place: Vec3) -> Option<f32> {
        let limit = |(fixed, share): (f32, f32), shown: &Shown| fixed + share * shown.depth_m;
        if let Some(shown) = self.shown(place).filter(|shown| shown.past_m.abs() < limit(ON_SURFACE, shown)) {
            return Some(self.lit_at(&shown));
        }
        let (mut before_m, mut along_m) = (0.0, 0.0);
        while along_m < REACH_M {
            let at = place - self.sun * along_m;
            let met = self.shown(at).filter(|shown| (0.0..limit(BEHIND, shown)).contains(&shown.past_m));
            if let Some(mut met) = met {
                for _ in 0..BISECTIONS {
                    let middle_m = 0.5 * (before_m + along_m);
                    match self.shown(place - self.sun * middle_m).filter(|shown| shown.past_m >= 0.0) {
                        Some(nearer) => (along_m, met) = (middle_m, nearer),
                        None => before_m = middle_m,
                    }
                }
                return Some(self.lit_at(&met));
            }
            before_m = along_m;
            along_m += STEP * at.z.abs().max(0.2);
        }
        None
    }

    /// What the photo shows in a place's direction; `None` beside the picture and at holes.
    fn shown(&self, place: Vec3) -> Option<Shown> {
        let (u, v, depth_m) = self.camera.project(place)?;
        let inside = self.camera.contains(u, v);
        let shown_m = inside.then(|| self.depth_m[(u as usize, v as usize)]).filter(|&shown_m| shown_m > 0.0)?;
        Some(Shown { at: Vec2::new(u as f32, v as f32), depth_m: shown_m, past_m: depth_m as f32 - shown_m })
    }

    /// The share of the sun there, between pixels.
    fn lit_at(&self, shown: &Shown) -> f32 {
        bilinear(&self.lit, shown.at, |a, b, share| a + (b - a) * share)
    }
}

/// Means of each pixel and those beside it, with weights 1, 2, 1 in both directions.
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

    /// What a pixel shows: the floor, or the wall behind it.
    fn shown(x: usize, y: usize) -> Vec3 {
        let direction = camera().direction(x as f64 + 0.5, y as f64 + 0.5);
        let floor = if direction.y < 0.0 { FLOOR_M / direction.y } else { f32::INFINITY };
        direction * floor.min(WALL_M / direction.z)
    }

    fn in_patch(at: Vec3) -> bool {
        (-0.5..0.8).contains(&at.x) && (-3.0..-2.2).contains(&at.z)
    }

    /// A floor with a sun patch of this brightness beside the shade's, and a rug as dark as half of the floor.
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

    fn sunlit() -> &'static Sunlit {
        static SUNLIT: OnceLock<Sunlit> = OnceLock::new();
        SUNLIT.get_or_init(|| Sunlit::new(&frame(6.0), SUN).unwrap())
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
        assert_eq!(Sunlit::new(&frame(1.0), SUN), None);
        // The same seen from below the floor: nothing faces the sun.
        assert_eq!(Sunlit::new(&frame(6.0), -SUN), None);
    }

    proptest! {
        /// A place in the air is in the sun where the photo shows that its shadow would fall into a patch.
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
    fn of_what_the_photo_does_not_show_nothing_is_said() {
        let sunlit = sunlit();
        assert_eq!(sunlit.share_at(Vec3::new(0.0, 0.0, 4.0)), None);
        assert_eq!(sunlit.share_at(Vec3::new(-3.0, FLOOR_M, -0.5)), None);
    }
}
