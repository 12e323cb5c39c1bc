//! Configuration of a study.

use lo_dataset::GeneratorConfig;
use lo_eval::InsertionMethod;
use lo_insert::Quality;
use lo_mesh::MaterialSpec;
use serde::{Deserialize, Serialize};

/// Method of the video in the middle.
pub(crate) const REFERENCE: InsertionMethod = InsertionMethod::TrueOctree;

/// Configuration of a study. Every field has a default, so a file only needs the fields that differ.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StudyConfig {
    /// Method under study, by its name in `eval --protocol insertion`.
    pub ours: String,
    /// Methods that it is compared with. Each is one pair per room.
    pub others: Vec<String>,
    /// Number of rooms.
    pub rooms: u32,
    /// Mesh of both objects: a file, relative to the configuration's folder, or `builtin:NAME`.
    pub mesh: String,
    /// Materials of the left and the right object: names or JSON, as for `insert --material`.
    pub materials: [String; 2],
    /// Apparent size of an object in the middle of its path, of the larger of height and width, as a share of the
    /// photo's height.
    pub object_size: f32,
    /// Rotation of the objects from one end of the path to the other, degrees.
    pub turn_deg: f32,
    /// Frames from one end of the path to the other. The page plays them forth and back.
    pub frames: u32,
    /// Frames per second.
    pub fps: u32,
    /// Rendering quality: draft, normal or high.
    pub quality: Quality,
    /// Rooms, as for `synth --config`. One photo per room is used, and no panoramas.
    pub generator: GeneratorConfig,
}

impl Default for StudyConfig {
    fn default() -> Self {
        Self {
            ours: "fitted".to_owned(),
            others: ["single-map", "overhead", "no-lamp"].map(str::to_owned).to_vec(),
            rooms: 8,
            mesh: "builtin:suzanne".to_owned(),
            materials: ["matte-white", "silver"].map(str::to_owned),
            object_size: 0.25,
            turn_deg: 60.0,
            frames: 48,
            fps: 24,
            quality: Quality::Normal,
            generator: GeneratorConfig::default(),
        }
    }
}

/// A field of the configuration is invalid.
#[derive(Debug, thiserror::Error)]
pub enum StudyConfigError {
    /// No method has this name.
    #[error("{field}: unknown method \"{name}\"; available: {}", available())]
    UnknownMethod {
        /// Name of the field.
        field: &'static str,
        /// Name in the configuration.
        name: String,
    },
    /// The method cannot be compared.
    #[error("{field}: {name} cannot be compared: {reason}")]
    Unsuitable {
        /// Name of the field.
        field: &'static str,
        /// Name of the method.
        name: &'static str,
        /// Why not.
        reason: &'static str,
    },
    /// A method is named twice.
    #[error("others: {0} is named twice, or is the method under study")]
    Repeated(&'static str),
    /// There is nothing to compare with.
    #[error("others must name at least one method")]
    NoOthers,
    /// A number is out of range.
    #[error("{field} is {value}; it must be between {min} and {max}")]
    Range {
        /// Name of the field.
        field: &'static str,
        /// Its value.
        value: f32,
        /// Smallest allowed value.
        min: f32,
        /// Largest allowed value.
        max: f32,
    },
    /// A material is invalid.
    #[error("materials: {0}")]
    Material(#[from] lo_mesh::MeshError),
}

/// Methods of a study.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Methods {
    pub ours: InsertionMethod,
    pub others: Vec<InsertionMethod>,
}

impl Methods {
    /// Returns all methods: the reference, ours, the others.
    pub fn all(&self) -> impl Iterator<Item = InsertionMethod> {
        [REFERENCE, self.ours].into_iter().chain(self.others.iter().copied())
    }
}

impl StudyConfig {
    /// Checks all fields except those of the generator.
    ///
    /// # Errors
    /// If a field is invalid; the error names it.
    pub fn validate(&self) -> Result<(), StudyConfigError> {
        let ranges = [
            ("rooms", self.rooms as f32, 1.0, 1000.0),
            ("object_size", self.object_size, 0.02, 0.8),
            ("turn_deg", self.turn_deg, -3600.0, 3600.0),
            ("frames", self.frames as f32, 2.0, 1000.0),
            ("fps", self.fps as f32, 1.0, 120.0),
        ];
        if let Some((field, value, min, max)) = ranges.into_iter().find(|(_, v, min, max)| !(min..=max).contains(&v)) {
            return Err(StudyConfigError::Range { field, value, min, max });
        }
        self.materials()?;
        self.methods().map(|_| ())
    }

    /// Returns the materials of both objects.
    ///
    /// # Errors
    /// If one is invalid.
    pub fn materials(&self) -> Result<[MaterialSpec; 2], StudyConfigError> {
        let [left, right] = &self.materials;
        Ok([MaterialSpec::parse(left)?, MaterialSpec::parse(right)?])
    }

    /// Returns the methods.
    pub(crate) fn methods(&self) -> Result<Methods, StudyConfigError> {
        let ours = method("ours", &self.ours)?;
        let others: Vec<_> = self.others.iter().map(|name| method("others", name)).collect::<Result<_, _>>()?;
        if others.is_empty() {
            return Err(StudyConfigError::NoOthers);
        }
        match others.iter().enumerate().find(|(i, other)| **other == ours || others[..*i].contains(other)) {
            Some((_, other)) => Err(StudyConfigError::Repeated(other.name())),
            None => Ok(Methods { ours, others }),
        }
    }
}

/// Returns the comparable method of a name.
fn method(field: &'static str, name: &str) -> Result<InsertionMethod, StudyConfigError> {
    let named = InsertionMethod::ALL.into_iter().find(|method| method.name() == name);
    let method = named.ok_or_else(|| StudyConfigError::UnknownMethod { field, name: name.to_owned() })?;
    let reason = match method {
        InsertionMethod::TruePanorama => "its light is known at fixed positions, and objects move",
        REFERENCE => "it is the reference",
        _ => return Ok(method),
    };
    Err(StudyConfigError::Unsuitable { field, name: method.name(), reason })
}

/// Lists the names of all comparable methods.
fn available() -> String {
    let names = InsertionMethod::ALL.into_iter().map(InsertionMethod::name);
    names.filter(|name| method("", name).is_ok()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn message(config: StudyConfig) -> String {
        config.validate().unwrap_err().to_string()
    }

    #[test]
    fn the_default_is_valid() {
        let config = StudyConfig::default();
        config.validate().unwrap();
        let names: Vec<_> = config.methods().unwrap().all().map(InsertionMethod::name).collect();
        assert_eq!(names, ["true-octree", "fitted", "single-map", "overhead", "no-lamp"]);
    }

    #[test]
    fn invalid_fields_are_named() {
        let default = StudyConfig::default;
        let others =
            |names: &[&str]| StudyConfig { others: names.iter().map(|&name| name.to_owned()).collect(), ..default() };
        let found = message(StudyConfig { ours: "magic".into(), ..default() });
        assert!(found.starts_with("ours: unknown method \"magic\"; available: no-lamp, "), "{found}");
        assert!(!found.contains("true-octree"), "{found}");
        assert_eq!(
            message(others(&["true-panorama"])),
            "others: true-panorama cannot be compared: its light is known at fixed positions, and objects move"
        );
        assert!(message(others(&["true-octree"])).ends_with("it is the reference"));
        assert!(message(others(&["fitted"])).starts_with("others: fitted is named twice"));
        assert!(message(others(&["overhead", "overhead"])).starts_with("others: overhead is named twice"));
        assert_eq!(message(others(&[])), "others must name at least one method");
        assert_eq!(message(StudyConfig { frames: 1, ..default() }), "frames is 1; it must be between 2 and 1000");
        assert!(message(StudyConfig { object_size: f32::NAN, ..default() }).starts_with("object_size is NaN"));
        let found = message(StudyConfig { materials: ["matte-white".into(), "golf".into()], ..default() });
        assert!(found.starts_with("materials: ") && found.contains("golf"), "{found}");
    }
}
