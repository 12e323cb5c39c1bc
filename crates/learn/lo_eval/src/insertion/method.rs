//! What lights the objects.

use std::sync::Arc;

use lo_completion::light_from_above;
use lo_dataset::{NovelView, Sample};
use lo_estimate::plausible;
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging::{RadianceImage, sample_equirectangular};
use lo_insert::Lighting;
use lo_lookup::SceneRenderer;
use lo_scene::LitScene;

use crate::method::{in_photo_frame, true_octree};
use crate::{DepthInput, MethodError, Tools};

/// A way to light an object in a photo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InsertionMethod {
    /// The networks, from the photo alone or with depth.
    Network(Option<DepthInput>, Lamps),
    /// The one panorama that the global decoder makes of the photo, and true depth.
    SingleMap,
    /// The true octree and true depth: what a perfect network of this depth would reach.
    TrueOctree,
    /// The true panorama at the object's middle, as light from infinitely far away, and true depth.
    TruePanorama,
}

/// Lamps that a network's octree gets for lighting objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lamps {
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
        Self::Network(None, Lamps::None),
        Self::Network(None, Lamps::Overhead),
        Self::Network(None, Lamps::Fitted),
        Self::Network(Some(DepthInput::Sensor), Lamps::None),
        Self::Network(Some(DepthInput::Sensor), Lamps::Overhead),
        Self::Network(Some(DepthInput::Sensor), Lamps::Fitted),
        Self::Network(Some(DepthInput::True), Lamps::None),
        Self::Network(Some(DepthInput::True), Lamps::Overhead),
        Self::Network(Some(DepthInput::True), Lamps::Fitted),
        Self::SingleMap,
        Self::TrueOctree,
        Self::TruePanorama,
    ];

    /// Its name in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Network(None, Lamps::None) => "no-lamp",
            Self::Network(None, Lamps::Overhead) => "overhead",
            Self::Network(None, Lamps::Fitted) => "fitted",
            Self::Network(Some(DepthInput::Sensor), Lamps::None) => "no-lamp-sensor",
            Self::Network(Some(DepthInput::Sensor), Lamps::Overhead) => "overhead-sensor",
            Self::Network(Some(DepthInput::Sensor), Lamps::Fitted) => "fitted-sensor",
            Self::Network(Some(DepthInput::True), Lamps::None) => "no-lamp-true",
            Self::Network(Some(DepthInput::True), Lamps::Overhead) => "overhead-true",
            Self::Network(Some(DepthInput::True), Lamps::Fitted) => "fitted-true",
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

/// Light on objects, and the scene that they stand in.
pub(crate) struct Lit {
    pub scene: LitScene,
    light: Light,
}

enum Light {
    Octree(Box<SceneRenderer>),
    /// The same panorama at all places.
    Map(RadianceImage),
    /// The true panorama of each place.
    Panoramas,
}

impl Lit {
    /// `scene` is what the networks make of the photo and the method's depth.
    ///
    /// # Errors
    /// What the sample or the tools lack.
    pub fn new(
        method: InsertionMethod,
        sample: &Sample,
        estimate: &Arc<lo_scene::Estimate>,
        tools: &Tools,
    ) -> Result<Self, MethodError> {
        let mut scene = LitScene::as_estimated(estimate.clone());
        let light = match method {
            InsertionMethod::Network(_, lamps) => {
                match lamps {
                    Lamps::None => {}
                    Lamps::Overhead => lamp_above(&mut scene),
                    Lamps::Fitted => (scene, _) = plausible(estimate),
                }
                Light::Octree(Box::new(SceneRenderer::new(&scene)))
            }
            InsertionMethod::TrueOctree => {
                scene.light = true_octree(sample, tools)?;
                scene.estimate_mut().confidence = None;
                Light::Octree(Box::new(SceneRenderer::new(&scene)))
            }
            InsertionMethod::SingleMap => {
                let networks = tools.estimator.networks().ok_or(MethodError::Needs("weights"))?;
                Light::Map(networks.single_map(&sample.photo))
            }
            InsertionMethod::TruePanorama => Light::Panoramas,
        };
        Ok(Self { scene, light })
    }

    /// What `insert` is to take for all objects; `None` where each place has a light of its own, [`in_photo_frame`].
    pub fn lighting(&self) -> Option<Lighting> {
        match &self.light {
            Light::Octree(_) => Some(Lighting::Octree),
            Light::Map(map) => Some(Lighting::EnvironmentMap(map.clone())),
            Light::Panoramas => None,
        }
    }

    /// Panorama in the photo's frame at a place, which is `view`'s as the scene has it.
    pub fn panorama(&self, place_m: Vec3, view: &NovelView) -> RadianceImage {
        let (width, height) = (view.radiance.width(), view.radiance.height());
        match &self.light {
            Light::Octree(viewers) => viewers.panorama(place_m, width, height).radiance,
            Light::Map(map) => RadianceImage::from_fn(width, height, |x, y| {
                sample_equirectangular(map, pixel_direction(x, y, width, height))
            }),
            Light::Panoramas => in_photo_frame(view),
        }
    }
}

/// The baseline of one lamp above the middle of the view.
fn lamp_above(scene: &mut LitScene) {
    if let Some(room) = &scene.estimate.room {
        let seen = scene.estimate.surface();
        light_from_above(&mut scene.light, &seen.surfels(&seen.radiance()), room.up);
    }
}
