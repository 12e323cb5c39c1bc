//! Methods to light objects.

use std::sync::Arc;

use lo_completion::light_from_above;
use lo_dataset::{NovelView, Sample};
use lo_estimate::plausible_light;
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{RadianceImage, sample_equirectangular};
use lo_insert::Lighting;
use lo_lookup::SceneRenderer;
use lo_scene::{Estimate, LitScene};

use crate::method::{in_photo_frame, true_octree};
use crate::{DepthInput, MethodError, Tools};

/// A method to light an object in a photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsertionMethod {
    /// The networks, from the photo alone or with depth.
    Network(Option<DepthInput>, LampMode),
    /// The single map, with true depth.
    SingleMap,
    /// The true octree and true depth: the upper bound of a network of this depth.
    TrueOctree,
    /// The true panorama at the object's centre as distant light, with true depth.
    TruePanorama,
}

/// Lamps added to a network's octree for lighting objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LampMode {
    /// No added lamp.
    None,
    /// One lamp above the centre of the view, at the brightness that observed surfaces require.
    Overhead,
    /// Lamps fitted to the shading of observed surfaces.
    Fitted,
}

impl InsertionMethod {
    /// All methods, in the order of the tables.
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

    /// Returns the name in tables and on the command line.
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

    /// Returns the depth input.
    pub fn input(self) -> Option<DepthInput> {
        match self {
            Self::Network(input, _) => input,
            _ => Some(DepthInput::True),
        }
    }
}

/// Light on objects, and the scene that they are inserted into.
pub struct ObjectLighting {
    /// The scene in the method's light.
    pub scene: LitScene,
    light: ObjectLight,
}

/// Source of the light on objects.
enum ObjectLight {
    Octree(Box<SceneRenderer>),
    /// One panorama at all footprints.
    Map(RadianceImage),
    /// The true panorama at each footprint.
    Panoramas,
}

impl ObjectLighting {
    /// Prepares the light of a method; `estimate` is of the networks with the method's depth input.
    ///
    /// # Errors
    /// Missing inputs.
    pub fn new(
        method: InsertionMethod,
        sample: &Sample,
        estimate: &Arc<Estimate>,
        tools: &Tools,
    ) -> Result<Self, MethodError> {
        let mut scene = LitScene::as_estimated(estimate.clone());
        let light = match method {
            InsertionMethod::Network(_, lamps) => {
                match lamps {
                    LampMode::None => {}
                    LampMode::Overhead => add_overhead_lamp(&mut scene),
                    LampMode::Fitted => (scene, _) = plausible_light(estimate),
                }
                ObjectLight::Octree(Box::new(SceneRenderer::new(&scene)))
            }
            InsertionMethod::TrueOctree => {
                scene.light = true_octree(sample, tools)?;
                scene.estimate_mut().confidence = None;
                ObjectLight::Octree(Box::new(SceneRenderer::new(&scene)))
            }
            InsertionMethod::SingleMap => {
                let networks = tools.estimator.networks().ok_or(MethodError::Needs("weights"))?;
                ObjectLight::Map(networks.single_map(&sample.photo))
            }
            InsertionMethod::TruePanorama => ObjectLight::Panoramas,
        };
        Ok(Self { scene, light })
    }

    /// Returns the lighting of all objects; `None` if each footprint has its own true panorama.
    pub fn lighting(&self) -> Option<Lighting> {
        match &self.light {
            ObjectLight::Octree(_) => Some(Lighting::Octree),
            ObjectLight::Map(map) => Some(Lighting::EnvironmentMap(map.clone())),
            ObjectLight::Panoramas => None,
        }
    }

    /// Returns the panorama in the photo's frame at a position of the scene that corresponds to `view`.
    pub(crate) fn panorama(&self, place_m: Vec3, view: &NovelView) -> RadianceImage {
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

/// Adds one lamp above the centre of the view: the baseline.
fn add_overhead_lamp(scene: &mut LitScene) {
    if let Some(room) = &scene.estimate.room {
        let seen = scene.estimate.surface();
        light_from_above(&mut scene.light, &seen.surfels(&seen.radiance()), room.up);
    }
}
