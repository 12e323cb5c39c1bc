//! Evaluates methods on the photos of a dataset.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use lo_dataset::{CropModel, Dataset, DatasetLayout, InteriorNet, Sample, Split, evenly_spread, indices_of};
use lo_events::{Cancelled, OnEvent, Steps};
use lo_imaging::{Image, RadianceImage};
use lo_insert::Quality;
use lo_mesh::MeshError;

use crate::external::ViewWriter;
use crate::insertion::{PhotoObjects, PhotoReference, picture};
use crate::prior::TWO_PANORAMAS_APART;
use crate::stages;
use crate::{
    Cost, EvalError, External, ExternalError, KnownPanorama, Method, MethodError, MethodOutput, Outcome, Protocol,
    ProtocolCrops, ProtocolRenders, Report, Scorer, Sheet, Summary, Tools, memory, walk,
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

    /// Writes the photos with the list of their views, for other programs. Returns their number.
    ///
    /// All files store `generator`, the name of the writing program.
    ///
    /// # Errors
    /// Errors of [`open`](Self::open); unreadable samples; photos without panoramas; files that cannot be written;
    /// [`Cancelled`], which leaves no list.
    pub fn write_views(&self, folder: &Path, generator: &str, on_event: OnEvent<'_>) -> Result<usize, EvalError> {
        let (dataset, indices) = self.open()?;
        let mut writer = ViewWriter::create(folder, generator)?;
        let (photos, mut has_truth) = (indices.len(), false);
        let mut steps = Steps::begin(on_event, stages::WRITE_PHOTOS, indices.len());
        for index in indices {
            if steps.cancelled() {
                return Err(Cancelled.into());
            }
            let sample = dataset.get(index)?;
            has_truth |= !sample.views.is_empty();
            writer.add_photo(&sample)?;
            steps.step();
        }
        steps.end();
        if !has_truth {
            return Err(ExternalError::NoTruth { photos }.into());
        }
        Ok(writer.finish()?)
    }
}

/// An evaluation, ready to [run](Self::run).
pub struct Evaluation<'a> {
    dataset: Box<dyn Dataset>,
    /// Indices of the photos in the dataset.
    indices: Vec<usize>,
    protocol: Option<Protocol>,
    methods: Vec<Method>,
    externals: Vec<External>,
    /// Objects to insert into the photos.
    objects: Option<PhotoObjects>,
    /// Folder of the methods' panoramas, and the name of the writing program.
    panoramas: Option<(PathBuf, String)>,
    tools: Tools<'a>,
}

impl<'a> Evaluation<'a> {
    /// Opens the dataset. If `methods` is empty, selects all that the tools and the first photo allow. The tools'
    /// baselines are always among them.
    ///
    /// # Errors
    /// Unreadable datasets; parts without photos; an unreadable first photo; baselines that were trained on other
    /// networks' features.
    pub fn open(photos: &PhotoSelection, methods: &[Method], tools: Tools<'a>) -> Result<Self, EvalError> {
        let (dataset, indices) = photos.open()?;
        if let Some(networks) = tools.estimator.networks() {
            tools.baselines.iter().try_for_each(|baseline| baseline.check(networks))?;
        }
        let mut methods = if methods.is_empty() {
            let first = dataset.get(indices[0])?;
            let is_possible = |method: &Method| method.has_tools(&tools) && method.takes(&first);
            Method::ALL.into_iter().filter(is_possible).collect()
        } else {
            methods.to_vec()
        };
        methods.extend(tools.baselines.iter().map(|baseline| Method::Baseline(baseline.system())));
        let (protocol, externals) = (photos.protocol, Vec::new());
        Ok(Self { dataset, indices, protocol, methods, externals, objects: None, panoramas: None, tools })
    }

    /// Scores panoramas of other programs, too.
    ///
    /// # Errors
    /// An unreadable first photo, or one that a program's list does not have.
    pub fn with_externals(mut self, externals: Vec<External>) -> Result<Self, EvalError> {
        if !externals.is_empty() {
            let first = self.dataset.get(self.indices[0])?;
            externals.iter().try_for_each(|external| external.entry(&first).map(drop))?;
        }
        self.externals = externals;
        Ok(self)
    }

    /// Inserts three spheres into each photo, lit by each method's panorama, and compares them with those lit by the
    /// true one. Requires an estimator with networks.
    ///
    /// # Errors
    /// Oversized meshes; does not occur.
    pub fn with_objects(mut self, quality: Quality) -> Result<Self, MeshError> {
        self.objects = Some(PhotoObjects::new(quality)?);
        Ok(self)
    }

    /// Returns the methods.
    pub fn methods(&self) -> &[Method] {
        &self.methods
    }

    /// Writes each method's panoramas into a folder of its name in `folder`, in the form that [`External::open`] reads.
    /// The files store `generator`, the name of the writing program.
    pub fn keeping_panoramas(mut self, folder: PathBuf, generator: String) -> Self {
        self.panoramas = Some((folder, generator));
        self
    }

    /// Evaluates all photos.
    ///
    /// A probe moves along a path in `walks` rooms, and `rows` photos are on the contact sheet, both evenly spread. If
    /// the handler cancels or a file cannot be read or written, the report holds the figures so far and the error.
    pub fn run(&self, rows: usize, walks: usize, on_event: OnEvent<'_>) -> Report {
        let count = self.indices.len();
        let scorer = Scorer::new(self.protocol.map(ProtocolRenders::new));
        let [rows, walks] = [rows, walks].map(|most| evenly_spread(count, most).collect::<Vec<usize>>());
        let names = self.methods.iter().map(|method| method.name());
        let methods = names.chain(self.externals.iter().map(External::name)).map(str::to_owned).collect();
        let (summary, sheet) = (Summary::default(), Sheet::default());
        let (objects, without_objects) = (Sheet::default(), BTreeMap::new());
        let mut report =
            Report { methods, summary, sheet, objects, without_objects, photos: 0, asked: count, error: None };
        let mut steps = Steps::begin(on_event, stages::EVALUATE_PHOTOS, count);
        let result = self.writers().and_then(|mut writers| {
            let mut evaluated = Ok(());
            for position in 0..count {
                if steps.cancelled() {
                    break;
                }
                let row = match self.photo(position, &scorer, walks.contains(&position), &mut writers) {
                    Ok(row) => row,
                    Err(error) => {
                        evaluated = Err(error);
                        break;
                    }
                };
                let is_shown = rows.contains(&position);
                if is_shown {
                    report.sheet.add(&row.sample, &row.shown);
                }
                match row.objects {
                    Some(Ok(pictures)) if is_shown => report.objects.add_row(pictures),
                    Some(Err(reason)) => *report.without_objects.entry(reason.to_string()).or_default() += 1,
                    _ => {}
                }
                row.outcomes.into_iter().for_each(|outcome| report.summary.add(outcome));
                report.photos += 1;
                steps.step();
            }
            writers.into_iter().try_for_each(|writer| writer.finish().map(drop))?;
            evaluated
        });
        report.error = result.err();
        steps.end();
        report
    }

    /// Creates a writer of panoramas for each method, if they are kept.
    fn writers(&self) -> Result<Vec<ViewWriter>, EvalError> {
        let Some((folder, generator)) = &self.panoramas else { return Ok(Vec::new()) };
        let writers = self.methods.iter().map(|method| ViewWriter::create(&folder.join(method.name()), generator));
        Ok(writers.collect::<Result<_, _>>()?)
    }

    /// Runs all methods on a photo.
    fn photo(
        &self,
        position: usize,
        scorer: &Scorer,
        walks: bool,
        writers: &mut [ViewWriter],
    ) -> Result<PhotoRow, EvalError> {
        let (sample, known) = self.known_panorama(self.dataset.get(self.indices[position])?);
        let foreign = self.foreign_panorama(position, &sample);
        let reference = self.objects.as_ref().map(|objects| objects.reference(&sample, &self.tools));
        let placed = reference.as_ref().and_then(|reference| reference.as_ref().ok());
        let mut pictures = Vec::new();
        let (mut outcomes, mut shown) = (Vec::new(), Vec::new());
        for (index, &method) in self.methods.iter().enumerate() {
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
            let (mut outcome, panoramas) = outcome(scorer, &sample, method, estimate, walks);
            pictures.extend(placed.map(|placed| insert(placed, &panoramas, &mut outcome)));
            if let Some(writer) = writers.get_mut(index) {
                writer.add_panoramas(&sample, &panoramas)?;
            }
            outcomes.push(outcome);
            shown.push(panoramas.into_iter().next());
        }
        for external in &self.externals {
            let panoramas = external.panoramas(&sample)?;
            let scores = panoramas.as_ref().map(|panoramas| scorer.score_panoramas(&sample, panoramas));
            let mut outcome = Outcome {
                sample: sample.id.clone(),
                scene: sample.scene_id.clone(),
                method: external.name().to_owned(),
                condition: None,
                scores: scores.ok_or(MethodError::Needs(PANORAMAS)),
                cost: None,
            };
            let panoramas = panoramas.unwrap_or_default();
            pictures.extend(placed.map(|placed| insert(placed, &panoramas, &mut outcome)));
            outcomes.push(outcome);
            shown.push(panoramas.into_iter().next());
        }
        let objects = reference.map(|reference| {
            let reference = reference?;
            Ok([sample.photo.clone(), reference.picture()].into_iter().chain(pictures).collect())
        });
        Ok(PhotoRow { sample, outcomes, shown, objects })
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

/// Results of all methods on a photo.
struct PhotoRow {
    sample: Sample,
    outcomes: Vec<Outcome>,
    /// The first panorama of each method.
    shown: Vec<Option<RadianceImage>>,
    /// The photo, and objects in it under the true panorama and each method's; the reason for having none.
    objects: Option<Result<Vec<Image<[u8; 3]>>, MethodError>>,
}

/// Inserts the objects under a method's first panorama: adds their figures and returns their picture.
fn insert(reference: &PhotoReference, panoramas: &[RadianceImage], outcome: &mut Outcome) -> Image<[u8; 3]> {
    let Some(panorama) = panoramas.first() else { return reference.missing() };
    match (reference.under(panorama.clone()), &mut outcome.scores) {
        (Ok(composite), Ok(scores)) => {
            reference.compare(&composite, scores);
            picture(&composite.image)
        }
        (Err(error), Ok(_)) => {
            outcome.scores = Err(error);
            reference.missing()
        }
        (_, Err(_)) => reference.missing(),
    }
}

/// Requirement of another program's panoramas.
const PANORAMAS: &str = "the panorama of each view that views.json names, or that of the photo";

/// Runs a method on a photo and returns its outcome and its panoramas.
fn outcome(
    scorer: &Scorer,
    sample: &Sample,
    method: Method,
    estimate: impl Fn(&Sample) -> Result<MethodOutput, MethodError>,
    walks: bool,
) -> (Outcome, Vec<RadianceImage>) {
    memory::reset_peak();
    let begun = Instant::now();
    let estimate = estimate(sample);
    let mut cost = Cost { estimate_s: begun.elapsed().as_secs_f64(), ..Cost::default() };
    let mut kept = Vec::new();
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
        kept = panoramas;
        scores
    });
    let (id, scene, method) = (sample.id.clone(), sample.scene_id.clone(), method.name().to_owned());
    (Outcome { sample: id, scene, method, condition: None, scores, cost: Some(cost) }, kept)
}
