//! The box that closes the room: floor, ceiling and four walls along the room's axes.

use lo_geometry::{Mat3, Plane, RigidTransform, Vec3};
use lo_scene::{Room, RoomPlane, Side, Surfel};

/// Least cosine between a facet's normal and that of its side (24°).
const SAME_NORMAL: f32 = 0.91;

/// Share of the readings that may be outside a side: outliers, views through a window or a door.
const OUTSIDE_SHARE: f32 = 0.005;

/// Share of all readings that a plane needs to count as measured.
const MIN_SUPPORT: f32 = 0.01;

/// Bin width of the offset histograms, in metres.
const BIN_M: f32 = 0.02;

/// Height in metres below the camera above which a plane is a table rather than the floor.
const MIN_CAMERA_HEIGHT_M: f32 = 0.6;

/// Assumptions where nothing is observed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AssumedHeights {
    pub camera_height_m: f32,
    pub ceiling_height_m: f32,
}

/// A box aligned with the room's axes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoomBox {
    /// Columns: the room's axes in the world; the second one is up.
    pub axes: Mat3,
    /// Lowest corner along the axes, in metres.
    pub low: Vec3,
    /// Highest corner along the axes, in metres.
    pub high: Vec3,
    /// Whether each of the six faces (−x, +x, floor, ceiling, −z, +z) was fitted to readings.
    pub measured: [bool; 6],
}

impl RoomBox {
    /// Converts coordinates along the axes to a world point.
    pub fn world(&self, local: Vec3) -> Vec3 {
        self.axes * local
    }

    /// Converts a world point to coordinates along the axes.
    pub fn local(&self, world: Vec3) -> Vec3 {
        self.axes.transpose() * world
    }

    /// Returns the unit normal of a face into the room, in the world frame.
    pub fn inward(&self, face: usize) -> Vec3 {
        let axis = self.axes.col(face / 2);
        if face.is_multiple_of(2) { axis } else { -axis }
    }

    /// Returns the plane of a face, with its normal into the room.
    pub fn plane(&self, face: usize) -> Plane {
        let corner = if face.is_multiple_of(2) { self.low } else { self.high };
        Plane::through(self.world(corner), self.inward(face))
    }

    /// Returns the normal of the first face that contains a point.
    pub fn normal_at(&self, point: Vec3) -> Option<Vec3> {
        const ON_FACE_M: f32 = 0.01;
        let mut planes = (0..6).map(|face| self.plane(face));
        planes.find(|plane| plane.signed_distance_m(point).abs() < ON_FACE_M).map(|plane| plane.normal)
    }

    /// Returns the face and local point at which a ray from a point inside leaves the box. Both arguments are along the
    /// axes.
    pub fn exit(&self, origin: Vec3, direction: Vec3) -> (usize, Vec3) {
        let mut best = (f32::INFINITY, 0);
        for axis in 0..3 {
            let speed = direction[axis];
            if speed.abs() > 1e-9 {
                let (bound, face) =
                    if speed > 0.0 { (self.high[axis], 2 * axis + 1) } else { (self.low[axis], 2 * axis) };
                let distance = ((bound - origin[axis]) / speed).max(0.0);
                if distance < best.0 {
                    best = (distance, face);
                }
            }
        }
        let point = origin + direction * if best.0.is_finite() { best.0 } else { 0.0 };
        (best.1, point.clamp(self.low, self.high))
    }

    /// Returns the box in the axes of a camera inside it; bit-identical where these are the world's axes.
    pub fn seen_from(&self, world_from_camera: &RigidTransform) -> Self {
        if *world_from_camera == RigidTransform::IDENTITY {
            return *self;
        }
        let shift = self.local(world_from_camera.translation_m);
        let axes = Mat3::from_quat(world_from_camera.rotation.inverse()) * self.axes;
        Self { axes, low: self.low - shift, high: self.high - shift, measured: self.measured }
    }

    /// Extends the box to contain the cameras that observed these surfels, since rays begin at them.
    pub fn including_cameras(mut self, surfels: &[Surfel]) -> Self {
        const BESIDE_M: f32 = 0.05;
        let mut last = Vec3::ZERO;
        for surfel in surfels {
            if surfel.eye_m != last {
                last = surfel.eye_m;
                let eye = self.local(last);
                self.low = self.low.min(eye - BESIDE_M);
                self.high = self.high.max(eye + BESIDE_M);
            }
        }
        self
    }

    /// Returns the room as stored in the scene file.
    pub fn room(&self) -> Room {
        let sides = [Side::Wall, Side::Wall, Side::Floor, Side::Ceiling, Side::Wall, Side::Wall];
        let planes =
            (0..6).map(|face| RoomPlane { side: sides[face], plane: self.plane(face), measured: self.measured[face] });
        Room { up: self.axes.col(1), planes: planes.collect() }
    }
}

/// Fits the box to the observed surfels.
///
/// - *Azimuth*: the direction that most wall area agrees on modulo 90°; the camera's own without walls.
/// - *Measured side*: the outermost peak of the offsets of surfels facing it, if at most 0.5 % of all readings are more
///   than 10 cm behind. Otherwise the side is assumed where only 0.5 % are outside.
/// - *Floor* without a measured plane: `camera_height_m` below the camera.
/// - *Ceiling* without a measured plane: `ceiling_height_m` above the floor, at least 0.3 m above the camera and above
///   all observed points.
/// - *Walls* outside the view: at half the distance of the opposite wall, at least 1.2 m and at most 3 m, since photos
///   are usually taken towards the longer side of a room.
pub(crate) fn fit(surfels: &[Surfel], up: Vec3, assumed: AssumedHeights) -> RoomBox {
    let axes = axes_from(surfels, up);
    let sides: Vec<Option<SideExtent>> = (0..6).map(|face| outermost(surfels, &axes, face)).collect();
    let reach = |face: usize| sides[face].map_or(0.0, |s| s.offset_m);
    let measured = |face: usize| sides[face].is_some_and(|s| s.measured);
    let mut offsets = [0.0f32; 6];
    let mut known: [bool; 6] = std::array::from_fn(measured);

    known[2] = measured(2) && reach(2) >= MIN_CAMERA_HEIGHT_M;
    offsets[2] = if known[2] { reach(2) } else { (reach(2) + 0.02).max(assumed.camera_height_m) };
    let default_ceiling = assumed.ceiling_height_m - offsets[2];
    known[3] = measured(3) && reach(3) + offsets[2] > 1.9 && reach(3) > 0.1;
    offsets[3] = if known[3] { reach(3) } else { default_ceiling.max(reach(3) + 0.05).max(0.3) };
    for face in [0, 1, 4, 5] {
        known[face] = measured(face) && reach(face) > 0.1;
        offsets[face] = reach(face);
    }
    for face in [0, 1, 4, 5] {
        if !known[face] {
            let behind = (0.5 * reach(face ^ 1)).clamp(1.2, 3.0);
            offsets[face] = (reach(face) + 0.05).max(behind);
        }
    }
    RoomBox {
        axes,
        low: -Vec3::new(offsets[0], offsets[2], offsets[4]),
        high: Vec3::new(offsets[1], offsets[3], offsets[5]),
        measured: known,
    }
}

/// Returns the room's axes: `up` and the two horizontal directions that walls face.
fn axes_from(surfels: &[Surfel], up: Vec3) -> Mat3 {
    // Camera forward, or camera up where it looks straight down, projected to the horizontal.
    let flat = |v: Vec3| (v - up * v.dot(up)).try_normalize();
    let forward = flat(Vec3::NEG_Z).or_else(|| flat(Vec3::Y)).unwrap_or(Vec3::X);
    let right = forward.cross(up);
    const BINS: usize = 90;
    let mut votes = [0.0f32; BINS];
    let quarter = std::f32::consts::FRAC_PI_2;
    let azimuth = |n: Vec3| n.dot(right).atan2(n.dot(forward)).rem_euclid(quarter);
    let walls = || surfels.iter().filter(|s| s.normal.dot(up).abs() < 0.2);
    for surfel in walls() {
        votes[(azimuth(surfel.normal) / quarter * BINS as f32) as usize % BINS] += area(surfel);
    }
    let smooth = |bin: usize| -> f32 {
        (0..7).map(|k| votes[(bin + BINS + k - 3) % BINS] * [1.0, 2.0, 3.0, 4.0, 3.0, 2.0, 1.0][k]).sum()
    };
    let peak =
        (0..BINS).fold((0.0, None), |best, bin| if smooth(bin) > best.0 { (smooth(bin), Some(bin)) } else { best }).1;
    let mut angle = peak.map_or(0.0, |bin| (bin as f32 + 0.5) / BINS as f32 * quarter);
    if peak.is_some() {
        for width in [0.10f32, 0.05, 0.05] {
            let (mut sum, mut total) = (0.0, 0.0);
            for surfel in walls() {
                let difference = (azimuth(surfel.normal) - angle + 0.5 * quarter).rem_euclid(quarter) - 0.5 * quarter;
                let weight = area(surfel) * (1.0 - (difference / width).powi(2)).max(0.0);
                sum += weight * difference;
                total += weight;
            }
            if total > 0.0 {
                angle += sum / total;
            }
        }
    }
    // Of the four equivalent rotations, the one nearest to the camera's heading.
    if angle > 0.5 * quarter {
        angle -= quarter;
    }
    let ahead = forward * angle.cos() + right * angle.sin();
    Mat3::from_cols(ahead.cross(up), up, -ahead)
}

/// Extent of the readings towards a side.
#[derive(Clone, Copy, Debug)]
struct SideExtent {
    /// Distance from the camera along the outward normal, in metres.
    offset_m: f32,
    /// Whether a plane was found there.
    measured: bool,
}

fn outermost(surfels: &[Surfel], axes: &Mat3, face: usize) -> Option<SideExtent> {
    let outward = if face.is_multiple_of(2) { -axes.col(face / 2) } else { axes.col(face / 2) };
    let mut reaches: Vec<f32> = surfels.iter().map(|s| s.position_m.dot(outward)).collect();
    if reaches.is_empty() {
        return None;
    }
    let rank = ((reaches.len() as f32 * (1.0 - OUTSIDE_SHARE)) as usize).min(reaches.len() - 1);
    let limit = *reaches.select_nth_unstable_by(rank, f32::total_cmp).1;
    let facing: Vec<f32> = surfels
        .iter()
        .filter(|s| s.normal.dot(outward) < -SAME_NORMAL)
        .map(|s| s.position_m.dot(outward))
        .filter(|&offset| offset > limit - 0.35)
        .collect();
    let needed = (surfels.len() as f32 * MIN_SUPPORT).max(8.0);
    Some(match peak(&facing, limit) {
        Some((offset_m, support)) if support >= needed => SideExtent { offset_m, measured: true },
        _ => SideExtent { offset_m: limit.max(0.0), measured: false },
    })
}

/// Returns offset and support of the outermost strong peak among `offsets`, within 10 cm of `limit`.
fn peak(offsets: &[f32], limit: f32) -> Option<(f32, f32)> {
    let low = limit - 0.35;
    let bins = 32;
    let mut counts = vec![0.0f32; bins];
    for offset in offsets {
        let bin = ((offset - low) / BIN_M) as usize;
        if bin < bins {
            counts[bin] += 1.0;
        }
    }
    let smooth = |bin: usize| (bin.saturating_sub(2)..(bin + 3).min(bins)).map(|b| counts[b]).sum::<f32>();
    let best = (0..bins).map(smooth).fold(0.0, f32::max);
    // The outermost bin at least half as strong as the strongest: a wall behind its skirting board and pictures.
    let bin = (0..bins).rev().find(|&bin| best > 0.0 && smooth(bin) >= 0.5 * best)?;
    let bin = (bin.saturating_sub(3)..=bin).fold(bin, |a, b| if smooth(b) > smooth(a) { b } else { a });
    let mut centre = low + (bin as f32 + 0.5) * BIN_M;
    let mut support = 0.0;
    for width in [0.08f32, 0.05, 0.05, 0.05] {
        let (mut sum, mut total) = (0.0, 0.0);
        support = 0.0;
        for offset in offsets {
            let weight = (1.0 - ((offset - centre) / width).powi(2)).max(0.0);
            sum += weight * offset;
            total += weight;
            support += f32::from(u8::from(weight > 0.0));
        }
        if total > 0.0 {
            centre = sum / total;
        }
    }
    // A peak far inside the limit is furniture in front of something else.
    (limit - centre < 0.10).then_some((centre, support))
}

/// Returns the area in square metres, up to a constant, that a surfel represents: its pixel's footprint on the surface.
pub(crate) fn area(surfel: &Surfel) -> f32 {
    area_of(surfel.position_m - surfel.eye_m, surfel.depth_m, surfel.normal)
}

/// Returns the [`area`] of a surface at `ray_m` from the camera, with this depth and normal.
pub(crate) fn area_of(ray_m: Vec3, depth_m: f32, normal: Vec3) -> f32 {
    let distance = ray_m.length().max(1e-3);
    let cosine = (-normal.dot(ray_m) / distance).max(0.1);
    let obliquity = (depth_m / distance).max(0.1);
    distance * distance * obliquity.powi(3) / cosine
}
