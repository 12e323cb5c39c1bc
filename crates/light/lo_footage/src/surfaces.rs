use lo_cone::{Cone, ConeTracer, Settings, TracerError};
use lo_geometry::{Camera, Plane, Ray, RigidTransform, Vec3};
use lo_imaging::{DepthMap, Image, Photo};
use lo_scene::{Frame, LitScene};
use rayon::prelude::*;

/// Longer side of the depth map whose pixels become surfaces.
const SIDE: usize = 640;

/// Largest relative difference in inverse depth of neighbours on one surface: as a tangent against the line of sight,
/// 80°, and at least.
const STEEP: f32 = 6.0;
const LEAST_STEP: f32 = 0.025;

/// Smallest distance of a rendered surface from the camera, metres.
const NEAREST_M: f32 = 0.02;

/// Distance within which the octree's surface is that of a plane of the room: leaf edges, and share of the distance.
const ON_PLANE: (f32, f32) = (2.0, 0.05);

/// Least opacity of a surface in the octree.
const LEAST_OPACITY: f32 = 0.5;

/// Surfaces of a scene, seen from any camera: those of its photo, and behind and beside them the planes of the room and
/// the octree.
pub struct SceneSurfaces {
    /// Corners of the photo's surfaces, in the room's axes.
    corners: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    planes: Vec<Plane>,
    tracer: ConeTracer,
    leaf_edge_m: f32,
}

impl SceneSurfaces {
    /// Prepares the surfaces of a scene.
    ///
    /// # Errors
    /// If the octree cannot be traced.
    pub fn new(scene: &LitScene) -> Result<Self, TracerError> {
        let frame = of_side(&scene.frame, SIDE);
        let clean = frame.without_flying_pixels();
        let (corners, triangles) = mesh(&clean);
        let light = &scene.light;
        Ok(Self {
            corners,
            triangles,
            planes: scene.room.iter().flat_map(|room| room.planes.iter().map(|plane| plane.plane)).collect(),
            tracer: ConeTracer::new(light, Settings::default())?,
            leaf_edge_m: light.cube.node_edge_m(light.octree.depth()),
        })
    }

    /// Returns the depth along the optical axis in metres at each pixel of a camera; 0 where nothing is known.
    pub fn depth_m(&self, camera: &Camera, room_from_camera: &RigidTransform) -> DepthMap {
        let mut depth_m = self.photo_depth_m(camera, room_from_camera);
        let width = depth_m.width();
        depth_m.pixels_mut().par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            let missing: Vec<usize> = (0..width).filter(|&x| row[x] == 0.0).collect();
            let directions: Vec<Vec3> =
                missing.iter().map(|&x| camera.direction(x as f64 + 0.5, y as f64 + 0.5)).collect();
            for ((&x, direction), distance_m) in
                missing.iter().zip(&directions).zip(self.behind_m(camera, room_from_camera, &directions))
            {
                row[x] = -direction.z * distance_m;
            }
        });
        depth_m
    }

    /// Returns depth of the surfaces that the scene's photo shows; 0 elsewhere.
    pub(crate) fn photo_depth_m(&self, camera: &Camera, room_from_camera: &RigidTransform) -> DepthMap {
        let camera_from_room = room_from_camera.inverse();
        let (width, height) = (camera.width as usize, camera.height as usize);
        // Inverse depth is affine in the image.
        let seen: Vec<Option<[f32; 3]>> = self
            .corners
            .par_iter()
            .map(|&corner| {
                let (u, v, z) = camera.project(camera_from_room.point(corner))?;
                (z as f32 > NEAREST_M).then_some([u as f32, v as f32, 1.0 / z as f32])
            })
            .collect();
        let mut inverse_m = Image::new(width, height, vec![0.0f32; width * height]);
        for triangle in &self.triangles {
            let [Some(a), Some(b), Some(c)] = triangle.map(|corner| seen[corner as usize]) else { continue };
            draw(&mut inverse_m, [a, b, c]);
        }
        inverse_m.map(|&inverse| if inverse > 0.0 { 1.0 / inverse } else { 0.0 })
    }

    /// Returns the distances at which rays from the camera meet the room, 0 where they do not.
    fn behind_m(&self, camera: &Camera, room_from_camera: &RigidTransform, directions: &[Vec3]) -> Vec<f32> {
        let origin = room_from_camera.translation_m;
        let tan_half_angle = 0.5 * camera.pixel_angle_rad();
        let cones: Vec<Cone> = directions
            .iter()
            .map(|&direction| Cone { origin, direction: room_from_camera.direction(direction), tan_half_angle })
            .collect();
        let mut samples = vec![lo_cone::ConeSample::default(); cones.len()];
        self.tracer.trace_batch(&cones, &mut samples);
        let met = cones.iter().zip(&samples).map(|(cone, sample)| {
            let ray = Ray { origin, direction: cone.direction };
            if sample.opacity < LEAST_OPACITY || !sample.distance_m.is_finite() {
                let planes = self.planes.iter().filter_map(|plane| plane.intersect(&ray));
                return planes.reduce(f32::min).unwrap_or(0.0);
            }
            let reach_m = (ON_PLANE.0 * self.leaf_edge_m).max(ON_PLANE.1 * sample.distance_m);
            let planes = self.planes.iter().filter_map(|plane| plane.intersect(&ray));
            let off_m = |distance_m: &f32| (distance_m - sample.distance_m).abs();
            let nearest = planes.filter(|distance_m| off_m(distance_m) < reach_m);
            nearest.min_by(|a, b| off_m(a).total_cmp(&off_m(b))).unwrap_or(sample.distance_m)
        });
        met.collect()
    }
}

/// Returns a frame's camera and depth, limited to `side` pixels on the longer side, with a photo of one pixel.
fn of_side(frame: &Frame, side: usize) -> Frame {
    let (width, height) = (frame.depth_m.width(), frame.depth_m.height());
    let scale = (side as f64 / width.max(height) as f64).min(1.0);
    let scaled = |length: usize| ((length as f64 * scale).round() as usize).max(1);
    let (width, height) = (scaled(width), scaled(height));
    Frame {
        camera: frame.camera.resized(width as u32, height as u32),
        photo: Photo::Srgb8(Image::new(1, 1, vec![[0; 3]])),
        depth_m: lo_imaging::resize_depth(&frame.depth_m, width, height),
        exposure: frame.exposure,
    }
}

/// Returns the points of a depth map and the triangles between neighbours on one surface.
fn mesh(frame: &Frame) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let depth_m = &frame.depth_m;
    let camera = frame.depth_camera();
    let (width, height) = (depth_m.width(), depth_m.height());
    let point = |i: usize| {
        let (x, y) = (i % width, i / width);
        camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(depth_m[(x, y)]))
    };
    let corners = (0..width * height).into_par_iter().map(point).collect();
    let largest = (STEEP * (1.0 / camera.fx).max(1.0 / camera.fy) as f32).max(LEAST_STEP);
    let connected = |a: usize, b: usize| {
        let [a, b] = [a, b].map(|i| depth_m.pixels()[i]);
        a > 0.0 && b > 0.0 && (a - b).abs() <= largest * a.max(b)
    };
    let mut triangles = Vec::with_capacity(2 * width * height);
    for y in 0..height.saturating_sub(1) {
        for x in 0..width.saturating_sub(1) {
            let [a, b] = [y * width + x, y * width + x + 1];
            let [c, d] = [a + width, b + width];
            // The shorter diagonal, so that corners of surfaces are kept.
            let z = |i: usize| depth_m.pixels()[i];
            let halves = if (z(a) - z(d)).abs() <= (z(b) - z(c)).abs() {
                [[a, c, d], [a, d, b]]
            } else {
                [[a, c, b], [b, c, d]]
            };
            let whole = |&[a, b, c]: &[usize; 3]| connected(a, b) && connected(b, c) && connected(c, a);
            triangles.extend(halves.into_iter().filter(whole).map(|corners| corners.map(|i| i as u32)));
        }
    }
    (corners, triangles)
}

/// Draws a triangle of corners `[u, v, 1 / z]` into an image of inverse depth; the nearest surface stays.
fn draw(inverse_m: &mut Image<f32>, [a, b, c]: [[f32; 3]; 3]) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if area.abs() < 1e-9 {
        return;
    }
    let range = |axis: usize, length: usize| {
        let [low, high] = [f32::min, f32::max].map(|pick| pick(pick(a[axis], b[axis]), c[axis]));
        // Pixel centres are at + 0.5.
        let first = (low - 0.5).ceil().max(0.0) as usize;
        first..((high - 0.5).floor().min(length as f32 - 1.0) + 1.0).max(0.0) as usize
    };
    for y in range(1, inverse_m.height()) {
        for x in range(0, inverse_m.width()) {
            let (u, v) = (x as f32 + 0.5, y as f32 + 0.5);
            let edge = |p: [f32; 3], q: [f32; 3]| ((q[0] - p[0]) * (v - p[1]) - (q[1] - p[1]) * (u - p[0])) / area;
            let shares = [edge(b, c), edge(c, a), edge(a, b)];
            // A pixel on a common edge belongs to both.
            if shares.iter().all(|&share| share >= -1e-4) {
                let inverse = shares[0] * a[2] + shares[1] * b[2] + shares[2] * c[2];
                let nearest = &mut inverse_m[(x, y)];
                *nearest = nearest.max(inverse);
            }
        }
    }
}
