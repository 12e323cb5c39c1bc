//! Guessed lamps and windows as bright as the seen surfaces are shaded.
//!
//! A diffuse surface of constant albedo is as bright as the light that it gets: where a wall is brighter on its left there is more light on its
//! left. Networks know where lamps are better than how bright: one factor on all that is guessed of lamps, and one on guessed surfaces, are the likeliest
//! ones that explain the shading of segments of constant albedo (`solve`), with visibility through the octree. For lamps placed by hand or
//! matched from pictures the same is done in Karsch et al. 2011 and 2014 ("Rendering synthetic objects into legacy photographs", "Automatic scene
//! inference for 3D object compositing"); there the room's box is all that casts shadows, here it is the octree.

mod places;
mod solve;

use std::borrow::Cow;

use lo_events::Warning;
use lo_geometry::Vec3;
use lo_imaging::luminance;
use lo_octree::{LeafNode, LightOctree};
use lo_scene::Frame;

use crate::irradiance::{irradiances, offset_m, tracer};
use crate::lamps::OBJECT_SHARE;
use places::{Place, places};
use solve::{Problem, solve};

/// What exceeds this multiple of the mean luminance is a lamp's or a window's, or of what they shine on.
const CAP: f32 = 2.0;

/// Of a lamp so many times as bright as the cap the rest stays: it is not one that was averaged away, and where it is wrong, it blinds.
const LIMIT: f32 = 4.0;

/// Lamps that give less than this share of the light on what is seen are none.
const MIN_SHARE: f32 = 0.02;

/// Logarithms of factors up to this size are not worth a word.
const NOTABLE: f32 = 0.1;

/// What was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampFit {
    /// Factor on what is guessed of lamps and windows beyond what surfaces have.
    pub lamps: f32,
    /// Share of the light on what is seen that these give now, 0 to 1.
    pub lamps_share: f32,
    /// Factor on the radiance of guessed surfaces.
    pub surfaces: f32,
}

impl Default for LampFit {
    /// Nothing.
    fn default() -> Self {
        Self { lamps: 1.0, lamps_share: 0.0, surfaces: 1.0 }
    }
}

impl LampFit {
    /// What a user should know about it.
    pub fn warning(&self) -> Option<Warning> {
        let Self { lamps, lamps_share, surfaces } = *self;
        let lamps = (lamps_share > MIN_SHARE).then_some(lamps);
        let notable = lamps.into_iter().chain([surfaces]).any(|factor| factor.ln().abs() > NOTABLE);
        notable.then_some(Warning::FittedLamps { lamps, lamps_share, surfaces })
    }
}

/// Makes guessed lamps and windows as bright as seen surfaces are shaded, and scales guessed surfaces; what is seen stays.
///
/// `seen` is the frame at the working resolution ([`Frame::working`]) without flying pixels. Where nodes have lobes, the octree becomes what is
/// seen of it from the middle of the view.
pub fn fit_lamps(light: &mut LightOctree, seen: &Frame) -> LampFit {
    let places = places(seen);
    if places.is_empty() {
        return LampFit::default();
    }
    let middle_m = OBJECT_SHARE * places.iter().map(|place| place.position_m).sum::<Vec3>() / places.len() as f32;
    if let Cow::Owned(seen) = light.seen_from(middle_m) {
        *light = seen;
    }
    let cap = cap(light);
    let problem = problem(light, &places, cap);
    let solution = solve(&problem);
    let all = problem.irradiance(solution);
    let share = problem.lamps.iter().zip(&all).map(|(lamps, all)| solution.lamps * lamps / all);
    let lamps_share = share.sum::<f32>() / places.len() as f32;
    light.change_leaves(|light, leaf| {
        let Parts { surface, lamp, .. } = Parts::of(light, leaf, cap);
        light.radiance(leaf) * (1.0 + surface * (solution.surfaces - 1.0) + lamp * (solution.lamps - 1.0))
    });
    LampFit { lamps: solution.lamps, lamps_share, surfaces: solution.surfaces }
}

/// Shares of a leaf's radiance; their sum is 1.
struct Parts {
    /// What the photo saw, unclipped.
    seen: f32,
    /// Of the rest what is not a lamp's.
    surface: f32,
    /// Of the rest what exceeds the cap, up to the limit.
    lamp: f32,
}

impl Parts {
    fn of(light: &LightOctree, leaf: LeafNode, cap: f32) -> Self {
        let (own, open) = (lightness(light, leaf), light.unseen(leaf));
        let lamp = open * (own - cap).clamp(0.0, LIMIT * cap) / own.max(1e-6);
        Self { seen: 1.0 - open, surface: open - lamp, lamp }
    }
}

/// Luminance from which on a leaf shines.
fn cap(light: &LightOctree) -> f32 {
    let filled = light.octree.leaf_nodes().filter(|leaf| light.rgba[leaf.depth as usize][leaf.row][3] > 0.0);
    let (sum, area_m2) = filled.fold((0.0, 0.0), |(sum, total), leaf| {
        let area_m2 = light.cube.node_edge_m(leaf.depth).powi(2);
        (sum + lightness(light, leaf) * area_m2, total + area_m2)
    });
    CAP * sum / f32::max(area_m2, 1e-12)
}

/// Luminance of a leaf.
fn lightness(light: &LightOctree, leaf: LeafNode) -> f32 {
    luminance(light.radiance(leaf).to_array())
}

fn problem(light: &LightOctree, places: &[Place], cap: f32) -> Problem {
    // What leaves give, by channel: what is seen, guessed surfaces, lamps.
    let given = light.merged(|leaf| {
        let Parts { seen, surface, lamp } = Parts::of(light, leaf, cap);
        lightness(light, leaf) * Vec3::new(seen, surface, lamp)
    });
    let tracer = tracer(&LightOctree { rgba: light.rows_with(|depth, row, _| given[depth][row]), ..light.clone() });
    let at = places.iter().map(|place| (place.position_m, place.normal));
    let coming_in = irradiances(&tracer, at, offset_m(light));
    Problem {
        log_radiance: places.iter().map(|place| place.log_radiance).collect(),
        clipped: places.iter().map(|place| place.clipped).collect(),
        weights: places.iter().map(|place| place.weight).collect(),
        segments: places.iter().map(|place| place.segment).collect(),
        seen: coming_in.iter().map(|light| light.x).collect(),
        surfaces: coming_in.iter().map(|light| light.y).collect(),
        lamps: coming_in.iter().map(|light| light.z).collect(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_cone::{Cone, ConeTracer, Settings};
    use lo_geometry::{Camera, Cube};
    use lo_imaging::{DepthMap, Photo, RadianceImage};
    use lo_octree::{Coverage, RadiancePoint};

    use super::*;

    /// Half of the room's edge, and its albedo.
    const HALF_M: f32 = 2.0;
    const ALBEDO: f32 = 0.6;

    /// A cubic room around a camera that looks at its far wall, and a square lamp of this radiance in the left wall, which is not seen; the octree is
    /// told of a tenth of it. Everything else gives even light.
    fn room(lamp_radiance: f32) -> (LightOctree, Frame) {
        let lamp_m = Vec3::new(-HALF_M, 0.6, -1.0);
        let is_lamp = |p: Vec3| p.x < 0.01 - HALF_M && (p - lamp_m).abs().max_element() < 0.4;
        let mut points = Vec::new();
        for face in 0..6 {
            let at = |i: usize| HALF_M * ((i as f32 + 0.5) / 48.0 - 1.0);
            for (i, j) in (0..96 * 96).map(|n| (n % 96, n / 96)) {
                let mut p = [at(i), at(j), if face < 3 { -HALF_M } else { HALF_M }];
                p.rotate_right(2 - face % 3);
                let position_m = Vec3::from(p);
                let radiance = if is_lamp(position_m) { [0.1 * lamp_radiance; 3] } else { [0.1; 3] };
                points.push(RadiancePoint { position_m, radiance, coverage: Coverage::Inferred });
            }
        }
        let cube = Cube::centred(Vec3::ZERO, 2.2 * HALF_M);
        let light = LightOctree::from_points(&points, cube, 6, 3).unwrap().0;
        // What the far wall shows: even light, and the lamp's in closed form for small patches.
        let camera = Camera::from_hfov_deg(80.0, 480, 320).unwrap();
        let patches: Vec<Vec3> = (0..64)
            .map(|n| lamp_m + Vec3::new(0.0, 0.1 * ((n % 8) as f32 - 3.5), 0.1 * ((n / 8) as f32 - 3.5)))
            .collect();
        let photo = RadianceImage::from_fn(480, 320, |x, y| {
            let point = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(HALF_M));
            let of_patch = |patch: &Vec3| {
                let to = *patch - point;
                let direction = to.normalize();
                0.01 * direction.z.max(0.0) * (-direction.x).max(0.0) / to.length_squared()
            };
            let lamp = lamp_radiance * patches.iter().map(of_patch).sum::<f32>();
            [ALBEDO / std::f32::consts::PI * (0.1 * std::f32::consts::PI + lamp); 3]
        });
        let depth_m = DepthMap::from_fn(480, 320, |_, _| HALF_M);
        let frame = Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).unwrap();
        (light, frame)
    }

    #[test]
    fn a_lamp_that_is_guessed_too_dark_gets_as_bright_as_the_wall_says() {
        let (mut light, frame) = room(12.0);
        let fit = fit_lamps(&mut light, &frame);
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let cone = Cone { origin: Vec3::new(0.0, 0.6, -1.0), direction: Vec3::NEG_X, tan_half_angle: 0.05 };
        let radiance = tracer.trace(&cone).radiance[1];
        assert!((5.0..18.0).contains(&radiance), "{radiance}: {fit:?}");
        assert!(matches!(fit.warning(), Some(Warning::FittedLamps { lamps: Some(_), .. })), "{fit:?}");
    }

    #[test]
    fn irradiance_by_lamps_is_that_of_their_patches() {
        let (light, frame) = room(12.0);
        let (places, cap) = (places(&frame), cap(&light));
        let problem = problem(&light, &places, cap);
        let (mut sum, mut expected) = (0.0, 0.0);
        for (place, light) in places.iter().zip(&problem.lamps) {
            let point = place.position_m;
            for n in 0..64 {
                let patch = Vec3::new(-2.0, 0.6 + 0.1 * ((n % 8) as f32 - 3.5), -1.0 + 0.1 * ((n / 8) as f32 - 3.5));
                let to = patch - point;
                let direction = to.normalize();
                expected += 0.01 * direction.z.max(0.0) * (-direction.x).max(0.0) / to.length_squared();
            }
            sum += light;
        }
        // Of the lamp's radiance, 1.2, what lies above the cap. Leaves are a twelfth of it wide, and jut out.
        let excess = 1.2 - cap;
        let ratio = sum / (excess * expected);
        assert!((0.75..1.7).contains(&ratio), "{ratio}, excess {excess}");
    }

    #[test]
    fn even_light_stays() {
        let (mut light, frame) = room(0.1);
        let before = light.clone();
        let fit = fit_lamps(&mut light, &frame);
        assert!(fit.lamps_share < 1e-6 && (0.91..1.1).contains(&fit.surfaces), "{fit:?}");
        assert_eq!(fit.warning(), None);
        for (after, before) in light.rgba.iter().flatten().zip(before.rgba.iter().flatten()) {
            assert!((after[1] - fit.surfaces * before[1]).abs() < 1e-5 && after[3] == before[3]);
        }
    }

    #[test]
    fn lobes_are_taken_as_they_are_seen() {
        let (mut light, frame) = room(12.0);
        light.lobes = Some(light.rgba.iter().map(|rows| vec![[0.1, 0.0, 0.0]; rows.len()]).collect());
        assert!(fit_lamps(&mut light, &frame).lamps > 1.5 && light.lobes.is_none());
    }

    #[test]
    fn without_depth_nothing_is_changed() {
        let (mut light, mut frame) = room(12.0);
        frame.depth_m.pixels_mut().fill(0.0);
        let before = light.clone();
        assert_eq!((fit_lamps(&mut light, &frame), light), (LampFit::default(), before));
    }
}
