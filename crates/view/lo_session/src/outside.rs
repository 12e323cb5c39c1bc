use std::sync::Arc;

use lightoctree::LitScene;
use lo_export::RoomFaces;
use lo_geometry::{Camera, Mat3, Ray, Vec3};
use lo_imaging::Image;
use lo_mesh::{Material, Model, PlacedModel, PreparedModel};
use lo_octree::{LeafNode, Octree};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::lit::LitSceneCache;
use crate::outside_rays::RayCaster;
use crate::overlay::DepthRange;
use crate::visibility::visible_faces;
use crate::{Overlay, SessionError, State};

/// Maximum image size, pixels.
const MAX_SIZE: [u32; 2] = [1920, 1440];

/// Maximum coordinate of eye and target, metres.
const MAX_COORDINATE_M: f32 = 1000.0;

/// Accepted vertical fields of view, degrees.
const FOVS_DEG: std::ops::RangeInclusive<f32> = 5.0..=120.0;

/// Maximum exposure in either direction, stops.
const MAX_EXPOSURE_EV: f32 = 20.0;

/// A view of the room from any viewpoint.
///
/// The camera is a pinhole with square pixels at `eye_m`. Its axis passes through `target_m` and the image centre; up
/// is against gravity. In its frame (x = ahead × up, y = up, z = −ahead) [`Camera::project`] applies, with a focal
/// length of `height / (2 tan(fov / 2))` pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(deny_unknown_fields)]
pub struct OutsideView {
    /// Viewpoint, metres in the photo's frame.
    pub eye_m: [f32; 3],
    /// Point at the image centre, metres in the photo's frame.
    pub target_m: [f32; 3],
    /// Vertical field of view, degrees, 5 to 120.
    pub fov_deg: f32,
    /// Width, pixels, at most 1920.
    pub width: u32,
    /// Height, pixels, at most 1440.
    pub height: u32,
    /// Exposure, stops, −20 to 20.
    pub exposure_ev: f32,
    /// Overlay to show instead of radiance.
    pub show: Option<Overlay>,
    /// Whether the view is at rest: four rays per pixel instead of one.
    pub still: bool,
}

impl OutsideView {
    /// Validates the view.
    ///
    /// # Errors
    /// If a number is out of range, the direction is vertical, or eye and target coincide.
    pub fn check(&self, up: Vec3) -> Result<(), SessionError> {
        self.camera(up).map(|_| ())
    }

    /// Returns the camera at the origin and the rotation from its frame to the world.
    fn camera(&self, up: Vec3) -> Result<(Camera, Mat3), SessionError> {
        let range = |is_good: bool, what| if is_good { Ok(()) } else { Err(SessionError::OutOfRange(what)) };
        let near = |point: Vec3| point.is_finite() && point.abs().max_element() <= MAX_COORDINATE_M;
        let (eye_m, target_m) = (Vec3::from(self.eye_m), Vec3::from(self.target_m));
        range(near(eye_m) && near(target_m), "the view's position")?;
        range(FOVS_DEG.contains(&self.fov_deg), "the view's field of view")?;
        let [width, height] = [self.width, self.height];
        let fits = (1..=MAX_SIZE[0]).contains(&width) && (1..=MAX_SIZE[1]).contains(&height);
        range(fits, "the view's size")?;
        range(self.exposure_ev.abs() <= MAX_EXPOSURE_EV, "the view's exposure")?;
        let ahead = (target_m - eye_m).normalize_or_zero();
        let right = ahead.cross(up);
        range(right.length() > 1e-3, "the view's direction")?;
        let right = right.normalize();
        let focal = 0.5 * f64::from(height) / (0.5 * f64::from(self.fov_deg).to_radians()).tan();
        let camera = Camera::new(focal, focal, 0.5 * f64::from(width), 0.5 * f64::from(height), width, height);
        let camera = camera.map_err(|_| SessionError::OutOfRange("the view's field of view"))?;
        Ok((camera, Mat3::from_cols(right, right.cross(ahead), -ahead)))
    }
}

/// Renders a scene's room from outside: the octree's leaves with their radiance, and the objects.
///
/// Walls are single-sided and reduced to what is visible from inside, so the view opens into the room like a doll's
/// house. Inferred surfaces in front of observed ones are transparent. Objects show their base colour under a light at
/// the viewer, independent of the room's light.
pub struct OutsideRenderer {
    scenes: Arc<LitSceneCache>,
    room: Option<RoomMesh>,
}

/// Visible faces of an octree. Independent of light edits.
struct RoomMesh {
    octree: Octree,
    faces: PreparedModel,
    leaves: Vec<LeafNode>,
    depth_range_m: DepthRange,
}

impl OutsideRenderer {
    /// Creates a renderer for one scene.
    pub fn new(scenes: Arc<LitSceneCache>) -> Self {
        Self { scenes, room: None }
    }

    /// Renders the room with a state's objects and light. Returns `None` if `is_superseded` returns `true` on the way.
    ///
    /// # Errors
    /// Those of [`OutsideView::check`] and [`LitSceneCache::lit`].
    pub fn render(
        &mut self,
        state: &State,
        view: &OutsideView,
        is_superseded: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Image<[u8; 3]>>, SessionError> {
        let (camera, world_from_camera) = view.camera(self.scenes.scene().up())?;
        let scene = if view.still { self.scenes.lit(state)? } else { self.scenes.lit_draft(state)? };
        let room = match self.room.take() {
            Some(room) if room.octree == scene.light.octree => room,
            _ => RoomMesh::of(&scene, DepthRange::of(self.scenes.scene().surfaces.depth_m())),
        };
        let room = self.room.insert(room);
        let models = state.objects.iter().map(|object| object.mesh.prepared(object.material.as_ref()));
        let models: Vec<Arc<PreparedModel>> = models.collect::<Result<_, _>>()?;
        let placed = |(model, object): (_, &crate::Object)| -> PlacedModel<'_> {
            let prepared: &PreparedModel = model;
            PlacedModel { prepared, placement: object.placement.of_model(prepared.bounds()) }
        };
        let objects: Vec<PlacedModel> = models.iter().map(|model| &**model).zip(&state.objects).map(placed).collect();
        let eye_m = Vec3::from(view.eye_m);
        let caster = RayCaster {
            scene: &scene,
            faces: &room.faces,
            leaves: &room.leaves,
            depth_range_m: room.depth_range_m,
            objects: &objects,
            show: view.show,
            exposure_ev: view.exposure_ev,
            pitch: camera.pixel_angle_rad(),
        };
        let color = |u: f64, v: f64| {
            caster.color(&Ray { origin: eye_m, direction: (world_from_camera * camera.direction(u, v)).normalize() })
        };
        let (width, height) = (view.width as usize, view.height as usize);
        let row = |y: usize| {
            let pixel = |x: usize| {
                let at = |[du, dv]: [f64; 2]| color(x as f64 + du, y as f64 + dv);
                if view.still { mean(ROTATED_GRID.map(at)) } else { at([0.5; 2]) }
            };
            (!is_superseded()).then(|| (0..width).map(pixel).collect::<Vec<_>>())
        };
        let rows: Option<Vec<Vec<[u8; 3]>>> = (0..height).into_par_iter().map(row).collect();
        Ok(rows.map(|rows| Image::new(width, height, rows.concat())))
    }
}

/// Sample positions in a pixel, no two in one row or column.
const ROTATED_GRID: [[f64; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];

/// Averages sRGB codes instead of radiance, so that edges against clipped white stay smooth.
fn mean(colors: [[u8; 3]; 4]) -> [u8; 3] {
    std::array::from_fn(|c| (colors.iter().map(|color| u32::from(color[c])).sum::<u32>() as f32 / 4.0).round() as u8)
}

impl RoomMesh {
    fn of(scene: &LitScene, depth_range_m: DepthRange) -> Self {
        let all = RoomFaces::of(&scene.light);
        let faces = single_sided(&all.positions_m, &all.quads);
        let is_visible = visible_faces(&faces, &all.quads, &scene.frame.camera);
        let kept = || is_visible.iter().enumerate().filter(|(_, is_visible)| **is_visible).map(|(face, _)| face);
        let quads: Vec<[u32; 4]> = kept().map(|face| all.quads[face]).collect();
        let leaves = kept().map(|face| all.leaves[face]).collect();
        let faces = single_sided(&all.positions_m, &quads);
        Self { octree: scene.light.octree.clone(), faces, leaves, depth_range_m }
    }
}

/// Builds a single-sided model with two consecutive triangles per quad.
pub(crate) fn single_sided(positions_m: &[Vec3], quads: &[[u32; 4]]) -> PreparedModel {
    let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    PreparedModel::new(Model {
        positions: positions_m.to_vec(),
        triangle_materials: vec![0; triangles.len()],
        triangles,
        materials: vec![Material { double_sided: false, ..Material::default() }],
        ..Model::default()
    })
}
