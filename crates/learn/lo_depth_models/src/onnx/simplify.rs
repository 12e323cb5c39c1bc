//! Inlines functions, turns `Constant` nodes into tensors, and half and double precision into single.

use std::collections::{HashMap, HashSet};

use super::{Attribute, AttributeValue, Data, Element, Function, Graph, MAX_NESTING, MAX_NODES, Model, Node, Tensor};
use crate::ModelError;

/// Removes functions, `Constant` nodes, and inputs that are constants.
///
/// # Errors
/// Functions nested deeper than [`MAX_NESTING`], more nodes than [`MAX_NODES`], constants that are not tensors of
/// numbers.
pub(crate) fn simplify(model: &mut Model) -> Result<(), ModelError> {
    let functions: HashMap<Key, &Function> = model
        .functions
        .iter()
        .map(|function| ((standard(&function.domain), function.name.as_str(), function.overload.as_str()), function))
        .collect();
    let mut inliner = Inliner { functions, calls: 0, nodes: 0 };
    let graph = std::mem::take(&mut model.graph);
    model.graph = inliner.graph(graph, 0)?;
    model.functions.clear();
    Ok(())
}

/// A branch's nodes and tensors for use in the enclosing graph, and its outputs' names. Names defined in the branch get
/// a prefix.
pub(crate) fn inlined_branch(branch: &Graph, prefix: &str) -> (Graph, Vec<String>) {
    let own: HashSet<&str> = branch
        .nodes
        .iter()
        .flat_map(|node| &node.outputs)
        .chain(branch.initializers.iter().map(|tensor| &tensor.name))
        .map(String::as_str)
        .filter(|name| !name.is_empty())
        .collect();
    let rename = |name: &str| if own.contains(name) { format!("{prefix}{name}") } else { name.to_owned() };
    let outputs = branch.outputs.iter().map(|info| rename(&info.name)).collect();
    (renamed(branch.clone(), &rename), outputs)
}

/// Domain, name and overload.
type Key<'a> = (&'a str, &'a str, &'a str);

fn standard(domain: &str) -> &str {
    if domain == "ai.onnx" { "" } else { domain }
}

struct Inliner<'a> {
    functions: HashMap<Key<'a>, &'a Function>,
    calls: usize,
    nodes: usize,
}

impl Inliner<'_> {
    fn graph(&mut self, mut graph: Graph, depth: usize) -> Result<Graph, ModelError> {
        let mut nodes = Vec::with_capacity(graph.nodes.len());
        for node in std::mem::take(&mut graph.nodes) {
            self.node(node, depth, &mut nodes)?;
        }
        for node in nodes {
            if node.is_standard() && node.op == "Constant" {
                graph.initializers.push(constant(node)?);
            } else {
                graph.nodes.push(node);
            }
        }
        let constants: HashSet<&str> = graph.initializers.iter().map(|tensor| tensor.name.as_str()).collect();
        if constants.len() != graph.initializers.len() {
            return Err(ModelError::Malformed("two of its tensors have the same name".into()));
        }
        // Before version 4 of the format, constants were also inputs.
        graph.inputs.retain(|input| !constants.contains(input.name.as_str()));
        for info in graph.inputs.iter_mut().chain(&mut graph.outputs) {
            if info.element.is_float() {
                info.element = Element::F32;
            }
        }
        Ok(graph)
    }

    fn node(&mut self, mut node: Node, depth: usize, into: &mut Vec<Node>) -> Result<(), ModelError> {
        self.nodes += 1;
        if self.nodes > MAX_NODES {
            return Err(ModelError::TooLarge(format!("it has more than {MAX_NODES} nodes")));
        }
        if depth > MAX_NESTING {
            return Err(ModelError::TooLarge(format!("function calls are nested more than {MAX_NESTING} deep")));
        }
        let key = (standard(&node.domain), node.op.as_str(), node.overload.as_str());
        if let Some(&function) = self.functions.get(&key) {
            for inner in self.called(function, &node)? {
                self.node(inner, depth + 1, into)?;
            }
            return Ok(());
        }
        for attribute in &mut node.attributes {
            match &mut attribute.value {
                AttributeValue::Graph(graph) => *graph = self.graph(std::mem::take(graph), depth + 1)?,
                AttributeValue::Int(to) if node.op == "Cast" && attribute.name == "to" && element(*to).is_float() => {
                    *to = i64::from(Element::F32.0);
                }
                _ => {}
            }
        }
        if node.is_standard() {
            node.domain.clear();
        }
        into.push(node);
        Ok(())
    }

    /// Nodes of a function, with the names and attributes of a call.
    fn called(&mut self, function: &Function, call: &Node) -> Result<Vec<Node>, ModelError> {
        self.calls += 1;
        if call.inputs.len() > function.inputs.len() || call.outputs.len() > function.outputs.len() {
            return Err(ModelError::Malformed(format!("{} is called with too many inputs or outputs", call.label())));
        }
        let prefix = format!("{}#{}/", function.name, self.calls);
        let mut names: HashMap<&str, String> = HashMap::new();
        let given = call.inputs.iter().map(String::as_str).chain(std::iter::repeat(""));
        names.extend(function.inputs.iter().map(String::as_str).zip(given.map(str::to_owned)));
        let mut nodes = Vec::new();
        for (own, outer) in function.outputs.iter().zip(&call.outputs) {
            if outer.is_empty() {
                continue;
            }
            match names.get(own.as_str()) {
                Some(passed) => nodes.push(Node::new("Identity", &[passed.as_str()], outer)),
                None => _ = names.insert(own, outer.clone()),
            }
        }
        let rename = |name: &str| names.get(name).cloned().unwrap_or_else(|| format!("{prefix}{name}"));
        for node in &function.nodes {
            let mut node = renamed_node(node.clone(), &rename);
            node.attributes = resolved(std::mem::take(&mut node.attributes), call, function);
            nodes.push(node);
        }
        Ok(nodes)
    }
}

fn element(to: i64) -> Element {
    Element(i32::try_from(to).unwrap_or_default())
}

/// Attributes of a function's node, with references replaced by the call's or the default value. References without a
/// value are omitted.
fn resolved(attributes: Vec<Attribute>, call: &Node, function: &Function) -> Vec<Attribute> {
    let resolve = |mut attribute: Attribute| {
        if attribute.reference.is_empty() {
            if let AttributeValue::Graph(graph) = &mut attribute.value {
                for node in &mut graph.nodes {
                    node.attributes = resolved(std::mem::take(&mut node.attributes), call, function);
                }
            }
            return Some(attribute);
        }
        let named = |of: &[Attribute]| {
            of.iter().find(|given| given.name == attribute.reference).map(|given| given.value.clone())
        };
        let value = named(&call.attributes).or_else(|| named(&function.defaults))?;
        Some(Attribute { name: attribute.name, value, reference: String::new() })
    };
    attributes.into_iter().filter_map(resolve).collect()
}

fn renamed(mut graph: Graph, rename: &dyn Fn(&str) -> String) -> Graph {
    graph.nodes = graph.nodes.into_iter().map(|node| renamed_node(node, rename)).collect();
    graph.initializers.iter_mut().for_each(|tensor| tensor.name = rename(&tensor.name));
    graph.inputs.iter_mut().chain(&mut graph.outputs).for_each(|info| info.name = rename(&info.name));
    graph
}

fn renamed_node(mut node: Node, rename: &dyn Fn(&str) -> String) -> Node {
    for name in node.inputs.iter_mut().chain(&mut node.outputs).filter(|name| !name.is_empty()) {
        *name = rename(name);
    }
    for attribute in &mut node.attributes {
        if let AttributeValue::Graph(graph) = &mut attribute.value {
            *graph = renamed(std::mem::take(graph), rename);
        }
    }
    node
}

/// The tensor of a `Constant` node.
fn constant(node: Node) -> Result<Tensor, ModelError> {
    let unsupported = ModelError::Unsupported(format!("{} has no tensor of numbers", node.label()));
    let [name] = &node.outputs[..] else { return Err(unsupported) };
    let name = name.clone();
    let words = |values: &[i64]| Data::Bytes(values.iter().flat_map(|value| value.to_le_bytes()).collect());
    let Some(Attribute { value, .. }) =
        node.attributes.into_iter().find(|attribute| attribute.name.starts_with("value"))
    else {
        return Err(unsupported);
    };
    Ok(match value {
        AttributeValue::Tensor(tensor) => Tensor { name, ..tensor },
        AttributeValue::Float(value) => Tensor::floats(name, Vec::new(), &[value]),
        AttributeValue::Floats(values) => Tensor::floats(name, vec![values.len()], &values),
        AttributeValue::Int(value) => Tensor { name, dims: Vec::new(), element: Element::I64, data: words(&[value]) },
        AttributeValue::Ints(values) => {
            Tensor { name, dims: vec![values.len()], element: Element::I64, data: words(&values) }
        }
        _ => return Err(unsupported),
    })
}
