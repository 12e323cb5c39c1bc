use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::fs::File;
use std::io::{BufRead, BufReader, Seek};
use std::path::{Component, Path};

use half::{bf16, f16};
use lo_imaging::open_regular_file;

use super::wire::read_at;
use super::{AttributeValue, Data, Element, Graph, MAX_TENSORS, MAX_WEIGHT_BYTES, Tensor};
use crate::ModelError;

/// Name of the weights in a written graph. The runtime requires this extension.
pub(crate) const WEIGHTS_FILE: &str = "weights.data";

/// Tensors up to this many bytes stay in the graph, where their values are accessible.
const SMALL_BYTES: usize = 1 << 12;

/// Alignment of tensors in bytes.
const ALIGNMENT: usize = 16;

/// Number of bytes that are converted at a time.
const CHUNK: usize = 1 << 20;

/// Values of all large tensors of a graph, concatenated, little-endian.
pub(crate) struct Weights(pub Vec<u8>);

impl Weights {
    /// Reads values from the model's file and from external files, and stores their new location in the graph. Half and
    /// double precision become single.
    ///
    /// Allocates only what the files contain, and reads nothing outside of `folder`.
    ///
    /// # Errors
    /// Values that do not match their tensor, unsupported types, more than [`MAX_WEIGHT_BYTES`], external files that
    /// are missing or outside of the folder.
    pub fn gather<R: BufRead + Seek>(graph: &mut Graph, file: R, folder: Option<&Path>) -> Result<Self, ModelError> {
        let mut sources = Sources { file, folder, external: HashMap::new() };
        let mut tensors = Vec::new();
        tensors_of(graph, &mut tensors);
        if tensors.len() > MAX_TENSORS {
            return Err(ModelError::TooLarge(format!(
                "it has {} tensors, the limit is {}",
                tensors.len(),
                MAX_TENSORS
            )));
        }
        let mut total = 0usize;
        // Values that several tensors share are stored once.
        let mut starts: HashMap<(Option<String>, u64, u64, i32), usize> = HashMap::new();
        let mut plan = Vec::new();
        for (index, tensor) in tensors.iter_mut().enumerate() {
            let (stored, kept) = sizes(tensor)?;
            sources.check(tensor, stored as u64)?;
            if kept <= SMALL_BYTES {
                plan.push((index, stored, None));
                continue;
            }
            let key = match &tensor.data {
                Data::File { start, bytes } => Some((None, *start, *bytes, tensor.element.0)),
                Data::External { file, start, .. } => {
                    Some((Some(file.clone()), *start, stored as u64, tensor.element.0))
                }
                _ => None,
            };
            let known = key.as_ref().and_then(|key| starts.get(key)).copied();
            let start = known.unwrap_or(total);
            plan.push((index, stored, Some((start, kept, known.is_none()))));
            if known.is_none() {
                total += kept.next_multiple_of(ALIGNMENT);
                key.map(|key| starts.insert(key, start));
            }
            if total as u64 > MAX_WEIGHT_BYTES {
                let most = MAX_WEIGHT_BYTES as f64 / f64::from(1 << 30);
                return Err(ModelError::TooLarge(format!("its weights take more than {most} GiB in single precision")));
            }
        }
        let mut weights = vec![0; total];
        for (index, stored, place) in plan {
            let tensor = &mut *tensors[index];
            match place {
                None => {
                    let mut bytes = vec![0; sizes(tensor)?.1];
                    sources.fill(tensor, stored, &mut bytes)?;
                    tensor.data = Data::Bytes(bytes);
                }
                Some((start, kept, first)) => {
                    if first {
                        sources.fill(tensor, stored, &mut weights[start..start + kept])?;
                    }
                    tensor.data = Data::Weights { start, bytes: kept };
                }
            }
            if tensor.element.is_float() {
                tensor.element = Element::F32;
            }
        }
        Ok(Self(weights))
    }
}

/// Collects the tensors of a graph and of its branches.
fn tensors_of<'a>(graph: &'a mut Graph, into: &mut Vec<&'a mut Tensor>) {
    into.extend(&mut graph.initializers);
    for attribute in graph.nodes.iter_mut().flat_map(|node| &mut node.attributes) {
        match &mut attribute.value {
            AttributeValue::Tensor(tensor) => into.push(tensor),
            AttributeValue::Graph(graph) => tensors_of(graph, into),
            _ => {}
        }
    }
}

/// Bytes of a tensor's values in the file and in memory.
fn sizes(tensor: &Tensor) -> Result<(usize, usize), ModelError> {
    let named = || format!("the tensor \"{}\"", crate::error::short(&tensor.name));
    let too_large = || ModelError::TooLarge(format!("{} has the shape {:?}", named(), tensor.dims));
    let unsupported = || ModelError::Unsupported(format!("{} has the type {}", named(), tensor.element.name()));
    let length = tensor.len().ok_or_else(too_large)?;
    let stored = length.checked_mul(tensor.element.bytes().ok_or_else(unsupported)?).ok_or_else(too_large)?;
    let kept = if tensor.element.is_float() { length.checked_mul(4).ok_or_else(too_large)? } else { stored };
    let given = match &tensor.data {
        Data::Bytes(bytes) => bytes.len() as u64,
        Data::File { bytes, .. } => *bytes,
        Data::External { bytes, .. } => bytes.unwrap_or(stored as u64),
        Data::Weights { .. } => stored as u64,
    };
    if given != stored as u64 {
        return Err(ModelError::Malformed(format!(
            "{} has {given} bytes of values, its shape {:?} needs {stored}",
            named(),
            tensor.dims
        )));
    }
    Ok((stored, kept))
}

/// Files that values are read from.
struct Sources<'a, R> {
    file: R,
    folder: Option<&'a Path>,
    external: HashMap<String, (BufReader<File>, u64)>,
}

impl<R: BufRead + Seek> Sources<'_, R> {
    /// Checks that an external file contains a tensor's values.
    fn check(&mut self, tensor: &Tensor, stored: u64) -> Result<(), ModelError> {
        let Data::External { file, start, .. } = &tensor.data else { return Ok(()) };
        let refused = |why: &str| ModelError::External { file: crate::error::short(file), why: why.to_owned() };
        let open = match self.external.entry(file.clone()) {
            Entry::Occupied(open) => open.into_mut(),
            Entry::Vacant(place) => {
                let folder = self.folder.ok_or_else(|| refused("the model was not read from a folder"))?;
                place.insert(open_external(folder, file).map_err(|why| refused(&why))?)
            }
        };
        let end = start.checked_add(stored).ok_or_else(|| refused("the offset is invalid"))?;
        if end > open.1 {
            return Err(refused(&format!("it has {} bytes, the model needs {end}: is the download complete?", open.1)));
        }
        Ok(())
    }

    /// Fills `into` with a tensor's values, in the precision they have in memory.
    fn fill(&mut self, tensor: &Tensor, stored: usize, into: &mut [u8]) -> Result<(), ModelError> {
        let element = tensor.element;
        match &tensor.data {
            Data::Bytes(bytes) => {
                convert(element, bytes, into);
                Ok(())
            }
            Data::File { start, .. } => read_converted(&mut self.file, *start, stored, element, into),
            Data::External { file, start, .. } => {
                let (open, _) =
                    self.external.get_mut(file).ok_or_else(|| ModelError::Malformed("external data".into()))?;
                read_converted(open, *start, stored, element, into)
            }
            Data::Weights { .. } => Ok(()),
        }
    }
}

/// Opens a file in the model's folder or below it, and returns it with its length.
fn open_external(folder: &Path, name: &str) -> Result<(BufReader<File>, u64), String> {
    let path = Path::new(name);
    let inside = path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    if !inside || name.is_empty() {
        return Err("it is outside of the model's folder, so it is not read".to_owned());
    }
    let folder = folder.canonicalize().map_err(|e| e.to_string())?;
    let path = folder.join(path).canonicalize().map_err(|e| format!("{e}; it must be next to the model"))?;
    if !path.starts_with(&folder) {
        return Err("it links out of the model's folder, so it is not read".to_owned());
    }
    // Only the stated ranges of it are read, so its length is not limited.
    let (file, length) = open_regular_file(&path, u64::MAX).map_err(|e| e.to_string())?;
    Ok((BufReader::new(file), length))
}

fn read_converted<R: BufRead + Seek>(
    file: &mut R,
    start: u64,
    stored: usize,
    element: Element,
    into: &mut [u8],
) -> Result<(), ModelError> {
    if stored == into.len() && !matches!(element, Element::F64) {
        return read_at(file, start, into).map_err(ModelError::read);
    }
    let (from, to) = (element.bytes().unwrap_or(4), 4);
    let mut chunk = vec![0; CHUNK.min(stored)];
    for (index, part) in into.chunks_mut(CHUNK / from * to).enumerate() {
        let chunk = &mut chunk[..part.len() / to * from];
        read_at(file, start + (index * (CHUNK / from) * from) as u64, chunk).map_err(ModelError::read)?;
        convert(element, chunk, part);
    }
    Ok(())
}

fn convert(element: Element, from: &[u8], into: &mut [u8]) {
    let into_words = into.as_chunks_mut::<4>().0;
    match element {
        Element::F16 => {
            let values = from.as_chunks().0.iter().map(|&bytes| f16::from_le_bytes(bytes).to_f32());
            into_words.iter_mut().zip(values).for_each(|(word, value)| *word = value.to_le_bytes());
        }
        Element::BF16 => {
            let values = from.as_chunks().0.iter().map(|&bytes| bf16::from_le_bytes(bytes).to_f32());
            into_words.iter_mut().zip(values).for_each(|(word, value)| *word = value.to_le_bytes());
        }
        Element::F64 => {
            let values = from.as_chunks().0.iter().map(|&bytes| f64::from_le_bytes(bytes) as f32);
            into_words.iter_mut().zip(values).for_each(|(word, value)| *word = value.to_le_bytes());
        }
        _ => into.copy_from_slice(from),
    }
}
