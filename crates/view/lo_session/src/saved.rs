//! Conversion between session states and documents.

use std::collections::BTreeMap;
use std::sync::Arc;

use lightoctree::Document;
use lo_insert::{Ground, LayoutObject, PathSource, Placement};
use lo_scene::ObjectDisplay;

use crate::{Mesh, Object, ObjectMaterial, ObjectPosition, ObjectSize, SessionError, State};

/// Meshes by name.
type Meshes = BTreeMap<String, Arc<Mesh>>;

impl State {
    /// Returns a document with this state's edits and objects.
    ///
    /// # Errors
    /// Never for a state of a session.
    pub fn to_document(&self, of: &Document) -> Result<Document, SessionError> {
        let layout = if self.objects.is_empty() { None } else { Some(self.layout()?) };
        let meshes = self.objects.iter().flat_map(|object| object.mesh.files());
        Ok(Document {
            estimate: of.estimate.clone(),
            light_edits: self.lights.clone(),
            layout,
            meshes: meshes.map(|(name, bytes)| (name.clone(), bytes.clone())).collect(),
            shown: self.shown(),
        })
    }

    /// Restores the state of a document and the meshes of its objects. Object ids are 1, 2, ….
    ///
    /// # Errors
    /// If an object cannot be placed, or uses a feature that a session does not support.
    pub fn from_document(document: &Document, ground: Ground<'_>) -> Result<(Self, Meshes), SessionError> {
        let ObjectDisplay { floor_gloss, frames, fps, time_s } = document.shown;
        let lights = document.light_edits.clone();
        let objects = Vec::new();
        let mut state = Self { objects, lights, floor_gloss, frames, fps, time_s, known_length: None };
        let mut meshes = Meshes::new();
        let Some(layout) = &document.layout else { return Ok((state, meshes)) };
        for (object, id) in layout.objects().iter().zip(1..) {
            let name = object.mesh.to_string_lossy().into_owned();
            let mesh = match meshes.get(&name) {
                Some(mesh) => mesh.clone(),
                None => Arc::new(Mesh::from_document(document, &name)?),
            };
            meshes.insert(name, mesh.clone());
            state.objects.push(placed(ground, id, object, mesh, time_s)?);
        }
        Ok((state, meshes))
    }
}

fn placed(
    ground: Ground<'_>,
    id: u32,
    from: &LayoutObject,
    mesh: Arc<Mesh>,
    time_s: f64,
) -> Result<Object, SessionError> {
    let unsupported = |what| SessionError::Unsupported { object: from.name().to_owned(), what };
    let path = match &from.path {
        Some(PathSource::Keyframes(path)) => Some(path.clone()),
        Some(PathSource::File(_)) => return Err(unsupported("a \"path\" in a file")),
        None => None,
    };
    let position = match (from.pixel, from.position_m) {
        _ if from.on.is_some() => return Err(unsupported("\"on\"")),
        _ if path.is_some() => ObjectPosition::Position(Default::default()),
        (Some(pixel), _) => ObjectPosition::Pixel(pixel),
        (None, Some(position_m)) => ObjectPosition::Position(position_m),
        (None, None) => return Err(unsupported("no position")),
    };
    let size = from.height_m.map_or(ObjectSize::Scale(from.metres_per_unit()), ObjectSize::Height);
    let material = from.material.as_ref();
    let material = material
        .map(|spec| ObjectMaterial::from_spec(spec).ok_or_else(|| unsupported("a \"material\"")))
        .transpose()?;
    let align = from.align.unwrap_or_default();
    let object = Object {
        id,
        name: from.name().to_owned(),
        mesh,
        position,
        size,
        yaw_deg: from.yaw_deg.unwrap_or(0.0),
        path,
        align,
        material,
        is_hidden: from.hidden,
        is_locked: from.locked,
        placement: Placement::at(ground.estimate, Default::default(), align),
    };
    object.placed(ground, time_s)
}
