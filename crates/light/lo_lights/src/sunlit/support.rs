//! Brightness edges in a photo that support a sun direction given by an object and its shadow.

use std::f32::consts::TAU;
use std::ops::Range;

use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, RadianceImage};
use lo_scene::{Estimate, Frame};

use super::CLIPPED;
use super::edges::{Edge, EdgeSide, edges, log_luminance};

/// Greatest distance of an edge from the shadow's pixel, as a share of the photo's width.
const NEAR: f32 = 0.05;

/// Ranges of ln(ratio to shade in red ÷ that in green), and in green ÷ in blue: sunlight is neutral or warm.
const WARM: [Range<f32>; 2] = [-0.15..0.5, -0.15..0.6];

/// Clicks and depth are imprecise: the sun may be up to this angle from the given direction.
const TURN_DEG: f32 = 6.0;

/// Directions tried, by share of that angle.
const RINGS: [(f32, usize); 2] = [(0.5, 6), (1.0, 12)];

/// Offset of ray origins from a surface along its normal and along the ray: metres, and metres per metre of depth.
const RAISED: (f32, f32) = (0.01, 0.01);
const START: (f32, f32) = (0.15, 0.03);

/// Range of distances at which a surface occludes points behind it: metres, and metres per metre of depth.
const BEHIND: [(f32, f32); 2] = [(0.015, 0.015), (0.15, 0.1)];

/// Step along a ray, as a share of the distance from the camera, and greatest length of rays in metres.
const STEP: f32 = 0.012;
const REACH_M: f32 = 8.0;

/// Counts of sharp edges on sun-facing surfaces, around the pixel of a shadow.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShadowSupport {
    /// All edges.
    pub edges: usize,
    /// Edges whose bright side has more light of a sun's colour than the dark side, or is clipped.
    pub sunny: usize,
    /// Sunny edges whose dark side is occluded from the sun by the photo's depth, and whose bright side is not.
    pub explained: usize,
    /// Sunny edges whose bright side is occluded, and whose dark side is not.
    pub against: usize,
    /// Whether depth was measured. Predicted depth is too imprecise for [`ShadowSupport::explained`] to decide.
    pub measured: bool,
}

impl ShadowSupport {
    /// Least number of [`ShadowSupport::sunny`] edges.
    pub const MIN_SUNNY: usize = 5;

    /// Least share of [`ShadowSupport::sunny`] edges.
    pub const MIN_SUNNY_SHARE: f32 = 0.4;

    /// Returns whether the photo supports the shadow.
    pub fn is_enough(&self) -> bool {
        self.sunny >= Self::MIN_SUNNY
            && self.sunny as f32 >= Self::MIN_SUNNY_SHARE * self.edges as f32
            && (!self.measured || self.explained > self.against)
    }
}

/// Counts the support for a sun by the edges around the pixel of a shadow. `sun` is the unit vector towards the sun.
///
/// The ray from the dark side of a shadow's edge to the sun hits the object that casts the shadow. The ray from the
/// bright side passes beside it.
pub fn shadow_support(scene: &Estimate, sun: Vec3, shadow: [f64; 2]) -> ShadowSupport {
    let seen = scene.surface();
    let (radiance, normals) = (seen.radiance(), scene.surface_normals());
    if (radiance.width(), radiance.height()) != (normals.width(), normals.height()) {
        return ShadowSupport::default();
    }
    let width = seen.depth_m.width() as f32;
    let scale = width / scene.frame.camera.width as f32;
    let [x, y] = shadow.map(|along| along as f32 * scale);
    let is_near = |edge: &Edge| (edge.lit.pixel.0 as f32 - x).hypot(edge.lit.pixel.1 as f32 - y) < NEAR * width;
    let mut near = edges(seen, &log_luminance(&radiance), normals, sun);
    near.retain(is_near);
    let counted =
        ShadowSupport { edges: near.len(), measured: !scene.origin.predicted_depth, ..ShadowSupport::default() };
    near.retain(|edge| is_sunny(edge, seen, &radiance));
    let view = DepthView { depth_m: &seen.depth_m, camera: seen.depth_camera() };
    let supports = around(sun).into_iter().map(|sun| view.support(&near, sun));
    let best = supports.max_by_key(|[explained, against]| *explained as isize - *against as isize);
    let [explained, against] = best.unwrap_or_default();
    ShadowSupport { sunny: near.len(), explained, against, ..counted }
}

/// Returns whether the ratio of an edge's sides has a sun's colour. Clipped channels are not tested.
fn is_sunny(edge: &Edge, seen: &Frame, radiance: &RadianceImage) -> bool {
    let [lit, shaded] = [edge.lit, edge.shaded].map(|side| Vec3::from(radiance[side.pixel]).max(Vec3::splat(1e-3)));
    let ratio = (lit / shaded).to_array().map(f32::ln);
    let is_clipped = |channel: usize| lit[channel] >= CLIPPED * seen.exposure;
    let mut pairs = WARM.iter().enumerate();
    pairs.all(|(c, warm)| is_clipped(c) || is_clipped(c + 1) || warm.contains(&(ratio[c] - ratio[c + 1])))
}

/// Returns a direction and others around it.
fn around(sun: Vec3) -> Vec<Vec3> {
    let (right, above) = sun.any_orthonormal_pair();
    let ring = |(share, count): (f32, usize)| {
        (0..count).map(move |k| {
            let (sin, cos) = (TAU * k as f32 / count as f32).sin_cos();
            (sun + (right * cos + above * sin) * (share * TURN_DEG).to_radians().tan()).normalize()
        })
    };
    std::iter::once(sun).chain(RINGS.into_iter().flat_map(ring)).collect()
}

/// Surfaces that the photo shows.
struct DepthView<'a> {
    depth_m: &'a DepthMap,
    camera: Camera,
}

impl DepthView<'_> {
    /// Returns the numbers of edges that a sun explains and contradicts.
    fn support(&self, edges: &[Edge], sun: Vec3) -> [usize; 2] {
        let (mut explained, mut against) = (0, 0);
        for edge in edges {
            match [edge.lit, edge.shaded].map(|side| self.hides(&side, sun)) {
                [false, true] => explained += 1,
                [true, false] => against += 1,
                _ => {}
            }
        }
        [explained, against]
    }

    /// Returns whether a surface is between a point and the sun.
    fn hides(&self, point: &EdgeSide, sun: Vec3) -> bool {
        let length = |(fixed, share): (f32, f32), depth_m: f32| fixed + share * depth_m;
        let depth_m = -point.position_m.z;
        let from = point.position_m + point.normal * length(RAISED, depth_m);
        let mut along_m = length(START, depth_m);
        while along_m < REACH_M {
            let at = from + sun * along_m;
            let projected = self.camera.project(at).filter(|&(u, v, _)| self.camera.contains(u, v));
            let Some((u, v, depth_m)) = projected else { return false };
            let shown_m = self.depth_m[(u as usize, v as usize)];
            let [least_m, most_m] = BEHIND.map(|limit| length(limit, shown_m));
            if shown_m > 0.0 && (least_m..most_m).contains(&(depth_m as f32 - shown_m)) {
                return true;
            }
            along_m += STEP * at.z.abs().max(0.5);
        }
        false
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::Cube;
    use lo_imaging::Photo;
    use lo_octree::LightOctree;
    use lo_scene::EstimateOrigin;

    use super::*;

    const WIDTH: usize = 240;
    const HEIGHT: usize = 160;
    const FLOOR_M: f32 = -0.9;
    const BOARD_M: f32 = -3.0;
    const SUN: Vec3 = Vec3::new(0.36, 0.8, -0.48);

    fn camera() -> Camera {
        Camera::from_hfov_deg(70.0, WIDTH as u32, HEIGHT as u32).unwrap()
    }

    /// A board hanging above the floor, in the plane `z = BOARD_M`.
    fn in_board(at: Vec3) -> bool {
        (-0.3..0.5).contains(&at.x) && (-0.45..0.2).contains(&at.y)
    }

    /// Returns the surface at a pixel: the board, the floor, or a wall 6 m away.
    fn shown(x: usize, y: usize) -> Vec3 {
        let direction = camera().direction(x as f64 + 0.5, y as f64 + 0.5);
        let board = direction * (BOARD_M / direction.z);
        if in_board(board) {
            return board;
        }
        let floor = if direction.y < 0.0 { FLOOR_M / direction.y } else { f32::INFINITY };
        direction * floor.min(-6.0 / direction.z)
    }

    /// A sunny floor, partly shaded by the board. `light` is the sun's per channel, relative to the shade.
    fn scene(light: [f32; 3], predicted_depth: bool) -> Estimate {
        let photo = RadianceImage::from_fn(WIDTH, HEIGHT, |x, y| {
            let at = shown(x, y);
            if at.y > FLOOR_M + 1e-3 {
                return [0.05; 3];
            }
            let toward_board = at + SUN * ((BOARD_M - at.z) / SUN.z);
            let is_lit = at.z < BOARD_M || !in_board(toward_board);
            light.map(|light| 0.12 * if is_lit { 1.0 + light } else { 1.0 })
        });
        let depth_m = DepthMap::from_fn(WIDTH, HEIGHT, |x, y| -shown(x, y).z);
        let frame = Frame::new(Photo::Linear(photo), depth_m, camera(), 1.0).unwrap();
        let (octree, _) = LightOctree::from_points(&[], Cube::centred(Vec3::ZERO, 8.0), 3, 2).unwrap();
        let origin = EstimateOrigin { predicted_depth, ..EstimateOrigin::default() };
        Estimate { origin, ..Estimate::observed_only(octree, frame) }
    }

    /// Returns the pixel at the shadow of a corner of the board.
    fn shadow() -> [f64; 2] {
        let corner = Vec3::new(-0.3, -0.45, BOARD_M);
        let fallen = corner + SUN * ((FLOOR_M - corner.y) / SUN.y);
        camera().project(fallen).map(|(u, v, _)| [u, v]).unwrap()
    }

    #[test]
    fn a_shadow_is_supported_by_its_edges() {
        let support = shadow_support(&scene([4.0, 3.6, 3.0], false), SUN, shadow());
        assert!(support.is_enough() && support.measured, "{support:?}");
        assert!(support.explained > support.edges / 3 && support.against == 0, "{support:?}");
    }

    #[test]
    fn a_sun_that_the_board_does_not_hide_is_refused_where_depth_was_measured() {
        // Towards the camera's side nothing is between the floor and the sun.
        let other = Vec3::new(-0.48, 0.6, 0.64);
        let [measured, predicted] = [false, true].map(|is| shadow_support(&scene([4.0; 3], is), other, shadow()));
        assert!(measured.sunny >= ShadowSupport::MIN_SUNNY && measured.explained == 0, "{measured:?}");
        assert!(!measured.is_enough() && predicted.is_enough(), "{predicted:?}");
    }

    #[test]
    fn without_edges_of_sunlight_there_is_no_support() {
        // No edge at the pixel, and edges of a change of paint.
        let far = shadow_support(&scene([4.0; 3], true), SUN, [20.0, 150.0]);
        assert!(!far.is_enough() && far.edges == 0, "{far:?}");
        let painted = shadow_support(&scene([1.5, 4.0, 1.0], true), SUN, shadow());
        assert!(!painted.is_enough() && painted.edges > 5 && painted.sunny == 0, "{painted:?}");
    }
}
