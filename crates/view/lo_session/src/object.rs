use std::sync::Arc;

use lightoctree::insert::{Align, Ground, InsertError, Layout, LayoutObject, Path, PathSource, Placement};
use serde::{Deserialize, Serialize};

use crate::keyframes::{place_of, shown_key};
use crate::{Mesh, ObjectMaterial, SessionError};

/// Longest name of an object.
const MAX_NAME: usize = 100;

/// Where an object stands, as `insert` is told.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// On the surface seen at this photo position, pixel centres at +0.5.
    Pixel([f64; 2]),
    /// World position of the middle of its base, metres.
    Position([f64; 3]),
}

/// How large an object is.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Size {
    /// Metres per unit of its mesh.
    Scale(f64),
    /// Metres from its lowest to its highest point.
    Height(f64),
}

/// One object of a [`State`](crate::State).
#[derive(Clone, Debug)]
pub struct Object {
    /// Its number, which no other object of the session has or had.
    pub id: u32,
    /// What the user calls it.
    pub name: String,
    /// What it is made of.
    pub mesh: Arc<Mesh>,
    /// Where it stands at the time that is looked at.
    pub place: Place,
    /// How large it is.
    pub size: Size,
    /// Turn about its up at that time, counter-clockwise seen from above, degrees.
    pub yaw_deg: f64,
    /// Its keyframes, where it moves.
    pub path: Option<Path>,
    /// Which way is up for it.
    pub align: Align,
    /// Its material, where it is not the mesh's own.
    pub material: Option<ObjectMaterial>,
    /// What all that comes to in the scene.
    pub placement: Placement,
}

/// Two objects are the same where they are of the same mesh in memory.
impl PartialEq for Object {
    fn eq(&self, other: &Self) -> bool {
        let Self { id, name, mesh, place, size, yaw_deg, path, align, material, placement } = self;
        Arc::ptr_eq(mesh, &other.mesh)
            && (id, name, place, size, yaw_deg) == (&other.id, &other.name, &other.place, &other.size, &other.yaw_deg)
            && (path, align) == (&other.path, &other.align)
            && (material, placement) == (&other.material, &other.placement)
    }
}

impl Place {
    /// To a hundredth of a pixel, or a tenth of a millimetre in the precision of positions: what is short on the command line, and read from it as the same.
    pub(crate) fn rounded(self) -> Self {
        match self {
            Self::Pixel(pixel) => Self::Pixel(pixel.map(|x| (x * 100.0).round() / 100.0)),
            Self::Position(position) => Self::Position(position.map(|x| f64::from(((x * 1e4).round() / 1e4) as f32))),
        }
    }
}

impl Object {
    /// The same, checked, with numbers that the command line can say, and the placement that they come to in a scene at a time.
    ///
    /// # Errors
    /// Numbers out of range; a pixel without a surface.
    pub fn placed<'a>(mut self, ground: impl Into<Ground<'a>>, time_s: f64) -> Result<Self, SessionError> {
        if let Some(material) = &self.material {
            material.check()?;
        }
        if !self.yaw_deg.is_finite() {
            return Err(SessionError::Number { name: "the turn", needed: "a finite angle", found: self.yaw_deg });
        }
        self.name = self.name.chars().filter(|c| !c.is_control()).take(MAX_NAME).collect();
        self.place = self.place.rounded();
        self.yaw_deg = f64::from(self.yaw_deg as f32);
        self.placement = self.placement_in(ground.into(), time_s)?;
        self.placement.check()?;
        if let Some(path) = &self.path {
            (self.place, self.yaw_deg) = match shown_key(path, time_s) {
                Some(key) => (place_of(key), key.yaw_deg),
                None => {
                    let position_m = self.placement.position_m.to_array().map(f64::from);
                    (Place::Position(position_m), f64::from(self.placement.yaw_rad.to_degrees()))
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
        first.ok_or_else(|| InsertError::Layout("it has no place".into()))
    }

    /// As `insert --layout` reads it.
    pub fn to_layout(&self) -> LayoutObject {
        let path = self.path.clone().map(PathSource::Keyframes);
        let (pixel, position_m) = match self.place {
            _ if path.is_some() => (None, None),
            Place::Pixel(pixel) => (Some(pixel), None),
            Place::Position(position_m) => (None, Some(position_m)),
        };
        let (scale, height_m) = match self.size {
            Size::Scale(scale) => (Some(scale), None),
            Size::Height(height_m) => (None, Some(height_m)),
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
            height_m,
            align: (self.align != Align::default()).then_some(self.align),
            material: self.material.as_ref().map(ObjectMaterial::spec),
        }
    }
}
