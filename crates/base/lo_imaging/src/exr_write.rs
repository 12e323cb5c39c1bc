use std::io::{self, Cursor};

use exr::image::write::WritableImage;
use exr::image::{AnyChannel, AnyChannels, Encoding, FlatSamples, Image as ExrImage, Layer};
use exr::math::Vec2;
use exr::meta::attribute::{AttributeValue, Chromaticities, EnvironmentMap, IntegerBounds, Text};
use exr::meta::header::{ImageAttributes, LayerAttributes};

use crate::chromaticity::REC709;
use crate::generator::{GENERATOR, printable};
use crate::{Image, RadianceImage};

/// Layout of an OpenEXR environment map (attribute `envmap`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EnvironmentLayout {
    /// Equirectangular.
    LatitudeLongitude,
    /// Cubemap: six faces stacked vertically.
    Cube,
}

/// Options and metadata of an OpenEXR file.
///
/// Other formats ignore them, except that Radiance HDR stores the generator.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrOptions {
    /// Name of the writing program; [`GENERATOR`] by default. Non-ASCII characters are replaced.
    pub generator: String,
    /// Stores 16-bit half instead of 32-bit float. Values are clamped to ±65504.
    pub half: bool,
    /// Luminance of (1, 1, 1) in cd/m², if known.
    pub white_luminance: Option<f32>,
    /// Layout, for environment maps.
    pub environment: Option<EnvironmentLayout>,
    /// Custom text attributes: names and values in Latin-1.
    pub metadata: Vec<(String, String)>,
}

impl Default for ExrOptions {
    fn default() -> Self {
        Self {
            generator: GENERATOR.to_owned(),
            half: false,
            white_luminance: None,
            environment: None,
            metadata: Vec::new(),
        }
    }
}

/// A layer of an OpenEXR file: channels `name.R` …, or plain `R` … if `name` is empty.
#[derive(Clone, Debug, PartialEq)]
pub struct ChannelGroup {
    /// Name of the layer.
    pub name: String,
    /// Channel names (`R`, `A`, `Z` …) and samples, row by row from the top.
    pub channels: Vec<(String, Vec<f32>)>,
}

impl ChannelGroup {
    /// Creates the channels `R G B` of an image.
    pub fn rgb(name: &str, image: &RadianceImage) -> Self {
        Self::planes(name, ["R", "G", "B"], image)
    }

    /// Creates the channels `R G B A` of an image.
    pub fn rgba(name: &str, image: &Image<[f32; 4]>) -> Self {
        Self::planes(name, ["R", "G", "B", "A"], image)
    }

    /// Creates a single channel.
    pub fn single(name: &str, channel: &str, image: &Image<f32>) -> Self {
        Self { name: name.to_owned(), channels: vec![(channel.to_owned(), image.pixels().to_vec())] }
    }

    fn planes<const N: usize>(name: &str, channels: [&str; N], image: &Image<[f32; N]>) -> Self {
        let plane = |slot: usize| image.pixels().iter().map(|pixel| pixel[slot]).collect();
        let channels = channels.iter().enumerate().map(|(slot, c)| ((*c).to_owned(), plane(slot))).collect();
        Self { name: name.to_owned(), channels }
    }
}

/// Standard attributes with a type of their own: a text attribute of the same name would make the file unreadable.
const RESERVED: [&str; 17] = [
    "channels",
    "chromaticities",
    "chunkCount",
    "compression",
    "dataWindow",
    "displayWindow",
    "envmap",
    "lineOrder",
    "name",
    "pixelAspectRatio",
    "screenWindowCenter",
    "screenWindowWidth",
    "software",
    "tiles",
    "type",
    "version",
    "whiteLuminance",
];

/// Encodes scan lines with ZIP compression and Rec. 709 `chromaticities`. The same input gives the same bytes.
pub(crate) fn encode(
    (width, height): (usize, usize),
    groups: &[ChannelGroup],
    options: &ExrOptions,
) -> io::Result<Vec<u8>> {
    let bad = |what: String| io::Error::new(io::ErrorKind::InvalidInput, what);
    let text = |s: &str| Text::new_or_none(s).ok_or_else(|| bad(format!("“{s}” has characters outside Latin-1")));
    let mut channels = Vec::new();
    for (group, (channel, samples)) in groups.iter().flat_map(|g| g.channels.iter().map(move |c| (g, c))) {
        if samples.len() != width * height {
            let (layer, count, needed) = (&group.name, samples.len(), width * height);
            return Err(bad(format!("channel {layer}.{channel} has {count} samples instead of {needed}")));
        }
        let name = if group.name.is_empty() { channel.clone() } else { format!("{}.{channel}", group.name) };
        let half = |v: &f32| half::f16::from_f32(if v.is_nan() { *v } else { v.clamp(-65504.0, 65504.0) });
        let samples = match options.half {
            true => FlatSamples::F16(samples.iter().map(half).collect()),
            false => FlatSamples::F32(samples.clone()),
        };
        channels.push(AnyChannel::new(text(&name)?, samples));
    }
    let xy = |[x, y]: [f64; 2]| Vec2(x as f32, y as f32);
    let [red, green, blue, white] = REC709.map(xy);
    let mut attributes = ImageAttributes::new(IntegerBounds::from_dimensions((width, height)));
    attributes.chromaticities = Some(Chromaticities { red, green, blue, white });

    let software_name = Some(text(&printable(&options.generator))?);
    let mut own =
        LayerAttributes { white_luminance: options.white_luminance, software_name, ..LayerAttributes::default() };
    own.environment_map = options.environment.map(|layout| match layout {
        EnvironmentLayout::LatitudeLongitude => EnvironmentMap::LatitudeLongitude,
        EnvironmentLayout::Cube => EnvironmentMap::Cube,
    });
    for (name, value) in &options.metadata {
        if RESERVED.contains(&name.as_str()) {
            return Err(bad(format!("the attribute name “{name}” is reserved by OpenEXR")));
        }
        own.other.insert(text(name)?, AttributeValue::Text(text(value)?));
    }
    let channels = AnyChannels::sort(channels.into_iter().collect());
    let layer = Layer::new((width, height), own, Encoding::SMALL_LOSSLESS, channels);
    let mut file = Cursor::new(Vec::new());
    ExrImage::new(attributes, layer).write().non_parallel().to_buffered(&mut file).map_err(|error| match error {
        exr::error::Error::Io(error) => error,
        error => bad(error.to_string()),
    })?;
    let mut file = file.into_inner();
    sort_attributes(&mut file);
    Ok(file)
}

/// Length of the magic number and the version, which precede the attributes.
const PREFIX: usize = 8;

/// Sorts the attributes of a file with one part by name, as the OpenEXR library writes them. The `exr` crate writes
/// those of no standard name in random order.
///
/// An attribute is a name and a type, both terminated by 0, the size of the value in 4 bytes, and the value. An empty
/// name ends the list. The size of the list does not change, so all offsets of the file remain valid.
fn sort_attributes(file: &mut [u8]) {
    let mut attributes: Vec<&[u8]> = Vec::new();
    let mut rest = &file[PREFIX..];
    while let Some(size) = attribute_size(rest) {
        let (attribute, after) = rest.split_at(size);
        attributes.push(attribute);
        rest = after;
    }
    attributes.sort_by_key(|attribute| attribute.split(|&byte| byte == 0).next());
    let sorted = attributes.concat();
    file[PREFIX..PREFIX + sorted.len()].copy_from_slice(&sorted);
}

/// Returns the length of the attribute that `bytes` begin with, or `None` at the end of the list.
fn attribute_size(bytes: &[u8]) -> Option<usize> {
    let name = bytes.iter().position(|&byte| byte == 0).filter(|&length| length > 0)?;
    let kind = bytes[name + 1..].iter().position(|&byte| byte == 0)?;
    let value = name + 1 + kind + 1;
    let size = u32::from_le_bytes(bytes.get(value..value + 4)?.try_into().ok()?);
    Some(value + 4 + size as usize).filter(|&end| end <= bytes.len())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn the_same_metadata_gives_the_same_bytes() {
        let names = ["source", "camera", "light", "version-2", "at", "orientation"];
        let metadata: Vec<_> = names.iter().map(|name| ((*name).to_owned(), format!("value of {name}"))).collect();
        let options = ExrOptions { metadata, environment: Some(EnvironmentLayout::Cube), ..ExrOptions::default() };
        let write = || {
            encode((3, 2), &[ChannelGroup::rgb("", &Image::new(3, 2, vec![[0.25, 0.5, 4.0]; 6]))], &options).unwrap()
        };
        let file = write();
        // Each map of the `exr` crate has its own random order: 6! of them.
        (0..8).for_each(|_| assert!(write() == file));

        let mut rest = &file[PREFIX..];
        let mut written = Vec::new();
        while let Some(size) = attribute_size(rest) {
            written.push(String::from_utf8(rest.split(|&byte| byte == 0).next().unwrap().to_vec()).unwrap());
            rest = &rest[size..];
        }
        assert!(written.is_sorted(), "{written:?}");
        assert!(names.iter().all(|name| written.iter().any(|other| other == name)), "{written:?}");
        assert_eq!(rest[0], 0, "the end of the list");
    }
}
