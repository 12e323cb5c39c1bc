//! All methods in all rooms.

use std::path::PathBuf;
use std::time::Instant;

use lightoctree::insert::{Align, Base, Composite, Inserter, Instance, Placement, Quality};
use lightoctree::mesh::PreparedModel;
use lightoctree::scene::Scene;
use lo_dataset::{DatasetError, Generator, Sample, evenly_spread};
use lo_events::{OnEvent, Stage, Steps};
use lo_geometry::Vec3;
use lo_imaging::{Image, Photo, linear_from_srgb8, srgb8_from_linear};
use lo_synth::{CameraPose, Interior, Weather};

use super::compare;
use super::method::{InsertionMethod, Lit, in_photo_frame, scene_of};
use super::objects::Kind;
use super::places::{Place, places};
use super::truth::{STRIDE, TrueRoom, Truth};
use crate::{Cost, MethodError, Outcome, Report, Scores, Sheet, Summary, Tools, memory};

/// Rooms without a place for an object are passed over, at most so many for each that is wanted.
const MAX_PASSED: u64 = 4;

/// Edge of the sheet's pictures in pixels of the photo, as a share of its width.
const TILE_SHARE: f32 = 0.4;

/// Objects in generated rooms.
pub struct InsertionEvaluation<'a> {
    generator: Generator,
    seed: u64,
    rooms: usize,
    methods: Vec<InsertionMethod>,
    tools: Tools<'a>,
    quality: Quality,
    truths: Option<PathBuf>,
}

/// One room with what is true of it.
struct Room {
    sample: Sample,
    condition: &'static str,
    places: Vec<Place>,
    camera: CameraPose,
    /// Of each place, of each kind.
    truths: Vec<Vec<Truth>>,
}

impl<'a> InsertionEvaluation<'a> {
    /// Objects in the first `rooms` rooms of a generator that have a place for them. Without `methods`: all of them.
    pub fn new(
        generator: Generator,
        seed: u64,
        rooms: usize,
        methods: &[InsertionMethod],
        tools: Tools<'a>,
        quality: Quality,
    ) -> Self {
        let methods = if methods.is_empty() { InsertionMethod::ALL.to_vec() } else { methods.to_vec() };
        Self { generator, seed, rooms, methods, tools, quality, truths: None }
    }

    /// Keeps what is path traced in a folder, and takes it from there where it is: the same seed and configuration give the same.
    #[must_use]
    pub fn keeping_truths(self, folder: PathBuf) -> Self {
        Self { truths: Some(folder), ..self }
    }

    /// Evaluates room after room; `rows` places are on the sheet.
    ///
    /// Where the handler asks for the end or a room cannot be made, the report says so and holds the figures so far.
    pub fn run(&self, rows: usize, on_event: OnEvent<'_>) -> Report {
        let rows: Vec<usize> = evenly_spread(self.rooms, rows).collect();
        let (mut summary, mut sheet) = (Summary::default(), Sheet::default());
        let (mut done, mut unreadable, mut index) = (0, None, 0);
        let mut steps = Steps::begin(on_event, Stage::EvaluatePhotos, self.rooms);
        while done < self.rooms && index < MAX_PASSED * self.rooms as u64 && !steps.cancelled() {
            let room = match self.room(index) {
                Ok(room) => room,
                Err(error) => {
                    unreadable = Some(error);
                    break;
                }
            };
            index += 1;
            let Some(room) = room else { continue };
            let mut pictures = vec![room.tile(|pixel| Some(room.true_picture(pixel)))];
            let mut scenes: Vec<(Option<crate::DepthInput>, Result<Scene, String>, f64)> = Vec::new();
            for &method in &self.methods {
                let input = method.input();
                if !scenes.iter().any(|(own, ..)| *own == input) {
                    let begun = Instant::now();
                    let scene = scene_of(input, &room.sample, &self.tools).map_err(|error| error.to_string());
                    scenes.push((input, scene, begun.elapsed().as_secs_f64()));
                }
                let found = scenes.iter().find(|(own, ..)| *own == input);
                let (scene, estimate_s) = match found {
                    Some((_, scene, seconds)) => (scene.as_ref().map_err(Clone::clone), *seconds),
                    None => continue,
                };
                let (outcomes, shown) = self.outcomes(&room, method, scene, estimate_s);
                outcomes.into_iter().for_each(|outcome| summary.add(outcome));
                pictures.push(room.tile(|pixel| shown.as_ref().map(|composite| linear(&composite.image, pixel))));
            }
            if rows.contains(&done) {
                let photo = room.tile(|pixel| Some(linear(&Photo::Srgb8(room.sample.photo.clone()), pixel)));
                sheet.add_row(std::iter::once(photo).chain(pictures).collect());
            }
            done += 1;
            steps.step();
        }
        steps.end();
        let methods = self.methods.iter().map(|method| method.name()).collect();
        Report { methods, summary, sheet, photos: done, asked: self.rooms, unreadable }
    }

    /// Room `index` of the generator, where it has a place for an object.
    fn room(&self, index: u64) -> Result<Option<Room>, DatasetError> {
        let mut found = None;
        let mut choose = |interior: &Interior, camera: &CameraPose| {
            let places = places(interior, camera, self.seed);
            let centres = places.iter().map(|place| place.base_m + Vec3::Y * place.radius_m).collect();
            found = Some((places, *camera, condition(interior.description.weather)));
            centres
        };
        let interior = self.generator.interior(index)?;
        // Asked before the room's light is made, which is most of the work.
        if places(&interior, &interior.camera_poses(1)[0], self.seed).is_empty() {
            return Ok(None);
        }
        let record = self.generator.record_with_panoramas(index, &mut choose)?;
        let Some((places, camera, condition)) = found else { return Ok(None) };
        let failed = |reason: String| DatasetError::Generate { scene_id: record.scene_id.clone(), reason };
        let kept = self.truths.as_ref().map(|folder| folder.join(format!("{}.json", record.key)));
        let truths = match kept.as_ref().and_then(|path| std::fs::read(path).ok()) {
            Some(bytes) => serde_json::from_slice(&bytes).map_err(|error| failed(error.to_string()))?,
            None => {
                let room = TrueRoom::new(interior.world, camera, record.shots[0].gains, self.seed);
                let truths = room
                    .map_err(|error| error.to_string())
                    .and_then(|room| true_objects(&room, &places))
                    .map_err(failed)?;
                if let Some(path) = &kept {
                    let text = serde_json::to_vec(&truths).map_err(|error| failed(error.to_string()))?;
                    std::fs::write(path, text).map_err(|error| failed(error.to_string()))?;
                }
                truths
            }
        };
        Ok(Some(Room { sample: record.sample(0), condition, places, camera, truths }))
    }

    /// One outcome for each place, and a picture of the first object at the first place.
    fn outcomes(
        &self,
        room: &Room,
        method: InsertionMethod,
        scene: Result<&Scene, String>,
        estimate_s: f64,
    ) -> (Vec<Outcome>, Option<Composite>) {
        let mut shown = None;
        let outcome = |number: usize, scores, cost| Outcome {
            sample: format!("{}-{number}", room.sample.id),
            scene: room.sample.scene_id.clone(),
            method: method.name(),
            condition: Some(room.condition),
            scores,
            cost,
        };
        let lit = match scene {
            Ok(scene) => Lit::new(method, &room.sample, scene, &self.tools),
            Err(reason) => Err(MethodError::Insertion(reason)),
        };
        let lit = match lit {
            Ok(lit) => lit,
            Err(error) => return (vec![outcome(0, Err(error), Cost::default())], None),
        };
        let mut outcomes = Vec::new();
        for number in 0..room.places.len() {
            memory::restart_peak();
            let begun = Instant::now();
            let figures = self.figures(room, number, &lit, &mut shown);
            let panorama_s = begun.elapsed().as_secs_f64();
            let cost = Cost { estimate_s, panorama_s, peak_mib: memory::peak_mib() };
            outcomes.push(outcome(number, figures.map_err(|error| MethodError::Insertion(error.to_string())), cost));
        }
        (outcomes, shown)
    }

    fn figures(
        &self,
        room: &Room,
        number: usize,
        lit: &Lit,
        shown: &mut Option<Composite>,
    ) -> Result<Scores, Box<dyn std::error::Error>> {
        let (place, view) = (&room.places[number], &room.sample.views[number]);
        let inserter = Inserter::new(&lit.scene, lit.lighting(view), self.quality)?;
        let mut scores = Scores::default();
        let [u, v] = place.pixel;
        let resting = Placement::rest_on_pixel(&lit.scene, u, v, Align::Gravity)?;
        // As large in the picture as in truth, whatever the depth.
        let true_m = room.camera.pose.rotation.inverse() * (place.base_m - room.camera.pose.position);
        let scale = place.radius_m * resting.position_m.length() / true_m.length();
        let (mut shadow_rms, mut correlations) = (Vec::new(), Vec::new());
        for (kind, truth) in Kind::ALL.into_iter().zip(&room.truths[number]) {
            let model = PreparedModel::new(kind.model()?);
            let placement = resting.scaled(scale).settled(&lit.scene, &Base::new(&model));
            let composite = inserter.render(&[Instance { model: &model, placement }], &mut lo_events::ignore)?;
            if let Some([rmse, si_rmse]) = compare::object(truth, &composite) {
                scores.add(format!("object_{}_rmse", kind.name()), Some(rmse));
                scores.add(format!("object_{}_si_rmse", kind.name()), Some(si_rmse));
            }
            if kind.casts()
                && let Some(figures) = compare::shadow(truth, &composite)
            {
                scores.add(format!("shadow_{}_rms", kind.name()), Some(figures.rms));
                shadow_rms.push(figures.rms);
                correlations.extend(figures.gradient_correlation);
            }
            if number == 0 && kind == Kind::Diffuse {
                *shown = Some(composite);
            }
        }
        let mean = |values: &[f64]| (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64);
        scores.add("shadow_rms", mean(&shadow_rms));
        scores.add("shadow_gradient_correlation", mean(&correlations));
        let middle_m = resting.position_m + resting.up * scale;
        let panorama = lit.panorama(middle_m, view);
        if let Some((angle_deg, intensity)) = compare::lights(&in_photo_frame(view), &panorama) {
            scores.add("dominant_deg", Some(angle_deg));
            scores.add("dominant_log2_intensity", intensity);
        }
        Ok(scores)
    }
}

/// What shines in: the rows of the tables by light.
fn condition(weather: Weather) -> &'static str {
    match weather {
        Weather::Clear | Weather::Sunset => "sunny",
        Weather::Overcast => "overcast",
        Weather::Night => "night",
        Weather::Panorama => "panorama",
    }
}

fn linear(photo: &Photo, pixel: (usize, usize)) -> [f32; 3] {
    match photo {
        Photo::Srgb8(image) => image[pixel].map(linear_from_srgb8),
        Photo::Linear(image) => image[pixel],
    }
}

impl Room {
    /// A square of the photo around the first place.
    fn tile(&self, colour: impl Fn((usize, usize)) -> Option<[f32; 3]>) -> Image<[u8; 3]> {
        let (width, height) = (self.sample.photo.width(), self.sample.photo.height());
        let edge = ((TILE_SHARE * width as f32) as usize).min(height);
        let start = |middle: f64, size: usize| (middle as usize).saturating_sub(edge / 2).min(size - edge);
        let [u, v] = self.places[0].pixel;
        let (left, top) = (start(u, width), start(v, height));
        Image::from_fn(edge, edge, |x, y| {
            colour((left + x, top + y)).map_or([60, 28, 28], |rgb| rgb.map(srgb8_from_linear))
        })
    }

    /// The photo with the first object's truth in it, where it is known.
    fn true_picture(&self, (x, y): (usize, usize)) -> [f32; 3] {
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

/// What is true of all objects at all places.
fn true_objects(room: &TrueRoom, places: &[Place]) -> Result<Vec<Vec<Truth>>, String> {
    let of_place = |place: &Place| {
        let of_kind = |kind: Kind| {
            let model = kind.model().map_err(|error| error.to_string())?;
            room.with(kind, &model, place).map_err(|error| error.to_string())
        };
        Kind::ALL.into_iter().map(of_kind).collect()
    };
    places.iter().map(of_place).collect()
}
