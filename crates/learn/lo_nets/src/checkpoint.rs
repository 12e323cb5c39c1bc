//! Weights and all that training needs to go on, in one `.safetensors` file.

use std::collections::BTreeMap;

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Tensor, TensorData};

use crate::adam::{Adam, Moments, floats};
use crate::names::Path;

mod file;

pub use file::FORMAT_VERSION;

/// Tensors by name, and a state in JSON: schedule, random numbers, position in the data.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Checkpoint {
    tensors: BTreeMap<String, HostTensor>,
    /// What is neither weights nor moments.
    pub state: serde_json::Value,
}

#[derive(Clone, Debug, PartialEq)]
struct HostTensor {
    shape: Vec<usize>,
    values: Vec<f32>,
}

/// How numbers are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits: to go on training.
    Full,
    /// 16 bits: to ship. Values beyond ±65,504 become infinite; no weight of a sound network is near.
    Half,
}

/// Why a checkpoint cannot be read, written or used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("{path}: {source}")]
    File {
        /// Which file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no `.safetensors` file, or holds what a checkpoint does not.
    #[error("{path}: {reason}")]
    Content {
        /// Which file.
        path: String,
        /// What is wrong.
        reason: String,
    },
    /// The weights are not those of the network.
    #[error("the weights of \"{module}\" do not fit: {}", .problems.join("; "))]
    Weights {
        /// Under which name they were looked for.
        module: String,
        /// What is missing, of another shape or too much.
        problems: Vec<String>,
    },
}

impl Checkpoint {
    /// Adds a module's parameters and running statistics under a name.
    pub fn add_module<M: Module>(&mut self, name: &str, module: &M) {
        // Without gradients: burn's batch normalisation keeps the last update of its running statistics aside until then.
        module.valid().visit(&mut Collect { tensors: &mut self.tensors, path: Path::of(name) });
    }

    /// Adds an optimiser's moments and number of steps under a name, which no module has.
    pub fn add_adam(&mut self, name: &str, adam: &Adam) {
        // Exact in two parts, however many.
        let steps = vec![(adam.steps >> 16) as f32, (adam.steps & 0xffff) as f32];
        self.tensors.insert(format!("{name}.steps"), HostTensor { shape: vec![2], values: steps });
        let betas = vec![adam.beta1, adam.beta2, adam.epsilon];
        self.tensors.insert(format!("{name}.constants"), HostTensor { shape: vec![3], values: betas });
        for (parameter, Moments { first, second }) in &adam.moments {
            for (kind, values) in [("first", first), ("second", second)] {
                let tensor = HostTensor { shape: vec![values.len()], values: values.clone() };
                self.tensors.insert(format!("{name}.{kind}.{parameter}"), tensor);
            }
        }
    }

    /// `module` with the values under a name, every one of which must be there with its shape and no others.
    ///
    /// # Errors
    /// Names what is missing, of another shape, or too much.
    pub fn load_module<M: Module>(&self, name: &str, module: M) -> Result<M, CheckpointError> {
        let prefix = format!("{name}.");
        let tensors = self.tensors.iter().filter(|(key, _)| key.starts_with(&prefix));
        let mut own =
            Self { tensors: tensors.map(|(key, tensor)| (key.clone(), tensor.clone())).collect(), ..Self::default() };
        let recording = is_recording(&module);
        let loaded = own.take_module(name, module.valid())?;
        Ok(if recording { loaded.train() } else { loaded })
    }

    /// [`Checkpoint::load_module`] without copies: the values are taken away, and `module` must have been made for this, since clones
    /// of it share running statistics.
    ///
    /// # Errors
    /// Names what is missing, of another shape, or too much.
    pub fn take_module<M: Module>(&mut self, name: &str, module: M) -> Result<M, CheckpointError> {
        let prefix = format!("{name}.");
        let (loaded, mut problems) = filled(module, |parameter| {
            let name = format!("{prefix}{parameter}");
            let tensor = self.tensors.remove(&name);
            (name, tensor)
        });
        let extra = self.tensors.keys().filter(|key| key.starts_with(&prefix));
        problems.extend(extra.map(|key| format!("\"{key}\" is not part of it")));
        checked(name, loaded, problems)
    }

    /// `module`, called `name` in messages, with the values whose names `renamed` makes of its own; what else there is does not
    /// matter.
    ///
    /// # Errors
    /// Names what is missing or of another shape.
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

    /// The optimiser that was added under a name.
    ///
    /// # Errors
    /// It is not there, or not whole.
    pub fn load_adam(&self, name: &str) -> Result<Adam, CheckpointError> {
        let wrong = |what: String| CheckpointError::Weights { module: name.to_owned(), problems: vec![what] };
        let get = |key: &str| {
            let key = format!("{name}.{key}");
            self.tensors
                .get(&key)
                .map(|tensor| &tensor.values[..])
                .ok_or_else(|| wrong(format!("\"{key}\" is missing")))
        };
        let (&[high, low], &[beta1, beta2, epsilon]) = (get("steps")?, get("constants")?) else {
            return Err(wrong("\"steps\" and \"constants\" have two and three values".to_owned()));
        };
        let mut adam = Adam { beta1, beta2, epsilon, steps: ((high as u64) << 16) + low as u64, ..Adam::default() };
        let prefix = format!("{name}.first.");
        for (key, first) in self.tensors.range(prefix.clone()..).take_while(|(key, _)| key.starts_with(&prefix)) {
            let parameter = &key[prefix.len()..];
            let second = get(&format!("second.{parameter}"))?.to_vec();
            if second.len() != first.values.len() {
                return Err(wrong(format!("the moments of \"{parameter}\" differ in length")));
            }
            adam.moments.insert(parameter.to_owned(), Moments { first: first.values.clone(), second });
        }
        Ok(adam)
    }

    /// Adds a tensor.
    ///
    /// # Panics
    /// Where there are not as many values as the shape says.
    pub fn insert(&mut self, name: &str, shape: &[usize], values: Vec<f32>) {
        assert_eq!(values.len(), shape.iter().product::<usize>(), "as many values as the shape says");
        self.tensors.insert(name.to_owned(), HostTensor { shape: shape.to_vec(), values });
    }

    /// Whether there is a tensor of this name.
    pub fn has(&self, name: &str) -> bool {
        self.tensors.contains_key(name)
    }

    /// Names and shapes of all tensors, by name.
    pub fn shapes(&self) -> impl Iterator<Item = (&str, &[usize])> {
        self.tensors.iter().map(|(name, tensor)| (&name[..], &tensor.shape[..]))
    }

    /// A tensor's values in row-major order.
    pub fn values(&self, name: &str) -> Option<&[f32]> {
        self.tensors.get(name).map(|tensor| &tensor.values[..])
    }

    /// How many values all tensors of a module have together.
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

/// `module` with the values that `get` has under a parameter's name, and what is wrong with them; `get` also gives the name for
/// messages.
fn filled<M: Module>(module: M, get: impl FnMut(&str) -> (String, Option<HostTensor>)) -> (M, Vec<String>) {
    let mut fill = Fill { get, problems: Vec::new(), path: Path::default() };
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

struct Collect<'a> {
    tensors: &'a mut BTreeMap<String, HostTensor>,
    path: Path,
}

impl ModuleVisitor for Collect<'_> {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, container: &str) {
        self.path.leave(container);
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = param.val();
        let shape = tensor.dims().to_vec();
        self.tensors.insert(self.path.name(), HostTensor { shape, values: floats(tensor.inner()) });
    }
}

struct Fill<F> {
    get: F,
    problems: Vec<String>,
    path: Path,
}

impl<F: FnMut(&str) -> (String, Option<HostTensor>)> ModuleMapper for Fill<F> {
    fn enter_module(&mut self, name: &str, container: &str) {
        self.path.enter(name, container);
    }

    fn exit_module(&mut self, _: &str, container: &str) {
        self.path.leave(container);
    }

    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (name, tensor) = (self.get)(&self.path.name());
        // Not its values, which might have to be drawn for that.
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use burn::tensor::Device;

    use super::*;
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
    fn a_killed_run_goes_on_to_the_bit() {
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
    fn what_does_not_fit_is_named() {
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
    }
}
