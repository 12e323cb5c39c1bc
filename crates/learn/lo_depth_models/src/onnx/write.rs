//! Writes a simplified graph for the runtime.

use super::wire::Writer;
use super::{Attribute, AttributeValue, Data, Dim, Graph, Node, Tensor, ValueInfo, WEIGHTS_FILE};

/// Version of the format; constants need not be inputs from version 4 on.
const IR_VERSION: i64 = 8;

/// Bytes of a file whose large tensors are in [`super::Weights`].
pub(crate) fn write_model(graph: &Graph, opsets: &[(String, i64)]) -> Vec<u8> {
    let mut w = Writer::default();
    w.int(1, IR_VERSION);
    w.message(7, |w| write_graph(w, graph));
    for (domain, version) in opsets {
        w.message(8, |w| {
            w.bytes(1, domain.as_bytes());
            w.int(2, *version);
        });
    }
    w.0
}

fn write_graph(w: &mut Writer, graph: &Graph) {
    graph.nodes.iter().for_each(|node| w.message(1, |w| write_node(w, node)));
    graph.initializers.iter().for_each(|tensor| w.message(5, |w| write_tensor(w, tensor)));
    graph.inputs.iter().for_each(|info| w.message(11, |w| write_info(w, info)));
    graph.outputs.iter().for_each(|info| w.message(12, |w| write_info(w, info)));
}

fn write_node(w: &mut Writer, node: &Node) {
    node.inputs.iter().for_each(|name| w.bytes(1, name.as_bytes()));
    node.outputs.iter().for_each(|name| w.bytes(2, name.as_bytes()));
    w.bytes(3, node.name.as_bytes());
    w.bytes(4, node.op.as_bytes());
    node.attributes.iter().for_each(|attribute| w.message(5, |w| write_attribute(w, attribute)));
    w.bytes(7, node.domain.as_bytes());
}

fn write_attribute(w: &mut Writer, attribute: &Attribute) {
    w.bytes(1, attribute.name.as_bytes());
    let kind = match &attribute.value {
        AttributeValue::None => 0,
        AttributeValue::Float(value) => {
            w.float(2, *value);
            1
        }
        AttributeValue::Int(value) => {
            w.int(3, *value);
            2
        }
        AttributeValue::Text(value) => {
            w.bytes(4, value.as_bytes());
            3
        }
        AttributeValue::Tensor(value) => {
            w.message(5, |w| write_tensor(w, value));
            4
        }
        AttributeValue::Graph(value) => {
            w.message(6, |w| write_graph(w, value));
            5
        }
        AttributeValue::Floats(values) => {
            values.iter().for_each(|&value| w.float(7, value));
            6
        }
        AttributeValue::Ints(values) => {
            values.iter().for_each(|&value| w.int(8, value));
            7
        }
        AttributeValue::Texts(values) => {
            values.iter().for_each(|value| w.bytes(9, value.as_bytes()));
            8
        }
    };
    w.int(20, kind);
}

fn write_tensor(w: &mut Writer, tensor: &Tensor) {
    tensor.dims.iter().for_each(|&dim| w.int(1, dim as i64));
    w.int(2, i64::from(tensor.element.0));
    w.bytes(8, tensor.name.as_bytes());
    match &tensor.data {
        Data::Bytes(bytes) => w.bytes(9, bytes),
        Data::Weights { start, bytes } => {
            let entries =
                [("location", WEIGHTS_FILE.to_owned()), ("offset", start.to_string()), ("length", bytes.to_string())];
            for (key, value) in entries {
                w.message(13, |w| {
                    w.bytes(1, key.as_bytes());
                    w.bytes(2, value.as_bytes());
                });
            }
            w.int(14, 1);
        }
        Data::File { .. } | Data::External { .. } => unreachable!("weights are gathered before a graph is written"),
    }
}

fn write_info(w: &mut Writer, info: &ValueInfo) {
    w.bytes(1, info.name.as_bytes());
    w.message(2, |w| {
        w.message(1, |w| {
            w.int(1, i64::from(info.element.0));
            let Some(dims) = &info.dims else { return };
            w.message(2, |w| {
                for dim in dims {
                    w.message(1, |w| match dim {
                        Dim::Fixed(size) => w.int(1, *size as i64),
                        Dim::Free(name) => w.bytes(2, name.as_bytes()),
                    });
                }
            });
        });
    });
}
