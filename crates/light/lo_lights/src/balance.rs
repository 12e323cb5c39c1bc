//! Scales the faces of bright leaves to what cones see of their leaves.

use std::f32::consts::PI;

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};
use rayon::prelude::*;

use crate::cap::luminance;
use crate::face::{Face, RAY_TANGENT};
use crate::occlusion::unoccluded_share;

/// Rows of the panoramas in which light is compared.
const HEIGHT: usize = 64;

/// Sharpness of the kernel e^(λ (cos − 1)) within which light of neighbouring directions is compared: 15° wide, as
/// lamps and their surroundings are.
const SHARPNESS: f32 = 30.0;

/// Range of the factors.
const GAIN: [f32; 2] = [0.1, 4.0];

/// Light from a direction: unit direction, and luminance times solid angle.
type Flux = (Vec3, f32);

/// Scales faces so that they light `eyes` as much as cones do that are traced through `excess`, the octree with the
/// faces' light alone. `whole` has the octree's own light, for occlusion.
///
/// Inferred surfaces are half-transparent and some leaves thick: they hide one another in part and show leaves behind
/// them, which faces alone do not. The factors are means over the eyes, compared within 15° of each face.
pub(crate) fn balance(faces: &mut [Face], whole: &ConeTracer, excess: &ConeTracer, eyes: &[Vec3]) {
    // Eyes count by the light that they get from a face.
    let at_eye = |&eye: &Vec3| -> Vec<[f32; 2]> {
        let (of_faces, of_cones) = (of_faces(faces, whole, eye), of_cones(excess, eye));
        let given: Vec<Flux> = of_faces.iter().flatten().copied().collect();
        let sums = |(direction, flux)| [&of_cones, &given].map(|light| flux * around(light, direction));
        of_faces.into_iter().map(|face| face.map_or([0.0; 2], sums)).collect()
    };
    let at_eyes: Vec<Vec<[f32; 2]>> = eyes.par_iter().map(at_eye).collect();
    let mut sums = vec![[0.0f32; 2]; faces.len()];
    for at_eye in at_eyes {
        for (sum, own) in sums.iter_mut().zip(at_eye) {
            *sum = [sum[0] + own[0], sum[1] + own[1]];
        }
    }
    let total = |index: usize| sums.iter().map(|sum| sum[index]).sum::<f32>();
    let gain = |[cones, faces]: [f32; 2]| {
        if faces > 0.0 { (cones / faces).clamp(GAIN[0], GAIN[1]) } else { 1.0 }
    };
    let mean = gain([total(0), total(1)]);
    for (face, sum) in faces.iter_mut().zip(&sums) {
        face.radiance *= if sum[1] > 0.0 { gain(*sum) } else { mean };
    }
}

/// Returns the sum of the light around a direction, weighted by the kernel.
fn around(light: &[Flux], direction: Vec3) -> f32 {
    light.iter().map(|(from, flux)| flux * (SHARPNESS * (from.dot(direction) - 1.0)).exp()).sum()
}

/// Returns the light of each face at an eye; `None` where it faces away or is hidden.
fn of_faces(faces: &[Face], whole: &ConeTracer, eye: Vec3) -> Vec<Option<Flux>> {
    let towards = |face: &Face| (face.centre - eye).normalize_or(Vec3::Y);
    let cone = |face| Cone { origin: eye, direction: towards(face), tan_half_angle: RAY_TANGENT };
    let cones: Vec<Cone> = faces.iter().map(cone).collect();
    let mut samples = vec![ConeSample::default(); cones.len()];
    whole.trace_batch(&cones, &mut samples);
    let light = |((face, cone), sample): ((&Face, &Cone), &ConeSample)| {
        let distance_m = face.centre.distance(eye);
        let cosine = (-face.normal.dot(cone.direction)).max(0.0);
        let visible = unoccluded_share(distance_m, sample, whole.leaf_edge_m());
        // As the disc of the same area on its axis.
        let area_m2 = face.edge_m * face.edge_m;
        let solid_angle_sr = area_m2 * cosine / (distance_m * distance_m + area_m2 / PI);
        let flux = visible * luminance(face.radiance) * solid_angle_sr;
        (flux > 0.0).then_some((cone.direction, flux))
    };
    faces.iter().zip(&cones).zip(&samples).map(light).collect()
}

/// Returns the light of the directions that show any.
fn of_cones(excess: &ConeTracer, eye: Vec3) -> Vec<Flux> {
    let (width, height) = (2 * HEIGHT, HEIGHT);
    let panorama = excess.panorama(eye, width, height);
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
    let light = |((x, y), radiance): ((usize, usize), &[f32; 3])| {
        let flux = luminance(Vec3::from(*radiance)) * pixel_solid_angle_sr(y, width, height);
        (flux > 0.0).then(|| (pixel_direction(x, y, width, height), flux))
    };
    pixels.zip(panorama.radiance.pixels()).filter_map(light).collect()
}
