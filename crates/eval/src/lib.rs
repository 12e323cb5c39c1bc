//! Evaluation of estimated lighting: metrics, spheres, published protocols, baselines, tables (SPEC §9).
//!
//! `docs/evaluation.md` tells what the figures mean and where the protocols come from.

mod baseline;
mod coherence;
mod depth;
mod method;
mod metrics;
mod profile;
mod protocol;
mod scores;
mod seen;
mod sheet;
pub mod spheres;
mod split;
mod summary;
#[cfg(test)]
mod testing;
mod walk;

pub use coherence::coherence;
pub use depth::DepthErrors;
pub use method::{DepthInput, Estimate, Light, Method, MethodError, Tools};
pub use metrics::{PsnrCurve, angular_error_deg, log_rmse, psnr_db, relative_si_rmse, rmse, si_rmse, solid_angles_sr};
pub use profile::{Profile, ProfileBuilder, ProfileError};
pub use protocol::{Protocol, ProtocolCrops, ProtocolRenders};
pub use scores::{Scorer, Scores};
pub use seen::seen_mask;
pub use sheet::Sheet;
pub use split::SplitAgreement;
pub use summary::{Cost, Outcome, Summary};
pub use walk::{Walk, walk};
