//! ONNX files: read within limits, simplified, and written for the runtime.
//!
//! A simplified graph has no functions, no `Constant` nodes, no half or double precision, and large tensors only in
//! [`Weights`].

mod read;
mod simplify;
mod weights;
mod wire;
mod write;

pub(crate) use read::read_model;
pub(crate) use simplify::{inlined_branch, simplify};
pub(crate) use weights::{WEIGHTS_FILE, Weights};
pub(crate) use write::write_model;

/// Most nodes of a graph, with functions and branches inlined.
pub(crate) const MAX_NODES: usize = 50_000;

/// Most bytes of memory for a file's content without its tensors' values.
pub(crate) const MAX_STRUCTURE_BYTES: u64 = 64 << 20;

/// Most bytes of memory for the values of all tensors.
pub(crate) const MAX_WEIGHT_BYTES: u64 = 3 << 29;

/// Most tensors of a graph. A network of 300 million parameters has a few thousand.
pub(crate) const MAX_TENSORS: usize = 20_000;

/// Most elements along one axis. The runtime counts in 32 bits.
pub(crate) const MAX_DIM: usize = i32::MAX as usize;

/// Deepest nesting of functions or branches.
pub(crate) const MAX_NESTING: usize = 8;

/// Most axes of a tensor.
pub(crate) const MAX_RANK: usize = 10;

/// Element type, by its number in ONNX.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Element(pub i32);

impl Element {
    pub const F32: Self = Self(1);
    pub const U8: Self = Self(2);
    pub const I8: Self = Self(3);
    pub const I32: Self = Self(6);
    pub const I64: Self = Self(7);
    pub const BOOL: Self = Self(9);
    pub const F16: Self = Self(10);
    pub const F64: Self = Self(11);
    pub const BF16: Self = Self(16);

    /// Bytes of an element; `None` for unsupported types.
    pub const fn bytes(self) -> Option<usize> {
        match self {
            Self::U8 | Self::I8 | Self::BOOL => Some(1),
            Self::F16 | Self::BF16 => Some(2),
            Self::F32 | Self::I32 => Some(4),
            Self::F64 | Self::I64 => Some(8),
            _ => None,
        }
    }

    /// Whether the runtime computes the type in single precision.
    pub const fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F16 | Self::F64 | Self::BF16)
    }

    /// Name in ONNX, in lower case.
    pub fn name(self) -> String {
        const NAMES: [&str; 25] = [
            "undefined",
            "float32",
            "uint8",
            "int8",
            "uint16",
            "int16",
            "int32",
            "int64",
            "string",
            "bool",
            "float16",
            "float64",
            "uint32",
            "uint64",
            "complex64",
            "complex128",
            "bfloat16",
            "float8e4m3fn",
            "float8e4m3fnuz",
            "float8e5m2",
            "float8e5m2fnuz",
            "uint4",
            "int4",
            "float4e2m1",
            "float8e8m0",
        ];
        let name = usize::try_from(self.0).ok().and_then(|index| NAMES.get(index));
        name.map_or_else(|| format!("type {}", self.0), |name| (*name).to_owned())
    }
}

/// Content of a file.
#[derive(Debug, Default)]
pub(crate) struct Model {
    /// Domain (empty: the standard's) and version of the operators.
    pub opsets: Vec<(String, i64)>,
    pub graph: Graph,
    pub functions: Vec<Function>,
}

impl Model {
    /// Version of the standard's operators.
    pub fn opset(&self) -> i64 {
        self.opsets
            .iter()
            .find(|(domain, _)| matches!(domain.as_str(), "" | "ai.onnx"))
            .map_or(0, |&(_, version)| version)
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Graph {
    pub nodes: Vec<Node>,
    pub initializers: Vec<Tensor>,
    pub inputs: Vec<ValueInfo>,
    pub outputs: Vec<ValueInfo>,
}

impl Graph {
    /// Inputs and outputs with their types and sizes, one a line, at most 40.
    pub fn signature(&self) -> String {
        let line = |what: &str, info: &ValueInfo| {
            format!("  {what:<6} {}  {} {}", crate::error::short(&info.name), info.element.name(), info.dims_text())
        };
        let inputs = self.inputs.iter().map(|info| line("input", info));
        let outputs = self.outputs.iter().map(|info| line("output", info));
        inputs.chain(outputs).take(40).collect::<Vec<_>>().join("\n")
    }
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Function {
    pub name: String,
    pub domain: String,
    pub overload: String,
    pub inputs: Vec<String>,
    pub outputs: Vec<String>,
    /// Attributes with default values.
    pub defaults: Vec<Attribute>,
    pub nodes: Vec<Node>,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Node {
    pub name: String,
    pub op: String,
    pub domain: String,
    pub overload: String,
    pub inputs: Vec<String>,
    pub outputs: Vec<String>,
    pub attributes: Vec<Attribute>,
}

impl Node {
    pub fn new(op: &str, inputs: &[&str], output: &str) -> Self {
        let inputs = inputs.iter().map(|&name| name.to_owned()).collect();
        Self { name: output.to_owned(), op: op.to_owned(), inputs, outputs: vec![output.to_owned()], ..Self::default() }
    }

    pub fn with(mut self, name: &str, value: AttributeValue) -> Self {
        self.attributes.push(Attribute { name: name.to_owned(), value, reference: String::new() });
        self
    }

    /// Whether the operator is in the standard's domain.
    pub fn is_standard(&self) -> bool {
        matches!(self.domain.as_str(), "" | "ai.onnx")
    }

    /// Operator and name, for messages.
    pub fn label(&self) -> String {
        let name = if self.name.is_empty() { self.outputs.first().map_or("", String::as_str) } else { &self.name };
        let name: String = name.chars().take(80).filter(|c| !c.is_control()).collect();
        format!("{} \"{name}\"", self.op.chars().take(40).filter(|c| !c.is_control()).collect::<String>())
    }

    pub fn value(&self, name: &str) -> Option<&AttributeValue> {
        self.attributes.iter().find(|attribute| attribute.name == name).map(|attribute| &attribute.value)
    }

    pub fn int(&self, name: &str) -> Option<i64> {
        match self.value(name) {
            Some(AttributeValue::Int(value)) => Some(*value),
            _ => None,
        }
    }

    pub fn float(&self, name: &str) -> Option<f32> {
        match self.value(name) {
            Some(AttributeValue::Float(value)) => Some(*value),
            _ => None,
        }
    }

    pub fn ints(&self, name: &str) -> Option<&[i64]> {
        match self.value(name) {
            Some(AttributeValue::Ints(values)) => Some(values),
            _ => None,
        }
    }

    pub fn text(&self, name: &str) -> Option<&str> {
        match self.value(name) {
            Some(AttributeValue::Text(value)) => Some(value),
            _ => None,
        }
    }
}

#[derive(Clone, Debug)]
pub(crate) struct Attribute {
    pub name: String,
    pub value: AttributeValue,
    /// In a function: name of the call's attribute with the value.
    pub reference: String,
}

#[derive(Clone, Debug)]
pub(crate) enum AttributeValue {
    None,
    Float(f32),
    Int(i64),
    Text(String),
    Tensor(Tensor),
    Graph(Graph),
    Floats(Vec<f32>),
    Ints(Vec<i64>),
    Texts(Vec<String>),
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Tensor {
    pub name: String,
    pub dims: Vec<usize>,
    pub element: Element,
    pub data: Data,
}

impl Tensor {
    /// Number of elements; `None` if it overflows.
    pub fn len(&self) -> Option<usize> {
        product(&self.dims)
    }

    pub fn floats(name: String, dims: Vec<usize>, values: &[f32]) -> Self {
        let data = Data::Bytes(values.iter().flat_map(|value| value.to_le_bytes()).collect());
        Self { name, dims, element: Element::F32, data }
    }

    pub fn ints(name: String, dims: Vec<usize>, values: &[i32]) -> Self {
        let data = Data::Bytes(values.iter().flat_map(|value| value.to_le_bytes()).collect());
        Self { name, dims, element: Element::I32, data }
    }
}

/// Location of a tensor's values, little-endian.
#[derive(Clone, Debug)]
pub(crate) enum Data {
    Bytes(Vec<u8>),
    /// In the model's own file.
    File {
        start: u64,
        bytes: u64,
    },
    /// In an external file.
    External {
        file: String,
        start: u64,
        bytes: Option<u64>,
    },
    /// In [`Weights`].
    Weights {
        start: usize,
        bytes: usize,
    },
}

impl Default for Data {
    fn default() -> Self {
        Self::Bytes(Vec::new())
    }
}

/// A graph's input or output.
#[derive(Clone, Debug, Default)]
pub(crate) struct ValueInfo {
    pub name: String,
    pub element: Element,
    /// `None` if the file does not give them.
    pub dims: Option<Vec<Dim>>,
}

impl ValueInfo {
    fn dims_text(&self) -> String {
        let Some(dims) = &self.dims else { return "of any shape".to_owned() };
        let dim = |dim: &Dim| match dim {
            Dim::Fixed(size) => size.to_string(),
            Dim::Free(name) if name.is_empty() => "?".to_owned(),
            Dim::Free(name) => crate::error::short(name),
        };
        format!("[{}]", dims.iter().map(dim).collect::<Vec<_>>().join(", "))
    }
}

#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Dim {
    Fixed(usize),
    /// Depends on the input; the name may be empty.
    Free(String),
}

/// Product of sizes; `None` if it overflows.
pub(crate) fn product(dims: &[usize]) -> Option<usize> {
    dims.iter().try_fold(1usize, |product, &dim| product.checked_mul(dim))
}
