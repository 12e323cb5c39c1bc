use std::borrow::Cow;
use std::path::{Path, PathBuf};

use lo_geometry::{Camera, Quat, Vec3};
use lo_imaging::{
    DepthMap, Image, Photo, RadianceImage, linear_from_srgb8, read_depth, read_photo, resize_equirectangular,
};
use lo_octree::{Provenance, RadiancePoint};
use lo_random::seq::SliceRandom;

use super::files::{check_panorama, check_size, entries, folders, name, size, stem};
use crate::sample::Metadata;
use crate::{Dataset, DatasetError, NovelView, Record, Sample, Shot, evenly_spread};

/// Folder with the camera files of HD1 to HD6.
const GROUND_TRUTH: &str = "GroundTruth_HD1-HD6";
/// File that sizes are compared with.
const CAMERAS: &str = "cam0.ccam";
/// Height of the returned panoramas. They are stored with 1500 rows.
const PANORAMA_HEIGHT: usize = 128;
/// Maximum number of panoramas per sample, including its own.
const VIEWS: usize = 6;
/// Number of a sequence's frames, besides the sample's own, whose depth gives surface points.
const FUSED_FRAMES: usize = 12;
/// Step of their pixels along both axes.
const FUSED_STEP: usize = 4;

/// InteriorNet (Li et al., BMVC 2018), HD1 to HD7.
///
/// A sequence is a folder with `cam0/data/*.png`, `depth0/data/*.png` (16-bit, millimetres along the ray) and
/// optionally `cam0_pano/data/*.png` (equirectangular sRGB). Its cameras are in `cam0.ccam`, either in the folder
/// itself or, for `HDn/<scene>/<light>_<t>_<t>`, in `GroundTruth_HD1-HD6/<scene>/velocity_angular_<t>_<t>`. The
/// panoramas are 8-bit, so radiance above white is clipped. Surface points are those that twelve frames along the
/// sequence and the sample's own show.
#[derive(Debug)]
pub struct InteriorNet {
    sequences: Vec<Sequence>,
    /// Sequence and frame of each sample.
    samples: Vec<(u32, u32)>,
    /// Whether photos and panoramas are those that Lighthouse evaluates.
    as_lighthouse: bool,
    seed: u64,
}

/// Choices of Lighthouse (`data_loader.py`, `interiornet_test.py`): sizes of photo and panorama, largest number of
/// frames between them, smallest brightness of a photo, smallest depth, and the percentile of depth that the panorama
/// is ahead of. (The code calls it the median, but TensorFlow takes 0.5 as half a percent.)
const LIGHTHOUSE_PHOTO: [usize; 2] = [320, 240];
const LIGHTHOUSE_PANORAMA: [usize; 2] = [240, 120];
const LIGHTHOUSE_FRAMES: usize = 40;
const LIGHTHOUSE_BRIGHTNESS: f32 = 0.1;
const LIGHTHOUSE_NEAREST_M: f32 = 0.1;
const LIGHTHOUSE_PERCENTILE: f32 = 0.005;

#[derive(Debug)]
struct Sequence {
    folder: PathBuf,
    scene: String,
    id: String,
    frames: Vec<Frame>,
    /// Indices of the frames that have a panorama.
    panoramas: Vec<usize>,
}

#[derive(Debug)]
struct Frame {
    photo: PathBuf,
    depth: PathBuf,
    panorama: Option<PathBuf>,
    pinhole: Pinhole,
}

/// Camera of one line of `cam0.ccam`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pinhole {
    camera: Camera,
    position_m: Vec3,
    /// World from camera. The camera looks along −Z, +Y is up in the image.
    rotation: Quat,
}

impl Pinhole {
    /// Returns another camera's position in this one's axes, in metres.
    fn local(&self, other: &Self) -> Vec3 {
        self.rotation.inverse() * (other.position_m - self.position_m)
    }
}

impl InteriorNet {
    /// Whether a folder looks like the dataset or a part of it.
    pub(crate) fn is_at(folder: &Path) -> bool {
        folder.join(GROUND_TRUTH).is_dir() || sequence_folders(folder).is_ok_and(|found| !found.is_empty())
    }

    /// Opens the sequences of the folder itself, its scenes, or the scenes of its `HD1` … `HD7`.
    ///
    /// # Errors
    /// If a folder cannot be read, a sequence has no cameras or a different number of images, or a line is not a
    /// camera.
    pub fn open(folder: &Path, seed: u64) -> Result<Self, DatasetError> {
        let mut sequences = Vec::new();
        for path in sequence_folders(folder)? {
            sequences.push(Sequence::open(folder, &path)?);
        }
        if sequences.is_empty() {
            return Err(DatasetError::layout(folder, "contains no sequence with cam0/data and depth0/data"));
        }
        let numbered = sequences.iter().enumerate();
        let samples =
            numbered.flat_map(|(s, sequence)| (0..sequence.frames.len()).map(move |f| (s as u32, f as u32))).collect();
        Ok(Self { sequences, samples, as_lighthouse: false, seed })
    }

    /// Chooses as Lighthouse (Srinivasan et al., CVPR 2020) does: no sequences with random light, photos of 320 × 240
    /// pixels that are not dark and not nearer than 0.1 m to anything, each with one panorama of 240 × 120 pixels at
    /// most 40 frames away and ahead of the camera, between its nearest and farthest depth.
    ///
    /// A photo that does not qualify has no panorama. Which of the qualified frames Lighthouse's own test set holds is
    /// not published; see [`Lighthouse`](crate::Lighthouse) for that set.
    ///
    /// # Errors
    /// If no sequence is left.
    pub fn as_lighthouse(mut self, folder: &Path) -> Result<Self, DatasetError> {
        let is_original = |sequence: u32| !name(&self.sequences[sequence as usize].folder).starts_with("random");
        self.samples.retain(|&(sequence, _)| is_original(sequence));
        if self.samples.is_empty() {
            return Err(DatasetError::layout(folder, "contains sequences with random light alone"));
        }
        self.as_lighthouse = true;
        Ok(self)
    }
}

/// Finds the folders of sequences, at most three levels down.
fn sequence_folders(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut found = Vec::new();
    let mut level = vec![folder.to_owned()];
    for _ in 0..4 {
        let mut next = Vec::new();
        for path in level {
            if path.join("cam0").join("data").is_dir() && path.join("depth0").join("data").is_dir() {
                found.push(path);
            } else if name(&path) != GROUND_TRUTH {
                next.extend(folders(&path)?);
            }
        }
        level = next;
    }
    Ok(found)
}

impl Sequence {
    fn open(root: &Path, path: &Path) -> Result<Self, DatasetError> {
        let cameras = cameras_file(root, path)?;
        let text = std::fs::read_to_string(&cameras).map_err(DatasetError::io(&cameras))?;
        let pinholes = parse_cameras(&cameras, &text)?;
        let photos = pictures(&path.join("cam0").join("data"))?;
        // Frames that were left out of an archive keep their numbers.
        let numbers: Option<Vec<usize>> = photos.iter().map(|photo| stem(photo).parse().ok()).collect();
        let numbers = match numbers {
            Some(numbers) if numbers.iter().all(|&number| number < pinholes.len()) => numbers,
            _ if photos.len() == pinholes.len() => (0..photos.len()).collect(),
            _ => {
                let reason = format!("{} cameras for {} images in {}", pinholes.len(), photos.len(), path.display());
                return Err(DatasetError::field(&cameras, "lines", reason));
            }
        };
        let frames: Vec<Frame> = photos
            .into_iter()
            .zip(numbers)
            .map(|(photo, number)| {
                let file = name(&photo);
                let panorama = path.join("cam0_pano").join("data").join(&file);
                Frame {
                    depth: path.join("depth0").join("data").join(&file),
                    panorama: Some(panorama).filter(|p| p.is_file()),
                    pinhole: pinholes[number],
                    photo,
                }
            })
            .collect();
        let panoramas = (0..frames.len()).filter(|&i| frames[i].panorama.is_some()).collect();
        // `<scene>/<light>_<t>_<t>` or, in HD7, the scene itself.
        let parent = path.parent().map(name).unwrap_or_default();
        let (scene, id) = match trajectory(&name(path)) {
            Some(_) => (parent.clone(), format!("{parent}-{}", name(path))),
            None => (name(path), name(path)),
        };
        Ok(Self { folder: path.to_owned(), scene, id, frames, panoramas })
    }
}

impl Sequence {
    /// Adds the surface points of frames all along the sequence but frame `number`.
    fn add_points_along(&self, number: usize, points: &mut Vec<RadiancePoint>) -> Result<(), DatasetError> {
        for other in evenly_spread(self.frames.len(), FUSED_FRAMES).filter(|&other| other != number) {
            let frame = &self.frames[other];
            points.extend(frame.points(&frame.picture()?, &frame.depth()?));
        }
        Ok(())
    }
}

/// Returns the `<t>_<t>` of `<light>_<t>_<t>`.
fn trajectory(folder: &str) -> Option<&str> {
    folder.strip_prefix("original_").or_else(|| folder.strip_prefix("random_"))
}

fn cameras_file(root: &Path, path: &Path) -> Result<PathBuf, DatasetError> {
    let own = path.join("cam0.ccam");
    if own.is_file() {
        return Ok(own);
    }
    let scene = path.parent().map(name).unwrap_or_default();
    let shared = trajectory(&name(path)).map(|t| {
        // The ground truth is beside the HDn folders or within one of them.
        let below =
            |base: &Path| base.join(GROUND_TRUTH).join(&scene).join(format!("velocity_angular_{t}")).join("cam0.ccam");
        path.ancestors()
            .take_while(|a| a.starts_with(root) || *a == root)
            .chain(root.parent())
            .map(below)
            .find(|f| f.is_file())
    });
    shared.flatten().ok_or_else(|| {
        let reason = format!("no cam0.ccam here or in {GROUND_TRUTH}/{scene}/velocity_angular_…");
        DatasetError::layout(path, reason)
    })
}

/// Returns the images of a folder in the order of their numbers, or of their names if they have none.
fn pictures(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let mut paths: Vec<PathBuf> =
        entries(folder)?.into_iter().filter(|p| p.extension().is_some_and(|e| e == "png")).collect();
    paths.sort_by_key(|path| stem(path).parse::<u64>().unwrap_or(u64::MAX));
    Ok(paths)
}

/// Parses lines of 15 numbers: focal length, principal point (2), distortion (3), orientation w x y z, position x y z,
/// width, height. Comments and the line with the count are skipped.
fn parse_cameras(path: &Path, text: &str) -> Result<Vec<Pinhole>, DatasetError> {
    let mut pinholes = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.len() <= 1 || line.trim_start().starts_with('#') {
            continue;
        }
        let wrong = |reason: String| DatasetError::field(path, format!("line {}", number + 1), reason);
        let mut values = [0.0f64; 15];
        if words.len() < values.len() {
            return Err(wrong(format!("{} numbers; expected 15", words.len())));
        }
        for (value, word) in values.iter_mut().zip(&words) {
            *value = word
                .parse()
                .ok()
                .filter(|v: &f64| v.is_finite())
                .ok_or_else(|| wrong(format!("`{word}` is not a number")))?;
        }
        let [f, cx, cy, _, _, _, w, x, y, z, px, py, pz, width, height] = values;
        let camera =
            Camera::new(f, f, cx, cy, width as u32, height as u32).map_err(|error| wrong(error.to_string()))?;
        let rotation = Quat::from_xyzw(x as f32, y as f32, z as f32, w as f32);
        if (rotation.length() - 1.0).abs() > 0.01 {
            return Err(wrong(format!("the orientation {w} {x} {y} {z} is not a unit quaternion")));
        }
        let position_m = Vec3::new(px as f32, py as f32, pz as f32);
        pinholes.push(Pinhole { camera, position_m, rotation: rotation.normalize() });
    }
    Ok(pinholes)
}

impl Dataset for InteriorNet {
    fn len(&self) -> usize {
        self.samples.len()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.sequences[self.samples[index].0 as usize].scene.as_str().into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let len = self.samples.len();
        let &(sequence, number) = self.samples.get(index).ok_or(DatasetError::Index { index, len })?;
        let sequence = &self.sequences[sequence as usize];
        let frame = &sequence.frames[number as usize];
        let Pinhole { mut camera, position_m, rotation } = frame.pinhole;
        let mut photo = frame.picture()?;
        let depth_m = frame.depth()?;
        let mut points = frame.points(&photo, &depth_m);
        sequence.add_points_along(number as usize, &mut points)?;
        let ahead_m = self.as_lighthouse.then(|| lighthouse_range_m(&depth_m, &camera));
        let is_chosen = |&i: &usize| match ahead_m {
            Some([nearest_m, farthest_m]) => {
                let ahead_m = -frame.pinhole.local(&sequence.frames[i].pinhole).z;
                i.abs_diff(number as usize) <= LIGHTHOUSE_FRAMES && ahead_m > nearest_m && ahead_m < farthest_m
            }
            None => i != number as usize && sees(frame, &depth_m, &sequence.frames[i]),
        };
        let mut chosen: Vec<usize> = sequence.panoramas.iter().copied().filter(is_chosen).collect();
        chosen.shuffle(&mut lo_random::stream(
            self.seed ^ lo_random::hash(sequence.id.as_bytes()),
            "views",
            u64::from(number),
        ));
        let own = frame.panorama.is_some().then_some(number as usize);
        let mut views = Vec::new();
        if self.as_lighthouse {
            if let Some(&i) = chosen.first().filter(|_| is_bright_and_far(&photo, &depth_m)) {
                views.extend(sequence.frames[i].view(LIGHTHOUSE_PANORAMA)?);
            }
            let [width, height] = LIGHTHOUSE_PHOTO;
            let values = photo.map(|rgb| rgb.map(f32::from));
            photo = lo_imaging::resize(&values, width, height).map(|rgb| rgb.map(|value| value.round() as u8));
            camera = camera.resized(width as u32, height as u32);
        } else {
            for i in own.into_iter().chain(chosen).take(VIEWS) {
                views.extend(sequence.frames[i].view([2 * PANORAMA_HEIGHT, PANORAMA_HEIGHT])?);
            }
        }
        let shot = Shot {
            position_m,
            rotation,
            gains: [1.0; 3],
            camera,
            radiance: None,
            photo,
            jpeg: None,
            depth_m: Some(depth_m),
            sensor_depth_m: None,
            normal: None,
            albedo: None,
            views: (0..views.len()).collect(),
            metadata: Metadata::from_iter([(Sample::CLIPPED_PANORAMAS.to_owned(), true.into())]),
        };
        let record = Record {
            key: format!("{}-{}", sequence.id, stem(&frame.photo)),
            scene_id: sequence.scene.clone(),
            up: Some(Vec3::Z),
            points,
            point_area_m2: None,
            views,
            shots: vec![shot],
            metadata: Metadata::new(),
        };
        Ok(record.into_sample())
    }
}

impl Frame {
    /// Reads the depth along the optical axis, converted from the stored distance along the ray.
    fn depth(&self) -> Result<DepthMap, DatasetError> {
        let camera = &self.pinhole.camera;
        let distance = read_depth(&self.depth, Some(1000.0))?;
        check_size(&self.depth, size(&distance), CAMERAS, camera_size(camera))?;
        Ok(Image::from_fn(distance.width(), distance.height(), |x, y| {
            distance[(x, y)] * -camera.direction(x as f64 + 0.5, y as f64 + 0.5).z
        }))
    }

    /// Reads the photo.
    fn picture(&self) -> Result<Image<[u8; 3]>, DatasetError> {
        let photo = read_srgb(&self.photo)?;
        check_size(&self.photo, size(&photo), CAMERAS, camera_size(&self.pinhole.camera))?;
        Ok(photo)
    }

    /// Returns the surface points that this frame's photo and depth show, in the world's axes.
    fn points(&self, photo: &Image<[u8; 3]>, depth_m: &DepthMap) -> Vec<RadiancePoint> {
        let Pinhole { camera, position_m, rotation } = self.pinhole;
        let rows = (FUSED_STEP / 2..depth_m.height()).step_by(FUSED_STEP);
        let pixels = rows.flat_map(|y| (FUSED_STEP / 2..depth_m.width()).step_by(FUSED_STEP).map(move |x| (x, y)));
        let point = |(x, y): (usize, usize)| RadiancePoint {
            position_m: position_m
                + rotation * camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(depth_m[(x, y)])),
            radiance: photo[(x, y)].map(linear_from_srgb8),
            provenance: Provenance::Inferred,
        };
        pixels.filter(|&at| depth_m[at] > 0.0).map(point).collect()
    }

    /// Reads the panorama at this frame's position as linear radiance of this size. Its axes are the camera's.
    fn view(&self, [width, height]: [usize; 2]) -> Result<Option<NovelView>, DatasetError> {
        let Some(path) = &self.panorama else { return Ok(None) };
        let map: RadianceImage = Photo::Srgb8(read_srgb(path)?).into_radiance();
        check_panorama(path, "size", &map)?;
        let radiance = resize_equirectangular(&map, width, height);
        let Pinhole { position_m, rotation, .. } = self.pinhole;
        Ok(Some(NovelView { position_m, rotation, radiance, depth_m: None }))
    }
}

/// Returns the distances along the ray between which Lighthouse's panoramas are ahead of the camera; both 0 without
/// depth.
fn lighthouse_range_m(depth_m: &DepthMap, camera: &Camera) -> [f32; 2] {
    let (width, height) = (depth_m.width(), depth_m.height());
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).filter(|&at| depth_m[at] > 0.0);
    let distance_m = |(x, y)| camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(depth_m[(x, y)])).length();
    let mut distances_m: Vec<f32> = pixels.map(distance_m).collect();
    distances_m.sort_unstable_by(f32::total_cmp);
    let nearest = distances_m.get((LIGHTHOUSE_PERCENTILE * distances_m.len() as f32) as usize);
    nearest.zip(distances_m.last()).map_or([0.0; 2], |(nearest, farthest)| [*nearest, *farthest])
}

fn camera_size(camera: &Camera) -> (usize, usize) {
    (camera.width as usize, camera.height as usize)
}

/// Whether a photo is neither dark nor close to a surface, by Lighthouse's measures.
fn is_bright_and_far(photo: &Image<[u8; 3]>, depth_m: &DepthMap) -> bool {
    let squared = |value: u8| (f32::from(value) / 255.0).powi(2);
    let brightness = |[r, g, b]: &[u8; 3]| (0.299 * squared(*r) + 0.587 * squared(*g) + 0.114 * squared(*b)).sqrt();
    let mean = photo.pixels().iter().map(brightness).sum::<f32>() / photo.pixels().len() as f32;
    let nearest = depth_m.pixels().iter().copied().filter(|z| *z > 0.0).fold(f32::INFINITY, f32::min);
    mean > LIGHTHOUSE_BRIGHTNESS && nearest > LIGHTHOUSE_NEAREST_M
}

/// Whether another frame's position projects into a frame's photo and is in front of its surfaces.
fn sees(frame: &Frame, depth_m: &DepthMap, other: &Frame) -> bool {
    frame.pinhole.camera.project(frame.pinhole.local(&other.pinhole)).is_some_and(|(u, v, z)| {
        u >= 0.0
            && v >= 0.0
            && u < depth_m.width() as f64
            && v < depth_m.height() as f64
            && z < f64::from(depth_m[(u as usize, v as usize)])
    })
}

fn read_srgb(path: &Path) -> Result<Image<[u8; 3]>, DatasetError> {
    match read_photo(path)?.photo {
        photo @ (Photo::Srgb8(_) | Photo::Encoded8(_)) => Ok(photo.into_srgb8()),
        Photo::Linear(_) => Err(DatasetError::field(path, "picture", "8-bit sRGB is expected")),
    }
}
