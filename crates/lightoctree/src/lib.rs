//! Indoor lighting from one photo: the public Rust API.
//!
//! The input is a photo of a room, optionally with depth. The result is a sparse voxel octree that holds the HDR
//! radiance of the whole room. From it come environment maps at any 3D point, photos with inserted objects, and 3D
//! scenes for other programs.
//!
//! # From a photo to an environment map
//!
//! ```no_run
//! use lightoctree::{
//!     Document, EstimateOptions, Estimator, Input, LightPurpose, SceneRenderer, events, geometry::Vec3, imaging,
//! };
//!
//! // 1. Estimate.
//! let photo = imaging::read_photo("room.jpg")?;
//! let estimator = Estimator::shipped()?;
//! let (camera, _source) = estimator.camera_of(&photo)?;
//! let input = Input::Photo { photo: photo.photo, camera };
//! let estimate = estimator.estimate(input, &EstimateOptions::default(), &mut events::ignore)?;
//! // 2. Save.
//! let document = Document::new(estimate);
//! document.write("room.scene", "my program")?;
//! // 3. Light.
//! let lit = document.lit(LightPurpose::Panorama)?;
//! // 4. Render, one metre in front of the camera.
//! let panorama = SceneRenderer::new(&lit).panorama(Vec3::NEG_Z, 256, 128);
//! imaging::write_radiance("light.exr", &panorama.radiance, &imaging::ExrOptions::default())?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! 1. **Estimate.** An [`Estimator`] turns an [`Input`] into an [`Estimate`]: octree, camera, depth, planes of the
//!    room. It is immutable.
//!    - [`Input::MeasuredDepth`] takes a [`scene::Frame`] of a photo and a sensor's depth map.
//!    - [`Input::PredictedDepth`] takes depth from another network. With the feature `depth-models`,
//!      `Estimator::predict_depth` runs one from an ONNX file.
//!    - [`Input::Photos`] takes several photos with depth and poses.
//!    - [`Estimator::resolve`] determines camera and depth from a [`PhotoRequest`], as the command line does.
//! 2. **Document.** A [`Document`] is an estimate with the user's edits of lights and the inserted objects. It is read
//!    from and written to a `.scene` file, which is self-contained. [`Document::lights`] lists the lights to edit.
//! 3. **Lit scene.** [`Document::lit`] applies the light for a [`LightPurpose`] and returns a [`LitScene`], the input
//!    of renderers and exports. [`FittedLight`] does so repeatedly, for interactive edits.
//! 4. **Render, insert, export.**
//!    - [`SceneRenderer`] renders panoramas and single cones. [`render_probes`] renders panoramas at many points, for
//!      example those of [`probe_grid`].
//!    - [`insert::Inserter`] renders objects into the photo, with shadows and reflections. [`Models`] loads their
//!      meshes.
//!    - [`export::write`] writes PLY, glTF or USD. [`export_web`] writes a web page.
//!
//! The programs in `crates/lightoctree/examples` show each of these: `estimate`, `external_depth`, `envmap`, `insert`,
//! `probes`.
//!
//! # Conventions
//!
//! - Lengths are in metres. The world frame is the first photo's camera: +X right, +Y up, −Z along the optical axis.
//! - Radiance is linear RGB with Rec. 709 primaries. 1 is the photo's white at [`scene::Frame::exposure`] 1.
//! - Depth is distance along the optical axis, 0 where there is no reading.
//! - Pixel coordinates are column and row from the upper left corner; pixel centres are at half integers.
//! - Panoramas are equirectangular, twice as wide as high. Their centre faces −Z, and +Y is up.
//!
//! # Events
//!
//! Long functions take an [`OnEvent`] handler. It receives stages, progress and warnings as [`Event`]s, and cancels the
//! job by returning [`ControlFlow::Break`](std::ops::ControlFlow::Break). [`events::ignore`] ignores all events.
//!
//! # Feature flags
//!
//! | feature | default | effect |
//! | --- | --- | --- |
//! | `weights` | yes | embeds the trained weights, 18 MB: `Estimator::shipped` |
//! | `depth-models` | yes | third-party depth models in ONNX files: `depth_models`, `Estimator::predict_depth` |
//!
//! # Stability
//!
//! `public_items.txt` beside `Cargo.toml` lists every public item, and a test compares it with the source. The crates
//! `lo_*` that this crate consists of have no stable API.

mod builtin;
mod builtin_names;
mod document;
mod model_error;
mod models;
mod probe_grid;
mod probes;
mod web;

// 1. Estimate.
pub use lo_completion::{PanoramaError, PanoramaPrior};
pub use lo_estimate::{
    DepthSource, EstimateError, EstimateOptions, Estimator, Exposures, Input, PhotoRequest, PredictedDepth,
    ResolvedPhoto,
};
pub use lo_nets::Networks;
pub use lo_nets::checkpoint::CheckpointError;
pub use lo_scene::{CameraSource, Estimate};

// 2. Document.
pub use builtin::builtin_model;
pub use builtin_names::{BUILTIN_MODELS, BUILTIN_PREFIX};
pub use document::{Document, DocumentError, LightPurpose};
pub use model_error::ModelError;
pub use models::{Models, PosedModels};

// 3. Lit scene.
pub use lo_estimate::{AppliedLight, FittedLight, LightReport, LightingError};
pub use lo_scene::{InferredLight, KnownLength, KnownLengthError, LightMode, LightTuning, LitScene};

// 4. Render.
pub use lo_lookup::{Detail, LevelFrame, SceneRenderer};
pub use probe_grid::probe_grid;
pub use probes::render_probes;
pub use web::{WebExportError, export_web};

pub use events::{Cancelled, Event, OnEvent, Stage, Warning};

/// Progress, warnings and cancellation of long functions.
///
/// A [`Warning`] has a message. [`Event::warning`] returns it as the enum that defines it, with its values.
///
/// ```no_run
/// use std::ops::ControlFlow;
/// use std::time::{Duration, Instant};
/// use lightoctree::{EstimateOptions, Estimator, Event, Input, imaging};
///
/// let photo = imaging::read_photo("room.jpg")?;
/// let estimator = Estimator::shipped()?;
/// let (camera, _source) = estimator.camera_of(&photo)?;
/// let deadline = Instant::now() + Duration::from_secs(5);
/// let mut on_event = |event: Event| {
///     if let Event::Warning(warning) = &event {
///         eprintln!("{warning}");
///     }
///     // Cancels the estimate, which then returns `EstimateError::Cancelled`.
///     if Instant::now() > deadline { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
/// };
/// let input = Input::Photo { photo: photo.photo, camera };
/// let estimate = estimator.estimate(input, &EstimateOptions::default(), &mut on_event)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod events {
    pub use lo_completion::{CompletionWarning, PanoramaWarning};
    pub use lo_estimate::EstimateWarning;
    pub use lo_events::{Cancelled, Event, Figure, OnEvent, Stage, Warning, ignore};
    pub use lo_insert::InsertWarning;
    pub use lo_nets::light::NetworkWarning;
}

/// Vectors, cameras and coordinate frames.
///
/// ```no_run
/// use lightoctree::geometry::{Camera, Vec3};
///
/// // 640 × 480 pixels, 60° wide.
/// let camera = Camera::from_hfov_deg(60.0, 640, 480)?;
/// let point = camera.unproject(320.0, 240.0, 2.0);
/// assert!((point - Vec3::new(0.0, 0.0, -2.0)).length() < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod geometry {
    pub use lo_geometry::{
        Camera, CameraError, Cube, Distortion, Mat3, Orientation, Plane, Quat, Ray, RigidTransform, Vec2, Vec3,
        direction_from_uv, pixel_solid_angle_sr, uv_from_direction,
    };
}

/// Photos, HDR images and depth maps: readers, writers, light of a panorama.
///
/// ```no_run
/// use lightoctree::geometry::Vec3;
/// use lightoctree::imaging::{self, Sh9, ToneCurve};
///
/// let panorama = imaging::read_radiance("studio.exr")?;
/// let floor_irradiance = Sh9::project(&panorama).irradiance(Vec3::Y);
/// let main_light = imaging::main_light(&panorama);
/// imaging::write_tone_mapped("studio.png", &panorama, ToneCurve::Aces, 0.0, "my program")?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod imaging {
    pub use lo_imaging::{
        BlackBars, ChannelGroup, ColorProfile, DepthMap, EncodedPhoto, EnvironmentLayout, ExrOptions, GainMap,
        GainMapParameters, Image, ImageError, MainLight, PartialPanorama, Photo, PhotoEncoding, PhotoFile, PhotoNote,
        RadianceImage, Sh9, SpecialProjection, ToneCurve, depth_from_bytes, encode_exr, encode_photo,
        inverse_depth_from_bytes, luminance, main_light, photo_from_bytes, radiance_from_bytes, read_depth,
        read_inverse_depth, read_photo, read_radiance, write_depth, write_photo, write_radiance, write_tone_mapped,
    };
}

/// The parts of an [`Estimate`].
///
/// ```no_run
/// use lightoctree::Document;
///
/// let estimate = Document::read("room.scene")?.estimate;
/// // The observed surface in the middle of the photo, in metres.
/// let (width, height) = (estimate.frame.depth_m.width(), estimate.frame.depth_m.height());
/// let point = estimate.frame.point(width / 2, height / 2);
/// let floor = estimate.room.as_ref().and_then(|room| room.floor());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod scene {
    pub use lo_scene::{
        Completion, DistortedPhoto, EstimateOrigin, ExpectedLight, Frame, FrameError, ObjectDisplay, OtherPhoto,
        PanoramaContribution, PosedFrame, Room, RoomPlane, SceneError, Side, Undistortion, UndistortionError, poses,
    };
}

/// The sparse voxel octree of radiance.
///
/// ```no_run
/// use lightoctree::Document;
///
/// // As estimated; `Document::lit` applies expected light and edits.
/// let light = &Document::read("room.scene")?.estimate.light;
/// for leaf in light.octree.leaf_nodes() {
///     let centre_m = lightoctree::octree::node_middle_m(light.cube, leaf.depth, light.octree.key(leaf));
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod octree {
    pub use lo_octree::{
        BuildReport, LeafNode, Level, LightOctree, MAX_DEPTH, NamedTensor, Octree, OctreeError, OctreeHeader,
        OctreeStats, Provenance, RadiancePoint, key_from_xyz, node_middle_m, write_tensors, xyz_from_key,
    };
}

/// Voxel cone tracing.
///
/// ```no_run
/// use lightoctree::cone::{Cone, ConeTracer, Settings};
/// use lightoctree::geometry::Vec3;
/// use lightoctree::{Document, LightPurpose};
///
/// let lit = Document::read("room.scene")?.lit(LightPurpose::Panorama)?;
/// let tracer = ConeTracer::new(&lit.light, Settings::default())?;
/// let cone = Cone { origin: Vec3::ZERO, direction: Vec3::NEG_Z, tan_half_angle: 0.01 };
/// let sample = tracer.trace(&cone);
/// println!("{:?} at {:.2} m", sample.radiance, sample.distance_m);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod cone {
    pub use lo_cone::{Cone, ConeSample, ConeTracer, Gradients, Rendering, SampleGradient, Settings, TracerError};
}

/// The lights of a room, and edits of them.
///
/// ```no_run
/// use lightoctree::Document;
/// use lightoctree::lights::{EmitterEdit, LightChange};
///
/// let mut document = Document::read("room.scene")?;
/// // Switches the strongest light off.
/// if let Some(light) = document.lights().first() {
///     let change = LightChange { on: false, ..LightChange::NONE };
///     let added = document.light_edits.change(&light.id, light.position_m.unwrap_or_default(), change);
///     assert!(added, "too many edits");
/// }
/// document.write("dark.scene", "my program")?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod lights {
    pub use lo_completion::{ExpectedLightReport, LampFit};
    pub use lo_estimate::{PhotoSun, ShadowError, sun_from_photo, supported_sun};
    pub use lo_lights::{EngineLight, LightEstimate, LightKind, LightLayout, LightOrigin, LightsError, ListedLight};
    pub use lo_scene::{
        AddedLight, AnalyticLight, EmitterEdit, LightChange, LightColor, LightEdits, LightEffect, LightShape,
    };
}

/// Triangle meshes with materials.
///
/// ```no_run
/// use lightoctree::mesh::{LoadOptions, MaterialSpec, Model, PreparedModel};
///
/// let mut model = Model::load("vase.glb", &LoadOptions::default())?;
/// model.override_material(&MaterialSpec::parse("chrome")?, "".as_ref())?;
/// let prepared = PreparedModel::new(model);
/// println!("{:.2} m high", prepared.bounds().size().y);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod mesh {
    pub use lo_mesh::{
        AnimatedModel, Bounds, LoadOptions, Material, MaterialSpec, MeshError, MeshWarning, Model, PreparedModel,
        Texture,
    };
}

/// Objects in the photo.
///
/// ```no_run
/// use lightoctree::insert::{Align, Inserter, Instance, Lighting, Placement, Quality};
/// use lightoctree::mesh::PreparedModel;
/// use lightoctree::{Document, LightPurpose, builtin_model, events, imaging};
///
/// let document = Document::read("room.scene")?;
/// let sphere = PreparedModel::new(builtin_model("sphere")?);
/// let placement = Placement::rest_on_pixel(&document.estimate, 320.0, 400.0, Align::Gravity)?.scaled(0.2);
/// let lit = document.lit(LightPurpose::Objects { at_m: placement.position_m })?;
/// let inserter = Inserter::new(&lit, Lighting::Octree, Quality::Normal)?;
/// let composite = inserter.render(&[Instance::new(&sphere, placement)], &mut events::ignore)?;
/// imaging::write_photo("inserted.png", &composite.image, "my program")?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod insert {
    pub use lo_insert::{
        Align, Anchor, Base, Composite, Cryptomatte, Ground, InsertError, Inserter, Instance, Interpolation, Keyframe,
        Layout, LayoutObject, Lighting, Passes, Path, PathSource, Placement, Plate, Quality, Unit, surface_at_pixel,
    };
}

/// Footage: the room of a scene seen by a moving camera.
///
/// ```no_run
/// use lightoctree::footage::Shot;
/// use lightoctree::geometry::RigidTransform;
/// use lightoctree::insert::{Align, Inserter, Instance, Lighting, Placement, Quality};
/// use lightoctree::mesh::PreparedModel;
/// use lightoctree::{Document, LightPurpose, builtin_model, events, imaging};
///
/// let document = Document::read("room.scene")?;
/// let sphere = PreparedModel::new(builtin_model("sphere")?);
/// let placement = Placement::rest_on_pixel(&document.estimate, 320.0, 400.0, Align::Gravity)?.scaled(0.2);
/// let lit = document.lit(LightPurpose::Objects { at_m: placement.position_m })?;
/// let inserter = Inserter::new(&lit, Lighting::Octree, Quality::Normal)?;
/// // From the camera of each plate to one world; the scene is that of plate 0.
/// let track = vec![RigidTransform::IDENTITY; 24];
/// let mut shot = Shot::new(&lit, &track, 0)?;
/// for index in 0..track.len() {
///     let photo = imaging::read_photo(format!("shot_{index:04}.jpg"))?.photo;
///     let camera = lit.frame.camera.resized(photo.width() as u32, photo.height() as u32);
///     let plate = shot.plate(index, photo, camera, None, None)?;
///     let composite = inserter.on_plate(&plate).render(&[Instance::new(&sphere, placement)], &mut events::ignore)?;
///     imaging::write_photo(format!("out_{index:04}.png"), &composite.image, "my program")?;
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod footage {
    pub use lo_footage::{ScaleFit, ScaleSource, SceneSurfaces, Shot, ShotError, ShotWarning, likeness};
}

/// 3D scenes for other programs.
///
/// ```no_run
/// use lightoctree::export::{self, Content, Format, Options};
/// use lightoctree::{Document, LightPurpose};
///
/// let lit = Document::read("room.scene")?.lit(LightPurpose::Export)?;
/// let options = Options { format: Format::Usda, content: Content::Leaves, level: true, probes: &[], lights: &[] };
/// export::write(&lit, &options, "room.usda")?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub mod export {
    pub use lo_export::{Content, ExportError, Format, LightProbe, Options, Report, WebReport, write};
}

/// Third-party depth networks in ONNX files.
///
/// ```no_run
/// use std::sync::Arc;
///
/// use lightoctree::depth_models::DepthModel;
/// use lightoctree::{DepthSource, EstimateOptions, Estimator, PhotoRequest, events, imaging};
///
/// let photo = imaging::read_photo("room.jpg")?;
/// let depth = DepthSource::Model(Arc::new(DepthModel::read("depth_anything_v2.onnx", None)?));
/// let estimator = Estimator::shipped()?;
/// let resolved = estimator.resolve(PhotoRequest { photo, camera: None, distortion: None, depth }, &mut events::ignore)?;
/// let estimate = estimator.estimate(resolved.input, &EstimateOptions::default(), &mut events::ignore)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "depth-models")]
pub mod depth_models {
    pub use lo_depth_models::{DepthModel, FieldOfView, Geometry, ModelConfig, ModelError, Prediction};
}
