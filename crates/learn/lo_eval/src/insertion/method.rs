//! What lights the objects.

use lightoctree::completion::light_from_above;
use lightoctree::insert::Lighting;
use lightoctree::scene::Scene;
use lightoctree::{SharpViewers, fit_lamps};
use lo_dataset::{NovelView, Sample};
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{RadianceImage, sample_equirectangular};

use crate::method::{in_photo_frame, true_octree};
use crate::{DepthInput, MethodError, Tools};

/// A way to light an object in a photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsertionMethod {
    /// The networks, from the photo alone or with depth.
    Network(Option<DepthInput>, LampMode),
    /// The one panorama that the global decoder makes of the photo, and true depth.
    SingleMap,
    /// The true octree and true depth: what a perfect network of this depth would reach.
    TrueOctree,
    /// The true panorama at the object's middle, as light from infinitely far away, and true depth.
    TruePanorama,
}

/// LampMode that a network's octree gets for lighting objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LampMode {
    /// None but what the network sees and guesses.
    None,
    /// One above the middle of the view, as bright as what is seen asks for.
    Overhead,
    /// Those that explain how what is seen is shaded.
    Fitted,
}

impl InsertionMethod {
    /// All of them, in the order of the tables.
    pub const ALL: [Self; 12] = [
        Self::Network(None, LampMode::None),
        Self::Network(None, LampMode::Overhead),
        Self::Network(None, LampMode::Fitted),
        Self::Network(Some(DepthInput::Sensor), LampMode::None),
        Self::Network(Some(DepthInput::Sensor), LampMode::Overhead),
        Self::Network(Some(DepthInput::Sensor), LampMode::Fitted),
        Self::Network(Some(DepthInput::True), LampMode::None),
        Self::Network(Some(DepthInput::True), LampMode::Overhead),
        Self::Network(Some(DepthInput::True), LampMode::Fitted),
        Self::SingleMap,
        Self::TrueOctree,
        Self::TruePanorama,
    ];

    /// Its name in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Network(None, LampMode::None) => "no-lamp",
            Self::Network(None, LampMode::Overhead) => "overhead",
            Self::Network(None, LampMode::Fitted) => "fitted",
            Self::Network(Some(DepthInput::Sensor), LampMode::None) => "no-lamp-sensor",
            Self::Network(Some(DepthInput::Sensor), LampMode::Overhead) => "overhead-sensor",
            Self::Network(Some(DepthInput::Sensor), LampMode::Fitted) => "fitted-sensor",
            Self::Network(Some(DepthInput::True), LampMode::None) => "no-lamp-true",
            Self::Network(Some(DepthInput::True), LampMode::Overhead) => "overhead-true",
            Self::Network(Some(DepthInput::True), LampMode::Fitted) => "fitted-true",
            Self::SingleMap => "single-map",
            Self::TrueOctree => "true-octree",
            Self::TruePanorama => "true-panorama",
        }
    }

    /// The depth that it works with.
    pub(crate) fn input(self) -> Option<DepthInput> {
        match self {
            Self::Network(input, _) => input,
            _ => Some(DepthInput::True),
        }
    }
}

/// ObjectLight on objects, and the scene that they stand in.
pub(crate) struct ObjectLighting {
    pub scene: Scene,
    light: ObjectLight,
}

enum ObjectLight {
    Octree(Box<SharpViewers>),
    /// The same panorama at all places.
    Map(RadianceImage),
    /// The true panorama of each place.
    Panoramas,
}

impl ObjectLighting {
    /// `scene` is what the networks make of the photo and the method's depth.
    ///
    /// # Errors
    /// What the sample or the tools lack.
    pub fn new(method: InsertionMethod, sample: &Sample, scene: &Scene, tools: &Tools) -> Result<Self, MethodError> {
        let mut scene = scene.clone();
        let light = match method {
            InsertionMethod::Network(_, lamps) => {
                match lamps {
                    LampMode::None => {}
                    LampMode::Overhead => lamp_above(&mut scene),
                    LampMode::Fitted => drop(fit_lamps(&mut scene)),
                }
                ObjectLight::Octree(Box::new(SharpViewers::new(&scene)))
            }
            InsertionMethod::TrueOctree => {
                scene.light = true_octree(sample, tools)?;
                scene.confidence = None;
                ObjectLight::Octree(Box::new(SharpViewers::new(&scene)))
            }
            InsertionMethod::SingleMap => {
                let networks = tools.estimator.networks().ok_or(MethodError::Needs("weights"))?;
                ObjectLight::Map(networks.single_map(&sample.photo))
            }
            InsertionMethod::TruePanorama => ObjectLight::Panoramas,
        };
        Ok(Self { scene, light })
    }

    /// What `insert` is to take for all objects; `None` where each place has a light of its own, [`in_photo_frame`].
    pub fn lighting(&self) -> Option<Lighting> {
        match &self.light {
            ObjectLight::Octree(_) => Some(Lighting::Octree),
            ObjectLight::Map(map) => Some(Lighting::EnvironmentMap(map.clone())),
            ObjectLight::Panoramas => None,
        }
    }

    /// Panorama in the photo's frame at a place, which is `view`'s as the scene has it.
    pub fn panorama(&self, place_m: Vec3, view: &NovelView) -> RadianceImage {
        let (width, height) = (view.radiance.width(), view.radiance.height());
        match &self.light {
            ObjectLight::Octree(viewers) => viewers.panorama(place_m, width, height).radiance,
            ObjectLight::Map(map) => RadianceImage::from_fn(width, height, |x, y| {
                sample_equirectangular(map, pixel_direction(x, y, width, height))
            }),
            ObjectLight::Panoramas => in_photo_frame(view),
        }
    }
}

/// The baseline of one lamp above the middle of the view.
fn lamp_above(scene: &mut Scene) {
    if let Some(room) = &scene.room {
        let seen = scene.frame.working().without_flying_pixels();
        light_from_above(&mut scene.light, &seen.surfels(&seen.radiance()), room.up);
    }
}
