//! Lamps and windows as bright as the seen surfaces are shaded.
//!
//! A diffuse surface of constant albedo is as bright as the light that it gets: where a wall is brighter on its left there is more light on its
//! left. Candidates are bright regions, which may be brighter still, and soft discs on what is not seen (`candidates`); the sparsest non-negative
//! radiances are sought that explain the shading of segments of constant albedo (`solve`), with visibility through the octree. The same is done
//! by hand or with trained matching in Karsch et al. 2011 and 2014 ("Rendering synthetic objects into legacy photographs", "Automatic scene inference for 3D
//! object compositing"); there the room's box is all that casts shadows, here it is the octree.

mod candidates;
mod places;
mod solve;

use std::borrow::Cow;

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_events::Warning;
use lo_geometry::Vec3;
use lo_imaging::luminance;
use lo_octree::LightOctree;
use lo_scene::{Frame, Room};

use crate::irradiance::{irradiances, offset_m, tracer};
use crate::lamps::OBJECT_SHARE;
pub use candidates::scale_guessed;
use candidates::{Candidate, Candidates, Disc, Shape};
use places::{Place, places};
use solve::{Problem, solve};

/// What a new lamp costs that gives a place as much light as everything else, in half squared deviations of the place.
const SPARSITY: f32 = 5.0;

/// What a known lamp's being brighter costs, as a share of what a new one costs.
const KNOWN: f32 = 0.1;

/// Cosine, at a place or at a lamp, below which a lamp is not looked for.
const MIN_COSINE: f32 = 0.01;

/// Lamps that give less than this share of the light on what is seen are none.
const MIN_SHARE: f32 = 0.02;

/// A lamp or window that gives more light than was known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FittedLamp {
    /// Its middle, metres.
    pub position_m: Vec3,
    /// Whether nothing was known of it; else it is brighter than was thought.
    pub is_new: bool,
    /// Radiance in its middle; of one that was known, by how many times it is brighter.
    pub radiance: f32,
    /// Share of the light on what is seen, 0 to 1.
    pub share: f32,
}

/// What was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct LampFit {
    /// The brightest first.
    pub lamps: Vec<FittedLamp>,
    /// Factor on the radiance of what is not seen.
    pub scale: f32,
}

impl Default for LampFit {
    /// Nothing.
    fn default() -> Self {
        Self { lamps: Vec::new(), scale: 1.0 }
    }
}

impl LampFit {
    /// What a user should know about it.
    pub fn warning(&self) -> Option<Warning> {
        let assumed = self.lamps.iter().filter(|lamp| lamp.is_new).count();
        let share = self.lamps.iter().map(|lamp| lamp.share).sum();
        let fitted = Warning::FittedLamps { brighter: self.lamps.len() - assumed, assumed, share };
        (!self.lamps.is_empty()).then_some(fitted)
    }
}

/// Makes lamps and windows brighter, and adds lamps where nothing is seen, so that seen surfaces are shaded as they are; scales what is guessed.
///
/// `seen` is the frame at the working resolution ([`Frame::working`]) without flying pixels. Where nodes have lobes, the octree becomes what is
/// seen of it from the middle of the view.
pub fn fit_lamps(light: &mut LightOctree, seen: &Frame, room: &Room) -> LampFit {
    let places = places(seen);
    if places.is_empty() {
        return LampFit::default();
    }
    let middle_m = OBJECT_SHARE * places.iter().map(|place| place.position_m).sum::<Vec3>() / places.len() as f32;
    if let Cow::Owned(seen) = light.seen_from(middle_m) {
        *light = seen;
    }
    let candidates = Candidates::new(light, room);
    let problem = problem(light, &places, &candidates, offset_m(light));
    let mut solution = solve(&problem);
    let all = problem.irradiance(&solution);
    let mut lamps = Vec::new();
    for (j, candidate) in candidates.all.iter().enumerate() {
        let of_place = |(lamp, all): (&f32, &f32)| solution.radiance[j] * lamp / all;
        let share = problem.lamps[j].iter().zip(&all).map(of_place).sum::<f32>() / places.len() as f32;
        if share > MIN_SHARE {
            let is_new = matches!(candidate.shape, Shape::Disc(_));
            lamps.push(FittedLamp { position_m: candidate.position_m, is_new, radiance: solution.radiance[j], share });
        } else {
            solution.radiance[j] = 0.0;
        }
    }
    lamps.sort_by(|a, b| b.share.total_cmp(&a.share));
    candidates.shine(light, &solution.radiance, solution.scale);
    LampFit { lamps, scale: solution.scale }
}

fn problem(light: &LightOctree, places: &[Place], candidates: &Candidates, offset_m: f32) -> Problem {
    // What each row gives off, by its radiance and by the share of it that was seen.
    let giving = |of: &dyn Fn(Vec3, f32) -> Vec3| {
        let seen = |depth: usize, row: usize| f32::from(light.seen[depth][row]) / 255.0;
        let rgba = light.rows_with(|depth, row, radiance| of(radiance, seen(depth, row)));
        tracer(&LightOctree { rgba, ..light.clone() })
    };
    let coming_in = |tracer: &ConeTracer| {
        irradiances(tracer, places.iter().map(|place| (place.position_m, place.normal)), offset_m)
    };
    let seen = coming_in(&giving(&|radiance, seen| seen * radiance));
    let guessed = coming_in(&giving(&|radiance, seen| (1.0 - seen) * radiance));
    let open = giving(&|_, seen| Vec3::splat(1.0 - seen));
    let excess = tracer(&candidates.excess(light));
    let lamps: Vec<Vec<f32>> = candidates
        .all
        .iter()
        .map(|candidate| match &candidate.shape {
            Shape::Disc(disc) => by_disc(&open, candidate.position_m, disc, places, offset_m),
            Shape::Bright { nodes } => by_bright(&excess, nodes, places, offset_m),
        })
        .collect();
    // What a place gets is at least what it gives.
    let least = |((seen, guessed), place): ((&f32, &f32), &Place)| {
        (seen + guessed).max(std::f32::consts::PI * place.log_radiance.exp())
    };
    let mean: Vec<f32> = seen.iter().zip(&guessed).zip(places).map(least).collect();
    let total: f32 = places.iter().map(|place| place.weight).sum();
    let cost = |(lamp, candidate): (&Vec<f32>, &Candidate)| {
        let share = lamp.iter().zip(&mean).map(|(lamp, all)| lamp / all).sum::<f32>() / places.len() as f32;
        let known = match candidate.shape {
            Shape::Bright { .. } => KNOWN,
            Shape::Disc(_) => 1.0,
        };
        SPARSITY * total * share.max(1e-6) * known
    };
    let costs = lamps.iter().zip(&candidates.all).map(cost).collect();
    Problem {
        log_radiance: places.iter().map(|place| place.log_radiance).collect(),
        clipped: places.iter().map(|place| place.clipped).collect(),
        weights: places.iter().map(|place| place.weight).collect(),
        segments: places.iter().map(|place| place.segment).collect(),
        seen,
        guessed,
        lamps,
        costs,
    }
}

/// A cone to something that may shine on a place.
struct Sight {
    /// Number of the place.
    place: usize,
    cone: Cone,
    distance_m: f32,
    /// Cosine of its angle to the place's normal.
    cosine: f32,
}

impl Sight {
    /// To what lies at `target_m` and has this radius, where it is before the place and the place not in it. The cone's tangent is `width` radii by the distance.
    fn new((place, from): (usize, &Place), target_m: Vec3, radius_m: f32, width: f32, offset_m: f32) -> Option<Self> {
        let origin = from.position_m + offset_m * from.normal;
        let to = target_m - origin;
        let distance_m = to.length();
        let direction = to / distance_m.max(1e-6);
        let cosine = from.normal.dot(direction);
        let cone = Cone { origin, direction, tan_half_angle: width * radius_m / distance_m };
        (cosine > MIN_COSINE && distance_m >= radius_m).then_some(Self { place, cone, distance_m, cosine })
    }
}

/// Adds for each place what its sights see, as `irradiance` has it.
fn seen_light(
    tracer: &ConeTracer,
    sights: &[Sight],
    places: usize,
    irradiance: impl Fn(&Sight, &ConeSample) -> f32,
) -> Vec<f32> {
    let cones: Vec<Cone> = sights.iter().map(|sight| sight.cone).collect();
    let mut samples = vec![ConeSample::default(); cones.len()];
    tracer.trace_batch(&cones, &mut samples);
    let mut light = vec![0.0; places];
    for (sight, sample) in sights.iter().zip(&samples) {
        light[sight.place] += irradiance(sight, sample);
    }
    light
}

/// Irradiance of each place by a disc of radiance 1, as far as it is in sight: `open` is 1 where nothing is seen.
fn by_disc(open: &ConeTracer, middle_m: Vec3, disc: &Disc, places: &[Place], offset_m: f32) -> Vec<f32> {
    let facing = |sight: &Sight| disc.normal.map_or(1.0, |normal| -normal.dot(sight.cone.direction));
    let sights = places.iter().enumerate();
    let sights = sights.filter_map(|place| Sight::new(place, middle_m, disc.radius_m, 0.7, offset_m));
    let sights: Vec<Sight> = sights.filter(|sight| facing(sight) > MIN_COSINE).collect();
    seen_light(open, &sights, places.len(), |sight, sample| {
        // What is met well before the lamp hides it.
        let missing = (sight.distance_m - sample.distance_m) / disc.radius_m;
        let in_sight = (1.0 - (missing - 1.0)).clamp(0.0, 1.0);
        let unshadowed = sight.cosine * facing(sight) * disc.area_m2 / (sight.distance_m * sight.distance_m);
        unshadowed * luminance(sample.radiance) * in_sight
    })
}

/// Irradiance of each place by what a bright region has above surfaces: `excess` shows nothing else. One cone to what
/// shines in each of its coarse nodes, as wide as that.
fn by_bright(excess: &ConeTracer, nodes: &[(Vec3, f32)], places: &[Place], offset_m: f32) -> Vec<f32> {
    let to_nodes = |place: (usize, &Place)| -> Vec<Sight> {
        nodes.iter().filter_map(|&(node_m, radius_m)| Sight::new(place, node_m, radius_m, 1.0, offset_m)).collect()
    };
    let sights: Vec<Sight> = places.iter().enumerate().flat_map(to_nodes).collect();
    seen_light(excess, &sights, places.len(), |sight, sample| {
        let tangent = sight.cone.tan_half_angle;
        sight.cosine * std::f32::consts::PI * tangent * tangent * luminance(sample.radiance)
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_cone::Settings;
    use lo_geometry::{Camera, Cube, Plane};
    use lo_imaging::{DepthMap, Photo, RadianceImage};
    use lo_octree::{Coverage, RadiancePoint};
    use lo_scene::{RoomPlane, Side};

    use super::*;

    /// Half of the room's edge, and its albedo.
    const HALF_M: f32 = 2.0;
    const ALBEDO: f32 = 0.6;

    /// A cubic room around a camera that looks at its far wall, and a square lamp of this radiance in the left wall, which is not seen; the octree is
    /// told of a tenth of it. Everything else gives even light.
    fn room(lamp_radiance: f32) -> (LightOctree, Frame, Room) {
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
        let plane = |normal: Vec3| {
            let side = if normal.y > 0.5 {
                Side::Floor
            } else if normal.y < -0.5 {
                Side::Ceiling
            } else {
                Side::Wall
            };
            RoomPlane { side, plane: Plane::through(-HALF_M * normal, normal), measured: true }
        };
        let planes = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].map(plane).to_vec();
        (light, frame, Room { up: Vec3::Y, planes })
    }

    #[test]
    fn a_lamp_that_is_guessed_too_dark_gets_as_bright_as_the_wall_says() {
        let (mut light, frame, room) = room(12.0);
        let fit = fit_lamps(&mut light, &frame, &room);
        let lamp = fit.lamps[0];
        assert!(!lamp.is_new && (lamp.position_m - Vec3::new(-2.0, 0.6, -1.0)).length() < 0.3, "{fit:?}");
        // Of its excess above the cap; the albedo is not known, and the least that explains the
        // wall is taken.
        let tracer = ConeTracer::new(&light, Settings::default()).unwrap();
        let cone = Cone { origin: Vec3::new(0.0, 0.6, -1.0), direction: Vec3::NEG_X, tan_half_angle: 0.05 };
        let radiance = tracer.trace(&cone).radiance[1];
        assert!((4.8..20.0).contains(&radiance), "{radiance}: {fit:?}");
        assert!(matches!(fit.warning(), Some(Warning::FittedLamps { brighter: 1, .. })), "{fit:?}");
    }

    #[test]
    fn irradiance_by_a_bright_region_is_that_of_its_patches() {
        let (light, frame, room) = room(12.0);
        let (places, candidates) = (places(&frame), Candidates::new(&light, &room));
        let problem = problem(&light, &places, &candidates, offset_m(&light));
        assert!(matches!(candidates.all[0].shape, Shape::Bright { .. }));
        assert!(candidates.all[1..].iter().all(|candidate| matches!(candidate.shape, Shape::Disc(_))));
        let (mut sum, mut expected) = (0.0, 0.0);
        for (place, light) in places.iter().zip(&problem.lamps[0]) {
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
        let excess = 1.2 - candidates.cap;
        let ratio = sum / (excess * expected);
        assert!((0.75..1.7).contains(&ratio), "{ratio}, excess {excess}");
    }

    #[test]
    fn even_light_stays() {
        let (mut light, frame, room) = room(0.1);
        let before = light.clone();
        let fit = fit_lamps(&mut light, &frame, &room);
        assert!(fit.lamps.is_empty() && (0.9..1.15).contains(&fit.scale), "{fit:?}");
        assert_eq!(fit.warning(), None);
        let mut scaled = before.clone();
        scale_guessed(&mut scaled, fit.scale);
        assert_eq!(light, scaled);
    }

    #[test]
    fn lobes_are_taken_as_they_are_seen() {
        let (mut light, frame, room) = room(12.0);
        light.lobes = Some(light.rgba.iter().map(|rows| vec![[0.1, 0.0, 0.0]; rows.len()]).collect());
        assert!(!fit_lamps(&mut light, &frame, &room).lamps.is_empty() && light.lobes.is_none());
    }

    #[test]
    fn without_depth_nothing_is_changed() {
        let (mut light, mut frame, room) = room(12.0);
        frame.depth_m.pixels_mut().fill(0.0);
        let before = light.clone();
        assert_eq!((fit_lamps(&mut light, &frame, &room), light), (LampFit::default(), before));
    }
}
