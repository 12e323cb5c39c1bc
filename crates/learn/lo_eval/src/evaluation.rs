//! Evaluates methods on the photos of a dataset.

use std::path::{Path, PathBuf};
use std::time::Instant;

use lo_dataset::{
    CropModel, Dataset, DatasetError, DatasetLayout, InteriorNet, Sample, Split, evenly_spread, indices_of,
};
use lo_events::{OnEvent, Steps};

use crate::prior::TWO_PANORAMAS_APART;
use crate::stages;
use crate::{
    Cost, KnownPanorama, Method, MethodError, MethodOutput, Outcome, Protocol, ProtocolCrops, ProtocolRenders, Report,
    Scorer, Sheet, Summary, Tools, memory, walk,
};

/// Selects photos of a dataset.
#[derive(Clone, Debug)]
pub struct PhotoSelection {
    /// A dataset folder or a shard.
    pub dataset: PathBuf,
    /// DatasetLayout of the files; detected if `None`.
    pub layout: Option<DatasetLayout>,
    /// A published protocol, which defines its own crops of panoramas.
    pub protocol: Option<Protocol>,
    /// Whether photos and panoramas of InteriorNet are chosen as Lighthouse's authors chose them
    /// ([`InteriorNet::as_lighthouse`]), or those of its test set are used.
    pub as_lighthouse: bool,
    /// Cameras of the crops of panoramas, without a protocol.
    pub crops: CropModel,
    /// Folder of floor plans of the panoramas' rooms, which provide depth.
    pub plans: Option<PathBuf>,
    /// Part of the dataset; all of it if `None`.
    pub part: Option<Split>,
    /// Largest number of photos, evenly spread; all if `None`.
    pub most: Option<usize>,
}

/// Errors of opening an evaluation.
#[derive(Debug, thiserror::Error)]
pub enum EvalError {
    /// The dataset or its first sample cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Lighthouse's choices are asked for of another dataset.
    #[error("{}: InteriorNet or Lighthouse's test set is needed, but the layout is {layout}", dataset.display())]
    NotInteriorNet {
        /// The dataset.
        dataset: PathBuf,
        /// Name of its layout.
        layout: &'static str,
    },
    /// The selected part has no photos.
    #[error("{}: none of the {photos} photos is in the selected part", dataset.display())]
    NoPhotos {
        /// The dataset.
        dataset: PathBuf,
        /// Photos in the whole dataset.
        photos: usize,
    },
}

impl PhotoSelection {
    /// Opens the dataset and returns the indices of the selected photos, at least one.
    ///
    /// # Errors
    /// Unreadable datasets, and those that a protocol does not take; parts without photos.
    pub fn open(&self) -> Result<(Box<dyn Dataset>, Vec<usize>), EvalError> {
        let path: &Path = &self.dataset;
        let dataset: Box<dyn Dataset> = match (self.protocol, self.layout) {
            (Some(protocol), _) => Box::new(ProtocolCrops::open(path, protocol)?),
            (None, layout) => {
                let layout = layout.map_or_else(|| DatasetLayout::detect(path), Ok)?;
                match layout {
                    DatasetLayout::InteriorNet if self.as_lighthouse => {
                        Box::new(InteriorNet::open(path, self.crops.seed)?.as_lighthouse(path)?)
                    }
                    other if self.as_lighthouse && other != DatasetLayout::Lighthouse => {
                        return Err(EvalError::NotInteriorNet { dataset: path.to_owned(), layout: other.name() });
                    }
                    layout => layout.open_with_plans(path, self.crops, self.plans.as_deref())?,
                }
            }
        };
        let indices = indices_of(dataset.as_ref(), self.part, self.most);
        if indices.is_empty() {
            return Err(EvalError::NoPhotos { dataset: self.dataset.clone(), photos: dataset.len() });
        }
        Ok((dataset, indices))
    }
}

/// An evaluation, ready to [run](Self::run).
pub struct Evaluation<'a> {
    dataset: Box<dyn Dataset>,
    /// Indices of the photos in the dataset.
    indices: Vec<usize>,
    protocol: Option<Protocol>,
    methods: Vec<Method>,
    tools: Tools<'a>,
}

impl<'a> Evaluation<'a> {
    /// Opens the dataset. If `methods` is empty, selects all that the tools and the first photo allow.
    ///
    /// # Errors
    /// Unreadable datasets; parts without photos; an unreadable first photo.
    pub fn open(photos: &PhotoSelection, methods: &[Method], tools: Tools<'a>) -> Result<Self, EvalError> {
        let (dataset, indices) = photos.open()?;
        let methods = if methods.is_empty() {
            let first = dataset.get(indices[0])?;
            let is_possible = |method: &Method| method.has_tools(&tools) && method.takes(&first);
            Method::ALL.into_iter().filter(is_possible).collect()
        } else {
            methods.to_vec()
        };
        Ok(Self { dataset, indices, protocol: photos.protocol, methods, tools })
    }

    /// Evaluates all photos.
    ///
    /// A probe moves along a path in `walks` rooms, and `rows` photos are on the contact sheet, both evenly spread. If
    /// the handler cancels or a photo cannot be read, the report holds the figures so far and the reason.
    pub fn run(&self, rows: usize, walks: usize, on_event: OnEvent<'_>) -> Report {
        let count = self.indices.len();
        let scorer = Scorer::new(self.protocol.map(ProtocolRenders::new));
        let [rows, walks] = [rows, walks].map(|most| evenly_spread(count, most).collect::<Vec<usize>>());
        let (mut summary, mut sheet) = (Summary::default(), Sheet::default());
        let (mut done, mut unreadable) = (0, None);
        let mut steps = Steps::begin(on_event, stages::EVALUATE_PHOTOS, count);
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

    /// Takes the known panorama out of the sample, if any method uses one.
    ///
    /// All methods are then scored on the remaining panoramas, so that their figures are comparable. The inner error
    /// names what the sample lacks.
    fn known_panorama(&self, mut sample: Sample) -> (Sample, Option<Result<KnownPanorama, &'static str>>) {
        if !self.methods.iter().any(|method| method.knows_panorama()) {
            return (sample, None);
        }
        let known = KnownPanorama::take(&mut sample);
        (sample, Some(known.map_err(|_| TWO_PANORAMAS_APART)))
    }

    /// Returns a panorama of the next photo in a different room, if any method uses one.
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

/// Runs a method on a photo and returns its outcome and its first panorama.
fn outcome(
    scorer: &Scorer,
    sample: &Sample,
    method: Method,
    estimate: impl Fn(&Sample) -> Result<MethodOutput, MethodError>,
    walks: bool,
) -> (Outcome, Option<lo_imaging::RadianceImage>) {
    memory::reset_peak();
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
