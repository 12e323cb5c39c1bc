//! Depth maps: decoding of each format, units, and validity of readings.

use std::io::{self, Cursor, Write};

use image::DynamicImage;
use tiff::decoder::{Decoder, DecodingResult, Limits};

use crate::encoded_image::{EncodedImage, MAX_PIXELS};
use crate::pfm::Pfm;
use crate::stored_depth::StoredDepth;
use crate::{DepthMap, Format, Image, ImageError, exr_read, npy, pfm, raster_decoder};

/// Depth from which a value is a renderer's background and not a reading (Blender writes 1e10).
const FARTHEST_M: f64 = 1e5;

/// Default scale of integer files: millimetres.
const INTEGER_UNITS_PER_METRE: f64 = 1000.0;

pub(crate) fn decode(source: EncodedImage, units_per_metre: Option<f64>) -> Result<DepthMap, ImageError> {
    if let Some(scale) = units_per_metre.filter(|s| !(s.is_finite() && *s > 0.0)) {
        return Err(source.invalid(format!("the depth scale must be positive and finite, got {scale} units per metre")));
    }
    let float = |values| StoredDepth { values, integers: false };
    let StoredDepth { mut values, integers } = match source.format {
        Format::Exr => float(exr_read::decode_depth(source)?),
        Format::Pfm => match pfm::decode(source)? {
            Pfm::Grey(depth) => float(depth),
            Pfm::Color(image) => float(image.map(|rgb| rgb[0])),
        },
        Format::Npy => npy::decode(source)?,
        Format::Tiff => decode_tiff(source)?,
        Format::Png | Format::Pnm => StoredDepth { values: decode_integers(source)?, integers: true },
        _ => return Err(source.unsupported("depth must be a 16-bit PNG or PGM, an EXR, PFM, TIFF or NPY file")),
    };
    let units = units_per_metre.unwrap_or(if integers { INTEGER_UNITS_PER_METRE } else { 1.0 });
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
    Ok(values)
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
