use std::path::Path;

use lightoctree::geometry::Vec3;
use lightoctree::insert::{Ground, SeenSurfaces};
use lightoctree::lights::ListedLight;
use lightoctree::scene::Room;
use lightoctree::{Document, Estimate, FittedLight};
use serde::Serialize;

/// A scene, made ready for a session.
pub struct OpenScene {
    /// What the command line calls its file.
    pub file: String,
    /// As it was read or estimated.
    pub document: Document,
    /// To be lit.
    pub fitted: FittedLight,
    /// The surfaces that the photo sees.
    pub surfaces: SeenSurfaces,
    /// Depth of the farthest of them, metres.
    pub far_m: f32,
}

/// About where a room is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RoomExtent {
    /// Its middle, metres in the photo's frame.
    pub middle_m: [f32; 3],
    /// From there to its farthest corner, metres.
    pub radius_m: f32,
    /// Height of its floor over the camera, metres: below 0. Where no floor is known, of the lowest that the photo saw.
    pub floor_m: f32,
}

impl OpenScene {
    /// Makes a scene ready; takes some tenths of a second, most of it for the lamps.
    pub fn new(file: impl Into<String>, document: impl Into<Document>) -> Self {
        let document = document.into();
        let fitted = FittedLight::new(document.estimate.clone());
        let surfaces = SeenSurfaces::new(&document.estimate);
        let far_m = surfaces.depth_m().pixels().iter().fold(0.0f32, |far, &z| far.max(z));
        Self { file: file.into(), fitted, surfaces, far_m, document }
    }

    /// What was inferred of the room.
    pub fn estimate(&self) -> &Estimate {
        &self.document.estimate
    }

    /// Its lights, without changes.
    pub fn lights(&self) -> &[ListedLight] {
        self.fitted.lights()
    }

    /// What objects stand on.
    pub fn ground(&self) -> Ground<'_> {
        Ground::new(self.estimate(), &self.surfaces)
    }

    /// Unit vector against gravity.
    pub fn up(&self) -> Vec3 {
        self.estimate().up()
    }

    /// About where the room is: of what the photo saw and its camera, without the two hundredths that lie farthest out on each side.
    pub fn extent(&self) -> RoomExtent {
        let light = &self.estimate().light;
        let up = self.up();
        let level = Room { up, planes: Vec::new() }.level_from_camera();
        let mut sides: [Vec<f32>; 3] = std::array::from_fn(|_| Vec::new());
        for (depth, nodes) in light.octree.levels().iter().enumerate() {
            for ((&key, &row), &children) in nodes.keys.iter().zip(&nodes.rows).zip(&nodes.children) {
                if children < 0 && usize::try_from(row).is_ok_and(|row| light.seen[depth][row] >= 128) {
                    let place = level * light.node_middle_m(depth as u32, key);
                    sides.iter_mut().zip(place.to_array()).for_each(|(side, along)| side.push(along));
                }
            }
        }
        let [mut low, mut high] = [Vec3::ZERO; 2];
        for (axis, mut side) in sides.into_iter().enumerate() {
            side.sort_unstable_by(f32::total_cmp);
            let last = side.len().saturating_sub(1);
            low[axis] = side.get(last / 50).map_or(0.0, |along| along.min(0.0));
            high[axis] = side.get(last - last / 50).map_or(0.0, |along| along.max(0.0));
        }
        let floor = self.estimate().room.as_ref().and_then(Room::floor);
        RoomExtent {
            middle_m: (level.transpose() * (0.5 * (low + high))).to_array(),
            radius_m: (0.5 * (high - low).length()).max(0.5),
            floor_m: floor.map_or(low.y, |floor| floor.offset_m),
        }
    }

    /// The file's name without folders, for what is taken away.
    pub fn file_name(&self) -> String {
        Path::new(&self.file).file_name().map_or_else(|| self.file.clone(), |name| name.to_string_lossy().into_owned())
    }
}
