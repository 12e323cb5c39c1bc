//! A model's recipe: how to make its inputs and read its outputs.

use std::collections::HashSet;

use crate::config::{Channels, Focal, ModelConfig};
use crate::onnx::{Data, Dim, Element, Graph, Tensor};
use crate::{AxisOrder, ModelError, OutputKind, SizeRule, depth_anything, metric3d};

/// Number of tokens for MoGe-2: its exporter's default, of 1200 to 3600.
const MOGE_TOKENS: i64 = 1800;

/// Longer side of the photo for MoGe-2 in pixels. The network resizes it to its tokens and predicts points at this
/// size. Estimation works at 480.
const MOGE_LONGER_SIDE: usize = 720;

/// Number of nodes at either end of a graph that are inspected for its family.
const LOOKED_AT: usize = 100;

/// Inputs and outputs of a model.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Recipe {
    /// Display name of the family.
    pub family: String,
    pub input: String,
    pub layout: AxisOrder,
    /// Whether blue comes first.
    pub bgr: bool,
    /// Value of white before mean and deviation.
    pub white: f32,
    pub mean: [f32; 3],
    pub deviation: [f32; 3],
    /// Colour around the photo in a letterbox, 0 to 255; the mean if absent.
    pub padding: Option<[f32; 3]>,
    pub size: SizeRule,
    /// Further inputs, each one integer.
    pub integers: Vec<(String, i64)>,
    pub kind: OutputKind,
    /// Name of the output with depth or points.
    pub output: String,
    pub normals: Option<String>,
    /// Name of the output with the concentration κ of the normals.
    pub normals_kappa: Option<String>,
    pub mask: Option<String>,
    /// Name of the output with the factor from points to metres.
    pub scale: Option<String>,
    /// Focal length of the canonical camera in pixels, if depth depends on the focal length.
    pub canonical_focal_px: Option<f64>,
}

impl Recipe {
    /// Determines the recipe of a simplified graph from its family and from a config.
    ///
    /// # Errors
    /// An unknown model without a config, or a config that does not match the graph.
    pub fn of(graph: &Graph, config: Option<&ModelConfig>, file_name: &str) -> Result<Self, ModelError> {
        let known = known(graph, file_name);
        let recipe = match (known, config) {
            (Some(recipe), None) => recipe,
            (known, Some(config)) => Self::configured(known, config, graph)?,
            (None, None) => {
                return Err(ModelError::Unknown { signature: graph.signature(), config: ModelConfig::template(graph) });
            }
        };
        recipe.checked(graph)
    }

    /// Names of all outputs that are used.
    pub fn outputs(&self) -> Vec<String> {
        let others = [&self.normals, &self.normals_kappa, &self.mask, &self.scale];
        let mut outputs = vec![self.output.clone()];
        for name in others.into_iter().flatten() {
            // The runtime rejects duplicates.
            if !outputs.contains(name) {
                outputs.push(name.clone());
            }
        }
        outputs
    }

    /// Applies a config to the recipe of a known family, or to none.
    ///
    /// # Errors
    /// Without a family: a config that lacks the kind, or a size, input or output that the graph does not determine.
    fn configured(family: Option<Self>, config: &ModelConfig, graph: &Graph) -> Result<Self, ModelError> {
        let images: Vec<&str> = graph
            .inputs
            .iter()
            .filter(|info| info.dims.as_ref().is_none_or(|dims| dims.len() == 4))
            .map(|info| info.name.as_str())
            .collect();
        let known = family.is_some();
        let needed =
            |what: &str| ModelError::Config(format!("it does not define {what}; the model has\n{}", graph.signature()));
        let mut recipe = family.unwrap_or_else(|| Self {
            family: String::new(),
            input: if let [only] = images[..] { only.to_owned() } else { String::new() },
            layout: AxisOrder::Nchw,
            bgr: false,
            white: 1.0,
            mean: [0.0; 3],
            deviation: [1.0; 3],
            padding: None,
            // Replaced below, by the config or by the file.
            size: SizeRule::Fixed { width: 0, height: 0 },
            integers: Vec::new(),
            kind: OutputKind::Metric,
            output: if let [only] = &graph.outputs[..] { only.name.clone() } else { String::new() },
            normals: None,
            normals_kappa: None,
            mask: None,
            scale: None,
            canonical_focal_px: None,
        });
        if !known && config.kind.is_none() {
            return Err(needed("the kind (metric, inverse-affine, log or points)"));
        }
        recipe.family = config
            .name
            .clone()
            .unwrap_or_else(|| if recipe.family.is_empty() { "by its config".to_owned() } else { recipe.family });
        recipe.kind = config.kind.unwrap_or(recipe.kind);
        recipe.input = config.input.clone().unwrap_or(recipe.input);
        recipe.layout = config.layout.unwrap_or(recipe.layout);
        recipe.bgr = config.channels.map_or(recipe.bgr, |channels| channels == Channels::Bgr);
        recipe.white = config.white.unwrap_or(recipe.white);
        recipe.mean = config.mean.unwrap_or(recipe.mean);
        recipe.deviation = config.deviation.unwrap_or(recipe.deviation);
        recipe.output = config.output.clone().unwrap_or(recipe.output);
        recipe.normals = config.normals.clone().or(recipe.normals);
        recipe.mask = config.mask.clone().or(recipe.mask);
        recipe.scale = config.scale.clone().or(recipe.scale);
        for (name, value) in &config.integers {
            recipe.integers.retain(|(known, _)| known != name);
            recipe.integers.push((name.clone(), *value));
        }
        match config.focal {
            None => {}
            Some(Focal::None) => recipe.canonical_focal_px = None,
            Some(Focal::Canonical { pixels }) => recipe.canonical_focal_px = Some(pixels),
        }
        if recipe.input.is_empty() {
            return Err(needed("the input for the photo"));
        }
        if recipe.output.is_empty() {
            return Err(needed("the output with depth or points"));
        }
        let dims = graph.inputs.iter().find(|info| info.name == recipe.input).and_then(|info| info.dims.as_ref());
        let fixed = dims.is_some_and(|dims| {
            dims.len() == 4 && recipe.layout.axes()[1..].iter().all(|&axis| matches!(dims[axis], Dim::Fixed(_)))
        });
        match config.size {
            Some(size) => recipe.size = size,
            None if !known && !fixed => return Err(needed("the size")),
            None => {}
        }
        Ok(recipe)
    }

    fn checked(mut self, graph: &Graph) -> Result<Self, ModelError> {
        let wrong = |why: String| Err(ModelError::Config(format!("{why}; the model has\n{}", graph.signature())));
        let Some(input) = graph.inputs.iter().find(|info| info.name == self.input) else {
            return wrong(format!("there is no input \"{}\"", self.input));
        };
        if let Some(absent) = self.outputs().iter().find(|name| graph.outputs.iter().all(|info| info.name != **name)) {
            return wrong(format!("there is no output \"{absent}\""));
        }
        if input.element != Element::F32 {
            return wrong(format!(
                "its input \"{}\" has the type {}, expected floating-point numbers",
                self.input,
                input.element.name()
            ));
        }
        if let Some(dims) = &input.dims {
            let axes = self.layout.axes();
            let free = |axis: usize, size: usize| matches!(&dims[axis], Dim::Free(_)) || dims[axis] == Dim::Fixed(size);
            if dims.len() != 4 || !free(0, 1) || !free(axes[0], 3) {
                return wrong(format!("its input \"{}\" is not an image with three channels", self.input));
            }
            // A size fixed in the file takes precedence.
            if let (Dim::Fixed(height), Dim::Fixed(width)) = (&dims[axes[1]], &dims[axes[2]]) {
                let (width, height) = (*width, *height);
                self.size = match self.size {
                    SizeRule::Fixed { .. } | SizeRule::ShorterSide { .. } | SizeRule::DepthAnything => {
                        SizeRule::Fixed { width, height }
                    }
                    SizeRule::Letterbox { .. } | SizeRule::LongerSide { .. } => SizeRule::Letterbox { width, height },
                };
            }
        }
        let given = |name: &str| name == self.input || self.integers.iter().any(|(known, _)| known == name);
        if let Some(open) = graph.inputs.iter().find(|info| !given(&info.name)) {
            return wrong(format!("there is no value for the input \"{}\"", crate::error::short(&open.name)));
        }
        self.size.check()?;
        Ok(self)
    }
}

/// The recipe of a known family.
fn known(graph: &Graph, file_name: &str) -> Option<Recipe> {
    let input = |name: &str| {
        graph.inputs.iter().any(|info| info.name == name && info.dims.as_ref().is_none_or(|dims| dims.len() == 4))
    };
    let integer = |name: &str| graph.inputs.iter().any(|info| info.name == name && info.element == Element::I64);
    let output = |name: &str| graph.outputs.iter().any(|info| info.name == name).then(|| name.to_owned());
    let plain = Recipe {
        family: String::new(),
        input: String::new(),
        layout: AxisOrder::Nchw,
        bgr: false,
        white: 1.0,
        mean: [0.0; 3],
        deviation: [1.0; 3],
        padding: None,
        size: SizeRule::DepthAnything,
        integers: Vec::new(),
        kind: OutputKind::Metric,
        output: String::new(),
        normals: None,
        normals_kappa: None,
        mask: None,
        scale: None,
        canonical_focal_px: None,
    };
    if let (true, Some(points)) = (input("image"), output("points")) {
        let scale = output("metric_scale").or_else(|| output("scale"));
        return Some(Recipe {
            family: if scale.is_some() { "MoGe-2" } else { "MoGe" }.to_owned(),
            input: "image".to_owned(),
            size: SizeRule::LongerSide { longer_side: MOGE_LONGER_SIDE, multiple: 1 },
            integers: integer("num_tokens").then(|| ("num_tokens".to_owned(), MOGE_TOKENS)).into_iter().collect(),
            kind: OutputKind::Points,
            output: points,
            normals: output("normal"),
            mask: output("mask"),
            scale,
            ..plain
        });
    }
    let metric3d = |image: &str, depth: String, normals: Option<String>, kappa: Option<String>| {
        // Some exporters include the normalisation in the graph.
        let inside = normalises(graph, image);
        Recipe {
            family: "Metric3D v2".to_owned(),
            input: image.to_owned(),
            white: 255.0,
            mean: if inside { [0.0; 3] } else { metric3d::MEAN },
            deviation: if inside { [1.0; 3] } else { metric3d::DEVIATION },
            padding: Some(metric3d::MEAN),
            size: SizeRule::Letterbox { width: metric3d::WIDTH, height: metric3d::HEIGHT },
            output: depth,
            normals,
            normals_kappa: kappa,
            canonical_focal_px: Some(metric3d::CANONICAL_FOCAL_PX),
            ..plain.clone()
        }
    };
    if let (true, Some(depth), normals @ Some(_)) =
        (input("pixel_values"), output("predicted_depth"), output("predicted_normal"))
    {
        return Some(metric3d("pixel_values", depth, normals, output("normal_confidence")));
    }
    if let (true, Some(depth)) = (input("image") && normalises(graph, "image"), output("pred_depth")) {
        return Some(metric3d("image", depth, None, None));
    }
    let alone = graph.inputs.len() == 1 && graph.outputs.len() == 1;
    // Names used by `transformers`, and by exports of the publisher's code. Other networks with these names (DPT,
    // ZoeDepth, Depth Pro) have patches of other sizes. In quantised networks the size is not visible.
    let patches = patches_of_14(graph);
    for (image, depth, known) in
        [("pixel_values", "predicted_depth", patches != Some(false)), ("image", "depth", patches == Some(true))]
    {
        let (true, true, Some(depth)) = (alone && known, input(image), output(depth)) else { continue };
        let variant = depth_anything::variant(backwards(graph, &depth)).or_else(|| {
            let name = file_name.to_ascii_lowercase();
            let metric = ["metric", "indoor", "outdoor"].iter().any(|word| name.contains(word));
            let by_name = if metric { depth_anything::Variant::Metric } else { depth_anything::Variant::Relative };
            (patches == Some(true)).then_some(by_name)
        })?;
        let (name, kind) = match variant {
            depth_anything::Variant::Metric => ("Depth Anything V2, metric", OutputKind::Metric),
            depth_anything::Variant::Relative => ("Depth Anything V2, relative", OutputKind::InverseAffine),
        };
        return Some(Recipe {
            family: name.to_owned(),
            input: image.to_owned(),
            mean: depth_anything::MEAN,
            deviation: depth_anything::DEVIATION,
            kind,
            output: depth,
            ..plain
        });
    }
    None
}

/// Operators from an output backwards, along the first inputs.
fn backwards<'a>(graph: &'a Graph, output: &'a str) -> impl Iterator<Item = &'a str> {
    let mut at = output;
    let mut left = LOOKED_AT;
    std::iter::from_fn(move || {
        let node = graph.nodes.iter().find(|node| node.outputs.iter().any(|name| name == at))?;
        left = left.checked_sub(1)?;
        at = node.inputs.first()?;
        Some(node.op.as_str())
    })
}

/// Whether the first convolution has patches of 14 × 14 pixels; `None` if its weights are not found.
fn patches_of_14(graph: &Graph) -> Option<bool> {
    let first = graph.nodes.iter().find(|node| node.op == "Conv")?;
    let tensor = graph.initializers.iter().find(|tensor| Some(&tensor.name) == first.inputs.get(1))?;
    Some(tensor.dims.ends_with(&[3, 14, 14]))
}

/// Whether a graph subtracts Metric3D's mean itself, before the first convolution.
fn normalises(graph: &Graph, input: &str) -> bool {
    let mut derived: HashSet<&str> = HashSet::from([input]);
    for node in graph.nodes.iter().take(LOOKED_AT).take_while(|node| node.op != "Conv") {
        if node.inputs.iter().any(|name| derived.contains(name.as_str())) {
            let constants =
                node.inputs.iter().filter_map(|name| graph.initializers.iter().find(|tensor| tensor.name == *name));
            if constants.into_iter().any(is_mean) {
                return true;
            }
            derived.extend(node.outputs.iter().map(String::as_str));
        }
    }
    false
}

fn is_mean(tensor: &Tensor) -> bool {
    let Data::Bytes(bytes) = &tensor.data else { return false };
    let values = bytes.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes).abs());
    // Half precision has steps of 1/16 at these values.
    tensor.element == Element::F32
        && bytes.len() == 12
        && values.zip(metric3d::MEAN).all(|(value, mean)| (value - mean).abs() < 0.1)
}
