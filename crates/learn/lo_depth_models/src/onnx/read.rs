//! Reads the messages of `onnx.proto3` that define a network. Field numbers are the standard's.

use std::io::{BufRead, Seek, SeekFrom};

use super::wire::{Field, Reader, Wire};
use super::{
    Attribute, AttributeValue, Data, Dim, Element, Function, Graph, MAX_DIM, MAX_NESTING, MAX_RANK, Model, Node,
    Tensor, ValueInfo,
};
use crate::ModelError;

/// Raw values of at least this many bytes stay in the file until the graph is validated.
const LEFT_IN_FILE: u64 = 1 << 10;

/// Reads a file's graph and functions. Values of large tensors stay in the file.
pub(crate) fn read_model<R: BufRead + Seek>(mut file: R) -> Result<(Model, R), ModelError> {
    let end = file.seek(SeekFrom::End(0)).map_err(ModelError::read)?;
    file.seek(SeekFrom::Start(0)).map_err(ModelError::read)?;
    let mut reader = Reader::new(file);
    let r = &mut reader;
    let mut model = Model::default();
    let mut graphs = 0;
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            7 => {
                graphs += 1;
                model.graph = graph(r, nested(r, value, end)?, 0)?;
            }
            8 => model.opsets.push(opset(r, nested(r, value, end)?)?),
            25 => {
                let inner = nested(r, value, end)?;
                model.functions.push(function(r, inner)?);
            }
            _ => r.skip(value)?,
        }
    }
    if graphs != 1 || model.graph.outputs.is_empty() {
        return Err(ModelError::Malformed("it has no graph with outputs: it is not an ONNX file".into()));
    }
    Ok((model, reader.into_inner()))
}

fn nested<R: BufRead + Seek>(r: &Reader<R>, value: Wire, end: u64) -> Result<u64, ModelError> {
    match value {
        Wire::Length(length) => r.end_of(length, end),
        _ => Err(r.malformed("a message was expected")),
    }
}

fn opset<R: BufRead + Seek>(r: &mut Reader<R>, end: u64) -> Result<(String, i64), ModelError> {
    let (mut domain, mut version) = (String::new(), 0);
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => domain = r.text(value)?,
            2 => version = r.int(value)?,
            _ => r.skip(value)?,
        }
    }
    Ok((domain, version))
}

fn graph<R: BufRead + Seek>(r: &mut Reader<R>, end: u64, depth: usize) -> Result<Graph, ModelError> {
    if depth > MAX_NESTING {
        return Err(ModelError::TooLarge(format!("graphs are nested more than {MAX_NESTING} deep")));
    }
    let mut graph = Graph::default();
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => graph.nodes.push(node(r, nested(r, value, end)?, depth)?),
            5 => graph.initializers.push(tensor(r, nested(r, value, end)?)?),
            11 => graph.inputs.push(value_info(r, nested(r, value, end)?)?),
            12 => graph.outputs.push(value_info(r, nested(r, value, end)?)?),
            15 => return Err(ModelError::Unsupported("it has sparse tensors".into())),
            _ => r.skip(value)?,
        }
    }
    Ok(graph)
}

fn function<R: BufRead + Seek>(r: &mut Reader<R>, end: u64) -> Result<Function, ModelError> {
    let mut function = Function::default();
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => function.name = r.text(value)?,
            4 => function.inputs.push(r.text(value)?),
            5 => function.outputs.push(r.text(value)?),
            7 => function.nodes.push(node(r, nested(r, value, end)?, 0)?),
            10 => function.domain = r.text(value)?,
            11 => function.defaults.push(attribute(r, nested(r, value, end)?, 0)?),
            13 => function.overload = r.text(value)?,
            _ => r.skip(value)?,
        }
    }
    Ok(function)
}

fn node<R: BufRead + Seek>(r: &mut Reader<R>, end: u64, depth: usize) -> Result<Node, ModelError> {
    let mut node = Node::default();
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => node.inputs.push(r.text(value)?),
            2 => node.outputs.push(r.text(value)?),
            3 => node.name = r.text(value)?,
            4 => node.op = r.text(value)?,
            5 => node.attributes.push(attribute(r, nested(r, value, end)?, depth)?),
            7 => node.domain = r.text(value)?,
            8 => node.overload = r.text(value)?,
            _ => r.skip(value)?,
        }
    }
    Ok(node)
}

fn attribute<R: BufRead + Seek>(r: &mut Reader<R>, end: u64, depth: usize) -> Result<Attribute, ModelError> {
    let (mut name, mut reference, mut kind) = (String::new(), String::new(), 0);
    let (mut float, mut int, mut text) = (None, None, None);
    let (mut held_tensor, mut held_graph) = (None, None);
    let (mut floats, mut ints, mut texts) = (Vec::new(), Vec::new(), Vec::new());
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => name = r.text(value)?,
            2 => float = Some(r.float(value)?),
            3 => int = Some(r.int(value)?),
            4 => text = Some(r.text(value)?),
            5 => held_tensor = Some(tensor(r, nested(r, value, end)?)?),
            6 => held_graph = Some(graph(r, nested(r, value, end)?, depth + 1)?),
            7 => r.float_bytes(value, &mut floats)?,
            8 => r.ints(value, &mut ints)?,
            9 => texts.push(r.text(value)?),
            20 => kind = r.int(value)?,
            21 => reference = r.text(value)?,
            _ => r.skip(value)?,
        }
    }
    let floats: Vec<f32> = floats.as_chunks().0.iter().map(|&bytes| f32::from_le_bytes(bytes)).collect();
    // Old files have no kind. Files with a kind may omit values that are empty or zero.
    let value = match kind {
        1 => AttributeValue::Float(float.unwrap_or_default()),
        2 => AttributeValue::Int(int.unwrap_or_default()),
        3 => AttributeValue::Text(text.unwrap_or_default()),
        4 => held_tensor.map_or(AttributeValue::None, AttributeValue::Tensor),
        5 => held_graph.map_or(AttributeValue::None, AttributeValue::Graph),
        6 => AttributeValue::Floats(floats),
        7 => AttributeValue::Ints(ints),
        8 => AttributeValue::Texts(texts),
        0 => (float.map(AttributeValue::Float))
            .or(int.map(AttributeValue::Int))
            .or(text.map(AttributeValue::Text))
            .or(held_tensor.map(AttributeValue::Tensor))
            .or(held_graph.map(AttributeValue::Graph))
            .or((!floats.is_empty()).then_some(AttributeValue::Floats(floats)))
            .or((!ints.is_empty()).then_some(AttributeValue::Ints(ints)))
            .or((!texts.is_empty()).then_some(AttributeValue::Texts(texts)))
            .unwrap_or(AttributeValue::None),
        _ => AttributeValue::None,
    };
    Ok(Attribute { name, value, reference })
}

fn tensor<R: BufRead + Seek>(r: &mut Reader<R>, end: u64) -> Result<Tensor, ModelError> {
    let mut tensor = Tensor::default();
    let (mut dims, mut raw, mut floats, mut ints) = (Vec::new(), None, Vec::new(), Vec::new());
    let (mut external, mut location) = (Vec::new(), 0);
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => r.ints(value, &mut dims)?,
            2 => tensor.element = Element(r.int(value)? as i32),
            3 => return Err(ModelError::Unsupported("a tensor is split into segments".into())),
            4 | 10 => r.float_bytes(value, &mut floats)?,
            5 | 7 => r.ints(value, &mut ints)?,
            8 => tensor.name = r.text(value)?,
            9 => match value {
                Wire::Length(bytes) if bytes >= LEFT_IN_FILE => {
                    raw = Some(Data::File { start: r.position(), bytes });
                    r.skip(value)?;
                }
                _ => raw = Some(Data::Bytes(r.bytes(value)?)),
            },
            13 => external.push(entry(r, nested(r, value, end)?)?),
            14 => location = r.int(value)?,
            _ => r.skip(value)?,
        }
    }
    if dims.len() > MAX_RANK {
        return Err(ModelError::TooLarge(format!("a tensor has {} axes, the limit is {MAX_RANK}", dims.len())));
    }
    for dim in dims {
        let size = usize::try_from(dim).ok().filter(|&size| size <= MAX_DIM);
        tensor.dims.push(size.ok_or_else(|| r.malformed("the size of a tensor is invalid"))?);
    }
    tensor.data = match (location, raw) {
        (1, _) => {
            located(&external).ok_or_else(|| r.malformed("the location of external data is missing or invalid"))?
        }
        (_, Some(data)) => data,
        (_, None) if !floats.is_empty() => Data::Bytes(floats),
        (_, None) => Data::Bytes(narrowed(&ints, tensor.element)),
    };
    Ok(tensor)
}

/// Bytes of integers, which the standard stores in wider fields.
fn narrowed(ints: &[i64], element: Element) -> Vec<u8> {
    let bytes = element.bytes().unwrap_or(8);
    ints.iter().flat_map(|int| int.to_le_bytes().into_iter().take(bytes)).collect()
}

fn located(entries: &[(String, String)]) -> Option<Data> {
    let find = |key: &str| entries.iter().find(|(name, _)| name == key).map(|(_, value)| value);
    let number = |key: &str| find(key).map(|value| value.parse::<u64>());
    let start = number("offset").unwrap_or(Ok(0)).ok()?;
    let bytes = number("length").transpose().ok()?;
    Some(Data::External { file: find("location")?.clone(), start, bytes })
}

fn entry<R: BufRead + Seek>(r: &mut Reader<R>, end: u64) -> Result<(String, String), ModelError> {
    let (mut key, mut text) = (String::new(), String::new());
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => key = r.text(value)?,
            2 => text = r.text(value)?,
            _ => r.skip(value)?,
        }
    }
    Ok((key, text))
}

fn value_info<R: BufRead + Seek>(r: &mut Reader<R>, end: u64) -> Result<ValueInfo, ModelError> {
    let mut info = ValueInfo::default();
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => info.name = r.text(value)?,
            2 => {
                let end = nested(r, value, end)?;
                while let Some(Field { number, value }) = r.next(end)? {
                    match number {
                        1 => tensor_type(r, nested(r, value, end)?, &mut info)?,
                        _ => r.skip(value)?,
                    }
                }
            }
            _ => r.skip(value)?,
        }
    }
    Ok(info)
}

fn tensor_type<R: BufRead + Seek>(r: &mut Reader<R>, end: u64, info: &mut ValueInfo) -> Result<(), ModelError> {
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            1 => info.element = Element(r.int(value)? as i32),
            2 => {
                let end = nested(r, value, end)?;
                let mut dims = Vec::new();
                while let Some(Field { number, value }) = r.next(end)? {
                    match number {
                        1 => dims.push(dim(r, nested(r, value, end)?)?),
                        _ => r.skip(value)?,
                    }
                }
                info.dims = Some(dims);
            }
            _ => r.skip(value)?,
        }
    }
    Ok(())
}

fn dim<R: BufRead + Seek>(r: &mut Reader<R>, end: u64) -> Result<Dim, ModelError> {
    let mut dim = Dim::Free(String::new());
    while let Some(Field { number, value }) = r.next(end)? {
        match number {
            // Some exporters write −1 for a free size.
            1 => dim = usize::try_from(r.int(value)?).map_or_else(|_| Dim::Free(String::new()), Dim::Fixed),
            2 => dim = Dim::Free(r.text(value)?),
            _ => r.skip(value)?,
        }
    }
    Ok(dim)
}
