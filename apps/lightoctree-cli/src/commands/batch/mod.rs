//! `lightoctree batch PHOTO|FOLDER…`: estimates a scene from each of many photos.
//!
//! Several processes may fill one folder, each with its part of the photos. Results are written atomically, so that a
//! run can be killed at any time and continued by the same command.

mod args;
mod one_photo;
mod photo_list;
mod progress;
mod record;
mod settings;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;
use std::time::Instant;

use serde_json::json;

pub use self::args::Args;
use self::args::COMMAND;
use self::one_photo::{Failure, Worker};
use self::photo_list::ListedPhoto;
use self::progress::Progress;
use self::record::{Record, Report};
use super::environment;
use crate::args::Global;
use crate::progress::seconds;
use crate::{interrupt, output, report};

/// File that describes what the results depend on.
const MANIFEST: &str = "batch.json";

/// Estimates the photos of this part that have no result yet.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    environment::height(args.panorama.size)?;
    output::check_folder(&args.output, MANIFEST, COMMAND, args.force)?;
    let [part, parts] = args.shard;
    let photos = photo_list::read(&args.photos, &args.output)?;
    let photos: Vec<ListedPhoto> = photos.into_iter().skip(part as usize - 1).step_by(parts as usize).collect();
    let estimator = super::estimator(args.method.weights.as_deref())?;
    output::prepare_folder(&args.output, MANIFEST, COMMAND, args.force)?;
    settings::agree(&args.output.join(MANIFEST), &settings::of(global, args))?;

    let begun = Instant::now();
    let (mut kept, mut missing) = (Vec::new(), Vec::new());
    let report_path = args.output.join(report_name(args.shard));
    let mut earlier = record::read(&report_path)?;
    for photo in photos {
        let files = Files::of(args, &photo);
        if files.are_complete()? {
            kept.push(earlier.remove(&photo.name_text()).unwrap_or_else(|| Record::kept(args, &photo)));
        } else {
            missing.push(photo);
        }
    }
    let mut records = Report::begin(&report_path, &kept)?;
    let outcome = estimate_all(&Worker { global, args, estimator: &estimator }, &missing, &mut records)?;
    let Outcome { estimated, failed, is_stopped } = outcome;

    let (total, kept) = (kept.len() + missing.len(), kept.len());
    if args.json {
        report::print_json(&json!({
            "photos": total,
            "kept": kept,
            "estimated": estimated,
            "failed": failed,
            "report": report_path,
            "seconds": begun.elapsed().as_secs_f64(),
        }))?;
    } else {
        report::print(&format!(
            "{}  {estimated} of {} estimated, {kept} kept, {failed} failed, in {}",
            args.output.display(),
            report::counted(total, "photo"),
            seconds(begun.elapsed())
        ));
    }
    if is_stopped {
        anyhow::bail!(
            "stopped after {} of {}; run the same command again to continue",
            kept + estimated,
            report::counted(total, "photo")
        );
    }
    if failed > 0 {
        anyhow::bail!("{failed} of {} failed; see {}", report::counted(total, "photo"), report_path.display());
    }
    Ok(())
}

/// Numbers of photos of a run.
struct Outcome {
    estimated: usize,
    failed: usize,
    /// Whether Ctrl-C was pressed.
    is_stopped: bool,
}

/// Estimates photos, as many at a time as there are threads, each on one thread.
///
/// # Errors
/// Wrong options, and results or a report that cannot be written. Failures of single photos are recorded.
fn estimate_all(worker: &Worker<'_>, photos: &[ListedPhoto], records: &mut Report) -> anyhow::Result<Outcome> {
    let mut outcome = Outcome { estimated: 0, failed: 0, is_stopped: false };
    if photos.is_empty() {
        return Ok(outcome);
    }
    let mut progress = Progress::new(worker.global.quiet, photos.len());
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let threads = rayon::current_num_threads().min(photos.len());
    std::thread::scope(|scope| {
        let (sender, results) = mpsc::channel();
        for _ in 0..threads {
            let (sender, next, stop) = (sender.clone(), &next, &stop);
            scope.spawn(move || {
                let take = || photos.get(next.fetch_add(1, Ordering::Relaxed));
                if let Err(error) = worker.run(take, stop, |result| sender.send(result).is_ok()) {
                    // The receiver ends only with this function.
                    let _ = sender.send(Err(Failure::Job(error)));
                }
            });
        }
        drop(sender);
        let mut fatal = None;
        for result in results {
            let added = match result {
                Ok(record) => {
                    progress.add(&record);
                    if record.has_failed() {
                        outcome.failed += 1
                    } else {
                        outcome.estimated += 1
                    }
                    records.add(&record)
                }
                Err(Failure::Stopped) => Ok(()),
                Err(Failure::Job(error)) => Err(error),
            };
            if let Err(error) = added {
                stop.store(true, Ordering::Relaxed);
                // Others fail for the same reason.
                fatal.get_or_insert(error);
            }
        }
        progress.finish();
        outcome.is_stopped = interrupt::requested();
        match fatal {
            Some(error) => Err(error),
            None => Ok(outcome),
        }
    })
}

/// Result files of a photo.
struct Files {
    scene: Option<PathBuf>,
    envmap: Option<PathBuf>,
}

impl Files {
    fn of(args: &Args, photo: &ListedPhoto) -> Self {
        let path = |extension: &str| args.output.join(photo.result_name(extension));
        Self { scene: (!args.no_scenes).then(|| path("scene")), envmap: args.envmap_at.is_some().then(|| path("exr")) }
    }

    /// Whether all files exist and none was cut off, for example by a crash of the machine.
    fn are_complete(&self) -> anyhow::Result<bool> {
        let (scene, envmap) = (self.scene.as_deref(), self.envmap.as_deref());
        Ok(scene.map_or(Ok(true), record::is_complete_scene)? && envmap.is_none_or(is_nonempty_file))
    }
}

fn is_nonempty_file(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|metadata| metadata.is_file() && metadata.len() > 0)
}

/// Returns the name of the report of a part: `report.jsonl` of all photos, `report-03-of-16.jsonl` of a part.
fn report_name([part, parts]: [u32; 2]) -> String {
    if parts == 1 {
        return "report.jsonl".to_owned();
    }
    let width = parts.to_string().len();
    format!("report-{part:0width$}-of-{parts}.jsonl")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_sort_by_their_parts() {
        assert_eq!(report_name([1, 1]), "report.jsonl");
        assert_eq!(report_name([3, 16]), "report-03-of-16.jsonl");
        assert_eq!(report_name([16, 16]), "report-16-of-16.jsonl");
    }
}
