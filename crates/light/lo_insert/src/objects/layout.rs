use std::collections::HashSet;
use std::io;
use std::path::{Path as FilePath, PathBuf};

use lo_geometry::Vec3;
use lo_mesh::{MaterialSpec, PreparedModel};
use lo_scene::Estimate;
use serde::{Deserialize, Deserializer, Serialize, de};
use serde_json::Value;

use crate::objects::path::frame_times_s;
use crate::objects::ranges;
use crate::{Align, Anchor, Base, Ground, InsertError, Instance, Path, PathPlacement, Placement, Unit};

/// Objects that are inserted together, read from JSON.
///
/// ```json
/// {"objects": [
///     {"mesh": "table.glb", "pixel": [960, 1150], "height_m": 0.45, "material": "matte-white"},
///     {"mesh": "vase.obj", "name": "vase", "on": "table", "material": {"preset": "gold", "roughness": 0.3}},
///     {"mesh": "car.glb",
///      "path": {"keyframes": [{"time_s": 0, "pixel": [500, 1200]}, {"time_s": 2, "pixel": [800, 1250]}]}}
/// ]}
/// ```
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Layout {
    /// The objects; their names are unique.
    objects: Vec<LayoutObject>,
}

/// One object of a [`Layout`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LayoutObject {
    /// File of the model: glTF, GLB, OBJ, PLY or STL.
    pub mesh: PathBuf,
    /// Name in messages and for other objects; by default the file name without extension.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Photo position whose surface it rests on, pixel centres at +0.5.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pixel: Option<[f64; 2]>,
    /// World position of the centre of its base, in metres.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub position_m: Option<[f64; 3]>,
    /// Keyframes of its path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<PathSource>,
    /// Name of a preceding object that carries it: at `pixel`, below `position_m`, or at the centre of its top.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub on: Option<String>,
    /// Metres per unit of the model; default 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<f64>,
    /// Unit of the model's coordinates, instead of a scale; metres by default.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<Unit>,
    /// Height in metres, instead of a scale.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub height_m: Option<f64>,
    /// Rotation about its up, counter-clockwise seen from above, in degrees; default 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub yaw_deg: Option<f64>,
    /// Alignment of its up; default against gravity.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub align: Option<Align>,
    /// Name of the mesh's animation that plays in a sequence; at rest without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub animation: Option<String>,
    /// Material of the whole object: a name, or an object of [`MaterialSpec`]'s fields.
    #[serde(deserialize_with = "material", skip_serializing_if = "Option::is_none")]
    pub material: Option<MaterialSpec>,
    /// Whether images leave it out, with what it carries.
    #[serde(skip_serializing_if = "is_no")]
    pub hidden: bool,
    /// Whether editors protect it from being moved by accident.
    #[serde(skip_serializing_if = "is_no")]
    pub locked: bool,
}

/// Keyframes, or the file that contains them.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum PathSource {
    /// Name of the file.
    File(PathBuf),
    /// The keyframes.
    Keyframes(Path),
}

impl Layout {
    /// Largest number of objects of a layout.
    pub const MAX_OBJECTS: usize = 100;

    /// Validates the objects, and names those without a name.
    ///
    /// # Errors
    /// If an object has no position or several, two sizes, a number out of range, a duplicate name, or a carrier that
    /// does not precede it.
    pub fn new(mut objects: Vec<LayoutObject>) -> Result<Self, InsertError> {
        if objects.is_empty() || objects.len() > Self::MAX_OBJECTS {
            let found = objects.len();
            return Err(InsertError::Layout(format!("needs 1 to {} objects, has {found}", Self::MAX_OBJECTS)));
        }
        let mut names: HashSet<String> = HashSet::new();
        for name in objects.iter().filter_map(|object| object.name.as_ref()) {
            if !names.insert(name.clone()) {
                return Err(InsertError::Layout(format!("two objects are named `{name}`")));
            }
        }
        for i in 0..objects.len() {
            let (before, rest) = objects.split_at_mut(i);
            let object = &mut rest[0];
            let name = object.name.take().unwrap_or_else(|| free_name(&object.mesh, &names));
            names.insert(name.clone());
            object.name = Some(name);
            let carriers: Vec<&str> = before.iter().map(LayoutObject::name).collect();
            object
                .check(&carriers)
                .map_err(|wrong| InsertError::Layout(format!("object {} ({}): {wrong}", i + 1, object.name())))?;
        }
        Ok(Self { objects })
    }

    /// Parses and validates a layout: a list of objects, or an object with such a list as `objects`.
    ///
    /// # Errors
    /// If the JSON is invalid, and all errors of [`Layout::new`].
    pub fn from_json(text: &str) -> Result<Self, InsertError> {
        let wrong = |error: serde_json::Error| InsertError::Layout(error.to_string());
        let list = match serde_json::from_str(text).map_err(wrong)? {
            Value::Array(list) => list,
            Value::Object(mut fields) if fields.len() == 1 && fields.contains_key("objects") => {
                let Some(Value::Array(list)) = fields.remove("objects") else {
                    return Err(InsertError::Layout("`objects` is not a list".into()));
                };
                list
            }
            Value::Object(fields) => {
                let unknown = fields.keys().find(|key| *key != "objects");
                let found = unknown.map_or_else(|| "has none".into(), |key| format!("has `{key}`"));
                return Err(InsertError::Layout(format!("needs only `objects`, a list of objects; {found}")));
            }
            _ => return Err(InsertError::Layout("is not a list of objects".into())),
        };
        let object = |(i, value): (usize, Value)| {
            let name = value.get("name").or_else(|| value.get("mesh")).and_then(Value::as_str);
            let called = name.map_or_else(|| format!("object {}", i + 1), |name| format!("object {} ({name})", i + 1));
            serde_json::from_value(value).map_err(|error| InsertError::Layout(format!("{called}: {error}")))
        };
        Self::new(list.into_iter().enumerate().map(object).collect::<Result<_, _>>()?)
    }

    /// Returns the layout as JSON, as read by [`Layout::from_json`].
    ///
    /// # Errors
    /// Only if a file name is not UTF-8.
    pub fn to_json(&self) -> Result<String, InsertError> {
        serde_json::to_string(self).map_err(|error| InsertError::Layout(error.to_string()))
    }

    /// Replaces path files by their keyframes, read with `read`.
    ///
    /// # Errors
    /// If a file cannot be read, or its keyframes are invalid.
    pub fn with_paths(mut self, mut read: impl FnMut(&FilePath) -> io::Result<String>) -> Result<Self, InsertError> {
        for object in &mut self.objects {
            let Some(PathSource::File(file)) = &object.path else { continue };
            let wrong =
                |error: String| InsertError::Layout(format!("path of {}, {}: {error}", object.name(), file.display()));
            let text = read(file).map_err(|error| wrong(error.to_string()))?;
            let path = Path::from_json(&text).map_err(|error| wrong(error.to_string()))?;
            object.path = Some(PathSource::Keyframes(path));
        }
        Ok(self)
    }

    /// Returns the layout without hidden objects and what they carry; `None` if nothing is left.
    pub fn without_hidden(self) -> Option<Self> {
        let mut hidden: HashSet<String> = HashSet::new();
        let mut objects = Vec::with_capacity(self.objects.len());
        for object in self.objects {
            if object.hidden || object.on.as_ref().is_some_and(|on| hidden.contains(on)) {
                hidden.insert(object.name().to_owned());
            } else {
                objects.push(object);
            }
        }
        (!objects.is_empty()).then_some(Self { objects })
    }

    /// Returns the layout in a room that is scaled about the camera: positions are scaled, sizes stay.
    ///
    /// # Errors
    /// If a position is out of range then.
    pub fn in_scaled_room(&self, factor: f64) -> Result<Self, InsertError> {
        let scaled = |position_m: &mut Option<[f64; 3]>| {
            // Positions are given in single precision.
            *position_m = position_m.map(|position_m| position_m.map(|x| f64::from((x * factor) as f32)));
        };
        let mut objects = self.objects.clone();
        for object in &mut objects {
            scaled(&mut object.position_m);
            if let Some(PathSource::Keyframes(path)) = &mut object.path {
                path.keyframes.iter_mut().for_each(|key| scaled(&mut key.position_m));
            }
        }
        Self::new(objects)
    }

    /// Returns the objects.
    pub fn objects(&self) -> &[LayoutObject] {
        &self.objects
    }

    /// Returns whether any object moves.
    pub fn moves(&self) -> bool {
        self.objects.iter().any(|object| object.path.is_some() || object.animation.is_some())
    }

    /// Returns the times of the first and the last keyframe of all paths, in seconds; `None` if nothing moves.
    ///
    /// # Errors
    /// If the keyframes of a file were not read ([`Layout::with_paths`]).
    pub fn span_s(&self) -> Result<Option<[f64; 2]>, InsertError> {
        let mut span_s: Option<[f64; 2]> = None;
        for (i, object) in self.objects.iter().enumerate() {
            if let Some(path) = object.keyframes().map_err(|error| error.of(i))? {
                let [first, last] = path.span_s().map_err(|error| error.of(i))?;
                let [begun, ended] = span_s.unwrap_or([first, last]);
                span_s = Some([begun.min(first), ended.max(last)]);
            }
        }
        Ok(span_s)
    }

    /// Returns the placements of each object in `frames` frames, at equal time steps from the first keyframe of all
    /// paths to the last.
    ///
    /// `models` has one model per object.
    ///
    /// # Errors
    /// [`InsertError::Object`] if there is no surface at a pixel, or the carrier is not below; an error if the
    /// keyframes of a file were not read ([`Layout::with_paths`]).
    pub fn placements<'a>(
        &self,
        ground: impl Into<Ground<'a>>,
        models: &[&PreparedModel],
        frames: usize,
    ) -> Result<Vec<Vec<Placement>>, InsertError> {
        let times_s = self.span_s()?.map_or_else(|| vec![0.0; frames], |span_s| frame_times_s(span_s, frames));
        self.placements_at(ground, models, &times_s)
    }

    /// Returns the placements of each object at given times, in seconds. An object on a carrier is placed at the
    /// first time.
    ///
    /// # Errors
    /// As for [`Layout::placements`].
    pub fn placements_at<'a>(
        &self,
        ground: impl Into<Ground<'a>>,
        models: &[&PreparedModel],
        times_s: &[f64],
    ) -> Result<Vec<Vec<Placement>>, InsertError> {
        let ground = ground.into();
        let mut placements: Vec<Vec<Placement>> = Vec::with_capacity(self.objects.len());
        for (i, (object, model)) in self.objects.iter().zip(models).enumerate() {
            let carrier = object.on.as_deref().and_then(|on| self.objects[..i].iter().position(|o| o.name() == on));
            let placed = match carrier {
                Some(carrier) => {
                    object.placements_on_carrier(ground.estimate, model, models[carrier], &placements[carrier])
                }
                None => object.placements(ground, model, times_s),
            };
            placements.push(placed.map_err(|error| error.of(i))?);
        }
        Ok(placements)
    }
}

impl LayoutObject {
    /// Returns its name in a [`Layout`].
    pub fn name(&self) -> &str {
        self.name.as_deref().unwrap_or_default()
    }

    fn check(&self, carriers: &[&str]) -> Result<(), String> {
        if self.mesh.as_os_str().is_empty() {
            return Err("needs a \"mesh\"".into());
        }
        let places = [self.pixel.is_some(), self.position_m.is_some(), self.path.is_some()];
        let places = places.into_iter().filter(|&given| given).count();
        match &self.on {
            None if places != 1 => {
                return Err("needs exactly one of \"pixel\", \"position_m\", \"path\" or \"on\"".into());
            }
            Some(_) if places > 1 || self.path.is_some() => {
                return Err("with \"on\", only one of \"pixel\" and \"position_m\" is allowed, and no \"path\"".into());
            }
            Some(on) if !carriers.contains(&on.as_str()) => {
                return Err(format!("no object before it is named `{on}`, which it is \"on\""));
            }
            Some(_) if self.align.is_some() => {
                return Err("\"align\" is not allowed with \"on\": the alignment is that of the carrier".into());
            }
            _ => {}
        }
        if self.path.is_some() && self.yaw_deg.is_some() {
            return Err("\"yaw_deg\" is not allowed with \"path\": set it in the keyframes".into());
        }
        let sizes =
            [("scale", self.scale.is_some()), ("height_m", self.height_m.is_some()), ("unit", self.unit.is_some())];
        let given: Vec<&str> = sizes.into_iter().filter(|&(_, given)| given).map(|(name, _)| name).collect();
        if let [first, second, ..] = given[..] {
            return Err(format!("\"{first}\" and \"{second}\" cannot both be given"));
        }
        ranges::PIXEL.check(self.pixel.iter().flatten())?;
        ranges::POSITION_M.check(self.position_m.iter().flatten())?;
        ranges::YAW_DEG.check(&self.yaw_deg)?;
        ranges::SCALE.check(&self.scale)?;
        ranges::HEIGHT_M.check(&self.height_m)?;
        if let Some(PathSource::Keyframes(path)) = &self.path {
            path.check().map_err(|error| error.to_string())?;
        }
        Ok(())
    }

    fn keyframes(&self) -> Result<Option<&Path>, InsertError> {
        match &self.path {
            None => Ok(None),
            Some(PathSource::Keyframes(path)) => Ok(Some(path)),
            Some(PathSource::File(file)) => Err(InsertError::Path(format!("{} was not read", file.display()))),
        }
    }

    /// Returns the metres per unit of the model by its scale or unit, without regard to its height.
    pub fn metres_per_unit(&self) -> f64 {
        self.scale.or(self.unit.map(Unit::metres)).unwrap_or(1.0)
    }

    /// Returns the scale in metres per unit of the model.
    fn scale_of(&self, model: &PreparedModel) -> Result<f32, InsertError> {
        let Some(height_m) = self.height_m else { return Ok(self.metres_per_unit() as f32) };
        let height = model.bounds().size().y;
        if height > 0.0 { Ok(height_m as f32 / height) } else { Err(InsertError::Flat) }
    }

    fn yaw_rad(&self) -> f32 {
        (self.yaw_deg.unwrap_or(0.0) as f32).to_radians()
    }

    /// Returns the placements of an object on real surfaces or in the air.
    fn placements(
        &self,
        ground: Ground<'_>,
        model: &PreparedModel,
        times_s: &[f64],
    ) -> Result<Vec<Placement>, InsertError> {
        let (scale, align, base) = (self.scale_of(model)?, self.align.unwrap_or_default(), Base::new(model));
        if let Some(path) = self.keyframes()? {
            return path.placements_at(ground, &PathPlacement { scale, align, base: Some(&base) }, times_s);
        }
        let placed = |placement: Placement| placement.scaled(scale).turned(self.yaw_rad());
        let placement = match (self.position_m, self.pixel) {
            (Some(position_m), _) => placed(Placement::at(ground.estimate, point(position_m), align)),
            (None, Some([u, v])) => placed(Placement::stand_on_pixel(ground, u, v, align)?).settled(ground, &base),
            (None, None) => return Err(InsertError::Layout("it has no position".into())),
        };
        Ok(vec![placement; times_s.len()])
    }

    /// Returns the placements of an object that moves with its carrier.
    fn placements_on_carrier(
        &self,
        scene: &Estimate,
        model: &PreparedModel,
        carrier: &PreparedModel,
        places: &[Placement],
    ) -> Result<Vec<Placement>, InsertError> {
        let Some(&first) = places.first() else { return Ok(Vec::new()) };
        let anchor = match (self.position_m, self.pixel) {
            (Some(position_m), _) => Anchor::Below(point(position_m)),
            (None, Some([u, v])) => Anchor::Pixel(u, v),
            (None, None) => Anchor::Middle,
        };
        let placed = first.scaled(self.scale_of(model)?).turned(self.yaw_rad()).on_object(
            &Instance::new(carrier, first),
            anchor,
            &Base::new(model),
            &scene.frame.camera,
        )?;
        Ok(places.iter().map(|place| placed.moved_with_carrier(&first, place)).collect())
    }
}

impl<'de> Deserialize<'de> for PathSource {
    /// Reads a file name or keyframes.
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        match Value::deserialize(deserializer)? {
            Value::String(file) => Ok(Self::File(file.into())),
            value => {
                let path: Path =
                    serde_json::from_value(value).map_err(|error| de::Error::custom(format!("path: {error}")))?;
                path.span_s().map_err(de::Error::custom)?;
                Ok(Self::Keyframes(path))
            }
        }
    }
}

/// Reads a material's name or its fields.
fn material<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<MaterialSpec>, D::Error> {
    let text = match Value::deserialize(deserializer)? {
        Value::Null => return Ok(None),
        Value::String(name) => name,
        fields => fields.to_string(),
    };
    MaterialSpec::parse(&text).map(Some).map_err(|error| de::Error::custom(format!("material: {error}")))
}

fn is_no(value: &bool) -> bool {
    !value
}

fn point(position_m: [f64; 3]) -> Vec3 {
    Vec3::from_array(position_m.map(|x| x as f32))
}

/// Returns `vase` for `meshes/vase.obj`, or `vase 2` if that is taken.
fn free_name(mesh: &FilePath, taken: &HashSet<String>) -> String {
    let stem = mesh.file_stem().map_or_else(|| "object".into(), |stem| stem.to_string_lossy().into_owned());
    let numbered = (2..).map(|number| format!("{stem} {number}"));
    std::iter::once(stem.clone()).chain(numbered).find(|name| !taken.contains(name)).unwrap_or(stem)
}
