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
}

impl ValidationReport {
    /// What applies, under the names of the fields.
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
        let known = figures.into_iter().filter_map(|(name, value)| Some((name, value?)));
        known.map(|(name, value)| Figure { name, value: value.into() }).collect()
    }
}
