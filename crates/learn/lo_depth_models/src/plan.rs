//! Plans a graph for one photo size: determines every tensor size and the memory of the run.
//!
//! Only values that are known to be small are computed here, so a hostile file cannot make sizes explode. A graph runs
//! only if its memory is known.

use std::collections::{HashMap, HashSet, VecDeque};

use crate::facts::{Fact, Inputs, Known};
use crate::onnx::{
    AttributeValue, Data, Dim, Element, Graph, MAX_DIM, MAX_NESTING, MAX_NODES, MAX_RANK, Node, Tensor, inlined_branch,
    product,
};
use crate::shapes::{shape_range, shapes};
use crate::{ModelError, integer_products, resize};

/// Largest memory of a run, for weights and values.
const MAX_RUN_BYTES: u64 = 1_900_000_000;

/// Longest chain of nodes. The runtime orders nodes recursively, on the stack that [`crate::runtime`] gives it.
const MAX_CHAIN: usize = 10_000;

/// Largest number of multiplications of a run: minutes on an ordinary computer.
const MAX_PRODUCTS: f64 = 3e13;

/// Largest number of elements of a tensor that is computed before the run.
const MAX_KNOWN: usize = 1 << 12;

/// Content of an input.
pub(crate) enum InputContent {
    /// An unknown tensor of this shape.
    Sized(Vec<usize>),
    /// A known value, which becomes a constant of the graph.
    Value(Vec<usize>, Known),
}

/// Computes a node from the names, shapes and values of its inputs; `None` if [`Known`] lacks the type of the result.
pub(crate) type Evaluate<'a> = &'a dyn Fn(&Node, &[(String, Vec<usize>, Known)]) -> Result<Option<Values>, ModelError>;

/// Shapes and values of a node's outputs.
pub(crate) type Values = Vec<(Vec<usize>, Known)>;

/// Plans a simplified graph for given inputs, with `weight_bytes` of weights.
///
/// # Errors
/// Sizes that do not match or are not known before the run, unsupported operators, memory or work beyond the limits.
pub(crate) fn plan(
    graph: &Graph,
    opset: i64,
    contents: &HashMap<String, InputContent>,
    wanted: &[String],
    weight_bytes: u64,
    evaluate: Evaluate<'_>,
) -> Result<Graph, ModelError> {
    let mut planner = Planner {
        opset,
        evaluate,
        facts: HashMap::new(),
        nodes: Vec::new(),
        tensors: Vec::new(),
        branches: 0,
        products: 0.0,
        in_floats: integer_products::saturate(),
    };
    let mut inputs = Vec::new();
    for input in &graph.inputs {
        let fact = match contents.get(&input.name) {
            None => {
                return Err(ModelError::Unsupported(format!(
                    "there is no value for its input \"{}\"",
                    crate::error::short(&input.name)
                )));
            }
            Some(InputContent::Sized(dims)) => {
                let dims_info = dims.iter().map(|&dim| Dim::Fixed(dim)).collect();
                inputs.push(crate::onnx::ValueInfo { dims: Some(dims_info), ..input.clone() });
                Fact { dims: dims.clone(), known: None, constant: false }
            }
            Some(InputContent::Value(dims, known)) => {
                Fact { dims: dims.clone(), known: Some(known.clone()), constant: true }
            }
        };
        planner.facts.insert(input.name.clone(), fact);
    }
    planner.tensors(&graph.initializers)?;
    // Only nodes that the requested outputs depend on.
    for node in needed(&graph.nodes, wanted)? {
        planner.node(node, 0)?;
    }
    planner.finish(inputs, wanted, weight_bytes)
}

/// Nodes that `wanted` depends on, in topological order. The standard requires that order, but files may violate it.
///
/// # Errors
/// A cycle of nodes.
fn needed<'a>(nodes: &'a [Node], wanted: &[String]) -> Result<Vec<&'a Node>, ModelError> {
    let makers: HashMap<&str, usize> = nodes
        .iter()
        .enumerate()
        .flat_map(|(index, node)| node.outputs.iter().map(move |output| (output.as_str(), index)))
        .filter(|(name, _)| !name.is_empty())
        .collect();
    let takes = |index: usize| {
        let mut names = HashSet::new();
        names_used(&nodes[index], &mut names);
        let mut makers: Vec<usize> = names.into_iter().filter_map(|name| makers.get(name).copied()).collect();
        makers.sort_unstable();
        makers.dedup();
        makers
    };
    let (mut order, mut begun, mut done) = (Vec::new(), vec![false; nodes.len()], vec![false; nodes.len()]);
    let mut first: Vec<usize> = wanted.iter().filter_map(|name| makers.get(name.as_str()).copied()).collect();
    first.sort_unstable();
    for root in first {
        // Not recursive: a chain of nodes can exceed the stack.
        let mut open = vec![(root, if done[root] { Vec::new() } else { takes(root) })];
        begun[root] = true;
        while let Some((index, rest)) = open.last_mut() {
            let index = *index;
            match rest.pop() {
                Some(maker) if done[maker] => {}
                Some(maker) if begun[maker] => {
                    return Err(ModelError::Malformed(format!(
                        "its node {} depends on its own output",
                        nodes[maker].label()
                    )));
                }
                Some(maker) => {
                    begun[maker] = true;
                    open.push((maker, takes(maker)));
                }
                None => {
                    open.pop();
                    if !std::mem::replace(&mut done[index], true) {
                        order.push(&nodes[index]);
                    }
                }
            }
        }
    }
    Ok(order)
}

/// Names that a node and its branches use.
fn names_used<'a>(node: &'a Node, into: &mut HashSet<&'a str>) {
    into.extend(node.inputs.iter().map(String::as_str));
    for attribute in &node.attributes {
        if let AttributeValue::Graph(graph) = &attribute.value {
            graph.nodes.iter().for_each(|node| names_used(node, into));
            into.extend(graph.outputs.iter().map(|info| info.name.as_str()));
        }
    }
}

struct Planner<'a> {
    opset: i64,
    evaluate: Evaluate<'a>,
    facts: HashMap<String, Fact>,
    nodes: Vec<Node>,
    tensors: Vec<Tensor>,
    branches: usize,
    products: f64,
    /// Whether integers are multiplied in single precision.
    in_floats: bool,
}

impl Planner<'_> {
    fn tensors(&mut self, tensors: &[Tensor]) -> Result<(), ModelError> {
        for tensor in tensors {
            let fact = Fact { dims: tensor.dims.clone(), known: known(tensor), constant: true };
            self.define(&tensor.name, fact)?;
            self.tensors.push(tensor.clone());
        }
        Ok(())
    }

    fn define(&mut self, name: &str, fact: Fact) -> Result<(), ModelError> {
        match self.facts.insert(name.to_owned(), fact) {
            None => Ok(()),
            Some(_) => Err(ModelError::Malformed(format!("\"{}\" is defined twice", crate::error::short(name)))),
        }
    }

    fn node(&mut self, node: &Node, depth: usize) -> Result<(), ModelError> {
        let refused = |why: String| ModelError::Node { node: node.label(), why };
        if self.nodes.len() > MAX_NODES {
            return Err(ModelError::TooLarge(format!("it has more than {MAX_NODES} nodes")));
        }
        let absent = node.inputs.iter().find(|name| !name.is_empty() && !self.facts.contains_key(*name));
        if let Some(absent) = absent {
            return Err(refused(format!("its input \"{}\" is not defined before it", crate::error::short(absent))));
        }
        if node.is_standard() && node.op == "If" {
            return self.branch(node, depth);
        }
        let inputs: Vec<Option<&Fact>> = node.inputs.iter().map(|name| self.facts.get(name)).collect();
        let sizes = shapes(node, &inputs, self.opset).map_err(refused)?;
        for dims in &sizes {
            let bytes = product(dims).and_then(|length| length.checked_mul(4)).map_or(u64::MAX, |bytes| bytes as u64);
            if bytes > MAX_RUN_BYTES || dims.iter().any(|&dim| dim > MAX_DIM) || dims.len() > MAX_RANK {
                return Err(ModelError::TooLarge(format!("its node {} has an output of shape {dims:?}", node.label())));
            }
        }
        self.products += products(node, &inputs, &sizes);
        if self.products > MAX_PRODUCTS {
            return Err(ModelError::TooLarge("a run takes more than 3e13 multiplications".to_owned()));
        }
        let constant = inputs.iter().flatten().all(|fact| fact.constant);
        if let Some(values) = self.values(node, &inputs, &sizes)? {
            for (name, (dims, known)) in node.outputs.iter().zip(values) {
                if !name.is_empty() {
                    self.define(name, Fact { dims, known: Some(known), constant: true })?;
                }
            }
            return Ok(());
        }
        if node.op == "NonZero" {
            return Err(refused("the size of its output depends on the photo".to_owned()));
        }
        if matches!(node.op.as_str(), "Resize" | "Upsample") && node.is_standard() {
            let products =
                resize::as_products(&Inputs { node, inputs: &inputs, opset: self.opset }).map_err(refused)?;
            if let Some((nodes, tensors)) = products {
                for tensor in tensors {
                    self.define(&tensor.name, resize::matrix_fact(&tensor))?;
                    self.tensors.push(tensor);
                }
                return nodes.iter().try_for_each(|node| self.node(node, depth));
            }
        }
        if self.in_floats
            && let Some((nodes, tensors)) = integer_products::in_floats(node, &inputs)
        {
            self.tensors(&tensors)?;
            return nodes.iter().try_for_each(|node| self.node(node, depth));
        }
        if node.op == "ConvInteger"
            && let Some((pad, pads, conv)) = padded_first(node, &inputs)
        {
            self.tensors(&[pads])?;
            return [pad, conv].iter().try_for_each(|node| self.node(node, depth));
        }
        let convolution = matches!(node.op.as_str(), "Conv" | "ConvInteger").then(|| with_steps(node, &inputs));
        for (name, dims) in node.outputs.iter().zip(sizes) {
            if !name.is_empty() {
                self.define(name, Fact { dims, known: None, constant })?;
            }
        }
        self.nodes.push(match node.op.as_str() {
            // Active in training only.
            "Dropout" => Node::new("Identity", &[&node.inputs[0]], &node.outputs[0]),
            _ => convolution.unwrap_or_else(|| node.clone()),
        });
        Ok(())
    }

    /// Values of a node with known inputs; `None` if they are unknown or too large.
    fn values(
        &self,
        node: &Node,
        inputs: &[Option<&Fact>],
        sizes: &[Vec<usize>],
    ) -> Result<Option<Values>, ModelError> {
        if node.is_standard() && matches!(node.op.as_str(), "Shape" | "Size") {
            let Some(Some(fact)) = inputs.first() else { return Ok(None) };
            let (start, end) = shape_range(node, fact.dims.len());
            let int = |size: usize| i32::try_from(size).unwrap_or(i32::MAX);
            let values: Vec<i32> = match node.op.as_str() {
                "Size" => vec![int(product(&fact.dims).unwrap_or(usize::MAX))],
                _ => fact.dims.get(start..end).unwrap_or_default().iter().map(|&size| int(size)).collect(),
            };
            return Ok(Some(vec![(sizes[0].clone(), Known::Ints(values))]));
        }
        let small = sizes.iter().all(|dims| product(dims).is_some_and(|length| length <= MAX_KNOWN));
        let resized = matches!(node.op.as_str(), "Resize" | "Upsample");
        let all = inputs
            .iter()
            .zip(&node.inputs)
            .all(|(fact, name)| name.is_empty() || fact.is_some_and(|fact| fact.known.is_some()));
        if !small || !all || resized {
            return Ok(None);
        }
        let given: Vec<(String, Vec<usize>, Known)> = inputs
            .iter()
            .zip(&node.inputs)
            .filter_map(|(fact, name)| fact.map(|fact| (name.clone(), fact.dims.clone(), fact.known.clone())))
            .filter_map(|(name, dims, known)| known.map(|known| (name, dims, known)))
            .collect();
        if divides_smallest_integer(node, &given) {
            let why = "it divides the smallest integer by -1, which overflows".to_owned();
            return Err(ModelError::Node { node: node.label(), why });
        }
        (self.evaluate)(node, &given)
    }

    /// Inlines the branch of an `If` that its condition selects.
    fn branch(&mut self, node: &Node, depth: usize) -> Result<(), ModelError> {
        let refused = |why: &str| ModelError::Node { node: node.label(), why: why.to_owned() };
        if depth > MAX_NESTING {
            return Err(refused("branches are nested too deeply"));
        }
        let chosen =
            match node.inputs.first().and_then(|name| self.facts.get(name)).and_then(|fact| fact.known.as_ref()) {
                Some(Known::Ints(values)) if values.len() == 1 => values[0] != 0,
                _ => return Err(refused("its condition is not known before the run")),
            };
        let name = if chosen { "then_branch" } else { "else_branch" };
        let Some(AttributeValue::Graph(branch)) = node.value(name) else { return Err(refused("a branch is missing")) };
        self.branches += 1;
        let (branch, outputs) = inlined_branch(branch, &format!("branch{}/", self.branches));
        if outputs.len() != node.outputs.len() {
            return Err(refused("a branch has a different number of outputs"));
        }
        self.tensors(&branch.initializers)?;
        for inner in needed(&branch.nodes, &outputs)? {
            self.node(inner, depth + 1)?;
        }
        for (from, to) in outputs.iter().zip(&node.outputs) {
            self.node(&Node::new("Identity", &[from], to), depth + 1)?;
        }
        Ok(())
    }

    fn finish(
        mut self,
        inputs: Vec<crate::onnx::ValueInfo>,
        wanted: &[String],
        weight_bytes: u64,
    ) -> Result<Graph, ModelError> {
        let mut used: HashSet<&str> = wanted.iter().map(String::as_str).collect();
        used.extend(self.nodes.iter().flat_map(|node| &node.inputs).map(String::as_str));
        // Values that became known are constants of the new graph.
        let mut tensors: Vec<Tensor> = std::mem::take(&mut self.tensors);
        tensors.retain(|tensor| used.contains(tensor.name.as_str()));
        let have: HashSet<String> = tensors.iter().map(|tensor| tensor.name.clone()).collect();
        let mut names: Vec<&str> = used.into_iter().filter(|name| !have.contains(*name)).collect();
        names.sort_unstable();
        for name in names {
            match self.facts.get(name) {
                Some(Fact { dims, known: Some(Known::Ints(values)), .. }) => {
                    tensors.push(Tensor::ints(name.to_owned(), dims.clone(), values));
                }
                Some(Fact { dims, known: Some(Known::Floats(values)), .. }) => {
                    tensors.push(Tensor::floats(name.to_owned(), dims.clone(), values));
                }
                _ => {}
            }
        }
        let mut outputs = Vec::new();
        for name in wanted {
            let fact = self.facts.get(name);
            let fact = fact.ok_or_else(|| {
                ModelError::Malformed(format!("its output \"{}\" is not defined", crate::error::short(name)))
            })?;
            let dims = fact.dims.iter().map(|&dim| Dim::Fixed(dim)).collect();
            outputs.push(crate::onnx::ValueInfo { name: name.clone(), element: Element::default(), dims: Some(dims) });
        }
        if self.longest_chain() > MAX_CHAIN {
            return Err(ModelError::TooLarge(format!("a chain of its nodes is longer than {MAX_CHAIN}")));
        }
        let peaks = [false, true].map(|in_place_last| self.peak_bytes(wanted, &self.order(in_place_last)));
        let bytes = weight_bytes.saturating_add(peaks[0].max(peaks[1]));
        if bytes > MAX_RUN_BYTES {
            return Err(ModelError::TooLarge(format!(
                "a run takes about {:.1} GB of memory, the limit is {:.1} GB",
                bytes as f64 / 1e9,
                MAX_RUN_BYTES as f64 / 1e9
            )));
        }
        Ok(Graph { nodes: self.nodes, initializers: tensors, inputs, outputs })
    }

    /// Number of nodes on the longest path through the graph.
    fn longest_chain(&self) -> usize {
        let mut depths: HashMap<&str, usize> = HashMap::new();
        let mut longest = 0;
        for node in &self.nodes {
            let depth = 1 + node.inputs.iter().filter_map(|name| depths.get(name.as_str())).max().copied().unwrap_or(0);
            longest = longest.max(depth);
            depths.extend(node.outputs.iter().map(|name| (name.as_str(), depth)));
        }
        longest
    }

    /// The order in which rten runs the nodes: the first node with all inputs available; with `in_place_last`, nodes
    /// that can overwrite an input wait for others.
    fn order(&self, in_place_last: bool) -> Vec<usize> {
        let mut takers: HashMap<&str, Vec<usize>> = HashMap::new();
        let makers: HashSet<&str> = self.nodes.iter().flat_map(|node| &node.outputs).map(String::as_str).collect();
        let mut missing = vec![0usize; self.nodes.len()];
        for (index, node) in self.nodes.iter().enumerate() {
            let inputs: HashSet<&str> =
                node.inputs.iter().map(String::as_str).filter(|name| makers.contains(name)).collect();
            missing[index] = inputs.len();
            inputs.into_iter().for_each(|name| takers.entry(name).or_default().push(index));
        }
        let late = |index: usize| in_place_last && writes_in_place(&self.nodes[index]);
        let (mut first, mut last): (VecDeque<usize>, VecDeque<usize>) =
            (0..self.nodes.len()).filter(|&index| missing[index] == 0).partition(|&index| !late(index));
        let mut order = Vec::with_capacity(self.nodes.len());
        while let Some(index) = first.pop_front().or_else(|| last.pop_front()) {
            order.push(index);
            for output in self.nodes[index].outputs.iter().filter(|output| !output.is_empty()) {
                for &taker in takers.get(output.as_str()).into_iter().flatten() {
                    missing[taker] -= 1;
                    if missing[taker] == 0 {
                        if late(taker) { last.push_back(taker) } else { first.push_back(taker) }
                    }
                }
            }
        }
        order
    }

    /// Peak memory of values in such an order, in bytes.
    ///
    /// A value lives from the node that computes it to the last that uses it. Values that are independent of the photo
    /// are computed when the graph is loaded, and stay.
    fn peak_bytes(&self, wanted: &[String], order: &[usize]) -> u64 {
        let bytes = |name: &str| {
            self.facts.get(name).and_then(|fact| product(&fact.dims)).map_or(0, |length| 4 * length as u64)
        };
        let constant = |name: &str| self.facts.get(name).is_some_and(|fact| fact.constant);
        let mut last: HashMap<&str, usize> = HashMap::new();
        for (at, node) in order.iter().map(|&index| &self.nodes[index]).enumerate() {
            let stays = node.outputs.iter().any(|output| !constant(output));
            for name in &node.inputs {
                // A constant that the run uses stays to the end.
                let end = if stays && constant(name) { usize::MAX } else { at };
                let known = last.entry(name).or_default();
                *known = end.max(*known);
            }
        }
        wanted.iter().for_each(|name| _ = last.insert(name, usize::MAX));
        let mut ends: HashMap<usize, u64> = HashMap::new();
        let (mut now, mut most) = (0u64, 0u64);
        for (at, node) in order.iter().map(|&index| &self.nodes[index]).enumerate() {
            for output in node.outputs.iter().filter(|output| !output.is_empty()) {
                let size = bytes(output);
                now = now.saturating_add(size);
                *ends.entry(last.get(output.as_str()).copied().unwrap_or(at)).or_default() += size;
            }
            most = most.max(now);
            now -= ends.remove(&at).unwrap_or(0);
        }
        most
    }
}

/// Whether rten can overwrite a node's input with its output, and therefore runs it late.
fn writes_in_place(node: &Node) -> bool {
    const KINDS: [&str; 36] = [
        "Abs",
        "Add",
        "BatchNormalization",
        "Cast",
        "Ceil",
        "Clip",
        "Cos",
        "Div",
        "Elu",
        "Erf",
        "Exp",
        "Flatten",
        "Floor",
        "Gelu",
        "HardSigmoid",
        "HardSwish",
        "Identity",
        "LayerNormalization",
        "LeakyRelu",
        "Log",
        "Mul",
        "Neg",
        "Not",
        "Pow",
        "Reciprocal",
        "Relu",
        "Reshape",
        "Round",
        "Sigmoid",
        "Sin",
        "Softmax",
        "Sqrt",
        "Squeeze",
        "Sub",
        "Tanh",
        "Unsqueeze",
    ];
    KINDS.contains(&node.op.as_str())
}

/// Splits a `ConvInteger` with padding into a `Pad` by the zero point and a `ConvInteger` without padding; `None` if
/// there is no padding. rten 0.27 pads by 0 even if the zero point differs.
fn padded_first(node: &Node, inputs: &[Option<&Fact>]) -> Option<(Node, Tensor, Node)> {
    let pads = node.ints("pads").filter(|pads| pads.iter().any(|&pad| pad != 0))?;
    let axes = inputs.first().copied().flatten()?.dims.len().checked_sub(2).filter(|axes| 2 * axes == pads.len())?;
    let zero_point = node.inputs.get(2).filter(|name| !name.is_empty())?;
    let (from, output) = (node.inputs.first()?, node.outputs.first()?);
    let int = |pad: i64| i32::try_from(pad).ok();
    let none = [Some(0); 2].into_iter();
    let sides: Option<Vec<i32>> = none
        .clone()
        .chain(pads[..axes].iter().map(|&pad| int(pad)))
        .chain(none)
        .chain(pads[axes..].iter().map(|&pad| int(pad)))
        .collect();
    let (padded, by) = (format!("{output}#padded"), format!("{output}#pads"));
    let tensor = Tensor::ints(by.clone(), vec![2 * axes + 4], &sides?);
    let mut conv = node.clone();
    conv.inputs[0].clone_from(&padded);
    conv.attributes.retain(|attribute| attribute.name != "pads");
    Some((Node::new("Pad", &[from, &by, zero_point], &padded), tensor, conv))
}

/// A convolution with explicit strides, dilations and padding. rten 0.27 lacks their defaults for integer convolutions.
fn with_steps(node: &Node, inputs: &[Option<&Fact>]) -> Node {
    let axes = inputs.first().copied().flatten().map_or(0, |fact| fact.dims.len().saturating_sub(2));
    let pads = node.text("auto_pad").is_none_or(|auto_pad| auto_pad == "NOTSET").then(|| ("pads", vec![0; 2 * axes]));
    let usual = [("strides", vec![1; axes]), ("dilations", vec![1; axes])].into_iter().chain(pads);
    usual.fold(node.clone(), |node, (name, values)| match node.ints(name) {
        Some(_) => node,
        None => node.with(name, AttributeValue::Ints(values)),
    })
}

/// Returns whether an integer division may overflow, which makes rten panic.
fn divides_smallest_integer(node: &Node, given: &[(String, Vec<usize>, Known)]) -> bool {
    let has = |name: Option<&String>, value: i32| {
        let known = given.iter().find(|(given, ..)| Some(given) == name).map(|(_, _, known)| known);
        matches!(known, Some(Known::Ints(values)) if values.contains(&value))
    };
    matches!(node.op.as_str(), "Div" | "Mod") && has(node.inputs.first(), i32::MIN) && has(node.inputs.get(1), -1)
}

/// Values of a small tensor, if the runtime stores its type as 32-bit integers or in single precision.
fn known(tensor: &Tensor) -> Option<Known> {
    let Data::Bytes(bytes) = &tensor.data else { return None };
    if product(&tensor.dims)? > MAX_KNOWN {
        return None;
    }
    let words = bytes.as_chunks::<4>().0;
    Some(match tensor.element {
        Element::F32 => Known::Floats(words.iter().map(|&word| f32::from_le_bytes(word)).collect()),
        Element::I32 => Known::Ints(words.iter().map(|&word| i32::from_le_bytes(word)).collect()),
        Element::I64 => {
            let saturated =
                |&word: &[u8; 8]| i64::from_le_bytes(word).clamp(i64::from(i32::MIN), i64::from(i32::MAX)) as i32;
            Known::Ints(bytes.as_chunks().0.iter().map(saturated).collect())
        }
        Element::BOOL => Known::Ints(bytes.iter().map(|&byte| i32::from(byte != 0)).collect()),
        _ => return None,
    })
}

/// Approximate number of multiplications of a node.
fn products(node: &Node, inputs: &[Option<&Fact>], sizes: &[Vec<usize>]) -> f64 {
    let count = |dims: &[usize]| dims.iter().map(|&dim| dim as f64).product::<f64>();
    let out = sizes.iter().map(|dims| count(dims)).sum::<f64>();
    let dims = |index: usize| inputs.get(index).copied().flatten().map_or(&[][..], |fact| fact.dims.as_slice());
    match node.op.as_str() {
        "MatMul" | "MatMulInteger" | "MatMulNBits" | "Gemm" => out * dims(0).iter().copied().max().unwrap_or(1) as f64,
        "Conv" | "ConvInteger" => out * count(dims(1).get(1..).unwrap_or_default()),
        "ConvTranspose" => count(dims(0)) * count(dims(1).get(1..).unwrap_or_default()),
        "Einsum" => out * dims(0).iter().chain(dims(1)).map(|&dim| dim as f64).fold(1.0, f64::max),
        "Attention" | "MultiHeadAttention" => 2.0 * out * dims(1).get(1).map_or(1.0, |&dim| dim as f64),
        _ => out,
    }
}
