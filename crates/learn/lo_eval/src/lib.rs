//! Evaluation of estimated lighting: metrics, spheres, published protocols, baselines, tables (`docs/method.md` §9).
//!
//! `docs/evaluation.md` explains the figures and the sources of the protocols.

mod baseline;
mod coherence;
mod eval_error;
mod evaluation;
mod external;
mod insertion;
pub mod memory;
mod method;
mod method_error;
mod prior;
mod profile;
mod protocol;
mod report;
mod scores;
mod sheet;
pub mod spheres;
mod split;
pub mod stages;
mod summary;
#[cfg(test)]
mod testing;
mod walk;

pub use coherence::coherence;
pub use eval_error::EvalError;
pub use evaluation::{Evaluation, PhotoSelection};
pub use external::{External, ExternalError, ListedPhoto, ListedView, VIEWS_FILE, ViewList};
pub use insertion::{InsertionEvaluation, InsertionMethod, LampMode, LevelSurfaces, ObjectLighting};
pub use method::{DepthInput, EstimatedLight, Method, MethodOutput, PriorPanorama, Tools, Tracer, estimate_scene};
pub use method_error::MethodError;
pub use prior::{KnownPanorama, MIN_PANORAMA_DISTANCE_M, PriorAlignment};
pub use profile::{Profile, ProfileBuilder, ProfileError};
pub use protocol::{Protocol, ProtocolCrops, ProtocolRenders};
pub use report::Report;
pub use scores::{Scorer, Scores};
pub use sheet::Sheet;
pub use split::SplitAgreement;
pub use summary::{Cost, Outcome, Summary};
pub use walk::{Walk, walk};
