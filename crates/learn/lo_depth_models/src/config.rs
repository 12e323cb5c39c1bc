//! Description of an unknown model by the user: a TOML file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::ModelError;
use crate::onnx::{Dim, Element, Graph};

/// Largest config file.
const MAX_CONFIG_BYTES: u64 = 1 << 16;

/// Largest number of pixels of a model's input.
const MAX_PIXELS: usize = 1 << 22;

/// Description of a model's inputs and outputs where its file does not define them.
///
/// Missing fields have the value of the model's family, or the default stated here.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ModelConfig {
    /// Display name of the model.
    pub name: Option<String>,
    /// Meaning of the output.
    pub kind: Option<OutputKind>,
    /// Name of the input for the photo. Default: the only input with four axes.
    pub input: Option<String>,
    /// Order of the input's axes. Default: `nchw`.
    pub layout: Option<AxisOrder>,
    /// Order of the channels, `rgb` or `bgr`. Default: `rgb`.
    pub channels: Option<Channels>,
    /// Value of white before mean and deviation are applied: 1 or 255. Default: 1.
    pub white: Option<f32>,
    /// Mean of each channel, subtracted first. Default: 0.
    pub mean: Option<[f32; 3]>,
    /// Standard deviation of each channel, a divisor. Default: 1.
    pub deviation: Option<[f32; 3]>,
    /// Size to which the photo is resized. Required unless the file fixes it.
    pub size: Option<SizeRule>,
    /// Name of the output with depth or points. Default: the only output.
    pub output: Option<String>,
    /// Name of the output with unit normals, in OpenCV's axes (+X right, +Y down, +Z forward).
    pub normals: Option<String>,
    /// Name of the output with a mask; below one half there is no reading.
    pub mask: Option<String>,
    /// Name of the output with the factor from points to metres.
    pub scale: Option<String>,
    /// Dependence of depth on the focal length. Default: `none`.
    pub focal: Option<Focal>,
    /// Values of further inputs, each one integer.
    #[serde(default)]
    pub integers: std::collections::BTreeMap<String, i64>,
}

/// Meaning of a model's output.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OutputKind {
    /// Metres along the optical axis.
    Metric,
    /// `1 / z` up to scale and shift.
    InverseAffine,
    /// `ln z` up to an offset.
    Log,
    /// Points in OpenCV's axes up to scale and a shift in depth; metres if an output gives the scale.
    Points,
}

/// Order of an image tensor's axes: batch (N), channels (C), height (H), width (W).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AxisOrder {
    /// Channels first.
    Nchw,
    /// Channels last.
    Nhwc,
}

impl AxisOrder {
    /// Axes of channels, height and width.
    pub(crate) const fn axes(self) -> [usize; 3] {
        match self {
            Self::Nchw => [1, 2, 3],
            Self::Nhwc => [3, 1, 2],
        }
    }
}

/// Order of the channels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Channels {
    /// Red first.
    Rgb,
    /// Blue first.
    Bgr,
}

/// Rule for the size to which a photo is resized.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "rule", deny_unknown_fields, rename_all = "kebab-case")]
pub enum SizeRule {
    /// This size; the photo is stretched.
    Fixed {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// A given shorter side, both sides rounded to a multiple.
    ShorterSide {
        /// Shorter side in pixels.
        #[serde(rename = "pixels")]
        shorter_side: usize,
        /// Factor of both sides in pixels.
        #[serde(default = "one")]
        multiple: usize,
    },
    /// A maximum for the longer side, both sides rounded to a multiple. Photos are not enlarged.
    LongerSide {
        /// Longer side in pixels.
        #[serde(rename = "pixels")]
        longer_side: usize,
        /// Factor of both sides in pixels.
        #[serde(default = "one")]
        multiple: usize,
    },
    /// This size; the photo keeps its aspect ratio and is centred, the rest is filled with the mean.
    Letterbox {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The rule of Depth Anything V2's publisher: shorter side 518, both sides multiples of 14.
    DepthAnything,
}

const fn one() -> usize {
    1
}

impl SizeRule {
    /// Width and height for a photo of `photo` pixels.
    pub(crate) fn size(self, photo: (usize, usize)) -> (usize, usize) {
        let scaled = |scale: f64, multiple: usize| {
            let side = |pixels: usize| ((pixels as f64 * scale / multiple as f64).round() as usize).max(1) * multiple;
            (side(photo.0), side(photo.1))
        };
        match self {
            Self::Fixed { width, height } | Self::Letterbox { width, height } => (width, height),
            Self::ShorterSide { shorter_side, multiple } => {
                // The number of pixels limits very wide photos.
                let scale = shorter_side as f64 / photo.0.min(photo.1) as f64;
                let most = (2.0 * (shorter_side * shorter_side) as f64 / (photo.0 as f64 * photo.1 as f64)).sqrt();
                scaled(scale.min(most), multiple)
            }
            Self::LongerSide { longer_side, multiple } => {
                scaled((longer_side as f64 / photo.0.max(photo.1) as f64).min(1.0), multiple)
            }
            Self::DepthAnything => crate::depth_anything::input_size(photo),
        }
    }

    pub(crate) fn check(self) -> Result<(), ModelError> {
        let (width, height, multiple) = match self {
            Self::Fixed { width, height } | Self::Letterbox { width, height } => (width, height, 1),
            Self::ShorterSide { shorter_side, multiple } | Self::LongerSide { longer_side: shorter_side, multiple } => {
                (shorter_side, shorter_side, multiple)
            }
            Self::DepthAnything => return Ok(()),
        };
        let sides = 8..=4096;
        let right = sides.contains(&width)
            && sides.contains(&height)
            && width * height <= MAX_PIXELS
            && (1..=512).contains(&multiple);
        let why = || {
            format!(
                "invalid size of {width} × {height} pixels in steps of {multiple}: \
                 sides must be 8 to 4096, at most {MAX_PIXELS} pixels in all"
            )
        };
        if right { Ok(()) } else { Err(ModelError::Config(why())) }
    }
}

/// Dependence of metric depth on the focal length.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "rule", deny_unknown_fields, rename_all = "kebab-case")]
pub enum Focal {
    /// None, or the model handles it.
    None,
    /// Depth of a canonical camera with this focal length. Metres are depth times the photo's focal length, in pixels
    /// of the model's input, divided by this.
    Canonical {
        /// Focal length in pixels.
        pixels: f64,
    },
}

impl ModelConfig {
    /// Reads a config file.
    ///
    /// # Errors
    /// A file that cannot be read, or is not a valid config; the message names the line.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let named = |source| ModelError::Read { path: path.display().to_string(), source };
        Self::parse(&lo_imaging::read_regular_text(path, MAX_CONFIG_BYTES).map_err(named)?)
    }

    /// Parses the text of a config.
    ///
    /// # Errors
    /// Text that is not a valid config; the message names the line.
    pub fn parse(text: &str) -> Result<Self, ModelError> {
        let config: Self =
            toml::from_str(text).map_err(|error| ModelError::Config(error.to_string().trim_end().to_owned()))?;
        let finite =
            |values: Option<[f32; 3]>| values.is_none_or(|values| values.iter().all(|value| value.is_finite()));
        let usable = finite(config.mean)
            && finite(config.deviation)
            && config.deviation.is_none_or(|values| values.iter().all(|value| *value > 0.0))
            && config.white.is_none_or(|white| white.is_finite() && white > 0.0);
        if !usable {
            return Err(ModelError::Config(
                "mean, deviation and white must be finite, deviation and white also positive".into(),
            ));
        }
        if matches!(config.focal, Some(Focal::Canonical { pixels }) if !(pixels.is_finite() && pixels > 0.0)) {
            return Err(ModelError::Config("the canonical focal length must be positive".into()));
        }
        if let Some(size) = config.size {
            size.check()?;
        }
        Ok(config)
    }

    /// A config to complete, with the names of a graph's inputs and outputs.
    pub(crate) fn template(graph: &Graph) -> String {
        let quoted = |name: &str| toml::Value::String(name.to_owned()).to_string();
        let image = graph.inputs.iter().find(|info| info.dims.as_ref().is_some_and(|dims| dims.len() == 4));
        let input = image.or(graph.inputs.first()).map_or_else(|| quoted("input"), |info| quoted(&info.name));
        let layout = match image.and_then(|info| info.dims.as_ref()) {
            Some(dims) if dims[3] == Dim::Fixed(3) => "nhwc",
            _ => "nchw",
        };
        let output = graph.outputs.first().map_or_else(|| quoted("output"), |info| quoted(&info.name));
        let integers: Vec<String> = graph
            .inputs
            .iter()
            .filter(|info| matches!(info.element, Element::I64 | Element::I32))
            .map(|info| format!("{} = 0", quoted(&info.name)))
            .collect();
        let integers = if integers.is_empty() {
            String::new()
        } else {
            format!("\n[integers]   # other inputs\n{}\n", integers.join("\n"))
        };
        format!(
            "kind = \"metric\"   # or inverse-affine, log, points\n\
             input = {input}\n\
             layout = \"{layout}\"\n\
             white = 1.0   # or 255, before mean and deviation\n\
             mean = [0.485, 0.456, 0.406]\n\
             deviation = [0.229, 0.224, 0.225]\n\
             size = {{ rule = \"shorter-side\", pixels = 518, multiple = 14 }}\n\
             \x20      # or {{ rule = \"fixed\", width = 518, height = 518 }}; letterbox as fixed, longer-side as shorter-side\n\
             output = {output}\n\
             focal = {{ rule = \"none\" }}   # or {{ rule = \"canonical\", pixels = 1000 }}\n{integers}"
        )
    }
}
