//! Progress on stderr: a line with the time of each stage, and a bar with rate and remaining time for long ones.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use lightoctree::{Event, Stage, Warning};
use lo_events::Figure;

use crate::interrupt;

/// Reports the stages of one command.
pub struct Stages {
    quiet: bool,
    start: Instant,
    done: Vec<(String, Duration)>,
    /// Bar of the current stage, once it reports progress.
    bar: Option<ProgressBar>,
    /// Names of the inserted objects, for warnings.
    objects: Vec<String>,
}

impl Stages {
    /// Starts the clock. Prints nothing if `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, start: Instant::now(), done: Vec::new(), bar: None, objects: Vec::new() }
    }

    /// Whether progress and notes are suppressed.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }

    /// Sets the names of the inserted objects; warnings use them if there are several.
    pub fn name_objects(&mut self, names: &[String]) {
        self.objects = names.to_vec();
    }

    /// Runs a stage and reports its time.
    pub fn stage<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        self.done(name, start.elapsed());
        result
    }

    /// Handles an event of the library. Returns `Break` after a Ctrl-C.
    pub fn handle(&mut self, event: Event) -> ControlFlow<()> {
        match event {
            Event::Progress { stage, done, total } => {
                let quiet = self.quiet;
                let bar = self.bar.get_or_insert_with(|| bar(quiet, total as usize, &stage_label(&stage)));
                bar.set_position(done);
            }
            Event::Done { stage, took } => {
                self.clear_bar();
                self.done(&stage_label(&stage), took);
            }
            Event::Warning(warning) => self.warn(&warning),
            Event::Figures { stage: Stage::Photos, figures } => self.note(&exposures_text(&figures)),
            // Stages are reported when they are done.
            _ => {}
        }
        if interrupt::requested() {
            self.clear_bar();
        }
        interrupt::control_flow()
    }

    /// Removes the bar of an unfinished stage.
    pub fn clear_bar(&mut self) {
        self.bar.take().iter().for_each(ProgressBar::finish_and_clear);
    }

    /// Prints a warning of the library.
    pub fn warn(&self, warning: &Warning) {
        self.note(&warning_text(warning, &self.objects));
    }

    /// Prints a note.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("  note: {text}");
        }
    }

    /// Returns the seconds of each finished stage by its name.
    pub fn timings(&self) -> serde_json::Map<String, serde_json::Value> {
        self.done.iter().map(|(name, took)| (name.clone(), took.as_secs_f64().into())).collect()
    }

    fn done(&mut self, name: &str, took: Duration) {
        if !self.quiet {
            eprintln!("  {name:<28} {}", seconds(took));
        }
        self.done.push((name.to_owned(), took));
    }

    /// Time since the start.
    pub fn total(&self) -> Duration {
        self.start.elapsed()
    }
}

/// Returns the name of a stage on the terminal and in the `seconds` of `--json`.
pub fn stage_label(stage: &Stage) -> Cow<'static, str> {
    let label = match stage {
        Stage::ReadInput => "read input",
        Stage::ReadWeights => "read weights",
        Stage::WorkingResolution => "resize to working resolution",
        Stage::Photos => "match photos",
        Stage::DepthAndGlobalLight => "depth and global light",
        Stage::ReadDepthModel => "read depth model",
        Stage::PrepareDepthModel => "prepare depth model",
        Stage::DepthModel => "depth model",
        Stage::GlobalLight => "global light",
        Stage::LightNetwork => "light network",
        Stage::Completion => "completion",
        Stage::Octree => "octree",
        Stage::PanoramaMatch => "align panorama",
        Stage::PanoramaLaying => "project panorama",
        Stage::Probes => "probes",
        Stage::CoarseShadow => "coarse shadow",
        Stage::Radiosity => "radiosity",
        Stage::FineShadow => "fine shadow",
        Stage::Visibility => "visibility",
        Stage::Shading => "shading",
        Stage::Composite => "composite",
        Stage::Write => "write",
        Stage::GenerateRooms => "generate rooms",
        Stage::ReadSamples => "read samples",
        Stage::EvaluatePhotos => "evaluate photos",
        Stage::Training(phase) => return phase.to_string().into(),
        Stage::Validation => "validation",
        Stage::Checkpoint => "checkpoint",
        other => return format!("{other:?}").into(),
    };
    label.into()
}

/// Formats a warning for the user. `objects` are the names of the inserted objects, used if there are several.
pub fn warning_text(warning: &Warning, objects: &[String]) -> String {
    let object_name = |object: usize| match objects {
        [_, _, ..] => objects.get(object).cloned().unwrap_or_default(),
        _ => "the object".into(),
    };
    match warning {
        Warning::PredictedDepth => {
            "depth is predicted from the photo alone: distances and sizes are uncertain, and the \
                                    up direction may be off by some degrees"
                .into()
        }
        Warning::FittedDepth { scale, offset, agree, median_error } => format!(
            "the depth model returns relative depth; it was fitted to the metric depth of the built-in network by \
             1/z = {scale:.4} d {offset:+.4}: {:.0} % of the pixels agree within a ratio of 1.25, the median difference \
             is {:.0} %",
            100.0 * agree,
            100.0 * median_error
        ),
        Warning::PosesDisagree { photos: [a, b], disagreement } => format!(
            "photos {} and {} overlap according to their poses, but their depths differ there by {:.0} %: check the \
             poses",
            a + 1,
            b + 1,
            100.0 * disagreement
        ),
        Warning::AssumedExposures { photos } => match &photos[..] {
            [photo] => format!(
                "photo {} overlaps none of the photos before it, so its exposure is estimated from its brightness; set \
                 it with --exposures",
                photo + 1
            ),
            _ => {
                let photos: Vec<String> = photos.iter().map(|photo| (photo + 1).to_string()).collect();
                format!(
                    "photos {} overlap none of the photos before them, so their exposures are estimated from their \
                     brightness; set them with --exposures",
                    photos.join(", ")
                )
            }
        },
        Warning::OutsideCube { outside, points } => {
            format!("{outside} of {points} points are outside the octree's cube and were discarded")
        }
        &Warning::ObjectHidden { object } if objects.len() > 1 => {
            format!("{} is not visible: it is behind real surfaces or other objects", object_name(object))
        }
        Warning::ObjectHidden { .. } => "the object is not visible: it is behind real surfaces".into(),
        &Warning::ObjectOutsidePicture { object } => {
            format!("{} is not visible: it is outside the photo", object_name(object))
        }
        &Warning::ObjectOutsideOctree { object } => {
            format!("{} is outside the octree, so its lighting is unreliable", object_name(object))
        }
        &Warning::ObjectOverhangs { object, supported } => format!(
            "only {:.0} % of the base of {} is supported, the rest overhangs an edge: move it, or make it smaller",
            100.0 * supported,
            object_name(object)
        ),
        &Warning::ObjectsIntersect { objects: [a, b] } => {
            format!("{} and {} intersect: move one of them", object_name(a), object_name(b))
        }
        Warning::FilledDepth { filled, pixels } => format!(
            "{:.0} % of the pixels have no depth reading and were filled from the room's planes or their neighbours",
            100.0 * *filled as f32 / *pixels as f32
        ),
        Warning::Highlights { clipped_share, regions, peak_radiance } => format!(
            "{:.1} % of the photo is clipped; {regions} bright regions were reconstructed, up to {peak_radiance:.1} times \
             white",
            100.0 * clipped_share
        ),
        Warning::AssumedLamp { radiance } => format!(
            "visible lights do not explain the photo's shading: a lamp of radiance {radiance:.1} was assumed in the \
             unobserved part of the ceiling"
        ),
        Warning::FittedLamps { lamps, lamps_share, clipped_lamps, clipped_share, surfaces } => {
            let part = |factor: Option<f32>, share: f32, what: &str, than: &str| {
                let text = |factor| {
                    format!("{what} {factor:.1} times as bright as {than} ({:.0} % of the light)", 100.0 * share)
                };
                factor.map(text)
            };
            let lamps = part(*lamps, *lamps_share, "lamps and windows", "inferred");
            let clipped = part(*clipped_lamps, *clipped_share, "clipped lamps and windows", "usual");
            let surfaces = ((surfaces - 1.0).abs() > 0.05)
                .then(|| format!("unobserved surfaces {surfaces:.1} times as bright as inferred"));
            let parts: Vec<String> = lamps.into_iter().chain(clipped).chain(surfaces).collect();
            format!("fitted to the photo's shading: {}", parts.join(", "))
        }
        Warning::AssumedPlanes { floor, ceiling, walls } => {
            let planes = [
                floor.then(|| "the floor".to_owned()),
                ceiling.then(|| "the ceiling".to_owned()),
                (*walls > 0).then(|| format!("{walls} of 4 walls")),
            ];
            let planes: Vec<String> = planes.into_iter().flatten().collect();
            format!("not observed, so their positions are assumed: {}", planes.join(", "))
        }
        Warning::ClippedPanorama { clipped_share } => format!(
            "the panorama is not HDR: {:.1} % of it is clipped, so lamps may be brighter than it shows",
            100.0 * clipped_share
        ),
        Warning::PanoramaValues { cleaned, pixels } => {
            format!("{cleaned} of the panorama's {pixels} pixels are negative, NaN or infinite and were set to 0")
        }
        Warning::PanoramaMatch { confidence, least, yaw_deg } => format!(
            "the panorama matches the photo poorly (confidence {confidence:.2}, expected at least {least:.2}): check that \
             it shows this room and was taken at --panorama-at. It is used with a yaw of {yaw_deg:.0}°; \
             --panorama-yaw-deg sets another"
        ),
        Warning::PanoramaNotCompared => {
            "the panorama's position sees too little of what the photo shows, so its yaw is \
                                         uncertain: set --panorama-yaw-deg and --panorama-exposure-ev if you know them"
                .into()
        }
        Warning::NothingOccupied { depth } => {
            format!("no node of depth {depth} was predicted to be occupied; the most probable one is used")
        }
        Warning::NodeBudget { depth, predicted, kept } => format!(
            "{predicted} nodes of depth {depth} were predicted to be split; only the {kept} most probable fit the node \
             budget"
        ),
        Warning::SamplePassedOver { sample, error } => format!("skipped {sample}: {error}"),
        Warning::UnpublishedEncoder { file, sha256 } => {
            format!("{file} is not the published file of encoder weights; its SHA-256 is {sha256}")
        }
        Warning::DatasetChanged { .. } => "the dataset has changed; the next epoch begins".into(),
        Warning::SetBack { phase, step, fault, back_to_step } => {
            format!("{phase}, step {step}: {fault}; continuing from step {back_to_step} with other data")
        }
        other => format!("{other:?}"),
    }
}

/// Formats the matched exposures of several photos.
fn exposures_text(figures: &[Figure]) -> String {
    let stops: Vec<String> = figures.iter().map(|figure| format!("{:+.2}", figure.value)).collect();
    format!("matched exposures, relative to the first photo: {} EV", stops.join(", "))
}

/// Formats a duration, such as `12 ms` or `1.24 s`.
pub fn seconds(duration: Duration) -> String {
    let s = duration.as_secs_f64();
    if s < 1.0 { format!("{:.0} ms", 1e3 * s) } else { format!("{s:.2} s") }
}

/// Creates a bar for `count` steps with rate and remaining time. It is hidden if `quiet`, or if stderr is not a
/// terminal.
pub fn bar(quiet: bool, count: usize, label: &str) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("  {msg} {wide_bar} {pos}/{len}  {per_sec}  {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(count as u64).with_style(style).with_message(label.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_are_formatted_with_their_figures() {
        let text = |warning| warning_text(&warning, &[]);
        let filled = text(Warning::FilledDepth { filled: 1, pixels: 5 });
        assert!(filled.starts_with("20 % of the pixels have no depth reading"), "{filled}");
        let clipped = text(Warning::Highlights { clipped_share: 0.012, regions: 3, peak_radiance: 4.56 });
        assert_eq!(
            clipped,
            "1.2 % of the photo is clipped; 3 bright regions were reconstructed, up to 4.6 times white"
        );
        let planes = text(Warning::AssumedPlanes { floor: false, ceiling: true, walls: 2 });
        assert_eq!(planes, "not observed, so their positions are assumed: the ceiling, 2 of 4 walls");
        let names = ["table", "vase"].map(str::to_owned);
        let intersecting = warning_text(&Warning::ObjectsIntersect { objects: [0, 1] }, &names);
        assert_eq!(intersecting, "table and vase intersect: move one of them");
        let hidden = Warning::ObjectHidden { object: 1 };
        assert!(warning_text(&hidden, &names).starts_with("vase is not visible"), "{hidden:?}");
        assert!(text(hidden).starts_with("the object is not visible: it is behind real surfaces"));
    }

    #[test]
    fn stages_of_the_library_are_in_the_timings() {
        let mut stages = Stages::new(true);
        let took = Duration::from_millis(250);
        assert_eq!(stages.handle(Event::Done { stage: Stage::LightNetwork, took }), ControlFlow::Continue(()));
        assert_eq!(stages.timings()["light network"], 0.25);
    }
}
