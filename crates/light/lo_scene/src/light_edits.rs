use std::f32::consts::{PI, TAU};

use lo_geometry::Vec3;
use serde::{Deserialize, Serialize};

use crate::InferredLight;

/// Largest number of edited emitters, and of added lights, of one scene.
pub const MAX_LIGHT_EDITS: usize = 256;

/// Largest gain of an emitter's light.
pub const MAX_LIGHT_SCALE: f32 = 1e4;

/// Largest radiance of an added light; a sun of 1,000 times the photo's white and 0.1° has 10⁸.
pub const MAX_LIGHT_RADIANCE: f32 = 1e10;

/// Smallest size of an added light, metres: edge of a rectangle, radius of a sphere.
pub const MIN_LIGHT_SIZE_M: f32 = 1e-3;
/// Largest size of an added light, metres.
pub const MAX_LIGHT_SIZE_M: f32 = 100.0;

/// Largest coordinate of a light's position along each axis, metres.
pub const MAX_LIGHT_POSITION_M: f32 = 1e3;

/// Smallest angular radius of a sun, degrees; the real sun has 0.27°.
pub const MIN_SUN_RADIUS_DEG: f32 = 0.05;
/// Largest angular radius of a sun, degrees.
pub const MAX_SUN_RADIUS_DEG: f32 = 45.0;

/// Lowest colour temperature of a light, kelvin.
pub const MIN_KELVIN: f32 = 1667.0;
/// Highest colour temperature of a light, kelvin.
pub const MAX_KELVIN: f32 = 25_000.0;

/// The user's light edits. They are stored beside the estimate, which stays unchanged.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LightEdits {
    /// Changes of emitters of the estimate.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub emitters: Vec<EmitterEdit>,
    /// Added lights.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub added: Vec<AddedLight>,
    /// Light that the scene is rendered with; `None` if not chosen, so that each command uses its own default.
    #[serde(rename = "guessed", default, skip_serializing_if = "Option::is_none")]
    pub inferred: Option<InferredLight>,
}

/// Change of one emitter of the estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EmitterEdit {
    /// Name in the list of emitters.
    pub id: String,
    /// Centre when it was edited, metres. Emitters are detected anew whenever a scene is used; one of this name
    /// elsewhere is a different emitter.
    pub found_at_m: Vec3,
    /// The change.
    #[serde(flatten)]
    pub change: LightChange,
}

/// A light added by the user.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AddedLight {
    /// Name in the list of lights.
    pub id: String,
    /// The light as it was added.
    pub light: AnalyticLight,
    /// Change since then.
    #[serde(flatten)]
    pub change: LightChange,
}

/// Change of a light; by default none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct LightChange {
    /// Whether it is on.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    #[cfg_attr(feature = "typescript", ts(as = "Option<bool>", optional))]
    pub on: bool,
    /// Gain of its radiance, from 0 to [`MAX_LIGHT_SCALE`].
    #[serde(default = "one", skip_serializing_if = "is_one")]
    #[cfg_attr(feature = "typescript", ts(as = "Option<f32>", optional))]
    pub scale: f32,
    /// New colour; luminance is kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(optional))]
    pub color: Option<LightColor>,
    /// New centre, metres; ignored for suns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(as = "Option<[f32; 3]>", optional))]
    pub at_m: Option<Vec3>,
}

/// Colour of a light; its luminance is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum LightColor {
    /// Colour temperature of a black body, kelvin.
    Kelvin(f32),
    /// Linear Rec. 709 RGB.
    Rgb([f32; 3]),
}

/// A light with an analytic shape, outside of the octree.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnalyticLight {
    /// Shape and position.
    pub shape: LightShape,
    /// Linear RGB radiance, uniform over the surface and over all emitting directions.
    pub radiance: [f32; 3],
}

/// Shape of a light, in metres in the photo's frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightShape {
    /// A flat rectangle.
    Rectangle {
        /// Centre.
        centre_m: Vec3,
        /// Unit direction of emission.
        direction: Vec3,
        /// Unit direction of its width, perpendicular to `direction`.
        across: Vec3,
        /// Width and height.
        size_m: [f32; 2],
        /// Whether it also emits from its back.
        two_sided: bool,
    },
    /// A sphere that emits in all directions.
    Sphere {
        /// Centre.
        centre_m: Vec3,
        /// Radius.
        radius_m: f32,
    },
    /// A disc at infinity.
    Sun {
        /// Unit direction towards the sun.
        direction: Vec3,
        /// Half of its angular diameter, degrees.
        angular_radius_deg: f32,
        /// Whether it is the sun of the photo: it shines only where the photo shows it, and the photo already
        /// contains its light.
        #[serde(default, skip_serializing_if = "is_no")]
        of_photo: bool,
    },
}

impl LightEdits {
    /// Returns whether there are no edits.
    pub fn is_empty(&self) -> bool {
        !self.has_lights() && self.inferred.is_none()
    }

    /// Returns whether emitters are changed or lights added.
    pub fn has_lights(&self) -> bool {
        !(self.emitters.is_empty() && self.added.is_empty())
    }

    /// Returns the change of a light; [`LightChange::NONE`] if it is unchanged.
    pub fn change_of(&self, id: &str) -> LightChange {
        let emitter = self.emitters.iter().find(|edit| edit.id == id).map(|edit| edit.change);
        let added = || self.added.iter().find(|light| light.id == id).map(|light| light.change);
        emitter.or_else(added).unwrap_or_default()
    }

    /// Replaces the change of an added light, or of the emitter of that name.
    ///
    /// `found_at_m` is the emitter's position in the list of lights (`ListedLight::position_m`). It tells later whether
    /// the list still means the same emitter. Returns `false`, and changes nothing, if [`MAX_LIGHT_EDITS`] emitters are
    /// edited already.
    #[must_use]
    pub fn change(&mut self, id: &str, found_at_m: Vec3, change: LightChange) -> bool {
        if let Some(light) = self.added.iter_mut().find(|light| light.id == id) {
            light.change = change;
            return true;
        }
        let is_new = !self.emitters.iter().any(|edit| edit.id == id);
        if is_new && change != LightChange::NONE && self.emitters.len() >= MAX_LIGHT_EDITS {
            return false;
        }
        self.emitters.retain(|edit| edit.id != id);
        if change != LightChange::NONE {
            self.emitters.push(EmitterEdit { id: id.to_owned(), found_at_m, change });
        }
        true
    }

    /// Adds a light and returns its name; `None` if there are [`MAX_LIGHT_EDITS`] already.
    pub fn add(&mut self, light: AnalyticLight) -> Option<String> {
        let number = |light: &AddedLight| light.id.trim_start_matches('A').parse::<u32>().unwrap_or(0);
        let last = self.added.iter().map(number).max().unwrap_or(0);
        let id = format!("A{}", last.checked_add(1)?);
        (self.added.len() < MAX_LIGHT_EDITS).then(|| {
            self.added.push(AddedLight { id: id.clone(), light, change: LightChange::NONE });
            id
        })
    }

    /// Removes an added light; returns `false` if there is none of that name.
    pub fn remove(&mut self, id: &str) -> bool {
        let before = self.added.len();
        self.added.retain(|light| light.id != id);
        self.added.len() < before
    }

    /// Checks all values; the error names the first invalid one.
    pub(crate) fn check(&self) -> Result<(), String> {
        if let Some(what) = self.inferred.and_then(|inferred| inferred.tuning.invalid_field()) {
            return Err(format!("inferred light: {what} is out of range"));
        }
        let count = self.emitters.len().max(self.added.len());
        if count > MAX_LIGHT_EDITS {
            return Err(format!("{count} edited lights; at most {MAX_LIGHT_EDITS} are allowed"));
        }
        let ids = || self.emitters.iter().map(|edit| &edit.id).chain(self.added.iter().map(|light| &light.id));
        if let Some(id) = ids().find(|id| !is_id(id)) {
            return Err(format!("invalid name of an edited light: {:?}", id.chars().take(20).collect::<String>()));
        }
        if let Some((_, id)) = ids().enumerate().find(|(index, id)| ids().take(*index).any(|before| before == *id)) {
            return Err(format!("light {id} is edited twice"));
        }
        let wrong = |id: &str, what: &str| Err(format!("edited light {id}: {what} is out of range"));
        for EmitterEdit { id, found_at_m, change } in &self.emitters {
            if !is_place(*found_at_m) {
                return wrong(id, "the position");
            }
            if let Some(what) = change.invalid_field() {
                return wrong(id, what);
            }
        }
        for AddedLight { id, light, change } in &self.added {
            if let Some(what) = light.invalid_field().or_else(|| change.invalid_field()) {
                return wrong(id, what);
            }
        }
        Ok(())
    }
}

impl LightChange {
    /// No change.
    pub const NONE: Self = Self { on: true, scale: 1.0, color: None, at_m: None };

    /// Returns the name of a value that is out of range.
    pub fn invalid_field(&self) -> Option<&'static str> {
        if !(0.0..=MAX_LIGHT_SCALE).contains(&self.scale) {
            return Some("the scale");
        }
        if self.color.is_some_and(|color| !color.is_valid()) {
            return Some("the colour");
        }
        self.at_m.is_some_and(|at| !is_place(at)).then_some("the position")
    }
}

impl Default for LightChange {
    fn default() -> Self {
        Self::NONE
    }
}

impl LightColor {
    fn is_valid(&self) -> bool {
        match self {
            Self::Kelvin(kelvin) => (MIN_KELVIN..=MAX_KELVIN).contains(kelvin),
            Self::Rgb(rgb) => {
                rgb.iter().all(|c| (0.0..=MAX_LIGHT_RADIANCE).contains(c)) && lo_imaging::luminance(*rgb) > 1e-6
            }
        }
    }
}

impl AnalyticLight {
    /// Returns the name of a value that is out of range.
    pub fn invalid_field(&self) -> Option<&'static str> {
        if !self.radiance.iter().all(|c| (0.0..=MAX_LIGHT_RADIANCE).contains(c)) {
            return Some("the radiance");
        }
        let unit = |v: Vec3| v.is_finite() && (v.length_squared() - 1.0).abs() < 1e-3;
        let size = |m: &f32| (MIN_LIGHT_SIZE_M..=MAX_LIGHT_SIZE_M).contains(m);
        match self.shape {
            LightShape::Rectangle { centre_m, direction, across, size_m, .. } => {
                if !is_place(centre_m) {
                    Some("the position")
                } else if !(unit(direction) && unit(across) && direction.dot(across).abs() < 1e-3) {
                    Some("the direction")
                } else {
                    (!size_m.iter().all(size)).then_some("the size")
                }
            }
            LightShape::Sphere { centre_m, radius_m } => {
                if is_place(centre_m) {
                    (!size(&radius_m)).then_some("the size")
                } else {
                    Some("the position")
                }
            }
            LightShape::Sun { direction, angular_radius_deg, .. } => {
                let wide = (MIN_SUN_RADIUS_DEG..=MAX_SUN_RADIUS_DEG).contains(&angular_radius_deg);
                if unit(direction) { (!wide).then_some("the size") } else { Some("the direction") }
            }
        }
    }

    /// Returns the centre in metres; `None` for a sun.
    pub fn centre_m(&self) -> Option<Vec3> {
        match self.shape {
            LightShape::Rectangle { centre_m, .. } | LightShape::Sphere { centre_m, .. } => Some(centre_m),
            LightShape::Sun { .. } => None,
        }
    }

    /// Returns the emitting area in m² (both sides of a two-sided rectangle), or a sun's solid angle in steradians.
    pub fn extent(&self) -> f32 {
        match self.shape {
            LightShape::Rectangle { size_m: [width, height], two_sided, .. } => {
                width * height * if two_sided { 2.0 } else { 1.0 }
            }
            LightShape::Sphere { radius_m, .. } => 4.0 * PI * radius_m * radius_m,
            LightShape::Sun { angular_radius_deg, .. } => {
                // 1 − cos θ = 2 sin² θ/2 avoids cancellation.
                let sin = (0.5 * angular_radius_deg.to_radians()).sin();
                TAU * 2.0 * sin * sin
            }
        }
    }
}

/// Returns whether a name is one or more letters followed by digits.
fn is_id(id: &str) -> bool {
    (2..=16).contains(&id.len())
        && id.starts_with(|c: char| c.is_ascii_uppercase())
        && id.chars().skip(1).all(|c| c.is_ascii_digit())
}

fn is_place(place: Vec3) -> bool {
    place.to_array().iter().all(|c| c.abs() <= MAX_LIGHT_POSITION_M)
}

fn yes() -> bool {
    true
}

fn is_no(of_photo: &bool) -> bool {
    !*of_photo
}

fn is_yes(on: &bool) -> bool {
    *on
}

fn one() -> f32 {
    1.0
}

fn is_one(scale: &f32) -> bool {
    *scale == 1.0
}
