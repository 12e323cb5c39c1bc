//! The surface that the photo shows, as a map of inverse depth, and where rays meet it.

use lo_cone::{Cone, ConeSample, ConeTracer};
use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::Image;
use lo_scene::Frame;

use crate::edges::edges;
use crate::fade::fade;
use crate::guided::guided_inverse;

/// Longer side of the depth map; a finer one adds noise and time.
const MAX_SIDE: usize = 960;

/// Pixels of the depth map from one sample of a ray to the next, and the most samples of one stretch.
const STRIDE_PX: f32 = 1.0;
const MAX_SAMPLES: usize = 64;

/// Readings that are compared with the octree, where some are missing.
const COMPARED: usize = 2000;

/// Nearest depth at which anything is looked up, in metres.
const MIN_DEPTH_M: f32 = 1e-3;

/// Steps of the secant method (Illinois) from a crossing of the map to its place.
const SECANT_STEPS: usize = 5;

/// Inverse depth of what the photo shows. Planes are affine in it, and so are rays along their picture.
pub(crate) struct Surface {
    width: f32,
    height: f32,
    fx: f32,
    fy: f32,
    cx: f32,
    cy: f32,
    /// 1 / m.
    inverse: Image<f32>,
    /// Whether a depth edge runs between a pixel and those right of it, below it, and right below: there nothing is blended.
    edge: Image<bool>,
    /// How far inverse depth is from continuing its neighbours' plane, the largest of 3 × 3 pixels: large at depth edges.
    jump: Image<f32>,
    least_inverse: f32,
}

/// A ray that is followed from a distance on.
pub(crate) struct Stretch {
    pub origin: Vec3,
    pub direction: Vec3,
    /// Distances in metres.
    pub from_m: f32,
    pub to_m: f32,
    /// A ray that begins no further behind the surface than this, in metres, begins on it.
    pub slack_m: f32,
}

/// Where a ray meets the surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Meeting {
    pub distance_m: f32,
    /// Position in the picture, in pixels of the depth map.
    pub at: Vec2,
    /// Depth along the optical axis.
    pub depth_m: f32,
    /// How far the ray is from the surface there: of a depth edge that it passes behind, the height of the edge.
    pub off_m: f32,
    /// 1 where all of the ray before it, from where it was followed, lies before what the photo shows; 0 where not; between where it begins just
    /// behind that.
    pub free: f32,
}

/// What a stretch of a ray showed.
pub(crate) enum Followed {
    Met(Meeting),
    /// It ends in free space within the picture; as [`Meeting::free`], and above 0.
    Free(f32),
    /// It leaves the picture, or ends behind what the photo shows.
    Lost,
}

impl Surface {
    /// Of the frame's depth. Pixels without a reading near by get the place at which the octree holds what they show.
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

    /// Position in the picture and inverse depth of a point; at or behind the camera they mean nothing.
    pub fn project(&self, point: Vec3) -> (Vec2, f32) {
        let inverse = -1.0 / point.z;
        (Vec2::new(self.cx + self.fx * point.x * inverse, self.cy - self.fy * point.y * inverse), inverse)
    }

    /// Whether a point lies before the camera, in the picture or at most `margin_px` pixels beside it.
    pub fn shows(&self, point: Vec3, margin_px: f32) -> bool {
        let (at, inverse) = self.project(point);
        inverse > 0.0
            && (-margin_px..=self.width + margin_px).contains(&at.x)
            && (-margin_px..=self.height + margin_px).contains(&at.y)
    }

    /// Width and height in pixels.
    pub fn size(&self) -> Vec2 {
        Vec2::new(self.width, self.height)
    }

    /// Pixels per metre at a depth of one metre.
    pub fn focal_px(&self) -> f32 {
        self.fx.max(self.fy)
    }

    /// Distance beyond which no ray in the picture is before anything.
    pub fn farthest_m(&self) -> f32 {
        1.0 / self.least_inverse
    }

    /// The median depth.
    pub fn usual_depth_m(&self) -> f32 {
        let mut inverse = self.inverse.pixels().to_vec();
        let middle = inverse.len() / 2;
        1.0 / *inverse.select_nth_unstable_by(middle, f32::total_cmp).1
    }

    /// By how much inverse depth differs on both sides of a depth edge at a position.
    pub fn jump(&self, at: Vec2) -> f32 {
        Blend::new(&self.jump, at).bilinear(&self.jump)
    }

    /// Inverse depth at a position: blended between pixels, but for those between which a depth edge runs.
    fn inverse_at(&self, at: Vec2) -> f32 {
        let blend = Blend::new(&self.inverse, at);
        if self.edge[blend.first] { self.inverse[blend.nearest()] } else { blend.bilinear(&self.inverse) }
    }

    /// Follows a ray through the picture, front to back.
    pub fn follow(&self, stretch: &Stretch) -> Followed {
        let Some((from_m, to_m)) = self.within_picture(stretch) else { return Followed::Lost };
        let point = |distance_m: f32| stretch.origin + stretch.direction * distance_m;
        let (start, end) = (self.project(point(from_m)), self.project(point(to_m)));
        let samples = ((end.0 - start.0).length() / STRIDE_PX).ceil().clamp(1.0, MAX_SAMPLES as f32);
        // Along the picture position and inverse depth of a ray are linear; how far the ray is behind the surface, in inverse depth:
        let at = |share: f32| (start.0.lerp(end.0, share), start.1 + (end.1 - start.1) * share);
        let behind = |share: f32| {
            let (at, inverse) = at(share);
            self.inverse_at(at) - inverse
        };
        let meeting = |share: f32, off: f32, free: f32| {
            let (at, inverse) = at(share);
            // t such that the point's inverse depth is this: distances times inverse depth are linear, too.
            let distance_m = (from_m * start.1 * (1.0 - share) + to_m * end.1 * share) / inverse;
            Meeting { distance_m, at, depth_m: 1.0 / inverse, off_m: off / (inverse * inverse), free }
        };
        // Before the picture's edge something may stand that the photo does not show.
        let mut free = if from_m - stretch.from_m < stretch.slack_m { 1.0 } else { 0.0 };
        let (mut last, mut off) = (0.0, behind(0.0));
        if off >= 0.0 {
            let off_m = off / (start.1 * start.1);
            if off_m <= stretch.slack_m && behind(1.0 / samples) > off {
                return Followed::Met(meeting(0.0, off, free));
            }
            free *= fade(off_m / stretch.slack_m, (0.5, 1.0));
        }
        let mut before = off < 0.0;
        for sample in 1..=samples as usize {
            let share = sample as f32 / samples;
            let next = behind(share);
            if off < 0.0 && next >= 0.0 {
                let (share, off) = crossing(&behind, (last, off), (share, next));
                let met = meeting(share, off.abs(), free);
                if met.off_m <= stretch.slack_m {
                    return Followed::Met(met);
                }
            }
            if before && next >= 0.0 {
                free = 0.0;
            }
            before |= next < 0.0;
            (last, off) = (share, next);
        }
        if free > 0.0 && before && to_m == stretch.to_m { Followed::Free(free) } else { Followed::Lost }
    }

    /// How position in the picture changes where the ray's direction turns by each of two small vectors: on the plane through
    /// the surface around the meeting.
    pub fn footprint(&self, origin: Vec3, met: &Meeting, direction: Vec3, turns: [Vec3; 2]) -> [Vec2; 2] {
        const REACH_PX: f32 = 2.0;
        let here = self.inverse_at(met.at);
        // On the side without a depth edge, where there is one.
        let slope = |axis: Vec2| {
            let [after, before] =
                [1.0, -1.0].map(|side| side * (self.inverse_at(met.at + axis * (side * REACH_PX)) - here));
            if after.abs() < before.abs() { after / REACH_PX } else { before / REACH_PX }
        };
        let (along_u, along_v) = (slope(Vec2::X), slope(Vec2::Y));
        // 1/z = i + gᵤ (u − u₀) + gᵥ (v − v₀) is the plane N · p = 1.
        let ahead = 1.0 / met.depth_m + along_u * (self.cx - met.at.x) + along_v * (self.cy - met.at.y);
        let normal = Vec3::new(along_u * self.fx, -along_v * self.fy, -ahead);
        let height = 1.0 - normal.dot(origin);
        turns.map(|turn| {
            let direction = direction + turn;
            let slant = normal.dot(direction);
            let distance_m = if slant == 0.0 { f32::INFINITY } else { height / slant };
            // Where the plane is seen from its edge the footprint ends somewhere.
            let distance_m = if distance_m > 0.0 { distance_m } else { f32::INFINITY };
            let point = origin + direction * distance_m.clamp(0.5 * met.distance_m, 2.0 * met.distance_m);
            self.project(point).0 - met.at
        })
    }

    /// The part of a stretch that lies in the picture.
    fn within_picture(&self, stretch: &Stretch) -> Option<(f32, f32)> {
        let (mut from_m, mut to_m) = (stretch.from_m, stretch.to_m);
        // In homogeneous coordinates each side is linear along the ray: value(t) = a + b t, not negative within.
        let sides = |p: Vec3| {
            let (u, v, w) = (self.fx * p.x - self.cx * p.z, -self.fy * p.y - self.cy * p.z, -p.z);
            [u, self.width * w - u, v, self.height * w - v]
        };
        let (starts, slopes) = (sides(stretch.origin), sides(stretch.direction));
        let near = [(-stretch.origin.z - MIN_DEPTH_M, -stretch.direction.z)];
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

/// Between two shares, before the surface and behind it: where the ray meets it, and what is left there.
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

/// Gives pixels without a reading the place at which the octree holds what they show.
///
/// Cones meet leaves on their near side: by how much too near the octree is in the median, readings tell.
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

/// The four pixels around a position; pixel centres lie at +0.5, and the border goes on outside.
struct Blend {
    first: (usize, usize),
    last: (usize, usize),
    share: Vec2,
}

impl Blend {
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
