use std::borrow::Cow;
use std::path::{Path, PathBuf};

use lo_geometry::{Camera, Mat3, Quat, Vec3};
use lo_imaging::{DepthMap, Image, linear_from_srgb};

use super::files::{check_panorama, entries, stem};
use super::npz::Npz;
use crate::sample::Metadata;
use crate::{Dataset, DatasetError, NovelView, Record, Sample, Shot, Split};

/// Largest difference of a pose's axes from unit vectors at right angles.
const MAX_SKEW: f32 = 0.01;

/// Test set of Lighthouse (Srinivasan et al., CVPR 2020), made of InteriorNet: a folder of `.npz` files, each with a
/// photo and a panorama at a position ahead of its camera.
///
/// Arrays, of which the first dimension is a batch of 1, by the authors' `interiornet_test.py` and `data_loader.py`:
/// `ref_image` and `env_image`, sRGB from 0 to 1; `ref_depth`, metres along the ray, without holes and widened by a
/// pixel; `intrinsics`; `ref_pose` and `env_pose`, world from camera, whose third axis looks ahead. All samples are
/// [`Split::Test`]. Radiance above white is lost.
#[derive(Debug)]
pub struct Lighthouse {
    files: Vec<PathBuf>,
}

impl Lighthouse {
    /// Opens the files of a folder.
    ///
    /// # Errors
    /// If the folder cannot be read or contains none.
    pub fn open(folder: &Path) -> Result<Self, DatasetError> {
        let is_npz = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "npz");
        let files: Vec<PathBuf> = entries(folder)?.into_iter().filter(is_npz).collect();
        match files.is_empty() {
            true => Err(DatasetError::layout(folder, "contains no .npz")),
            false => Ok(Self { files }),
        }
    }
}

impl Dataset for Lighthouse {
    fn len(&self) -> usize {
        self.files.len()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        stem(&self.files[index]).into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let path = self.files.get(index).ok_or(DatasetError::Index { index, len: self.files.len() })?;
        let mut file = Npz::open(path)?;
        let mut picture = |name: &str| -> Result<Image<[f32; 3]>, DatasetError> {
            let (values, [height, width, channels]) = file.array(name)?;
            let wrong = |reason: String| DatasetError::field(path, name, reason);
            if channels != 3 || width == 0 || height == 0 {
                return Err(wrong(format!("shape {height} × {width} × {channels}; three channels are expected")));
            }
            if let Some(value) = values.iter().find(|value| !(0.0..=1.001).contains(*value)) {
                return Err(wrong(format!("the value {value} is outside 0 to 1")));
            }
            Ok(Image::from_fn(width, height, |x, y| [0, 1, 2].map(|c| values[3 * (y * width + x) + c])))
        };
        let (photo, panorama) = (picture("ref_image")?, picture("env_image")?);
        check_panorama(path, "env_image", &panorama)?;
        let (width, height) = (photo.width(), photo.height());
        let camera = camera(&mut file, path, [width, height])?;
        let (distances, size) = file.array::<2>("ref_depth")?;
        if size != [height, width] {
            let reason = format!("shape {size:?}, but the photo has {height} × {width} pixels");
            return Err(DatasetError::field(path, "ref_depth", reason));
        }
        let depth_m = DepthMap::from_fn(width, height, |x, y| {
            let along_axis = -camera.direction(x as f64 + 0.5, y as f64 + 0.5).z;
            let distance = distances[y * width + x];
            if distance.is_finite() && distance > 0.0 { distance * along_axis } else { 0.0 }
        });
        let (position_m, rotation) = pose(&mut file, path, "ref_pose")?;
        let (panorama_at, panorama_turned) = pose(&mut file, path, "env_pose")?;
        let view = NovelView {
            position_m: panorama_at,
            rotation: panorama_turned,
            radiance: panorama.map(|rgb| rgb.map(linear_from_srgb)),
            depth_m: None,
        };
        let shot = Shot {
            position_m,
            rotation,
            gains: [1.0; 3],
            camera,
            photo: photo.map(|rgb| rgb.map(|value| (255.0 * value.min(1.0)).round() as u8)),
            jpeg: None,
            radiance: None,
            depth_m: Some(depth_m),
            sensor_depth_m: None,
            normal: None,
            albedo: None,
            views: vec![0],
            metadata: Metadata::from_iter([(Sample::CLIPPED_PANORAMAS.to_owned(), true.into())]),
        };
        let record = Record {
            key: stem(path),
            scene_id: stem(path),
            up: Some(Vec3::Z),
            points: Vec::new(),
            point_area_m2: None,
            views: vec![view],
            shots: vec![shot],
            metadata: Metadata::new(),
        };
        Ok(record.into_sample())
    }

    fn split(&self, _: usize) -> Split {
        Split::Test
    }
}

fn camera(file: &mut Npz, path: &Path, [width, height]: [usize; 2]) -> Result<Camera, DatasetError> {
    let (values, size) = file.array::<2>("intrinsics")?;
    let wrong = |reason: String| DatasetError::field(path, "intrinsics", reason);
    if size != [3, 3] {
        return Err(wrong(format!("shape {size:?}; 3 × 3 is expected")));
    }
    let [fx, cx, fy, cy] = [0, 2, 4, 5].map(|i| f64::from(values[i]));
    Camera::new(fx, fy, cx, cy, width as u32, height as u32).map_err(|error| wrong(error.to_string()))
}

/// Reads a pose: position and rotation of a camera that looks along −Z. In the file it looks along +Z, with +X to the
/// right and +Y up.
fn pose(file: &mut Npz, path: &Path, name: &str) -> Result<(Vec3, Quat), DatasetError> {
    let (values, size) = file.array::<2>(name)?;
    let wrong = |reason: String| DatasetError::field(path, name, reason);
    if size != [4, 4] || values.iter().any(|value| !value.is_finite()) {
        return Err(wrong(format!("shape {size:?}; finite numbers, 4 × 4, are expected")));
    }
    let column = |i: usize| Vec3::new(values[i], values[4 + i], values[8 + i]);
    let axes = Mat3::from_cols(column(0), column(1), -column(2));
    let skew = axes.transpose() * axes - Mat3::IDENTITY;
    let is_rigid = skew.to_cols_array().iter().all(|value| value.abs() < MAX_SKEW) && axes.determinant() > 0.0;
    if !is_rigid {
        return Err(wrong("its axes are not those of a left-handed camera that looks along +Z".to_owned()));
    }
    Ok((column(3), Quat::from_mat3(&axes).normalize()))
}
