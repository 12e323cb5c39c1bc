use std::collections::HashMap;

use lo_completion::{Enclosure, ShellOptions};
use lo_geometry::{Camera, Cube, Vec3};
use lo_imaging::Image;
use lo_nets::light::{PhotoView, VisiblePoint};
use lo_scene::{Frame, ObservedPhoto, Room, Surfel, place_cube};

/// The light network's input from one or several frames.
///
/// Estimation and training both use it. All positions are in metres in the first camera's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct ObservedFrame {
    /// The camera of the first photo, in pixels of the working resolution.
    pub camera: Camera,
    /// Observed surface elements, one for each depth reading that is not a flying pixel.
    pub surfels: Vec<Surfel>,
    /// Up and the planes that enclose the surfels.
    pub room: Room,
    /// The cube that the octree covers.
    pub cube: Cube,
    /// The surfels, and the photo's pixels without depth reading, with whether each is clipped.
    ///
    /// Windows, lamps, and shiny, black or distant surfaces have no reading. Their depth is that of the room's planes,
    /// or continues the surrounding depth. Points beyond the cube are moved to its boundary. A normal is zero where no
    /// surface could be fitted.
    pub points: Vec<VisiblePoint>,
    /// The cameras, in the order in which `points` is grouped.
    pub views: Vec<PhotoView>,
}

impl ObservedFrame {
    /// Prepares a frame at the [working resolution](Frame::working). Returns `None` if no depth reading is left.
    ///
    /// `up` is the unit vector against gravity, estimated if `None`. `normals` replace those fitted to depth where they
    /// are `Some`.
    ///
    /// # Panics
    /// If `normals` differ in size from the depth map.
    pub fn new(working: &Frame, up: Option<Vec3>, normals: Option<&Image<Option<Vec3>>>) -> Option<Self> {
        Self::from_photos(&[working], &[ObservedPhoto::first(working, normals)], up)
    }

    /// Prepares several frames: each at the working resolution, and as an observed photo. Returns `None` if no depth
    /// reading is left.
    ///
    /// `up` is as in [`ObservedFrame::new`].
    pub fn from_photos(working: &[&Frame], observed: &[ObservedPhoto], up: Option<Vec3>) -> Option<Self> {
        let surfels: Vec<Surfel> = observed.iter().flat_map(ObservedPhoto::surfels).collect();
        if surfels.is_empty() {
            return None;
        }
        let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
        let cube = place_cube(&positions);
        let enclosure = Enclosure::around(&surfels, &ShellOptions { up, ..ShellOptions::default() });
        let photos = observed.iter().zip(working);
        let mut each: Vec<Vec<VisiblePoint>> =
            photos.map(|(photo, working)| visible_points(photo, working, &enclosure, cube)).collect();
        if each.len() > 1 {
            drop_clipped(&mut each, cube);
        }
        let view = |(photo, points): (&ObservedPhoto, &Vec<VisiblePoint>)| PhotoView {
            camera: photo.clean.camera,
            camera_from_world: photo.first_from_camera.inverse(),
            points: points.len(),
        };
        let views: Vec<PhotoView> = observed.iter().zip(&each).map(view).collect();
        let camera = views[0].camera;
        Some(Self { points: each.concat(), camera, room: enclosure.room(), cube, surfels, views })
    }
}

/// Returns the points that a photo shows, in the first camera's frame.
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

/// Leaves along an edge of the cube, in each of which an unclipped photo replaces clipped ones.
const LEAVES: f32 = 128.0;

/// Drops a photo's clipped points in leaves that another photo shows unclipped.
fn drop_clipped(photos: &mut [Vec<VisiblePoint>], cube: Cube) {
    let leaf = |point: &VisiblePoint| (cube.unit_from_world(point.position_m) * LEAVES).floor().as_ivec3().to_array();
    // The photo with certain points in a leaf; `None` for several photos.
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
