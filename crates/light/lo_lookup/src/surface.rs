//! The surface that the photo shows, as an image of inverse depth, and its intersection with rays.

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::Image;
use lo_scene::Frame;

use crate::edges::edges;
use crate::fade::fade;
use crate::guided::guided_inverse;

/// Longer side of the depth map; a finer one adds noise and time.
const MAX_SIDE: usize = 960;

/// Stride of a ray's samples, in pixels of the depth map, and the greatest number of samples per segment.
const STRIDE_PX: f32 = 1.0;
const MAX_SAMPLES: usize = 64;

/// Number of readings compared with the octree, where some are missing.
const COMPARED: usize = 2000;

/// Least depth of a lookup, in metres.
const MIN_DEPTH_M: f32 = 1e-3;

/// Iterations of the secant method (Illinois) that refine a crossing.
const SECANT_STEPS: usize = 5;

/// Inverse depth of the photo's surface. Planes are affine in it, and so are rays along their projection.
pub(crate) struct DepthSurface {
    width: f32,
    height: f32,
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    /// 1 / m.
    inverse: Image<f32>,
    /// Whether a depth edge runs between a pixel and those right of it, below it, and diagonally below; nothing is
    /// blended there.
    edge: Image<bool>,
    /// Deviation of inverse depth from its neighbours' plane, maximum over 3 × 3 pixels: large at depth edges.
    jump: Image<f32>,
    least_inverse: f32,
}

/// A segment of a ray.
pub(crate) struct RaySegment {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Distances in metres.
    pub from_m: f32,
    pub to_m: f32,
    /// A ray that begins at most this far behind the surface, in metres, begins on it.
    pub slack_m: f32,
}

/// Intersection of a ray with the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceHit {
    pub distance_m: f32,
    /// Position in the photo, in pixels of the depth map.
    pub at: Vec2,
    /// Depth along the optical axis.
    pub depth_m: f32,
    /// Distance between ray and surface at the hit. Where the ray passes behind a depth edge, it is the height of the
    /// edge.
    pub off_m: f32,
    /// 1 where all of the segment before the hit is in front of the photo's surface, 0 where not; in between where it
    /// begins just behind the surface.
    pub free: f32,
}

/// Result of following a segment.
pub(crate) enum FollowResult {
    Hit(SurfaceHit),
    /// The segment ends in free space within the photo; the value is that of [`SurfaceHit::free`], above 0.
    Free(f32),
    /// The segment leaves the photo or ends behind its surface.
    Lost,
}

impl DepthSurface {
    /// Builds the surface from the frame's depth. Pixels without a reading nearby get the octree's depth.
    pub fn new(frame: &Frame, tracer: &ConeTracer) -> Self {
        let depth_m = frame.without_flying_pixels().depth_m;
        let (width, height) = (frame.photo.width(), frame.photo.height());
        let longer = width.max(height).min(MAX_SIDE);
        let side = |pixels: usize| (pixels * longer).div_ceil(width.max(height)).max(1);
        let mut inverse = guided_inverse(&depth_m, &frame.photo, side(width), side(height));
        let camera = frame.camera.resized(inverse.width() as u32, inverse.height() as u32);
        fill(&mut inverse, &camera, tracer);
        let (edge, jump) = edges(&inverse);
        let least_inverse = inverse.pixels().iter().copied().fold(f32::INFINITY, f32::min).max(1e-3);
        let (width, height) = (camera.width as f32, camera.height as f32);
        let [fx, fy, cx, cy] = [camera.fx, camera.fy, camera.cx, camera.cy].map(|v| v as f32);
        Self { width, height, fx, fy, cx, cy, inverse, edge, jump, least_inverse }
    }

    /// Returns the position in the photo and the inverse depth of a point; at or behind the camera they are
    /// meaningless.
    pub fn project(&self, point: Vec3) -> (Vec2, f32) {
        let inverse = -1.0 / point.z;
        (Vec2::new(self.cx + self.fx * point.x * inverse, self.cy - self.fy * point.y * inverse), inverse)
    }

    /// Returns whether a point is in front of the camera and in the photo, or at most `margin_px` pixels beside it.
    pub fn shows(&self, point: Vec3, margin_px: f32) -> bool {
        let (at, inverse) = self.project(point);
        inverse > 0.0
            && (-margin_px..=self.width + margin_px).contains(&at.x)
            && (-margin_px..=self.height + margin_px).contains(&at.y)
    }

    /// Returns width and height in pixels.
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.width, self.height)
    }

    /// Returns the number of pixels per metre at a depth of one metre.
    pub fn focal_px(&self) -> f32 {
        self.fx.max(self.fy)
    }

    /// Returns the distance beyond which no ray in the photo is in front of the surface.
    pub fn farthest_m(&self) -> f32 {
        1.0 / self.least_inverse
    }

    /// Returns the median depth.
    pub fn median_depth_m(&self) -> f32 {
        let mut inverse = self.inverse.pixels().to_vec();
        let middle = inverse.len() / 2;
        1.0 / *inverse.select_nth_unstable_by(middle, f32::total_cmp).1
    }

    /// Returns the difference of inverse depth across a depth edge at a position.
    pub fn jump(&self, at: Vec2) -> f32 {
        BilinearTap::new(&self.jump, at).bilinear(&self.jump)
    }

    /// Returns inverse depth at a position, blended between pixels except across a depth edge.
    fn inverse_at(&self, at: Vec2) -> f32 {
        let blend = BilinearTap::new(&self.inverse, at);
        if self.edge[blend.first] { self.inverse[blend.nearest()] } else { blend.bilinear(&self.inverse) }
    }

    /// Follows a ray through the photo, front to back.
    pub fn follow(&self, segment: &RaySegment) -> FollowResult {
        let Some((from_m, to_m)) = self.within_picture(segment) else { return FollowResult::Lost };
        let point = |distance_m: f32| segment.origin + segment.direction * distance_m;
        let (start, end) = (self.project(point(from_m)), self.project(point(to_m)));
        let samples = ((end.0 - start.0).length() / STRIDE_PX).ceil().clamp(1.0, MAX_SAMPLES as f32);
        // Position and inverse depth of a ray are linear along its projection. `behind` is how far the ray is behind
        // the surface, in inverse depth.
        let at = |share: f32| (start.0.lerp(end.0, share), start.1 + (end.1 - start.1) * share);
        let behind = |share: f32| {
            let (at, inverse) = at(share);
            self.inverse_at(at) - inverse
        };
        let hit_at = |share: f32, off: f32, free: f32| {
            let (at, inverse) = at(share);
            // t such that the point's inverse depth is this: distance × inverse depth is linear, too.
            let distance_m = (from_m * start.1 * (1.0 - share) + to_m * end.1 * share) / inverse;
            SurfaceHit { distance_m, at, depth_m: 1.0 / inverse, off_m: off / (inverse * inverse), free }
        };
        // Before the photo's border, something outside the photo may block the ray.
        let mut free = if from_m - segment.from_m < segment.slack_m { 1.0 } else { 0.0 };
        let (mut last, mut off) = (0.0, behind(0.0));
        if off >= 0.0 {
            let off_m = off / (start.1 * start.1);
            if off_m <= segment.slack_m && behind(1.0 / samples) > off {
                return FollowResult::Hit(hit_at(0.0, off, free));
            }
            free *= fade(off_m / segment.slack_m, (0.5, 1.0));
        }
        let mut before = off < 0.0;
        for sample in 1..=samples as usize {
            let share = sample as f32 / samples;
            let next = behind(share);
            if off < 0.0 && next >= 0.0 {
                let (share, off) = crossing(&behind, (last, off), (share, next));
                let hit = hit_at(share, off.abs(), free);
                if hit.off_m <= segment.slack_m {
                    return FollowResult::Hit(hit);
                }
            }
            if before && next >= 0.0 {
                free = 0.0;
            }
            before |= next < 0.0;
            (last, off) = (share, next);
        }
        if free > 0.0 && before && to_m == segment.to_m { FollowResult::Free(free) } else { FollowResult::Lost }
    }

    /// Returns how the position in the photo changes when the ray's direction turns by each of two small vectors, on
    /// the plane through the surface at the hit.
    pub fn footprint(&self, origin: Vec3, hit: &SurfaceHit, direction: Vec3, turns: [Vec3; 2]) -> [Vec2; 2] {
        const REACH_PX: f32 = 2.0;
        let here = self.inverse_at(hit.at);
        // On the side without a depth edge, where there is one.
        let slope = |axis: Vec2| {
            let [after, before] =
                [1.0, -1.0].map(|side| side * (self.inverse_at(hit.at + axis * (side * REACH_PX)) - here));
            if after.abs() < before.abs() { after / REACH_PX } else { before / REACH_PX }
        };
        let (along_u, along_v) = (slope(Vec2::X), slope(Vec2::Y));
        // 1/z = i + gᵤ (u − u₀) + gᵥ (v − v₀) is the plane N · p = 1.
        let ahead = 1.0 / hit.depth_m + along_u * (self.cx - hit.at.x) + along_v * (self.cy - hit.at.y);
        let normal = Vec3::new(along_u * self.fx, -along_v * self.fy, -ahead);
        let height = 1.0 - normal.dot(origin);
        turns.map(|turn| {
            let direction = direction + turn;
            let slant = normal.dot(direction);
            let distance_m = if slant == 0.0 { f32::INFINITY } else { height / slant };
            // Limits the footprint where the plane is seen at a grazing angle.
            let distance_m = if distance_m > 0.0 { distance_m } else { f32::INFINITY };
            let point = origin + direction * distance_m.clamp(0.5 * hit.distance_m, 2.0 * hit.distance_m);
            self.project(point).0 - hit.at
        })
    }

    /// Returns the part of a segment that is in the photo.
    fn within_picture(&self, segment: &RaySegment) -> Option<(f32, f32)> {
        let (mut from_m, mut to_m) = (segment.from_m, segment.to_m);
        // In homogeneous coordinates each side is linear along the ray: value(t) = a + b t, not negative inside.
        let sides = |p: Vec3| {
            let (u, v, w) = (self.fx * p.x - self.cx * p.z, -self.fy * p.y - self.cy * p.z, -p.z);
            [u, self.width * w - u, v, self.height * w - v]
        };
        let (starts, slopes) = (sides(segment.origin), sides(segment.direction));
        let near = [(-segment.origin.z - MIN_DEPTH_M, -segment.direction.z)];
        for (start, slope) in starts.into_iter().zip(slopes).chain(near) {
            let end = -start / slope;
            if slope > 0.0 {
                from_m = from_m.max(end);
            } else if slope < 0.0 {
                to_m = to_m.min(end);
            } else if start < 0.0 {
                return None;
            }
        }
        (from_m < to_m).then_some((from_m, to_m))
    }
}

/// Finds the crossing between a share before the surface and one behind it; returns its share and residual.
fn crossing(behind: &impl Fn(f32) -> f32, mut before: (f32, f32), mut after: (f32, f32)) -> (f32, f32) {
    let mut best = if after.1 < -before.1 { after } else { before };
    // Illinois: an end that stays twice counts half.
    let mut side = 0;
    let (mut low, mut high) = (before.1, after.1);
    for _ in 0..SECANT_STEPS {
        if best.1.abs() < 1e-6 {
            break;
        }
        let share = (before.0 * high - after.0 * low) / (high - low);
        let value = behind(share);
        if value.abs() < best.1.abs() {
            best = (share, value);
        }
        if value >= 0.0 {
            (after, high) = ((share, value), value);
            low *= if side == 1 { 0.5 } else { 1.0 };
            side = 1;
        } else {
            (before, low) = ((share, value), value);
            high *= if side == -1 { 0.5 } else { 1.0 };
            side = -1;
        }
    }
    best
}

/// Fills pixels without a reading with the octree's depth.
///
/// Cones hit leaves on their near side; the median bias is measured on pixels with readings.
fn fill(inverse: &mut Image<f32>, camera: &Camera, tracer: &ConeTracer) {
    let width = inverse.width();
    let (known, holes): (Vec<usize>, Vec<usize>) =
        (0..inverse.pixels().len()).partition(|&i| inverse.pixels()[i] > 0.0);
    if holes.is_empty() {
        return;
    }
    let tan_half_angle = (0.5 * camera.pixel_angle_rad()).tan();
    let depths_m = |pixels: &[usize]| -> Vec<f32> {
        let cone = |&i: &usize| Cone {
            origin: Vec3::ZERO,
            direction: camera.direction((i % width) as f64 + 0.5, (i / width) as f64 + 0.5),
            tan_half_angle,
        };
        let cones: Vec<Cone> = pixels.iter().map(cone).collect();
        let mut samples = vec![ConeSample::default(); cones.len()];
        tracer.trace_batch(&cones, &mut samples);
        cones.iter().zip(&samples).map(|(cone, sample)| -cone.direction.z * sample.distance_m).collect()
    };
    let compared: Vec<usize> = known.iter().copied().step_by((known.len() / COMPARED).max(1)).collect();
    let own_m = compared.iter().map(|&i| 1.0 / inverse.pixels()[i]);
    let mut behind_m: Vec<f32> = own_m.zip(depths_m(&compared)).map(|(own_m, octree_m)| own_m - octree_m).collect();
    let middle = behind_m.len() / 2;
    let lag_m = if behind_m.is_empty() { 0.0 } else { *behind_m.select_nth_unstable_by(middle, f32::total_cmp).1 };
    for (&i, depth_m) in holes.iter().zip(depths_m(&holes)) {
        inverse.pixels_mut()[i] = 1.0 / (depth_m + lag_m).max(MIN_DEPTH_M);
    }
}

/// The four pixels around a position; pixel centres are at +0.5, and border pixels are repeated outside.
struct BilinearTap {
    first: (usize, usize),
    last: (usize, usize),
    share: Vec2,
}

impl BilinearTap {
    fn new<T>(image: &Image<T>, at: Vec2) -> Self {
        let size = Vec2::new((image.width() - 1) as f32, (image.height() - 1) as f32);
        let at = (at - 0.5).min(size).max(Vec2::ZERO);
        let first = (at.x as usize, at.y as usize);
        let last = ((first.0 + 1).min(image.width() - 1), (first.1 + 1).min(image.height() - 1));
        Self { first, last, share: at - Vec2::new(first.0 as f32, first.1 as f32) }
    }

    fn nearest(&self) -> (usize, usize) {
        let of = |first: usize, last: usize, share: f32| if share < 0.5 { first } else { last };
        (of(self.first.0, self.last.0, self.share.x), of(self.first.1, self.last.1, self.share.y))
    }

    fn bilinear(&self, image: &Image<f32>) -> f32 {
        let ((x, y), (x1, y1)) = (self.first, self.last);
        let row = |y: usize| image[(x, y)] + self.share.x * (image[(x1, y)] - image[(x, y)]);
        let (top, bottom) = (row(y), row(y1));
        top + self.share.y * (bottom - top)
    }
}
