use std::sync::Arc;

use lo_insert::{Align, Ground, InsertError, Layout, LayoutObject, Path, PathSource, Placement};
use lo_scene::plain_name;
use serde::{Deserialize, Serialize};

use crate::key_times::{key_at, position_of};
use crate::object_position::ObjectPosition;
use crate::{Mesh, ObjectMaterial, SessionError};

/// Longest name of an object.
const MAX_NAME: usize = 100;

/// Size of an object.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum ObjectSize {
    /// Metres per unit of the mesh.
    Scale(f64),
    /// Height in metres.
    Height(f64),
}

/// One object of a [`State`](crate::State).
#[derive(Clone, Debug)]
pub struct Object {
    /// Unique id, never reused within a session.
    pub id: u32,
    /// Name, unique among the objects.
    pub name: String,
    /// The mesh.
    pub mesh: Arc<Mesh>,
    /// Position at the current time.
    pub position: ObjectPosition,
    /// The size.
    pub size: ObjectSize,
    /// Rotation about the up axis at the current time, degrees, counter-clockwise seen from above.
    pub yaw_deg: f64,
    /// Keyframes, if the object is animated.
    pub path: Option<Path>,
    /// Direction that the up axis is aligned with.
    pub align: Align,
    /// Material that replaces the mesh's own.
    pub material: Option<ObjectMaterial>,
    /// Whether images leave it out.
    pub is_hidden: bool,
    /// Whether front ends protect it from being moved by accident.
    pub is_locked: bool,
    /// The resulting placement in the scene.
    pub placement: Placement,
}

/// Compares meshes by identity.
impl PartialEq for Object {
    fn eq(&self, other: &Self) -> bool {
        let Self { id, name, mesh, position, size, yaw_deg, path, align, material, is_hidden, is_locked, placement } =
            self;
        Arc::ptr_eq(mesh, &other.mesh)
            && (id, name, position, size, yaw_deg)
                == (&other.id, &other.name, &other.position, &other.size, &other.yaw_deg)
            && (path, align) == (&other.path, &other.align)
            && (material, placement) == (&other.material, &other.placement)
            && (is_hidden, is_locked) == (&other.is_hidden, &other.is_locked)
    }
}

impl Object {
    /// Validates the object, rounds its numbers to what the command line expresses, and computes the placement at a
    /// time.
    ///
    /// # Errors
    /// If a number is out of range, or there is no surface at the pixel.
    pub fn placed<'a>(mut self, ground: impl Into<Ground<'a>>, time_s: f64) -> Result<Self, SessionError> {
        if let Some(material) = &self.material {
            material.check()?;
        }
        if !self.yaw_deg.is_finite() {
            return Err(SessionError::InvalidNumber {
                name: "the rotation",
                needed: "a finite angle",
                found: self.yaw_deg,
            });
        }
        self.name = plain_name(&self.name).chars().take(MAX_NAME).collect();
        if self.name.is_empty() {
            self.name = format!("object {}", self.id);
        }
        self.position = self.position.rounded();
        self.yaw_deg = f64::from(self.yaw_deg as f32);
        let ground = ground.into();
        self.placement = match self.placement_in(ground, time_s) {
            // At a wall's pixel it hangs in the air, as at any other position.
            Err(InsertError::Steep { position_m, .. }) if self.path.is_none() => {
                self.position = ObjectPosition::Position(position_m.to_array().map(f64::from)).rounded();
                self.placement_in(ground, time_s)?
            }
            placement => placement?,
        };
        self.placement.check()?;
        if let Some(path) = &self.path {
            (self.position, self.yaw_deg) = match key_at(path, time_s) {
                Some(key) => (position_of(key), key.yaw_deg),
                None => {
                    let position_m = self.placement.position_m.to_array().map(f64::from);
                    (ObjectPosition::Position(position_m), f64::from(self.placement.yaw_rad.to_degrees()))
                }
            };
        }
        Ok(self)
    }

    fn placement_in(&self, ground: Ground<'_>, time_s: f64) -> Result<Placement, InsertError> {
        let layout = Layout::new(vec![self.to_layout()])?;
        let placements =
            layout.placements_at(ground, &[self.mesh.plain()], &[time_s]).map_err(|error| match error {
                InsertError::Object { source, .. } => *source,
                error => error,
            })?;
        let first = placements.into_iter().flatten().next();
        first.ok_or_else(|| InsertError::Layout("the object has no position".into()))
    }

    /// Returns the object as `insert --layout` reads it.
    pub fn to_layout(&self) -> LayoutObject {
        let path = self.path.clone().map(PathSource::Keyframes);
        let (pixel, position_m) = match self.position {
            _ if path.is_some() => (None, None),
            ObjectPosition::Pixel(pixel) => (Some(pixel), None),
            ObjectPosition::Position(position_m) => (None, Some(position_m)),
        };
        let (scale, height_m) = match self.size {
            ObjectSize::Scale(scale) => (Some(scale), None),
            ObjectSize::Height(height_m) => (None, Some(height_m)),
        };
        LayoutObject {
            mesh: self.mesh.name().into(),
            name: Some(self.name.clone()),
            pixel,
            position_m,
            yaw_deg: (path.is_none() && self.yaw_deg != 0.0).then_some(self.yaw_deg),
            path,
            on: None,
            scale,
            unit: None,
            height_m,
            align: (self.align != Align::default()).then_some(self.align),
            animation: None,
            material: self.material.as_ref().map(ObjectMaterial::spec),
            hidden: self.is_hidden,
            locked: self.is_locked,
        }
    }
}
