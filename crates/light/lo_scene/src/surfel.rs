use lo_geometry::{Camera, RigidTransform, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::{Provenance, RadiancePoint};
use rayon::prelude::*;

use crate::Frame;

/// A small piece of surface that emits or reflects light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surfel {
    /// World position in metres.
    pub position_m: Vec3,
    /// Unit normal, towards the lit side; towards the camera for observed surfels.
    pub normal: Vec3,
    /// Linear RGB radiance.
    pub radiance: [f32; 3],
    /// Whether a photo observed it.
    pub provenance: Provenance,
    /// Position of the camera that observed it, metres.
    pub eye_m: Vec3,
    /// Depth along that camera's optical axis, metres.
    pub depth_m: f32,
}

impl Surfel {
    /// Transforms it to other axes.
    pub fn moved(self, to_from_own: &RigidTransform) -> Self {
        Self {
            position_m: to_from_own.point(self.position_m),
            normal: to_from_own.direction(self.normal),
            eye_m: to_from_own.point(self.eye_m),
            ..self
        }
    }
}

impl From<Surfel> for RadiancePoint {
    fn from(surfel: Surfel) -> Self {
        Self { position_m: surfel.position_m, radiance: surfel.radiance, provenance: surfel.provenance }
    }
}

/// Tangent of the steepest valid slope, against the line of sight, on both sides of a reading: 86°.
///
/// If both sides of a pixel are steeper, the sensor has mixed two surfaces. A floor seen from 1.5 m above reaches 86°
/// at 21 m; the ramps of the LiDAR and Kinect test frames are at 87.5° and more.
const MAX_SLOPE: f32 = 14.0;

/// Largest relative difference in inverse depth of one surface when a normal is fitted.
const SURFACE_RANGE: f32 = 0.06;

impl Frame {
    /// Removes flying pixels: their depth becomes 0, "no reading".
    ///
    /// At depth edges, sensors mix near and far into readings between both surfaces. A reading is dropped if, along a
    /// row or a column, the surface falls off steeper than 86° against the line of sight on both of its sides (a hole
    /// counts as a fall if the other side is one). Edges of real surfaces keep one smooth side and stay.
    ///
    /// Call it at the depth map's own resolution or at the working resolution.
    pub fn without_flying_pixels(&self) -> Self {
        let depth = &self.depth_m;
        let camera = self.depth_camera();
        let (pitch_x, pitch_y) = (1.0 / camera.fx as f32, 1.0 / camera.fy as f32);
        let depth_m = Image::from_fn(depth.width(), depth.height(), |x, y| {
            let z = depth[(x, y)];
            if z <= 0.0 {
                return 0.0;
            }
            let at = |dx: isize, dy: isize| {
                let (x, y) = (x.checked_add_signed(dx)?, y.checked_add_signed(dy)?);
                (x < depth.width() && y < depth.height()).then(|| depth[(x, y)])
            };
            let flying = |a: Option<f32>, b: Option<f32>, pitch: f32| {
                let falls = |side: Option<f32>| match side {
                    Some(s) if s > 0.0 => (s - z).abs() > MAX_SLOPE * pitch * s.min(z),
                    _ => false,
                };
                let open = |side: Option<f32>| matches!(side, Some(s) if s <= 0.0);
                (falls(a) && (falls(b) || open(b))) || (falls(b) && open(a))
            };
            let drop = flying(at(-1, 0), at(1, 0), pitch_x) || flying(at(0, -1), at(0, 1), pitch_y);
            if drop { 0.0 } else { z }
        });
        Self { camera: self.camera, photo: self.photo.clone(), depth_m, exposure: self.exposure }
    }

    /// Returns the normal at each depth pixel, towards the camera; `None` at holes and where no surface can be
    /// fitted.
    ///
    /// Inverse depth of a plane is affine in the image. A weighted least-squares fit over a window (9 × 9 pixels at
    /// the working resolution) gives the plane. Readings that differ by more than 6 % in depth from the centre belong
    /// to another surface and have no weight, which keeps edges sharp.
    pub fn normals(&self) -> Image<Option<Vec3>> {
        normals_of(&self.depth_m, &self.depth_camera())
    }

    /// Returns all observed surface points: one per reading, row by row, with the given radiance at photo resolution
    /// (see [`Frame::radiance`]) and provenance [`Provenance::Observed`]. Call [`Frame::without_flying_pixels`]
    /// first.
    ///
    /// Photo and depth should have one resolution, as from [`Frame::working`]; otherwise each point gets the radiance
    /// of the photo pixel at the centre of the depth pixel.
    pub fn surfels(&self, radiance: &RadianceImage) -> Vec<Surfel> {
        self.surfels_with_normals(&self.normals(), radiance)
    }

    /// [`Frame::surfels`] with given normals; missing ones point to the camera.
    ///
    /// # Panics
    /// If `normals` does not have the depth map's size.
    pub fn surfels_with_normals(&self, normals: &Image<Option<Vec3>>, radiance: &RadianceImage) -> Vec<Surfel> {
        let depth = &self.depth_m;
        assert_eq!((normals.width(), normals.height()), (depth.width(), depth.height()), "one normal per depth pixel");
        let camera = self.depth_camera();
        let (width, height) = (depth.width(), depth.height());
        let mut surfels = Vec::with_capacity(width * height);
        for y in 0..height {
            for x in 0..width {
                let z = depth[(x, y)];
                if z <= 0.0 {
                    continue;
                }
                let position_m = camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(z));
                let pixel =
                    ((2 * x + 1) * radiance.width() / (2 * width), (2 * y + 1) * radiance.height() / (2 * height));
                surfels.push(Surfel {
                    position_m,
                    normal: normals[(x, y)].unwrap_or(-position_m.normalize_or(Vec3::NEG_Z)),
                    radiance: radiance[pixel],
                    provenance: Provenance::Observed,
                    eye_m: Vec3::ZERO,
                    depth_m: z,
                });
            }
        }
        surfels
    }
}

fn normals_of(depth: &DepthMap, camera: &Camera) -> Image<Option<Vec3>> {
    let (width, height) = (depth.width(), depth.height());
    let inverse = depth.map(|&z| if z > 0.0 { 1.0 / z } else { 0.0 });
    let radius = (width.max(height) / 120).max(1);
    let rows: Vec<Vec<Option<Vec3>>> = (0..height)
        .into_par_iter()
        .map(|y| (0..width).map(|x| normal_at(&inverse, camera, x, y, radius)).collect())
        .collect();
    Image::new(width, height, rows.into_iter().flatten().collect())
}

/// Fits `1/z ≈ a + b·Δu + c·Δv` around a pixel and turns it into the normal of the plane.
fn normal_at(inverse: &Image<f32>, camera: &Camera, x: usize, y: usize, radius: usize) -> Option<Vec3> {
    let centre = inverse[(x, y)];
    if centre <= 0.0 {
        return None;
    }
    let scale = 1.0 / (SURFACE_RANGE * centre);
    let columns = x.saturating_sub(radius)..(x + radius + 1).min(inverse.width());
    let (mut s, mut su, mut sv, mut suu, mut suv, mut svv) = (0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32, 0.0f32);
    let (mut sz, mut suz, mut svz) = (0.0f32, 0.0f32, 0.0f32);
    for row in y.saturating_sub(radius)..(y + radius + 1).min(inverse.height()) {
        let v = row as f32 - y as f32;
        let line = &inverse.pixels()[row * inverse.width() + columns.start..row * inverse.width() + columns.end];
        for (i, &value) in line.iter().enumerate() {
            let u = (columns.start + i) as f32 - x as f32;
            let difference = value - centre;
            // Tukey's biweight; holes (0) are far from any reading and have no weight.
            let t = (1.0 - (difference * scale).powi(2)).max(0.0);
            let w = t * t;
            s += w;
            su += w * u;
            sv += w * v;
            suu += w * u * u;
            suv += w * u * v;
            svv += w * v * v;
            sz += w * difference;
            suz += w * u * difference;
            svz += w * v * difference;
        }
    }
    let (cuu, cuv, cvv) = (suu - su * su / s, suv - su * sv / s, svv - sv * sv / s);
    let (cuz, cvz) = (suz - su * sz / s, svz - sv * sz / s);
    let determinant = cuu * cvv - cuv * cuv;
    // Readings along one line, or fewer than three, do not define a plane.
    if determinant <= 1e-3 * s * s {
        return None;
    }
    let b = (cuz * cvv - cvz * cuv) / determinant;
    let c = (cvz * cuu - cuz * cuv) / determinant;
    let a = centre + (sz - b * su - c * sv) / s;
    let (u0, v0) = ((x as f64 + 0.5 - camera.cx) as f32, (y as f64 + 0.5 - camera.cy) as f32);
    // With n·P = d and P = z((u−cx)/fx, −(v−cy)/fy, −1): 1/z = (n/d)·((u−cx)/fx, −(v−cy)/fy, −1).
    let normal = Vec3::new(b * camera.fx as f32, -c * camera.fy as f32, -(a - b * u0 - c * v0)).try_normalize()?;
    let toward = Vec3::new(u0 / camera.fx as f32, -v0 / camera.fy as f32, -1.0);
    Some(if normal.dot(toward) > 0.0 { -normal } else { normal })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Plane, Ray};
    use lo_imaging::Photo;

    use super::*;

    /// Renders the depth map of a plane.
    fn depth_of(plane: Plane, camera: &Camera) -> DepthMap {
        Image::from_fn(camera.width as usize, camera.height as usize, |x, y| {
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let hit = plane.intersect(&Ray { origin: Vec3::ZERO, direction });
            hit.map_or(0.0, |distance| -distance * direction.z)
        })
    }

    fn frame(depth_m: DepthMap, camera: Camera) -> Frame {
        let photo =
            Photo::Linear(Image::new(depth_m.width(), depth_m.height(), vec![[0.5; 3]; depth_m.pixels().len()]));
        Frame { camera, photo, depth_m, exposure: 1.0 }
    }

    #[test]
    fn normals_of_planes_are_exact_and_survive_noise_and_edges() {
        let camera = Camera::from_hfov_deg(60.0, 240, 160).unwrap();
        for normal in [Vec3::Z, Vec3::new(0.2, 0.9, 0.4), Vec3::new(-0.7, 0.1, 0.7)] {
            let plane = Plane { normal: normal.normalize(), offset_m: -2.0 };
            let mut depth = depth_of(plane, &camera);
            let clean = frame(depth.clone(), camera).normals();
            let seen = clean.pixels().iter().flatten().count();
            assert!(seen > 1000);
            // f32 sums of inverse depths: a few 1e-4 in direction
            assert!(clean.pixels().iter().flatten().all(|n| n.dot(plane.normal) > 0.999), "{normal}");
            // 0.3 % of depth noise and a box edge in front of the right half
            let mut state = 1u32;
            for (i, z) in depth.pixels_mut().iter_mut().enumerate() {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                *z *= 1.0 + 0.003 * ((state >> 8) as f32 / (1 << 23) as f32 - 1.0);
                if i % 240 > 120 {
                    *z = z.min(0.8);
                }
            }
            let noisy = frame(depth, camera).normals();
            let good = |x: usize| (0..160).filter_map(|y| noisy[(x, y)]).filter(|n| n.dot(plane.normal) > 0.95).count();
            let known = |x: usize| (0..160).filter(|&y| noisy[(x, y)].is_some()).count();
            for x in [60, 119] {
                assert!(good(x) * 10 >= known(x) * 8, "{normal} column {x}: {} of {}", good(x), known(x));
            }
        }
    }

    #[test]
    fn flying_pixels_go_and_edges_stay() {
        let camera = Camera::from_hfov_deg(60.0, 240, 160).unwrap();
        // Near at 1 m, far at 3 m, and three columns that the sensor mixed.
        let depth = Image::from_fn(240, 160, |x, _| match x {
            0..100 => 1.0,
            100 => 1.4,
            101 => 2.0,
            102 => 2.6,
            _ => 3.0,
        });
        let clean = frame(depth, camera).without_flying_pixels().depth_m;
        assert!((100..103).all(|x| clean[(x, 80)] == 0.0));
        assert_eq!((clean[(99, 80)], clean[(103, 80)]), (1.0, 3.0));
        let floor = depth_of(Plane { normal: Vec3::Y, offset_m: -1.5 }, &camera);
        let kept = frame(floor.clone(), camera).without_flying_pixels().depth_m;
        let near = |d: &DepthMap| d.pixels().iter().filter(|&&z| z > 0.0 && z < 20.0).count();
        assert_eq!(near(&kept), near(&floor));
    }

    #[test]
    fn surfels_lie_where_the_depth_says() {
        let camera = Camera::from_hfov_deg(60.0, 24, 16).unwrap();
        let mut depth = depth_of(Plane { normal: Vec3::Z, offset_m: -2.0 }, &camera);
        depth[(3, 3)] = 0.0;
        let frame = frame(depth, camera);
        let surfels = frame.surfels(&frame.radiance());
        assert_eq!(surfels.len(), 24 * 16 - 1);
        assert!(
            surfels.iter().all(|s| (s.position_m.z + 2.0).abs() < 1e-5 && s.normal.z > 0.999 && s.radiance == [0.5; 3])
        );
    }

    #[test]
    fn tiny_frames_give_no_normals_but_no_panic() {
        for (w, h) in [(1, 1), (1, 7), (2, 2)] {
            let camera = Camera::from_hfov_deg(60.0, w, h).unwrap();
            let depth = Image::new(w as usize, h as usize, vec![1.0; (w * h) as usize]);
            let frame = frame(depth, camera);
            assert_eq!(frame.surfels(&frame.radiance()).len(), (w * h) as usize);
        }
    }
}
