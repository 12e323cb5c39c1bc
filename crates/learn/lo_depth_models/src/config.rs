//! What a user says of a model that is not known: a TOML file.

use std::path::Path;

use serde::{Deserialize, Serialize};

use crate::ModelError;
use crate::onnx::{Dim, Element, Graph};

/// Longest config that is read.
const MAX_CONFIG_BYTES: u64 = 1 << 16;

/// Most pixels that a model is given.
const MAX_PIXELS: usize = 1 << 22;

/// What a model takes and gives, as far as its file does not say it. What is left out is as its family has it, or as stated here.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ModelConfig {
    /// What people call the model.
    pub name: Option<String>,
    /// What the output is.
    pub kind: Option<Kind>,
    /// Name of the input that takes the photo. Where it is left out: the only input of four axes.
    pub input: Option<String>,
    /// Order of the input's axes. `nchw` where it is left out.
    pub layout: Option<Layout>,
    /// Order of the channels, `rgb` or `bgr`. `rgb` where it is left out.
    pub channels: Option<Channels>,
    /// Value of white before mean and deviation: 1 or 255. 1 where it is left out.
    pub white: Option<f32>,
    /// What is subtracted of each channel. 0 where it is left out.
    pub mean: Option<[f32; 3]>,
    /// What each channel is divided by then. 1 where it is left out.
    pub deviation: Option<[f32; 3]>,
    /// What the photo is resized to. Needed where the file does not fix it.
    pub size: Option<SizeRule>,
    /// Name of the output with depth or points. Where it is left out: the only output.
    pub output: Option<String>,
    /// Name of the output with unit normals, in OpenCV's axes (+X right, +Y down, +Z forward).
    pub normals: Option<String>,
    /// Name of the output that is below one half where there is nothing to see.
    pub mask: Option<String>,
    /// Name of the output that points are multiplied by to be metres.
    pub scale: Option<String>,
    /// How depth depends on the lens. `none` where it is left out.
    pub focal: Option<Focal>,
    /// Further inputs that take one integer.
    #[serde(default)]
    pub integers: std::collections::BTreeMap<String, i64>,
}

/// What a model's output is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Metres along the optical axis.
    Metric,
    /// `1 / z` up to a factor and a summand.
    InverseAffine,
    /// `ln z` up to a summand.
    Log,
    /// Points in OpenCV's axes up to a factor and a shift in depth; metres where an output gives the factor.
    Points,
}

/// Order of a picture's axes: number of pictures, channels, height, width.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// Channels first.
    Nchw,
    /// Channels last.
    Nhwc,
}

impl Layout {
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

/// What a photo is resized to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "rule", deny_unknown_fields, rename_all = "kebab-case")]
pub enum SizeRule {
    /// Always this size; the photo is stretched.
    Fixed {
        /// In pixels.
        width: usize,
        /// In pixels.
        height: usize,
    },
    /// This shorter side, both sides rounded to a multiple.
    ShorterSide {
        /// In pixels.
        #[serde(rename = "pixels")]
        shorter_side: usize,
        /// Both sides are a multiple of this many pixels.
        #[serde(default = "one")]
        multiple: usize,
    },
    /// At most this longer side, both sides rounded to a multiple; photos are not made larger.
    LongerSide {
        /// In pixels.
        #[serde(rename = "pixels")]
        longer_side: usize,
        /// Both sides are a multiple of this many pixels.
        #[serde(default = "one")]
        multiple: usize,
    },
    /// As large as it fits into this size, in its middle, the rest filled with the mean.
    Letterbox {
        /// In pixels.
        width: usize,
        /// In pixels.
        height: usize,
    },
    /// As Depth Anything V2's publisher does it: the shorter side 518, both sides multiples of 14.
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
                // A panorama's longer side is limited by the pixels that it makes.
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
                "a size of {width} × {height} pixels in steps of {multiple} is impossible: sides lie between 8 and 4096, the product below {MAX_PIXELS}"
            )
        };
        if right { Ok(()) } else { Err(ModelError::Config(why())) }
    }
}

/// How metric depth depends on the lens.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "rule", deny_unknown_fields, rename_all = "kebab-case")]
pub enum Focal {
    /// Not at all, or the model sees to it.
    None,
    /// Depth is that of a camera of this focal length: metres are depth times the photo's focal length, in pixels of what the model is given, over this.
    Canonical {
        /// In pixels.
        pixels: f64,
    },
}

impl ModelConfig {
    /// Reads a config.
    ///
    /// # Errors
    /// A file that cannot be read or is no such config, naming the line.
    pub fn read(path: &Path) -> Result<Self, ModelError> {
        let named = |source| ModelError::Read { path: path.display().to_string(), source };
        if std::fs::metadata(path).map_err(named)?.len() > MAX_CONFIG_BYTES {
            return Err(ModelError::Config(format!("{} is longer than {MAX_CONFIG_BYTES} bytes", path.display())));
        }
        Self::parse(&std::fs::read_to_string(path).map_err(named)?)
    }

    /// Reads the text of a config.
    ///
    /// # Errors
    /// Text that is no such config, naming the line.
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
            return Err(ModelError::Config("mean, deviation and white must be numbers, the latter two above 0".into()));
        }
        if matches!(config.focal, Some(Focal::Canonical { pixels }) if !(pixels.is_finite() && pixels > 0.0)) {
            return Err(ModelError::Config("the canonical focal length must be above 0".into()));
        }
        if let Some(size) = config.size {
            size.check()?;
        }
        Ok(config)
    }

    /// A config to fill in, with the names of a graph's inputs and outputs.
    pub(crate) fn template(graph: &Graph) -> String {
        let quoted = |name: &str| toml::Value::String(name.to_owned()).to_string();
        let picture = graph.inputs.iter().find(|info| info.dims.as_ref().is_some_and(|dims| dims.len() == 4));
        let input = picture.or(graph.inputs.first()).map_or_else(|| quoted("input"), |info| quoted(&info.name));
        let layout = match picture.and_then(|info| info.dims.as_ref()) {
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
             \x20      # or {{ rule = \"fixed\", width = 518, height = 518 }}, the same with letterbox; longer-side as shorter-side\n\
             output = {output}\n\
             focal = {{ rule = \"none\" }}   # or {{ rule = \"canonical\", pixels = 1000 }}\n{integers}"
        )
    }
}
