//! Depth maps: decoding of each format, units, and validity of readings.

use std::io::{self, Cursor, Write};

use image::DynamicImage;
use tiff::decoder::{Decoder, DecodingResult, Limits};

use crate::encoded_image::{EncodedImage, MAX_PIXELS};
use crate::npz::Wanted;
use crate::pfm::Pfm;
use crate::stored_depth::StoredDepth;
use crate::{DepthMap, Format, Image, ImageError, exr_read, npy, npz, pfm, raster_decoder};

/// Depth from which a value is a renderer's background and not a reading (Blender writes 1e10).
const FARTHEST_M: f64 = 1e5;

/// Default scale of integer files: millimetres.
const INTEGER_UNITS_PER_METRE: f64 = 1000.0;

/// A depth map with what is known of its numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthFile {
    /// Depth in metres; 0 means no reading.
    pub depth_m: DepthMap,
    /// Stored units per metre that were assumed or given.
    pub units_per_metre: f64,
    /// Whether the stored values span a whole range, of 8 or 16 bits or from 0 to 1, as normalised depth does.
    pub spans_range: bool,
}

pub(crate) fn decode(source: EncodedImage, units_per_metre: Option<f64>) -> Result<DepthFile, ImageError> {
    if let Some(scale) = units_per_metre.filter(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(source.invalid(format!("the depth scale must be positive and finite, got {scale} units per metre")));
    }
    let StoredDepth { mut values, integers } = stored(source, Wanted::Depth)?;
    let units = units_per_metre.unwrap_or(if integers { INTEGER_UNITS_PER_METRE } else { 1.0 });
    let spans_range = spans_range(values.pixels(), integers);
    let (mut positive, mut negative) = (false, false);
    for value in values.pixels_mut() {
        let depth_m = f64::from(*value) / units;
        let reading = depth_m > 0.0 && depth_m < FARTHEST_M;
        positive |= reading;
        negative |= depth_m < 0.0 && depth_m.is_finite();
        *value = if reading { depth_m as f32 } else { 0.0 };
    }
    if negative && !positive {
        return Err(source.invalid("all depths are negative; depth must increase away from the camera"));
    }
    Ok(DepthFile { depth_m: values, units_per_metre: units, spans_range })
}

fn spans_range(values: &[f32], integers: bool) -> bool {
    let (least, most) = values.iter().fold((f32::MAX, f32::MIN), |(a, b), &v| (a.min(v), b.max(v)));
    let ends: &[f32] = if integers { &[255.0, 65535.0] } else { &[1.0, 255.0, 65535.0] };
    least == 0.0 && ends.contains(&most)
}

/// Decodes inverse depth as stored: any unit, any offset, larger is nearer. Values that are NaN or infinite are `NaN`.
pub(crate) fn decode_inverse(source: EncodedImage) -> Result<Image<f32>, ImageError> {
    let values = match source.format {
        Format::Png | Format::Pnm => decode_grey(source)?,
        _ => stored(source, Wanted::Inverse)?.values,
    };
    Ok(values.map(|value| if value.is_finite() { *value } else { f32::NAN }))
}

/// Decodes the values of a depth map as stored.
fn stored(source: EncodedImage, wanted: Wanted) -> Result<StoredDepth, ImageError> {
    let float = |values| StoredDepth { values, integers: false };
    Ok(match source.format {
        Format::Exr => float(exr_read::decode_depth(source)?),
        Format::Pfm => match pfm::decode(source)? {
            Pfm::Grey(depth) => float(depth),
            Pfm::Color(image) => float(image.map(|rgb| rgb[0])),
        },
        Format::Npy => npy::decode(source)?,
        Format::Npz => npz::decode(source, wanted)?,
        Format::Tiff => decode_tiff(source)?,
        Format::Png | Format::Pnm => StoredDepth { values: decode_integers(source)?, integers: true },
        _ => return Err(source.unsupported("depth must be a 16-bit PNG or PGM, an EXR, PFM, TIFF, NPY or NPZ file")),
    })
}

/// Decodes grey of 8 or 16 bits. A colour file is accepted if it is grey, as many programs write it.
fn decode_grey(source: EncodedImage) -> Result<Image<f32>, ImageError> {
    let decoded = raster_decoder::samples(source)?;
    let (width, height) = (decoded.width() as usize, decoded.height() as usize);
    let values: Vec<f32> = match decoded {
        DynamicImage::ImageLuma16(grey) => grey.into_raw().into_iter().map(f32::from).collect(),
        DynamicImage::ImageLuma8(grey) => grey.into_raw().into_iter().map(f32::from).collect(),
        other => {
            let rgb = other.into_rgb8();
            if rgb.pixels().any(|pixel| pixel.0 != [pixel.0[0]; 3]) {
                return Err(source.unsupported("it is a colour image; inverse depth needs one channel"));
            }
            rgb.pixels().map(|pixel| f32::from(pixel.0[0])).collect()
        }
    };
    Ok(Image::new(width, height, values))
}

fn decode_integers(source: EncodedImage) -> Result<DepthMap, ImageError> {
    let samples = match raster_decoder::samples(source)? {
        DynamicImage::ImageLuma16(grey) => grey,
        other => {
            return Err(source.unsupported(format!("{:?} pixels; depth needs one channel of 16 bits", other.color())));
        }
    };
    let (width, height) = (samples.width() as usize, samples.height() as usize);
    Ok(Image::new(width, height, samples.into_raw().into_iter().map(f32::from).collect()))
}

fn decode_tiff(source: EncodedImage) -> Result<StoredDepth, ImageError> {
    let invalid = |e: tiff::TiffError| source.invalid(e);
    let mut decoder = Decoder::new(Cursor::new(source.bytes)).map_err(invalid)?;
    let (width, height) = decoder.dimensions().map_err(invalid)?;
    source.check_size(width.into(), height.into())?;
    let color = decoder.colortype().map_err(invalid)?;
    let single = matches!(color, tiff::ColorType::Gray(_));
    if !single {
        return Err(source.unsupported(format!("{color:?} pixels; depth needs one channel")));
    }
    let mut limits = Limits::default();
    limits.decoding_buffer_size = 8 * MAX_PIXELS as usize;
    limits.intermediate_buffer_size = limits.decoding_buffer_size;
    decoder = decoder.with_limits(limits);
    let (values, integers): (Vec<f32>, bool) = match decoder.read_image().map_err(invalid)? {
        DecodingResult::F16(v) => (v.into_iter().map(|v| v.to_f32()).collect(), false),
        DecodingResult::F32(v) => (v, false),
        DecodingResult::F64(v) => (v.into_iter().map(|v| v as f32).collect(), false),
        DecodingResult::U16(v) => (v.into_iter().map(f32::from).collect(), true),
        DecodingResult::I16(v) => (v.into_iter().map(f32::from).collect(), true),
        DecodingResult::U32(v) => (v.into_iter().map(|v| v as f32).collect(), true),
        _ => {
            return Err(
                source.unsupported("depth needs samples of 16 or 32 bits (integer), or 16, 32 or 64 bits (float)")
            );
        }
    };
    if values.len() != width as usize * height as usize {
        return Err(source.invalid(format!("it has {} pixels instead of {width} × {height}", values.len())));
    }
    Ok(StoredDepth { values: Image::new(width as usize, height as usize, values), integers })
}

/// Converts depth to 16-bit millimetres; depths beyond 65.535 m become 0, no reading.
pub(crate) fn millimetres(depth: &DepthMap) -> Vec<u16> {
    let to_millimetres = |&depth_m: &f32| {
        let value = (f64::from(depth_m) * INTEGER_UNITS_PER_METRE).round();
        if value > 65535.0 { 0 } else { value as u16 }
    };
    depth.pixels().iter().map(to_millimetres).collect()
}

/// Writes depth as NPY, as [`decode`] reads it.
pub(crate) fn encode_npy(depth: &DepthMap, out: &mut impl Write) -> io::Result<()> {
    npy::encode(depth, out)
}
