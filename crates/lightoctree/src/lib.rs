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
//! document.write("room.scene".as_ref(), "my program")?;
//! // 3. Light.
//! let lit = document.lit(LightPurpose::Panorama)?;
//! // 4. Render, one metre in front of the camera.
//! let panorama = SceneRenderer::new(&lit).panorama(Vec3::NEG_Z, 256, 128);
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
//! 3. **Lit scene.** [`Document::lit`] applies the light for a [`LightPurpose`] and returns a [`LitScene`], the only
//!    type that renders. [`FittedLight`] does so repeatedly, for interactive edits.
//! 4. **Render, insert, export.**
//!    - [`SceneRenderer`] renders panoramas and single cones. [`render_probes`] renders panoramas at many points, for
//!      example those of [`probe_grid`].
//!    - [`insert::Inserter`] renders objects into the photo, with shadows and reflections. [`Models`] loads their
//!      meshes.
//!    - [`export::write`] writes PLY, glTF or USD.
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
//! # Modules
//!
//! Most modules are re-exported crates of the workspace. The hidden module `nets` contains the networks' internals, for
//! training and tests. Its types follow the deep-learning framework and are exempt from this crate's versioning. Only
//! [`Networks`], [`CheckpointError`] and [`LightError`] of it are public API.

mod builtin;
mod builtin_names;
mod document;
mod model_error;
mod models;
mod probe_grid;
mod probes;

pub use builtin::builtin_model;
pub use builtin_names::{BUILTIN_MODELS, BUILTIN_PREFIX};
pub use document::{Document, DocumentError, LightPurpose};
pub use lo_completion as completion;
pub use lo_completion::{PanoramaError, PanoramaPrior};
pub use lo_cone as cone;
#[cfg(feature = "depth-models")]
pub use lo_depth_models as depth_models;
pub use lo_estimate::{
    AppliedLight, DEFAULT_HFOV_DEG, DEFAULT_OCTREE_DEPTH, DepthSource, EstimateError, EstimateOptions, Estimator,
    Exposures, FittedLight, Input, LightReport, LightingError, PhotoRequest, PhotoSun, PredictedDepth, ResolvedPhoto,
    ShadowError, check_white, sun_from_photo, supported_sun,
};
pub use lo_events as events;
pub use lo_events::{Cancelled, Event, OnEvent, Stage, Warning};
pub use lo_export as export;
pub use lo_geometry as geometry;
pub use lo_imaging as imaging;
pub use lo_insert as insert;
pub use lo_lights as lights;
pub use lo_lookup::{Detail, LevelFrame, PhotoLookup, SceneRenderer};
pub use lo_mesh as mesh;
#[doc(hidden)]
pub use lo_nets as nets;
pub use lo_nets::Networks;
pub use lo_nets::checkpoint::CheckpointError;
pub use lo_nets::light::LightError;
pub use lo_octree as octree;
pub use lo_scene as scene;
pub use lo_scene::{CameraSource, Estimate, GuessedLight, LightEffect, LightMode, LightTuning, LitScene};
pub use model_error::ModelError;
pub use models::Models;
pub use probe_grid::probe_grid;
pub use probes::render_probes;
