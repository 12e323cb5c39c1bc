//! Fitting of inferred lamps and windows to the shading of observed surfaces.
//!
//! A diffuse surface of constant albedo is as bright as the light that it receives: where a wall is brighter on its
//! left, there is more light on its left. Networks predict the positions of lamps better than their brightness. Three
//! factors are fitted by maximum a posteriori estimation: on inferred lamps, on observed but clipped lamps, and on
//! inferred surfaces. They explain the shading of segments of constant albedo (`solve`), with visibility through the
//! octree.
//!
//! Karsch et al. 2011 and 2014 do the same for lamps placed by hand or matched from images ("Rendering synthetic
//! objects into legacy photographs", "Automatic scene inference for 3D object compositing"). There only the room's box
//! casts shadows; here the octree does.

mod shading_samples;
mod solve;

use std::borrow::Cow;

use lo_geometry::Vec3;
use lo_imaging::{Image, RadianceImage, luminance};
use lo_octree::{LeafNode, LightOctree};
use lo_scene::Frame;

use crate::highlights;
use crate::irradiance::{irradiances, offset_m, tracer};
use crate::lamps::OBJECT_SHARE;
use crate::warning::CompletionWarning;
use shading_samples::{ShadingSample, shading_samples};
use solve::{Prior, Problem, Solution, solve};

/// Multiple of the mean luminance above which radiance belongs to a lamp, a window or a surface that they illuminate.
const CAP: f32 = 2.0;

/// Multiple of the cap up to which a lamp is scaled. Such a lamp was not averaged away by a network, and scaling a
/// wrong one would dazzle.
const LIMIT: f32 = 4.0;

/// Least share of a lamp in the light on observed surfaces.
const MIN_SHARE: f32 = 0.02;

/// A preview uses one of so many samples.
const PREVIEW: usize = 7;

/// Least logarithm of a factor that is reported.
const NOTABLE: f32 = 0.1;

/// Result of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LampFit {
    /// Factor on inferred lamps and windows, applied to their radiance above that of surfaces.
    pub lamps: f32,
    /// Share of these lamps in the light on observed surfaces after the fit, 0 to 1.
    pub lamps_share: f32,
    /// Factor on lamps and windows that are clipped in the photo, applied to their radiance above white. 1 is the
    /// typical value of such regions.
    pub clipped_lamps: f32,
    /// Share of clipped lamps in the light on observed surfaces after the fit, 0 to 1.
    pub clipped_share: f32,
    /// Factor on the radiance of inferred surfaces.
    pub surfaces: f32,
}

impl Default for LampFit {
    /// Returns the identity fit.
    fn default() -> Self {
        Self { lamps: 1.0, lamps_share: 0.0, clipped_lamps: 1.0, clipped_share: 0.0, surfaces: 1.0 }
    }
}

impl LampFit {
    /// Returns the warning about a notable fit.
    pub fn warning(&self) -> Option<CompletionWarning> {
        let Self { lamps, lamps_share, clipped_lamps, clipped_share, surfaces } = *self;
        let lamps = (lamps_share > MIN_SHARE).then_some(lamps);
        let clipped_lamps = (clipped_share > MIN_SHARE).then_some(clipped_lamps);
        let notable =
            lamps.into_iter().chain(clipped_lamps).chain([surfaces]).any(|factor| factor.ln().abs() > NOTABLE);
        notable.then_some(CompletionWarning::FittedLamps { lamps, lamps_share, clipped_lamps, clipped_share, surfaces })
    }
}

/// State of the lamps in an octree before they are fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InitialLamps {
    /// Averaged away by a network that predicts the likeliest radiance: darker than they are.
    Averaged,
    /// As bright as expected ([`crate::apply_expected_light`]).
    Expected,
}

impl InitialLamps {
    /// Returns the greatest radiance of a lamp that is scaled, as a multiple of the cap.
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

/// Shading of observed surfaces, prepared once to fit several lights to it.
#[derive(Clone, Debug)]
pub struct ObservedShading {
    pub(crate) frame: Frame,
    pub(crate) up: Vec3,
    /// The photo's radiance with clipped regions at their typical brightness ([`highlights::restore_highlights`]).
    restored: RadianceImage,
    samples: Vec<ShadingSample>,
}

impl ObservedShading {
    /// Prepares a frame at working resolution ([`Frame::working`]) without flying pixels, with its [`Frame::normals`].
    /// `up` is the direction against gravity in its camera's frame.
    pub fn new(frame: Frame, normals: &Image<Option<Vec3>>, up: Vec3) -> Self {
        let restored = highlights::restore_highlights(&frame, normals, up).0;
        let samples = shading_samples(&frame, normals, &restored);
        Self { frame, up, restored, samples }
    }
}

/// Scales inferred and clipped lamps and windows, and inferred surfaces, to match the shading of observed surfaces.
/// Unclipped observed radiance is kept.
///
/// If nodes have lobes, the octree becomes its view from the middle of the observed surfaces.
pub fn fit_lamps(light: &mut LightOctree, seen: &ObservedShading, guess: InitialLamps) -> LampFit {
    fit(light, seen, guess, 1)
}

/// Previews [`fit_lamps`] with a fraction of the samples, in a fraction of the time.
pub fn preview_lamps(light: &mut LightOctree, seen: &ObservedShading, guess: InitialLamps) -> LampFit {
    fit(light, seen, guess, PREVIEW)
}

/// Fits to every `step`th sample, weighted accordingly.
fn fit(light: &mut LightOctree, seen: &ObservedShading, guess: InitialLamps, step: usize) -> LampFit {
    let thinned = |sample: &ShadingSample| ShadingSample { weight: step as f32 * sample.weight, ..*sample };
    let samples: Vec<ShadingSample> = seen.samples.iter().step_by(step).map(thinned).collect();
    if samples.is_empty() {
        return LampFit::default();
    }
    let middle_m = OBJECT_SHARE * samples.iter().map(|sample| sample.position_m).sum::<Vec3>() / samples.len() as f32;
    if let Cow::Owned(seen) = light.seen_from(middle_m) {
        *light = seen;
    }
    let thresholds = LampThresholds {
        clipped: restore_clipped(light, seen),
        level: seen.frame.exposure,
        cap: cap(light),
        limit: guess.limit(),
    };
    let problem = problem(light, &samples, &thresholds, guess.prior());
    let solution = solve(&problem);
    let all = problem.irradiance(solution);
    let Solution { surfaces, lamps, clipped_lamps } = solution;
    let share = |factor: f32, of: &[f32]| {
        of.iter().zip(&all).map(|(part, all)| factor * part / all).sum::<f32>() / samples.len() as f32
    };
    light.change_leaves(|light, leaf| {
        let RadianceShares { surface, lamp, clipped, .. } = RadianceShares::of(light, leaf, &thresholds);
        let more = surface * (surfaces - 1.0) + lamp * (lamps - 1.0) + clipped * (clipped_lamps - 1.0);
        light.radiance(leaf) * (1.0 + more)
    });
    let (lamps_share, clipped_share) = (share(lamps, &problem.lamps), share(clipped_lamps, &problem.clipped_lamps));
    LampFit { lamps, lamps_share, clipped_lamps, clipped_share, surfaces }
}

/// `[depth][row]`: mean restored radiance of the clipped pixels in each leaf; `None` for leaves without any.
pub(crate) type ClippedLeaves = Vec<Vec<Option<Vec3>>>;

/// Raises leaves with clipped pixels to at least the typical radiance of such regions and returns them. A network may
/// predict less than the photo shows.
pub(crate) fn restore_clipped(light: &mut LightOctree, seen: &ObservedShading) -> ClippedLeaves {
    let clipped = clipped_leaves(light, &seen.frame, &seen.restored);
    light.change_leaves(|light, leaf| {
        let (own, open) = (light.radiance(leaf), light.unseen(leaf));
        clipped[leaf.depth as usize][leaf.row].map_or(own, |restored| own.max(own.lerp(restored, open)))
    });
    clipped
}

/// Thresholds that separate surfaces from lamps.
struct LampThresholds {
    clipped: ClippedLeaves,
    /// Radiance at which the photo clips.
    level: f32,
    /// Luminance above which other leaves emit light.
    cap: f32,
    /// Greatest radiance of a lamp that is scaled, as a multiple of the cap.
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
struct RadianceShares {
    /// Observed, up to the clipping level.
    seen: f32,
    /// Unobserved, from surfaces.
    surface: f32,
    /// Unobserved, above the cap and up to the limit: from lamps.
    lamp: f32,
    /// Observed but clipped: the part above the clipping level.
    clipped: f32,
}

impl RadianceShares {
    fn of(light: &LightOctree, leaf: LeafNode, thresholds: &LampThresholds) -> Self {
        let (own, open) = (lightness(light, leaf), light.unseen(leaf));
        let LampThresholds { ref clipped, level, cap, limit } = *thresholds;
        if clipped[leaf.depth as usize][leaf.row].is_some() {
            let beyond = open * (1.0 - level / own.max(level));
            return Self { seen: 1.0 - beyond, surface: 0.0, lamp: 0.0, clipped: beyond };
        }
        let lamp = open * (own - cap).clamp(0.0, limit * cap) / own.max(1e-6);
        Self { seen: 1.0 - open, surface: open - lamp, lamp, clipped: 0.0 }
    }
}

/// Returns the luminance above which a leaf emits light.
fn cap(light: &LightOctree) -> f32 {
    let filled = light.octree.leaf_nodes().filter(|leaf| light.rgba[leaf.depth as usize][leaf.row][3] > 0.0);
    let (sum, area_m2) = filled.fold((0.0, 0.0), |(sum, total), leaf| {
        let area_m2 = light.cube.node_edge_m(leaf.depth).powi(2);
        (sum + lightness(light, leaf) * area_m2, total + area_m2)
    });
    CAP * sum / f32::max(area_m2, 1e-12)
}

/// Returns the luminance of a leaf.
fn lightness(light: &LightOctree, leaf: LeafNode) -> f32 {
    luminance(light.radiance(leaf).to_array())
}

fn problem(light: &LightOctree, samples: &[ShadingSample], thresholds: &LampThresholds, prior: Prior) -> Problem {
    let coming_in = |of: &dyn Fn(RadianceShares) -> Vec3| {
        let given = light.merged(|leaf| lightness(light, leaf) * of(RadianceShares::of(light, leaf, thresholds)));
        let tracer = tracer(&LightOctree { rgba: light.rows_with(|depth, row, _| given[depth][row]), ..light.clone() });
        irradiances(&tracer, samples.iter().map(|sample| (sample.position_m, sample.normal)), offset_m(light))
    };
    // The three shares are traced as the three channels.
    let all = coming_in(&|RadianceShares { seen, surface, lamp, .. }| Vec3::new(seen, surface, lamp));
    let is_clipped = thresholds.clipped.iter().flatten().any(Option::is_some);
    let clipped_lamps =
        if is_clipped { coming_in(&|parts| Vec3::splat(parts.clipped)) } else { vec![Vec3::ZERO; all.len()] };
    Problem {
        log_radiance: samples.iter().map(|sample| sample.log_radiance).collect(),
        clipped: samples.iter().map(|sample| sample.clipped).collect(),
        weights: samples.iter().map(|sample| sample.weight).collect(),
        segments: samples.iter().map(|sample| sample.segment).collect(),
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

    fn shading(frame: &Frame) -> ObservedShading {
        ObservedShading::new(frame.clone(), &frame.normals(), Vec3::Y)
    }

    /// A cubic room around a camera that looks at its far wall. The left wall has a square lamp of this radiance,
    /// outside the view; the octree has a tenth of it. Everything else has uniform radiance.
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
        // The far wall is lit by uniform light and by the lamp, in closed form for small patches.
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
    fn a_lamp_that_is_inferred_too_dark_gets_as_bright_as_the_wall_says() {
        let (mut light, frame) = room(12.0);
        let mut previewed = light.clone();
        let fit = fit_lamps(&mut light, &shading(&frame), InitialLamps::Averaged);
        let preview = preview_lamps(&mut previewed, &shading(&frame), InitialLamps::Averaged);
        let ratios = [preview.lamps / fit.lamps, preview.surfaces / fit.surfaces];
        assert!(ratios.iter().all(|ratio| (ratio.ln()).abs() < 0.1), "{preview:?} {fit:?}");
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let cone = Cone { origin: Vec3::new(0.0, 0.6, -1.0), direction: Vec3::NEG_X, tan_half_angle: 0.05 };
        let radiance = tracer.trace(&cone).radiance[1];
        assert!((5.0..18.0).contains(&radiance), "{radiance}: {fit:?}");
        // In the photo, a lamp of radiance 12 causes the light above the uniform level.
        let Photo::Linear(photo) = &frame.photo else { panic!("it is linear") };
        let true_share =
            photo.pixels().iter().map(|pixel| 1.0 - 0.1 * ALBEDO / pixel[0]).sum::<f32>() / (480.0 * 320.0);
        let odds = |share: f32| share / (1.0 - share);
        let expected = radiance / 12.0 / fit.surfaces * odds(true_share);
        assert!((odds(fit.lamps_share) / expected - 1.0).abs() < 0.3, "{expected}: {fit:?}");
        assert!(matches!(fit.warning(), Some(CompletionWarning::FittedLamps { lamps: Some(_), .. })), "{fit:?}");
    }

    #[test]
    fn irradiance_by_lamps_is_that_of_their_patches() {
        let (light, frame) = room(12.0);
        let (samples, cap) = (shading_samples(&frame, &frame.normals(), &frame.radiance()), cap(&light));
        let clipped = clipped_leaves(&light, &frame, &frame.radiance());
        let problem =
            problem(&light, &samples, &LampThresholds { clipped, level: 1.0, cap, limit: LIMIT }, Prior::AVERAGED);
        let (mut sum, mut expected) = (0.0, 0.0);
        for (sample, light) in samples.iter().zip(&problem.lamps) {
            let point = sample.position_m;
            for n in 0..64 {
                let patch = Vec3::new(-2.0, 0.6 + 0.1 * ((n % 8) as f32 - 3.5), -1.0 + 0.1 * ((n / 8) as f32 - 3.5));
                let to = patch - point;
                let direction = to.normalize();
                expected += 0.01 * direction.z.max(0.0) * (-direction.x).max(0.0) / to.length_squared();
            }
            sum += light;
        }
        // The part of the lamp's radiance, 1.2, above the cap. Leaves are a twelfth as wide as the lamp, and stick out.
        let excess = 1.2 - cap;
        let ratio = sum / (excess * expected);
        assert!((0.75..1.7).contains(&ratio), "{ratio}, excess {excess}");
    }

    /// Adds a clipped square lamp in the middle of the far wall of [`room`], with the radiance `guess` in the octree.
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
        let fit = fit_lamps(&mut light, &shading(&frame), InitialLamps::Averaged);
        // Taken for a white surface it would imply E = π, ten times the actual light.
        assert!((0.9..1.1).contains(&fit.surfaces), "{fit:?}");
        // The lamp is in the observed wall and does not light it.
        assert!(fit.lamps_share == 0.0 && fit.clipped_share < 0.01, "{fit:?}");
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let cone = Cone { origin: Vec3::ZERO, direction: Vec3::NEG_Z, tan_half_angle: 0.05 };
        let radiance = tracer.trace(&cone).radiance[1];
        // A region of this size gets 5.9, more in its middle.
        assert!((4.0..15.0).contains(&radiance), "{radiance}: {fit:?}");
    }

    #[test]
    fn even_light_stays() {
        let (mut light, frame) = room(0.1);
        let before = light.clone();
        let fit = fit_lamps(&mut light, &shading(&frame), InitialLamps::Averaged);
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
        assert!(fit_lamps(&mut light, &shading(&frame), InitialLamps::Averaged).lamps > 1.5 && light.lobes.is_none());
    }

    #[test]
    fn without_depth_nothing_is_changed() {
        let (mut light, mut frame) = room(12.0);
        frame.depth_m.pixels_mut().fill(0.0);
        let before = light.clone();
        assert_eq!(
            (fit_lamps(&mut light, &shading(&frame), InitialLamps::Averaged), light),
            (LampFit::default(), before)
        );
    }

    #[test]
    fn photo_and_depth_of_two_resolutions_change_nothing() {
        let (mut light, mut frame) = room(12.0);
        with_clipped_lamp(&mut light, &mut frame, 0.9);
        frame.depth_m = DepthMap::from_fn(240, 160, |_, _| HALF_M);
        let before = light.clone();
        assert_eq!(
            (fit_lamps(&mut light, &shading(&frame), InitialLamps::Averaged), light),
            (LampFit::default(), before)
        );
    }
}
