use std::path::Path;

use lo_geometry::{Camera, RigidTransform, Vec3};

use super::{Lens, Pose, PoseError, PoseFile, PoseFormat};

/// Photos and poses may be this much apart in time, seconds: less than a frame of a video.
const MAX_APART_S: f64 = 0.02;

/// Cameras farther apart than this, metres, do not look into one room.
const MAX_DISTANCE_M: f64 = 50.0;

/// Picture and stated size may differ by this much in aspect ratio.
const ASPECT_TOLERANCE: f64 = 0.01;

/// One pose for each of several photos.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoPoses {
    /// The photos' poses, with the names of the photos and of the files that they came from.
    matched: Vec<Matched>,
    /// Unit vector against gravity in the axes of the first photo's camera, where the format knows it.
    pub up: Option<Vec3>,
    /// What wrote the files.
    pub format: PoseFormat,
    /// Whether a lens distortion is stated.
    pub distorted: bool,
}

#[derive(Clone, Debug, PartialEq)]
struct Matched {
    photo: String,
    file: String,
    pose: Pose,
}

impl PhotoPoses {
    /// Reads the files and finds the photos' poses in them: one file for all photos, or one for each, in order.
    ///
    /// # Errors
    /// Of the files, and of [`PhotoPoses::of`].
    pub fn read(files: &[impl AsRef<Path>], photos: &[impl AsRef<Path>]) -> Result<Self, PoseError> {
        let files: Vec<PoseFile> = files.iter().map(|path| PoseFile::read(path.as_ref())).collect::<Result<_, _>>()?;
        Self::of(&files, photos)
    }

    /// Finds the photos' poses.
    ///
    /// # Errors
    /// Another number of files than one or the photos'; photos without a pose or with several; cameras more than 50 m apart.
    pub fn of(files: &[PoseFile], photos: &[impl AsRef<Path>]) -> Result<Self, PoseError> {
        let count = PoseError::FileCount { files: files.len(), photos: photos.len() };
        let Some(first) = files.first() else { return Err(count) };
        let matched: Vec<(&PoseFile, &Pose)> = match files {
            [file] => matched_in(file, photos)?.into_iter().map(|pose| (file, pose)).collect(),
            files if files.len() == photos.len() => match files.iter().find(|file| file.poses.len() != 1) {
                Some(PoseFile { name, poses, .. }) => {
                    return Err(PoseError::OneEach { file: name.clone(), poses: poses.len() });
                }
                None => files.iter().map(|file| (file, &file.poses[0])).collect(),
            },
            _ => return Err(count),
        };
        let label = |photo: &Path| photo.display().to_string();
        let matched: Vec<Matched> = matched
            .into_iter()
            .zip(photos)
            .map(|((file, pose), photo)| Matched {
                photo: label(photo.as_ref()),
                file: file.name.clone(),
                pose: pose.clone(),
            })
            .collect();
        for (i, a) in matched.iter().enumerate() {
            for b in &matched[i + 1..] {
                let distance_m = (a.pose.position_m - b.pose.position_m).length();
                if distance_m > MAX_DISTANCE_M {
                    let (first, other) = (a.photo.clone(), b.photo.clone());
                    return Err(PoseError::Distance { first, other, distance_m, most_m: MAX_DISTANCE_M });
                }
            }
        }
        let world_up = first.world_up.filter(|up| files.iter().all(|file| file.world_up == Some(*up)));
        let up = world_up.zip(matched.first()).map(|(up, first)| first.pose.camera_from_world(up));
        let distorted = files.iter().any(|file| file.distorted);
        Ok(Self { matched, up, format: first.format, distorted })
    }

    /// Where each camera stands in the axes of the first one.
    pub fn first_from_cameras(&self) -> Vec<RigidTransform> {
        let Some(first) = self.matched.first() else { return Vec::new() };
        let others = self.matched.iter().skip(1).map(|other| first.pose.this_from(&other.pose));
        std::iter::once(RigidTransform::IDENTITY).chain(others).collect()
    }

    /// The camera that made photo `index`, of this size; `None` where its file says nothing of the lens.
    ///
    /// # Errors
    /// Intrinsics of a picture of another shape, or of no camera.
    pub fn camera(&self, index: usize, width: u32, height: u32) -> Result<Option<Camera>, PoseError> {
        let Matched { photo, file, pose } = &self.matched[index];
        let camera = match pose.lens {
            None => return Ok(None),
            Some(Lens::HfovDeg(hfov_deg)) => Camera::from_hfov_deg(hfov_deg, width, height),
            Some(Lens::Pixels { intrinsics: [fx, fy, cx, cy], size }) => {
                let stated = size.unwrap_or((width, height));
                let aspect = |(width, height): (u32, u32)| f64::from(width) / f64::from(height);
                if (aspect(stated) / aspect((width, height))).ln().abs() > ASPECT_TOLERANCE {
                    let (file, photo) = (file.clone(), photo.clone());
                    return Err(PoseError::PictureSize { file, photo, stated, found: (width, height) });
                }
                Camera::new(fx, fy, cx, cy, stated.0, stated.1).map(|camera| camera.resized(width, height))
            }
        };
        let (file, photo) = (file.clone(), photo.clone());
        camera.map(Some).map_err(|source| PoseError::Camera { file, photo, source })
    }

    /// Stops by which each photo shows the same light brighter than the first, where the file says so of all.
    pub fn exposures_ev(&self) -> Option<Vec<f64>> {
        let all: Option<Vec<f64>> = self.matched.iter().map(|matched| matched.pose.exposure_ev).collect();
        all.map(|all| all.iter().map(|ev| ev - all[0]).collect())
    }
}

/// The poses of photos in one file.
fn matched_in<'a>(file: &'a PoseFile, photos: &[impl AsRef<Path>]) -> Result<Vec<&'a Pose>, PoseError> {
    let by_order = file.poses.len() == photos.len();
    let missing = |photo: &Path, rule| {
        let (file, photo) = (file.name.clone(), photo.display().to_string());
        PoseError::NoPose { file, photo, rule }
    };
    match file.format {
        PoseFormat::Own | PoseFormat::Nerf => photos.iter().map(|photo| by_name(file, photo.as_ref())).collect(),
        PoseFormat::Record3d => {
            let index = |photo: &Path| stem(photo).and_then(|stem| stem.parse::<usize>().ok());
            let numbers: Option<Vec<usize>> = photos.iter().map(|photo| index(photo.as_ref())).collect();
            match numbers {
                Some(numbers) => {
                    let rule = "by the number in the photo's name, from 0";
                    let found = numbers.into_iter().zip(photos);
                    found.map(|(n, photo)| file.poses.get(n).ok_or_else(|| missing(photo.as_ref(), rule))).collect()
                }
                None if by_order => Ok(file.poses.iter().collect()),
                None => {
                    let photo = photos.iter().find(|photo| index(photo.as_ref()).is_none());
                    let photo = photo.map_or(Path::new(""), |photo| photo.as_ref());
                    Err(missing(photo, "photos are matched by the numbers that Record3D names them by, such as 12.jpg"))
                }
            }
        }
        PoseFormat::Tum => {
            let time = |photo: &Path| stem(photo).and_then(|stem| stem.parse::<f64>().ok());
            let times: Option<Vec<f64>> = photos.iter().map(|photo| time(photo.as_ref())).collect();
            let nearest = |time_s: f64| {
                let apart = |pose: &Pose| (pose.time_s.unwrap_or(f64::INFINITY) - time_s).abs();
                let nearest = file.poses.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
                // The names of photos have six digits, the trajectory may have four.
                (apart(nearest) <= MAX_APART_S).then_some(nearest)
            };
            let found: Option<Vec<&Pose>> = times.and_then(|times| times.into_iter().map(nearest).collect());
            match found {
                Some(found) => Ok(found),
                None if by_order => Ok(file.poses.iter().collect()),
                None => {
                    let without = |photo: &&_| time(AsRef::<Path>::as_ref(*photo)).and_then(nearest).is_none();
                    let photo = photos.iter().find(without).map_or(Path::new(""), |photo| photo.as_ref());
                    Err(missing(
                        photo,
                        "by the time stamps in the photos' names within 20 ms, or by order where there are as many",
                    ))
                }
            }
        }
        PoseFormat::ScannerApp | PoseFormat::Polycam if by_order => Ok(file.poses.iter().collect()),
        PoseFormat::ScannerApp | PoseFormat::Polycam => Err(PoseError::FileCount { files: 1, photos: photos.len() }),
    }
}

fn stem(photo: &Path) -> Option<&str> {
    photo.file_stem()?.to_str()
}

/// The pose whose file is this photo's: the one that shares the most of the path's end, and the name at least.
fn by_name<'a>(file: &'a PoseFile, photo: &Path) -> Result<&'a Pose, PoseError> {
    let parts: Vec<String> = photo.iter().rev().map(|part| part.to_string_lossy().into_owned()).collect();
    let name = parts.first().map_or("", String::as_str);
    let shared = |pose: &Pose| {
        let own = pose.file.as_deref().unwrap_or_default();
        let mut own = own.rsplit(['/', '\\']).filter(|part| !part.is_empty() && *part != ".");
        let last = own.next()?;
        // The synthetic scenes of NeRF name pictures without their ending.
        let bare = !last.contains('.') && Some(last) == stem(photo);
        (last == name || bare).then(|| 1 + own.zip(&parts[1..]).take_while(|(a, b)| a == b).count())
    };
    let scores: Vec<Option<usize>> = file.poses.iter().map(shared).collect();
    let best = scores.iter().flatten().max().copied();
    let mut found = file.poses.iter().zip(&scores).filter(|(_, score)| score.is_some() && **score == best);
    let (label, file) = (photo.display().to_string(), file.name.clone());
    match (found.next(), found.next()) {
        (Some((pose, _)), None) => Ok(pose),
        (Some(_), Some(_)) => Err(PoseError::Ambiguous { file, photo: label }),
        (None, _) => Err(PoseError::NoPose { file, photo: label, rule: "by file names" }),
    }
}
