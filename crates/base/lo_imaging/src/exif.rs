use std::io::Cursor;

use exif::experimental::Writer;
use exif::{Context, Exif, Field, In, Tag, Value};

/// EXIF tags of the lens, from which a photo's field of view follows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FocalLength {
    /// Equivalent focal length for 35 mm film (tag 0xA405), in millimetres.
    pub equivalent_35mm: Option<f64>,
    /// Actual focal length (tag 0x920A), in millimetres.
    pub focal_mm: Option<f64>,
    /// Sensor pixels per millimetre (tags 0xA20E, 0xA210).
    pub focal_plane_per_mm: Option<f64>,
    /// Width and height of the image as written by the camera (tags 0xA002, 0xA003), in pixels, turned upright; the
    /// height is absent in some files.
    pub original_size: Option<(u32, Option<u32>)>,
    /// Ratio of the digital zoom (tag 0xA404), above 1.
    pub digital_zoom: Option<f64>,
    /// Whether `equivalent_35mm` includes the digital zoom, as iPhones write it.
    pub equivalent_includes_zoom: bool,
}

/// Largest ratio of the aspects of a photo and its original at which it is not cropped.
const SAME_ASPECT: f64 = 1.015;

/// Diagonal of the 36 mm × 24 mm frame; CIPA DCG-001 defines the 35 mm equivalent by the diagonal angle of view.
const FILM_DIAGONAL_MM: f64 = 43.266_615_305_567_87;

/// EXIF tags of a photo's exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PhotoExposure {
    /// Exposure time (tag 0x829A, else 0x9201), in seconds.
    pub time_s: Option<f64>,
    /// F-number of the aperture (tag 0x829D, else 0x9202).
    pub f_number: Option<f64>,
    /// ISO sensitivity (tag 0x8827).
    pub iso: Option<f64>,
}

/// Parses a raw EXIF block (a TIFF structure) up to the first damage.
fn parse(raw: &[u8]) -> Option<Exif> {
    let mut reader = exif::Reader::new();
    reader.continue_on_error(true);
    reader.read_raw(raw.to_vec()).or_else(|error| error.distill_partial_result(|_| ())).ok()
}

/// Tags of a TIFF's main directory that describe the photo, not how it is stored.
const DESCRIPTIVE: [Tag; 8] = [
    Tag::ImageDescription,
    Tag::Make,
    Tag::Model,
    Tag::Orientation,
    Tag::Software,
    Tag::DateTime,
    Tag::Artist,
    Tag::Copyright,
];

/// Returns the metadata of a TIFF file as an EXIF block; `None` if it has none.
pub(crate) fn of_tiff(bytes: &[u8]) -> Option<Vec<u8>> {
    let exif = parse(bytes)?;
    let is_kept = |field: &&Field| {
        let is_metadata = match field.tag.context() {
            Context::Tiff => DESCRIPTIVE.contains(&field.tag),
            // offsets in it are those of the file
            _ => field.tag != Tag::MakerNote,
        };
        field.ifd_num == In::PRIMARY && is_metadata
    };
    let fields: Vec<&Field> = exif.fields().filter(is_kept).collect();
    if fields.iter().all(|field| field.tag == Tag::Orientation) {
        return None;
    }
    let mut writer = Writer::new();
    fields.into_iter().for_each(|field| writer.push_field(field));
    let mut block = Cursor::new(Vec::new());
    writer.write(&mut block, false).ok()?;
    Some(block.into_inner())
}

/// Whether the colour space is Adobe RGB: the interoperability index R03 (EXIF 2.32, 4.6.8; DCF 2.0), or the value 2 of
/// the colour space that some cameras write.
pub(crate) fn is_adobe_rgb(raw: &[u8]) -> bool {
    parse(raw).is_some_and(|exif| {
        uint(&exif, Tag::ColorSpace) == Some(2)
            || match exif.get_field(Tag::InteroperabilityIndex, In::PRIMARY) {
                Some(field) => {
                    matches!(&field.value, Value::Ascii(text) if text.first().is_some_and(|t| t.starts_with(b"R03")))
                }
                None => false,
            }
    })
}

impl PhotoExposure {
    /// Reads the tags of a raw EXIF block. Damaged or missing tags are `None`.
    pub(crate) fn from_exif(raw: &[u8]) -> Self {
        let Some(exif) = parse(raw) else { return Self::default() };
        // APEX (EXIF 2.32, annex C): time = 2^-Tv, N = 2^(Av / 2)
        let time = || apex(&exif, Tag::ShutterSpeedValue).map(|tv| (-tv).exp2());
        let aperture = || apex(&exif, Tag::ApertureValue).map(|av| (0.5 * av).exp2());
        Self {
            time_s: number(&exif, Tag::ExposureTime).or_else(time),
            f_number: number(&exif, Tag::FNumber).or_else(aperture),
            iso: number(&exif, Tag::PhotographicSensitivity),
        }
    }
}

impl FocalLength {
    /// Reads the tags of a raw EXIF block (a TIFF structure). Damaged or missing tags are `None`.
    pub(crate) fn from_exif(raw: &[u8]) -> Self {
        let Some(exif) = parse(raw) else { return Self::default() };
        let per_mm = match uint(&exif, Tag::FocalPlaneResolutionUnit).unwrap_or(2) {
            3 => 10.0,
            4 => 1.0,
            5 => 1e-3,
            _ => 25.4,
        };
        let is_turned = uint(&exif, Tag::Orientation).is_some_and(|orientation| (5..=8).contains(&orientation));
        let original_size = match [Tag::PixelXDimension, Tag::PixelYDimension].map(|tag| uint(&exif, tag)) {
            [Some(width), Some(height)] if is_turned => Some((height, Some(width))),
            [Some(width), height] => Some((width, height)),
            [None, height] => height.map(|height| (height, None)),
        };
        Self {
            equivalent_35mm: number(&exif, Tag::FocalLengthIn35mmFilm),
            focal_mm: number(&exif, Tag::FocalLength),
            focal_plane_per_mm: number(&exif, Tag::FocalPlaneXResolution).map(|r| r / per_mm),
            original_size,
            digital_zoom: number(&exif, Tag::DigitalZoomRatio).filter(|zoom| *zoom > 1.0),
            equivalent_includes_zoom: is_made_by(&exif, "Apple"),
        }
    }

    /// Focal length in pixels of a photo of `width` × `height`, in either orientation, with square pixels.
    ///
    /// Computed from the focal plane resolution if the original size is known, else from the 35 mm equivalent. A photo
    /// of another aspect than the original is a crop of it, the largest that fits. `None` if neither is stated, or for
    /// an implausible lens (a horizontal angle outside 1° to 170°).
    pub fn focal_px(&self, width: u32, height: u32) -> Option<f64> {
        let original = self.original_px(width, height);
        let zoom = self.digital_zoom.unwrap_or(1.0);
        let plane = || {
            let scale = original?[0] / f64::from(self.long_side()?);
            Some(self.focal_mm? * self.focal_plane_per_mm? * scale * zoom)
        };
        let film = || {
            let [long, short] = original.unwrap_or([width, height].map(f64::from));
            let zoom = if self.equivalent_includes_zoom { 1.0 } else { zoom };
            Some(self.equivalent_35mm? / FILM_DIAGONAL_MM * long.hypot(short) * zoom)
        };
        let plausible = |focal: &f64| (1.0..=170.0).contains(&hfov_deg(*focal, f64::from(width)));
        plane().filter(plausible).or_else(|| film().filter(plausible))
    }

    /// Whether a photo of `width` × `height` is cropped from an original of another aspect.
    pub fn is_cropped(&self, width: u32, height: u32) -> bool {
        let Some((original_width, Some(original_height))) = self.original_size else { return false };
        let aspect = |a: u32, b: u32| f64::from(a.max(b)) / f64::from(a.min(b).max(1));
        let ratio = aspect(width, height) / aspect(original_width, original_height);
        ratio.max(ratio.recip()) > SAME_ASPECT
    }

    fn long_side(&self) -> Option<u32> {
        self.original_size.map(|(width, height)| width.max(height.unwrap_or(0)))
    }

    /// Longer and shorter side of the uncropped original, in pixels of a photo of `width` × `height`.
    fn original_px(&self, width: u32, height: u32) -> Option<[f64; 2]> {
        let [photo_width, photo_height] = [width, height].map(f64::from);
        let long = photo_width.max(photo_height);
        let Some((original_width, Some(original_height))) =
            self.original_size.filter(|_| self.is_cropped(width, height))
        else {
            return self.original_size.map(|_| [long, photo_width.min(photo_height)]);
        };
        let [original_width, original_height] = [original_width, original_height].map(f64::from);
        let scale = (photo_width / original_width).max(photo_height / original_height);
        Some([original_width.max(original_height) * scale, original_width.min(original_height) * scale])
    }

    /// Horizontal field of view in degrees of a photo of `width` × `height`; `None` as for [`FocalLength::focal_px`].
    pub fn hfov_deg(&self, width: u32, height: u32) -> Option<f64> {
        self.focal_px(width, height).map(|focal| hfov_deg(focal, f64::from(width)))
    }
}

fn hfov_deg(focal_px: f64, width: f64) -> f64 {
    2.0 * (0.5 * width / focal_px).atan().to_degrees()
}

/// Reads a positive number of the primary image; 0 means "unknown" in EXIF.
fn number(exif: &Exif, tag: Tag) -> Option<f64> {
    let value = match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::Rational(values) => values.first()?.to_f64(),
        value => f64::from(value.get_uint(0)?),
    };
    (value.is_finite() && value > 0.0).then_some(value)
}

/// Reads an APEX value in stops, which may be negative.
fn apex(exif: &Exif, tag: Tag) -> Option<f64> {
    let value = match &exif.get_field(tag, In::PRIMARY)?.value {
        Value::SRational(values) => values.first()?.to_f64(),
        Value::Rational(values) => values.first()?.to_f64(),
        _ => return None,
    };
    (value.is_finite() && value.abs() <= 40.0).then_some(value)
}

fn is_made_by(exif: &Exif, maker: &str) -> bool {
    match exif.get_field(Tag::Make, In::PRIMARY).map(|field| &field.value) {
        Some(Value::Ascii(texts)) => texts.iter().any(|text| text.starts_with(maker.as_bytes())),
        _ => false,
    }
}

fn uint(exif: &Exif, tag: Tag) -> Option<u32> {
    exif.get_field(tag, In::PRIMARY)?.value.get_uint(0).filter(|v| *v > 0)
}
