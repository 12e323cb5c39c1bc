//! Evaluates all methods in all rooms of the insertion protocol.

use std::collections::BTreeMap;
use std::sync::Arc;

use std::path::PathBuf;
use std::time::Instant;

use lo_dataset::{DatasetError, Generator, Sample, evenly_spread};
use lo_events::{OnEvent, Steps};
use lo_geometry::Vec3;
use lo_imaging::{Image, Photo, linear_from_srgb8, srgb8_from_linear};
use lo_insert::{Align, Composite, InsertError, Inserter, Instance, Lighting, Placement, Quality};
use lo_mesh::{MeshError, PreparedModel};
use lo_scene::Estimate;
use lo_synth::{CameraPose, Weather};

use super::compare::{self, Darkening};
use super::footprints::{Footprint, footprints};
use super::method::{InsertionMethod, ObjectLighting};
use super::objects::{PreparedObject, TestObject};
use super::truth::{ObjectTruth, STRIDE, TrueRoom};
use crate::method::{estimate_scene, in_photo_frame};
use crate::sheet::NOTHING;
use crate::stages;
use crate::{Cost, DepthInput, MethodError, Outcome, Report, Scores, Sheet, Summary, Tools, memory};

/// Largest number of rooms to generate per requested room: rooms without footprints are skipped.
const MAX_ROOMS_PER_REQUESTED: u64 = 4;

/// Edge of the contact sheet's crops as a share of the photo's width.
const TILE_SHARE: f32 = 0.4;

/// Evaluation of objects in generated rooms.
pub struct InsertionEvaluation<'a> {
    generator: Generator,
    seed: u64,
    rooms: usize,
    methods: Vec<InsertionMethod>,
    tools: Tools<'a>,
    quality: Quality,
    truths: Option<PathBuf>,
    objects: Vec<PreparedObject>,
}

/// A room with its references.
struct Room {
    sample: Sample,
    condition: &'static str,
    footprints: Vec<Footprint>,
    camera: CameraPose,
    /// Footprint → object → reference.
    truths: Vec<Vec<ObjectTruth>>,
}

/// A scene estimated by the networks from a room's photo and one depth input.
struct Estimated {
    input: Option<DepthInput>,
    estimate: Result<Arc<Estimate>, String>,
    seconds: f64,
}

impl<'a> InsertionEvaluation<'a> {
    /// Prepares an evaluation of the first `rooms` rooms of a generator that have footprints.
    ///
    /// If `methods` is empty, selects all.
    ///
    /// # Errors
    /// Oversized meshes; does not occur.
    pub fn new(
        generator: Generator,
        seed: u64,
        rooms: usize,
        methods: &[InsertionMethod],
        tools: Tools<'a>,
        quality: Quality,
    ) -> Result<Self, MeshError> {
        let methods = if methods.is_empty() { InsertionMethod::ALL.to_vec() } else { methods.to_vec() };
        let objects = PreparedObject::all(&TestObject::ALL)?;
        Ok(Self { generator, seed, rooms, methods, tools, quality, truths: None, objects })
    }

    /// Caches the path-traced references in a folder. Use one folder per seed and configuration.
    #[must_use]
    pub fn with_truth_cache(self, folder: PathBuf) -> Self {
        Self { truths: Some(folder), ..self }
    }

    /// Evaluates all rooms; `rows` rooms are on the contact sheet.
    ///
    /// If the handler cancels or a room cannot be generated, the report holds the figures so far and the reason.
    pub fn run(&self, rows: usize, on_event: OnEvent<'_>) -> Report {
        let rows: Vec<usize> = evenly_spread(self.rooms, rows).collect();
        let (mut summary, mut sheet) = (Summary::default(), Sheet::default());
        let (mut done, mut failure, mut index) = (0, None, 0);
        let mut steps = Steps::begin(on_event, stages::EVALUATE_PHOTOS, self.rooms);
        while done < self.rooms && index < MAX_ROOMS_PER_REQUESTED * self.rooms as u64 && !steps.cancelled() {
            let room = match self.room(index) {
                Ok(room) => room,
                Err(error) => {
                    failure = Some(error.into());
                    break;
                }
            };
            index += 1;
            let Some(room) = room else { continue };
            let mut pictures = vec![room.tile(|pixel| Some(room.reference_pixel(pixel)))];
            let mut estimates: Vec<Estimated> = Vec::new();
            for &method in &self.methods {
                let input = method.input();
                let cached = estimates.iter().position(|estimated| estimated.input == input);
                let cached = cached.unwrap_or_else(|| {
                    estimates.push(self.estimate(&room, input));
                    estimates.len() - 1
                });
                let (outcomes, shown) = self.outcomes(&room, method, &estimates[cached]);
                outcomes.into_iter().for_each(|outcome| summary.add(outcome));
                pictures.push(room.tile(|pixel| shown.as_ref().map(|composite| composite.image.linear_at(pixel))));
            }
            if rows.contains(&done) {
                let photo = Photo::Srgb8(room.sample.photo.clone());
                let photo = room.tile(|pixel| Some(photo.linear_at(pixel)));
                sheet.add_row(std::iter::once(photo).chain(pictures).collect());
            }
            done += 1;
            steps.step();
        }
        steps.end();
        let methods = self.methods.iter().map(|method| method.name().to_owned()).collect();
        let (objects, without_objects) = (Sheet::default(), BTreeMap::new());
        Report { methods, summary, sheet, objects, without_objects, photos: done, asked: self.rooms, error: failure }
    }

    /// Generates room `index`; `None` if it has no footprint.
    fn room(&self, index: u64) -> Result<Option<Room>, DatasetError> {
        let interior = self.generator.interior(index)?;
        let camera = interior.camera_poses(1)[0];
        let bare = PreparedModel::new(interior.world.model.clone());
        let footprints = footprints(&interior, &bare, &camera, self.seed);
        if footprints.is_empty() {
            return Ok(None);
        }
        let (world, condition) = (interior.world.clone(), condition(interior.description.weather));
        let centres = footprints.iter().map(|footprint| footprint.base_m + Vec3::Y * footprint.radius_m);
        let record = self.generator.record_with_panoramas(index, interior, &camera, centres)?;
        let failed = |reason: String| DatasetError::Generate { scene_id: record.scene_id.clone(), reason };
        let cache = self.truths.as_ref().map(|folder| folder.join(format!("{}.json", record.key)));
        let truths = match cache.as_ref().and_then(|path| std::fs::read(path).ok()) {
            Some(bytes) => serde_json::from_slice(&bytes).map_err(|error| failed(error.to_string()))?,
            None => {
                let room = TrueRoom::new(world, bare, camera, record.shots[0].gains, self.seed)
                    .map_err(|error| failed(error.to_string()))?;
                let of_place = |footprint: &Footprint| {
                    let of_object = |object: &PreparedObject| room.trace(object.kind, object.model.model(), footprint);
                    self.objects.iter().map(of_object).collect::<Result<Vec<ObjectTruth>, _>>()
                };
                let truths: Vec<Vec<ObjectTruth>> = footprints
                    .iter()
                    .map(of_place)
                    .collect::<Result<_, _>>()
                    .map_err(|error| failed(error.to_string()))?;
                if let Some(path) = &cache {
                    let text = serde_json::to_vec(&truths).map_err(|error| failed(error.to_string()))?;
                    std::fs::write(path, text).map_err(|error| failed(error.to_string()))?;
                }
                truths
            }
        };
        Ok(Some(Room { sample: record.sample(0), condition, footprints, camera, truths }))
    }

    /// Estimates the scene of a room by the networks.
    fn estimate(&self, room: &Room, input: Option<DepthInput>) -> Estimated {
        let begun = Instant::now();
        let estimate = estimate_scene(&room.sample, input, &self.tools).map_err(|error| error.to_string());
        Estimated { input, estimate, seconds: begun.elapsed().as_secs_f64() }
    }

    /// Returns an outcome for each footprint, and the composite of the first object at the first footprint.
    fn outcomes(
        &self,
        room: &Room,
        method: InsertionMethod,
        estimated: &Estimated,
    ) -> (Vec<Outcome>, Option<Composite>) {
        let mut shown = None;
        let outcome = |number: usize, scores, cost| Outcome {
            sample: format!("{}-{number}", room.sample.id),
            scene: room.sample.scene_id.clone(),
            method: method.name().to_owned(),
            condition: Some(room.condition),
            scores,
            cost: Some(cost),
        };
        let insertion = |error: &dyn std::error::Error| MethodError::Insertion(error.to_string());
        let estimate = estimated.estimate.as_ref().map_err(|reason| MethodError::Insertion(reason.clone()));
        let lit = estimate
            .and_then(|estimate| ObjectLighting::new(method, &room.sample, estimate, &self.tools))
            .and_then(|lit| {
                let inserter = lit.lighting().map(|lighting| Inserter::new(&lit.scene, lighting, self.quality));
                Ok((inserter.transpose().map_err(|error| insertion(&error))?, lit))
            });
        let (inserter, lit) = match lit {
            Ok(lit) => lit,
            Err(error) => return (vec![outcome(0, Err(error), Cost::default())], None),
        };
        let mut outcomes = Vec::new();
        for number in 0..room.footprints.len() {
            memory::reset_peak();
            let begun = Instant::now();
            let figures = self.figures(room, number, &lit, inserter.as_ref(), &mut shown);
            let panorama_s = begun.elapsed().as_secs_f64();
            let cost = Cost { estimate_s: estimated.seconds, panorama_s, peak_mib: memory::peak_mib() };
            outcomes.push(outcome(number, figures.map_err(|error| insertion(&error)), cost));
        }
        (outcomes, shown)
    }

    /// Scores all objects at one footprint.
    ///
    /// `inserter` is shared by all footprints; `None` if each footprint has its own light.
    fn figures(
        &self,
        room: &Room,
        number: usize,
        lit: &ObjectLighting,
        inserter: Option<&Inserter>,
        shown: &mut Option<Composite>,
    ) -> Result<Scores, InsertError> {
        let (footprint, view) = (&room.footprints[number], &room.sample.views[number]);
        let own;
        let inserter = match inserter {
            Some(inserter) => inserter,
            None => {
                let lighting = Lighting::EnvironmentMap(in_photo_frame(view));
                own = Inserter::new(&lit.scene, lighting, self.quality)?;
                &own
            }
        };
        let mut scores = Scores::default();
        let [u, v] = footprint.pixel;
        let resting = Placement::rest_on_pixel(&lit.scene, u, v, Align::Gravity)?;
        // Keep the true apparent size, whatever the estimated depth.
        let true_m = room.camera.pose.rotation.inverse() * (footprint.base_m - room.camera.pose.position);
        let scale = footprint.radius_m * resting.position_m.length() / true_m.length();
        let radii = |pixel: [usize; 2]| footprint.radii_from_base(&room.camera, pixel.map(|v| v as f64 + 0.5));
        let (mut shadow_rms, mut correlations, mut darkening) = (Vec::new(), Vec::new(), [Darkening::default(); 2]);
        for (PreparedObject { kind, model, base }, truth) in self.objects.iter().zip(&room.truths[number]) {
            let placement = resting.scaled(scale).settled(&lit.scene, base);
            let composite = inserter.render(&[Instance::new(model, placement)], &mut lo_events::ignore)?;
            if let Some([rmse, si_rmse]) = compare::object(truth, &composite) {
                scores.add(format!("object_{}_rmse", kind.name()), Some(rmse));
                scores.add(format!("object_{}_si_rmse", kind.name()), Some(si_rmse));
            }
            if kind.casts()
                && let Some(figures) = compare::shadow(truth, &composite, radii)
            {
                scores.add(format!("shadow_{}_rms", kind.name()), Some(figures.rms));
                shadow_rms.push(figures.rms);
                correlations.extend(figures.gradient_correlation);
                darkening.iter_mut().zip(figures.darkening).for_each(|(sum, part)| *sum += part);
            }
            if number == 0 && *kind == TestObject::Diffuse {
                *shown = Some(composite);
            }
        }
        let mean = |values: &[f64]| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        scores.add("shadow_rms", mean(&shadow_rms));
        scores.add("shadow_gradient_correlation", mean(&correlations));
        if !shadow_rms.is_empty() {
            for (zone, Darkening { truth, got }) in ["near", "far"].into_iter().zip(darkening) {
                scores.add(format!("shadow_darkening_{zone}"), Some(got));
                scores.add(format!("true_shadow_darkening_{zone}"), Some(truth));
            }
        }
        let centre_m = resting.position_m + resting.up * scale;
        let panorama = lit.panorama(centre_m, view);
        if let Some((angle_deg, intensity)) = compare::dominant_lights(&in_photo_frame(view), &panorama) {
            scores.add("dominant_deg", Some(angle_deg));
            scores.add("dominant_log2_intensity", intensity);
        }
        Ok(scores)
    }
}

/// Returns the lighting condition of the tables.
fn condition(weather: Weather) -> &'static str {
    match weather {
        Weather::Clear | Weather::Sunset => "sunny",
        Weather::Overcast => "overcast",
        Weather::Night => "night",
        Weather::Panorama => "panorama",
    }
}

impl Room {
    /// Renders a square crop around the first footprint.
    fn tile(&self, colour: impl Fn((usize, usize)) -> Option<[f32; 3]>) -> Image<[u8; 3]> {
        let (width, height) = (self.sample.photo.width(), self.sample.photo.height());
        let edge = ((TILE_SHARE * width as f32) as usize).min(height);
        let start = |centre: f64, size: usize| (centre as usize).saturating_sub(edge / 2).min(size - edge);
        let [u, v] = self.footprints[0].pixel;
        let (left, top) = (start(u, width), start(v, height));
        Image::from_fn(edge, edge, |x, y| colour((left + x, top + y)).map_or(NOTHING, |rgb| rgb.map(srgb8_from_linear)))
    }

    /// Returns a pixel of the photo with the reference of the first object, where available.
    fn reference_pixel(&self, (x, y): (usize, usize)) -> [f32; 3] {
        let truth = &self.truths[0][0];
        let near = |values: &[([usize; 2], [f32; 3])]| {
            let is_near =
                |([u, v], _): &&([usize; 2], [f32; 3])| (*u..u + STRIDE).contains(&x) && (*v..v + STRIDE).contains(&y);
            values.iter().find(is_near).map(|(_, value)| *value)
        };
        let photo = self.sample.photo[(x, y)].map(linear_from_srgb8);
        match (near(&truth.object), near(&truth.shadow)) {
            (Some(object), _) => object,
            (None, Some(ratio)) => [photo[0] * ratio[0], photo[1] * ratio[1], photo[2] * ratio[2]],
            (None, None) => photo,
        }
    }
}
