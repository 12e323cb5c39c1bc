use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use lo_geometry::{Camera, DMat3, DQuat, DVec3, Quat, Vec3};
use lo_imaging::{DepthMap, Image, RadianceImage};
use lo_octree::{Provenance, RadiancePoint};
use lo_sensor::PhotoModel;

use super::files::{check_jpeg, check_size, clean, entries, folders, name, photographed, size};
use super::hdf5::read_array;
use super::splits::PublishedSplits;
use crate::sample::Metadata;
use crate::{Dataset, DatasetError, Record, Sample, Shot, Split, evenly_spread};

/// Lists beside the scenes; both are in the authors' repository.
const CAMERAS: &str = "metadata_camera_parameters.csv";
const SPLIT: &str = "metadata_images_split_scene_v1.csv";

/// Number of a trajectory's frames, besides the sample's own, that give surface points, and the step of their pixels.
const FUSED_FRAMES: usize = 12;
const FUSED_STEP: usize = 8;

/// Largest shear of an image, in pixels along a row per row. A pinhole camera has none.
const MAX_SHEAR: f64 = 0.005;

/// Hypersim (Roberts et al., ICCV 2021), in its published layout, with the lists `metadata_camera_parameters.csv` and
/// `metadata_images_split_scene_v1.csv` of the authors' repository beside the scenes.
///
/// A scene is a folder `ai_VVV_NNN` with `images/scene_cam_XX_final_hdf5/frame.IIII.color.hdf5` (HDR),
/// `scene_cam_XX_geometry_hdf5/frame.IIII.depth_meters.hdf5` (metres along the ray) and
/// `_detail/cam_XX/camera_keyframe_{positions,orientations}.hdf5` (asset units; world from camera). LDR photos are made
/// of the images.
///
/// Frames that the list excludes are left out, and so are scenes whose image is sheared or does not hold the principal
/// point. A lens that is tilted against the image is a pinhole camera in another direction; photos get that direction.
/// Surface points are those that twelve frames along the trajectory and the sample's own show.
#[derive(Debug)]
pub struct Hypersim {
    trajectories: Vec<Trajectory>,
    /// Trajectory and frame of each sample.
    samples: Vec<(u32, u32)>,
    splits: PublishedSplits,
    left_out: usize,
    photo: PhotoModel,
    seed: u64,
}

/// Frames along one path through a scene.
#[derive(Debug)]
struct Trajectory {
    scene: String,
    /// `cam_00`.
    camera: String,
    /// Folder `images` of the scene.
    images: PathBuf,
    lens: Lens,
    frames: Vec<Frame>,
}

#[derive(Clone, Copy, Debug)]
struct Frame {
    number: usize,
    position_m: Vec3,
    /// World from the pinhole camera.
    rotation: Quat,
}

/// A scene's lens as a pinhole camera.
#[derive(Clone, Copy, Debug)]
struct Lens {
    camera: Camera,
    /// Stored camera from the pinhole camera.
    rotation: Quat,
}

impl Lens {
    /// Splits the matrix that maps (u, v, 1), from −1 to 1 across the image and +v up, to a direction in the stored
    /// camera's axes. `None` if the image is sheared, or the matrix is not that of a lens.
    fn new(ray_of_uv: DMat3, [width, height]: [f64; 2]) -> Option<Self> {
        // Pixels with v down ← directions with +Y up and −Z ahead.
        let uv_of_pixel = DMat3::from_cols(
            DVec3::new(2.0 / width, 0.0, 0.0),
            DVec3::new(0.0, -2.0 / height, 0.0),
            DVec3::new(-1.0, 1.0, 1.0),
        );
        let rays = ray_of_uv * uv_of_pixel;
        let pixel_of_ray = (rays.determinant().abs() > 1e-12).then(|| rays.inverse())?;
        // pixel = K · R · ray, with K upper triangular: Gram-Schmidt from the last row. The pinhole camera looks along
        // −Z: its axes are the rows (x, −y, −z) of R.
        let [a, b, c] = [0, 1, 2].map(|row| pixel_of_ray.row(row));
        // In front of the camera the third coordinate is positive.
        let ahead = DVec3::NEG_Z;
        let (a, b, c) = if c.dot(ahead) > 0.0 { (a, b, c) } else { (-a, -b, -c) };
        let scale = c.length();
        let z = c / scale;
        let cy = b.dot(z) / scale;
        let b = b - z * b.dot(z);
        let fy = b.length() / scale;
        let y = b.normalize();
        let (cx, shear) = (a.dot(z) / scale, a.dot(y) / scale / fy);
        let a = a - z * a.dot(z) - y * a.dot(y);
        let fx = a.length() / scale;
        let x = a.normalize();
        let axes = DMat3::from_cols(x, -y, -z);
        if shear.abs() > MAX_SHEAR || axes.determinant() < 0.0 {
            return None;
        }
        let camera = Camera::new(fx, fy, cx, cy, width as u32, height as u32).ok()?;
        Some(Self { camera, rotation: DQuat::from_mat3(&axes).as_quat() })
    }
}

impl Hypersim {
    /// Whether a folder looks like the dataset.
    pub(crate) fn is_at(folder: &Path) -> bool {
        let is_scene = |scene: &PathBuf| scene.join("_detail").is_dir() && scene.join("images").is_dir();
        folders(folder).is_ok_and(|all| all.iter().take(50).any(is_scene))
    }

    /// Opens the scenes of a folder. LDR photos are made with `photo` and `seed`.
    ///
    /// # Errors
    /// If a folder or list cannot be read, a scene has no cameras, or there is no frame.
    pub fn open(folder: &Path, photo: PhotoModel, seed: u64) -> Result<Self, DatasetError> {
        let scenes: Vec<PathBuf> =
            folders(folder)?.into_iter().filter(|scene| scene.join("_detail").is_dir()).collect();
        if scenes.is_empty() {
            return Err(DatasetError::layout(folder, "contains no scene: ai_VVV_NNN with _detail and images"));
        }
        let lenses = lenses(&folder.join(CAMERAS))?;
        let (splits, excluded) = published(&folder.join(SPLIT))?;
        let (mut trajectories, mut left_out) = (Vec::new(), 0);
        for scene in scenes {
            let id = name(&scene);
            let lens = lenses.get(&id).ok_or_else(|| {
                DatasetError::field(&folder.join(CAMERAS), "scene_name", format!("there is no line of {id}"))
            })?;
            for (folder, camera) in image_folders(&scene)? {
                let mut numbers = frame_numbers(&folder)?;
                let count = numbers.len();
                numbers.retain(|&number| !excluded.contains(&(id.clone(), camera.clone(), number)));
                let Some(lens) = lens else {
                    left_out += count;
                    continue;
                };
                left_out += count - numbers.len();
                trajectories.push(Trajectory::open(&scene, camera, *lens, &numbers)?);
            }
        }
        let numbered = trajectories.iter().enumerate();
        let samples: Vec<(u32, u32)> =
            numbered.flat_map(|(t, all)| (0..all.frames.len()).map(move |f| (t as u32, f as u32))).collect();
        match (samples.is_empty(), left_out) {
            (true, 0) => {
                Err(DatasetError::layout(folder, "contains no ai_VVV_NNN/images/scene_cam_XX_final_hdf5/*.color.hdf5"))
            }
            (true, _) => Err(DatasetError::layout(folder, format!("all frames are left out: {left_out}"))),
            (false, _) => Ok(Self { trajectories, samples, splits, left_out, photo, seed }),
        }
    }
}

/// Reads the lens of each scene; `None` for those that are no pinhole camera.
fn lenses(path: &Path) -> Result<HashMap<String, Option<Lens>>, DatasetError> {
    let (columns, rows) = list(path, "each scene has its own lens", "contrib/mikeroberts3000")?;
    let column = |wanted: &str| {
        columns.iter().position(|name| name == wanted).ok_or_else(|| DatasetError::field(path, wanted, "is missing"))
    };
    let scene = column("scene_name")?;
    let [width, height] = [column("settings_output_img_width")?, column("settings_output_img_height")?];
    let mut entries = [[0; 3]; 3];
    for (row, column_of) in entries.iter_mut().enumerate() {
        for (index, entry) in column_of.iter_mut().enumerate() {
            *entry = column(&format!("M_cam_from_uv_{row}{index}"))?;
        }
    }
    let lens = |row: &csv::StringRecord| {
        let number = |index: usize| row.get(index).unwrap_or_default().trim().parse::<f64>().unwrap_or(f64::NAN);
        let matrix = DMat3::from_cols_array_2d(&entries.map(|row| row.map(number))).transpose();
        matrix.is_finite().then(|| Lens::new(matrix, [width, height].map(number))).flatten()
    };
    Ok(rows.iter().map(|row| (row.get(scene).unwrap_or_default().to_owned(), lens(row))).collect())
}

/// Scene, trajectory and number of excluded frames.
type Excluded = HashSet<(String, String, usize)>;

/// Reads the published split and the frames that it excludes.
fn published(path: &Path) -> Result<(PublishedSplits, Excluded), DatasetError> {
    let (mut splits, mut excluded) = (PublishedSplits::default(), Excluded::new());
    let (columns, rows) = list(path, "it excludes unusable frames", "evermotion_dataset/analysis")?;
    let column = |wanted: &str| {
        columns.iter().position(|name| name == wanted).ok_or_else(|| DatasetError::field(path, wanted, "is missing"))
    };
    let indices = ["scene_name", "camera_name", "frame_id", "included_in_public_release", "split_partition_name"];
    let [scene, camera, frame, included, part] = indices.map(column);
    let (scene, camera, frame, included, part) = (scene?, camera?, frame?, included?, part?);
    for (number, row) in rows.iter().enumerate() {
        let cell = |index: usize| row.get(index).unwrap_or_default().trim();
        let wrong = |reason: String| DatasetError::field(path, format!("line {}", number + 2), reason);
        let split = match (cell(included), cell(part)) {
            ("True", "train") => Split::Train,
            ("True", "val") => Split::Validation,
            ("True", "test") => Split::Test,
            ("False", _) => {
                let frame = cell(frame).parse().map_err(|error| wrong(format!("frame {}: {error}", cell(frame))))?;
                excluded.insert((cell(scene).to_owned(), cell(camera).to_owned(), frame));
                continue;
            }
            (included, part) => return Err(wrong(format!("included `{included}`, part `{part}`"))),
        };
        if splits.assign(cell(scene), split).is_some_and(|before| before != split) {
            return Err(wrong(format!("{} is in two parts", cell(scene))));
        }
    }
    Ok((splits, excluded))
}

/// Reads a list of the authors' repository.
fn list(path: &Path, why: &str, folder: &str) -> Result<(Vec<String>, Vec<csv::StringRecord>), DatasetError> {
    if !path.is_file() {
        let reason = format!("is missing: {why}. It is in {folder} of github.com/apple/ml-hypersim");
        return Err(DatasetError::layout(path, reason));
    }
    table(path)
}

/// Reads a CSV file: names of the columns, and rows.
fn table(path: &Path) -> Result<(Vec<String>, Vec<csv::StringRecord>), DatasetError> {
    let failed = |error: csv::Error| DatasetError::field(path, "CSV", error);
    let mut reader = csv::Reader::from_path(path).map_err(failed)?;
    let columns = reader.headers().map_err(failed)?.iter().map(|name| name.trim().to_owned()).collect();
    Ok((columns, reader.records().collect::<Result<_, _>>().map_err(failed)?))
}

/// Finds the folders of a scene's HDR images, with the names of their trajectories.
fn image_folders(scene: &Path) -> Result<Vec<(PathBuf, String)>, DatasetError> {
    let camera = |folder: PathBuf| {
        let camera = name(&folder).strip_prefix("scene_")?.strip_suffix("_final_hdf5")?.to_owned();
        Some((folder, camera))
    };
    Ok(folders(&scene.join("images"))?.into_iter().filter_map(camera).collect())
}

/// Returns the numbers of the frames in a folder of HDR images.
fn frame_numbers(folder: &Path) -> Result<Vec<usize>, DatasetError> {
    let number = |path: PathBuf| name(&path).strip_prefix("frame.")?.strip_suffix(".color.hdf5")?.parse().ok();
    Ok(entries(folder)?.into_iter().filter_map(number).collect())
}

/// Reads the length of an asset unit.
fn metres_per_unit(path: &Path) -> Result<f64, DatasetError> {
    const NAME: &str = "meters_per_asset_unit";
    let (columns, rows) = table(path)?;
    let value = rows.iter().find(|row| row.get(0).is_some_and(|cell| cell.trim() == NAME)).and_then(|row| row.get(1));
    let value = value.and_then(|value| value.trim().parse::<f64>().ok()).filter(|value| *value > 0.0);
    value.filter(|value| value.is_finite()).ok_or_else(|| {
        DatasetError::field(path, NAME, format!("is missing or not positive; the columns are {}", columns.join(", ")))
    })
}

/// Reads one array for each keyframe.
fn keyframes(path: &Path, each: &[usize]) -> Result<Vec<Vec<f64>>, DatasetError> {
    let (shape, values) = read_array(path)?;
    if shape.get(1..) != Some(each) {
        return Err(DatasetError::field(path, "dataset", format!("{shape:?} values; N × {each:?} are needed")));
    }
    let size: usize = each.iter().product();
    Ok(values.chunks_exact(size).map(<[f64]>::to_vec).collect())
}

impl Trajectory {
    /// Reads the cameras of frames.
    fn open(scene: &Path, camera: String, lens: Lens, numbers: &[usize]) -> Result<Self, DatasetError> {
        let metres_per_unit = metres_per_unit(&scene.join("_detail").join("metadata_scene.csv"))?;
        let detail = scene.join("_detail").join(&camera);
        let positions = keyframes(&detail.join("camera_keyframe_positions.hdf5"), &[3])?;
        let orientations = keyframes(&detail.join("camera_keyframe_orientations.hdf5"), &[3, 3])?;
        let frame = |&number: &usize| {
            let wrong = |reason: &str| DatasetError::field(&detail, format!("frame {number}"), reason);
            let camera = positions.get(number).zip(orientations.get(number));
            let (position, orientation) = camera.ok_or_else(|| wrong("has no camera"))?;
            let position_m = (DVec3::from_slice(position) * metres_per_unit).as_vec3();
            let orientation = DMat3::from_cols_slice(orientation).transpose();
            let is_rotation = (orientation * orientation.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-3)
                && orientation.determinant() > 0.0;
            if !position_m.is_finite() || !is_rotation {
                return Err(wrong("its camera is no rigid motion"));
            }
            let rotation = (DQuat::from_mat3(&orientation).as_quat() * lens.rotation).normalize();
            Ok(Frame { number, position_m, rotation })
        };
        let frames = numbers.iter().map(frame).collect::<Result<_, _>>()?;
        Ok(Self { scene: name(scene), camera, images: scene.join("images"), lens, frames })
    }

    fn file(&self, kind: &str, frame: &Frame, what: &str) -> PathBuf {
        self.images
            .join(format!("scene_{}_{kind}_hdf5", self.camera))
            .join(format!("frame.{:04}.{what}.hdf5", frame.number))
    }

    /// Reads an image of three channels.
    fn colours(&self, path: &Path) -> Result<RadianceImage, DatasetError> {
        let (shape, values) = read_array(path)?;
        let &[height, width, 3] = &shape[..] else {
            return Err(DatasetError::field(path, "dataset", format!("{shape:?} values; an image has H × W × 3")));
        };
        let pixels = values.chunks_exact(3).map(|rgb| clean(&[rgb[0] as f32, rgb[1] as f32, rgb[2] as f32])).collect();
        let image = RadianceImage::new(width, height, pixels);
        self.check(path, size(&image))?;
        Ok(image)
    }

    /// Reads the depth along the optical axis; 0 where there is none.
    fn depth(&self, frame: &Frame) -> Result<DepthMap, DatasetError> {
        let path = self.file("geometry", frame, "depth_meters");
        let (shape, values) = read_array(&path)?;
        let &[height, width] = &shape[..] else {
            return Err(DatasetError::field(&path, "dataset", format!("{shape:?} values; a depth map has H × W")));
        };
        self.check(&path, (width, height))?;
        let camera = &self.lens.camera;
        let depth_m = Image::from_fn(width, height, |x, y| {
            let distance_m = values[y * width + x] as f32;
            let is_reading = distance_m.is_finite() && distance_m > 0.0;
            if is_reading { distance_m * -camera.direction(x as f64 + 0.5, y as f64 + 0.5).z } else { 0.0 }
        });
        if depth_m.pixels().iter().all(|z| *z == 0.0) {
            return Err(DatasetError::field(&path, "dataset", "no pixel has depth"));
        }
        Ok(depth_m)
    }

    fn check(&self, path: &Path, found: (usize, usize)) -> Result<(), DatasetError> {
        let Camera { width, height, .. } = self.lens.camera;
        check_size(path, found, CAMERAS, (width as usize, height as usize))
    }

    /// Returns the surface points that a frame shows, in the world's axes.
    fn points(&self, frame: &Frame, colours: &RadianceImage, depth_m: &DepthMap) -> Vec<RadiancePoint> {
        let rows = (FUSED_STEP / 2..depth_m.height()).step_by(FUSED_STEP);
        let pixels = rows.flat_map(|y| (FUSED_STEP / 2..depth_m.width()).step_by(FUSED_STEP).map(move |x| (x, y)));
        let point = |(x, y): (usize, usize)| {
            let local = self.lens.camera.unproject(x as f64 + 0.5, y as f64 + 0.5, f64::from(depth_m[(x, y)]));
            RadiancePoint {
                position_m: frame.position_m + frame.rotation * local,
                radiance: colours[(x, y)],
                provenance: Provenance::Inferred,
            }
        };
        pixels.filter(|&at| depth_m[at] > 0.0).map(point).collect()
    }
}

impl Dataset for Hypersim {
    fn len(&self) -> usize {
        self.samples.len()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.trajectories[self.samples[index].0 as usize].scene.as_str().into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let len = self.samples.len();
        let &(trajectory, number) = self.samples.get(index).ok_or(DatasetError::Index { index, len })?;
        let trajectory = &self.trajectories[trajectory as usize];
        let frame = &trajectory.frames[number as usize];
        let colour_file = trajectory.file("final", frame, "color");
        let seen = trajectory.colours(&colour_file)?;
        check_jpeg(&colour_file, &seen)?;
        let depth_m = trajectory.depth(frame)?;
        let mut points = trajectory.points(frame, &seen, &depth_m);
        for other in evenly_spread(trajectory.frames.len(), FUSED_FRAMES).filter(|&other| other != number as usize) {
            let other = &trajectory.frames[other];
            let colours = trajectory.colours(&trajectory.file("final", other, "color"))?;
            points.extend(trajectory.points(other, &colours, &trajectory.depth(other)?));
        }
        let albedo_file = trajectory.file("final", frame, "diffuse_reflectance");
        let albedo = albedo_file.is_file().then(|| trajectory.colours(&albedo_file)).transpose()?;
        let id = format!("{}-{}-{:04}", trajectory.scene, trajectory.camera, frame.number);
        let mut stream = lo_random::stream(self.seed ^ lo_random::hash(id.as_bytes()), "photo", 0);
        let settings = self.photo.draw(&mut stream);
        let mut shot = Shot {
            position_m: frame.position_m,
            rotation: frame.rotation,
            depth_m: Some(depth_m),
            albedo,
            ..photographed(&settings, &seen, trajectory.lens.camera, &mut stream)
        };
        self.splits.note(&trajectory.scene, &mut shot.metadata);
        let record = Record {
            key: id,
            scene_id: trajectory.scene.clone(),
            up: Some(Vec3::Z),
            points,
            point_area_m2: None,
            views: Vec::new(),
            shots: vec![shot],
            metadata: Metadata::new(),
        };
        Ok(record.into_sample())
    }

    fn split(&self, index: usize) -> Split {
        self.splits.of(&self.trajectories[self.samples[index].0 as usize].scene)
    }

    fn left_out(&self) -> usize {
        self.left_out
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Returns the list's matrix for a pinhole camera whose axes are turned by `rotation`.
    fn ray_of_uv(camera: &Camera, rotation: DQuat) -> DMat3 {
        let ray = |u: f64, v: f64| {
            let direction = DVec3::new((u - camera.cx) / camera.fx, -(v - camera.cy) / camera.fy, -1.0);
            rotation * direction
        };
        let (width, height) = (f64::from(camera.width), f64::from(camera.height));
        // Linear in the pixel: from its values at (u, v) = (−1, …) of three corners.
        let [middle, right, up] = [(0.5, 0.5), (1.0, 0.5), (0.5, 0.0)].map(|(x, y)| ray(x * width, y * height));
        DMat3::from_cols(right - middle, up - middle, middle)
    }

    #[test]
    fn a_tilted_lens_is_a_pinhole_camera_in_another_direction() {
        let camera = Camera::new(900.0, 880.0, 500.0, 250.0, 1024, 768).unwrap();
        for rotation in [DQuat::IDENTITY, DQuat::from_rotation_x(0.3) * DQuat::from_rotation_z(0.1)] {
            let matrix = 0.37 * ray_of_uv(&camera, rotation);
            let lens = Lens::new(matrix, [1024.0, 768.0]).unwrap();
            for (got, expected) in [
                (lens.camera.fx, camera.fx),
                (lens.camera.fy, camera.fy),
                (lens.camera.cx, camera.cx),
                (lens.camera.cy, camera.cy),
            ] {
                assert!((got - expected).abs() < 1e-6, "{:?}", lens.camera);
            }
            assert!(lens.rotation.angle_between(rotation.as_quat()) < 1e-3, "{:?} {rotation}", lens.rotation);
        }
        // Sheared by 2 % of its height, and singular.
        let plain = ray_of_uv(&camera, DQuat::IDENTITY);
        let sheared = plain * DMat3::from_cols(DVec3::X, DVec3::new(0.02, 1.0, 0.0), DVec3::Z);
        assert!(Lens::new(sheared, [1024.0, 768.0]).is_none());
        assert!(Lens::new(DMat3::ZERO, [1024.0, 768.0]).is_none());
    }
}
