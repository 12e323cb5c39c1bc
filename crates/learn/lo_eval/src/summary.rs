//! Tables over samples and methods.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use serde::Serialize;
use serde_json::json;

use crate::{MethodError, Scores};

/// Outcome of one method on one sample.
#[derive(Debug)]
pub struct Outcome {
    /// Identifier of the sample.
    pub sample: String,
    /// Identifier of its scene.
    pub scene: String,
    /// Name of the method, or of another program.
    pub method: String,
    /// Lighting condition; each condition gets its own tables.
    pub condition: Option<&'static str>,
    /// Figures, or the reason for having none.
    pub scores: Result<Scores, MethodError>,
    /// Measured time and memory; not reproducible. `None` for other programs.
    pub cost: Option<Cost>,
}

/// Time and memory of a method on a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// Time from photo to light, seconds.
    pub estimate_s: f64,
    /// Time per panorama of the sample's size, seconds.
    pub panorama_s: f64,
    /// Peak resident memory of the process, MiB, if the system reports it.
    pub peak_mib: Option<f64>,
}

/// All outcomes of an evaluation.
#[derive(Debug, Default)]
pub struct Summary {
    outcomes: Vec<Outcome>,
}

/// Results of one method: its row of the tables.
struct MethodRow<'a> {
    method: &'a str,
    samples: usize,
    failures: BTreeMap<String, usize>,
    /// Scene → mean of its samples.
    scenes: Vec<(&'a str, Scores)>,
    /// Mean over the scenes.
    mean: Scores,
    cost: Option<Cost>,
}

/// Title of a table, and its columns: figure, heading, digits.
type Table = (&'static str, &'static [(&'static str, &'static str, usize)]);

const TABLES: [Table; 11] = [
    (
        "Panorama",
        &[
            ("psnr_db", "PSNR dB ↑", 2),
            ("reinhard_psnr_db", "PSNR dB, L/(1+L) ↑", 2),
            ("pixel_psnr_db", "PSNR dB, every pixel alike ↑", 2),
            ("log_rmse", "log-RMSE ↓", 3),
            ("rmse", "RMSE ↓", 3),
            ("si_rmse", "si-RMSE ↓", 3),
            ("relative_si_rmse", "relative si-RMSE ↓", 3),
            ("angular_deg", "angle ° ↓", 2),
        ],
    ),
    (
        "Seen and unseen parts",
        &[
            ("seen_psnr_db", "seen PSNR ↑", 2),
            ("seen_si_rmse", "seen si-RMSE ↓", 3),
            ("seen_angular_deg", "seen ° ↓", 2),
            ("unseen_psnr_db", "unseen PSNR ↑", 2),
            ("unseen_log_rmse", "unseen log-RMSE ↓", 3),
            ("unseen_si_rmse", "unseen si-RMSE ↓", 3),
            ("unseen_relative_si_rmse", "unseen relative ↓", 3),
            ("unseen_angular_deg", "unseen ° ↓", 2),
        ],
    ),
    (
        "Light on objects",
        &[
            ("contrast_stops", "contrast, stops: median (quartiles)", 2),
            ("true_contrast_stops", "of the truth", 2),
            ("anisotropy", "anisotropy: median", 2),
            ("true_anisotropy", "of the truth", 2),
            ("vector_deg", "direction °: median ↓", 1),
            ("level_log2", "level, log₂: median ↓", 2),
            ("unseen_irradiance_relative_si_rmse", "unseen irradiance, relative si-RMSE ↓", 3),
            ("unseen_irradiance_angular_deg", "unseen irradiance ° ↓", 2),
        ],
    ),
    (
        "Spheres",
        &[
            ("diffuse_rmse", "diffuse RMSE ↓", 3),
            ("diffuse_si_rmse", "diffuse si-RMSE ↓", 3),
            ("diffuse_angular_deg", "diffuse ° ↓", 2),
            ("diffuse_stops", "diffuse stops ↓", 2),
            ("silver_rmse", "silver RMSE ↓", 3),
            ("silver_si_rmse", "silver si-RMSE ↓", 3),
            ("silver_angular_deg", "silver ° ↓", 2),
            ("mirror_rmse", "mirror RMSE ↓", 3),
            ("mirror_si_rmse", "mirror si-RMSE ↓", 3),
            ("mirror_angular_deg", "mirror ° ↓", 2),
        ],
    ),
    (
        "Spheres, normalised",
        &[
            ("diffuse_normalised_rmse", "diffuse ↓", 3),
            ("silver_normalised_rmse", "silver ↓", 3),
            ("mirror_normalised_rmse", "mirror ↓", 3),
        ],
    ),
    (
        "Array of spheres",
        &[
            ("array_rmse", "RMSE ↓", 3),
            ("array_si_rmse", "si-RMSE ↓", 3),
            ("array_angular_deg", "angle ° ↓", 2),
            ("array_psnr_db", "PSNR dB ↑", 2),
        ],
    ),
    (
        "Coherence",
        &[
            ("coherence", "L_SC ↓", 4),
            ("walk_step_ratio", "largest ÷ median step ↓", 2),
            ("walk_parallax_px", "parallax error px ↓", 2),
        ],
    ),
    (
        "Depth and octree",
        &[
            ("depth_abs_rel", "abs-rel ↓", 3),
            ("depth_scaled_abs_rel", "scale-corrected ↓", 3),
            ("depth_scale", "ẑ ÷ z", 2),
            ("depth_constant_abs_rel", "a constant's", 3),
            ("depth_rmse_m", "RMSE m ↓", 3),
            ("depth_delta1", "δ1 ↑", 3),
            ("depth_delta2", "δ2 ↑", 3),
            ("depth_delta3", "δ3 ↑", 3),
            ("up_deg", "up ° ↓", 1),
            ("split_accuracy", "split accuracy ↑", 3),
            ("split_precision", "precision ↑", 3),
            ("split_recall", "recall ↑", 3),
        ],
    ),
    (
        "Objects",
        &[
            ("object_diffuse_rmse", "diffuse RMSE ↓", 3),
            ("object_diffuse_si_rmse", "diffuse si-RMSE ↓", 3),
            ("object_rough_rmse", "rough RMSE ↓", 3),
            ("object_rough_si_rmse", "rough si-RMSE ↓", 3),
            ("object_mirror_rmse", "mirror RMSE ↓", 3),
            ("object_mirror_si_rmse", "mirror si-RMSE ↓", 3),
            ("object_pole_rmse", "pole RMSE ↓", 3),
            ("object_pole_si_rmse", "pole si-RMSE ↓", 3),
        ],
    ),
    (
        "Shadows and dominant light",
        &[
            ("shadow_rms", "shadow RMS ↓", 4),
            ("shadow_diffuse_rms", "of the sphere ↓", 4),
            ("shadow_pole_rms", "of the pole ↓", 4),
            ("shadow_gradient_correlation", "correlation of its gradient ↑", 3),
            ("shadow_strength_near", "strength, to 1 radius", 2),
            ("shadow_strength_far", "strength, 1 to 6 radii", 2),
            ("dominant_deg", "direction ° (median) ↓", 1),
            ("dominant_log2_intensity", "|log₂ intensity| (median) ↓", 2),
        ],
    ),
    (
        "Known panorama",
        &[
            ("prior_confidence", "confidence", 3),
            ("prior_yaw_error_deg", "yaw ° ↓", 1),
            ("prior_exposure_ev", "exposure EV ↓", 2),
            ("prior_warned", "warned", 3),
            ("prior_seen_unchanged", "seen leaves unchanged ↑", 4),
        ],
    ),
];

/// Figures tabulated as medians over scenes: outliers dominate their means.
const MEDIANS: [&str; 8] = [
    "contrast_stops",
    "true_contrast_stops",
    "anisotropy",
    "true_anisotropy",
    "vector_deg",
    "level_log2",
    "dominant_deg",
    "dominant_log2_intensity",
];

/// Figures with quartiles beside the median.
const QUARTILES: [&str; 2] = ["contrast_stops", "true_contrast_stops"];

/// Figures that are ratios of the sums of two others, so that small divisors have little weight.
const RATIOS: [(&str, [&str; 2]); 2] = [
    ("shadow_strength_near", ["shadow_darkening_near", "true_shadow_darkening_near"]),
    ("shadow_strength_far", ["shadow_darkening_far", "true_shadow_darkening_far"]),
];

/// Figures with a table of scenes won.
const CONTESTS: [&str; 9] = [
    "psnr_db",
    "unseen_si_rmse",
    "unseen_relative_si_rmse",
    "unseen_angular_deg",
    "unseen_irradiance_relative_si_rmse",
    "unseen_irradiance_angular_deg",
    "array_si_rmse",
    "object_diffuse_rmse",
    "shadow_rms",
];

impl Summary {
    /// Adds an outcome.
    pub fn add(&mut self, outcome: Outcome) {
        self.outcomes.push(outcome);
    }

    /// Returns all outcomes, in the order of addition.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// Returns the names of all figures; those of the tables come first, in their order.
    pub fn figures(&self) -> Vec<String> {
        let mut found: Vec<String> = Vec::new();
        let known = TABLES.iter().flat_map(|(_, columns)| columns.iter().map(|(figure, ..)| *figure));
        let scores = || self.outcomes.iter().filter_map(|outcome| outcome.scores.as_ref().ok());
        let all = known.filter(|figure| scores().any(|scores| scores.get(figure).is_some()));
        for figure in all.chain(scores().flat_map(|scores| scores.iter().map(|(figure, _)| figure))) {
            if !found.iter().any(|own| own == figure) {
                found.push(figure.to_owned());
            }
        }
        found
    }

    /// Returns the tables in Markdown: means over scenes, and scenes won by each method.
    ///
    /// The samples of a scene are averaged first. Tables of each lighting condition follow, if there are any.
    pub fn markdown(&self) -> String {
        let methods = self.rows(None);
        let mut text = String::new();
        self.tables(&mut text, &methods, "");
        for figure in CONTESTS {
            contest(&mut text, figure, &methods);
        }
        failures(&mut text, &methods);
        let conditions: BTreeSet<&str> = self.outcomes.iter().filter_map(|outcome| outcome.condition).collect();
        for condition in conditions {
            self.tables(&mut text, &self.rows(Some(condition)), &format!(", {condition}"));
        }
        text
    }

    fn tables(&self, text: &mut String, methods: &[MethodRow], condition: &str) {
        for (title, columns) in TABLES {
            let shown: Vec<_> = columns
                .iter()
                .filter(|(figure, ..)| methods.iter().any(|row| row.mean.get(figure).is_some()))
                .collect();
            if shown.is_empty() {
                continue;
            }
            let mut head = vec!["method".to_owned(), "photos".to_owned()];
            head.extend(shown.iter().map(|(_, name, _)| (*name).to_owned()));
            let rows = methods.iter().filter(|row| shown.iter().any(|(figure, ..)| row.mean.get(figure).is_some()));
            let rows = rows.map(|row| {
                let figures = shown.iter().map(|(figure, _, digits)| {
                    if !MEDIANS.contains(figure) {
                        return number(row.mean.get(figure), *digits);
                    }
                    let [lower, middle, upper] = QUANTILES.map(|share| number(row.quantile(figure, share), *digits));
                    if QUARTILES.contains(figure) { format!("{middle} ({lower}, {upper})") } else { middle }
                });
                [row.method.to_owned(), row.samples.to_string()].into_iter().chain(figures).collect()
            });
            table(text, &format!("{title}{condition}"), &head, rows);
        }
    }

    /// Returns the table of time and memory in Markdown.
    pub fn cost_markdown(&self) -> String {
        let mut text = String::new();
        let head = ["method", "photo → light, s", "panorama, ms", "peak memory, MiB"].map(str::to_owned);
        let rows = self.rows(None).into_iter().filter_map(|row| {
            let Cost { estimate_s, panorama_s, peak_mib } = row.cost?;
            Some(vec![
                row.method.to_owned(),
                number(Some(estimate_s), 3),
                number(Some(1e3 * panorama_s), 1),
                number(peak_mib, 0),
            ])
        });
        table(&mut text, "Cost (medians; memory: maximum)", &head, rows);
        text
    }

    /// Returns the summary as JSON: counts, means, medians and quartiles over scenes, and cost of each method.
    pub fn json(&self) -> serde_json::Value {
        let methods: Vec<_> = self
            .rows(None)
            .into_iter()
            .map(|row| {
                let figures: serde_json::Map<_, _> = row
                    .mean
                    .iter()
                    .map(|(figure, mean)| {
                        let [lower, median, upper] = QUANTILES.map(|share| row.quantile(figure, share));
                        (figure.to_owned(), json!({ "mean": mean, "median": median, "quartiles": [lower, upper] }))
                    })
                    .collect();
                json!({
                    "method": row.method,
                    "photos": row.samples,
                    "scenes": row.scenes.len(),
                    "not_possible": row.failures,
                    "figures": figures,
                    "cost": row.cost,
                })
            })
            .collect();
        json!({ "methods": methods })
    }

    /// Returns the rows of all methods, over outcomes of one condition or of all.
    fn rows(&self, condition: Option<&str>) -> Vec<MethodRow<'_>> {
        let mut methods: Vec<&str> = Vec::new();
        for outcome in &self.outcomes {
            if !methods.contains(&&outcome.method[..]) {
                methods.push(&outcome.method);
            }
        }
        methods.into_iter().map(|method| self.row(method, condition)).collect()
    }

    fn row<'a>(&'a self, method: &'a str, condition: Option<&str>) -> MethodRow<'a> {
        let asked = |outcome: &&Outcome| condition.is_none_or(|condition| outcome.condition == Some(condition));
        let own = || self.outcomes.iter().filter(|outcome| outcome.method == method).filter(asked);
        let mut failures = BTreeMap::new();
        let mut by_scene: Vec<(&str, Vec<&Scores>)> = Vec::new();
        for outcome in own() {
            match &outcome.scores {
                Err(reason) => *failures.entry(reason.to_string()).or_default() += 1,
                Ok(scores) => match by_scene.iter_mut().find(|(scene, _)| *scene == outcome.scene) {
                    Some((_, samples)) => samples.push(scores),
                    None => by_scene.push((&outcome.scene, vec![scores])),
                },
            }
        }
        let samples = by_scene.iter().map(|(_, samples)| samples.len()).sum();
        let mut scenes: Vec<_> = by_scene.into_iter().map(|(scene, samples)| (scene, Scores::mean(samples))).collect();
        let mut mean = Scores::mean(scenes.iter().map(|(_, scores)| scores));
        scenes.iter_mut().for_each(|(_, scores)| add_ratios(scores));
        add_ratios(&mut mean);
        let costs = || own().filter(|outcome| outcome.scores.is_ok()).filter_map(|outcome| outcome.cost);
        let median_of = |seconds: fn(Cost) -> f64| median(costs().map(seconds).collect());
        let seconds = median_of(|cost| cost.estimate_s).zip(median_of(|cost| cost.panorama_s));
        let peak_mib = costs().filter_map(|cost| cost.peak_mib).max_by(f64::total_cmp);
        let cost = seconds.map(|(estimate_s, panorama_s)| Cost { estimate_s, panorama_s, peak_mib });
        MethodRow { method, samples, failures, scenes, mean, cost }
    }
}

/// Adds the ratio figures. Ratios of means over the same samples equal ratios of sums.
fn add_ratios(mean: &mut Scores) {
    for (figure, [dividend, divisor]) in RATIOS {
        let both = mean.get(dividend).zip(mean.get(divisor));
        mean.add(figure, both.filter(|(_, divisor)| *divisor > 0.0).map(|(dividend, divisor)| dividend / divisor));
    }
}

impl MethodRow<'_> {
    /// Returns a quantile of a figure over the scenes that have it.
    fn quantile(&self, figure: &str, share: f64) -> Option<f64> {
        quantile(self.scenes.iter().filter_map(|(_, scores)| scores.get(figure)).collect(), share)
    }
}

/// Writes a table of scenes won by each method (row) against each other (column).
fn contest(text: &mut String, figure: &str, methods: &[MethodRow]) {
    let more_is_better = figure.ends_with("psnr_db");
    let compared: Vec<&MethodRow> = methods.iter().filter(|row| row.mean.get(figure).is_some()).collect();
    if compared.len() < 2 {
        return;
    }
    let head: Vec<String> =
        std::iter::once("wins against →".to_owned()).chain(compared.iter().map(|row| row.method.to_owned())).collect();
    let won = |a: &MethodRow, b: &MethodRow| {
        let pairs = a.scenes.iter().filter_map(|(scene, scores)| {
            let (_, other) = b.scenes.iter().find(|(own, _)| own == scene)?;
            Some((scores.get(figure)?, other.get(figure)?))
        });
        let (mut wins, mut all) = (0, 0);
        for (mine, other) in pairs {
            wins += usize::from(if more_is_better { mine > other } else { mine < other });
            all += 1;
        }
        if a.method == b.method || all == 0 { "–".to_owned() } else { format!("{wins}/{all}") }
    };
    let rows = compared
        .iter()
        .map(|a| std::iter::once(a.method.to_owned()).chain(compared.iter().map(|b| won(a, b))).collect());
    table(text, &format!("Scenes won, {figure}"), &head, rows);
}

fn failures(text: &mut String, methods: &[MethodRow]) {
    for row in methods {
        for (reason, count) in &row.failures {
            // Writing into a String cannot fail.
            let _ = writeln!(text, "{}: not possible on {count} photos: {reason}\n", row.method);
        }
    }
}

fn table(text: &mut String, title: &str, head: &[String], rows: impl Iterator<Item = Vec<String>>) {
    let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
    *text += &format!("### {title}\n\n{}", line(head));
    *text += &line(&vec!["---".to_owned(); head.len()]);
    rows.for_each(|row| *text += &line(&row));
    *text += "\n";
}

fn number(value: Option<f64>, digits: usize) -> String {
    value.map_or_else(|| "–".to_owned(), |value| format!("{value:.digits$}"))
}

/// Lower quartile, median and upper quartile.
const QUANTILES: [f64; 3] = [0.25, 0.5, 0.75];

fn median(values: Vec<f64>) -> Option<f64> {
    quantile(values, 0.5)
}

/// Returns NumPy's default quantile, with linear interpolation; `None` without values.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_unstable_by(f64::total_cmp);
    let position = share * values.len().saturating_sub(1) as f64;
    let lower = values.get(position as usize)?;
    let upper = values.get(position.ceil() as usize)?;
    Some(lower + position.fract() * (upper - lower))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn outcome(scene: &str, number: usize, method: &str, psnr_db: f64) -> Outcome {
        let scores = Ok(Scores::from_iter([("psnr_db".to_owned(), psnr_db)]));
        let (sample, scene, method) = (format!("{scene}-{number}"), scene.to_owned(), method.to_owned());
        Outcome { sample, scene, method, condition: None, scores, cost: Some(Cost::default()) }
    }

    #[test]
    fn scenes_count_alike_and_failures_are_told() {
        let mut summary = Summary::default();
        for (scene, number, psnr_db) in [("a", 0, 10.0), ("a", 1, 20.0), ("b", 0, 21.0)] {
            summary.add(outcome(scene, number, "mean-colour", psnr_db));
            summary.add(outcome(scene, number, "network", psnr_db + if scene == "a" { 1.0 } else { -1.0 }));
        }
        let needs = Err(MethodError::Needs("true depth"));
        summary.add(Outcome { scores: needs, ..outcome("b", 0, "shell-true", 0.0) });
        let text = summary.markdown();
        // (15 + 21) / 2, not the mean of three samples.
        assert!(text.contains("| mean-colour | 3 | 18.00 |"), "{text}");
        assert!(text.contains("| network | 1/2 | – |"), "{text}");
        assert!(text.contains("shell-true: not possible on 1 photos: needs true depth"), "{text}");
        let json = summary.json();
        assert_eq!(json["methods"][0]["figures"]["psnr_db"]["median"], 18.0);
        assert_eq!(json["methods"][2]["not_possible"]["needs true depth"], 1);
        assert_eq!(summary.figures(), ["psnr_db"]);
        assert!(summary.cost_markdown().contains("| network | 0.000 | 0.0 | – |"));
    }

    #[test]
    fn the_strength_of_shadows_is_a_ratio_of_sums() {
        let mut summary = Summary::default();
        // A room with almost no true shadow has a ratio of 50.
        for (scene, number, got, truth) in [("a", 0, 1.0, 2.0), ("a", 1, 3.0, 6.0), ("b", 0, 0.5, 0.01)] {
            let figures = [("shadow_darkening_near", got), ("true_shadow_darkening_near", truth)];
            let scores = Scores::from_iter(figures.map(|(figure, value)| (figure.to_owned(), value)));
            summary.add(Outcome { scores: Ok(scores), ..outcome(scene, number, "fitted", 0.0) });
        }
        let figure = &summary.json()["methods"][0]["figures"]["shadow_strength_near"];
        assert!((figure["mean"].as_f64().unwrap() - 2.5 / 4.01).abs() < 1e-9, "{figure}");
        // Median of 0.5 and 50.
        assert!((figure["median"].as_f64().unwrap() - 25.25).abs() < 1e-9, "{figure}");
        assert!(summary.markdown().contains("| fitted | 3 | 0.62 |"), "{}", summary.markdown());
    }

    #[test]
    fn medians() {
        assert_eq!([median(vec![]), median(vec![3.0, 1.0, 2.0]), median(vec![4.0, 1.0])], [None, Some(2.0), Some(2.5)]);
        // numpy.percentile([4, 1, 3, 2], [25, 75])
        assert_eq!([0.25, 0.75].map(|share| quantile(vec![4.0, 1.0, 3.0, 2.0], share)), [Some(1.75), Some(3.25)]);
    }
}
