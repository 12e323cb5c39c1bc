use std::ops::Range;

use lo_geometry::{Camera, Vec3};
use lo_imaging::{DepthMap, Image, Photo};
use lo_scene::{Estimate, Frame};
use rayon::prelude::*;

use crate::InsertError;

/// Long side at which normals are fitted; finer depth only adds noise to them.
const NORMAL_SIDE: usize = 480;

/// Pixels around a pixel that its normal depends on, with a margin.
const NORMAL_REACH: usize = 8;

/// Reach of a reading's tangent plane, as a share of its depth.
const PLANE_REACH: f32 = 0.03;

/// Observed real surfaces: depth and normals, at their own resolution.
#[derive(Clone, Debug)]
pub(crate) struct SurfaceMap {
    pub camera: Camera,
    pub depth_m: DepthMap,
    /// Unit normals; zero without a surface.
    pub normals: Image<Vec3>,
}

/// A real surface point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub position_m: Vec3,
    /// Unit normal towards the camera.
    pub normal: Vec3,
}

impl SurfaceMap {
    /// Fits normals at their resolution.
    pub fn new(frame: &Frame) -> Self {
        Self::fitted(limited(frame, NORMAL_SIDE))
    }

    /// [`SurfaceMap::new`] without flying pixels, with holes outside the [window](Self::window) of some world points.
    pub fn around(frame: &Frame, points: &[Vec3]) -> Self {
        Self::near(frame, &relative(&frame.camera, points))
    }

    /// Returns the columns and rows that contain the image positions of world points, with a margin for their
    /// normals.
    pub fn window(&self, points: &[Vec3]) -> (Range<usize>, Range<usize>) {
        widened(&relative(&self.camera, points), (self.width(), self.height()), NORMAL_REACH)
    }

    /// [`SurfaceMap::around`] for relative image positions.
    fn near(frame: &Frame, places: &[(f64, f64)]) -> Self {
        let mut frame = limited(&without_photo(frame).without_flying_pixels(), NORMAL_SIDE);
        let (width, height) = (frame.depth_m.width(), frame.depth_m.height());
        // A larger margin, so that holes do not change the normals of the pixels around.
        let (columns, rows) = widened(places, (width, height), 2 * NORMAL_REACH);
        let depth_m = &frame.depth_m;
        frame.depth_m = Image::from_fn(width, height, |x, y| {
            if columns.contains(&x) && rows.contains(&y) { depth_m[(x, y)] } else { 0.0 }
        });
        Self::fitted(frame)
    }

    fn fitted(frame: Frame) -> Self {
        let normals = frame.normals().map(|normal| normal.unwrap_or(Vec3::ZERO));
        Self { camera: frame.camera, depth_m: frame.depth_m, normals }
    }

    /// Resamples depth to another resolution, its longer side at most `side` and never above the photo's; normals are
    /// interpolated.
    pub fn resampled(&self, frame: &Frame, side: usize) -> Self {
        self.resampled_with(frame, side, DepthMap::clone)
    }

    /// [`SurfaceMap::resampled`] with `improve` applied to the resampled depth.
    pub fn resampled_with(&self, frame: &Frame, side: usize, improve: impl FnOnce(&DepthMap) -> DepthMap) -> Self {
        let frame = limited(frame, side);
        let depth_m = improve(&frame.depth_m);
        let (width, height) = (depth_m.width(), depth_m.height());
        let rows: Vec<Vec<Vec3>> = (0..height)
            .into_par_iter()
            .map(|y| (0..width).map(|x| self.normal_near(x, y, &depth_m)).collect())
            .collect();
        let normals = Image::new(width, height, rows.into_iter().flatten().collect());
        Self { camera: frame.camera, depth_m, normals }
    }

    /// Returns the normal for pixel `(x, y)` of another depth map of the same view: the mean of neighbours at similar
    /// depth.
    fn normal_near(&self, x: usize, y: usize, depth_m: &DepthMap) -> Vec3 {
        let z = depth_m[(x, y)];
        if z <= 0.0 {
            return Vec3::ZERO;
        }
        let u = (x as f32 + 0.5) / depth_m.width() as f32 * self.normals.width() as f32 - 0.5;
        let v = (y as f32 + 0.5) / depth_m.height() as f32 * self.normals.height() as f32 - 0.5;
        let mut sum = Vec3::ZERO;
        for (px, py, weight) in bilinear(u, v, self.normals.width(), self.normals.height()) {
            let other = self.depth_m[(px, py)];
            let closeness = 1.0 / (1e-4 + ((other - z) / (0.02 * z)).powi(2));
            sum += self.normals[(px, py)] * ((weight + 1e-3) * closeness);
        }
        sum.normalize_or(-self.camera.direction(f64::from(u) + 0.5, f64::from(v) + 0.5))
    }

    pub fn width(&self) -> usize {
        self.depth_m.width()
    }

    pub fn height(&self) -> usize {
        self.depth_m.height()
    }

    /// Returns the surface at the centre of a pixel.
    pub fn pixel(&self, x: usize, y: usize) -> Option<Surface> {
        let (z, normal) = (self.depth_m[(x, y)], self.normals[(x, y)]);
        if z <= 0.0 || normal == Vec3::ZERO {
            return None;
        }
        let position_m = self.camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(z));
        Some(Surface { position_m, normal })
    }

    /// Returns the surface at a relative image position in [0, 1]²: on the plane of the nearest pixel, `None` at
    /// holes.
    pub fn at(&self, u: f64, v: f64) -> Option<Surface> {
        let (x, y) = self.nearest(u, v)?;
        let surface = self.pixel(x, y)?;
        let direction = self.camera.unproject(u * self.width() as f64, v * self.height() as f64, 1.0);
        // On the tangent plane, unless that deviates from the reading (nearly edge-on).
        let distance = surface.normal.dot(surface.position_m) / surface.normal.dot(direction);
        let z = self.depth_m[(x, y)];
        let distance = if (distance - z).abs() < PLANE_REACH * z { distance } else { z };
        Some(Surface { position_m: direction * distance, ..surface })
    }

    /// Returns the depth of the pixel that contains a relative image position; `None` at holes.
    pub fn reading_m(&self, u: f64, v: f64) -> Option<f32> {
        self.nearest(u, v).map(|pixel| self.depth_m[pixel]).filter(|&z| z > 0.0)
    }

    /// Returns a lower bound in metres of the depth of [`SurfaceMap::at`] at a position; infinite at holes.
    pub fn depth_before_m(&self, u: f64, v: f64) -> f32 {
        self.reading_m(u, v).map_or(f32::INFINITY, |reading_m| (1.0 - 2.0 * PLANE_REACH) * reading_m)
    }

    /// Returns the pixel that contains a relative image position.
    fn nearest(&self, u: f64, v: f64) -> Option<(usize, usize)> {
        let (x, y) = (u * self.width() as f64, v * self.height() as f64);
        let inside = x >= 0.0 && y >= 0.0 && x < self.width() as f64 && y < self.height() as f64;
        inside.then_some((x as usize, y as usize))
    }
}

/// Returns the relative image positions of world points.
fn relative(camera: &Camera, points: &[Vec3]) -> Vec<(f64, f64)> {
    let seen = points.iter().filter_map(|&point| camera.project(point));
    seen.map(|(u, v, _)| (u / f64::from(camera.width), v / f64::from(camera.height))).collect()
}

/// Returns the columns and rows of an image that contain relative positions, with a margin of `reach` pixels; empty
/// without positions.
fn widened(places: &[(f64, f64)], (width, height): (usize, usize), reach: usize) -> (Range<usize>, Range<usize>) {
    let range = |length: usize, of: fn(&(f64, f64)) -> f64| {
        let pixels = places.iter().map(|place| (of(place) * length as f64) as usize);
        let (first, last) = pixels.fold((usize::MAX, 0), |(first, last), x| (first.min(x), last.max(x)));
        first.saturating_sub(reach).min(length)..last.saturating_add(reach + 1).min(length)
    };
    if places.is_empty() { (0..0, 0..0) } else { (range(width, |place| place.0), range(height, |place| place.1)) }
}

/// Returns the real surface at photo position `(u, v)`, pixel centres at +0.5: position in world metres and unit
/// normal towards the camera.
///
/// It uses the depth map at 480 pixels on the long side at most, which smooths noise. A flying pixel counts as no
/// reading.
///
/// # Errors
/// If the position is outside of the photo, or the depth map has no reading there.
pub fn surface_at_pixel(scene: &Estimate, u: f64, v: f64) -> Result<(Vec3, Vec3), InsertError> {
    let (width, height) = (scene.frame.photo.width(), scene.frame.photo.height());
    let inside = (0.0..width as f64).contains(&u) && (0.0..height as f64).contains(&v);
    if !inside {
        return Err(InsertError::PixelOutside { u, v, width, height });
    }
    let (relative_u, relative_v) = (u / width as f64, v / height as f64);
    let map = SurfaceMap::near(&scene.frame, &[(relative_u, relative_v)]);
    let surface = map.at(relative_u, relative_v).ok_or(InsertError::NoDepth { u, v })?;
    Ok((surface.position_m, surface.normal))
}

/// Observed real surfaces, precomputed for many calls: [`surface_at_pixel`] at any position.
#[derive(Debug)]
pub struct ObservedSurfaces {
    map: SurfaceMap,
    photo: (usize, usize),
}

impl ObservedSurfaces {
    /// Computes the surfaces of a scene.
    pub fn new(scene: &Estimate) -> Self {
        let map = SurfaceMap::new(&without_photo(&scene.frame).without_flying_pixels());
        Self { map, photo: (scene.frame.photo.width(), scene.frame.photo.height()) }
    }

    /// Returns the surface at photo position `(u, v)`; `None` outside of the photo and where there is no reading.
    pub fn at_pixel(&self, u: f64, v: f64) -> Option<(Vec3, Vec3)> {
        let surface = self.map.at(u / self.photo.0 as f64, v / self.photo.1 as f64)?;
        Some((surface.position_m, surface.normal))
    }

    pub(crate) fn map(&self) -> &SurfaceMap {
        &self.map
    }

    /// Returns unit normals towards the camera, zero if there is none, at the resolution at which normals are fitted.
    pub fn normals(&self) -> &Image<Vec3> {
        &self.map.normals
    }

    /// Returns depth in metres at that resolution, 0 where there is no reading.
    pub fn depth_m(&self) -> &DepthMap {
        &self.map.depth_m
    }
}

/// Returns camera and depth with a photo of one pixel: surfaces do not depend on the photo, and resampling it would
/// take longer than all work on the depth.
pub(crate) fn without_photo(frame: &Frame) -> Frame {
    let photo = Photo::Srgb8(Image::new(1, 1, vec![[0; 3]]));
    Frame { camera: frame.camera, photo, depth_m: frame.depth_m.clone(), exposure: frame.exposure }
}

/// Returns a frame [`without_photo`], its depth at the photo's size limited to `side` on the longer side.
fn limited(frame: &Frame, side: usize) -> Frame {
    let (width, height) = (f64::from(frame.camera.width), f64::from(frame.camera.height));
    let scale = (side as f64 / width.max(height)).min(1.0);
    let scaled = |length: f64| ((length * scale).round() as usize).max(1);
    let (width, height) = (scaled(width), scaled(height));
    Frame {
        camera: frame.camera.resized(width as u32, height as u32),
        photo: frame.photo.clone(),
        depth_m: lo_imaging::resize_depth(&frame.depth_m, width, height),
        exposure: frame.exposure,
    }
}

/// Returns the up to four pixels around `(u, v)` (pixel centres at integers) with their bilinear weights, clamped to
/// the image.
pub(crate) fn bilinear(u: f32, v: f32, width: usize, height: usize) -> [(usize, usize, f32); 4] {
    let (u, v) = (u.clamp(0.0, (width - 1) as f32), v.clamp(0.0, (height - 1) as f32));
    let (x, y) = (u as usize, v as usize);
    let (fx, fy) = (u - x as f32, v - y as f32);
    let (x1, y1) = ((x + 1).min(width - 1), (y + 1).min(height - 1));
    [(x, y, (1.0 - fx) * (1.0 - fy)), (x1, y, fx * (1.0 - fy)), (x, y1, (1.0 - fx) * fy), (x1, y1, fx * fy)]
}
