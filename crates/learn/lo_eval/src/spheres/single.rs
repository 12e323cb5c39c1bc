use lo_geometry::{Vec3, direction_from_uv, pixel_direction, pixel_solid_angle_sr, uv_from_direction};
use rayon::prelude::*;

use super::Material;
use super::transport::{Row, Transport};

/// Camera that looks at a sphere of radius 1 at the origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereView {
    /// Position of the camera, radii. It looks at the sphere's centre; +Y is up.
    pub eye: Vec3,
    /// Focal length in pixels.
    pub focal_px: f32,
}

/// Side of the pixel blocks of rough and diffuse spheres that share one sample, since shading varies slowly.
const STEP: usize = 4;

/// Samples along the side of a mirror's pixel.
const SAMPLES: usize = 2;

/// Sizes of the panoramas for mirrors, glossy and diffuse reflection: texels of 1.4°, 2.8° and 7.5°.
const MIRROR: [usize; 2] = [256, 128];
const GLOSSY: [usize; 2] = [128, 64];
const DIFFUSE: [usize; 2] = [48, 24];

/// Smallest share of a glossy BSDF entry. Smaller entries are dropped, and the others are scaled up to compensate.
const MIN_SHARE: f32 = 2e-6;

impl SphereView {
    /// Returns the radius of the silhouette, pixels.
    fn radius_px(self) -> f32 {
        self.focal_px / (self.eye.length_squared() - 1.0).sqrt()
    }

    /// Returns the point of the sphere at `(right, up)` pixels from the centre of the image.
    fn hit(self, right_px: f32, up_px: f32) -> Option<Vec3> {
        let forward = -self.eye.normalize();
        let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
        let up = right.cross(forward);
        let direction = (forward * self.focal_px + right * right_px + up * up_px).normalize();
        let along = -self.eye.dot(direction);
        let inside = 1.0 - (self.eye + direction * along).length_squared();
        (inside > 0.0).then(|| (self.eye + direction * (along - inside.sqrt())).normalize())
    }
}

/// Computes the transport of a sphere under distant light.
///
/// Mirrors have every pixel, other materials one for each block of 4 × 4.
pub fn single_sphere(material: Material, view: SphereView) -> Transport {
    let step = if matches!(material, Material::Mirror { .. }) { 1 } else { STEP };
    let side = (2.0 * view.radius_px() / step as f32).ceil() as usize;
    let maps = if step == 1 { vec![MIRROR] } else { vec![GLOSSY, DIFFUSE] };
    let pixel = |index: usize| {
        let position = [(index % side) as u16, (index / side) as u16];
        let at = |x: f32, y: f32| {
            let middle = 0.5 * side as f32;
            view.hit((x - middle) * step as f32, (middle - y) * step as f32)
        };
        let (x, y) = (f32::from(position[0]), f32::from(position[1]));
        let entries = if step == 1 {
            let offsets = (0..SAMPLES * SAMPLES).map(|i| [i % SAMPLES, i / SAMPLES]);
            let shift = |i: usize| (i as f32 + 0.5) / SAMPLES as f32;
            let normals: Vec<Vec3> = offsets.filter_map(|[i, j]| at(x + shift(i), y + shift(j))).collect();
            mirror_entries(material, view, &normals)
        } else {
            at(x + 0.5, y + 0.5).map(|normal| bsdf_entries(material, view, normal)).unwrap_or_default()
        };
        (!entries.is_empty()).then_some(Row { position, entries })
    };
    let rows: Vec<Row> = (0..side * side).into_par_iter().filter_map(pixel).collect();
    Transport::new(maps, [side, side], rows)
}

/// Returns bilinear lookups in the mirrored directions of a pixel.
fn mirror_entries(material: Material, view: SphereView, normals: &[Vec3]) -> Vec<(u16, f32)> {
    let [width, height] = MIRROR;
    let mut entries = Vec::with_capacity(4 * normals.len());
    for &normal in normals {
        let towards = (view.eye - normal).normalize();
        let direction = 2.0 * normal.dot(towards) * normal - towards;
        let uv = uv_from_direction(direction);
        let (x, y) = (uv.x * width as f32 - 0.5, uv.y * height as f32 - 0.5);
        let (fx, fy) = (x - x.floor(), y - y.floor());
        let weight = material.mirror_reflectance(normal.dot(towards)) / normals.len() as f32;
        for (dx, dy, share) in
            [(0, 0, (1.0 - fx) * (1.0 - fy)), (1, 0, fx * (1.0 - fy)), (0, 1, (1.0 - fx) * fy), (1, 1, fx * fy)]
        {
            let column = (x.floor() as i64 + dx).rem_euclid(width as i64) as usize;
            let row = (y.floor() as i64 + dy).clamp(0, height as i64 - 1) as usize;
            entries.push(((row * width + column) as u16, weight * share));
        }
    }
    entries
}

/// Integrates the BRDF over all directions: the glossy part on the finer panorama, the diffuse part on the coarser.
fn bsdf_entries(material: Material, view: SphereView, normal: Vec3) -> Vec<(u16, f32)> {
    let towards = (view.eye - normal).normalize();
    let mut entries = integrate(GLOSSY, 2, |light| material.glossy(normal, towards, light));
    let whole: f32 = entries.iter().map(|(_, weight)| weight).sum();
    entries.retain(|(_, weight)| *weight > MIN_SHARE * whole);
    let kept: f32 = entries.iter().map(|(_, weight)| weight).sum();
    entries.iter_mut().for_each(|(_, weight)| *weight *= whole / kept.max(f32::MIN_POSITIVE));
    let first = (GLOSSY[0] * GLOSSY[1]) as u16;
    let diffuse = integrate(DIFFUSE, 2, |light| material.diffuse(normal, towards, light));
    entries.extend(diffuse.into_iter().map(|(column, weight)| (first + column, weight)));
    entries
}

/// Integrates `f` over each texel where it is positive, with `samples`² samples.
pub(super) fn integrate([width, height]: [usize; 2], samples: usize, f: impl Fn(Vec3) -> f32) -> Vec<(u16, f32)> {
    let mut entries = Vec::new();
    for y in 0..height {
        let solid_angle = pixel_solid_angle_sr(y, width, height);
        for x in 0..width {
            // Zero at the centre: outside of the hemisphere.
            if f(pixel_direction(x, y, width, height)) <= 0.0 {
                continue;
            }
            let at = |i: usize, size: usize| (i as f32 + 0.5) / (samples * size) as f32;
            let mut sum = 0.0;
            for (i, j) in (0..samples).flat_map(|j| (0..samples).map(move |i| (i, j))) {
                sum += f(direction_from_uv([at(samples * x + i, width), at(samples * y + j, height)].into()));
            }
            entries.push(((y * width + x) as u16, solid_angle * sum / (samples * samples) as f32));
        }
    }
    entries
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use lo_imaging::RadianceImage;

    /// A view along −Z; the sphere is 141 pixels wide.
    const VIEW: SphereView = SphereView { eye: Vec3::new(0.0, 0.0, 16.0), focal_px: 1133.0 };

    fn map(light: impl Fn(Vec3) -> f32) -> RadianceImage {
        RadianceImage::from_fn(256, 128, |x, y| [light(pixel_direction(x, y, 256, 128)); 3])
    }

    #[test]
    fn a_sphere_in_even_light_shows_its_albedo() {
        let white = map(|_| 1.0);
        for (material, least, most) in [
            (Material::Diffuse { albedo: 0.8 }, 0.795, 0.805),
            // The model lacks multiple scattering between microfacets.
            (Material::Metal { reflectance: 0.8, roughness: 0.3271 }, 0.77, 0.8),
            (Material::Mirror { reflectance: 0.8 }, 0.799, 1.001),
        ] {
            let shown = single_sphere(material, VIEW).render(&white);
            let values: Vec<f32> = shown.pixels().iter().map(|rgb| rgb[0]).collect();
            let (low, high) = values.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
            assert!(low > least - 0.03 && high < most + 0.01, "{material:?}: {low} to {high}");
            let mean = values.iter().sum::<f32>() / values.len() as f32;
            assert!((least..most).contains(&mean), "{material:?}: {mean}");
        }
    }

    #[test]
    fn the_diffuse_sphere_follows_irradiance_in_closed_form() {
        // L(ω) = 1 + ω·u/2 gives E(n) = π (1 + n·u/3).
        let towards = Vec3::new(0.6, 0.64, 0.48);
        let transport = single_sphere(Material::Diffuse { albedo: 0.5 }, VIEW);
        let shown = transport.render(&map(|d| 1.0 + 0.5 * d.dot(towards)));
        let picture = transport.picture(shown.pixels(), [f32::NAN; 3]);
        let (mut worst, mut pixels) = (0.0f32, 0);
        let middle = 0.5 * picture.width() as f32;
        for (x, y) in (0..picture.height()).flat_map(|y| (0..picture.width()).map(move |x| (x, y))) {
            let right = (x as f32 + 0.5 - middle) * STEP as f32;
            let Some(normal) = VIEW.hit(right, (middle - y as f32 - 0.5) * STEP as f32) else { continue };
            worst = worst.max((picture[(x, y)][0] - 0.5 * (1.0 + normal.dot(towards) / 3.0)).abs());
            pixels += 1;
        }
        // About 35² · π / 4 pixels.
        assert!(worst < 2e-3 && (880..1010).contains(&pixels), "{worst}, {pixels} pixels");
    }

    #[test]
    fn mirrors_show_what_they_reflect() {
        let transport = single_sphere(Material::Mirror { reflectance: 1.0 }, VIEW);
        let shown = transport.picture(transport.render(&map(|d| 1.0 + d.y)).pixels(), [0.0; 3]);
        let size = shown.width();
        // The centre reflects the camera; a normal tilted by 45° reflects straight up.
        assert!((shown[(size / 2, size / 2)][0] - 1.0).abs() < 0.02);
        let up = (0.5 * size as f32 * (1.0 - 0.5f32.sqrt())) as usize;
        assert!(shown[(size / 2, up)][0] > 1.99);
        // Light from the right appears on the right.
        let right = transport.picture(transport.render(&map(|d| d.x.max(0.0))).pixels(), [0.0; 3]);
        assert!(right[(size - 8, size / 2)][0] > 0.3 && right[(8, size / 2)][0] == 0.0);
    }

    #[test]
    fn a_rough_mirror_agrees_with_an_f64_twin() {
        // One bright patch on a dim background, integrated by brute force in f64.
        let towards = Vec3::new(0.48, 0.6, 0.64);
        let patch = |d: Vec3| 0.1 + 20.0 * f32::from(u8::from(d.dot(towards) > 0.97));
        let material = Material::Metal { reflectance: 0.8, roughness: 0.3271 };
        let transport = single_sphere(material, VIEW);
        let shown = transport.picture(transport.render(&map(patch)).pixels(), [0.0; 3]);
        let middle = 0.5 * shown.width() as f32;
        for (x, y) in [(17, 17), (22, 13), (26, 8), (9, 25)] {
            let right = (x as f32 + 0.5 - middle) * STEP as f32;
            let normal = VIEW.hit(right, (middle - y as f32 - 0.5) * STEP as f32).unwrap();
            let expected = twin(normal, (VIEW.eye - normal).normalize(), towards);
            let got = f64::from(shown[(x, y)][0]);
            assert!((got - expected).abs() < 0.03 * expected + 0.005, "{x}, {y}: {got} {expected}");
        }
    }

    /// Returns the reflected radiance of the patch by GGX (Walter et al. 2007) with Smith's G in tangent form.
    ///
    /// Summed in f64 over a fine grid.
    fn twin(normal: Vec3, view: Vec3, towards: Vec3) -> f64 {
        let vector = |v: Vec3| [f64::from(v.x), f64::from(v.y), f64::from(v.z)];
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (n, v, u) = (vector(normal), vector(view), vector(towards));
        let alpha = 0.3271f64.powi(2);
        let g1 = |cosine: f64| 2.0 / (1.0 + (1.0 + alpha * alpha * (1.0 / (cosine * cosine) - 1.0)).sqrt());
        let (rows, mut sum) = (720, 0.0);
        for row in 0..rows {
            let theta = std::f64::consts::PI * (f64::from(row) + 0.5) / f64::from(rows);
            for column in 0..2 * rows {
                let phi = std::f64::consts::PI * (f64::from(column) + 0.5) / f64::from(rows);
                let l = [theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin()];
                let (n_l, n_v) = (dot(n, l), dot(n, v));
                if n_l <= 0.0 {
                    continue;
                }
                let h = [l[0] + v[0], l[1] + v[1], l[2] + v[2]];
                let length = dot(h, h).sqrt();
                let (n_h, v_h) = (dot(n, h) / length, dot(v, h) / length);
                let tangent = 1.0 / (n_h * n_h) - 1.0;
                let d = 1.0
                    / (std::f64::consts::PI * alpha * alpha * n_h.powi(4) * (1.0 + tangent / (alpha * alpha)).powi(2));
                let fresnel = 0.8 + 0.2 * (1.0 - v_h).powi(5);
                let radiance = 0.1 + if dot(l, u) > 0.97 { 20.0 } else { 0.0 };
                let solid_angle = (std::f64::consts::PI / f64::from(rows)).powi(2) * theta.sin();
                sum += radiance * d * g1(n_l) * g1(n_v) * fresnel / (4.0 * n_v) * solid_angle;
            }
        }
        sum
    }
}
