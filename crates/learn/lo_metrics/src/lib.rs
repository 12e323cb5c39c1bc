//! Metrics of estimated light and depth, shared by the validation of training and by evaluation.
//!
//! `docs/evaluation.md` explains the figures.

mod depth;
mod irradiance;
mod radiance;

pub use depth::DepthErrors;
pub use irradiance::{LightDistribution, LightOnObjects, MAX_CONTRAST_STOPS};
pub use radiance::{
    MAX_PSNR_DB, PsnrCurve, angular_error_deg, log_rmse, panorama_psnr_db, psnr_db, relative_si_rmse, rmse, si_rmse,
    solid_angles_sr,
};
