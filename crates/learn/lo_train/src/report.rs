use lo_events::Figure;
use serde::Serialize;

/// Figures on held-out scenes, from full estimates. Figures that do not apply are missing.
///
/// PSNR is the mean of [`lo_metrics::panorama_psnr_db`] over the panoramas of a photo, taken at novel positions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ValidationReport {
    /// Number of photos, each of a different scene.
    pub photos: usize,
    /// Mean of |predicted − true| / true depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_abs_rel: Option<f32>,
    /// Share of pixels with predicted depth within a factor of 1.25 of the truth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_delta1: Option<f32>,
    /// Median angle between predicted and true up, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_error_deg: Option<f32>,
    /// Median absolute error of the predicted field of view along the longer side, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fov_error_deg: Option<f32>,
    /// PSNR of the single map at the camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global_psnr_db: Option<f32>,
    /// PSNR with true depth as input.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psnr_db: Option<f32>,
    /// PSNR from the photo alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photo_alone_psnr_db: Option<f32>,
    /// PSNR of the true octree of the estimate's depth and cube: the upper bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_octree_psnr_db: Option<f32>,
    /// PSNR of the completion `shell` with true depth: the baseline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shell_psnr_db: Option<f32>,
    /// Share of nodes of the true octree that are classified correctly as occupied or empty.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_accuracy: Option<f32>,
    /// Light on objects under the panoramas estimated from the photo alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_on_objects: Option<LightReport>,
    /// Light on objects under the single map at the camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global_light_on_objects: Option<LightReport>,
}

/// Figures of [`lo_metrics::LightOnObjects`], averaged over the panoramas of each photo.
///
/// Figures of the unseen part are means over photos, all others medians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LightReport {
    /// Largest ÷ smallest irradiance over normals, in stops.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contrast_stops: Option<f32>,
    /// Contrast under the true panorama.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_contrast_stops: Option<f32>,
    /// Angle between the vector irradiances, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub vector_deg: Option<f32>,
    /// `|log₂|` of the ratio of mean irradiances.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub level_log2: Option<f32>,
    /// Relative si-RMSE of the unseen part's irradiance.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen_irradiance_relative_si_rmse: Option<f32>,
    /// Angle between the colours of the unseen part's irradiance, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unseen_irradiance_angular_deg: Option<f32>,
}

impl ValidationReport {
    /// Returns the available figures under their field names; those of the single map start with `global_`.
    pub fn figures(&self) -> Vec<Figure> {
        let figures = [
            ("photos", Some(self.photos as f32)),
            ("depth_abs_rel", self.depth_abs_rel),
            ("depth_delta1", self.depth_delta1),
            ("up_error_deg", self.up_error_deg),
            ("fov_error_deg", self.fov_error_deg),
            ("global_psnr_db", self.global_psnr_db),
            ("psnr_db", self.psnr_db),
            ("photo_alone_psnr_db", self.photo_alone_psnr_db),
            ("true_octree_psnr_db", self.true_octree_psnr_db),
            ("shell_psnr_db", self.shell_psnr_db),
            ("split_accuracy", self.split_accuracy),
        ];
        let light = self.light_on_objects.unwrap_or_default();
        let global = self.global_light_on_objects.unwrap_or_default();
        let lights = [
            ("contrast_stops", light.contrast_stops),
            ("true_contrast_stops", light.true_contrast_stops),
            ("vector_deg", light.vector_deg),
            ("level_log2", light.level_log2),
            ("unseen_irradiance_relative_si_rmse", light.unseen_irradiance_relative_si_rmse),
            ("unseen_irradiance_angular_deg", light.unseen_irradiance_angular_deg),
            ("global_contrast_stops", global.contrast_stops),
            ("global_true_contrast_stops", global.true_contrast_stops),
            ("global_vector_deg", global.vector_deg),
            ("global_level_log2", global.level_log2),
            ("global_unseen_irradiance_relative_si_rmse", global.unseen_irradiance_relative_si_rmse),
            ("global_unseen_irradiance_angular_deg", global.unseen_irradiance_angular_deg),
        ];
        let available = figures.into_iter().chain(lights).filter_map(|(name, value)| Some((name, value?)));
        available.map(|(name, value)| Figure { name, value: value.into() }).collect()
    }
}
