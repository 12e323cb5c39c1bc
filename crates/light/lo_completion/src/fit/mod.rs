//! Guessed lamps and windows as bright as the seen surfaces are shaded.
//!
//! A diffuse surface of constant albedo is as bright as the light that it gets: where a wall is brighter on its left there is more light on its
//! left. Networks know where lamps are better than how bright. Three factors, on all that is guessed of lamps, on what is seen of lamps but clipped
//! and on guessed surfaces, are the likeliest ones that explain the shading of segments of constant albedo (`solve`), with visibility through the
//! octree. For lamps placed by hand or matched from pictures the same is done in Karsch et al. 2011 and 2014 ("Rendering synthetic objects into legacy
//! photographs", "Automatic scene inference for 3D object compositing"); there the room's box is all that casts shadows, here it is the octree.

mod places;
mod solve;

use std::borrow::Cow;

use lo_events::Warning;
use lo_geometry::Vec3;
use lo_imaging::{RadianceImage, luminance};
use lo_octree::{LeafNode, LightOctree};
use lo_scene::Frame;

use crate::highlights;
use crate::irradiance::{irradiances, offset_m, tracer};
use crate::lamps::OBJECT_SHARE;
use places::{Place, places};
use solve::{Prior, Problem, Solution, solve};

/// What exceeds this multiple of the mean luminance is a lamp's or a window's, or of what they shine on.
const CAP: f32 = 2.0;

/// Of a lamp so many times as bright as the cap the rest stays: it is not one that was averaged away, and where it is wrong, it blinds.
const LIMIT: f32 = 4.0;

/// Lamps that give less than this share of the light on what is seen are none.
const MIN_SHARE: f32 = 0.02;

/// A preview looks at one of so many places.
const PREVIEW: usize = 7;

/// Logarithms of factors up to this size are not worth a word.
const NOTABLE: f32 = 0.1;

/// What was fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampFit {
    /// Factor on what is guessed of lamps and windows beyond what surfaces have.
    pub lamps: f32,
    /// Share of the light on what is seen that these give now, 0 to 1.
    pub lamps_share: f32,
    /// Factor on what the photo shows of lamps and windows but clipped, beyond white: 1 is what such regions usually have.
    pub clipped_lamps: f32,
    /// Share of the light on what is seen that these give now, 0 to 1.
    pub clipped_share: f32,
    /// Factor on the radiance of guessed surfaces.
    pub surfaces: f32,
}

impl Default for LampFit {
    /// Nothing.
    fn default() -> Self {
        Self { lamps: 1.0, lamps_share: 0.0, clipped_lamps: 1.0, clipped_share: 0.0, surfaces: 1.0 }
    }
}

impl LampFit {
    /// What a user should know about it.
    pub fn warning(&self) -> Option<Warning> {
        let Self { lamps, lamps_share, clipped_lamps, clipped_share, surfaces } = *self;
        let lamps = (lamps_share > MIN_SHARE).then_some(lamps);
        let clipped_lamps = (clipped_share > MIN_SHARE).then_some(clipped_lamps);
        let notable =
            lamps.into_iter().chain(clipped_lamps).chain([surfaces]).any(|factor| factor.ln().abs() > NOTABLE);
        notable.then_some(Warning::FittedLamps { lamps, lamps_share, clipped_lamps, clipped_share, surfaces })
    }
}

/// What lamps in an octree are before they are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LampGuess {
    /// Averaged away by a network that guesses the likeliest radiance: darker than they are.
    Averaged,
    /// As bright as is expected ([`crate::lay_expected`]).
    Expected,
}

impl LampGuess {
    /// Most that is fitted of a lamp, as a multiple of the cap.
    fn limit(self) -> f32 {
        match self {
            Self::Averaged => LIMIT,
            Self::Expected => f32::INFINITY,
        }
    }

    fn prior(self) -> Prior {
        match self {
            Self::Averaged => Prior::AVERAGED,
            Self::Expected => Prior::EXPECTED,
        }
    }
}

/// Shading of seen surfaces, prepared once to fit several lights to it.
#[derive(Clone, Debug)]
pub struct SeenShading {
    pub(crate) frame: Frame,
    pub(crate) up: Vec3,
    /// The photo's radiance with clipped regions as bright as these usually are ([`highlights::recover_shining`]).
    restored: RadianceImage,
    places: Vec<Place>,
}

impl SeenShading {
    /// `frame` at the working resolution ([`Frame::working`]) without flying pixels, `up` the direction against gravity in its camera's frame.
    pub fn new(frame: Frame, up: Vec3) -> Self {
        let normals = frame.normals();
        let restored = highlights::recover_shining(&frame, &normals, up).0;
        let places = places(&frame, &normals, &restored);
        Self { frame, up, restored, places }
    }
}

/// Makes guessed and clipped lamps and windows as bright as seen surfaces are shaded, and scales guessed surfaces; what is seen unclipped stays.
///
/// Where nodes have lobes, the octree becomes what is seen of it from the middle of the view.
pub fn fit_lamps(light: &mut LightOctree, seen: &SeenShading, guess: LampGuess) -> LampFit {
    fit(light, seen, guess, 1)
}

/// A preview of [`fit_lamps`] by a fraction of the places on seen surfaces, in a fraction of the time.
pub fn preview_lamps(light: &mut LightOctree, seen: &SeenShading, guess: LampGuess) -> LampFit {
    fit(light, seen, guess, PREVIEW)
}

/// By one of `step` places, which stands for the others.
fn fit(light: &mut LightOctree, seen: &SeenShading, guess: LampGuess, step: usize) -> LampFit {
    let thinned = |place: &Place| Place { weight: step as f32 * place.weight, ..*place };
    let places: Vec<Place> = seen.places.iter().step_by(step).map(thinned).collect();
    if places.is_empty() {
        return LampFit::default();
    }
    let middle_m = OBJECT_SHARE * places.iter().map(|place| place.position_m).sum::<Vec3>() / places.len() as f32;
    if let Cow::Owned(seen) = light.seen_from(middle_m) {
        *light = seen;
    }
    let bounds = Bounds {
        clipped: restore_clipped(light, seen),
        level: seen.frame.exposure,
        cap: cap(light),
        limit: guess.limit(),
    };
    let problem = problem(light, &places, &bounds, guess.prior());
    let solution = solve(&problem);
    let all = problem.irradiance(solution);
    let Solution { surfaces, lamps, clipped_lamps } = solution;
    let share = |factor: f32, of: &[f32]| {
        of.iter().zip(&all).map(|(part, all)| factor * part / all).sum::<f32>() / places.len() as f32
    };
    light.change_leaves(|light, leaf| {
        let Parts { surface, lamp, clipped, .. } = Parts::of(light, leaf, &bounds);
        let more = surface * (surfaces - 1.0) + lamp * (lamps - 1.0) + clipped * (clipped_lamps - 1.0);
        light.radiance(leaf) * (1.0 + more)
    });
    let (lamps_share, clipped_share) = (share(lamps, &problem.lamps), share(clipped_lamps, &problem.clipped_lamps));
    LampFit { lamps, lamps_share, clipped_lamps, clipped_share, surfaces }
}

/// `[depth][row]` of the leaves in which clipped pixels lie: the mean of these, restored.
pub(crate) type ClippedLeaves = Vec<Vec<Option<Vec3>>>;

/// Gives leaves with clipped pixels at least the radiance that such regions usually have, and says which they are: networks may guess less than the photo can
/// tell.
pub(crate) fn restore_clipped(light: &mut LightOctree, seen: &SeenShading) -> ClippedLeaves {
    let clipped = clipped_leaves(light, &seen.frame, &seen.restored);
    light.change_leaves(|light, leaf| {
        let (own, open) = (light.radiance(leaf), light.unseen(leaf));
        clipped[leaf.depth as usize][leaf.row].map_or(own, |restored| own.max(own.lerp(restored, open)))
    });
    clipped
}

/// What tells surfaces and lamps apart.
struct Bounds {
    clipped: ClippedLeaves,
    /// Radiance at which the photo clips.
    level: f32,
    /// Luminance from which on other leaves shine.
    cap: f32,
    /// Most that is fitted of a lamp, as a multiple of the cap.
    limit: f32,
}

fn clipped_leaves(light: &LightOctree, seen: &Frame, restored: &RadianceImage) -> ClippedLeaves {
    let clipped = seen.clipped();
    let mut sums: Vec<Vec<(Vec3, f32)>> = light.rgba.iter().map(|rows| vec![(Vec3::ZERO, 0.0); rows.len()]).collect();
    for (x, y) in (0..clipped.height()).flat_map(|y| (0..clipped.width()).map(move |x| (x, y))) {
        let point = if clipped[(x, y)] { seen.point(x, y) } else { None };
        let inside = point.map(|point| light.cube.pulled_inside(point));
        let Some((depth, node)) = inside.and_then(|point| light.locate(point, u32::MAX)) else { continue };
        let Ok(row) = usize::try_from(light.octree.levels()[depth as usize].rows[node]) else { continue };
        let (sum, count) = &mut sums[depth as usize][row];
        *sum += Vec3::from(restored[(x, y)]);
        *count += 1.0;
    }
    let mean = |(sum, count): (Vec3, f32)| (count > 0.0).then(|| sum / count);
    sums.into_iter().map(|rows| rows.into_iter().map(mean).collect()).collect()
}

/// Shares of a leaf's radiance; their sum is 1.
struct Parts {
    /// What the photo saw: up to where it clips.
    seen: f32,
    /// Of the rest what is not a lamp's.
    surface: f32,
    /// Of the rest what exceeds the cap, up to the limit.
    lamp: f32,
    /// What the photo saw but cannot tell, because it is clipped.
    clipped: f32,
}

impl Parts {
    fn of(light: &LightOctree, leaf: LeafNode, bounds: &Bounds) -> Self {
        let (own, open) = (lightness(light, leaf), light.unseen(leaf));
        let Bounds { ref clipped, level, cap, limit } = *bounds;
        if clipped[leaf.depth as usize][leaf.row].is_some() {
            let beyond = open * (1.0 - level / own.max(level));
            return Self { seen: 1.0 - beyond, surface: 0.0, lamp: 0.0, clipped: beyond };
        }
        let lamp = open * (own - cap).clamp(0.0, limit * cap) / own.max(1e-6);
        Self { seen: 1.0 - open, surface: open - lamp, lamp, clipped: 0.0 }
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

fn problem(light: &LightOctree, places: &[Place], bounds: &Bounds, prior: Prior) -> Problem {
    let coming_in = |of: &dyn Fn(Parts) -> Vec3| {
        let given = light.merged(|leaf| lightness(light, leaf) * of(Parts::of(light, leaf, bounds)));
        let tracer = tracer(&LightOctree { rgba: light.rows_with(|depth, row, _| given[depth][row]), ..light.clone() });
        irradiances(&tracer, places.iter().map(|place| (place.position_m, place.normal)), offset_m(light))
    };
    // By channel.
    let all = coming_in(&|Parts { seen, surface, lamp, .. }| Vec3::new(seen, surface, lamp));
    let is_clipped = bounds.clipped.iter().flatten().any(Option::is_some);
    let clipped_lamps =
        if is_clipped { coming_in(&|parts| Vec3::splat(parts.clipped)) } else { vec![Vec3::ZERO; all.len()] };
    Problem {
        log_radiance: places.iter().map(|place| place.log_radiance).collect(),
        clipped: places.iter().map(|place| place.clipped).collect(),
        weights: places.iter().map(|place| place.weight).collect(),
        segments: places.iter().map(|place| place.segment).collect(),
        seen: all.iter().map(|light| light.x).collect(),
        surfaces: all.iter().map(|light| light.y).collect(),
        lamps: all.iter().map(|light| light.z).collect(),
        clipped_lamps: clipped_lamps.iter().map(|light| light.x).collect(),
        prior,
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_cone::{Cone, ConeTracer, Settings};
    use lo_geometry::{Camera, Cube};
    use lo_imaging::{DepthMap, Photo, RadianceImage};
    use lo_octree::{Provenance, RadiancePoint};

    use super::*;

    /// Half of the room's edge, and its albedo.
    const HALF_M: f32 = 2.0;
    const ALBEDO: f32 = 0.6;

    fn shading(frame: &Frame) -> SeenShading {
        SeenShading::new(frame.clone(), Vec3::Y)
    }

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
                points.push(RadiancePoint { position_m, radiance, provenance: Provenance::Inferred });
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
        let mut previewed = light.clone();
        let fit = fit_lamps(&mut light, &shading(&frame), LampGuess::Averaged);
        let preview = preview_lamps(&mut previewed, &shading(&frame), LampGuess::Averaged);
        let ratios = [preview.lamps / fit.lamps, preview.surfaces / fit.surfaces];
        assert!(ratios.iter().all(|ratio| (ratio.ln()).abs() < 0.1), "{preview:?} {fit:?}");
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let cone = Cone { origin: Vec3::new(0.0, 0.6, -1.0), direction: Vec3::NEG_X, tan_half_angle: 0.05 };
        let radiance = tracer.trace(&cone).radiance[1];
        assert!((5.0..18.0).contains(&radiance), "{radiance}: {fit:?}");
        // By the photo, a lamp of radiance 12 gives what exceeds even light.
        let Photo::Linear(photo) = &frame.photo else { panic!("it is linear") };
        let true_share =
            photo.pixels().iter().map(|pixel| 1.0 - 0.1 * ALBEDO / pixel[0]).sum::<f32>() / (480.0 * 320.0);
        let odds = |share: f32| share / (1.0 - share);
        let expected = radiance / 12.0 / fit.surfaces * odds(true_share);
        assert!((odds(fit.lamps_share) / expected - 1.0).abs() < 0.3, "{expected}: {fit:?}");
        assert!(matches!(fit.warning(), Some(Warning::FittedLamps { lamps: Some(_), .. })), "{fit:?}");
    }

    #[test]
    fn irradiance_by_lamps_is_that_of_their_patches() {
        let (light, frame) = room(12.0);
        let (places, cap) = (places(&frame, &frame.normals(), &frame.radiance()), cap(&light));
        let clipped = clipped_leaves(&light, &frame, &frame.radiance());
        let problem = problem(&light, &places, &Bounds { clipped, level: 1.0, cap, limit: LIMIT }, Prior::AVERAGED);
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

    /// What the camera of [`room`] sees of a square lamp of this radiance in the middle of its wall: it is clipped.
    fn with_clipped_lamp(light: &mut LightOctree, frame: &mut Frame, guess: f32) {
        let in_lamp = |p: Vec3| p.z < 0.05 - HALF_M && p.truncate().abs().max_element() < 0.5;
        light.change_leaves(|light, leaf| {
            let own = light.radiance(leaf);
            if in_lamp(light.node_middle_m(leaf.depth, light.octree.key(leaf))) { Vec3::splat(guess) } else { own }
        });
        let Photo::Linear(photo) = &frame.photo else { panic!("it is linear") };
        let camera = frame.camera;
        let photo = RadianceImage::from_fn(480, 320, |x, y| {
            let point = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(HALF_M));
            if in_lamp(point) { [1.0; 3] } else { photo[(x, y)].map(|c| c.min(0.9)) }
        });
        frame.photo = Photo::Linear(photo);
    }

    #[test]
    fn a_clipped_lamp_asks_for_no_light_and_gets_what_such_lamps_have() {
        let (mut light, mut frame) = room(0.1);
        with_clipped_lamp(&mut light, &mut frame, 0.9);
        let fit = fit_lamps(&mut light, &shading(&frame), LampGuess::Averaged);
        // As a white surface it would ask for E = π, ten times what there is.
        assert!((0.9..1.1).contains(&fit.surfaces), "{fit:?}");
        // The lamp lies in the wall that is seen, and does not light it.
        assert!(fit.lamps_share == 0.0 && fit.clipped_share < 0.01, "{fit:?}");
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let cone = Cone { origin: Vec3::ZERO, direction: Vec3::NEG_Z, tan_half_angle: 0.05 };
        let radiance = tracer.trace(&cone).radiance[1];
        // A region as large as that: 5.9, in the middle more.
        assert!((4.0..15.0).contains(&radiance), "{radiance}: {fit:?}");
    }

    #[test]
    fn even_light_stays() {
        let (mut light, frame) = room(0.1);
        let before = light.clone();
        let fit = fit_lamps(&mut light, &shading(&frame), LampGuess::Averaged);
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
        assert!(fit_lamps(&mut light, &shading(&frame), LampGuess::Averaged).lamps > 1.5 && light.lobes.is_none());
    }

    #[test]
    fn without_depth_nothing_is_changed() {
        let (mut light, mut frame) = room(12.0);
        frame.depth_m.pixels_mut().fill(0.0);
        let before = light.clone();
        assert_eq!((fit_lamps(&mut light, &shading(&frame), LampGuess::Averaged), light), (LampFit::default(), before));
    }

    #[test]
    fn photo_and_depth_of_two_resolutions_change_nothing() {
        let (mut light, mut frame) = room(12.0);
        with_clipped_lamp(&mut light, &mut frame, 0.9);
        frame.depth_m = DepthMap::from_fn(240, 160, |_, _| HALF_M);
        let before = light.clone();
        assert_eq!((fit_lamps(&mut light, &shading(&frame), LampGuess::Averaged), light), (LampFit::default(), before));
    }
}
