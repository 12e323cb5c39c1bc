//! Sizes and values of a graph that are known before the run, and access to those of a node's inputs.

use crate::onnx::Node;

/// Values of a small tensor, known before the run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Known {
    Ints(Vec<i32>),
    Floats(Vec<f32>),
}

/// Properties of a tensor, known before the run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fact {
    pub dims: Vec<usize>,
    pub known: Option<Known>,
    /// Whether it is independent of the photo.
    pub constant: bool,
}

/// A node's inputs by their index.
pub(crate) struct Inputs<'a> {
    pub node: &'a Node,
    pub inputs: &'a [Option<&'a Fact>],
    pub opset: i64,
}

impl<'a> Inputs<'a> {
    pub fn get(&self, index: usize) -> Option<&'a Fact> {
        self.inputs.get(index).copied().flatten()
    }

    pub fn dims(&self, index: usize) -> Result<&'a [usize], String> {
        self.get(index).map(|fact| fact.dims.as_slice()).ok_or_else(|| format!("input {index} is missing"))
    }

    /// Values of an input.
    ///
    /// # Errors
    /// Values that are not known before the run.
    pub fn numbers(&self, index: usize) -> Result<Vec<f64>, String> {
        let fact = self.get(index).ok_or_else(|| format!("input {index} is missing"))?;
        match &fact.known {
            Some(Known::Ints(values)) => Ok(values.iter().map(|&value| f64::from(value)).collect()),
            Some(Known::Floats(values)) => Ok(values.iter().map(|&value| f64::from(value)).collect()),
            None => Err(format!("sizes depend on the values of input {index}, which are not known before the run")),
        }
    }

    pub fn int_list(&self, index: usize) -> Result<Vec<i64>, String> {
        Ok(self.numbers(index)?.into_iter().map(|value| value as i64).collect())
    }

    pub fn size_list(&self, index: usize) -> Result<Vec<usize>, String> {
        self.int_list(index)?.into_iter().map(|value| self.size(Some(value), "size")).collect()
    }

    /// Converts an integer to a size. `name` is for the message.
    pub fn size(&self, value: Option<i64>, name: &str) -> Result<usize, String> {
        let value = value.ok_or_else(|| format!("{name} is missing"))?;
        usize::try_from(value).map_err(|_| format!("{name} is {value}"))
    }

    pub fn axis(&self, axis: i64, rank: usize) -> Result<usize, String> {
        let inner = if axis < 0 { axis + rank as i64 } else { axis };
        let inner = usize::try_from(inner).ok().filter(|&inner| inner < rank);
        inner.ok_or_else(|| format!("axis {axis} is out of range for {rank} axes"))
    }

    /// A position between two axes, or at either end.
    pub fn edge(&self, axis: i64, rank: usize) -> Result<usize, String> {
        let inner = if axis < 0 { axis + rank as i64 } else { axis };
        let inner = usize::try_from(inner).ok().filter(|&inner| inner <= rank);
        inner.ok_or_else(|| format!("axis {axis} is out of range for {rank} axes"))
    }

    /// The axes: an attribute in older files, an input in newer ones.
    pub fn axes(&self, index: usize) -> Result<Option<Vec<i64>>, String> {
        if let Some(axes) = self.node.ints("axes") {
            return Ok(Some(axes.to_vec()));
        }
        self.get(index).map(|_| self.int_list(index)).transpose()
    }
}
