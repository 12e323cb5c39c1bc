use std::borrow::Cow;
use std::path::{Path, PathBuf};

use lo_geometry::Camera;
use lo_imaging::{read_depth, read_radiance};
use lo_sensor::PhotoModel;

use super::files::{check_jpeg, check_size, clean, entries, folders, name, photographed, size};
use super::splits::PublishedSplits;
use crate::sample::Metadata;
use crate::{Dataset, DatasetError, Record, Sample, Shot, Split};

/// End of an image's file name.
const IMAGE: &str = "_im.exr";

/// Ends of the names of its two folders, with the horizontal field of view in degrees.
const FOLDERS: [(&str, f64); 2] = [("_85", 85.0), ("_120", 120.0)];

/// Lists of scenes, one name per line.
const LISTS: [(&str, Split); 3] =
    [("train.txt", Split::Train), ("val.txt", Split::Validation), ("test.txt", Split::Test)];

/// InteriorVerse (Zhu et al., SIGGRAPH Asia 2022), its materials and geometry, in the layout of its authors' README:
/// `dataset_85` or `dataset_120`, or a folder with one or both, with `<scene>/<i>_{im,albedo,depth,…}.exr` and
/// `train.txt`, `val.txt`, `test.txt`.
///
/// Images are HDR, 85° or 120° across; LDR photos are made of them. Depth is in millimetres along the optical axis,
/// infinite where there is none. Poses and light other than the image's are not published.
#[derive(Debug)]
pub struct InteriorVerse {
    images: Vec<RenderedImage>,
    splits: PublishedSplits,
    photo: PhotoModel,
    seed: u64,
}

#[derive(Debug)]
struct RenderedImage {
    path: PathBuf,
    scene: String,
    hfov_deg: f64,
}

/// Returns the parts of the dataset in a folder, or the folder itself, with their fields of view.
fn parts(folder: &Path) -> Result<Vec<(PathBuf, f64)>, DatasetError> {
    let hfov_deg =
        |path: &Path| FOLDERS.iter().find(|(end, _)| name(path).ends_with(end)).map(|(_, hfov_deg)| *hfov_deg);
    // A relative path may have no name.
    let folder = folder.canonicalize().map_err(DatasetError::io(folder))?;
    if let Some(hfov_deg) = hfov_deg(&folder) {
        return Ok(vec![(folder, hfov_deg)]);
    }
    Ok(folders(&folder)?.into_iter().filter_map(|path| hfov_deg(&path).map(|hfov_deg| (path, hfov_deg))).collect())
}

/// Returns the images of a scene.
fn images(scene: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    Ok(entries(scene)?.into_iter().filter(|path| name(path).ends_with(IMAGE)).collect())
}

impl InteriorVerse {
    /// Whether a folder looks like the dataset.
    pub(crate) fn is_at(folder: &Path) -> bool {
        let has_images = |scene: &PathBuf| images(scene).is_ok_and(|images| !images.is_empty());
        let is_part = |(part, _): &(PathBuf, f64)| folders(part).is_ok_and(|all| all.iter().take(50).any(has_images));
        parts(folder).is_ok_and(|parts| parts.iter().any(is_part))
    }

    /// Opens the images of a folder. LDR photos are made with `photo` and `seed`.
    ///
    /// # Errors
    /// If a folder or a list cannot be read, or there is no image.
    pub fn open(folder: &Path, photo: PhotoModel, seed: u64) -> Result<Self, DatasetError> {
        let (mut found, mut splits) = (Vec::new(), PublishedSplits::default());
        for (part, hfov_deg) in parts(folder)? {
            for (list, split) in LISTS {
                let path = part.join(list);
                if path.is_file() {
                    let text = std::fs::read_to_string(&path).map_err(DatasetError::io(&path))?;
                    for scene in text.lines() {
                        splits.assign(scene.trim(), split);
                    }
                }
            }
            for scene in folders(&part)? {
                let image = |path| RenderedImage { path, scene: name(&scene), hfov_deg };
                found.extend(images(&scene)?.into_iter().map(image));
            }
        }
        match found.is_empty() {
            true => Err(DatasetError::layout(folder, "contains no dataset_85 or dataset_120 with <scene>/<i>_im.exr")),
            false => Ok(Self { images: found, splits, photo, seed }),
        }
    }
}

impl Dataset for InteriorVerse {
    fn len(&self) -> usize {
        self.images.len()
    }

    fn scene_id(&self, index: usize) -> Cow<'_, str> {
        self.images[index].scene.as_str().into()
    }

    fn get(&self, index: usize) -> Result<Sample, DatasetError> {
        let RenderedImage { path, scene, hfov_deg } =
            self.images.get(index).ok_or(DatasetError::Index { index, len: self.images.len() })?;
        let seen = read_radiance(path)?.map(clean);
        let (width, height) = (seen.width(), seen.height());
        check_jpeg(path, &seen)?;
        let camera = Camera::from_hfov_deg(*hfov_deg, width as u32, height as u32)
            .map_err(|error| DatasetError::field(path, "size", error))?;
        let number = name(path);
        let number = number.strip_suffix(IMAGE).unwrap_or(&number);
        let beside = |what: &str| path.with_file_name(format!("{number}_{what}.exr"));
        let depth_file = beside("depth");
        let depth_m = read_depth(&depth_file, Some(1000.0))?;
        check_size(&depth_file, size(&depth_m), "the image", size(&seen))?;
        let albedo_file = beside("albedo");
        let albedo = if albedo_file.is_file() {
            let albedo = read_radiance(&albedo_file)?;
            check_size(&albedo_file, size(&albedo), "the image", size(&seen))?;
            Some(albedo)
        } else {
            None
        };
        let id = format!("{scene}-{number}-{hfov_deg}");
        let mut stream = lo_random::stream(self.seed ^ lo_random::hash(id.as_bytes()), "photo", 0);
        let settings = self.photo.draw(&mut stream);
        let mut shot = Shot { depth_m: Some(depth_m), albedo, ..photographed(&settings, &seen, camera, &mut stream) };
        self.splits.note(scene, &mut shot.metadata);
        let record = Record {
            key: id,
            scene_id: scene.clone(),
            up: None,
            points: Vec::new(),
            point_area_m2: None,
            views: Vec::new(),
            shots: vec![shot],
            metadata: Metadata::new(),
        };
        Ok(record.into_sample())
    }

    fn split(&self, index: usize) -> Split {
        self.splits.of(&self.images[index].scene)
    }
}
