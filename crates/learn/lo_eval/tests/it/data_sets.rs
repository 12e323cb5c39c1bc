//! Published data sets, in their layouts, are evaluated.

use std::path::Path;

use lo_dataset::CropModel;
use lo_estimate::Estimator;
use lo_eval::{DepthInput, Evaluation, Method, PhotoSelection, Scores, Tools};
use lo_imaging::DepthMap;

use crate::{hypersim_layout, layouts, lighthouse_layout};

const METHODS: [Method; 4] =
    [Method::MeanColour, Method::Mirrored, Method::Shell(DepthInput::True), Method::TrueOctree];

/// Evaluates two photos and returns each method's mean figures; `None` where a method is not possible.
fn evaluate(dataset: &Path, as_lighthouse: bool) -> Vec<Option<Scores>> {
    let estimator = Estimator::without_networks();
    let tools = Tools {
        estimator: &estimator,
        profile: None,
        octree_depth: 5,
        seed: 0,
        known: None,
        foreign: None,
        baselines: &[],
    };
    let crops = CropModel { width: 96, height: 64, panorama_height: 32, ..CropModel::default() };
    let (layout, protocol, plans, part) = (None, None, None, None);
    let dataset = dataset.to_owned();
    let photos = PhotoSelection { dataset, layout, protocol, as_lighthouse, crops, plans, part, most: Some(2) };
    let report = Evaluation::open(&photos, &METHODS, tools).unwrap().run(1, 1, &mut lo_events::ignore);
    assert!(report.error.is_none() && report.photos > 0, "{:?}", report.error);
    let of_method = |method: &Method| {
        let outcomes = report.summary.outcomes().iter().filter(|outcome| outcome.method == method.name());
        let scores: Vec<&Scores> = outcomes.filter_map(|outcome| outcome.scores.as_ref().ok()).collect();
        (!scores.is_empty()).then(|| Scores::mean(scores))
    };
    METHODS.iter().map(of_method).collect()
}

#[test]
fn futurehouse_has_figures_of_radiance_and_coherence() {
    let folder = tempfile::tempdir().unwrap();
    layouts::futurehouse(folder.path());
    let found = evaluate(folder.path(), false);
    let [mean, mirrored, shell, octree] = [0, 1, 2, 3].map(|i| found[i].as_ref().unwrap());
    for scores in [mean, mirrored, shell, octree] {
        for name in ["psnr_db", "log_rmse", "relative_si_rmse", "contrast_stops", "coherence", "diffuse_rmse"] {
            assert!(scores.get(name).is_some_and(f64::is_finite), "{name}: {scores:?}");
        }
        assert_eq!(scores.get("pixel_psnr_db"), None);
    }
    // The octree of the panorama's own pixels is the upper bound.
    let others = [mean, mirrored, shell].map(|scores| scores.get("psnr_db").unwrap());
    assert!(others.iter().all(|db| *db < octree.get("psnr_db").unwrap()), "{others:?} {octree:?}");
}

#[test]
fn hypersim_has_figures_of_depth_and_structure() {
    let folder = tempfile::tempdir().unwrap();
    hypersim_layout::write(folder.path());
    let found = evaluate(folder.path(), false);
    let [shell, octree] = [2, 3].map(|i| found[i].as_ref().unwrap());
    assert!(shell.get("depth_abs_rel").is_some_and(|error| error < 1e-3), "{shell:?}");
    assert!(shell.get("split_accuracy").is_some_and(|share| (0.3..1.0).contains(&share)), "{shell:?}");
    assert_eq!((octree.get("split_accuracy"), octree.get("psnr_db")), (Some(1.0), None));
}

#[test]
fn data_clipped_at_white_has_no_figures_of_light_above_it() {
    let folder = tempfile::tempdir().unwrap();
    let [interiornet, lighthouse] = ["a", "b"].map(|name| folder.path().join(name));
    layouts::interiornet(&interiornet);
    // With a near corner, the panorama a metre ahead of the first photo is one that Lighthouse chooses.
    let near = DepthMap::from_fn(48, 32, |x, y| if x < 6 && y < 6 { 0.8 } else { 3.0 });
    let depth = interiornet.join("HD1/3FO4_Bedroom/original_1_1/depth0/data/0.png");
    lo_imaging::write_depth(&depth, &near, lo_imaging::GENERATOR).unwrap();
    std::fs::create_dir(&lighthouse).unwrap();
    lighthouse_layout::write(&lighthouse.join("00000.npz"), &lighthouse_layout::arrays());
    let cases = [(&interiornet, false, true), (&interiornet, true, true), (&lighthouse, true, false)];
    for (path, as_lighthouse, has_points) in cases {
        let found = evaluate(path, as_lighthouse);
        assert_eq!(found[3].is_some(), has_points, "the true octree needs surface points");
        for scores in found.iter().flatten() {
            assert!(scores.get("pixel_psnr_db").is_some_and(|db| (1.0..60.0).contains(&db)), "{scores:?}");
            for name in ["rmse", "log_rmse", "reinhard_psnr_db", "contrast_stops", "coherence", "diffuse_rmse"] {
                assert_eq!(scores.get(name), None, "{name}");
            }
        }
    }
}
