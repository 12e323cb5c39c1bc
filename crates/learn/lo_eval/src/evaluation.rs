//! An evaluation as a whole: every method on every photo of a part of a dataset.

use std::path::{Path, PathBuf};
use std::time::Instant;

use lo_dataset::{CropModel, Dataset, DatasetError, DatasetLayout, Sample, Split, evenly_spread, indices_of};
use lo_events::{OnEvent, Stage, Steps};

use crate::prior::TWO_APART;
use crate::{
    Cost, Estimate, KnownPanorama, Method, MethodError, Outcome, Protocol, ProtocolCrops, ProtocolRenders, Report,
    Scorer, Sheet, Summary, Tools, memory, walk,
};

/// Which photos of which dataset.
#[derive(Clone, Debug)]
pub struct Photos {
    /// A folder in one of the layouts, or a shard.
    pub dataset: PathBuf,
    /// How its files are laid out; found out where `None`.
    pub layout: Option<DatasetLayout>,
    /// A published protocol, with its own crops of a folder of panoramas.
    pub protocol: Option<Protocol>,
    /// How photos are made where there are none and no protocol says how.
    pub crops: CropModel,
    /// A folder with plans of the panoramas' rooms, by which depth is known.
    pub plans: Option<PathBuf>,
    /// The part of the dataset; all of it where `None`.
    pub part: Option<Split>,
    /// No more photos than this, evenly spread.
    pub most: Option<usize>,
}

/// Why nothing can be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// The dataset cannot be opened, or its first sample not be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// No photo is in the part that was asked for.
    #[error("{}: none of {photos} photos is in that part", dataset.display())]
    NoPhotos {
        /// The dataset.
        dataset: PathBuf,
        /// Photos in all of it.
        photos: usize,
    },
}

impl Photos {
    /// Opens the dataset, and gives the numbers of the photos in it, at least one.
    ///
    /// # Errors
    /// A dataset that cannot be opened; a part without photos.
    pub fn open(&self) -> Result<(Box<dyn Dataset>, Vec<usize>), EvalError> {
        let path: &Path = &self.dataset;
        let dataset: Box<dyn Dataset> = match (self.protocol, self.layout) {
            (Some(protocol), _) => Box::new(ProtocolCrops::open(path, protocol)?),
            (None, layout) => {
                let layout = layout.map_or_else(|| DatasetLayout::detect(path), Ok)?;
                layout.open_with_plans(path, self.crops, self.plans.as_deref())?
            }
        };
        let indices = indices_of(dataset.as_ref(), self.part, self.most);
        if indices.is_empty() {
            return Err(EvalError::NoPhotos { dataset: self.dataset.clone(), photos: dataset.len() });
        }
        Ok((dataset, indices))
    }
}

/// An evaluation that is ready to [run](Self::run).
pub struct Evaluation<'a> {
    dataset: Box<dyn Dataset>,
    /// Its photos, by their numbers in the dataset.
    indices: Vec<usize>,
    protocol: Option<Protocol>,
    methods: Vec<Method>,
    tools: Tools<'a>,
}

impl<'a> Evaluation<'a> {
    /// Opens the dataset. Without `methods`: all that the tools and the first photo suffice for.
    ///
    /// # Errors
    /// A dataset that cannot be opened; a part without photos; a first photo that cannot be read.
    pub fn open(photos: &Photos, methods: &[Method], tools: Tools<'a>) -> Result<Self, EvalError> {
        let (dataset, indices) = photos.open()?;
        let methods = if methods.is_empty() {
            let first = dataset.get(indices[0])?;
            let able = |method: &Method| method.has_tools(&tools) && method.takes(&first);
            Method::ALL.into_iter().filter(able).collect()
        } else {
            methods.to_vec()
        };
        Ok(Self { dataset, indices, protocol: photos.protocol, methods, tools })
    }

    /// Evaluates photo after photo; a probe walks a metre in `walks` of the rooms, and `rows` photos are on the sheet, both evenly spread.
    ///
    /// Where the handler asks for the end or a photo cannot be read, the report says so and holds the figures so far.
    pub fn run(&self, rows: usize, walks: usize, on_event: OnEvent<'_>) -> Report {
        let count = self.indices.len();
        let scorer = Scorer::new(self.protocol.map(ProtocolRenders::new));
        let [rows, walks] = [rows, walks].map(|most| evenly_spread(count, most).collect::<Vec<usize>>());
        let (mut summary, mut sheet) = (Summary::default(), Sheet::default());
        let (mut done, mut unreadable) = (0, None);
        let mut steps = Steps::begin(on_event, Stage::EvaluatePhotos, count);
        for (position, &index) in self.indices.iter().enumerate() {
            if steps.cancelled() {
                break;
            }
            let sample = match self.dataset.get(index) {
                Ok(sample) => sample,
                Err(error) => {
                    unreadable = Some(error);
                    break;
                }
            };
            let (sample, known) = self.known_panorama(sample);
            let foreign = self.foreign_panorama(position, &sample);
            let mut shown = Vec::new();
            for &method in &self.methods {
                let tools = Tools {
                    known: known.as_ref().and_then(|known| known.as_ref().ok()),
                    foreign: foreign.as_ref(),
                    ..self.tools
                };
                let reason = known.as_ref().and_then(|known| known.as_ref().err());
                let estimate = |sample: &Sample| match reason {
                    Some(reason) => Err(MethodError::Needs(reason)),
                    None => method.estimate(sample, &tools),
                };
                let (outcome, panorama) = outcome(&scorer, &sample, method, estimate, walks.contains(&position));
                summary.add(outcome);
                shown.push(panorama);
            }
            if rows.contains(&position) {
                sheet.add(&sample, &shown);
            }
            done += 1;
            steps.step();
        }
        steps.end();
        let methods = self.methods.iter().map(|method| method.name()).collect();
        Report { methods, summary, sheet, photos: done, asked: count, unreadable }
    }

    /// With a method that knows a panorama of the room: that one, or what is lacking, and the sample with those that are scored. All methods are, for
    /// their figures to be comparable.
    fn known_panorama(&self, mut sample: Sample) -> (Sample, Option<Result<KnownPanorama, &'static str>>) {
        if !self.methods.iter().any(|method| method.knows_panorama()) {
            return (sample, None);
        }
        let known = KnownPanorama::take(&mut sample);
        (sample, Some(known.map_err(|_| TWO_APART)))
    }

    /// Of the next photo's room that is another one, where a method asks for it.
    fn foreign_panorama(&self, position: usize, sample: &Sample) -> Option<KnownPanorama> {
        if !self.methods.iter().any(|method| method.takes_foreign_panorama()) {
            return None;
        }
        let count = self.indices.len();
        let others = (1..count).map(|step| self.indices[(position + step) % count]);
        others.filter_map(|index| self.dataset.get(index).ok()).find_map(|mut other| {
            if other.scene_id == sample.scene_id {
                return None;
            }
            KnownPanorama::take(&mut other).ok()
        })
    }
}

/// What comes of a method on a photo, and its first panorama.
fn outcome(
    scorer: &Scorer,
    sample: &Sample,
    method: Method,
    estimate: impl Fn(&Sample) -> Result<Estimate, MethodError>,
    walks: bool,
) -> (Outcome, Option<lo_imaging::RadianceImage>) {
    memory::restart_peak();
    let begun = Instant::now();
    let estimate = estimate(sample);
    let mut cost = Cost { estimate_s: begun.elapsed().as_secs_f64(), ..Cost::default() };
    let mut shown = None;
    let scores = estimate.map(|estimate| {
        let begun = Instant::now();
        let panoramas = Scorer::panoramas(sample, &estimate);
        cost.panorama_s = begun.elapsed().as_secs_f64() / panoramas.len().max(1) as f64;
        cost.peak_mib = memory::peak_mib();
        let mut scores = scorer.score(sample, &estimate, &panoramas);
        if walks && let Some(found) = walk(sample, &estimate) {
            scores.add("walk_step_ratio", found.largest_step_ratio);
            scores.add("walk_parallax_px", found.parallax_px);
        }
        shown = panoramas.into_iter().next();
        scores
    });
    let (id, scene) = (sample.id.clone(), sample.scene_id.clone());
    (Outcome { sample: id, scene, method: method.name(), condition: None, scores, cost }, shown)
}
