//! The whole room from one frame, or from several.

use std::collections::HashSet;

use lo_events::Warning;
use lo_geometry::{Cube, RigidTransform, Vec2, Vec3};
use lo_imaging::{DepthMap, RadianceImage};
use lo_octree::{Provenance, RadiancePoint};
use lo_scene::{Frame, Room, SeenPhoto, Side, Surfel};

use crate::extrapolate::{Faces, extrapolate};
use crate::fill::fill_holes;
use crate::gravity::{Facet, up_from_facets};
use crate::highlights::{self, HighlightReport};
use crate::lamps::{self, LampReport};
use crate::layout::{Assumed, RoomBox, fit};
use crate::visibility::{Closing, Views, Visibility};

/// Layers of leaves behind each face.
///
/// Where the camera sees a face, the seen surfels are its only layer, and they follow the sensor's noise: rays from elsewhere would slip through
/// cracks. And wide cones read coarser nodes, whose opacity is that of their average column: a face that only cuts a
/// corner of such a node hardly closes it. Of the 32,768 rays of a 256 × 128 panorama, at worst among six
/// places in the two photos of the test data, 20 keep more than 1.5 % with one layer, 16 with two, none with three.
const BACKING_LAYERS: u32 = 3;

/// What the shell may assume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShellOptions {
    /// Direction against gravity in the world frame, where it is known; otherwise it is estimated.
    pub up: Option<Vec3>,
    /// Height of the camera above a floor that is not seen, in metres.
    pub camera_height_m: f32,
    /// Height of a ceiling that is not seen above the floor, in metres.
    pub ceiling_height_m: f32,
    /// Depth of the octree that the points are for: closing points are one per leaf.
    pub octree_depth: u32,
}

impl Default for ShellOptions {
    fn default() -> Self {
        Self { up: None, camera_height_m: 1.5, ceiling_height_m: 2.6, octree_depth: 7 }
    }
}

/// A closed room.
#[derive(Clone, Debug, PartialEq)]
pub struct Shell {
    /// Seen surfels first, then those behind holes of the depth map, then the closing faces.
    pub surfels: Vec<Surfel>,
    /// Gravity and the six planes.
    pub room: Room,
    /// A cube that contains the room.
    pub cube: Cube,
    /// What was done.
    pub report: ShellReport,
}

impl Shell {
    /// What the lighting octree is built from.
    pub fn points(&self) -> Vec<RadiancePoint> {
        self.surfels.iter().copied().map(RadiancePoint::from).collect()
    }
}

/// Counts and balances of a completion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShellReport {
    /// Surfels with a reading.
    pub seen: usize,
    /// Surfels of pixels without a reading: their colour is the photo's, their depth inferred.
    pub filled: usize,
    /// Surfels on the closing faces.
    pub closing: usize,
    /// Clipped highlights.
    pub highlights: HighlightReport,
    /// Light from outside of the view.
    pub lamps: LampReport,
}

/// Closes the room around a frame at working resolution (see [`Frame::working`]).
///
/// 1. Clipped highlights get a value (a documented rule, calibrated on HDR panoramas).
/// 2. Gravity, axes and six planes from the normals; the planes enclose everything seen but 0.5 % of it.
/// 3. Pixels without a reading get a depth from the planes or their surroundings and keep the photo's colour.
/// 4. The six faces get the radiance of what is seen of them, extrapolated; a patch of light on the unseen part of the ceiling
///    supplies what the seen surfaces' brightness asks for beyond that.
/// 5. Each leaf that a face crosses gets a surfel, unless a seen surface is there already or the camera sees through that place: from
///    the camera, the photo stays as it is. Surfaces are shells: what lies hidden behind a seen object (the back of a sofa, the inside of a desk) stays
///    empty, and the wall behind it is closed.
///
/// Any frame gives a room: without readings it is a box of default size with the photo on its walls. Deterministic.
pub fn shell(frame: &Frame, options: &ShellOptions) -> Shell {
    shell_of_photos(&[SeenPhoto::new(frame, RigidTransform::IDENTITY)], options)
}

/// [`shell`] around several photos of one room, in the axes of the first one's camera.
///
/// Each photo's highlights and holes are its own; gravity, planes, faces and the lamp come from all of them. A surfel closes the room where no
/// camera sees through its place.
///
/// # Panics
/// Without photos.
pub fn shell_of_photos(photos: &[SeenPhoto], options: &ShellOptions) -> Shell {
    let first = &photos.first().expect("a shell is of a photo at least").clean;
    let camera = first.depth_camera();
    let pixel_area = (1.0 / (camera.fx * camera.fy)) as f32;
    let seen: Vec<Surfel> = photos.iter().flat_map(SeenPhoto::surfels).collect();
    let room = enclose(&seen, options);
    let cube = cube_around(&room, options.octree_depth);
    let tolerance_m = 1.5 * cube.node_edge_m(options.octree_depth);

    let (mut all, mut views, mut highlights) = (Vec::new(), Vec::new(), HighlightReport::default());
    for photo in photos {
        let (surfels, view, report) = full_view(photo, &room, tolerance_m);
        all.extend(surfels);
        views.push(view);
        highlights = highlights.and(report, photos.len());
    }
    let views = Views(views);
    let mut faces = extrapolate(&all, &room, pixel_area);
    let lamps = lamps::add(&mut faces, &room, &all, &views);

    for surfel in &mut all {
        surfel.position_m = cube.pulled_inside(surfel.position_m);
    }
    let filled = all.iter().filter(|s| s.provenance == Provenance::Inferred).count();
    let seen = all.len() - filled;
    let mut surfels = all;
    // A stable sort keeps the pixel order within both kinds.
    surfels.sort_by_key(|s| s.provenance == Provenance::Inferred);
    let closing = closing_surfels(&room, &cube, options.octree_depth, &faces, &views, &surfels);
    let report = ShellReport { seen, filled, closing: closing.len(), highlights, lamps };
    surfels.extend(closing);
    Shell { surfels, room: room.room(), cube, report }
}

/// What a photo shows with a depth everywhere: surfels in the room's frame, and what its camera sees where.
fn full_view(photo: &SeenPhoto, room: &RoomBox, tolerance_m: f32) -> (Vec<Surfel>, Visibility, HighlightReport) {
    let SeenPhoto { clean, normals, first_from_camera, .. } = photo;
    let camera = clean.depth_camera();
    let own_room = room.seen_from(first_from_camera);
    let (radiance, highlights) = highlights::recover_shining(clean, normals, own_room.axes.col(1));
    let radiance = at_depth_resolution(radiance, &clean.depth_m);
    let full = Frame { depth_m: fill_holes(&clean.depth_m, &camera, &own_room), ..clean.clone() };
    let mut surfels = full.surfels_with_normals(normals, &radiance);
    mark_filled(&mut surfels, clean.depth_m.pixels(), &own_room);
    if *first_from_camera != RigidTransform::IDENTITY {
        surfels.iter_mut().for_each(|surfel| *surfel = surfel.moved(first_from_camera));
    }
    let camera_from_world = first_from_camera.inverse();
    let view = Visibility { camera, camera_from_world, radiance, depth_m: full.depth_m, tolerance_m };
    (surfels, view, highlights)
}

/// Gravity and the six planes around what is seen, and depth where there is no reading: steps 2 and 3 of [`shell`] alone.
#[derive(Clone, Copy, Debug)]
pub struct Enclosure(RoomBox);

impl Enclosure {
    /// Around seen surfels.
    pub fn around(seen: &[Surfel], options: &ShellOptions) -> Self {
        Self(enclose(seen, options))
    }

    /// What the scene file keeps of it.
    pub fn room(&self) -> Room {
        self.0.room()
    }

    /// A depth for every pixel of a photo: its own where it has one, else that of the planes or of what is around.
    pub fn filled_depth_m(&self, photo: &SeenPhoto) -> DepthMap {
        let SeenPhoto { clean, first_from_camera, .. } = photo;
        fill_holes(&clean.depth_m, &clean.depth_camera(), &self.0.seen_from(first_from_camera))
    }

    /// Unit normal, into the room, of the plane that a point lies on.
    pub fn normal_at(&self, point: Vec3) -> Option<Vec3> {
        self.0.normal_at(point)
    }
}

fn enclose(seen: &[Surfel], options: &ShellOptions) -> RoomBox {
    let up = options.up.and_then(Vec3::try_normalize).unwrap_or_else(|| {
        let facets: Vec<Facet> = seen.iter().map(Facet::from).collect();
        up_from_facets(&facets)
    });
    let assumed = Assumed { camera_height_m: options.camera_height_m, ceiling_height_m: options.ceiling_height_m };
    fit(seen, up, assumed).around_eyes(seen)
}

impl Shell {
    /// What a user should know about this completion.
    pub fn warnings(&self) -> Vec<Warning> {
        let ShellReport { seen, filled, highlights, lamps, .. } = self.report;
        let brightened = (highlights.brightened_regions > 0).then_some(Warning::Highlights {
            clipped_share: highlights.clipped_share,
            regions: highlights.brightened_regions,
            peak_radiance: highlights.peak_radiance,
        });
        let not_seen = |side| self.room.planes.iter().filter(|plane| plane.side == side && !plane.measured).count();
        let [floor, ceiling] = [Side::Floor, Side::Ceiling].map(|side| not_seen(side) > 0);
        let walls = not_seen(Side::Wall);
        let assumed = (floor || ceiling || walls > 0).then_some(Warning::AssumedPlanes { floor, ceiling, walls });
        [filled_warning(seen, filled), brightened, lamps.warning(), assumed].into_iter().flatten().collect()
    }
}

/// What a user should know about pixels whose depth was filled in, beside those seen with their own: nothing up to a twentieth.
pub fn filled_warning(seen: usize, filled: usize) -> Option<Warning> {
    let pixels = seen + filled;
    (filled as f32 / pixels.max(1) as f32 > 0.05).then_some(Warning::FilledDepth { filled, pixels })
}

/// Radiance at the depth map's resolution, where the frame was not made by `working`.
fn at_depth_resolution(radiance: RadianceImage, depth_m: &DepthMap) -> RadianceImage {
    let (width, height) = (depth_m.width(), depth_m.height());
    if (radiance.width(), radiance.height()) == (width, height) {
        return radiance;
    }
    RadianceImage::from_fn(width, height, |x, y| {
        radiance[((2 * x + 1) * radiance.width() / (2 * width), (2 * y + 1) * radiance.height() / (2 * height))]
    })
}

/// Marks the surfels of pixels that had no reading and gives those on the room's faces the faces' normals; `surfels` holds one for
/// each pixel, in order.
fn mark_filled(surfels: &mut [Surfel], known: &[f32], room: &RoomBox) {
    for (surfel, _) in surfels.iter_mut().zip(known).filter(|(_, z)| **z <= 0.0) {
        surfel.provenance = Provenance::Inferred;
        surfel.normal = room.normal_at(surfel.position_m).unwrap_or(surfel.normal);
    }
}

/// The smallest cube around the box, with room for the backing layers.
fn cube_around(room: &RoomBox, octree_depth: u32) -> Cube {
    let corners = (0..8).map(|i| {
        let pick = |bit: u32, axis: usize| if i >> bit & 1 == 0 { room.low[axis] } else { room.high[axis] };
        room.world(Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2)))
    });
    let (low, high) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
    let margin = 2.0 * (BACKING_LAYERS + 1) as f32 / (1u32 << octree_depth.clamp(3, 16)) as f32;
    Cube::centred(0.5 * (low + high), (high - low).max_element() / (1.0 - margin.min(0.5)))
}

/// One surfel in each leaf that a face crosses, where it hides nothing that the camera sees and no other surfel is.
///
/// Further layers, each one leaf further out, back the first ([`BACKING_LAYERS`]).
fn closing_surfels(
    room: &RoomBox,
    cube: &Cube,
    octree_depth: u32,
    faces: &Faces,
    views: &Views,
    present: &[Surfel],
) -> Vec<Surfel> {
    let leaf_m = cube.node_edge_m(octree_depth);
    let leaf_of = |point: Vec3| ((point - cube.origin_m) / leaf_m).floor().as_ivec3();
    let mut occupied: HashSet<[i32; 3]> = present.iter().map(|s| leaf_of(s.position_m).to_array()).collect();
    let mut surfels = Vec::new();
    let grown = |leaves: u32| {
        let outwards = Vec3::splat(leaves as f32 * leaf_m);
        RoomBox { low: room.low - outwards, high: room.high + outwards, ..*room }
    };
    for (index, face) in (0..=BACKING_LAYERS).flat_map(|index| (0..6).map(move |face| (index, face))) {
        let layer = &grown(index);
        // The backing may come close behind what is seen: where it shows through a crack it has the same colour.
        let margin = |view: &Visibility| if index == 0 { view.tolerance_m } else { 0.25 * leaf_m };
        let plane = layer.plane(face);
        let outward = -plane.normal.abs();
        // Columns of leaves along the axis that the plane is steepest to: each is crossed in at most a few leaves.
        let main = (0..3).fold(0, |best, axis| if outward[axis] < outward[best] { axis } else { best });
        let (i, j) = ((main + 1) % 3, (main + 2) % 3);
        let corners = [0.0, 1.0].map(|x| [0.0, 1.0].map(|y| Faces::local(layer, face, Vec2::new(x, y))));
        let leaves = corners.map(|pair| pair.map(|corner| leaf_of(room.world(corner))));
        let first = leaves[0][0];
        let (low, high) = leaves.as_flattened().iter().fold((first, first), |(l, h), &c| (l.min(c), h.max(c)));
        for column_i in low[i]..=high[i] {
            for column_j in low[j]..=high[j] {
                let height = |di: f32, dj: f32| {
                    let mut point = Vec3::ZERO;
                    point[i] = cube.origin_m[i] + (column_i as f32 + di) * leaf_m;
                    point[j] = cube.origin_m[j] + (column_j as f32 + dj) * leaf_m;
                    point[main] = (plane.offset_m - plane.normal.dot(point)) / plane.normal[main];
                    point
                };
                let middle = height(0.5, 0.5);
                let local = room.local(middle);
                if (local - local.clamp(layer.low, layer.high)).length() > 0.9 * leaf_m {
                    continue;
                }
                let inside = local.clamp(room.low, room.high);
                let ends = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)].map(|(di, dj)| height(di, dj)[main]);
                let level = |m: f32| ((m - cube.origin_m[main]) / leaf_m).floor();
                let bottom = level(ends.into_iter().fold(f32::INFINITY, f32::min) + 1e-3 * leaf_m);
                let top = level(ends.into_iter().fold(f32::NEG_INFINITY, f32::max) - 1e-3 * leaf_m);
                for k in bottom as i32..=(top as i32).max(bottom as i32) {
                    let mut position_m = middle;
                    let base = cube.origin_m[main] + k as f32 * leaf_m;
                    position_m[main] = middle[main].clamp(base + 0.01 * leaf_m, base + 0.99 * leaf_m);
                    let radiance = match views.closing(position_m, margin, leaf_m) {
                        Closing::Face => faces.radiance(room, face, inside),
                        Closing::Photo(light) => light,
                        Closing::Nothing => continue,
                    };
                    // The corners of the backing may stick out of the cube.
                    if !cube.contains(position_m) || !occupied.insert(leaf_of(position_m).to_array()) {
                        continue;
                    }
                    let (normal, provenance) = (plane.normal, Provenance::Inferred);
                    let (eye_m, depth_m) = (Vec3::ZERO, -position_m.z);
                    surfels.push(Surfel { position_m, normal, radiance, provenance, eye_m, depth_m });
                }
            }
        }
    }
    surfels
}
