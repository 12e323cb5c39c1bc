//! Figures of one method on one sample.

use lo_dataset::{Sample, TrueLeaves, observed_mask, true_octree};
use lo_geometry::Vec3;
use lo_imaging::{RadianceImage, luminance};
use lo_metrics::{
    DepthErrors, LightOnObjects, MAX_PSNR_DB, PsnrCurve, angular_error_deg, log_rmse, psnr_db, relative_si_rmse, rmse,
    si_rmse, solid_angles_sr,
};
use serde::Serialize;

use crate::spheres::{Material, SphereView, Transport, single_sphere};
use crate::{EstimatedLight, MethodOutput, ProtocolRenders, SplitAgreement, coherence};

/// Named figures; figures that do not apply to a sample are missing.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Scores(Vec<(String, f64)>);

impl Scores {
    /// Returns a figure by its name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.0.iter().find(|(own, _)| own == name).map(|(_, value)| *value)
    }

    /// Returns all figures, in the order of the tables.
    pub fn iter(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().map(|(name, value)| (&name[..], *value))
    }

    /// Adds a figure, if there is a value.
    pub fn add(&mut self, name: impl Into<String>, value: Option<f64>) {
        self.0.extend(value.map(|value| (name.into(), value)));
    }

    /// Returns the mean of each figure over the scores that have it, in order of first appearance.
    pub fn mean<'a>(all: impl IntoIterator<Item = &'a Self>) -> Self {
        let mut sums: Vec<(&str, f64, usize)> = Vec::new();
        for scores in all {
            for (name, value) in scores.iter() {
                match sums.iter_mut().find(|(own, ..)| *own == name) {
                    Some((_, sum, count)) => (*sum, *count) = (*sum + value, *count + 1),
                    None => sums.push((name, value, 1)),
                }
            }
        }
        Self(sums.into_iter().map(|(name, sum, count)| (name.to_owned(), sum / count as f64)).collect())
    }
}

impl FromIterator<(String, f64)> for Scores {
    fn from_iter<I: IntoIterator<Item = (String, f64)>>(figures: I) -> Self {
        Self(figures.into_iter().collect())
    }
}

/// Computes scores. Holds the precomputed spheres.
#[derive(Debug)]
pub struct Scorer {
    spheres: Vec<(&'static str, Transport)>,
    protocol: Option<ProtocolRenders>,
}

impl Scorer {
    /// Creates a scorer with three spheres of the project, or with those of a published protocol.
    pub fn new(protocol: Option<ProtocolRenders>) -> Self {
        // Seen from the direction opposite the panorama's centre; 72 or 288 pixels across.
        let view = SphereView { eye: Vec3::new(0.0, 0.0, 16.0), focal_px: 2300.0 };
        let spheres = [
            ("diffuse", Material::Diffuse { albedo: 1.0 }),
            ("silver", Material::Metal { reflectance: 1.0, roughness: 0.3271 }),
            ("mirror", Material::Mirror { reflectance: 1.0 }),
        ];
        let spheres = match protocol {
            None => spheres.map(|(name, material)| (name, single_sphere(material, view))).into(),
            Some(_) => Vec::new(),
        };
        Self { spheres, protocol }
    }

    /// Renders the panoramas of an estimate at the sample's views, in order.
    pub fn panoramas(sample: &Sample, estimate: &MethodOutput) -> Vec<RadianceImage> {
        sample.views.iter().map(|view| estimate.panorama(view)).collect()
    }

    /// Scores an estimate by its [`panoramas`](Self::panoramas) and by its depth, up vector and octree.
    pub fn score(&self, sample: &Sample, estimate: &MethodOutput, panoramas: &[RadianceImage]) -> Scores {
        let mut scores = self.score_panoramas(sample, panoramas);
        scene(&mut scores, sample, estimate);
        scores
    }

    /// Scores panoramas of the sample's views, of the same sizes: means over the views.
    ///
    /// True panoramas that are clipped at white give only figures of what a screen shows.
    pub fn score_panoramas(&self, sample: &Sample, panoramas: &[RadianceImage]) -> Scores {
        let views: Vec<Scores> = sample
            .views
            .iter()
            .zip(panoramas)
            .map(|(view, got)| {
                let mut scores = Scores::default();
                let angles = solid_angles_sr(got.width(), got.height());
                let seen = observed_mask(sample, view);
                let clipped = sample.has_clipped_panoramas();
                parts(&mut scores, &view.radiance, got, &angles, seen.as_deref(), clipped);
                if clipped {
                    return scores;
                }
                light_on_objects(&mut scores, &view.radiance, got, seen.as_deref());
                for (name, sphere) in &self.spheres {
                    let (a, b) = (sphere.render(&view.radiance), sphere.render(got));
                    let ones = vec![1.0; a.pixels().len()];
                    scores.add(format!("{name}_rmse"), rmse(&a, &b, &ones));
                    scores.add(format!("{name}_si_rmse"), si_rmse(&a, &b, &ones));
                    scores.add(format!("{name}_angular_deg"), angular_error_deg(&a, &b, &ones));
                    scores.add(format!("{name}_stops"), stops(&a, &b));
                }
                let protocol = self.protocol.iter().flat_map(|protocol| protocol.figures(&view.radiance, got));
                protocol.for_each(|(name, value)| scores.add(name, Some(value)));
                scores
            })
            .collect();
        let mut scores = Scores::mean(&views);
        if !sample.has_clipped_panoramas() {
            scores.add("coherence", coherence(sample.views.iter().zip(panoramas)));
        }
        scores
    }
}

/// Returns |log₂| of the ratio of mean luminances, an exposure error; `None` if one image is black.
fn stops(truth: &RadianceImage, got: &RadianceImage) -> Option<f64> {
    let sum = |image: &RadianceImage| image.pixels().iter().map(|&rgb| f64::from(luminance(rgb))).sum::<f64>();
    let (truth, got) = (sum(truth), sum(got));
    (truth > 0.0 && got > 0.0).then(|| (got / truth).log2().abs())
}

/// Adds the figures of a whole panorama and of its seen and unseen parts; of one that is clipped at white, only those
/// of what a screen shows.
fn parts(
    scores: &mut Scores,
    truth: &RadianceImage,
    got: &RadianceImage,
    angles: &[f32],
    seen: Option<&[bool]>,
    clipped: bool,
) {
    let part_weights = |wanted: bool| -> Option<Vec<f32>> {
        let part = |(&angle, &seen): (&f32, &bool)| if seen == wanted { angle } else { 0.0 };
        seen.map(|seen| angles.iter().zip(seen).map(part).collect())
    };
    for (prefix, weights) in
        [("", Some(angles.to_vec())), ("seen_", part_weights(true)), ("unseen_", part_weights(false))]
    {
        let Some(weights) = weights else { continue };
        let db = |curve| psnr_db(truth, got, &weights, curve).map(|db| db.min(MAX_PSNR_DB));
        scores.add(format!("{prefix}psnr_db"), db(PsnrCurve::ClippedSrgb));
        if clipped {
            continue;
        }
        scores.add(format!("{prefix}reinhard_psnr_db"), db(PsnrCurve::Reinhard));
        scores.add(format!("{prefix}rmse"), rmse(truth, got, &weights));
        scores.add(format!("{prefix}log_rmse"), log_rmse(truth, got, &weights));
        scores.add(format!("{prefix}si_rmse"), si_rmse(truth, got, &weights));
        scores.add(format!("{prefix}relative_si_rmse"), relative_si_rmse(truth, got, &weights));
        scores.add(format!("{prefix}angular_deg"), angular_error_deg(truth, got, &weights));
    }
    if clipped {
        // As Lighthouse and those who compare with it count: every pixel alike.
        let alike = vec![1.0; angles.len()];
        scores.add("pixel_psnr_db", psnr_db(truth, got, &alike, PsnrCurve::ClippedSrgb).map(|db| db.min(MAX_PSNR_DB)));
    }
}

/// Adds the figures of light on objects.
fn light_on_objects(scores: &mut Scores, truth: &RadianceImage, got: &RadianceImage, seen: Option<&[bool]>) {
    let Some(light) = LightOnObjects::compare(truth, got, seen) else { return };
    scores.add("contrast_stops", Some(light.contrast_stops));
    scores.add("true_contrast_stops", Some(light.true_contrast_stops));
    scores.add("anisotropy", Some(light.anisotropy));
    scores.add("true_anisotropy", Some(light.true_anisotropy));
    scores.add("vector_deg", light.vector_deg);
    scores.add("level_log2", Some(light.level_log2));
    scores.add("unseen_irradiance_relative_si_rmse", light.unseen_relative_si_rmse);
    scores.add("unseen_irradiance_angular_deg", light.unseen_angular_deg);
}

/// Adds the figures of depth, up vector, prior and octree structure.
fn scene(scores: &mut Scores, sample: &Sample, estimate: &MethodOutput) {
    let depth = sample.depth_m.as_ref().zip(estimate.depth_m.as_ref());
    if let Some(errors) = depth.and_then(|(truth, got)| DepthErrors::compare(truth, got)) {
        scores.add("depth_abs_rel", Some(errors.abs_rel));
        scores.add("depth_scaled_abs_rel", Some(errors.scaled_abs_rel));
        scores.add("depth_scale", Some(errors.scale));
        scores.add("depth_constant_abs_rel", Some(errors.constant_abs_rel));
        scores.add("depth_rmse_m", Some(errors.rmse_m));
        for (i, delta) in errors.delta.into_iter().enumerate() {
            scores.add(format!("depth_delta{}", i + 1), Some(delta));
        }
    }
    let up = sample.up.zip(estimate.up);
    scores.add("up_deg", up.map(|(truth, got)| f64::from(truth.angle_between(got)).to_degrees()));
    if let Some(prior) = &estimate.prior {
        scores.add("prior_confidence", Some(prior.confidence));
        scores.add("prior_yaw_error_deg", prior.yaw_error_deg);
        scores.add("prior_exposure_ev", Some(prior.exposure_ev.abs()));
        scores.add("prior_warned", Some(f64::from(u8::from(prior.is_warned))));
        scores.add("prior_seen_unchanged", prior.seen_unchanged);
    }
    let EstimatedLight::Octree { octree, .. } = &estimate.light else { return };
    if sample.points.is_empty() {
        return;
    }
    let (depth, full_depth) = (octree.octree.depth(), octree.octree.full_depth());
    let truth = true_octree(&sample.points, TrueLeaves::All, octree.cube, depth, full_depth).ok();
    if let Some(agreement) = truth.and_then(|truth| SplitAgreement::compare(&truth, octree)) {
        scores.add("split_accuracy", Some(agreement.accuracy));
        scores.add("split_precision", Some(agreement.precision));
        scores.add("split_recall", Some(agreement.recall));
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{DepthInput, Method, ProfileBuilder, Tools, testing};
    use lo_estimate::Estimator;

    #[test]
    fn methods_are_ranked_as_they_must_be_in_a_known_room() {
        let sample = testing::box_room();
        let mut builder = ProfileBuilder::default();
        builder.add(&sample);
        let profile = builder.finish("the same room").unwrap();
        let tools = Tools {
            estimator: &Estimator::without_networks(),
            profile: Some(&profile),
            octree_depth: 6,
            seed: 0,
            known: None,
            foreign: None,
            baselines: &[],
        };
        let scorer = Scorer::new(None);
        let score = |method: Method| {
            let estimate = method.estimate(&sample, &tools).unwrap();
            let panoramas = Scorer::panoramas(&sample, &estimate);
            scorer.score(&sample, &estimate, &panoramas)
        };
        let [octree, shell, mean, mirrored] =
            [Method::TrueOctree, Method::Shell(DepthInput::True), Method::MeanColour, Method::Mirrored].map(score);
        let figure = |scores: &Scores, name: &str| scores.get(name).unwrap_or_else(|| panic!("no {name}"));
        assert!(figure(&octree, "psnr_db") > 25.0, "{octree:?}");
        assert!(figure(&shell, "seen_psnr_db") > figure(&mean, "seen_psnr_db") + 5.0, "{shell:?} {mean:?}");
        assert!(figure(&mirrored, "seen_psnr_db") > figure(&mean, "seen_psnr_db"));
        for scores in [&shell, &mean, &mirrored] {
            assert!(figure(&octree, "unseen_si_rmse") < figure(scores, "unseen_si_rmse"), "{scores:?}");
            assert!(figure(&octree, "coherence") < figure(scores, "coherence"));
            assert!(figure(&octree, "diffuse_rmse") < figure(scores, "diffuse_rmse"));
            assert!(figure(&octree, "diffuse_stops") < figure(scores, "diffuse_stops"));
            assert!(figure(&octree, "level_log2") < figure(scores, "level_log2"));
            let unseen = "unseen_irradiance_relative_si_rmse";
            assert!(figure(&octree, unseen) < figure(scores, unseen));
        }
        let contrast = |scores: &Scores| figure(scores, "contrast_stops");
        assert!((contrast(&octree) / figure(&octree, "true_contrast_stops") - 1.0).abs() < 0.05, "{octree:?}");
        assert!(contrast(&mean) < 2e-3 && mean.get("vector_deg").is_none() && figure(&octree, "vector_deg") < 5.0);
        // The true octree agrees with itself, and true depth has no error.
        assert_eq!(octree.get("split_accuracy"), Some(1.0));
        assert!(figure(&shell, "split_accuracy") < 1.0, "its assumed floor and ceiling heights differ");
        assert!(figure(&shell, "depth_abs_rel") < 1e-6 && figure(&shell, "depth_delta1") == 1.0);
        assert_eq!((mean.get("depth_abs_rel"), mean.get("split_accuracy"), mean.get("up_deg")), (None, None, None));
        assert!(figure(&shell, "up_deg") < 1.0, "floor and walls are observed");
        assert!(matches!(Method::Network(None).estimate(&sample, &tools), Err(crate::MethodError::Needs("weights"))));
        let bare = testing::sample();
        let error = Method::Shell(DepthInput::True).estimate(&bare, &tools).err().unwrap();
        assert_eq!(error.to_string(), "needs true depth");
    }

    #[test]
    fn clipped_panoramas_give_only_figures_of_what_a_screen_shows() {
        let mut sample = testing::box_room();
        let key = Sample::CLIPPED_PANORAMAS.to_owned();
        sample.metadata.insert(key, true.into());
        for view in &mut sample.views {
            // A lamp, clipped as an 8-bit file has it.
            view.radiance[(9, 3)] = [1.0; 3];
        }
        let truth: Vec<RadianceImage> = sample.views.iter().map(|view| view.radiance.clone()).collect();
        let mut bright = truth.clone();
        bright.iter_mut().for_each(|map| map[(9, 3)] = [500.0; 3]);
        let tools = Tools {
            estimator: &Estimator::without_networks(),
            profile: None,
            octree_depth: 5,
            seed: 0,
            known: None,
            foreign: None,
            baselines: &[],
        };
        let estimate = Method::MeanColour.estimate(&sample, &tools).unwrap();
        let scores = Scorer::new(None).score(&sample, &estimate, &bright);
        assert_eq!(scores.get("pixel_psnr_db"), Some(MAX_PSNR_DB), "brighter than white is shown as white");
        let of_light: Vec<&str> = scores.iter().map(|(name, _)| name).filter(|name| !name.contains("depth")).collect();
        assert_eq!(of_light, ["psnr_db", "seen_psnr_db", "unseen_psnr_db", "pixel_psnr_db"]);
        // By hand: every channel of one of 10 pixels is off by half of sRGB's range.
        let map = |value: f32| RadianceImage::new(10, 1, [vec![[value; 3]], vec![[0.0; 3]; 9]].concat());
        let mut found = Scores::default();
        parts(&mut found, &map(0.214_041_14), &map(0.0), &[1.0; 10], None, true);
        assert!((found.get("pixel_psnr_db").unwrap() - -10.0 * (0.25f64 / 10.0).log10()).abs() < 1e-4);
    }

    #[test]
    fn stops_are_those_of_an_exposure() {
        let grey = |value: f32| RadianceImage::new(2, 1, vec![[value; 3], [3.0 * value; 3]]);
        assert!((stops(&grey(1.0), &grey(0.25)).unwrap() - 2.0).abs() < 1e-6);
        assert!((stops(&grey(1.0), &grey(8.0)).unwrap() - 3.0).abs() < 1e-6);
        assert_eq!((stops(&grey(1.0), &grey(0.0)), stops(&grey(0.0), &grey(1.0))), (None, None));
    }

    #[test]
    fn means_take_what_there_is() {
        let scores = |values: &[(&str, f64)]| Scores(values.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect());
        let mean = Scores::mean(&[scores(&[("a", 1.0), ("b", 2.0)]), scores(&[("a", 3.0)])]);
        assert_eq!(mean, scores(&[("a", 2.0), ("b", 2.0)]));
    }
}
