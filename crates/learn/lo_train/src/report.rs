use lo_events::Figure;
use serde::Serialize;

/// Means over held-out scenes, of estimates as they are used. PSNR: [`lo_metrics::panorama_psnr_db`] of panoramas from novel places, mean over the
/// photo's panoramas. What does not apply is missing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ValidationReport {
    /// Photos, each of another scene.
    pub photos: usize,
    /// Mean of |predicted − true| / true depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_abs_rel: Option<f32>,
    /// Share of the pixels whose predicted depth is within a factor of 1.25.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth_delta1: Option<f32>,
    /// Median angle between the up that the photo tells and the true one, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up_error_deg: Option<f32>,
    /// Median difference of the field of view along the longer side that the photo tells from the true one, degrees.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub fov_error_deg: Option<f32>,
    /// PSNR of the global lighting decoder's panorama at the camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global_psnr_db: Option<f32>,
    /// PSNR with true depth as measured depth.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub psnr_db: Option<f32>,
    /// PSNR from the photo alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub photo_alone_psnr_db: Option<f32>,
    /// PSNR of the true octree, as deep as the estimate's and in the same cube: the bound.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub true_octree_psnr_db: Option<f32>,
    /// PSNR of the completion `shell` with true depth: what has to be beaten.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shell_psnr_db: Option<f32>,
    /// Share of the nodes that are rightly taken for occupied or empty, along the true octree.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub split_accuracy: Option<f32>,
    /// Light on objects under the panoramas from the photo alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub light_on_objects: Option<LightReport>,
    /// Light on objects under the global lighting decoder's panorama at the camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub global_light_on_objects: Option<LightReport>,
}

/// Figures of [`lo_metrics::LightOnObjects`], of each photo the mean over its panoramas: medians over photos, means
/// over photos of those of the unseen part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct LightReport {
    /// Largest over smallest irradiance, in stops.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub contrast_stops: Option<f32>,
    /// The contrast under the truth.
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
    /// What applies, under the names of the fields; those of the global decoder's light begin with `global_`.
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
        let known = figures.into_iter().chain(lights).filter_map(|(name, value)| Some((name, value?)));
        known.map(|(name, value)| Figure { name, value: value.into() }).collect()
    }
}
