//! What is known of a graph's values before the run, and access to it for the inputs of a node.

use crate::onnx::Node;

/// Values of a small tensor that are known before the run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Known {
    Ints(Vec<i32>),
    Floats(Vec<f32>),
}

/// What is known of a value before the run.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fact {
    pub dims: Vec<usize>,
    pub known: Option<Known>,
    /// Whether it depends on no input.
    pub constant: bool,
}

/// A node's inputs, asked for by their place.
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
        self.get(index).map(|fact| fact.dims.as_slice()).ok_or_else(|| format!("lacks its input {index}"))
    }

    /// Values of an input that must be known.
    pub fn numbers(&self, index: usize) -> Result<Vec<f64>, String> {
        let fact = self.get(index).ok_or_else(|| format!("lacks its input {index}"))?;
        match &fact.known {
            Some(Known::Ints(values)) => Ok(values.iter().map(|&value| f64::from(value)).collect()),
            Some(Known::Floats(values)) => Ok(values.iter().map(|&value| f64::from(value)).collect()),
            None => Err(format!("makes sizes of the values of its input {index}, which are not known before the run")),
        }
    }

    pub fn int_list(&self, index: usize) -> Result<Vec<i64>, String> {
        Ok(self.numbers(index)?.into_iter().map(|value| value as i64).collect())
    }

    pub fn size_list(&self, index: usize) -> Result<Vec<usize>, String> {
        self.int_list(index)?.into_iter().map(|value| self.size(Some(value), "a size")).collect()
    }

    /// An integer that must be a size.
    pub fn size(&self, value: Option<i64>, name: &str) -> Result<usize, String> {
        let value = value.ok_or_else(|| format!("lacks {name}"))?;
        usize::try_from(value).map_err(|_| format!("has {name} of {value}"))
    }

    pub fn axis(&self, axis: i64, rank: usize) -> Result<usize, String> {
        let inner = if axis < 0 { axis + rank as i64 } else { axis };
        let inner = usize::try_from(inner).ok().filter(|&inner| inner < rank);
        inner.ok_or_else(|| format!("takes axis {axis} of {rank}"))
    }

    /// Between two axes, or at the ends.
    pub fn edge(&self, axis: i64, rank: usize) -> Result<usize, String> {
        let inner = if axis < 0 { axis + rank as i64 } else { axis };
        let inner = usize::try_from(inner).ok().filter(|&inner| inner <= rank);
        inner.ok_or_else(|| format!("takes axis {axis} of {rank}"))
    }

    /// Axes, an attribute in older files and an input in newer ones.
    pub fn axes(&self, index: usize) -> Result<Option<Vec<i64>>, String> {
        if let Some(axes) = self.node.ints("axes") {
            return Ok(Some(axes.to_vec()));
        }
        self.get(index).map(|_| self.int_list(index)).transpose()
    }
}
