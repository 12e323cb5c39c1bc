//! Objects in the scene's file, and back.

use std::collections::BTreeMap;
use std::sync::Arc;

use lightoctree::insert::{Ground, LayoutObject, PathSource, Placement};
use lightoctree::scene::{ObjectsShown, SceneObjects};
use lightoctree::scene_layout;

use crate::{Mesh, Object, ObjectMaterial, Place, SessionError, Size, State};

/// Meshes by name.
type Meshes = BTreeMap<String, Arc<Mesh>>;

impl State {
    /// What a scene's file holds of it beside the light.
    ///
    /// # Errors
    /// None that a state of a session could cause.
    pub fn to_scene_objects(&self) -> Result<SceneObjects, SessionError> {
        let layout = if self.objects.is_empty() { String::new() } else { serde_json::to_string(&self.layout()?)? };
        let files = self.objects.iter().flat_map(|object| object.mesh.files());
        Ok(SceneObjects {
            layout,
            files: files.map(|(name, bytes)| (name.clone(), bytes.clone())).collect(),
            shown: self.shown(),
        })
    }

    /// As a scene's file left it, and the meshes of its objects, whose numbers are 1, 2, ….
    ///
    /// # Errors
    /// Where an object cannot stand there, or is told in a way that a session does not know.
    pub fn of_scene<'a>(ground: impl Into<Ground<'a>>) -> Result<(Self, Meshes), SessionError> {
        let ground = ground.into();
        let scene = ground.scene;
        let ObjectsShown { floor_gloss, frames, fps, time_s } = scene.objects.shown;
        let lights = scene.light_edits.clone();
        let mut state = Self { objects: Vec::new(), lights, floor_gloss, frames, fps, time_s };
        let mut meshes = Meshes::new();
        let Some(layout) = scene_layout(scene)? else { return Ok((state, meshes)) };
        for (object, id) in layout.objects().iter().zip(1..) {
            let name = object.mesh.to_string_lossy().into_owned();
            let mesh = match meshes.get(&name) {
                Some(mesh) => mesh.clone(),
                None => Arc::new(Mesh::of_scene(scene, &name)?),
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
    let foreign = |what| SessionError::Foreign { object: from.name().to_owned(), what };
    let path = match &from.path {
        Some(PathSource::Keyframes(path)) => Some(path.clone()),
        Some(PathSource::File(_)) => return Err(foreign("a \"path\" in a file")),
        None => None,
    };
    let place = match (from.pixel, from.position_m) {
        _ if from.on.is_some() => return Err(foreign("\"on\"")),
        _ if path.is_some() => Place::Position(Default::default()),
        (Some(pixel), _) => Place::Pixel(pixel),
        (None, Some(position_m)) => Place::Position(position_m),
        (None, None) => return Err(foreign("no place")),
    };
    let size = match (from.scale, from.height_m) {
        (_, Some(height_m)) => Size::Height(height_m),
        (scale, None) => Size::Scale(scale.unwrap_or(1.0)),
    };
    let material = from.material.as_ref();
    let material =
        material.map(|spec| ObjectMaterial::of_spec(spec).ok_or_else(|| foreign("a \"material\""))).transpose()?;
    let align = from.align.unwrap_or_default();
    let object = Object {
        id,
        name: from.name().to_owned(),
        mesh,
        place,
        size,
        yaw_deg: from.yaw_deg.unwrap_or(0.0),
        path,
        align,
        material,
        placement: Placement::at(ground.scene, Default::default(), align),
    };
    object.placed(ground, time_s)
}
