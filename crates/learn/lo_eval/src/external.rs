//! Panoramas that other programs made of an evaluation's photos.
//!
//! [`ViewList`] says which panorama belongs to which photo and position; it is written for other programs, and beside
//! the panoramas of this program's own methods.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use lo_dataset::{NovelView, Sample};
use lo_geometry::{Camera, Mat3, Vec3};
use lo_imaging::{ExrOptions, ImageError, JPEG_QUALITY, Photo, PhotoNote, RadianceImage, resize_equirectangular};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::{EstimatedLight, MethodOutput};

/// File name of the list of views, in the folder of its panoramas.
pub const VIEWS_FILE: &str = "views.json";

/// Version of the list's format.
const FORMAT_VERSION: u32 = 1;

/// Largest difference of a camera, position or rotation between a list and the dataset.
const SAME: f64 = 1e-3;

/// Extensions of panoramas.
const FORMATS: [&str; 3] = ["exr", "hdr", "pfm"];

/// Largest negative value, as a share of the largest value: lossy files have some just below zero. They become 0.
const MAX_NEGATIVE: f32 = 1e-3;

/// Photos of an evaluation and the panoramas wanted of them: the contents of [`VIEWS_FILE`].
///
/// Paths are relative to the file's folder.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ViewList {
    /// Version of the format: 1.
    pub format_version: u32,
    /// Name of the writing program.
    #[serde(default)]
    pub generator: String,
    /// The photos, in the order of evaluation.
    pub photos: Vec<ListedPhoto>,
}

/// A photo of a [`ViewList`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ListedPhoto {
    /// Identifier in the dataset.
    pub id: String,
    /// Identifier of its room.
    pub scene: String,
    /// Intrinsics of the photo, in pixels.
    pub camera: Camera,
    /// Horizontal field of view, degrees.
    pub hfov_deg: f64,
    /// Unit up direction of the room in the photo's frame, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub up: Option<[f32; 3]>,
    /// The photo, 8-bit sRGB.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub photo: Option<PathBuf>,
    /// True depth along the optical axis, metres; 0 is no reading.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub true_depth: Option<PathBuf>,
    /// Simulated or measured sensor depth, likewise.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor_depth: Option<PathBuf>,
    /// The one panorama of a program that makes one for all positions, in the photo's frame. It is read where the
    /// panorama of a view is missing.
    pub panorama: PathBuf,
    /// The positions and their panoramas.
    pub views: Vec<ListedView>,
}

/// A panorama of a [`ListedPhoto`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ListedView {
    /// The panorama.
    pub panorama: PathBuf,
    /// Its width at the evaluation, in pixels; others are resized.
    pub width: usize,
    /// Its height at the evaluation, in pixels.
    pub height: usize,
    /// Its position in the photo's frame, metres.
    pub position_m: [f32; 3],
    /// Rows of its rotation: photo-frame direction = rotation · panorama direction.
    pub rotation: [[f32; 3]; 3],
}

/// Errors of the panoramas of other programs.
#[derive(Debug, thiserror::Error)]
pub enum ExternalError {
    /// A file or folder cannot be read or written.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The list cannot be written; the message names it.
    #[error("cannot write {0}")]
    Write(#[from] std::io::Error),
    /// The list is no list of views.
    #[error("{}: not a list of views, as written by --write-views: {source}", path.display())]
    Json {
        /// The list.
        path: PathBuf,
        /// The parser's error.
        source: serde_json::Error,
    },
    /// The list's format is not supported.
    #[error("{}: format_version is {version}, expected {FORMAT_VERSION}", path.display())]
    Version {
        /// The list.
        path: PathBuf,
        /// Its version.
        version: u32,
    },
    /// The list names a photo twice.
    #[error("{}: the photo {id} is listed twice", path.display())]
    Twice {
        /// The list.
        path: PathBuf,
        /// Identifier of the photo.
        id: String,
    },
    /// None of the listed panoramas exists.
    #[error("{}: none of the panoramas that {VIEWS_FILE} lists is there, such as {}", folder.display(), first.display())]
    NoPanoramas {
        /// The folder.
        folder: PathBuf,
        /// A listed panorama.
        first: PathBuf,
    },
    /// A file is no panorama of linear radiance.
    #[error("{}: {reason}", path.display())]
    Radiance {
        /// The panorama.
        path: PathBuf,
        /// The fault.
        reason: String,
    },
    /// No photo has a panorama to compare with.
    #[error("none of the {photos} photos has a panorama to compare with")]
    NoTruth {
        /// Number of photos.
        photos: usize,
    },
    /// The list is of other photos than the evaluation.
    #[error(
        "{}: {what}; the list was written with other options than this evaluation's (dataset, protocol, part, crops, \
         field of view, samples or seed)", path.display()
    )]
    OtherPhotos {
        /// The list.
        path: PathBuf,
        /// The difference.
        what: String,
    },
    /// An image cannot be read or written.
    #[error(transparent)]
    Image(#[from] ImageError),
}

impl ListedPhoto {
    /// Lists a photo of an evaluation; `number` counts them from 1.
    fn of(sample: &Sample, number: usize) -> Self {
        let view = |(index, view): (usize, &NovelView)| ListedView {
            panorama: format!("{number:06}-{}.exr", index + 1).into(),
            width: view.radiance.width(),
            height: view.radiance.height(),
            position_m: view.position_m.to_array(),
            rotation: rows(view),
        };
        Self {
            id: sample.id.clone(),
            scene: sample.scene_id.clone(),
            camera: sample.camera,
            hfov_deg: sample.camera.hfov_deg(),
            up: sample.up.map(|up| up.to_array()),
            photo: None,
            true_depth: None,
            sensor_depth: None,
            panorama: format!("{number:06}.exr").into(),
            views: sample.views.iter().enumerate().map(view).collect(),
        }
    }

    /// Finds the entry of a sample's view.
    fn view(&self, view: &NovelView) -> Option<&ListedView> {
        let near = |a: &[f32], b: &[f32]| a.iter().zip(b).all(|(a, b)| f64::from((a - b).abs()) <= SAME);
        let rotation = rows(view);
        self.views.iter().find(|listed| {
            near(&listed.position_m, &view.position_m.to_array())
                && near(listed.rotation.as_flattened(), rotation.as_flattened())
        })
    }

    /// Whether the camera is that of a sample's photo.
    fn has_camera_of(&self, sample: &Sample) -> bool {
        let (own, other) = (&self.camera, &sample.camera);
        let near = |a: f64, b: f64| (a - b).abs() <= SAME * f64::from(other.width.max(other.height));
        (own.width, own.height) == (other.width, other.height)
            && [(own.fx, other.fx), (own.fy, other.fy), (own.cx, other.cx), (own.cy, other.cy)]
                .into_iter()
                .all(|(a, b)| near(a, b))
    }
}

/// Returns the rows of a view's rotation.
fn rows(view: &NovelView) -> [[f32; 3]; 3] {
    Mat3::from_quat(view.rotation).transpose().to_cols_array_2d()
}

/// Writes photos of an evaluation, or a method's panoramas of them, with their [`ViewList`].
#[derive(Debug)]
pub(crate) struct ViewWriter {
    folder: PathBuf,
    list: ViewList,
}

impl ViewWriter {
    /// Creates the folder. All files store `generator`, the name of the writing program.
    ///
    /// # Errors
    /// The folder cannot be created.
    pub(crate) fn create(folder: &Path, generator: &str) -> Result<Self, ExternalError> {
        let list = ViewList { format_version: FORMAT_VERSION, generator: generator.to_owned(), photos: Vec::new() };
        std::fs::create_dir_all(folder).map_err(|source| ExternalError::Io { path: folder.to_owned(), source })?;
        Ok(Self { folder: folder.to_owned(), list })
    }

    /// Writes a photo and its depth, and lists it.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(crate) fn add_photo(&mut self, sample: &Sample) -> Result<(), ExternalError> {
        let number = self.list.photos.len() + 1;
        let mut listed = ListedPhoto::of(sample, number);
        let photo = PathBuf::from(format!("{number:06}-photo.png"));
        lo_imaging::write_srgb8(self.folder.join(&photo), &sample.photo, JPEG_QUALITY, &self.list.generator)?;
        listed.photo = Some(photo);
        let depth = |depth_m: &Option<_>, kind: &str| -> Result<Option<PathBuf>, ExternalError> {
            let Some(depth_m) = depth_m else { return Ok(None) };
            let path = PathBuf::from(format!("{number:06}-{kind}-depth.exr"));
            lo_imaging::write_depth(self.folder.join(&path), depth_m, &self.list.generator)?;
            Ok(Some(path))
        };
        listed.true_depth = depth(&sample.depth_m, "true")?;
        listed.sensor_depth = depth(&sample.sensor_depth_m, "sensor")?;
        self.list.photos.push(listed);
        Ok(())
    }

    /// Writes the panoramas of a photo's views, in their order, and lists the photo. There are none if the method is
    /// not possible on the photo.
    ///
    /// # Errors
    /// A file cannot be written.
    pub(crate) fn add_panoramas(&mut self, sample: &Sample, panoramas: &[RadianceImage]) -> Result<(), ExternalError> {
        let listed = ListedPhoto::of(sample, self.list.photos.len() + 1);
        for (view, panorama) in listed.views.iter().zip(panoramas) {
            let options = ExrOptions { generator: self.list.generator.clone(), ..ExrOptions::default() };
            lo_imaging::write_radiance(self.folder.join(&view.panorama), panorama, &options)?;
        }
        self.list.photos.push(listed);
        Ok(())
    }

    /// Writes the list. Returns the number of its photos.
    ///
    /// # Errors
    /// The file cannot be written.
    pub(crate) fn finish(self) -> Result<usize, ExternalError> {
        let path = self.folder.join(VIEWS_FILE);
        let text = serde_json::to_string_pretty(&self.list)
            .map_err(|source| ExternalError::Json { path: path.clone(), source })?;
        lo_imaging::write_atomically(&path, |out| std::io::Write::write_all(out, text.as_bytes()))?;
        Ok(self.list.photos.len())
    }
}

/// Panoramas of another program, to be scored beside this program's methods.
#[derive(Clone, Debug)]
pub struct External {
    name: String,
    folder: PathBuf,
    list: ViewList,
}

impl External {
    /// Opens a folder with panoramas and their [`VIEWS_FILE`]. `name` is the row in the tables.
    ///
    /// # Errors
    /// The list cannot be read; none of its panoramas exists, or one of them is no panorama of linear radiance.
    pub fn open(name: &str, folder: &Path) -> Result<Self, ExternalError> {
        let path = folder.join(VIEWS_FILE);
        let bytes = std::fs::read(&path).map_err(|source| ExternalError::Io { path: path.clone(), source })?;
        let list: ViewList =
            serde_json::from_slice(&bytes).map_err(|source| ExternalError::Json { path: path.clone(), source })?;
        if list.format_version != FORMAT_VERSION {
            return Err(ExternalError::Version { path, version: list.format_version });
        }
        let mut ids = HashSet::new();
        if let Some(twice) = list.photos.iter().find(|photo| !ids.insert(&photo.id)) {
            return Err(ExternalError::Twice { path, id: twice.id.clone() });
        }
        let external = Self { name: name.to_owned(), folder: folder.to_owned(), list };
        external.check()?;
        Ok(external)
    }

    /// Checks all panoramas, so that a long evaluation does not end at the last one.
    fn check(&self) -> Result<(), ExternalError> {
        let views = self.list.photos.iter().flat_map(|photo| &photo.views).map(|view| &view.panorama);
        let all: Vec<&PathBuf> = self.list.photos.iter().map(|photo| &photo.panorama).chain(views).collect();
        let found = all.into_par_iter().map(|path| self.read(path).map(|map| map.is_some()));
        let is_any = found.try_reduce(|| false, |a, b| Ok(a || b))?;
        match self.list.photos.first().and_then(|photo| photo.views.first()) {
            Some(first) if !is_any => {
                Err(ExternalError::NoPanoramas { folder: self.folder.clone(), first: first.panorama.clone() })
            }
            _ => Ok(()),
        }
    }

    /// Returns the name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Finds the entry of a sample.
    ///
    /// # Errors
    /// The list does not have the photo, or has it with another camera or other views.
    pub(crate) fn entry(&self, sample: &Sample) -> Result<&ListedPhoto, ExternalError> {
        let other = |what: String| ExternalError::OtherPhotos { path: self.folder.join(VIEWS_FILE), what };
        let id = &sample.id;
        let photo = self.list.photos.iter().find(|photo| photo.id == *id);
        let photo = photo.ok_or_else(|| other(format!("the photo {id} is not listed")))?;
        if !photo.has_camera_of(sample) {
            return Err(other(format!("the photo {id} has another camera")));
        }
        for view in &sample.views {
            if photo.view(view).is_none() {
                let Vec3 { x, y, z } = view.position_m;
                return Err(other(format!("the photo {id} has no view at {x}, {y}, {z} m in this direction")));
            }
        }
        Ok(photo)
    }

    /// Reads the panoramas of a sample's views, in their order; `None` if one is missing.
    ///
    /// # Errors
    /// Photos and views that are not listed; unreadable panoramas.
    pub(crate) fn panoramas(&self, sample: &Sample) -> Result<Option<Vec<RadianceImage>>, ExternalError> {
        let entry = self.entry(sample)?;
        let mut shared = None;
        let mut panoramas = Vec::new();
        for view in &sample.views {
            let own = entry.view(view).map(|listed| self.read(&listed.panorama)).transpose()?.flatten();
            let panorama = match own {
                Some(own) => {
                    let (width, height) = (view.radiance.width(), view.radiance.height());
                    let is_sized = (own.width(), own.height()) == (width, height);
                    if is_sized { own } else { resize_equirectangular(&own, width, height) }
                }
                None => {
                    if shared.is_none() {
                        let map = self.read(&entry.panorama)?;
                        shared = map.map(|map| MethodOutput::of_light(EstimatedLight::Map(map)));
                    }
                    let Some(shared) = &shared else { return Ok(None) };
                    shared.panorama(view)
                }
            };
            panoramas.push(panorama);
        }
        Ok(Some(panoramas))
    }

    /// Reads a panorama; `None` if there is no such file.
    fn read(&self, relative: &Path) -> Result<Option<RadianceImage>, ExternalError> {
        let path = self.folder.join(relative);
        if !path.exists() {
            return Ok(None);
        }
        let file = lo_imaging::read_photo(&path)?;
        let wrong = |reason: String| Err(ExternalError::Radiance { path: path.clone(), reason });
        let is_radiance = path.extension().is_some_and(|e| FORMATS.iter().any(|known| e.eq_ignore_ascii_case(known)));
        let (Photo::Linear(map), true) = (file.photo, is_radiance) else {
            return wrong("a panorama is linear radiance in .exr, .hdr or .pfm".into());
        };
        if file.notes.iter().any(|note| matches!(note, PhotoNote::NotFinite { .. })) {
            return wrong("it has values that are NaN or infinite".into());
        }
        let (width, height) = (map.width(), map.height());
        if width != 2 * height {
            return wrong(format!("a panorama is twice as wide as high, this has {width} × {height} pixels"));
        }
        let values = || map.pixels().as_flattened().iter().copied();
        let (least, most) = (values().fold(0.0, f32::min), values().fold(0.0, f32::max));
        if least < -MAX_NEGATIVE * most {
            return wrong(format!("it has negative radiance, down to {least}"));
        }
        Ok(Some(map.map(|rgb| rgb.map(|v| v.max(0.0)))))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::testing;
    use lo_geometry::{Quat, pixel_direction};

    /// A panorama whose colour tells the direction in the photo's frame, seen in a view's frame.
    fn directions(width: usize, height: usize, rotation: Quat) -> RadianceImage {
        let colour = |direction: Vec3| (rotation * direction).to_array().map(|v| 2.0 + v);
        RadianceImage::from_fn(width, height, |x, y| colour(pixel_direction(x, y, width, height)))
    }

    fn largest_difference(a: &RadianceImage, b: &RadianceImage) -> f32 {
        assert_eq!((a.width(), a.height()), (b.width(), b.height()));
        let pairs = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    fn write(folder: &Path, name: &str, map: &RadianceImage) {
        lo_imaging::write_radiance(folder.join(name), map, &ExrOptions::default()).unwrap();
    }

    /// The room with its first view turned by a quarter, and a folder that lists it.
    fn listed(folder: &Path) -> Sample {
        let mut sample = testing::box_room();
        sample.views[0].rotation = Quat::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let mut writer = ViewWriter::create(folder, "the tests").unwrap();
        writer.add_photo(&sample).unwrap();
        assert_eq!(writer.finish().unwrap(), 1);
        sample
    }

    #[test]
    fn own_panoramas_are_taken_as_they_are_and_others_are_resized_or_turned() {
        let folder = tempfile::tempdir().unwrap();
        let sample = listed(folder.path());
        let open = || External::open("other", folder.path()).unwrap();
        let message = External::open("other", folder.path()).unwrap_err().to_string();
        assert!(message.ends_with("none of the panoramas that views.json lists is there, such as 000001-1.exr"));
        // One for all positions, in the photo's frame.
        write(folder.path(), "000001.exr", &directions(128, 64, Quat::IDENTITY));
        let shared = open().panoramas(&sample).unwrap().unwrap();
        for (view, map) in sample.views.iter().zip(&shared) {
            assert!(largest_difference(map, &directions(64, 32, view.rotation)) < 0.02);
        }
        // One for the first position, in its own frame, and a larger one for the second.
        let own = directions(64, 32, sample.views[0].rotation).map(|rgb| rgb.map(|v| 0.5 * v));
        write(folder.path(), "000001-1.exr", &own);
        write(folder.path(), "000001-2.exr", &directions(256, 128, Quat::IDENTITY));
        let both = open().panoramas(&sample).unwrap().unwrap();
        assert_eq!(both[0], own);
        assert!(largest_difference(&both[1], &directions(64, 32, Quat::IDENTITY)) < 0.02);
        // Fewer views, as beside methods with a known panorama, are found by their position.
        let mut last = sample.clone();
        last.views.remove(0);
        assert_eq!(open().panoramas(&last).unwrap().unwrap(), both[1..]);
        // Without the shared one, a photo lacks a panorama where a view does.
        std::fs::remove_file(folder.path().join("000001.exr")).unwrap();
        std::fs::remove_file(folder.path().join("000001-2.exr")).unwrap();
        assert!(open().panoramas(&sample).unwrap().is_none());
    }

    #[test]
    fn what_is_no_panorama_of_radiance_is_refused_at_once() {
        let folder = tempfile::tempdir().unwrap();
        listed(folder.path());
        let map = |value: f32| {
            let mut map = directions(64, 32, Quat::IDENTITY);
            map[(9, 9)] = [value; 3];
            map
        };
        let refusal = |map: &RadianceImage| {
            write(folder.path(), "000001-2.exr", map);
            External::open("other", folder.path()).unwrap_err().to_string()
        };
        for (message, expected) in [
            (refusal(&directions(96, 64, Quat::IDENTITY)), "twice as wide as high, this has 96 × 64 pixels"),
            (refusal(&map(f32::NAN)), "it has values that are NaN or infinite"),
            (refusal(&map(f32::INFINITY)), "it has values that are NaN or infinite"),
            (refusal(&map(-0.5)), "it has negative radiance, down to -0.5"),
        ] {
            assert!(message.contains("000001-2.exr: ") && message.ends_with(expected), "{message}");
        }
        write(folder.path(), "000001-2.exr", &map(-1e-6));
        External::open("other", folder.path()).unwrap();
        // A tone-mapped picture by the name of an OpenEXR file.
        let photo = std::fs::read(folder.path().join("000001-photo.png")).unwrap();
        std::fs::write(folder.path().join("000001-2.exr"), photo).unwrap();
        let message = External::open("other", folder.path()).unwrap_err().to_string();
        assert!(message.ends_with("a panorama is linear radiance in .exr, .hdr or .pfm"), "{message}");
    }

    #[test]
    fn what_other_programs_need_is_in_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let sample = listed(folder.path());
        let list: ViewList = serde_json::from_slice(&std::fs::read(folder.path().join(VIEWS_FILE)).unwrap()).unwrap();
        let [photo] = &list.photos[..] else { panic!("{list:?}") };
        assert_eq!((photo.camera, &photo.id[..], &photo.scene[..]), (sample.camera, "room-0", "room"));
        assert!((photo.hfov_deg - 65.0).abs() < 1e-4 && photo.up == Some([0.0, 1.0, 0.0]));
        let file = |name: &Option<PathBuf>| folder.path().join(name.as_ref().unwrap());
        assert_eq!(
            lo_imaging::read_photo(file(&photo.photo)).unwrap().photo,
            lo_imaging::Photo::Srgb8(sample.photo.clone())
        );
        assert_eq!(Some(lo_imaging::read_depth(file(&photo.true_depth), None).unwrap()), sample.depth_m);
        assert_eq!(Some(lo_imaging::read_depth(file(&photo.sensor_depth), None).unwrap()), sample.sensor_depth_m);
        // Its first column is where the panorama's +X points: to −Z, where the camera looks.
        let [x, y, z] = photo.views[0].rotation.map(|row| row[0]);
        assert!((Vec3::new(x, y, z) - Vec3::NEG_Z).length() < 1e-6, "{:?}", photo.views[0].rotation);
        assert_eq!((photo.views[0].width, photo.views[0].height), (64, 32));
    }

    #[test]
    fn lists_of_other_photos_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let sample = listed(folder.path());
        write(folder.path(), "000001.exr", &directions(64, 32, Quat::IDENTITY));
        let external = External::open("other", folder.path()).unwrap();
        let refusal = |change: fn(&mut Sample)| {
            let mut other = sample.clone();
            change(&mut other);
            external.entry(&other).unwrap_err().to_string()
        };
        assert!(refusal(|sample| sample.id = "room-1".into()).contains("views.json: the photo room-1 is not listed; "));
        assert!(refusal(|sample| sample.camera.fx *= 1.1).contains("room-0 has another camera"));
        assert!(refusal(|sample| sample.views[1].position_m.x = 0.1).contains("has no view at 0.1, 0, 0 m"));
        let turned = refusal(|sample| sample.views[0].rotation = Quat::IDENTITY);
        assert!(turned.contains("has no view at 0.4, -0.2, -0.8 m in this direction"), "{turned}");

        let path = folder.path().join(VIEWS_FILE);
        let text = std::fs::read_to_string(&path).unwrap();
        let open = |text: &str| {
            std::fs::write(&path, text).unwrap();
            External::open("other", folder.path()).map(drop).unwrap_err().to_string()
        };
        assert!(open(&text.replace("\"format_version\": 1", "\"format_version\": 2")).contains("expected 1"));
        let mut list: ViewList = serde_json::from_str(&text).unwrap();
        list.photos.push(list.photos[0].clone());
        let twice = open(&serde_json::to_string(&list).unwrap());
        assert!(twice.ends_with("views.json: the photo room-0 is listed twice"), "{twice}");
        assert!(open("[]").contains("not a list of views, as written by --write-views"));
        std::fs::remove_file(&path).unwrap();
        assert!(External::open("other", folder.path()).unwrap_err().to_string().contains(VIEWS_FILE));
    }
}
