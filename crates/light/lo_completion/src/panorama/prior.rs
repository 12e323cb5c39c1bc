//! A panorama as given by the user.

use std::io::Read;
use std::ops::RangeInclusive;
use std::path::Path;

use lo_geometry::{MAX_COORDINATE_M, Orientation, Vec3, is_position};
use lo_imaging::{
    EncodedPhoto, Format, Image, ImageError, PartialPanorama, Photo, PhotoFile, PhotoNote, RadianceImage, reorient,
};

use super::PanoramaWarning;

/// Least number of rows of a panorama.
const MIN_HEIGHT: usize = 16;

/// Clipping level, of 255, of a channel of an 8-bit panorama: the same as for photos.
const CLIP_LEVEL: u8 = 250;

/// The clipping level in linear light.
const CLIP_LEVEL_LINEAR: f32 = 0.956;

/// Largest value of a panorama: 600 times the sun's luminance in cd/m².
const MAX_VALUE: f32 = 1e12;

/// Valid exposures, within ± 40 stops.
const EXPOSURES: RangeInclusive<f32> = 1.0 / (1u64 << 40) as f32..=(1u64 << 40) as f32;

/// Valid yaws: ten turns in either direction.
const YAWS_RAD: RangeInclusive<f32> = -63.0..=63.0;

/// A panorama of the room, to be [applied](crate::apply_panorama) to surfaces that the photo does not show.
#[derive(Clone, Debug, PartialEq)]
pub struct PanoramaPrior {
    radiance: RadianceImage,
    clipped: Option<Image<bool>>,
    /// Pixels that the panorama shows; `None` for all.
    covered: Option<Image<bool>>,
    cleaned: usize,
    /// Position at which it was taken, in metres in the photo's frame (+X right, +Y up, the camera at the origin looks
    /// along −Z).
    pub position_m: Vec3,
    /// Angle in radians from the photo's heading to the panorama's centre, to the right, about the room's vertical. If
    /// given, only a small tilt and the exposure are searched.
    pub yaw_rad: Option<f32>,
    /// Factor from the panorama's values to the photo's. Estimated if not given.
    pub exposure: Option<f32>,
    /// File name, stored in the scene.
    pub file: String,
}

/// Reasons why an image is not a panorama of a room.
#[derive(Debug, thiserror::Error)]
pub enum PanoramaError {
    /// The file cannot be read.
    #[error(transparent)]
    Image(#[from] ImageError),
    /// The image is not twice as wide as high.
    #[error("it is {width} × {height} pixels; an equirectangular panorama is twice as wide as high")]
    Shape {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The image has too few pixels.
    #[error("it is {width} × {height} pixels; a panorama of a room needs at least {} × {MIN_HEIGHT}", 2 * MIN_HEIGHT)]
    Small {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The metadata of a part of the sphere cannot be used.
    #[error("its GPano metadata cannot be used: {0}")]
    Metadata(&'static str),
    /// The image is black.
    #[error("it is black or has no finite values")]
    Black,
    /// The radiance is too large.
    #[error("its largest value is {largest:e}; at most {MAX_VALUE:e} is accepted")]
    Radiance {
        /// Largest finite value.
        largest: f32,
    },
    /// The position is far from the room.
    #[error("its position must be within ± {MAX_COORDINATE_M} m, got {0}")]
    Position(Vec3),
    /// The exposure is out of range.
    #[error("its exposure must be within ± 40 stops, a factor from 9.1e-13 to 1.1e12; got {0}")]
    Exposure(f32),
    /// The yaw is out of range.
    #[error("its yaw must be within ± 63 rad, got {0}")]
    Yaw(f32),
}

impl PanoramaPrior {
    /// Creates a panorama of linear radiance in this `orientation`, taken at the camera.
    ///
    /// Values that are negative or not finite become 0 and are [counted](Self::warnings).
    ///
    /// # Errors
    /// An image that is not twice as wide as high, too small, black, or brighter than 10¹².
    pub fn new(radiance: RadianceImage, orientation: Orientation, file: &str) -> Result<Self, PanoramaError> {
        Self::with_clipped(radiance, None, orientation, file)
    }

    /// Creates a panorama like [`new`](Self::new), with a mask of clipped pixels, whose values are lower bounds.
    ///
    /// # Errors
    /// Those of [`new`](Self::new).
    ///
    /// # Panics
    /// If `clipped` differs in size from `radiance`.
    pub fn with_clipped(
        mut radiance: RadianceImage,
        clipped: Option<Image<bool>>,
        orientation: Orientation,
        file: &str,
    ) -> Result<Self, PanoramaError> {
        let (width, height) = (radiance.width(), radiance.height());
        if let Some(clipped) = &clipped {
            assert_eq!((clipped.width(), clipped.height()), (width, height), "clipped is a mask of the panorama");
        }
        if width != 2 * height {
            return Err(PanoramaError::Shape { width, height });
        }
        if height < MIN_HEIGHT {
            return Err(PanoramaError::Small { width, height });
        }
        let mut cleaned = 0;
        for pixel in radiance.pixels_mut() {
            if !pixel.iter().all(|c| c.is_finite() && *c >= 0.0) {
                *pixel = pixel.map(|c| if c.is_finite() { c.max(0.0) } else { 0.0 });
                cleaned += 1;
            }
        }
        let largest = radiance.pixels().as_flattened().iter().copied().fold(0.0, f32::max);
        if largest == 0.0 {
            return Err(PanoramaError::Black);
        }
        if largest > MAX_VALUE {
            return Err(PanoramaError::Radiance { largest });
        }
        // Masks are reoriented as radiance is: any mixture with a clipped pixel is clipped.
        let turn = |image: &RadianceImage| reorient(image, orientation, Orientation::Lightoctree);
        let clipped = clipped.map(|mask| turn(&shares(&mask)).map(|pixel| pixel[0] > 0.0));
        let radiance = turn(&radiance);
        let (position_m, file, covered) = (Vec3::ZERO, file.to_owned(), None);
        Ok(Self { radiance, clipped, covered, cleaned, position_m, yaw_rad: None, exposure: None, file })
    }

    /// Restricts the panorama to the pixels of a mask, which has the file's orientation. Others light nothing.
    fn restricted(self, covered: &Image<bool>, orientation: Orientation) -> Self {
        let missing = reorient(&shares(&covered.map(|covered| !covered)), orientation, Orientation::Lightoctree);
        Self { covered: Some(missing.map(|share| share[0] == 0.0)), ..self }
    }

    /// Reads a file. HDR, EXR and PFM are linear; everything else is sRGB, clipped where a channel is at 250 of 255 or
    /// more. A part of the sphere is placed by its GPano metadata, and the rest lights nothing.
    ///
    /// # Errors
    /// A file that cannot be read, and those of [`new`](Self::new).
    pub fn read(path: impl AsRef<Path>, orientation: Orientation) -> Result<Self, PanoramaError> {
        let path = path.as_ref();
        let photo = lo_imaging::read_photo(path)?;
        let file = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self::of_photo(photo, || holds_radiance(path), orientation, &file)
    }

    /// Reads a file as [`read`](Self::read) does, from memory; `file` is its name.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn from_bytes(bytes: &[u8], orientation: Orientation, file: &str) -> Result<Self, PanoramaError> {
        let photo = lo_imaging::photo_from_bytes(bytes, file)?;
        let format = Format::from_bytes(bytes).or_else(|| Format::from_extension(Path::new(file)));
        Self::of_photo(photo, || is_radiance(format), orientation, file)
    }

    fn of_photo(
        PhotoFile { photo, panorama, notes, .. }: PhotoFile,
        is_radiance: impl FnOnce() -> bool,
        orientation: Orientation,
        file: &str,
    ) -> Result<Self, PanoramaError> {
        for note in notes {
            if let PhotoNote::UnusablePanorama { reason } = note {
                return Err(PanoramaError::Metadata(reason));
            }
        }
        let clipped = match &photo {
            Photo::Encoded8(photo) if photo.encoding.gain_map.is_some() => None,
            Photo::Srgb8(image) | Photo::Encoded8(EncodedPhoto { image, .. }) => {
                Some(image.map(|pixel| pixel.iter().any(|&c| c >= CLIP_LEVEL)))
            }
            Photo::Linear(image) if !is_radiance() => {
                Some(image.map(|pixel| pixel.iter().any(|&c| c >= CLIP_LEVEL_LINEAR)))
            }
            Photo::Linear(_) => None,
        };
        let radiance = photo.into_radiance();
        let Some(place) = panorama.filter(|place| !place.is_full()) else {
            return Self::with_clipped(radiance, clipped, orientation, file);
        };
        let covered =
            placed(&Image::new(radiance.width(), radiance.height(), vec![true; radiance.pixels().len()]), place);
        let (radiance, clipped) = (placed(&radiance, place), clipped.map(|mask| placed(&mask, place)));
        Ok(Self::with_clipped(radiance, clipped, orientation, file)?.restricted(&covered, orientation))
    }

    /// Sets the position at which it was taken, in metres in the photo's frame.
    pub fn at(self, position_m: Vec3) -> Self {
        Self { position_m, ..self }
    }

    /// Returns linear radiance in the panorama's own units, centre −Z, +X to the right, +Y up.
    pub fn radiance(&self) -> &RadianceImage {
        &self.radiance
    }

    /// Returns the mask of pixels whose light is a lower bound; `None` if the panorama is not clipped.
    pub fn clipped(&self) -> Option<&Image<bool>> {
        self.clipped.as_ref()
    }

    /// Returns the mask of pixels that the panorama shows; `None` if it shows all directions.
    pub fn covered(&self) -> Option<&Image<bool>> {
        self.covered.as_ref()
    }

    /// Returns the warnings about the panorama itself.
    pub fn warnings(&self) -> Vec<PanoramaWarning> {
        let pixels = self.radiance.pixels().len();
        let cleaned = (self.cleaned > 0).then_some(PanoramaWarning::Values { cleaned: self.cleaned, pixels });
        let clipped = self.clipped.as_ref().map(|mask| PanoramaWarning::Clipped {
            clipped_share: mask.pixels().iter().filter(|&&clipped| clipped).count() as f32 / pixels as f32,
        });
        let partial = self.covered.as_ref().map(|mask| PanoramaWarning::Partial {
            covered_share: mask.pixels().iter().filter(|&&covered| covered).count() as f32 / pixels as f32,
        });
        [cleaned, clipped, partial].into_iter().flatten().collect()
    }

    /// Checks the ranges of position and overrides.
    ///
    /// # Errors
    /// The first invalid value.
    pub fn check(&self) -> Result<(), PanoramaError> {
        if !is_position(self.position_m) {
            return Err(PanoramaError::Position(self.position_m));
        }
        if let Some(exposure) = self.exposure.filter(|exposure| !EXPOSURES.contains(exposure)) {
            return Err(PanoramaError::Exposure(exposure));
        }
        if let Some(yaw) = self.yaw_rad.filter(|yaw| !YAWS_RAD.contains(yaw)) {
            return Err(PanoramaError::Yaw(yaw));
        }
        Ok(())
    }
}

/// Returns a mask as an image of shares, 1 where it is set, to be resampled like radiance.
pub(super) fn shares(mask: &Image<bool>) -> RadianceImage {
    mask.map(|&is_set| [f32::from(u8::from(is_set)); 3])
}

/// Places a part of a panorama on the full sphere, whose other pixels are 0. The part may have been resized.
fn placed<T: Copy + Default>(part: &Image<T>, place: PartialPanorama) -> Image<T> {
    let scale = part.width() as f64 / f64::from(place.size[0]);
    let height = ((f64::from(place.full[1]) * scale).round() as usize).max(1);
    let [left, top] = place.offset.map(|offset| (f64::from(offset) * scale).round() as usize);
    let inside = |at: usize, offset: usize, size: usize| at.checked_sub(offset).filter(|at| *at < size);
    Image::from_fn(2 * height, height, |x, y| {
        let at = inside(x, left, part.width()).zip(inside(y, top, part.height()));
        at.map_or_else(T::default, |at| part[at])
    })
}

/// Returns whether a file's format holds linear radiance; 16-bit images are decoded to that, but end at white.
fn holds_radiance(path: &Path) -> bool {
    let mut first = Vec::new();
    // The file was read a moment ago; if that is no longer possible, the extension decides.
    let read = std::fs::File::open(path).and_then(|file| file.take(16).read_to_end(&mut first));
    let by_content = read.ok().and_then(|_| Format::from_bytes(&first));
    is_radiance(by_content.or_else(|| Format::from_extension(path)))
}

fn is_radiance(format: Option<Format>) -> bool {
    matches!(format, Some(Format::Hdr | Format::Exr | Format::Pfm))
}
