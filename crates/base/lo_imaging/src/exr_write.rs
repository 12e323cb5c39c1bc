use std::io::{self, Seek, Write};

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

/// Encodes scan lines with ZIP compression and Rec. 709 `chromaticities`.
pub(crate) fn encode(
    (width, height): (usize, usize),
    groups: &[ChannelGroup],
    options: &ExrOptions,
    out: &mut (impl Write + Seek),
) -> io::Result<()> {
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
    ExrImage::new(attributes, layer).write().non_parallel().to_buffered(out).map_err(|error| match error {
        exr::error::Error::Io(error) => error,
        error => bad(error.to_string()),
    })
}
