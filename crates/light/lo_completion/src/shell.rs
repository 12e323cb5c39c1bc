//! Completion of the whole room from one frame or several.

use std::collections::HashSet;

use lo_geometry::{Cube, RigidTransform, Vec2, Vec3};
use lo_imaging::{DepthMap, RadianceImage};
use lo_octree::{Provenance, RadiancePoint};
use lo_scene::{Frame, ObservedPhoto, Room, Side, Surfel};

use crate::extrapolate::{Faces, extrapolate};
use crate::fill::fill_holes;
use crate::gravity::{Facet, up_from_facets};
use crate::highlights::{self, HighlightReport};
use crate::lamps::{self, LampReport};
use crate::layout::{AssumedHeights, RoomBox, fit};
use crate::visibility::{CameraView, CameraViews, FaceClosure};
use crate::warning::CompletionWarning;

/// Number of leaf layers behind each face.
///
/// Where the camera sees a face, the observed surfels are its only layer and follow the sensor's noise: rays from
/// elsewhere would pass through cracks. In addition, wide cones read coarser nodes, whose opacity is that of their
/// average column; a face that only cuts a corner of such a node hardly closes it. Of the 32,768 rays of a 256 × 128
/// panorama, at worst among six positions in the two photos of the test data, 20 transmit more than 1.5 % with one
/// layer, 16 with two, none with three.
const BACKING_LAYERS: u32 = 3;

/// Assumptions of the completion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShellOptions {
    /// Direction against gravity in the world frame, if known; otherwise it is estimated.
    pub up: Option<Vec3>,
    /// Height in metres of the camera above an unobserved floor.
    pub camera_height_m: f32,
    /// Height in metres of an unobserved ceiling above the floor.
    pub ceiling_height_m: f32,
    /// Depth of the octree that is built from the points; it has one closing point per leaf.
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
    /// Observed surfels first, then those behind holes of the depth map, then the closing faces.
    pub surfels: Vec<Surfel>,
    /// Gravity and the six planes.
    pub room: Room,
    /// A cube that contains the room.
    pub cube: Cube,
    /// Counts and balances.
    pub report: ShellReport,
}

impl Shell {
    /// Returns the points from which the lighting octree is built.
    pub fn points(&self) -> Vec<RadiancePoint> {
        self.surfels.iter().copied().map(RadiancePoint::from).collect()
    }
}

/// Counts and balances of a completion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShellReport {
    /// Surfels with a reading.
    pub seen: usize,
    /// Surfels of pixels without a reading: radiance from the photo, inferred depth.
    pub filled: usize,
    /// Surfels on the closing faces.
    pub closing: usize,
    /// Clipped highlights.
    pub highlights: HighlightReport,
    /// Light from outside the view.
    pub lamps: LampReport,
}

/// Closes the room around a frame at working resolution (see [`Frame::working`]).
///
/// 1. Clipped highlights get a value (a documented rule, calibrated on HDR panoramas).
/// 2. Gravity, axes and six planes are estimated from the normals; the planes enclose all observed points but 0.5 %.
/// 3. Pixels without a reading get a depth from the planes or their surroundings and keep the photo's colour.
/// 4. The six faces get their observed radiance, extrapolated. A patch of light on the unobserved part of the ceiling
///    supplies the light that is missing to explain the observed brightness.
/// 5. Each leaf that a face crosses gets a surfel, unless an observed surface is already there or the camera sees
///    through the point: from the camera, the photo is unchanged. Surfaces are shells: the hidden volume behind an
///    observed object (the back of a sofa, the inside of a desk) stays empty, and the wall behind it is closed.
///
/// Any frame gives a room: without readings it is a box of default size with the photo on its walls. Deterministic.
pub fn shell(frame: &Frame, options: &ShellOptions) -> Shell {
    shell_of_photos(&[ObservedPhoto::new(frame, RigidTransform::IDENTITY)], options)
}

/// Completes a room as [`shell`] does, from several photos of it, in the axes of the first one's camera.
///
/// Highlights and holes are processed per photo; gravity, planes, faces and the lamp use all photos. A closing surfel
/// is placed only where no camera sees through its position.
///
/// # Panics
/// Without photos.
pub fn shell_of_photos(photos: &[ObservedPhoto], options: &ShellOptions) -> Shell {
    let first = &photos.first().expect("a shell needs at least one photo").clean;
    let camera = first.depth_camera();
    let pixel_area = (1.0 / (camera.fx * camera.fy)) as f32;
    let seen: Vec<Surfel> = photos.iter().flat_map(ObservedPhoto::surfels).collect();
    let room = enclose(&seen, options);
    let cube = cube_around(&room, options.octree_depth);
    let tolerance_m = 1.5 * cube.node_edge_m(options.octree_depth);

    let (mut all, mut views, mut highlights) = (Vec::new(), Vec::new(), HighlightReport::default());
    for photo in photos {
        let (surfels, view, report) = full_view(photo, &room, tolerance_m);
        all.extend(surfels);
        views.push(view);
        highlights = highlights.combined_with(report, photos.len());
    }
    let views = CameraViews(views);
    let mut faces = extrapolate(&all, &room, pixel_area);
    let lamps = lamps::add(&mut faces, &room, &all, &views);

    for surfel in &mut all {
        surfel.position_m = cube.pulled_inside(surfel.position_m);
    }
    let filled = all.iter().filter(|s| s.provenance == Provenance::Inferred).count();
    let seen = all.len() - filled;
    let mut surfels = all;
    // A stable sort keeps the pixel order within both groups.
    surfels.sort_by_key(|s| s.provenance == Provenance::Inferred);
    let closing = closing_surfels(&room, &cube, options.octree_depth, &faces, &views, &surfels);
    let report = ShellReport { seen, filled, closing: closing.len(), highlights, lamps };
    surfels.extend(closing);
    Shell { surfels, room: room.room(), cube, report }
}

/// Returns the surfels of a photo with depth everywhere, in the room's frame, and the visibility from its camera.
fn full_view(photo: &ObservedPhoto, room: &RoomBox, tolerance_m: f32) -> (Vec<Surfel>, CameraView, HighlightReport) {
    let ObservedPhoto { clean, normals, first_from_camera, .. } = photo;
    let camera = clean.depth_camera();
    let own_room = room.seen_from(first_from_camera);
    let (radiance, highlights) = highlights::restore_highlights(clean, normals, own_room.axes.col(1));
    let radiance = at_depth_resolution(radiance, &clean.depth_m);
    let full = Frame { depth_m: fill_holes(&clean.depth_m, &camera, &own_room), ..clean.clone() };
    let mut surfels = full.surfels_with_normals(normals, &radiance);
    mark_filled(&mut surfels, clean.depth_m.pixels(), &own_room);
    if *first_from_camera != RigidTransform::IDENTITY {
        surfels.iter_mut().for_each(|surfel| *surfel = surfel.moved(first_from_camera));
    }
    let camera_from_world = first_from_camera.inverse();
    let view = CameraView { camera, camera_from_world, radiance, depth_m: full.depth_m, tolerance_m };
    (surfels, view, highlights)
}

/// The room's gravity and six planes, and filled depth: steps 2 and 3 of [`shell`].
#[derive(Clone, Copy, Debug)]
pub struct Enclosure(RoomBox);

impl Enclosure {
    /// Encloses observed surfels.
    pub fn around(seen: &[Surfel], options: &ShellOptions) -> Self {
        Self(enclose(seen, options))
    }

    /// Returns the room as stored in the scene file.
    pub fn room(&self) -> Room {
        self.0.room()
    }

    /// Returns a depth for every pixel of a photo: its own where it has one, else from the planes or the surroundings.
    pub fn filled_depth_m(&self, photo: &ObservedPhoto) -> DepthMap {
        let ObservedPhoto { clean, first_from_camera, .. } = photo;
        fill_holes(&clean.depth_m, &clean.depth_camera(), &self.0.seen_from(first_from_camera))
    }

    /// Returns the unit normal, into the room, of the plane that contains a point.
    pub fn normal_at(&self, point: Vec3) -> Option<Vec3> {
        self.0.normal_at(point)
    }
}

fn enclose(seen: &[Surfel], options: &ShellOptions) -> RoomBox {
    let up = options.up.and_then(Vec3::try_normalize).unwrap_or_else(|| {
        let facets: Vec<Facet> = seen.iter().map(Facet::from).collect();
        up_from_facets(&facets)
    });
    let assumed =
        AssumedHeights { camera_height_m: options.camera_height_m, ceiling_height_m: options.ceiling_height_m };
    fit(seen, up, assumed).including_cameras(seen)
}

impl Shell {
    /// Returns the warnings about this completion.
    pub fn warnings(&self) -> Vec<CompletionWarning> {
        let ShellReport { seen, filled, highlights, lamps, .. } = self.report;
        let brightened = (highlights.brightened_regions > 0).then_some(CompletionWarning::Highlights {
            clipped_share: highlights.clipped_share,
            regions: highlights.brightened_regions,
            peak_radiance: highlights.peak_radiance,
        });
        let not_seen = |side| self.room.planes.iter().filter(|plane| plane.side == side && !plane.measured).count();
        let [floor, ceiling] = [Side::Floor, Side::Ceiling].map(|side| not_seen(side) > 0);
        let walls = not_seen(Side::Wall);
        let assumed =
            (floor || ceiling || walls > 0).then_some(CompletionWarning::AssumedPlanes { floor, ceiling, walls });
        [filled_warning(seen, filled), brightened, lamps.warning(), assumed].into_iter().flatten().collect()
    }
}

/// Returns a warning if the share of pixels with filled depth exceeds a twentieth.
pub fn filled_warning(seen: usize, filled: usize) -> Option<CompletionWarning> {
    let pixels = seen + filled;
    (filled as f32 / pixels.max(1) as f32 > 0.05).then_some(CompletionWarning::FilledDepth { filled, pixels })
}

/// Resamples radiance to the depth map's resolution, for frames that were not made by `working`.
fn at_depth_resolution(radiance: RadianceImage, depth_m: &DepthMap) -> RadianceImage {
    let (width, height) = (depth_m.width(), depth_m.height());
    if (radiance.width(), radiance.height()) == (width, height) {
        return radiance;
    }
    RadianceImage::from_fn(width, height, |x, y| {
        radiance[((2 * x + 1) * radiance.width() / (2 * width), (2 * y + 1) * radiance.height() / (2 * height))]
    })
}

/// Marks the surfels of pixels without a reading as inferred, and gives those on the room's faces the faces' normals.
/// `surfels` has one per pixel, in order.
fn mark_filled(surfels: &mut [Surfel], known: &[f32], room: &RoomBox) {
    for (surfel, _) in surfels.iter_mut().zip(known).filter(|(_, z)| **z <= 0.0) {
        surfel.provenance = Provenance::Inferred;
        surfel.normal = room.normal_at(surfel.position_m).unwrap_or(surfel.normal);
    }
}

/// Returns the smallest cube around the box, with a margin for the backing layers.
fn cube_around(room: &RoomBox, octree_depth: u32) -> Cube {
    let corners = (0..8).map(|i| {
        let pick = |bit: u32, axis: usize| if i >> bit & 1 == 0 { room.low[axis] } else { room.high[axis] };
        room.world(Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2)))
    });
    let (low, high) = corners.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), c| (l.min(c), h.max(c)));
    let margin = 2.0 * (BACKING_LAYERS + 1) as f32 / (1u32 << octree_depth.clamp(3, 16)) as f32;
    Cube::centred(0.5 * (low + high), (high - low).max_element() / (1.0 - margin.min(0.5)))
}

/// Creates one surfel in each leaf that a face crosses, where it occludes nothing that the camera sees and the leaf is
/// free.
///
/// Further layers, each one leaf further out, back the first ([`BACKING_LAYERS`]).
fn closing_surfels(
    room: &RoomBox,
    cube: &Cube,
    octree_depth: u32,
    faces: &Faces,
    views: &CameraViews,
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
        // The backing may be close behind observed surfaces: where it shows through a crack it has the same colour.
        let margin = |view: &CameraView| if index == 0 { view.tolerance_m } else { 0.25 * leaf_m };
        let plane = layer.plane(face);
        let outward = -plane.normal.abs();
        // Columns of leaves along the plane's steepest axis: each is crossed in at most a few leaves.
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
                    let radiance = match views.closure(position_m, margin, leaf_m) {
                        FaceClosure::Face => faces.radiance(room, face, inside),
                        FaceClosure::Photo(light) => light,
                        FaceClosure::None => continue,
                    };
                    // The corners of the backing may be outside the cube.
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
