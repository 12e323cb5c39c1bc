//! NumPy's `.npz`: a ZIP archive with one `.npy` file for each array.

use std::io::{Cursor, Read};

use zip::ZipArchive;

use crate::encoded_image::EncodedImage;
use crate::npy::{self, Header};
use crate::stored_depth::StoredDepth;
use crate::{Format, ImageError};

/// Names of depth arrays as programs write them, the preferred first.
const DEPTH_NAMES: [&str; 8] =
    ["depth_m", "depth", "metric_depth", "depth_map", "pred_depth", "depth_pred", "pred", "z"];

/// Names of arrays of inverse depth.
const INVERSE_NAMES: [&str; 5] = ["inverse_depth", "inv_depth", "disparity", "disp", "depth_inverse"];

/// Name that NumPy gives to an array without name.
const UNNAMED: &str = "arr_0";

/// Most bytes that are read for an array's header.
const MAX_HEADER_BYTES: u64 = 1 << 16;

/// Most arrays of an archive that are examined.
const MAX_ARRAYS: usize = 64;

/// Which array of an archive is depth.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wanted {
    Depth,
    Inverse,
}

/// Decodes the depth array: the first with a known name, else the only one with the shape of a depth map.
pub(crate) fn decode(source: EncodedImage, wanted: Wanted) -> Result<StoredDepth, ImageError> {
    let mut archive = ZipArchive::new(Cursor::new(source.bytes)).map_err(|error| source.invalid(error))?;
    let mut arrays = Vec::new();
    for index in 0..archive.len().min(MAX_ARRAYS) {
        let mut entry = archive.by_index(index).map_err(|error| source.invalid(error))?;
        let name = entry.name().map_err(|error| source.invalid(error))?;
        let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else { continue };
        let mut head = Vec::new();
        entry.by_ref().take(MAX_HEADER_BYTES).read_to_end(&mut head).map_err(|error| source.invalid(error))?;
        // An array of another type than depth can have is listed without shape.
        let header = Header::parse(EncodedImage { bytes: &head, format: Format::Npy, ..source });
        arrays.push(Array { index, name, shape: header.map(|header| header.shape).unwrap_or_default() });
    }
    let Some(array) = choose(&arrays, wanted) else {
        let list: Vec<String> = arrays.iter().map(Array::description).collect();
        return Err(source.unsupported(if list.is_empty() {
            "the archive has no NumPy array".to_owned()
        } else {
            format!(
                "none of its arrays is known as depth: {}; name it `depth`, in metres and of shape (height, width)",
                list.join(", ")
            )
        }));
    };
    if let Some([height, width]) = npy::depth_sides(&array.shape) {
        source.check_size(width, height)?;
    }
    let pixels: u64 = array.shape.iter().product();
    let mut entry = archive.by_index(array.index).map_err(|error| source.invalid(error))?;
    let mut bytes = Vec::new();
    entry
        .by_ref()
        .take(MAX_HEADER_BYTES + 8 * pixels)
        .read_to_end(&mut bytes)
        .map_err(|error| source.invalid(error))?;
    let name = format!("{} (array {})", source.name, array.name);
    npy::decode(EncodedImage { bytes: &bytes, name: &name, format: Format::Npy })
}

/// An array of an archive.
struct Array {
    index: usize,
    name: String,
    /// Empty if the header cannot be read.
    shape: Vec<u64>,
}

impl Array {
    /// Whether the shape is that of an image, not of a single number, a row or a matrix of intrinsics.
    fn is_map(&self) -> bool {
        npy::depth_sides(&self.shape).is_some_and(|sides| sides.iter().all(|side| *side > 4))
    }

    fn description(&self) -> String {
        let name: String = self.name.chars().take(40).collect();
        format!("{name} {}", npy::shape_text(&self.shape))
    }
}

fn choose(arrays: &[Array], wanted: Wanted) -> Option<&Array> {
    let first: &[&str] = if wanted == Wanted::Inverse { &INVERSE_NAMES } else { &[] };
    let names = first.iter().chain(&DEPTH_NAMES).chain([&UNNAMED]);
    let named = |name: &str| {
        arrays.iter().find(|array| array.name.eq_ignore_ascii_case(name) && npy::depth_sides(&array.shape).is_some())
    };
    names.copied().find_map(named).or_else(|| {
        let mut maps = arrays.iter().filter(|array| array.is_map());
        let only = maps.next()?;
        let is_inverse = INVERSE_NAMES.iter().any(|name| only.name.eq_ignore_ascii_case(name));
        (maps.next().is_none() && (wanted == Wanted::Inverse || !is_inverse)).then_some(only)
    })
}
