//! Indoor lighting from one photo: the public Rust API.
//!
//! ```no_run
//! use lightoctree::{
//!     Document, EstimateOptions, Estimator, Input, LightPurpose, SceneRenderer, events, geometry::Vec3, imaging,
//! };
//!
//! let photo = imaging::read_photo("room.jpg")?;
//! let estimator = Estimator::shipped()?;
//! let (camera, _source) = estimator.camera_of(&photo)?;
//! let input = Input::Photo { photo: photo.photo, camera };
//! let estimate = estimator.estimate(input, &EstimateOptions::default(), &mut events::ignore)?;
//! let document = Document::new(estimate);
//! document.write("room.scene".as_ref(), "my program")?;
//! let lit = document.lit(LightPurpose::Panorama)?;
//! let panorama = SceneRenderer::new(&lit).panorama(Vec3::NEG_Z, 256, 128);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! An [`Estimator`] makes an [`Estimate`] of photos. A [`Document`] is an estimate with the user's edits: only it saves. A [`LitScene`] is a document in the
//! light for a purpose: only it renders.
//!
//! With depth, [`Input::MeasuredDepth`] takes a [`scene::Frame`] of photo and depth map. With the feature `depth-models`, `Estimator::predict_depth` takes a depth
//! network of others as an ONNX file. What the program says on its way comes as
//! [`Event`]s, and whoever hears them can end the job.
//!
//! The crates below are re-exported whole: [`geometry`], [`imaging`], [`octree`], [`cone`], [`mesh`], [`scene`],
//! [`completion`], [`events`], [`insert`] and [`export`]. Of the networks, [`Networks`] and its errors are public. The hidden module `nets` is the
//! rest of them, for training and tests: its types change with the deep-learning stack, and are no part of this crate's version.

mod builtin;
mod document;
mod model_error;
mod models;
mod place;
mod probes;

pub use builtin::{BUILTIN_MODELS, BUILTIN_PREFIX, builtin_model};
pub use document::{Document, DocumentError, LightPurpose};
pub use lo_completion as completion;
pub use lo_completion::{PanoramaError, PanoramaPrior};
pub use lo_cone as cone;
#[cfg(feature = "depth-models")]
pub use lo_depth_models as depth_models;
pub use lo_estimate::{
    DEFAULT_HFOV_DEG, DEFAULT_OCTREE_DEPTH, DepthSource, EstimateError, EstimateOptions, Estimator, Exposures,
    FittedLight, Input, LaidLight, LightReport, LightingError, PhotoRequest, PhotoSun, PredictedDepth, ResolvedPhoto,
    ShadowError, check_white, sun_of_photo, supported_sun,
};
pub use lo_events as events;
pub use lo_events::{Cancelled, Event, OnEvent, Stage, Warning};
pub use lo_export as export;
pub use lo_geometry as geometry;
pub use lo_imaging as imaging;
pub use lo_insert as insert;
pub use lo_lights;
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
pub use place::probe_grid;
pub use probes::render_probes;
