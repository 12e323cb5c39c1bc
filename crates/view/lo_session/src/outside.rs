use std::sync::Arc;

use lightoctree::LitScene;
use lightoctree::export::RoomFaces;
use lightoctree::geometry::{Camera, Mat3, Ray, Vec3};
use lightoctree::imaging::{self, Image, ToneCurve};
use lightoctree::mesh::{Hit, Material, Model, PlacedModel, PreparedModel};
use lightoctree::octree::{LeafNode, Octree};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::lit::LitScenes;
use crate::overlay::{DepthRange, level_color, normal_color, origin_color, origin_of_leaf};
use crate::visible::visible;
use crate::{Overlay, SessionError, State};

/// Largest picture, pixels.
const MAX_SIZE: [u32; 2] = [1920, 1440];

/// Farthest places of a viewer, metres.
const MAX_PLACE_M: f32 = 1000.0;

/// Vertical fields of view.
const FOVS_DEG: std::ops::RangeInclusive<f32> = 5.0..=120.0;

/// Most stops by which a picture is brightened or darkened.
const MAX_EXPOSURE_EV: f32 = 20.0;

/// What is shown where there is nothing: the grey around the page's pictures.
const GROUND: [u8; 3] = [48; 3];

/// Of flat colours, how bright faces across each axis of the octree are: so that corners show.
const FLAT_SHADES: [f32; 3] = [0.84, 1.0, 0.7];

/// Radiance of a white surface of an object that faces the viewer, and how much of that is left of one that faces away.
const OBJECT_WHITE: f32 = 0.7;
const OBJECT_AMBIENT: f32 = 0.3;

/// A view of the room from wherever the viewer is.
///
/// The camera is a pinhole with square pixels at `eye_m`: its axis goes through `target_m` and the middle of the picture, and against gravity is up. In
/// its frame (x = ahead × up, y = up, z = −ahead) a point is seen where [`Camera::project`] says, with a focal length of
/// `height / (2 tan(fov / 2))` pixels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutsideView {
    /// Where the viewer is, metres in the photo's frame.
    pub eye_m: [f32; 3],
    /// Where the viewer looks.
    pub target_m: [f32; 3],
    /// Vertical field of view, degrees, 5 to 120.
    pub fov_deg: f32,
    /// Width, pixels, at most 1920.
    pub width: u32,
    /// Height, pixels, at most 1440.
    pub height: u32,
    /// Stops by which radiance is brightened, within ± 20.
    pub exposure_ev: f32,
    /// What colours mean; radiance where it is none.
    pub show: Option<Overlay>,
    /// Whether nothing moves: four rays a pixel instead of one.
    pub still: bool,
}

impl OutsideView {
    /// # Errors
    /// Numbers out of range; a viewer that looks along gravity, or nowhere.
    pub fn check(&self, up: Vec3) -> Result<(), SessionError> {
        self.camera(up).map(|_| ())
    }

    /// The camera at the origin, and what turns its frame to the world's.
    fn camera(&self, up: Vec3) -> Result<(Camera, Mat3), SessionError> {
        let range = |is_good: bool, what| if is_good { Ok(()) } else { Err(SessionError::Range(what)) };
        let near = |place: Vec3| place.is_finite() && place.abs().max_element() <= MAX_PLACE_M;
        let (eye_m, target_m) = (Vec3::from(self.eye_m), Vec3::from(self.target_m));
        range(near(eye_m) && near(target_m), "the view's place")?;
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
        let camera = camera.map_err(|_| SessionError::Range("the view's field of view"))?;
        Ok((camera, Mat3::from_cols(right, right.cross(ahead), -ahead)))
    }
}

/// Draws the rooms of one scene's states from outside: the leaves of the octree with their radiance, one ray a pixel, and the objects.
///
/// Walls are seen from the room's side alone, and of that side what somebody in the room sees: one looks into the room as into a doll's house. Objects have the base colour of their material under a
/// light at the viewer, whatever lights the room: how the room lights them, the photo shows.
pub struct Outside {
    scenes: Arc<LitScenes>,
    room: Option<Room>,
}

/// The faces of one octree, which edits of the light leave as they are.
struct Room {
    octree: Octree,
    faces: PreparedModel,
    leaves: Vec<LeafNode>,
    depth_range_m: DepthRange,
}

impl Outside {
    /// For one scene.
    pub fn new(scenes: Arc<LitScenes>) -> Self {
        Self { scenes, room: None }
    }

    /// A picture of the room with a state's objects and light; `None` where `is_passed` says on the way that nobody wants it any more.
    ///
    /// # Errors
    /// Those of [`OutsideView::check`]; edits that do not fit the scene.
    pub fn picture(
        &mut self,
        state: &State,
        view: &OutsideView,
        is_passed: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Image<[u8; 3]>>, SessionError> {
        let (camera, world_from_camera) = view.camera(self.scenes.open().up())?;
        let scene = if view.still { self.scenes.of(state)? } else { self.scenes.draft_of(state)? };
        let room = match self.room.take() {
            Some(room) if room.octree == scene.light.octree => room,
            _ => Room::of(&scene, DepthRange::of(self.scenes.open().surfaces.depth_m())),
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
        let seen = Seen { scene: &scene, room, objects: &objects, view, pitch: camera.pixel_angle_rad() };
        let color = |u: f64, v: f64| {
            seen.color(&Ray { origin: eye_m, direction: (world_from_camera * camera.direction(u, v)).normalize() })
        };
        let (width, height) = (view.width as usize, view.height as usize);
        let row = |y: usize| {
            let pixel = |x: usize| {
                let at = |[du, dv]: [f64; 2]| color(x as f64 + du, y as f64 + dv);
                if view.still { mean(ROTATED_GRID.map(at)) } else { at([0.5; 2]) }
            };
            (!is_passed()).then(|| (0..width).map(pixel).collect::<Vec<_>>())
        };
        let rows: Option<Vec<Vec<[u8; 3]>>> = (0..height).into_par_iter().map(row).collect();
        Ok(rows.map(|rows| Image::new(width, height, rows.concat())))
    }
}

/// Places in a pixel, no two in one row or column.
const ROTATED_GRID: [[f64; 2]; 4] = [[0.375, 0.125], [0.875, 0.375], [0.125, 0.625], [0.625, 0.875]];

/// The mean of codes: of colours as a screen shows them, so that edges against white are smooth, too.
fn mean(colors: [[u8; 3]; 4]) -> [u8; 3] {
    std::array::from_fn(|c| (colors.iter().map(|color| u32::from(color[c])).sum::<u32>() as f32 / 4.0).round() as u8)
}

impl Room {
    fn of(scene: &LitScene, depth_range_m: DepthRange) -> Self {
        let all = RoomFaces::of(&scene.light);
        let faces = single_sided(&all.positions_m, &all.quads);
        let is_visible = visible(&faces, &all.quads, &scene.frame.camera);
        let kept = || is_visible.iter().enumerate().filter(|(_, is_visible)| **is_visible).map(|(face, _)| face);
        let quads: Vec<[u32; 4]> = kept().map(|face| all.quads[face]).collect();
        let leaves = kept().map(|face| all.leaves[face]).collect();
        let faces = single_sided(&all.positions_m, &quads);
        Self { octree: scene.light.octree.clone(), faces, leaves, depth_range_m }
    }
}

/// Two triangles for each quad, one after the other, seen from one side.
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

/// What rays are sent into.
struct Seen<'a> {
    scene: &'a LitScene,
    room: &'a Room,
    objects: &'a [PlacedModel<'a>],
    view: &'a OutsideView,
    /// Metres between the rays of neighbouring pixels at one metre.
    pitch: f32,
}

impl Seen<'_> {
    fn color(&self, ray: &Ray) -> [u8; 3] {
        let face = self.room.faces.intersect(ray, f32::INFINITY);
        // An object stands on the surface that a leaf is of, somewhere in the leaf: not below it.
        let depth = |hit: Hit| self.room.leaves[hit.triangle as usize / 2].depth;
        let leaf_end_m = |hit: Hit| hit.distance_m + self.scene.light.cube.node_edge_m(depth(hit));
        let mut nearest_m = face.map_or(f32::INFINITY, leaf_end_m);
        let mut object = None;
        for placed in self.objects {
            if let Some(hit) = placed.intersect(ray, nearest_m) {
                nearest_m = hit.distance_m;
                object = Some((placed, hit));
            }
        }
        match (object, face) {
            (Some((placed, hit)), _) => {
                let surface = placed.surface(&hit, ray.direction, self.pitch * hit.distance_m);
                match self.view.show {
                    Some(Overlay::Normals) => normal_color(surface.shading_normal),
                    Some(Overlay::Depth) => self.depth_color(ray, hit.distance_m),
                    _ => {
                        let facing = surface.shading_normal.dot(-ray.direction).max(0.0);
                        let light = OBJECT_WHITE * (OBJECT_AMBIENT + (1.0 - OBJECT_AMBIENT) * facing);
                        let lit = Vec3::from(surface.base_color) * light + Vec3::from(surface.emissive);
                        self.developed(lit.to_array())
                    }
                }
            }
            (None, Some(hit)) => {
                let LeafNode { depth, row, .. } = self.room.leaves[hit.triangle as usize / 2];
                match self.view.show {
                    None => {
                        let [r, g, b, _] = self.scene.light.rgba[depth as usize][row];
                        self.developed([r, g, b])
                    }
                    Some(Overlay::Normals) => normal_color(self.normal(hit.triangle)),
                    Some(Overlay::Depth) => self.depth_color(ray, hit.distance_m),
                    Some(Overlay::Levels) => self.flat(level_color(depth), hit.triangle),
                    Some(Overlay::Origins) => {
                        self.flat(origin_color(origin_of_leaf(self.scene, depth, row)), hit.triangle)
                    }
                }
            }
            (None, None) => GROUND,
        }
    }

    fn developed(&self, radiance: [f32; 3]) -> [u8; 3] {
        let gain = self.view.exposure_ev.exp2();
        ToneCurve::Clip.apply(radiance.map(|value| value * gain)).map(imaging::srgb8_from_linear)
    }

    fn depth_color(&self, ray: &Ray, distance_m: f32) -> [u8; 3] {
        self.room.depth_range_m.color(-ray.at(distance_m).z)
    }

    fn normal(&self, triangle: u32) -> Vec3 {
        let model = self.room.faces.model();
        let [a, b, c] = model.triangles[triangle as usize].map(|corner| model.positions[corner as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    }

    fn flat(&self, color: [u8; 3], triangle: u32) -> [u8; 3] {
        let normal = self.normal(triangle).abs();
        let shade = normal.dot(Vec3::from(FLAT_SHADES));
        color.map(|code| (f32::from(code) * shade) as u8)
    }
}
