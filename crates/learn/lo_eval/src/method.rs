//! What is compared: the networks, the shell, and baselines.

use lightoctree::cone::{self, Cone, Viewers};
use lightoctree::scene::{Completion, Frame, FrameError, Scene};
use lightoctree::{
    EstimateError, EstimateOptions, Estimator, Input, LightMode, LightTuning, PanoramaError, SharpViewers,
};
use lo_dataset::{NovelView, Sample, TrueLeaves};
use lo_geometry::{Cube, Vec3};
use lo_imaging::{DepthMap, Photo, RadianceImage, sample_equirectangular};
use lo_octree::{LightOctree, OctreeError};

use crate::prior::{is_doubt, unchanged, yaw_error_deg};
use crate::{KnownPanorama, PriorAlignment, Profile, baseline};

/// Depth that a method is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthInput {
    /// The scene's own.
    True,
    /// As a sensor measures it.
    Sensor,
}

/// A way to the light around a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The networks, from the photo alone or with depth.
    Network(Option<DepthInput>),
    /// The same with the expected energy, as `envmap` shows it.
    Expected(Option<DepthInput>),
    /// The same with plausible lamps, as objects are lit.
    FittedLamps(Option<DepthInput>),
    /// Networks, and the photo's detail around what is inferred, as reflections of objects have it.
    Detail(Option<DepthInput>),
    /// Completion by planes.
    Shell(DepthInput),
    /// The photo's mean colour in all directions.
    MeanColour,
    /// The training set's mean vertical profile times the photo's mean colour.
    Profile,
    /// The training set's mean linear vertical profile as bright as the photo, with half of the chroma of its mean
    /// colour.
    FixedShape,
    /// The photo mirrored until the sphere is full.
    Mirrored,
    /// The one panorama that the global decoder makes of the photo, wherever the probe is (Gardner et al. 2017's kind).
    SingleMap,
    /// The networks' panorama from the photo alone with its luminance cubed, its integral kept and half of its chroma.
    NetworkCubed,
    /// The true octree: what a perfect network of this depth would reach.
    TrueOctree,
    /// The networks, from the photo alone or with depth, and a panorama of the room from another place than those that are scored.
    PanoramaPrior(Option<DepthInput>, PriorPanorama),
    /// That panorama as the light around every point.
    PanoramaEverywhere,
}

/// Which panorama a method knows, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PriorPanorama {
    /// One of the room, with its yaw; its exposure is found.
    YawGiven,
    /// The same, with its yaw to be found.
    YawFound,
    /// One of another room, as if it were of this one, with its yaw to be found.
    OfAnotherRoom,
}

/// What methods need beside the photo.
#[derive(Clone, Copy, Debug)]
pub struct Tools<'a> {
    /// `Network`, `NetworkCubed` and `SingleMap` need one with networks.
    pub estimator: &'a Estimator,
    /// For `Profile` and `FixedShape`.
    pub profile: Option<&'a Profile>,
    /// Depth of the octrees; those of networks are at least as deep as these say.
    pub octree_depth: u32,
    /// Of the networks' random choices.
    pub seed: u64,
    /// A panorama of the sample's room, for `PanoramaPrior` and `PanoramaEverywhere`.
    pub known: Option<&'a KnownPanorama>,
    /// A panorama of another room, for `PanoramaPrior` that takes one.
    pub foreign: Option<&'a KnownPanorama>,
}

/// Why a method gave nothing for a sample.
#[derive(Debug, thiserror::Error)]
pub enum MethodError {
    /// The sample or the tools lack something.
    #[error("needs {0}")]
    Needs(&'static str),
    /// Photo and depth do not make a frame.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The estimate failed.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// The octree cannot be built.
    #[error(transparent)]
    Octree(#[from] OctreeError),
    /// The panorama that is known is none.
    #[error(transparent)]
    Panorama(#[from] PanoramaError),
    /// An object cannot be put into the photo.
    #[error("{0}")]
    Insertion(String),
}

/// What a method says about a room.
pub struct Estimate {
    /// The light.
    pub light: EstimatedLight,
    /// The depth of the photo that the method found or used.
    pub depth_m: Option<DepthMap>,
    /// Which way it takes to be up, in the photo's frame, of unit length.
    pub up: Option<Vec3>,
    /// How the panorama that it knows was laid.
    pub prior: Option<PriorAlignment>,
    /// Whether its panoramas are cubed, as those of [`Method::NetworkCubed`] are.
    pub is_cubed: bool,
}

/// EstimatedLight around every point.
pub enum EstimatedLight {
    /// By cone tracing.
    Octree {
        /// The octree.
        octree: Box<LightOctree>,
        /// Ready to be trace.
        tracer: Tracer,
    },
    /// The same panorama, in the photo's frame, wherever the probe is.
    Map(RadianceImage),
}

/// What is trace.
pub enum Tracer {
    /// An octree alone.
    Octree(Viewers),
    /// A scene: where its photo shows what is met, the photo.
    Scene(Box<SharpViewers>),
}

impl Method {
    /// All that need no panorama of the room, in the order of the tables: those that run where nothing else is said.
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

    /// Those that know a panorama of the room. With any of them, every method is scored on the panoramas at other places alone.
    pub const WITH_PANORAMA: [Self; 6] = [
        Self::PanoramaEverywhere,
        Self::PanoramaPrior(None, PriorPanorama::YawGiven),
        Self::PanoramaPrior(None, PriorPanorama::YawFound),
        Self::PanoramaPrior(Some(DepthInput::Sensor), PriorPanorama::YawGiven),
        Self::PanoramaPrior(Some(DepthInput::True), PriorPanorama::YawGiven),
        Self::PanoramaPrior(None, PriorPanorama::OfAnotherRoom),
    ];

    /// Those with another light than the octree's own.
    pub const WITH_LAMPS: [Self; 6] = [
        Self::Expected(None),
        Self::Expected(Some(DepthInput::Sensor)),
        Self::Expected(Some(DepthInput::True)),
        Self::FittedLamps(None),
        Self::FittedLamps(Some(DepthInput::Sensor)),
        Self::FittedLamps(Some(DepthInput::True)),
    ];

    /// Methods with the photo's detail around what is inferred.
    pub const WITH_DETAIL: [Self; 3] =
        [Self::Detail(None), Self::Detail(Some(DepthInput::Sensor)), Self::Detail(Some(DepthInput::True))];

    /// Its name in tables and on the command line.
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
            Self::PanoramaPrior(_, PriorPanorama::OfAnotherRoom) => "panorama-of-another-room",
            Self::PanoramaPrior(None, PriorPanorama::YawGiven) => "panorama-prior",
            Self::PanoramaPrior(Some(DepthInput::Sensor), PriorPanorama::YawGiven) => "panorama-prior-sensor",
            Self::PanoramaPrior(Some(DepthInput::True), PriorPanorama::YawGiven) => "panorama-prior-true",
            Self::PanoramaPrior(None, PriorPanorama::YawFound) => "panorama-prior-found",
            Self::PanoramaPrior(Some(DepthInput::Sensor), PriorPanorama::YawFound) => "panorama-prior-found-sensor",
            Self::PanoramaPrior(Some(DepthInput::True), PriorPanorama::YawFound) => "panorama-prior-found-true",
        }
    }

    /// Whether it knows a panorama of the room, or of another one.
    pub fn knows_panorama(self) -> bool {
        matches!(self, Self::PanoramaEverywhere | Self::PanoramaPrior(..))
    }

    /// Whether it takes a panorama of another room.
    pub fn takes_foreign_panorama(self) -> bool {
        matches!(self, Self::PanoramaPrior(_, PriorPanorama::OfAnotherRoom))
    }

    /// Whether the tools at hand suffice, whatever the sample has.
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
            _ => true,
        }
    }

    /// Whether a sample has what the method takes.
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

    /// Estimates the light of a sample's room from its photo, and from depth where the method takes any.
    ///
    /// # Errors
    /// What the sample or the tools lack; estimates that fail.
    pub fn estimate(self, sample: &Sample, tools: &Tools) -> Result<Estimate, MethodError> {
        let map = |map: RadianceImage| Ok(Estimate::of_light(EstimatedLight::Map(map)));
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
                // With networks they would tell it which way is up.
                let estimator = Estimator::without_networks();
                let options = EstimateOptions { octree_depth: Some(tools.octree_depth), ..EstimateOptions::default() };
                let input = Input::MeasuredDepth(frame(sample, input)?);
                Ok(Estimate::of_scene(estimator.estimate(input, &options, &mut lightoctree::events::ignore)?))
            }
            Self::NetworkCubed => {
                Ok(Estimate { is_cubed: true, ..Estimate::of_scene(estimate_scene(sample, None, tools)?) })
            }
            Self::Network(input) => Ok(Estimate::of_scene(estimate_scene(sample, input, tools)?)),
            Self::Expected(input) => lit(sample, input, tools, LightMode::Expected).map(Estimate::of_scene),
            Self::FittedLamps(input) => lit(sample, input, tools, LightMode::Plausible).map(Estimate::of_scene),
            Self::Detail(input) => {
                let scene = lit(sample, input, tools, LightMode::Expected)?;
                let viewers = SharpViewers::new(&scene).with_detail(&scene);
                Ok(Estimate::seen_by(scene, viewers))
            }
            Self::PanoramaEverywhere => {
                let known = tools.known.filter(|known| !known.is_scored);
                let known = known.ok_or(MethodError::Needs("another panorama than the one that is scored"))?;
                map(in_photo_frame(&known.view))
            }
            Self::PanoramaPrior(input, which) => with_panorama(sample, input, which, tools),
            Self::TrueOctree => Ok(Estimate::of_octree(true_octree(sample, tools)?)),
        }
    }
}

/// The part of a profile that `FixedShape` needs.
const LINEAR: &str = "linear_factors in the profile, which --make-profile writes";

/// The networks' scene by the light of a mode.
fn lit(sample: &Sample, input: Option<DepthInput>, tools: &Tools, mode: LightMode) -> Result<Scene, MethodError> {
    let mut scene = estimate_scene(sample, input, tools)?;
    let lit = lightoctree::light_up(&mut scene, mode, &LightTuning::default());
    lit.expect("neither edits nor a white pixel are asked for");
    Ok(scene)
}

impl Estimate {
    fn of_scene(scene: Scene) -> Self {
        let viewers = SharpViewers::new(&scene);
        Self::seen_by(scene, viewers)
    }

    fn seen_by(scene: Scene, viewers: SharpViewers) -> Self {
        let tracer = Tracer::Scene(Box::new(viewers));
        let light = EstimatedLight::Octree { octree: Box::new(scene.light), tracer };
        let up = scene.room.map(|room| room.up);
        Self { depth_m: Some(scene.frame.depth_m), up, ..Self::of_light(light) }
    }

    fn of_octree(octree: LightOctree) -> Self {
        let tracer = Tracer::Octree(Viewers::new(&octree));
        Self::of_light(EstimatedLight::Octree { octree: Box::new(octree), tracer })
    }

    /// Wraps light of which no more is known.
    pub fn of_light(light: EstimatedLight) -> Self {
        Self { light, depth_m: None, up: None, prior: None, is_cubed: false }
    }

    /// The panorama at a view's place, in its orientation and of its size.
    pub fn panorama(&self, view: &NovelView) -> RadianceImage {
        let (width, height) = (view.radiance.width(), view.radiance.height());
        self.panorama_at(view.position_m, width, height, |direction| view.rotation * direction)
    }

    /// A panorama whose directions become the photo's by `turn`.
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
            EstimatedLight::Octree { tracer, .. } => {
                // half of the pixel's pitch, as of `ConeTracer::panorama`
                let tan_half_angle = (std::f32::consts::PI / width as f32).tan();
                let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
                let cones: Vec<Cone> = places
                    .map(|(x, y)| Cone { origin: position_m, direction: direction(x, y), tan_half_angle })
                    .collect();
                let samples = trace(tracer, position_m, &cones);
                RadianceImage::new(width, height, samples.iter().map(|sample| sample.radiance).collect())
            }
        };
        if self.is_cubed { baseline::cubed(&panorama) } else { panorama }
    }
}

/// What cones from `eye` see.
pub(crate) fn trace(tracer: &Tracer, eye: Vec3, cones: &[Cone]) -> Vec<cone::ConeSample> {
    let mut samples = vec![cone::ConeSample::default(); cones.len()];
    match tracer {
        Tracer::Octree(viewers) => viewers.at(eye).trace_batch(cones, &mut samples),
        Tracer::Scene(viewers) => viewers.trace_batch(eye, cones, &mut samples),
    }
    samples
}

/// A view's panorama with the photo's directions.
pub(crate) fn in_photo_frame(view: &NovelView) -> RadianceImage {
    let (width, height) = (view.radiance.width(), view.radiance.height());
    let inverse = view.rotation.inverse();
    RadianceImage::from_fn(width, height, |x, y| {
        let direction = lo_geometry::pixel_direction(x, y, width, height);
        sample_equirectangular(&view.radiance, inverse * direction)
    })
}

/// The scene that the networks make of a sample.
///
/// # Errors
/// What the sample or the tools lack; estimates that fail.
pub(crate) fn estimate_scene(sample: &Sample, input: Option<DepthInput>, tools: &Tools) -> Result<Scene, MethodError> {
    let options = network_options(tools)?;
    Ok(tools.estimator.estimate(input_of(sample, input)?, &options, &mut lightoctree::events::ignore)?)
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

/// By the networks and a panorama. With one of another room it is also looked at what became of the light that the photo saw.
fn with_panorama(
    sample: &Sample,
    input: Option<DepthInput>,
    which: PriorPanorama,
    tools: &Tools,
) -> Result<Estimate, MethodError> {
    let is_foreign = which == PriorPanorama::OfAnotherRoom;
    let known = if is_foreign { tools.foreign } else { tools.known };
    let needed = if is_foreign { "a panorama of another room" } else { "a panorama of the room" };
    let known = known.ok_or(MethodError::Needs(needed))?;
    let options = network_options(tools)?;
    let panorama = Some(known.prior(which == PriorPanorama::YawGiven)?);
    let with = EstimateOptions { panorama, ..options.clone() };
    let mut is_warned = false;
    let mut hear = |event| {
        is_warned |= is_doubt(&event);
        std::ops::ControlFlow::Continue(())
    };
    let scene = tools.estimator.estimate(input_of(sample, input)?, &with, &mut hear)?;
    let mut seen_unchanged = None;
    if is_foreign {
        let plain = tools.estimator.estimate(input_of(sample, input)?, &options, &mut lightoctree::events::ignore)?;
        seen_unchanged = Some(unchanged(&plain.light, &scene.light));
    }
    let prior = scene.panorama.as_ref().map(|laid| PriorAlignment {
        confidence: laid.source.confidence.into(),
        yaw_error_deg: (!is_foreign).then(|| yaw_error_deg(laid.source.yaw_deg, known.yaw_rad())),
        exposure_ev: laid.source.exposure_ev.into(),
        is_warned,
        seen_unchanged,
    });
    Ok(Estimate { prior, ..Estimate::of_scene(scene) })
}

fn frame(sample: &Sample, input: DepthInput) -> Result<Frame, MethodError> {
    let (depth_m, needed) = match input {
        DepthInput::True => (&sample.depth_m, "true depth"),
        DepthInput::Sensor => (&sample.sensor_depth_m, "sensor depth"),
    };
    let depth_m = depth_m.clone().ok_or(MethodError::Needs(needed))?;
    Ok(Frame::new(Photo::Srgb8(sample.photo.clone()), depth_m, sample.camera, 1.0)?)
}

/// Of all surface points, in the smallest cube that holds them.
pub(crate) fn true_octree(sample: &Sample, tools: &Tools) -> Result<LightOctree, MethodError> {
    let bounds = sample.points.iter().map(|point| (point.position_m, point.position_m));
    let (low, high) =
        bounds.reduce(|(low, high), (a, b)| (low.min(a), high.max(b))).ok_or(MethodError::Needs("surface points"))?;
    // a point on the far side would be outside
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
