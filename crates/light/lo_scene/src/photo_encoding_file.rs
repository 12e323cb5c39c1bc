//! Profile, gain map and metadata of the photo in scene files.

use lo_imaging::{ColorProfile, GainMap, GainMapParameters, Image, PhotoEncoding};
use safetensors::{Dtype, SafeTensors};
use serde::{Deserialize, Serialize};

use crate::SceneError;
use crate::document_tensors::{Tensor, layout, tensor};

/// Names of the tensors.
const PROFILE: &str = "photo_profile";
const EXIF: &str = "photo_exif";
const XMP: &str = "photo_xmp";
const GAIN_MAP: &str = "photo_gain_map";

/// States which tensors a file has.
#[derive(Serialize, Deserialize)]
pub(crate) struct EncodingHeader {
    #[serde(default)]
    profile: bool,
    #[serde(default)]
    exif: bool,
    #[serde(default)]
    xmp: bool,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gain_map: Option<GainMapParameters>,
}

/// Returns the header and the tensors of an encoding.
pub(crate) fn write(encoding: &PhotoEncoding) -> (EncodingHeader, Vec<(String, Tensor<'_>)>) {
    let PhotoEncoding { profile, gain_map, exif, xmp } = encoding;
    let icc = profile.as_ref().map_or(&[][..], ColorProfile::icc);
    let named = [(PROFILE, icc), (EXIF, exif), (XMP, xmp)].into_iter().filter(|(_, bytes)| !bytes.is_empty());
    let mut tensors: Vec<_> = named.map(|(name, bytes)| (name.to_owned(), Tensor::bytes(bytes))).collect();
    if let Some(map) = gain_map {
        tensors.push((GAIN_MAP.to_owned(), Tensor::srgb8(&map.image)));
    }
    let header = EncodingHeader {
        profile: !icc.is_empty(),
        exif: !exif.is_empty(),
        xmp: !xmp.is_empty(),
        gain_map: gain_map.as_ref().map(|map| map.parameters),
    };
    (header, tensors)
}

/// Reads an encoding.
pub(crate) fn read(tensors: &SafeTensors<'_>, header: &EncodingHeader) -> Result<PhotoEncoding, SceneError> {
    let bytes = |name: &'static str, present: bool| match present {
        false => Ok(&[][..]),
        true => match tensor(tensors, name)? {
            (Dtype::U8, shape, bytes) if shape.len() == 1 => Ok(bytes),
            (dtype, shape, _) => Err(layout(name, "U8 [bytes]", dtype, &shape)),
        },
    };
    let profile = match bytes(PROFILE, header.profile)? {
        [] => None,
        icc => Some(ColorProfile::from_icc(icc).ok_or_else(|| {
            SceneError::Metadata("the photo's colour profile is damaged or has no curves and primaries".to_owned())
        })?),
    };
    let gain_map = match header.gain_map {
        None => None,
        Some(parameters) if !parameters.is_valid() => {
            return Err(SceneError::Metadata("a parameter of the photo's gain map is out of range".to_owned()));
        }
        Some(parameters) => match tensor(tensors, GAIN_MAP)? {
            (Dtype::U8, shape, bytes) if shape.len() == 3 && shape[2] == 3 && !bytes.is_empty() => {
                Some(GainMap { image: Image::new(shape[1], shape[0], bytes.as_chunks().0.to_vec()), parameters })
            }
            (dtype, shape, _) => return Err(layout(GAIN_MAP, "U8 [height, width, 3]", dtype, &shape)),
        },
    };
    let (exif, xmp) = (bytes(EXIF, header.exif)?.to_vec(), bytes(XMP, header.xmp)?.to_vec());
    Ok(PhotoEncoding { profile, gain_map, exif, xmp })
}
