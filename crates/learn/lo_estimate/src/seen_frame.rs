use std::collections::HashMap;

use lo_completion::{Enclosure, ShellOptions};
use lo_geometry::{Camera, Cube, RigidTransform, Vec3};
use lo_imaging::Image;
use lo_nets::light::{PhotoView, VisiblePoint};
use lo_scene::{Frame, ObservedPhoto, Room, Surfel, place_cube};

/// What the light network is told of a frame, or of several, in estimation and in training alike.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenFrame {
    /// The camera of the first photo, in pixels of the working resolution.
    pub camera: Camera,
    /// What is seen where it is seen, one for each depth reading that is none of a flying pixel.
    pub surfels: Vec<Surfel>,
    /// Gravity and the planes around the surfels.
    pub room: Room,
    /// Part of the world that the octree covers.
    pub cube: Cube,
    /// The surfels, and what the photo shows where depth has no reading (windows, lamps, what is shiny, black or too far), with whether the photo
    /// is clipped there. What has no reading lies on the room's planes or continues what is around it. All that is beyond the cube is drawn in to its
    /// side. Normals are zero where no surface could be fitted.
    pub points: Vec<VisiblePoint>,
    /// The cameras; the points are theirs, one after another.
    pub views: Vec<PhotoView>,
}

impl SeenFrame {
    /// Of a frame at the [working resolution](Frame::working), with the unit vector against gravity and the surfaces' normals where something
    /// else than depth tells them; `None` where no depth reading is left.
    ///
    /// # Panics
    /// Where `normals` are not of the depth map's size.
    pub fn new(working: &Frame, up: Option<Vec3>, normals: Option<&Image<Option<Vec3>>>) -> Option<Self> {
        Self::of_photos(&[(working, RigidTransform::IDENTITY)], up, normals)
    }

    /// Of several frames, each with its camera's place in the first one's axes; `None` where no depth reading is left. `normals` are the first
    /// frame's.
    ///
    /// # Panics
    /// Where `normals` are not of the first depth map's size.
    pub fn of_photos(
        photos: &[(&Frame, RigidTransform)],
        up: Option<Vec3>,
        normals: Option<&Image<Option<Vec3>>>,
    ) -> Option<Self> {
        let mut seen: Vec<ObservedPhoto> =
            photos.iter().map(|(frame, pose)| ObservedPhoto::new(frame, *pose)).collect();
        if let Some((first, told)) = seen.first_mut().zip(normals) {
            first.override_normals(told);
        }
        let surfels: Vec<Surfel> = seen.iter().flat_map(ObservedPhoto::surfels).collect();
        if surfels.is_empty() {
            return None;
        }
        let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
        let cube = place_cube(&positions);
        let enclosure = Enclosure::around(&surfels, &ShellOptions { up, ..ShellOptions::default() });
        let mut each: Vec<Vec<VisiblePoint>> = seen
            .iter()
            .zip(photos)
            .map(|(seen, (working, _))| visible_points(seen, working, &enclosure, cube))
            .collect();
        if each.len() > 1 {
            drop_clipped(&mut each, cube);
        }
        let view = |(seen, points): (&ObservedPhoto, &Vec<VisiblePoint>)| PhotoView {
            camera: seen.clean.camera,
            camera_from_world: seen.first_from_camera.inverse(),
            points: points.len(),
        };
        let views: Vec<PhotoView> = seen.iter().zip(&each).map(view).collect();
        let camera = views[0].camera;
        Some(Self { points: each.concat(), camera, room: enclosure.room(), cube, surfels, views })
    }
}

/// What a photo shows, in the first photo's axes.
fn visible_points(photo: &ObservedPhoto, working: &Frame, enclosure: &Enclosure, cube: Cube) -> Vec<VisiblePoint> {
    let ObservedPhoto { clean, normals, radiance, first_from_camera } = photo;
    let clipped = clean.clipped();
    let complete = working.depth_m.pixels().iter().all(|&z| z > 0.0);
    let filled_m = if complete { clean.depth_m.clone() } else { enclosure.filled_depth_m(photo) };
    let camera = clean.depth_camera();
    let pixels = (0..filled_m.height()).flat_map(|y| (0..filled_m.width()).map(move |x| (x, y)));
    let points = pixels.filter_map(|at| {
        let read = clean.depth_m[at] > 0.0;
        if !read && working.depth_m[at] > 0.0 {
            return None; // a flying pixel shows two surfaces
        }
        let local_m = camera.unproject(at.0 as f64 + 0.5, at.1 as f64 + 0.5, f64::from(filled_m[at]));
        let position_m = first_from_camera.point(local_m);
        let own_normal = || normals[at].map(|normal| first_from_camera.direction(normal));
        let normal = if read { own_normal() } else { enclosure.normal_at(position_m) };
        Some(VisiblePoint {
            position_m: cube.pulled_inside(position_m),
            radiance: radiance[at],
            normal: normal.unwrap_or(Vec3::ZERO),
            certain: !clipped[at],
        })
    });
    points.collect()
}

/// Leaves of the finest octree along an edge of the cube in which photos take each other's place.
const LEAVES: f32 = 128.0;

/// Leaves out what a photo shows clipped where another shows it unclipped.
fn drop_clipped(photos: &mut [Vec<VisiblePoint>], cube: Cube) {
    let leaf = |point: &VisiblePoint| (cube.unit_from_world(point.position_m) * LEAVES).floor().as_ivec3().to_array();
    // The photo that is certain of a leaf; `None` where several are.
    let mut certain: HashMap<[i32; 3], Option<usize>> = HashMap::new();
    for (photo, points) in photos.iter().enumerate() {
        for point in points.iter().filter(|point| point.certain) {
            let known = certain.entry(leaf(point)).or_insert(Some(photo));
            if *known != Some(photo) {
                *known = None;
            }
        }
    }
    for (photo, points) in photos.iter_mut().enumerate() {
        points.retain(|point| point.certain || certain.get(&leaf(point)).is_none_or(|known| *known == Some(photo)));
    }
}
