use lo_completion::{Enclosure, ShellOptions};
use lo_geometry::{Camera, Cube, Vec3};
use lo_imaging::Image;
use lo_nets::light::VisiblePoint;
use lo_scene::{Frame, Room, Surfel, place_cube};

/// What the light network is told of a frame, in estimation and in training alike.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenFrame {
    /// The camera, in pixels of the working resolution.
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
}

impl SeenFrame {
    /// Of a frame at the [working resolution](Frame::working), with the unit vector against gravity and the surfaces' normals where something
    /// else than depth tells them; `None` where no depth reading is left.
    ///
    /// # Panics
    /// Where `normals` are not of the depth map's size.
    pub fn new(working: &Frame, up: Option<Vec3>, normals: Option<&Image<Option<Vec3>>>) -> Option<Self> {
        let clean = working.without_flying_pixels();
        let (mut fitted, radiance, clipped) = (clean.normals(), clean.radiance(), clean.clipped());
        if let Some(told) = normals {
            assert_eq!(
                (told.width(), told.height()),
                (fitted.width(), fitted.height()),
                "one normal for each depth pixel"
            );
            fitted.pixels_mut().iter_mut().zip(told.pixels()).for_each(|(fitted, told)| *fitted = told.or(*fitted));
        }
        let normals = fitted;
        let surfels = clean.surfels_with_normals(&normals, &radiance);
        if surfels.is_empty() {
            return None;
        }
        let positions: Vec<Vec3> = surfels.iter().map(|surfel| surfel.position_m).collect();
        let cube = place_cube(&positions);
        let enclosure = Enclosure::around(&surfels, &ShellOptions { up, ..ShellOptions::default() });
        let complete = working.depth_m.pixels().iter().all(|&z| z > 0.0);
        let filled_m = if complete { clean.depth_m.clone() } else { enclosure.filled_depth_m(&clean) };
        let camera = clean.depth_camera();
        let pixels = (0..filled_m.height()).flat_map(|y| (0..filled_m.width()).map(move |x| (x, y)));
        let points = pixels.filter_map(|at| {
            let read = clean.depth_m[at] > 0.0;
            if !read && working.depth_m[at] > 0.0 {
                return None; // a flying pixel shows two surfaces
            }
            let position_m = camera.unproject(at.0 as f64 + 0.5, at.1 as f64 + 0.5, f64::from(filled_m[at]));
            let normal = if read { normals[at] } else { enclosure.normal_at(position_m) };
            Some(VisiblePoint {
                position_m: cube.pulled_inside(position_m),
                radiance: radiance[at],
                normal: normal.unwrap_or(Vec3::ZERO),
                certain: !clipped[at],
            })
        });
        Some(Self { points: points.collect(), camera: clean.camera, room: enclosure.room(), cube, surfels })
    }
}
