//! Methods to compare: networks, shell completion, baselines and upper bounds.

use std::sync::Arc;

use lo_baselines::{Baseline, Prediction, System};
use lo_cone::{Cone, OctreeRenderer};
use lo_dataset::{NovelView, Sample, TrueLeaves};
use lo_estimate::{EstimateOptions, Estimator, Input, apply_light};
use lo_geometry::{Cube, Vec3};
use lo_imaging::{DepthMap, Photo, RadianceImage, sample_equirectangular};
use lo_lookup::SceneRenderer;
use lo_octree::LightOctree;
use lo_scene::{Completion, Estimate, Frame, InferredLight, LightMode, LightTuning, LitScene};

use crate::method_error::MethodError;
use crate::prior::{is_mismatch, unchanged, yaw_error_deg};
use crate::{KnownPanorama, PriorAlignment, Profile, baseline};

/// Depth input of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthInput {
    /// True depth.
    True,
    /// Simulated sensor depth.
    Sensor,
}

/// A method that estimates the light around a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The networks, from the photo alone or with depth.
    Network(Option<DepthInput>),
    /// The networks with expected light, as `envmap` renders it.
    Expected(Option<DepthInput>),
    /// The networks with plausible light, as objects are lit.
    FittedLamps(Option<DepthInput>),
    /// The networks with the photo's detail in inferred regions, as in reflections of inserted objects.
    Detail(Option<DepthInput>),
    /// Shell completion: planes, no networks.
    Shell(DepthInput),
    /// The photo's mean colour in all directions.
    MeanColour,
    /// The training set's mean vertical profile times the photo's mean colour.
    Profile,
    /// The training set's mean linear vertical profile at the photo's brightness, with half the chroma of its mean
    /// colour.
    FixedShape,
    /// The photo, mirrored repeatedly to fill the sphere.
    Mirrored,
    /// The single map, independent of the probe's position (as in Gardner et al. 2017).
    SingleMap,
    /// The networks from the photo alone, with luminance cubed at constant integral, and half the chroma.
    NetworkCubed,
    /// The true octree: the upper bound of a network of this depth.
    TrueOctree,
    /// The networks, from the photo alone or with depth, and a panorama prior.
    PanoramaPrior(Option<DepthInput>, PriorPanorama),
    /// The known panorama as the light around every point.
    PanoramaEverywhere,
    /// A trained system of the literature, from the photo alone.
    Baseline(System),
}

/// Panorama prior of a method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorPanorama {
    /// A panorama of the room with given yaw; its exposure is estimated.
    YawGiven,
    /// A panorama of the room; yaw and exposure are estimated.
    YawFound,
    /// A panorama of a different room, used as if it were of this one; yaw and exposure are estimated.
    OfAnotherRoom,
}

/// Inputs of methods beside the sample.
#[derive(Clone, Copy, Debug)]
pub struct Tools<'a> {
    /// Estimator; methods based on networks require one with networks.
    pub estimator: &'a Estimator,
    /// Vertical profile, for `Profile` and `FixedShape`.
    pub profile: Option<&'a Profile>,
    /// Octree depth. Networks use at least their own depth.
    pub octree_depth: u32,
    /// Seed of the networks' random choices.
    pub seed: u64,
    /// A panorama of the sample's room, for `PanoramaPrior` and `PanoramaEverywhere`.
    pub known: Option<&'a KnownPanorama>,
    /// A panorama of a different room, for `PriorPanorama::OfAnotherRoom`.
    pub foreign: Option<&'a KnownPanorama>,
    /// Trained systems, for `Baseline`.
    pub baselines: &'a [Baseline],
}

impl<'a> Tools<'a> {
    /// Returns a trained system.
    fn baseline(&self, system: System) -> Option<&'a Baseline> {
        self.baselines.iter().find(|baseline| baseline.system() == system)
    }
}

/// A method's result for a room.
pub struct MethodOutput {
    /// Estimated light.
    pub light: EstimatedLight,
    /// Depth of the photo, estimated or given.
    pub depth_m: Option<DepthMap>,
    /// Estimated up vector in the photo's frame, unit length.
    pub up: Option<Vec3>,
    /// Alignment of the panorama prior.
    pub prior: Option<PriorAlignment>,
    /// Whether luminance of panoramas is cubed, as by [`Method::NetworkCubed`].
    pub is_cubed: bool,
}

/// Light around every point.
pub enum EstimatedLight {
    /// An octree, rendered by cone tracing.
    Octree {
        /// The octree.
        octree: Box<LightOctree>,
        /// Prepared for tracing.
        tracer: Tracer,
    },
    /// One panorama in the photo's frame, independent of the probe's position.
    Map(RadianceImage),
    /// Light of a trained system that depends on the probe's position.
    Predicted(Prediction),
}

/// Traces cones through estimated light.
pub enum Tracer {
    /// An octree without the photo.
    Octree(OctreeRenderer),
    /// A scene: where a cone hits observed geometry, the photo is sampled.
    Scene(Box<SceneRenderer>),
}

impl Method {
    /// Default methods, in the order of the tables.
    pub const ALL: [Self; 12] = [
        Self::MeanColour,
        Self::Profile,
        Self::FixedShape,
        Self::Mirrored,
        Self::SingleMap,
        Self::NetworkCubed,
        Self::Shell(DepthInput::Sensor),
        Self::Shell(DepthInput::True),
        Self::Network(None),
        Self::Network(Some(DepthInput::Sensor)),
        Self::Network(Some(DepthInput::True)),
        Self::TrueOctree,
    ];

    /// Methods with a known panorama. With any of them, all methods are scored only on panoramas at other positions.
    pub const WITH_PANORAMA: [Self; 6] = [
        Self::PanoramaEverywhere,
        Self::PanoramaPrior(None, PriorPanorama::YawGiven),
        Self::PanoramaPrior(None, PriorPanorama::YawFound),
        Self::PanoramaPrior(Some(DepthInput::Sensor), PriorPanorama::YawGiven),
        Self::PanoramaPrior(Some(DepthInput::True), PriorPanorama::YawGiven),
        Self::PanoramaPrior(None, PriorPanorama::OfAnotherRoom),
    ];

    /// Methods with expected or plausible light.
    pub const WITH_LAMPS: [Self; 6] = [
        Self::Expected(None),
        Self::Expected(Some(DepthInput::Sensor)),
        Self::Expected(Some(DepthInput::True)),
        Self::FittedLamps(None),
        Self::FittedLamps(Some(DepthInput::Sensor)),
        Self::FittedLamps(Some(DepthInput::True)),
    ];

    /// Methods with the photo's detail in inferred regions.
    pub const WITH_DETAIL: [Self; 3] =
        [Self::Detail(None), Self::Detail(Some(DepthInput::Sensor)), Self::Detail(Some(DepthInput::True))];

    /// Returns the name in tables and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Network(None) => "network",
            Self::Network(Some(DepthInput::Sensor)) => "network-sensor",
            Self::Network(Some(DepthInput::True)) => "network-true",
            Self::Expected(None) => "network-expected",
            Self::Expected(Some(DepthInput::Sensor)) => "network-expected-sensor",
            Self::Expected(Some(DepthInput::True)) => "network-expected-true",
            Self::FittedLamps(None) => "network-lamps",
            Self::FittedLamps(Some(DepthInput::Sensor)) => "network-lamps-sensor",
            Self::FittedLamps(Some(DepthInput::True)) => "network-lamps-true",
            Self::Detail(None) => "network-detail",
            Self::Detail(Some(DepthInput::Sensor)) => "network-detail-sensor",
            Self::Detail(Some(DepthInput::True)) => "network-detail-true",
            Self::Shell(DepthInput::Sensor) => "shell-sensor",
            Self::Shell(DepthInput::True) => "shell-true",
            Self::MeanColour => "mean-colour",
            Self::Profile => "profile",
            Self::FixedShape => "fixed-shape",
            Self::Mirrored => "mirrored",
            Self::SingleMap => "single-map",
            Self::NetworkCubed => "network-cubed",
            Self::TrueOctree => "true-octree",
            Self::PanoramaEverywhere => "panorama-everywhere",
            Self::Baseline(system) => system.name(),
            Self::PanoramaPrior(_, PriorPanorama::OfAnotherRoom) => "panorama-of-another-room",
            Self::PanoramaPrior(None, PriorPanorama::YawGiven) => "panorama-prior",
            Self::PanoramaPrior(Some(DepthInput::Sensor), PriorPanorama::YawGiven) => "panorama-prior-sensor",
            Self::PanoramaPrior(Some(DepthInput::True), PriorPanorama::YawGiven) => "panorama-prior-true",
            Self::PanoramaPrior(None, PriorPanorama::YawFound) => "panorama-prior-found",
            Self::PanoramaPrior(Some(DepthInput::Sensor), PriorPanorama::YawFound) => "panorama-prior-found-sensor",
            Self::PanoramaPrior(Some(DepthInput::True), PriorPanorama::YawFound) => "panorama-prior-found-true",
        }
    }

    /// Returns whether the method uses a known panorama, of this room or another.
    pub fn knows_panorama(self) -> bool {
        matches!(self, Self::PanoramaEverywhere | Self::PanoramaPrior(..))
    }

    /// Returns whether the method uses a panorama of a different room.
    pub fn takes_foreign_panorama(self) -> bool {
        matches!(self, Self::PanoramaPrior(_, PriorPanorama::OfAnotherRoom))
    }

    /// Returns whether the tools include what the method requires.
    pub fn has_tools(self, tools: &Tools) -> bool {
        match self {
            Self::Network(_)
            | Self::NetworkCubed
            | Self::Expected(_)
            | Self::FittedLamps(_)
            | Self::Detail(_)
            | Self::SingleMap
            | Self::PanoramaPrior(..) => tools.estimator.networks().is_some(),
            Self::Profile | Self::FixedShape => tools.profile.is_some(),
            Self::Baseline(system) => tools.estimator.networks().is_some() && tools.baseline(system).is_some(),
            _ => true,
        }
    }

    /// Returns whether a sample has the inputs that the method requires.
    pub fn takes(self, sample: &Sample) -> bool {
        match self {
            Self::Network(Some(input))
            | Self::Expected(Some(input))
            | Self::FittedLamps(Some(input))
            | Self::Detail(Some(input))
            | Self::PanoramaPrior(Some(input), _)
            | Self::Shell(input) => match input {
                DepthInput::True => sample.depth_m.is_some(),
                DepthInput::Sensor => sample.sensor_depth_m.is_some(),
            },
            Self::TrueOctree => !sample.points.is_empty(),
            _ => true,
        }
    }

    /// Estimates the light of a sample's room.
    ///
    /// # Errors
    /// Missing inputs; failed estimates.
    pub fn estimate(self, sample: &Sample, tools: &Tools) -> Result<MethodOutput, MethodError> {
        let map = |map: RadianceImage| Ok(MethodOutput::of_light(EstimatedLight::Map(map)));
        let profile = || tools.profile.ok_or(MethodError::Needs("a profile"));
        match self {
            Self::MeanColour => map(baseline::mean_colour_map(sample)),
            Self::Profile => map(baseline::profile_map(sample, profile()?)),
            Self::FixedShape => map(baseline::fixed_shape_map(sample, profile()?).ok_or(MethodError::Needs(LINEAR))?),
            Self::Mirrored => map(baseline::mirrored_map(sample)),
            Self::SingleMap => {
                let networks = tools.estimator.networks().ok_or(MethodError::Needs("weights"))?;
                map(networks.single_map(&sample.photo))
            }
            Self::Shell(input) => {
                // An estimator with networks would predict the up vector.
                let estimator = Estimator::without_networks();
                let options = EstimateOptions { octree_depth: Some(tools.octree_depth), ..EstimateOptions::default() };
                let input = Input::MeasuredDepth(frame(sample, input)?);
                Ok(MethodOutput::as_estimated(estimator.estimate(input, &options, &mut lo_events::ignore)?.into()))
            }
            Self::NetworkCubed => {
                Ok(MethodOutput { is_cubed: true, ..MethodOutput::as_estimated(estimate_scene(sample, None, tools)?) })
            }
            Self::Network(input) => Ok(MethodOutput::as_estimated(estimate_scene(sample, input, tools)?)),
            Self::Expected(input) => {
                estimate_lit(sample, input, tools, LightMode::Expected).map(MethodOutput::of_scene)
            }
            Self::FittedLamps(input) => {
                estimate_lit(sample, input, tools, LightMode::Plausible).map(MethodOutput::of_scene)
            }
            Self::Detail(input) => {
                let scene = estimate_lit(sample, input, tools, LightMode::Expected)?;
                let viewers = SceneRenderer::new(&scene).with_detail(&scene);
                Ok(MethodOutput::with_viewers(scene, viewers))
            }
            Self::Baseline(system) => {
                let networks = tools.estimator.networks().ok_or(MethodError::Needs("weights"))?;
                let baseline = tools.baseline(system).ok_or(MethodError::Needs("the baseline's weights"))?;
                Ok(MethodOutput::of_light(match baseline.predict(networks, &sample.photo, &sample.camera) {
                    Prediction::Map(panorama) => EstimatedLight::Map(panorama),
                    local => EstimatedLight::Predicted(local),
                }))
            }
            Self::PanoramaEverywhere => {
                let known = tools.known.filter(|known| !known.is_scored);
                let known = known.ok_or(MethodError::Needs("a known panorama that is not scored itself"))?;
                map(in_photo_frame(&known.view))
            }
            Self::PanoramaPrior(input, which) => with_panorama(sample, input, which, tools),
            Self::TrueOctree => Ok(MethodOutput::of_octree(true_octree(sample, tools)?)),
        }
    }
}

/// Requirement of `FixedShape`.
const LINEAR: &str = "a profile with linear_factors, as written by --make-profile";

/// Estimates a scene by the networks and applies a light mode.
fn estimate_lit(
    sample: &Sample,
    input: Option<DepthInput>,
    tools: &Tools,
    mode: LightMode,
) -> Result<LitScene, MethodError> {
    let inferred = InferredLight { light: mode, tuning: LightTuning::default() };
    let lit = apply_light(&estimate_scene(sample, input, tools)?, &inferred);
    Ok(lit.expect("the default tuning has no white pixel").0)
}

impl MethodOutput {
    /// In the even light of the octree.
    fn as_estimated(estimate: Arc<Estimate>) -> Self {
        Self::of_scene(LitScene::as_estimated(estimate))
    }

    fn of_scene(scene: LitScene) -> Self {
        let viewers = SceneRenderer::new(&scene);
        Self::with_viewers(scene, viewers)
    }

    fn with_viewers(scene: LitScene, viewers: SceneRenderer) -> Self {
        let tracer = Tracer::Scene(Box::new(viewers));
        let (up, depth_m) = (scene.room.as_ref().map(|room| room.up), scene.frame.depth_m.clone());
        let light = EstimatedLight::Octree { octree: Box::new(scene.light), tracer };
        Self { depth_m: Some(depth_m), up, ..Self::of_light(light) }
    }

    fn of_octree(octree: LightOctree) -> Self {
        let tracer = Tracer::Octree(OctreeRenderer::new(&octree));
        Self::of_light(EstimatedLight::Octree { octree: Box::new(octree), tracer })
    }

    /// Wraps light alone, without depth, up vector or prior.
    pub fn of_light(light: EstimatedLight) -> Self {
        Self { light, depth_m: None, up: None, prior: None, is_cubed: false }
    }

    /// Renders the panorama at a view's pose and size.
    pub fn panorama(&self, view: &NovelView) -> RadianceImage {
        let (width, height) = (view.radiance.width(), view.radiance.height());
        self.panorama_at(view.position_m, width, height, |direction| view.rotation * direction)
    }

    /// Renders a panorama at a position; `turn` maps its directions to the photo's frame.
    pub(crate) fn panorama_at(
        &self,
        position_m: Vec3,
        width: usize,
        height: usize,
        turn: impl Fn(Vec3) -> Vec3,
    ) -> RadianceImage {
        let direction = |x: usize, y: usize| turn(lo_geometry::pixel_direction(x, y, width, height));
        let panorama = match &self.light {
            EstimatedLight::Map(map) => {
                RadianceImage::from_fn(width, height, |x, y| sample_equirectangular(map, direction(x, y)))
            }
            EstimatedLight::Predicted(prediction) => {
                let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
                let directions: Vec<Vec3> = pixels.map(|(x, y)| direction(x, y)).collect();
                RadianceImage::new(width, height, prediction.radiance(position_m, &directions))
            }
            EstimatedLight::Octree { tracer, .. } => {
                // Half of the pixel pitch, as in `ConeTracer::panorama`.
                let tan_half_angle = (std::f32::consts::PI / width as f32).tan();
                let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
                let cones: Vec<Cone> = pixels
                    .map(|(x, y)| Cone { origin: position_m, direction: direction(x, y), tan_half_angle })
                    .collect();
                let samples = trace(tracer, position_m, &cones);
                RadianceImage::new(width, height, samples.iter().map(|sample| sample.radiance).collect())
            }
        };
        if self.is_cubed { baseline::cubed(&panorama) } else { panorama }
    }
}

/// Traces cones from `eye`.
pub(crate) fn trace(tracer: &Tracer, eye: Vec3, cones: &[Cone]) -> Vec<lo_cone::ConeSample> {
    let mut samples = vec![lo_cone::ConeSample::default(); cones.len()];
    match tracer {
        Tracer::Octree(viewers) => viewers.at(eye).trace_batch(cones, &mut samples),
        Tracer::Scene(viewers) => viewers.trace_batch(eye, cones, &mut samples),
    }
    samples
}

/// Rotates a view's panorama into the photo's frame.
pub(crate) fn in_photo_frame(view: &NovelView) -> RadianceImage {
    let (width, height) = (view.radiance.width(), view.radiance.height());
    let inverse = view.rotation.inverse();
    RadianceImage::from_fn(width, height, |x, y| {
        let direction = lo_geometry::pixel_direction(x, y, width, height);
        sample_equirectangular(&view.radiance, inverse * direction)
    })
}

/// Estimates a scene by the networks.
///
/// # Errors
/// Missing inputs; failed estimates.
pub fn estimate_scene(sample: &Sample, input: Option<DepthInput>, tools: &Tools) -> Result<Arc<Estimate>, MethodError> {
    let options = network_options(tools)?;
    Ok(tools.estimator.estimate(input_of(sample, input)?, &options, &mut lo_events::ignore)?.into())
}

fn network_options(tools: &Tools) -> Result<EstimateOptions, MethodError> {
    let networks = tools.estimator.networks().ok_or(MethodError::Needs("weights"))?;
    Ok(EstimateOptions {
        completion: Some(Completion::Network),
        octree_depth: Some(tools.octree_depth.max(networks.config.depth)),
        seed: tools.seed,
        ..EstimateOptions::default()
    })
}

fn input_of(sample: &Sample, input: Option<DepthInput>) -> Result<Input, MethodError> {
    Ok(match input {
        Some(input) => Input::MeasuredDepth(frame(sample, input)?),
        None => Input::Photo { photo: Photo::Srgb8(sample.photo.clone()), camera: sample.camera },
    })
}

/// Estimates by the networks with a panorama prior.
///
/// With a panorama of another room, also measures whether observed leaves stay unchanged.
fn with_panorama(
    sample: &Sample,
    input: Option<DepthInput>,
    which: PriorPanorama,
    tools: &Tools,
) -> Result<MethodOutput, MethodError> {
    let is_foreign = which == PriorPanorama::OfAnotherRoom;
    let known = if is_foreign { tools.foreign } else { tools.known };
    let needed = if is_foreign { "a panorama of another room" } else { "a panorama of the room" };
    let known = known.ok_or(MethodError::Needs(needed))?;
    let options = network_options(tools)?;
    let panorama = Some(known.prior(which == PriorPanorama::YawGiven)?);
    let with = EstimateOptions { panorama, ..options.clone() };
    let mut is_warned = false;
    let mut on_event = |event| {
        is_warned |= is_mismatch(&event);
        std::ops::ControlFlow::Continue(())
    };
    let scene = tools.estimator.estimate(input_of(sample, input)?, &with, &mut on_event)?;
    let mut seen_unchanged = None;
    if is_foreign {
        let plain = tools.estimator.estimate(input_of(sample, input)?, &options, &mut lo_events::ignore)?;
        seen_unchanged = Some(unchanged(&plain.light, &scene.light));
    }
    let prior = scene.panorama.as_ref().map(|panorama| PriorAlignment {
        confidence: panorama.source.confidence.into(),
        yaw_error_deg: (!is_foreign).then(|| yaw_error_deg(panorama.source.yaw_deg, known.yaw_rad())),
        exposure_ev: panorama.source.exposure_ev.into(),
        is_warned,
        seen_unchanged,
    });
    Ok(MethodOutput { prior, ..MethodOutput::as_estimated(scene.into()) })
}

fn frame(sample: &Sample, input: DepthInput) -> Result<Frame, MethodError> {
    let (depth_m, needed) = match input {
        DepthInput::True => (&sample.depth_m, "true depth"),
        DepthInput::Sensor => (&sample.sensor_depth_m, "sensor depth"),
    };
    let depth_m = depth_m.clone().ok_or(MethodError::Needs(needed))?;
    Ok(Frame::new(Photo::Srgb8(sample.photo.clone()), depth_m, sample.camera, 1.0)?)
}

/// Builds the true octree of all surface points, in the smallest cube around them.
pub(crate) fn true_octree(sample: &Sample, tools: &Tools) -> Result<LightOctree, MethodError> {
    let bounds = sample.points.iter().map(|point| (point.position_m, point.position_m));
    let (low, high) =
        bounds.reduce(|(low, high), (a, b)| (low.min(a), high.max(b))).ok_or(MethodError::Needs("surface points"))?;
    // Enlarged slightly: the far sides of a cube are exclusive.
    let cube = Cube::centred(0.5 * (low + high), 1.001 * (high - low).max_element().max(0.01));
    let filled = |point_area_m2| TrueLeaves::Filled { point_area_m2 };
    let leaves = sample.point_area_m2.map_or(TrueLeaves::All, filled);
    Ok(lo_dataset::true_octree(
        &sample.points,
        leaves,
        cube,
        tools.octree_depth,
        EstimateOptions::default().full_depth,
    )?)
}
