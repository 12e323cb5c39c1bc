//! Checkpoints: weights, optimiser state and training state in one `.safetensors` file.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};

use crate::parameter_path::ParameterPath;

mod file;
#[cfg(feature = "training")]
mod optimiser;

pub use file::FORMAT_VERSION;

/// Tensors by name, and a JSON state: schedule, random numbers, position in the data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    tensors: BTreeMap<String, StoredTensor>,
    /// Everything but weights and moments.
    pub state: serde_json::Value,
}

#[derive(Clone, Debug, PartialEq)]
struct StoredTensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

/// Number format of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits, for resuming training.
    Full,
    /// 16 bits, for shipping. Values beyond ±65,504 become infinite; weights of a working network are far smaller.
    Half,
}

/// Error of reading, writing or using a checkpoint.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// Path of the file.
        path: String,
        /// Cause.
        source: std::io::Error,
    },
    /// The file is not a `.safetensors` file, or has unsupported content.
    #[error("{path}: {reason}")]
    Content {
        /// Path of the file.
        path: String,
        /// The problem.
        reason: String,
    },
    /// The weights do not match the network.
    #[error("the weights of \"{module}\" do not match the network: {}", .problems.join("; "))]
    Weights {
        /// Name of the module.
        module: String,
        /// Weights that are missing, surplus or of another shape.
        problems: Vec<String>,
    },
    /// Two parts of one checkpoint overlap.
    #[error("two parts of the weights have {what}")]
    Overlap {
        /// A tensor, or the state.
        what: String,
    },
}

impl Checkpoint {
    /// Joins the parts of one checkpoint. At most one of them has a state.
    ///
    /// # Errors
    /// [`CheckpointError::Overlap`] if two parts have the same tensor, or a state.
    pub fn joined(parts: impl IntoIterator<Item = Self>) -> Result<Self, CheckpointError> {
        let mut joined = Self::default();
        for mut part in parts {
            if let Some(name) = part.tensors.keys().find(|name| joined.has(name)) {
                return Err(CheckpointError::Overlap { what: format!("the tensor \"{name}\"") });
            }
            if !joined.state.is_null() && !part.state.is_null() {
                return Err(CheckpointError::Overlap { what: "a state".to_owned() });
            }
            joined.tensors.append(&mut part.tensors);
            if joined.state.is_null() {
                joined.state = part.state;
            }
        }
        Ok(joined)
    }

    /// Moves a module's tensors into a checkpoint without a state, the inverse of [`Checkpoint::joined`].
    pub fn split_off(&mut self, module: &str) -> Self {
        let is_own = |name: &String| name.strip_prefix(module).is_some_and(|rest| rest.starts_with('.'));
        Self { tensors: self.tensors.extract_if(.., |name, _| is_own(name)).collect(), ..Self::default() }
    }

    /// Adds a module's parameters and running statistics under a name.
    pub fn add_module<M: Module>(&mut self, name: &str, module: &M) {
        // `valid` applies the last update of the running statistics, which burn's batch normalisation defers until
        // then.
        module.valid().visit(&mut CollectParameters { tensors: &mut self.tensors, path: ParameterPath::root(name) });
    }

    /// Returns `module` with the values stored under `name`, which must match its parameters exactly.
    ///
    /// # Errors
    /// Names the values that are missing, surplus or of another shape.
    pub fn load_module<M: Module>(&self, name: &str, module: M) -> Result<M, CheckpointError> {
        let prefix = format!("{name}.");
        let tensors = self.tensors.iter().filter(|(key, _)| key.starts_with(&prefix));
        let mut own =
            Self { tensors: tensors.map(|(key, tensor)| (key.clone(), tensor.clone())).collect(), ..Self::default() };
        let recording = is_recording(&module);
        let loaded = own.take_module(name, module.valid())?;
        Ok(if recording { loaded.train() } else { loaded })
    }

    /// Loads a module as [`Checkpoint::load_module`] does, but moves the values out of the checkpoint.
    ///
    /// `module` must have been created for this call: clones of it share its running statistics.
    ///
    /// # Errors
    /// Names the values that are missing, surplus or of another shape.
    pub fn take_module<M: Module>(&mut self, name: &str, module: M) -> Result<M, CheckpointError> {
        let prefix = format!("{name}.");
        let (loaded, mut problems) = filled(module, |parameter| {
            let name = format!("{prefix}{parameter}");
            let tensor = self.tensors.remove(&name);
            (name, tensor)
        });
        let extra = self.tensors.keys().filter(|key| key.starts_with(&prefix));
        problems.extend(extra.map(|key| format!("\"{key}\" is not part of the network")));
        checked(name, loaded, problems)
    }

    /// Returns `module` with the values whose stored names are `renamed` of its parameters' names. Other stored values
    /// are ignored. Error messages use `name` for the module.
    ///
    /// # Errors
    /// Names the values that are missing or of another shape.
    pub fn load_renamed<M: Module>(
        &self,
        name: &str,
        module: M,
        mut renamed: impl FnMut(&str) -> String,
    ) -> Result<M, CheckpointError> {
        let recording = is_recording(&module);
        let (loaded, problems) = filled(module.valid(), |parameter| {
            let name = renamed(parameter);
            let tensor = self.tensors.get(&name).cloned();
            (name, tensor)
        });
        checked(name, if recording { loaded.train() } else { loaded }, problems)
    }

    /// Adds a tensor.
    ///
    /// # Panics
    /// Where the number of values does not match the shape.
    pub fn insert(&mut self, name: &str, shape: &[usize], values: Vec<f32>) {
        assert_eq!(values.len(), shape.iter().product::<usize>(), "values must match the shape");
        self.tensors.insert(name.to_owned(), StoredTensor { shape: shape.to_vec(), values });
    }

    /// Reports whether a tensor of this name exists.
    pub fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// Iterates over names and shapes of all tensors, sorted by name.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[usize])> {
        self.tensors.iter().map(|(name, tensor)| (&name[..], &tensor.shape[..]))
    }

    /// Returns a tensor's values in row-major order.
    pub fn values(&self, name: &str) -> Option<&[f32]> {
        self.tensors.get(name).map(|tensor| &tensor.values[..])
    }

    /// Counts the values of all tensors of a module.
    pub fn values_of(&self, module: &str) -> u64 {
        let own = self
            .tensors
            .range(format!("{module}.")..)
            .take_while(|(key, _)| key.strip_prefix(module).is_some_and(|rest| rest.starts_with('.')));
        own.map(|(_, tensor)| tensor.values.len() as u64).sum()
    }
}

fn is_recording<M: Module>(module: &M) -> bool {
    module.devices().iter().any(|device| device.is_autodiff())
}

/// Returns `module` with the values from `get`, and a list of problems. `get` maps a parameter's name to the stored
/// name and its tensor.
fn filled<M: Module>(module: M, get: impl FnMut(&str) -> (String, Option<StoredTensor>)) -> (M, Vec<String>) {
    let mut fill = FillParameters { get, problems: Vec::new(), path: ParameterPath::default() };
    let module = module.map(&mut fill);
    (module, fill.problems)
}

fn checked<M>(name: &str, module: M, problems: Vec<String>) -> Result<M, CheckpointError> {
    if problems.is_empty() {
        return Ok(module);
    }
    const SHOWN: usize = 8;
    let count = problems.len();
    let mut problems: Vec<String> = problems.into_iter().take(SHOWN).collect();
    if count > SHOWN {
        problems.push(format!("and {} more", count - SHOWN));
    }
    Err(CheckpointError::Weights { module: name.to_owned(), problems })
}

struct CollectParameters<'a> {
    tensors: &'a mut BTreeMap<String, StoredTensor>,
    path: ParameterPath,
}

impl ModuleVisitor for CollectParameters<'_> {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, container: &str) {
        self.path.leave(container);
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = param.val();
        let shape = tensor.dims().to_vec();
        self.tensors.insert(self.path.name(), StoredTensor { shape, values: floats(tensor.inner()) });
    }
}

struct FillParameters<F> {
    get: F,
    problems: Vec<String>,
    path: ParameterPath,
}

impl<F: FnMut(&str) -> (String, Option<StoredTensor>)> ModuleMapper for FillParameters<F> {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, container: &str) {
        self.path.leave(container);
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (name, tensor) = (self.get)(&self.path.name());
        // The lazy shape: reading the values would draw them first.
        let dims = param.lazy_shape().dims::<D>();
        match tensor {
            None => self.problems.push(format!("\"{name}\" is missing")),
            Some(tensor) if tensor.shape != dims => {
                self.problems.push(format!("\"{name}\" has the shape {:?}, not {dims:?}", tensor.shape));
            }
            Some(tensor) => {
                let value = Tensor::from_data(TensorData::new(tensor.values, dims), &param.lazy_device());
                let id = param.id;
                return param.transform_for_load(value, id);
            }
        }
        param
    }
}

/// Returns all values of a tensor.
pub(crate) fn floats<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().convert::<f32>().try_into_vec().expect("converted to f32 above")
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use burn::tensor::Device;

    use super::*;
    use crate::Adam;
    use crate::layers::{Head, Linear};

    fn head(hidden: usize, seed: u64) -> Head {
        let device = Device::flex().autodiff();
        Head::new([3, hidden], &[0.5, -0.5], 1, &mut lo_random::stream(seed, "test", 0), &device)
    }

    fn trained(mut net: Head, mut adam: Adam, steps: std::ops::Range<u64>) -> (Head, Adam) {
        for step in steps {
            let values = crate::testing::values(60, step as usize);
            let input = Tensor::from_data(TensorData::new(values, [20, 3]), &Device::flex().autodiff());
            let gradients = net.forward(input).square().mean().backward();
            net = adam.step(net, &gradients, 0.01);
        }
        (net, adam)
    }

    fn checkpoint(net: &Head, adam: &Adam) -> Checkpoint {
        let mut checkpoint = Checkpoint { state: serde_json::json!({ "step": 3 }), ..Checkpoint::default() };
        checkpoint.add_module("net", net);
        checkpoint.add_adam("adam", adam);
        checkpoint
    }

    #[test]
    fn resumed_training_is_bit_identical() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.safetensors");
        let (net, adam) = trained(head(4, 1), Adam::default(), 0..3);
        checkpoint(&net, &adam).write(&path, Precision::Full).unwrap();
        let straight = trained(net, adam, 3..6);
        let read = Checkpoint::read(&path).unwrap();
        assert_eq!(read.state["step"], 3);
        let resumed = trained(read.load_module("net", head(4, 2)).unwrap(), read.load_adam("adam").unwrap(), 3..6);
        assert_eq!(checkpoint(&straight.0, &straight.1), checkpoint(&resumed.0, &resumed.1));
    }

    #[test]
    fn half_precision_is_close() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("ship.safetensors");
        let whole = checkpoint(&head(4, 1), &Adam::default());
        whole.write(&path, Precision::Half).unwrap();
        let half = Checkpoint::read(&path).unwrap();
        for (name, tensor) in &whole.tensors {
            let close = |(a, b): (&f32, &f32)| (a - b).abs() <= 5e-4 * a.abs().max(1e-4);
            assert!(tensor.values.iter().zip(&half.tensors[name].values).all(close), "{name}");
        }
    }

    #[test]
    fn mismatched_weights_are_named() {
        let saved = checkpoint(&head(4, 1), &Adam::default());
        let error = saved.load_module("net", head(5, 1)).unwrap_err().to_string();
        assert!(error.contains("\"net.hidden.linear.weights\" has the shape [3, 4], not [3, 5]"), "{error}");
        let linear = Linear::new([3, 4], &mut lo_random::stream(1, "test", 0), &Device::flex());
        let error = saved.load_module("net", linear).unwrap_err().to_string();
        assert!(
            error.contains("\"net.weights\" is missing") && error.contains("\"net.output.bias\" is not part"),
            "{error}"
        );
        let error = saved.load_adam("none").unwrap_err().to_string();
        assert!(error.contains("\"none.steps\" is missing"), "{error}");
    }

    #[test]
    fn parts_are_joined_to_the_whole() {
        let whole = checkpoint(&head(4, 1), &Adam::default());
        let mut rest = whole.clone();
        let hidden = rest.split_off("net.hidden");
        assert!(hidden.shapes().all(|(name, _)| name.starts_with("net.hidden.")) && hidden.state.is_null());
        assert!(hidden.shapes().count() > 0 && !rest.shapes().any(|(name, _)| hidden.has(name)));
        assert_eq!(Checkpoint::joined([hidden.clone(), rest.clone()]).unwrap(), whole);

        let error = Checkpoint::joined([hidden.clone(), rest.clone(), hidden]).unwrap_err().to_string();
        assert!(error.starts_with("two parts of the weights have the tensor \"net.hidden."), "{error}");
        let other = Checkpoint { state: whole.state, ..Checkpoint::default() };
        assert_eq!(Checkpoint::joined([rest, other]).unwrap_err().to_string(), "two parts of the weights have a state");
    }

    #[test]
    fn damaged_files_are_errors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.safetensors");
        checkpoint(&head(4, 1), &Adam::default()).write(&path, Precision::Full).unwrap();
        let whole = std::fs::read(&path).unwrap();
        for length in [0, 7, 40, whole.len() / 2, whole.len() - 1] {
            std::fs::write(&path, &whole[..length]).unwrap();
            assert!(matches!(Checkpoint::read(&path), Err(CheckpointError::Content { .. })), "{length} bytes");
        }
        assert!(matches!(Checkpoint::read(folder.path().join("none")), Err(CheckpointError::File { .. })));
        #[cfg(unix)]
        assert!(Checkpoint::read("/dev/zero").unwrap_err().to_string().contains("only regular files are read"));
    }
}
