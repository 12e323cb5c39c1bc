use std::f32::consts::{PI, TAU};

use lo_geometry::Vec3;
use serde::{Deserialize, Serialize};

use crate::GuessedLight;

/// Most emitters with changes, and most added lights, of one scene.
pub const MAX_LIGHT_EDITS: usize = 256;

/// Largest factor of an emitter's light.
pub const MAX_LIGHT_SCALE: f32 = 1e4;

/// Brightest light that can be added, radiance; a sun of 1,000 times the photo's white and 0.1° has 10⁸.
pub const MAX_LIGHT_RADIANCE: f32 = 1e10;

/// Sizes of added lights, metres: edges of rectangles, radii of spheres.
pub const MIN_LIGHT_SIZE_M: f32 = 1e-3;
/// See [`MIN_LIGHT_SIZE_M`].
pub const MAX_LIGHT_SIZE_M: f32 = 100.0;

/// Farthest place of a light along each axis, metres.
pub const MAX_LIGHT_PLACE_M: f32 = 1e3;

/// Angular radii of suns, degrees. The sun's own is 0.27°.
pub const MIN_SUN_RADIUS_DEG: f32 = 0.05;
/// See [`MIN_SUN_RADIUS_DEG`].
pub const MAX_SUN_RADIUS_DEG: f32 = 45.0;

/// Colour temperatures in kelvin of lights that are given one.
pub const MIN_KELVIN: f32 = 1667.0;
/// See [`MIN_KELVIN`].
pub const MAX_KELVIN: f32 = 25_000.0;

/// What somebody wants changed of a scene's light, beside the estimate, which stays as it is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LightEdits {
    /// Of emitters that the estimate has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub emitters: Vec<EmitterEdit>,
    /// Lights that it does not have.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub added: Vec<AddedLight>,
    /// Which light the scene is lit by; where nobody chose it, each command has its own default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub guessed: Option<GuessedLight>,
}

/// What is changed of one emitter of the estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EmitterEdit {
    /// Its name in the list of emitters.
    pub id: String,
    /// Its middle when it was edited, metres: emitters are found anew whenever a scene is used, and one of this name elsewhere is another one.
    pub found_at_m: Vec3,
    /// What is changed.
    #[serde(flatten)]
    pub change: LightChange,
}

/// A light that somebody added.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AddedLight {
    /// Its name in the list of emitters.
    pub id: String,
    /// As it was added.
    pub light: AnalyticLight,
    /// What was changed since.
    #[serde(flatten)]
    pub change: LightChange,
}

/// A change of a light; by default none.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LightChange {
    /// Whether it shines.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub on: bool,
    /// Factor of its radiance, from 0 to [`MAX_LIGHT_SCALE`].
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f32,
    /// Its colour instead of its own; its luminance stays.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub color: Option<LightColor>,
    /// Its middle instead of its own, metres; of no meaning for suns.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_m: Option<Vec3>,
}

/// The colour of a light, of any luminance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightColor {
    /// Of a black body of this temperature.
    Kelvin(f32),
    /// Linear Rec. 709.
    Rgb([f32; 3]),
}

/// A light with a shape of its own, which no octree holds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct AnalyticLight {
    /// Where light comes from.
    pub shape: LightShape,
    /// Linear RGB radiance, the same all over it and in all directions that it shines to.
    pub radiance: [f32; 3],
}

/// The shape of a light, in metres and in the photo's frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightShape {
    /// A flat rectangle.
    Rectangle {
        /// Its middle.
        centre_m: Vec3,
        /// Unit direction that it shines to.
        direction: Vec3,
        /// Unit direction of its width, perpendicular to it.
        across: Vec3,
        /// Width and height.
        size_m: [f32; 2],
        /// Whether it shines to the other side, too.
        two_sided: bool,
    },
    /// A sphere, which shines all around.
    Sphere {
        /// Its middle.
        centre_m: Vec3,
        /// Radius.
        radius_m: f32,
    },
    /// A disc at infinity.
    Sun {
        /// Unit direction towards it.
        direction: Vec3,
        /// Half of the angle that it is seen under.
        angular_radius_deg: f32,
        /// Whether it is the photo's own: it shines where the photo shows that it does, and there the photo has its light already.
        #[serde(default, skip_serializing_if = "is_no")]
        of_photo: bool,
    },
}

impl LightEdits {
    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        !self.has_lights() && self.guessed.is_none()
    }

    /// Whether emitters are changed or lights added.
    pub fn has_lights(&self) -> bool {
        !(self.emitters.is_empty() && self.added.is_empty())
    }

    /// What is changed of a light; [`LightChange::NONE`] where nothing is.
    pub fn change_of(&self, id: &str) -> LightChange {
        let emitter = self.emitters.iter().find(|edit| edit.id == id).map(|edit| edit.change);
        let added = || self.added.iter().find(|light| light.id == id).map(|light| light.change);
        emitter.or_else(added).unwrap_or_default()
    }

    /// Changes a light that was added, or the emitter of that name, which lies at `found_at_m`, in the place of what was changed before. `false` where
    /// there are [`MAX_LIGHT_EDITS`] already.
    #[must_use]
    pub fn change(&mut self, id: &str, found_at_m: Vec3, change: LightChange) -> bool {
        if let Some(light) = self.added.iter_mut().find(|light| light.id == id) {
            light.change = change;
            return true;
        }
        self.emitters.retain(|edit| edit.id != id);
        if change != LightChange::NONE {
            self.emitters.push(EmitterEdit { id: id.to_owned(), found_at_m, change });
        }
        self.emitters.len() <= MAX_LIGHT_EDITS
    }

    /// Adds a light and names it; `None` where there are [`MAX_LIGHT_EDITS`] already.
    pub fn add(&mut self, light: AnalyticLight) -> Option<String> {
        let number = |light: &AddedLight| light.id.trim_start_matches('A').parse::<u32>().unwrap_or(0);
        let last = self.added.iter().map(number).max().unwrap_or(0);
        let id = format!("A{}", last.checked_add(1)?);
        (self.added.len() < MAX_LIGHT_EDITS).then(|| {
            self.added.push(AddedLight { id: id.clone(), light, change: LightChange::NONE });
            id
        })
    }

    /// Takes an added light away; `false` where there is none of that name.
    pub fn remove(&mut self, id: &str) -> bool {
        let before = self.added.len();
        self.added.retain(|light| light.id != id);
        self.added.len() < before
    }

    /// The first thing that is wrong.
    pub(crate) fn check(&self) -> Result<(), String> {
        if let Some(what) = self.guessed.and_then(|guessed| guessed.tuning.wrong()) {
            return Err(format!("guessed light: {what} is out of range"));
        }
        let count = self.emitters.len().max(self.added.len());
        if count > MAX_LIGHT_EDITS {
            return Err(format!("{count} edited lights, at most {MAX_LIGHT_EDITS} are kept"));
        }
        let ids = || self.emitters.iter().map(|edit| &edit.id).chain(self.added.iter().map(|light| &light.id));
        if let Some(id) = ids().find(|id| !is_id(id)) {
            return Err(format!("an edited light is called {:?}", id.chars().take(20).collect::<String>()));
        }
        if let Some((_, id)) = ids().enumerate().find(|(index, id)| ids().take(*index).any(|before| before == *id)) {
            return Err(format!("light {id} is edited twice"));
        }
        let wrong = |id: &str, what: &str| Err(format!("edited light {id}: {what} is out of range"));
        for EmitterEdit { id, found_at_m, change } in &self.emitters {
            if !is_place(*found_at_m) {
                return wrong(id, "its place");
            }
            if let Some(what) = change.wrong() {
                return wrong(id, what);
            }
        }
        for AddedLight { id, light, change } in &self.added {
            if let Some(what) = light.wrong().or_else(|| change.wrong()) {
                return wrong(id, what);
            }
        }
        Ok(())
    }
}

impl LightChange {
    /// None.
    pub const NONE: Self = Self { on: true, scale: 1.0, color: None, at_m: None };

    /// What lies out of its range, if anything.
    pub fn wrong(&self) -> Option<&'static str> {
        if !(0.0..=MAX_LIGHT_SCALE).contains(&self.scale) {
            return Some("the scale");
        }
        if self.color.is_some_and(|color| !color.is_valid()) {
            return Some("the colour");
        }
        self.at_m.is_some_and(|at| !is_place(at)).then_some("the place")
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
    /// What lies out of its range, if anything.
    pub fn wrong(&self) -> Option<&'static str> {
        if !self.radiance.iter().all(|c| (0.0..=MAX_LIGHT_RADIANCE).contains(c)) {
            return Some("the radiance");
        }
        let unit = |v: Vec3| v.is_finite() && (v.length_squared() - 1.0).abs() < 1e-3;
        let size = |m: &f32| (MIN_LIGHT_SIZE_M..=MAX_LIGHT_SIZE_M).contains(m);
        match self.shape {
            LightShape::Rectangle { centre_m, direction, across, size_m, .. } => {
                if !is_place(centre_m) {
                    Some("the place")
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
                    Some("the place")
                }
            }
            LightShape::Sun { direction, angular_radius_deg, .. } => {
                let wide = (MIN_SUN_RADIUS_DEG..=MAX_SUN_RADIUS_DEG).contains(&angular_radius_deg);
                if unit(direction) { (!wide).then_some("the size") } else { Some("the direction") }
            }
        }
    }

    /// Middle in metres; `None` for a sun.
    pub fn centre_m(&self) -> Option<Vec3> {
        match self.shape {
            LightShape::Rectangle { centre_m, .. } | LightShape::Sphere { centre_m, .. } => Some(centre_m),
            LightShape::Sun { .. } => None,
        }
    }

    /// Emitting area in m², both sides of a two-sided rectangle; of a sun its solid angle in steradians.
    pub fn extent(&self) -> f32 {
        match self.shape {
            LightShape::Rectangle { size_m: [width, height], two_sided, .. } => {
                width * height * if two_sided { 2.0 } else { 1.0 }
            }
            LightShape::Sphere { radius_m, .. } => 4.0 * PI * radius_m * radius_m,
            LightShape::Sun { angular_radius_deg, .. } => {
                // 1 − cos θ = 2 sin² θ/2 keeps its digits.
                let sin = (0.5 * angular_radius_deg.to_radians()).sin();
                TAU * 2.0 * sin * sin
            }
        }
    }
}

/// A letter or more, then digits.
fn is_id(id: &str) -> bool {
    (2..=16).contains(&id.len())
        && id.starts_with(|c: char| c.is_ascii_uppercase())
        && id.chars().skip(1).all(|c| c.is_ascii_digit())
}

fn is_place(place: Vec3) -> bool {
    place.to_array().iter().all(|c| c.abs() <= MAX_LIGHT_PLACE_M)
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
