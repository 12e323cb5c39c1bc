//! Rendering of a study's videos, and its folder.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use lo_dataset::Sample;
use lo_eval::{DepthInput, InsertionMethod, MethodError, ObjectLighting, Tools, estimate_scene};
use lo_events::{OnEvent, Steps};
use lo_imaging as imaging;
use lo_insert::{Base, InsertError, Inserter, Instance};
use lo_scene::Estimate;
use lo_synth::CameraPose;

use crate::motion::Motion;
use crate::page;
use crate::plan::PlannedRoom;
use crate::{Study, StudyError, Video, stages};

/// Frames of a study after making it, as far as it got.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Made {
    /// Frames of all videos.
    pub frames: usize,
    /// Frames that existed before.
    pub kept: usize,
    /// Frames written.
    pub written: usize,
}

impl Made {
    /// Whether all frames and the page exist.
    pub fn is_complete(&self) -> bool {
        self.kept + self.written == self.frames
    }
}

/// A video and its missing frames.
struct MissingFrames<'a> {
    video: &'a Video,
    method: InsertionMethod,
    frames: Vec<u32>,
}

impl Study<'_> {
    /// Renders the missing frames into a folder and, when all are there, writes the page.
    ///
    /// Existing frames must be those of this study. `generator` is the name of the program, for the frames' metadata.
    /// If the handler cancels, the folder has the frames so far, and another call continues.
    ///
    /// # Errors
    /// Failures of a method in a room, and files that cannot be written.
    pub fn make(
        &self,
        folder: &Path,
        tools: &Tools,
        generator: &str,
        on_event: OnEvent<'_>,
    ) -> Result<Made, StudyError> {
        let frames = self.key().videos.len() * self.config.frames as usize;
        let missing: Vec<Vec<MissingFrames>> = self.rooms.iter().map(|room| self.missing(folder, room)).collect();
        let count = missing.iter().flatten().map(|video| video.frames.len()).sum();
        let mut made = Made { frames, kept: frames - count, written: 0 };
        let mut steps = Steps::begin(on_event, stages::RENDER_FRAMES, count);
        for (room, videos) in self.rooms.iter().zip(&missing) {
            if videos.is_empty() || steps.cancelled() {
                continue;
            }
            let room = RoomRenderer::new(self, room)?;
            let mut estimates = Vec::new();
            for video in videos {
                if steps.cancelled() {
                    break;
                }
                create_folder(&video_path(folder, &video.video.id))?;
                room.render(video, tools, &mut estimates, |frame, image| {
                    let path = frame_path(folder, &video.video.id, frame);
                    imaging::write_photo(path, image, generator)?;
                    made.written += 1;
                    steps.step();
                    Ok(!steps.cancelled())
                })?;
            }
        }
        steps.end();
        if made.is_complete() {
            page::write(folder, self)?;
        }
        Ok(made)
    }

    /// Returns the videos of a room that lack frames.
    fn missing(&self, folder: &Path, room: &PlannedRoom) -> Vec<MissingFrames<'_>> {
        let videos = self.key().videos.iter().filter(|video| video.room == room.id);
        let with_frames = videos.zip(self.methods.all()).map(|(video, method)| {
            // A frame is written as a whole, but power can fail before its contents are on the disk.
            let has_bytes = |path: PathBuf| std::fs::metadata(path).is_ok_and(|metadata| metadata.len() > 0);
            let is_missing = |frame: &u32| !has_bytes(frame_path(folder, &video.id, *frame));
            MissingFrames { video, method, frames: (0..self.config.frames).filter(is_missing).collect() }
        });
        with_frames.filter(|video| !video.frames.is_empty()).collect()
    }
}

/// Returns the folder of a video.
fn video_path(folder: &Path, video: &str) -> PathBuf {
    folder.join(page::VIDEO_FOLDER).join(video)
}

/// Returns the path of a frame.
fn frame_path(folder: &Path, video: &str, frame: u32) -> PathBuf {
    video_path(folder, video).join(page::frame_name(frame))
}

fn create_folder(path: &Path) -> Result<(), StudyError> {
    let with_path = |error: io::Error| io::Error::new(error.kind(), format!("{}: {error}", path.display()));
    std::fs::create_dir_all(path).map_err(|error| StudyError::Io(with_path(error)))
}

/// An estimate by the networks with one depth input.
type CachedEstimate = (Option<DepthInput>, Arc<Estimate>);

/// Renders videos of one room.
struct RoomRenderer<'a> {
    study: &'a Study<'a>,
    room: &'a PlannedRoom,
    view: CameraPose,
    base: Base,
    sample: Sample,
}

impl<'a> RoomRenderer<'a> {
    fn new(study: &'a Study, room: &'a PlannedRoom) -> Result<Self, StudyError> {
        let interior = study.generator.interior(room.index)?;
        let view = interior.camera_poses(1)[0];
        let record = study.generator.record_with_panoramas(room.index, interior, &view, [])?;
        Ok(Self { study, room, view, base: Base::new(study.objects[0]), sample: record.sample(0) })
    }

    /// Renders the missing frames of a video. `write` returns whether to continue.
    fn render(
        &self,
        missing: &MissingFrames,
        tools: &Tools,
        estimates: &mut Vec<CachedEstimate>,
        mut write: impl FnMut(u32, &imaging::Photo) -> Result<bool, StudyError>,
    ) -> Result<(), StudyError> {
        let method = missing.method.name();
        let of_method = |source: MethodError| StudyError::Method { method, room: self.room.id.clone(), source };
        let of_insert = |source: InsertError| StudyError::Insert { method, room: self.room.id.clone(), source };
        let estimate = self.estimate(missing.method.input(), tools, estimates).map_err(of_method)?;
        let lit = ObjectLighting::new(missing.method, &self.sample, &estimate, tools).map_err(of_method)?;
        let lighting = lit.lighting().expect("methods with one light for each footprint are refused");
        let inserter = Inserter::new(&lit.scene, lighting, self.study.config.quality).map_err(of_insert)?;
        let motion = Motion {
            path: &self.room.path,
            view: &self.view,
            base: &self.base,
            frames: self.study.config.frames,
            turn_rad: self.study.config.turn_deg.to_radians(),
        };
        let no_surface = || StudyError::NoSurface { method, room: self.room.id.clone() };
        let placements = motion.placements(&lit.scene).ok_or_else(no_surface)?;
        for &frame in &missing.frames {
            let [left, right] = placements[frame as usize];
            let instances = [Instance::new(self.study.objects[0], left), Instance::new(self.study.objects[1], right)];
            let composite = inserter.render(&instances, &mut lo_events::ignore).map_err(of_insert)?;
            if !write(frame, &composite.image)? {
                break;
            }
        }
        Ok(())
    }

    /// Estimates the scene with a depth input, once.
    fn estimate(
        &self,
        input: Option<DepthInput>,
        tools: &Tools,
        estimates: &mut Vec<CachedEstimate>,
    ) -> Result<Arc<Estimate>, MethodError> {
        if let Some((_, estimate)) = estimates.iter().find(|(of_input, _)| *of_input == input) {
            return Ok(Arc::clone(estimate));
        }
        let estimate = estimate_scene(&self.sample, input, tools)?;
        estimates.push((input, Arc::clone(&estimate)));
        Ok(estimate)
    }
}
