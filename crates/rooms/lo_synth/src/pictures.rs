//! The user's images for posters, screens, covers and labels.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use lo_geometry::{Camera, Vec2, uv_from_direction};
use lo_imaging::{Image, Photo, RadianceImage, ToneCurve, linear_from_srgb8, luminance, resize, srgb8_from_linear};
use lo_random::Stream;

use crate::chance::{between, chance, count};
use crate::config::SynthConfig;
use crate::error::SynthError;
use crate::folder::files_in;

const EXTENSIONS: [&str; 6] = ["jpg", "jpeg", "png", "webp", "hdr", "exr"];
/// Number of image files per room.
const IMAGES_PER_ROOM: usize = 5;
/// Longer side of cached photos and panoramas, pixels.
const PHOTO_PX: usize = 1024;
const PANORAMA_PX: usize = 1536;
/// Longer side of a crop, pixels.
const CROP_PX: usize = 256;
/// Reflectance of white paper.
const PAPER_WHITE: f32 = 0.85;

/// Decoded images shared between rooms, newest last. An image depends on its file only, so rooms stay deterministic.
static CACHE: Mutex<VecDeque<(PathBuf, Arc<SourceImage>)>> = Mutex::new(VecDeque::new());
const CACHE_CAPACITY: usize = 40;

/// A decoded image in sRGB codes.
#[derive(Debug)]
struct SourceImage {
    image: Image<[u8; 3]>,
    /// Whether the image is equirectangular; its crops are perspective views.
    panorama: bool,
}

/// The images that a room can show.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pictures {
    images: Vec<Arc<SourceImage>>,
    share: f32,
}

impl Pictures {
    /// Draws some of the folders' files for a room and reads them.
    ///
    /// # Errors
    /// If a folder cannot be listed or holds no image, or if a file cannot be read.
    pub(crate) fn load(random: &mut Stream, config: &SynthConfig) -> Result<Self, SynthError> {
        if config.picture_folders.is_empty() || config.picture_share <= 0.0 {
            return Ok(Self::default());
        }
        let mut files = Vec::new();
        for folder in &config.picture_folders {
            let failed = |source| SynthError::PictureFolder { path: folder.clone(), source };
            let found = files_in(folder, &EXTENSIONS).map_err(failed)?;
            if found.is_empty() {
                return Err(SynthError::NoPicture { path: folder.clone() });
            }
            files.extend(found);
        }
        let images = (0..IMAGES_PER_ROOM.min(files.len()))
            .map(|_| load_image(&files[count(random, 0, files.len() - 1)]))
            .collect::<Result<_, _>>()?;
        Ok(Self { images, share: config.picture_share })
    }

    /// Draws an sRGB crop of one of the images, `aspect` times as wide as high, with the configured share.
    ///
    /// Returns `None` otherwise.
    pub(crate) fn crop(&self, random: &mut Stream, aspect: f32) -> Option<Image<[u8; 3]>> {
        if self.images.is_empty() || !chance(random, self.share) {
            return None;
        }
        let source = &self.images[count(random, 0, self.images.len() - 1)];
        let aspect = aspect.clamp(0.2, 5.0);
        let side = |share: f32| ((CROP_PX as f32 * share.min(1.0)).round() as usize).max(8);
        let (width, height) = (side(aspect), side(1.0 / aspect));
        Some(if source.panorama {
            perspective_view(random, &source.image, width, height)
        } else {
            random_crop(random, &source.image, width, height)
        })
    }
}

/// Converts an image to the reflectance of its print on paper, as RGBA codes.
pub(crate) fn print_reflectance(image: &Image<[u8; 3]>) -> Image<[u8; 4]> {
    image.map(|rgb| {
        let [r, g, b] = rgb.map(|code| srgb8_from_linear((PAPER_WHITE * linear_from_srgb8(code)).max(0.003)));
        [r, g, b, 255]
    })
}

fn load_image(path: &Path) -> Result<Arc<SourceImage>, SynthError> {
    let found = |read: &VecDeque<(PathBuf, Arc<SourceImage>)>| {
        read.iter().find(|(known, _)| known == path).map(|(_, source)| Arc::clone(source))
    };
    if let Some(source) = found(&CACHE.lock().unwrap_or_else(PoisonError::into_inner)) {
        return Ok(source);
    }
    // Decodes outside the lock, so that other threads can decode at the same time.
    let photo = lo_imaging::read_photo(path).map_err(SynthError::Picture)?.photo;
    let panorama = photo.width() == 2 * photo.height();
    let longest = if panorama { PANORAMA_PX } else { PHOTO_PX };
    let hdr = matches!(photo, Photo::Linear(_));
    let radiance = downscaled(photo.into_radiance(), longest);
    let image = if hdr { tone_mapped(&radiance) } else { ToneCurve::Clip.map(&radiance, 0.0) };
    let source = Arc::new(SourceImage { image, panorama });
    let mut read = CACHE.lock().unwrap_or_else(PoisonError::into_inner);
    read.push_back((path.to_owned(), Arc::clone(&source)));
    if read.len() > CACHE_CAPACITY {
        read.pop_front();
    }
    Ok(source)
}

fn downscaled(image: RadianceImage, longest: usize) -> RadianceImage {
    let scale = longest as f32 / image.width().max(image.height()).max(1) as f32;
    if scale >= 1.0 {
        return image;
    }
    let side = |length: usize| ((length as f32 * scale).round() as usize).max(1);
    resize(&image, side(image.width()), side(image.height()))
}

/// Exposes the median to 18 % grey and applies a tone curve.
fn tone_mapped(radiance: &RadianceImage) -> Image<[u8; 3]> {
    let mut light: Vec<f32> = radiance.pixels().iter().map(|&rgb| luminance(rgb)).filter(|l| l.is_finite()).collect();
    light.sort_by(f32::total_cmp);
    let median = light.get(light.len() / 2).copied().unwrap_or(1.0).max(1e-6);
    ToneCurve::Aces.map(radiance, (0.18 / median).log2())
}

/// Draws a rectangle of the image, at 35 to 100 % of the largest that fits.
fn random_crop(random: &mut Stream, image: &Image<[u8; 3]>, width: usize, height: usize) -> Image<[u8; 3]> {
    let (whole_x, whole_y) = (image.width() as f32, image.height() as f32);
    let aspect = width as f32 / height as f32;
    let max = (whole_x / aspect).min(whole_y);
    let rows = max * between(random, 0.35, 1.0);
    let size = [(rows * aspect).max(1.0) as usize, rows.max(1.0) as usize];
    let from = [image.width() - size[0], image.height() - size[1]].map(|room| count(random, 0, room));
    let part =
        RadianceImage::from_fn(size[0], size[1], |x, y| image[(from[0] + x, from[1] + y)].map(linear_from_srgb8));
    ToneCurve::Clip.map(&resize(&part, width, height), 0.0)
}

/// Draws a perspective view of a panorama, 45 to 80° along the longer side, by nearest-neighbour sampling.
fn perspective_view(random: &mut Stream, image: &Image<[u8; 3]>, width: usize, height: usize) -> Image<[u8; 3]> {
    let longer = between(random, 45.0, 80.0f32).to_radians();
    let focal = 0.5 * width.max(height) as f64 / f64::from(0.5 * longer).tan();
    let (cx, cy) = (0.5 * width as f64, 0.5 * height as f64);
    let camera = Camera { fx: focal, fy: focal, cx, cy, width: width as u32, height: height as u32 };
    let turn =
        lo_imaging::view_rotation(between(random, 0.0, std::f32::consts::TAU), between(random, -0.25, 0.35), 0.0);
    Image::from_fn(width, height, |x, y| {
        let Vec2 { x: u, y: v } = uv_from_direction(turn * camera.direction(x as f64 + 0.5, y as f64 + 0.5));
        let at = |share: f32, length: usize| ((share.max(0.0) * length as f32) as usize).min(length - 1);
        image[(at(u, image.width()), at(v, image.height()))]
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn folder() -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        // The left half is red, the right half blue.
        let photo = Image::from_fn(300, 200, |x, _| if x < 150 { [200u8, 10, 10] } else { [10, 10, 200] });
        lo_imaging::write_photo(folder.path().join("a.png"), &Photo::Srgb8(photo), "tests").unwrap();
        std::fs::write(folder.path().join("notes.txt"), "no picture").unwrap();
        folder
    }

    #[test]
    fn crops_are_of_the_folders_pictures_and_of_the_shape_asked_for() {
        let folder = folder();
        let config = SynthConfig {
            picture_folders: vec![folder.path().to_owned()],
            picture_share: 1.0,
            ..SynthConfig::default()
        };
        let pictures = Pictures::load(&mut lo_random::stream(1, "pictures", 0), &config).unwrap();
        let mut random = lo_random::stream(1, "crop", 0);
        for _ in 0..20 {
            let crop = pictures.crop(&mut random, 0.5).unwrap();
            assert_eq!((crop.width(), crop.height()), (128, 256));
            let known = |p: &[u8; 3]| p[1] < 30 && (u16::from(p[0]) + u16::from(p[2])).abs_diff(210) < 120;
            assert!(crop.pixels().iter().all(known));
            // Paper white is the maximum.
            assert!(print_reflectance(&crop).pixels().iter().all(|p| p[0] <= 190));
        }
        let none = SynthConfig { picture_share: 0.0, ..config };
        let none = Pictures::load(&mut random, &none).unwrap();
        assert!(none.crop(&mut random, 1.0).is_none());
    }

    #[test]
    fn panoramas_are_seen_by_a_camera_within() {
        // Red encodes the column.
        let image = Image::from_fn(512, 256, |x, _| [(x / 2) as u8, 0, 0]);
        let mut random = lo_random::stream(2, "crop", 0);
        for _ in 0..10 {
            let view = perspective_view(&mut random, &image, 64, 48);
            let (left, right) = (i32::from(view[(0, 24)][0]), i32::from(view[(63, 24)][0]));
            // 45 to 80 of 360 degrees, over 256 codes.
            assert!((30..60).contains(&(right - left).rem_euclid(256)), "{left} {right}");
        }
    }

    #[test]
    fn folders_without_pictures_are_named() {
        let empty = tempfile::tempdir().unwrap();
        let load = |folder: &Path| {
            let config =
                SynthConfig { picture_folders: vec![folder.to_owned()], picture_share: 0.5, ..SynthConfig::default() };
            Pictures::load(&mut lo_random::stream(1, "", 0), &config).unwrap_err().to_string()
        };
        assert!(load(empty.path()).contains("no image"));
        assert!(load(&empty.path().join("missing")).contains("missing"));
    }
}
