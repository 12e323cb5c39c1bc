//! Progress on stderr: a line per stage with its time, a bar with rate and time left for what has many steps.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use lightoctree::events::Figure;
use lightoctree::{Event, Stage, Warning};

use crate::interrupt;

/// Speaks about the stages of one command.
pub struct Stages {
    quiet: bool,
    begun: Instant,
    done: Vec<(String, Duration)>,
    /// Of the stage at hand, once it says how far it is.
    bar: Option<ProgressBar>,
    /// What warnings call the objects that are inserted.
    objects: Vec<String>,
}

impl Stages {
    /// Starts the clock; says nothing when `quiet`.
    pub fn new(quiet: bool) -> Self {
        Self { quiet, begun: Instant::now(), done: Vec::new(), bar: None, objects: Vec::new() }
    }

    /// From now on warnings call objects so, if there are several.
    pub fn name_objects(&mut self, names: &[String]) {
        self.objects = names.to_vec();
    }

    /// Does one stage and says how long it took.
    pub fn stage<T>(&mut self, name: &str, work: impl FnOnce() -> T) -> T {
        let begun = Instant::now();
        let result = work();
        self.done(name, begun.elapsed());
        result
    }

    /// Takes note of what the library says on its way, and ends its job after a Ctrl-C.
    pub fn hear(&mut self, event: Event) -> ControlFlow<()> {
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
            // What begins is told when it is done.
            _ => {}
        }
        if interrupt::asked() {
            self.clear_bar();
        }
        interrupt::go_on()
    }

    /// Takes the bar of a stage away that is not finished.
    pub fn clear_bar(&mut self) {
        self.bar.take().iter().for_each(ProgressBar::finish_and_clear);
    }

    /// Says what the library thinks the user should know.
    pub fn warn(&self, warning: &Warning) {
        self.note(&warning_text(warning, &self.objects));
    }

    /// Says something that the user should know.
    pub fn note(&self, text: &str) {
        if !self.quiet {
            eprintln!("  note: {text}");
        }
    }

    /// Name → seconds of every stage so far.
    pub fn timings(&self) -> serde_json::Map<String, serde_json::Value> {
        self.done.iter().map(|(name, took)| (name.clone(), took.as_secs_f64().into())).collect()
    }

    fn done(&mut self, name: &str, took: Duration) {
        if !self.quiet {
            eprintln!("  {name:<28} {}", seconds(took));
        }
        self.done.push((name.to_owned(), took));
    }

    /// Time since the beginning.
    pub fn total(&self) -> Duration {
        self.begun.elapsed()
    }
}

/// What a stage is called on the terminal, and in `--json`'s seconds.
pub fn stage_label(stage: &Stage) -> Cow<'static, str> {
    let label = match stage {
        Stage::ReadInput => "read input",
        Stage::ReadWeights => "read weights",
        Stage::WorkingResolution => "working resolution",
        Stage::Photos => "photos together",
        Stage::DepthAndGlobalLight => "depth and global light",
        Stage::ReadDepthModel => "read depth model",
        Stage::PrepareDepthModel => "prepare depth model",
        Stage::DepthModel => "depth model",
        Stage::GlobalLight => "global light",
        Stage::LightNetwork => "light network",
        Stage::Completion => "completion",
        Stage::Octree => "octree",
        Stage::PanoramaMatch => "panorama's yaw and exposure",
        Stage::PanoramaLaying => "panorama on the room",
        Stage::Probes => "panoramas",
        Stage::CoarseShadow => "shadow, coarse",
        Stage::Radiosity => "light on the object",
        Stage::FineShadow => "shadow",
        Stage::Visibility => "visibility",
        Stage::Shading => "shading",
        Stage::Composite => "composite",
        Stage::Write => "write",
        Stage::GenerateRooms => "rooms",
        Stage::ReadSamples => "samples",
        Stage::EvaluatePhotos => "photos",
        Stage::Training(phase) => return phase.to_string().into(),
        Stage::Validation => "validation",
        Stage::Checkpoint => "checkpoint",
        other => return format!("{other:?}").into(),
    };
    label.into()
}

/// A warning in words; `objects`: names of what is inserted.
pub fn warning_text(warning: &Warning, objects: &[String]) -> String {
    let called = |object: usize| match objects {
        [_, _, ..] => objects.get(object).cloned().unwrap_or_default(),
        _ => "the object".into(),
    };
    match warning {
        Warning::PredictedDepth => "depth is predicted from the photo alone: distances, and with them all sizes, \
                                    may be off, and which way is up by some degrees"
            .into(),
        Warning::FittedDepth { scale, offset, agree, median_error } => format!(
            "the depth model's depth is relative; it was brought to the metres of the program's own network: \
             1/z = {scale:.4} d {offset:+.4}; they agree within a quarter in {:.0} % of the pixels, {:.0} % apart in the middle",
            100.0 * agree,
            100.0 * median_error
        ),
        Warning::PosesDisagree { photos: [a, b], disagreement } => format!(
            "by their poses, photos {} and {} look at the same places, but their depths differ there by {:.0} %: check the poses",
            a + 1,
            b + 1,
            100.0 * disagreement
        ),
        Warning::AssumedExposures { photos } => {
            let photos: Vec<String> = photos.iter().map(|photo| (photo + 1).to_string()).collect();
            format!(
                "nothing is seen both in photo {} and in those before; how brightly {} the same light is guessed from the pictures' \
                 brightness: give --exposures if you know better",
                photos.join(", "),
                if photos.len() == 1 { "it shows" } else { "they show" }
            )
        }
        Warning::OutsideCube { outside, points } => {
            format!("{outside} of {points} points lie outside of the cube and were left out")
        }
        &Warning::ObjectHidden { object } if objects.len() > 1 => {
            format!("{} does not show: real surfaces or other objects stand before all of it", called(object))
        }
        Warning::ObjectHidden { .. } => "the object does not show: real surfaces stand before all of it".into(),
        &Warning::ObjectOutsidePicture { object } => {
            format!("{} does not show: it lies outside of the picture", called(object))
        }
        &Warning::ObjectOutsideOctree { object } => {
            format!("{} lies outside of the lighting octree, its light is a guess", called(object))
        }
        &Warning::ObjectOverhangs { object, supported } => format!(
            "only {:.0} % of the base of {} stands on what carries it, the rest hangs over an edge: move it, or make it smaller",
            100.0 * supported,
            called(object)
        ),
        &Warning::ObjectsIntersect { objects: [a, b] } => {
            format!("{} and {} reach into one another: move one of them", called(a), called(b))
        }
        Warning::FilledDepth { filled, pixels } => format!(
            "{:.0} % of the pixels have no depth reading; theirs was taken from the room's planes or from around them",
            100.0 * *filled as f32 / *pixels as f32
        ),
        Warning::Highlights { clipped_share, regions, peak_radiance } => format!(
            "{:.1} % of the photo is clipped; {regions} bright regions were given up to {peak_radiance:.1} times white",
            100.0 * clipped_share
        ),
        Warning::AssumedLamp { radiance } => {
            format!(
                "what is seen does not explain the light: an unseen ceiling lamp of radiance {radiance:.1} was assumed"
            )
        }
        Warning::FittedLamps { lamps, lamps_share, clipped_lamps, clipped_share, surfaces } => {
            let part = |factor: Option<f32>, share: f32, what: &str, than: &str| {
                let text = |factor| {
                    format!("{what} {factor:.1} times as bright as {than} ({:.0} % of the light)", 100.0 * share)
                };
                factor.map(text)
            };
            let lamps = part(*lamps, *lamps_share, "lamps and windows", "guessed");
            let clipped = part(*clipped_lamps, *clipped_share, "clipped lamps and windows", "usual");
            let surfaces = ((surfaces - 1.0).abs() > 0.05)
                .then(|| format!("unseen surfaces {surfaces:.1} times as bright as guessed"));
            let parts: Vec<String> = lamps.into_iter().chain(clipped).chain(surfaces).collect();
            format!("as the photo's shading asks for: {}", parts.join(", "))
        }
        Warning::AssumedPlanes { floor, ceiling, walls } => {
            let planes = [
                floor.then(|| "the floor".to_owned()),
                ceiling.then(|| "the ceiling".to_owned()),
                (*walls > 0).then(|| format!("{walls} of 4 walls")),
            ];
            let planes: Vec<String> = planes.into_iter().flatten().collect();
            format!("not seen, so their place is assumed: {}", planes.join(", "))
        }
        Warning::ClippedPanorama { clipped_share } => format!(
            "the panorama is no HDR image: {:.1} % of it is clipped, and lamps may be brighter than it shows",
            100.0 * clipped_share
        ),
        Warning::PanoramaValues { cleaned, pixels } => {
            format!("{cleaned} of the panorama's {pixels} pixels are negative or no numbers and count as 0")
        }
        Warning::PanoramaMatch { confidence, least, yaw_deg } => format!(
            "the panorama hardly shows what the photo shows (confidence {confidence:.2}, {least:.2} are usual at least): is it of this room and taken \
             where --panorama-at says? It was laid with a yaw of {yaw_deg:.0} degrees; --panorama-yaw-deg sets another"
        ),
        Warning::PanoramaNotCompared => {
            "the panorama's place sees next to nothing of what the photo shows, so its yaw is a guess: \
                                         --panorama-yaw-deg and --panorama-exposure-ev set what is known"
                .into()
        }
        Warning::NothingOccupied { depth } => {
            format!("no node of depth {depth} was predicted to be occupied; the likeliest one is")
        }
        Warning::NodeBudget { depth, predicted, kept } => format!(
            "{predicted} nodes of depth {depth} were predicted to be split, but only the likeliest {kept} fit the node budget"
        ),
        Warning::SamplePassedOver { sample, error } => format!("passed over: {sample}: {error}"),
        Warning::UnpublishedEncoder { file, sha256 } => {
            format!("{file} is not the published file of the encoder's weights; its SHA-256 is {sha256}")
        }
        Warning::DatasetChanged { .. } => "the dataset is not what it was; its next epoch begins".into(),
        Warning::SetBack { phase, step, fault, back_to_step } => {
            format!("{phase}, step {step}: {fault}; back to step {back_to_step}, with other data")
        }
        other => format!("{other:?}"),
    }
}

/// How several photos were exposed, in words.
fn exposures_text(figures: &[Figure]) -> String {
    let stops: Vec<String> = figures.iter().map(|figure| format!("{:+.2}", figure.value)).collect();
    format!("the photos show the same light brighter than the first by {} EV", stops.join(", "))
}

/// `12 ms`, `1.24 s`.
pub fn seconds(duration: Duration) -> String {
    let s = duration.as_secs_f64();
    if s < 1.0 { format!("{:.0} ms", 1e3 * s) } else { format!("{s:.2} s") }
}

/// A bar for `count` steps with rate and time left; hidden when `quiet` or when stderr is no terminal.
pub fn bar(quiet: bool, count: usize, what: &str) -> ProgressBar {
    if quiet {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("  {msg} {wide_bar} {pos}/{len}  {per_sec}  {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(count as u64).with_style(style).with_message(what.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn warnings_have_words_with_their_numbers() {
        let text = |warning| warning_text(&warning, &[]);
        let filled = text(Warning::FilledDepth { filled: 1, pixels: 5 });
        assert!(filled.starts_with("20 % of the pixels have no depth reading"), "{filled}");
        let clipped = text(Warning::Highlights { clipped_share: 0.012, regions: 3, peak_radiance: 4.56 });
        assert_eq!(clipped, "1.2 % of the photo is clipped; 3 bright regions were given up to 4.6 times white");
        let planes = text(Warning::AssumedPlanes { floor: false, ceiling: true, walls: 2 });
        assert_eq!(planes, "not seen, so their place is assumed: the ceiling, 2 of 4 walls");
        let names = ["table", "vase"].map(str::to_owned);
        let meet = warning_text(&Warning::ObjectsIntersect { objects: [0, 1] }, &names);
        assert_eq!(meet, "table and vase reach into one another: move one of them");
        let hidden = Warning::ObjectHidden { object: 1 };
        assert!(warning_text(&hidden, &names).starts_with("vase does not show"), "{hidden:?}");
        assert!(text(hidden).starts_with("the object does not show: real surfaces"));
    }

    #[test]
    fn what_the_library_did_is_in_the_timings() {
        let mut stages = Stages::new(true);
        let took = Duration::from_millis(250);
        assert_eq!(stages.hear(Event::Done { stage: Stage::LightNetwork, took }), ControlFlow::Continue(()));
        assert_eq!(stages.timings()["light network"], 0.25);
    }
}
