use std::collections::HashMap;
use std::path::Path;

use lo_geometry::{Camera, Distortion, RigidTransform, Vec3};

use super::{Pose, PoseError, PoseFile, PoseFormat};

/// Largest difference in time of a photo and its pose, seconds: less than a frame of a video.
const MAX_APART_S: f64 = 0.02;

/// Largest distance of two cameras in one room, metres.
const MAX_DISTANCE_M: f64 = 50.0;

/// Poses of several photos, one each.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoPoses {
    /// Poses in the order of the photos, with the names of photos and files.
    matched: Vec<Matched>,
    /// Unit vector against gravity in the axes of the first photo's camera, if the format states it.
    pub up: Option<Vec3>,
    /// Format of the files.
    pub format: PoseFormat,
}

#[derive(Clone, Debug, PartialEq)]
struct Matched {
    photo: String,
    file: String,
    pose: Pose,
}

impl PhotoPoses {
    /// Reads pose files and matches poses with photos: one file for all photos, or one per photo in order.
    ///
    /// # Errors
    /// If a file is invalid, and all errors of [`PhotoPoses::of`].
    pub fn read(files: &[impl AsRef<Path>], photos: &[impl AsRef<Path>]) -> Result<Self, PoseError> {
        let files: Vec<PoseFile> = files.iter().map(|path| PoseFile::read(path.as_ref())).collect::<Result<_, _>>()?;
        Self::of(&files, photos)
    }

    /// Matches poses with photos.
    ///
    /// # Errors
    /// If the number of files is neither one nor the number of photos, or a photo has no pose or several.
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
        let world_up = first.world_up.filter(|up| files.iter().all(|file| file.world_up == Some(*up)));
        let up = world_up.zip(matched.first()).map(|(up, first)| first.pose.camera_from_world(up));
        Ok(Self { matched, up, format: first.format })
    }

    /// Checks that positions in metres are within one room.
    ///
    /// # Errors
    /// If cameras are more than 50 m apart.
    pub fn check_distances(&self) -> Result<(), PoseError> {
        for (i, a) in self.matched.iter().enumerate() {
            for b in &self.matched[i + 1..] {
                let distance_m = (a.pose.position_m - b.pose.position_m).length();
                if distance_m > MAX_DISTANCE_M {
                    let (first, other) = (a.photo.clone(), b.photo.clone());
                    return Err(PoseError::Distance { first, other, distance_m, most_m: MAX_DISTANCE_M });
                }
            }
        }
        Ok(())
    }

    /// Returns the transform from each camera's axes to those of the first camera. Translations are in metres, except
    /// for formats of an arbitrary unit ([`PoseFormat::has_unit`]).
    pub fn first_from_cameras(&self) -> Vec<RigidTransform> {
        let Some(first) = self.matched.first() else { return Vec::new() };
        let others = self.matched.iter().skip(1).map(|other| first.pose.this_from(&other.pose));
        std::iter::once(RigidTransform::IDENTITY).chain(others).collect()
    }

    /// Returns the camera of photo `index` at this size; `None` if its file has no intrinsics.
    ///
    /// # Errors
    /// If the intrinsics are for an image of another aspect ratio, or are invalid.
    pub fn camera(&self, index: usize, width: u32, height: u32) -> Result<Option<Camera>, PoseError> {
        let Matched { photo, file, pose } = &self.matched[index];
        pose.lens.map(|lens| lens.camera(width, height, file, photo)).transpose()
    }

    /// Returns the lens distortion of photo `index`, if its file states one.
    pub fn distortion(&self, index: usize) -> Option<Distortion> {
        self.matched[index].pose.distortion
    }

    /// Returns the exposure of each photo relative to the first, in stops (+1 is twice as bright), if the file states
    /// it for all.
    pub fn exposures_ev(&self) -> Option<Vec<f64>> {
        let all: Option<Vec<f64>> = self.matched.iter().map(|matched| matched.pose.exposure_ev).collect();
        all.map(|all| all.iter().map(|ev| ev - all[0]).collect())
    }
}

/// Returns the poses of photos from one file.
fn matched_in<'a>(file: &'a PoseFile, photos: &[impl AsRef<Path>]) -> Result<Vec<&'a Pose>, PoseError> {
    let by_order = file.poses.len() == photos.len();
    match file.format {
        PoseFormat::Own | PoseFormat::Nerf | PoseFormat::Colmap => {
            photos.iter().map(|photo| by_name(file, photo.as_ref())).collect()
        }
        PoseFormat::Record3d => {
            let index = |photo: &Path| stem(photo).and_then(|stem| stem.parse::<usize>().ok());
            let rule = "by the number in the photo's name, such as 0.jpg for the first";
            by_number(file, photos, index, |index| file.poses.get(index), rule)
        }
        PoseFormat::Chan | PoseFormat::Usd => {
            if let [Pose { frame: None, .. }] = file.poses[..] {
                // A camera that does not move.
                return Ok(vec![&file.poses[0]; photos.len()]);
            }
            let by_frame: HashMap<Option<i64>, &Pose> = file.poses.iter().map(|pose| (pose.frame, pose)).collect();
            let rule = "by the frame, which is the last number in the photo's name, such as shot_0012.jpg";
            by_number(file, photos, frame_of, |frame| by_frame.get(&Some(frame)).copied(), rule)
        }
        PoseFormat::Tum => {
            let time = |photo: &Path| stem(photo).and_then(|stem| stem.parse::<f64>().ok());
            let times: Option<Vec<f64>> = photos.iter().map(|photo| time(photo.as_ref())).collect();
            let nearest = |time_s: f64| {
                let apart = |pose: &Pose| (pose.time_s.unwrap_or(f64::INFINITY) - time_s).abs();
                let nearest = file.poses.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)))?;
                // Time stamps in photo names have six decimals; those of the trajectory may have four.
                (apart(nearest) <= MAX_APART_S).then_some(nearest)
            };
            let found: Option<Vec<&Pose>> = times.and_then(|times| times.into_iter().map(nearest).collect());
            match found {
                Some(found) => Ok(found),
                None if by_order => Ok(file.poses.iter().collect()),
                None => {
                    let without = |photo: &&_| time(AsRef::<Path>::as_ref(*photo)).and_then(nearest).is_none();
                    let photo = photos.iter().find(without).map_or(Path::new(""), |photo| photo.as_ref());
                    Err(no_pose(
                        file,
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

/// Returns the poses of photos by the numbers in their names; by order if a name has none and there are as many poses
/// as photos.
fn by_number<'a, N>(
    file: &'a PoseFile,
    photos: &[impl AsRef<Path>],
    number: impl Fn(&Path) -> Option<N>,
    pose_of: impl Fn(N) -> Option<&'a Pose>,
    rule: &'static str,
) -> Result<Vec<&'a Pose>, PoseError> {
    if file.poses.len() == photos.len() && photos.iter().any(|photo| number(photo.as_ref()).is_none()) {
        return Ok(file.poses.iter().collect());
    }
    let photos = photos.iter().map(AsRef::as_ref);
    photos.map(|photo| number(photo).and_then(&pose_of).ok_or_else(|| no_pose(file, photo, rule))).collect()
}

fn no_pose(file: &PoseFile, photo: &Path, rule: &'static str) -> PoseError {
    PoseError::NoPose { file: file.name.clone(), photo: photo.display().to_string(), rule }
}

/// Returns the frame of a photo: the last number in its name, without the extension.
pub(super) fn frame_of(photo: &Path) -> Option<i64> {
    stem(photo)?.rsplit(|c: char| !c.is_ascii_digit()).find(|part| !part.is_empty())?.parse().ok()
}

pub(super) fn stem(photo: &Path) -> Option<&str> {
    photo.file_stem()?.to_str()
}

/// Returns the pose whose file path shares the longest end with the photo's, at least the file name.
pub(super) fn by_name<'a>(file: &'a PoseFile, photo: &Path) -> Result<&'a Pose, PoseError> {
    let parts: Vec<String> = photo.iter().rev().map(|part| part.to_string_lossy().into_owned()).collect();
    let name = parts.first().map_or("", String::as_str);
    let shared = |pose: &Pose| {
        let own = pose.file.as_deref().unwrap_or_default();
        let mut own = own.rsplit(['/', '\\']).filter(|part| !part.is_empty() && *part != ".");
        let last = own.next()?;
        // NeRF's synthetic scenes name images without extension.
        let bare = !last.contains('.') && Some(last) == stem(photo);
        (last == name || bare).then(|| 1 + own.zip(&parts[1..]).take_while(|(a, b)| a == b).count())
    };
    let scores: Vec<Option<usize>> = file.poses.iter().map(shared).collect();
    let best = scores.iter().flatten().max().copied();
    let mut found = file.poses.iter().zip(&scores).filter(|(_, score)| score.is_some() && **score == best);
    match (found.next(), found.next()) {
        (Some((pose, _)), None) => Ok(pose),
        (Some(_), Some(_)) => Err(PoseError::Ambiguous { file: file.name.clone(), photo: photo.display().to_string() }),
        (None, _) => Err(no_pose(file, photo, "by file names")),
    }
}
