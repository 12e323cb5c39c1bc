use std::path::Path;

use lightoctree::{Document, Estimate, FittedLight, KnownLength};
use lo_geometry::Vec3;
use lo_insert::{Ground, ObservedSurfaces};
use lo_lights::ListedLight;
use lo_scene::Room;
use serde::Serialize;

use crate::SessionError;

/// A scene prepared for a session.
pub struct OpenScene {
    /// Path of the scene file on the command line.
    pub file: String,
    /// Whether that file exists; otherwise the scene must be saved first.
    pub is_saved: bool,
    /// The document as read or estimated.
    pub document: Document,
    /// The fitted light, from which lit scenes are made.
    pub fitted: FittedLight,
    /// Surfaces that the photo shows.
    pub surfaces: ObservedSurfaces,
    /// Largest depth of these surfaces, metres.
    pub max_depth_m: f32,
    /// Factor by which the room is larger than in the file.
    pub scale: f32,
}

/// Approximate extent of a room.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RoomExtent {
    /// Centre, metres in the photo's frame.
    pub middle_m: [f32; 3],
    /// Distance from the centre to the farthest corner, metres.
    pub radius_m: f32,
    /// Height of the floor relative to the camera, metres, negative. Without a known floor, the lowest observed height.
    pub floor_m: f32,
}

impl OpenScene {
    /// Prepares a scene. Takes some tenths of a second, mostly for fitting lamps.
    pub fn new(file: impl Into<String>, document: impl Into<Document>) -> Self {
        let document = document.into();
        let fitted = FittedLight::new(document.estimate.clone());
        let surfaces = ObservedSurfaces::new(&document.estimate);
        let max_depth_m = surfaces.depth_m().pixels().iter().fold(0.0f32, |far, &z| far.max(z));
        Self { file: file.into(), is_saved: true, fitted, surfaces, max_depth_m, scale: 1.0, document }
    }

    /// Returns the scene with its room scaled to a known length.
    ///
    /// # Errors
    /// If no scale follows from the length.
    pub fn with_known_length(&self, known: &KnownLength) -> Result<Self, SessionError> {
        let factor = known.factor(self.estimate())?;
        let scaled = Self::new(self.file.clone(), self.document.scaled(factor)?);
        Ok(Self { is_saved: self.is_saved, scale: self.scale * factor, ..scaled })
    }

    /// Declares that the scene file does not exist yet.
    pub fn unsaved(self) -> Self {
        Self { is_saved: false, ..self }
    }

    /// Returns the estimate.
    pub fn estimate(&self) -> &Estimate {
        &self.document.estimate
    }

    /// Returns the scene's lights before edits.
    pub fn lights(&self) -> &[ListedLight] {
        self.fitted.lights()
    }

    /// Returns the ground that supports objects.
    pub fn ground(&self) -> Ground<'_> {
        Ground::new(self.estimate(), &self.surfaces)
    }

    /// Returns the unit vector against gravity.
    pub fn up(&self) -> Vec3 {
        self.estimate().up()
    }

    /// Computes the extent of the observed leaves and the camera, without the outermost 2 % on each side.
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

    /// Returns the file name without folders.
    pub fn file_name(&self) -> String {
        Path::new(&self.file).file_name().map_or_else(|| self.file.clone(), |name| name.to_string_lossy().into_owned())
    }
}
