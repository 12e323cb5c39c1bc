//! Scales light patches to what cones see of their leaves.

use lo_cone::{Cone, ConeTracer};
use lo_geometry::{Vec3, pixel_direction, pixel_solid_angle_sr};

use crate::cap::luminance;
use crate::occlusion::unoccluded_share;
use crate::{LightPatch, PatchShape};

/// Rows of the panoramas in which light is compared.
const HEIGHT: usize = 64;

/// Sharpness of the kernel e^(λ (cos − 1)) within which light of neighbouring directions is compared: 15° wide, as lamps
/// and their surroundings are.
const SHARPNESS: f32 = 30.0;

/// Range of the factors.
const GAIN: [f32; 2] = [0.1, 4.0];

/// Half-angle tangent of rays that test occlusion.
const RAY_TANGENT: f32 = 0.01;

/// Light from a direction: unit direction, and luminance times solid angle.
type Flux = (Vec3, f32);

/// Scales patches so that they light `eyes` as much as cones do that are traced through `excess`, the octree with the
/// patches' light alone. `whole` has the octree's own light, for occlusion.
///
/// Inferred surfaces are half-transparent and some leaves thick: they hide one another in part and show leaves behind
/// them, which faces alone do not. The factors are means over the eyes, compared within 15° of each patch.
pub(crate) fn balance(patches: &mut [LightPatch], whole: &ConeTracer, excess: &ConeTracer, eyes: &[Vec3]) {
    let mut sums = vec![[0.0f32; 2]; patches.len()];
    for &eye in eyes {
        let of_patches: Vec<Option<Flux>> = of_patches(patches, whole, eye);
        let of_cones = of_cones(excess, eye);
        let given: Vec<Flux> = of_patches.iter().flatten().copied().collect();
        for (sum, (direction, flux)) in sums.iter_mut().zip(&of_patches).filter_map(|(s, p)| Some((s, (*p)?))) {
            // Eyes count by the light that they get from the patch.
            sum[0] += flux * around(&of_cones, direction);
            sum[1] += flux * around(&given, direction);
        }
    }
    let total = |index: usize| sums.iter().map(|sum| sum[index]).sum::<f32>();
    let gain = |[cones, patches]: [f32; 2]| {
        if patches > 0.0 { (cones / patches).clamp(GAIN[0], GAIN[1]) } else { 1.0 }
    };
    let mean = gain([total(0), total(1)]);
    for (patch, sum) in patches.iter_mut().zip(&sums) {
        patch.radiance *= if sum[1] > 0.0 { gain(*sum) } else { mean };
    }
}

/// Returns the sum of the light around a direction, weighted by the kernel.
fn around(light: &[Flux], direction: Vec3) -> f32 {
    light.iter().map(|(from, flux)| flux * (SHARPNESS * (from.dot(direction) - 1.0)).exp()).sum()
}

/// Returns the light of each patch at an eye; `None` where it faces away or is hidden.
fn of_patches(patches: &[LightPatch], whole: &ConeTracer, eye: Vec3) -> Vec<Option<Flux>> {
    let light = |patch: &LightPatch| {
        let PatchShape::Square { centre, normal, edge_m } = patch.shape else { return None };
        let distance_m = centre.distance(eye);
        let direction = (centre - eye) / distance_m.max(1e-6);
        let cosine = -normal.dot(direction);
        if cosine <= 0.0 {
            return None;
        }
        let towards = whole.trace(&Cone { origin: eye, direction, tan_half_angle: RAY_TANGENT });
        let visible = unoccluded_share(distance_m, &towards, whole.leaf_edge_m());
        // As the disc of the same area on its axis.
        let solid_angle_sr = patch.extent * cosine / (distance_m * distance_m + edge_m * edge_m / std::f32::consts::PI);
        let flux = visible * luminance(patch.radiance) * solid_angle_sr;
        (flux > 0.0).then_some((direction, flux))
    };
    patches.iter().map(light).collect()
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
