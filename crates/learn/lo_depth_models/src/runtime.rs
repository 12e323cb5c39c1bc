//! A small interface to rten: loads a graph, runs it on arrays and returns arrays.
//!
//! [`crate::plan`] limits memory and work of a graph before it gets here. rten has some 60,000 lines and does not aim
//! at hostile files, so a panic in it is caught here and becomes an error, as for third-party image decoders.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::mpsc::{Sender, channel};

use rten::{DataType, Model, ModelOptions, RunOptions, ShapeInferenceMode, ThreadPool, Value, ValueOrView, ValueType};
use rten_tensor::prelude::*;
use rten_tensor::{Tensor, TensorView};

use crate::ModelError;
use crate::facts::Known;
use crate::onnx::{Dim, Element, Graph, Node, ValueInfo, WEIGHTS_FILE, Weights, product, write_model};
use crate::plan::Values;

/// Stack for rten, which orders nodes recursively. [`crate::plan`] limits the depth.
const STACK_BYTES: usize = 64 << 20;

/// Loads and evaluates graphs that share weights.
///
/// Works on its own thread, which has the stack for rten's recursion and rten's table of operators, which is not
/// `Send`.
pub(crate) struct Runtime {
    jobs: Sender<Job>,
    opsets: Vec<(String, i64)>,
    weight_bytes: u64,
}

type Job = Box<dyn FnOnce(&ModelOptions) + Send>;

/// A graph that is ready to run.
pub(crate) struct Loaded {
    model: Model,
}

/// An array in single precision.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    pub dims: Vec<usize>,
    pub values: Vec<f32>,
}

impl Runtime {
    /// Takes the weights and starts the thread.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn new(weights: Weights, opsets: Vec<(String, i64)>) -> Result<Self, ModelError> {
        let weight_bytes = weights.0.len() as u64;
        let (jobs, queue) = channel::<Job>();
        let work = move || {
            let mut options = ModelOptions::with_all_ops();
            options.external_data(WEIGHTS_FILE, weights.0);
            queue.into_iter().for_each(|job| job(&options));
        };
        let builder = std::thread::Builder::new().name("depth model".to_owned()).stack_size(STACK_BYTES);
        builder.spawn(work).map_err(|error| ModelError::Run(error.to_string()))?;
        Ok(Self { jobs, opsets, weight_bytes })
    }

    /// Runs a closure on the runtime's thread and waits for its result.
    fn on_thread<T: Send + 'static>(
        &self,
        work: impl FnOnce(&ModelOptions) -> T + Send + 'static,
    ) -> Result<T, ModelError> {
        let (answer, answers) = channel();
        let job = move |options: &ModelOptions| {
            // The caller waits for the answer, so sending cannot fail.
            _ = answer.send(catching_panics(|| work(options)));
        };
        let gone = || ModelError::Run("the runtime's thread has ended".to_owned());
        self.jobs.send(Box::new(job)).map_err(|_| gone())?;
        answers.recv().map_err(|_| gone())?
    }

    pub fn weight_bytes(&self) -> u64 {
        self.weight_bytes
    }

    /// Loads a graph and optimises it.
    pub fn load(&self, graph: &Graph) -> Result<Loaded, ModelError> {
        let bytes = write_model(graph, &self.opsets);
        let model = self.on_thread(move |options| options.load(bytes).map_err(|error| one_line(&error.to_string())))?;
        Ok(Loaded { model: model.map_err(ModelError::Unsupported)? })
    }

    /// Computes one node from known values; `None` if an output is neither `i32` nor `f32`.
    pub fn evaluate(&self, node: &Node, given: &[(String, Vec<usize>, Known)]) -> Result<Option<Values>, ModelError> {
        let refused = |why: String| ModelError::Node { node: node.label(), why: one_line(&why) };
        let info =
            |name: &str, element: Element, dims: Option<Vec<Dim>>| ValueInfo { name: name.to_owned(), element, dims };
        let mut inputs: Vec<ValueInfo> = Vec::new();
        for (name, dims, known) in given {
            let element = if matches!(known, Known::Ints(_)) { Element::I32 } else { Element::F32 };
            if inputs.iter().all(|input| input.name != *name) {
                inputs.push(info(name, element, Some(dims.iter().map(|&dim| Dim::Fixed(dim)).collect())));
            }
        }
        let names: Vec<&str> = node.outputs.iter().map(String::as_str).filter(|name| !name.is_empty()).collect();
        let outputs = names.iter().map(|name| info(name, Element::default(), None)).collect();
        let graph = Graph { nodes: vec![node.clone()], initializers: Vec::new(), inputs, outputs };
        let bytes = write_model(&graph, &self.opsets);
        let (names, given): (Vec<String>, Vec<_>) = (names.into_iter().map(str::to_owned).collect(), given.to_vec());
        let values = self.on_thread(move |options| -> Result<Vec<Value>, String> {
            let mut options = options.clone();
            options.enable_optimization(false).shape_inference(ShapeInferenceMode::Off);
            let model = options.load(bytes).map_err(|error| error.to_string())?;
            let id = |name: &str| model.node_id(name).map_err(|error| error.to_string());
            let mut inputs: Vec<(_, ValueOrView)> = Vec::new();
            for (name, dims, known) in given {
                let id = id(&name)?;
                if inputs.iter().any(|(known, _)| *known == id) {
                    continue;
                }
                let value = match known {
                    Known::Ints(values) => ValueOrView::from(
                        Tensor::try_from_data(dims.as_slice(), values.clone()).map_err(|e| e.to_string())?,
                    ),
                    Known::Floats(values) => ValueOrView::from(
                        Tensor::try_from_data(dims.as_slice(), values.clone()).map_err(|e| e.to_string())?,
                    ),
                };
                inputs.push((id, value));
            }
            let outputs = names.iter().map(|name| id(name)).collect::<Result<Vec<_>, _>>()?;
            model.run(inputs, &outputs, None).map_err(|error| error.to_string())
        })?;
        let mut values = values.map_err(refused)?.into_iter();
        let mut all = Vec::new();
        for name in &node.outputs {
            if name.is_empty() {
                all.push((Vec::new(), Known::Ints(Vec::new())));
                continue;
            }
            let Some(value) = values.next() else { return Ok(None) };
            let dims = value.shape().to_vec();
            let known = match value.dtype() {
                ValueType::Tensor(DataType::Int32) => {
                    value.into_tensor::<i32>().map(|tensor| Known::Ints(tensor.into_data()))
                }
                ValueType::Tensor(DataType::Float) => {
                    value.into_tensor::<f32>().map(|tensor| Known::Floats(tensor.into_data()))
                }
                _ => None,
            };
            let Some(known) = known else { return Ok(None) };
            all.push((dims, known));
        }
        Ok(Some(all))
    }
}

impl Loaded {
    /// Runs the graph on as many threads as the current rayon pool has.
    pub fn run(&self, input: &str, image: &Array, outputs: &[String]) -> Result<Vec<Array>, ModelError> {
        let failed = |error: String| ModelError::Run(one_line(&error));
        let pool = Arc::new(ThreadPool::with_num_threads(rayon::current_num_threads()));
        let options = RunOptions::default().with_thread_pool(Some(pool));
        let values = on_deep_stack(|| -> Result<Vec<Value>, String> {
            let id = |name: &str| self.model.node_id(name).map_err(|error| error.to_string());
            let ids = outputs.iter().map(|name| id(name)).collect::<Result<Vec<_>, _>>()?;
            let view =
                TensorView::try_from_data(image.dims.as_slice(), image.values.as_slice()).map_err(|e| e.to_string())?;
            self.model.run(vec![(id(input)?, view.into())], &ids, Some(options)).map_err(|error| error.to_string())
        })?;
        values.map_err(failed)?.into_iter().zip(outputs).map(|(value, name)| floats(value, name)).collect()
    }
}

fn floats(value: Value, name: &str) -> Result<Array, ModelError> {
    let dims = value.shape().to_vec();
    let values = match value.dtype() {
        ValueType::Tensor(DataType::Float) => value.into_tensor::<f32>().map(|tensor| tensor.into_data()),
        ValueType::Tensor(DataType::Int32) => {
            value.into_tensor::<i32>().map(|tensor| tensor.into_data().into_iter().map(|value| value as f32).collect())
        }
        ValueType::Tensor(DataType::UInt8) => {
            value.into_tensor::<u8>().map(|tensor| tensor.into_data().into_iter().map(f32::from).collect())
        }
        ValueType::Tensor(DataType::Int8) => {
            value.into_tensor::<i8>().map(|tensor| tensor.into_data().into_iter().map(f32::from).collect())
        }
        _ => None,
    };
    let values = values.filter(|values| product(&dims) == Some(values.len()));
    let why = || "it is not a tensor of numbers".to_owned();
    values
        .map(|values| Array { dims, values })
        .ok_or_else(|| ModelError::Output { output: crate::error::short(name), why: why() })
}

/// Runs a closure that may panic or recurse deeply, on a thread with a large stack.
fn on_deep_stack<T: Send>(work: impl FnOnce() -> T + Send) -> Result<T, ModelError> {
    std::thread::scope(|scope| {
        let builder = std::thread::Builder::new().name("depth model".to_owned()).stack_size(STACK_BYTES);
        let thread = builder
            .spawn_scoped(scope, || catching_panics(work))
            .map_err(|error| ModelError::Run(error.to_string()))?;
        thread.join().unwrap_or_else(|_| Err(ModelError::Run("internal error in rten".to_owned())))
    })
}

/// Runs a closure and turns a panic into an error.
fn catching_panics<T>(work: impl FnOnce() -> T) -> Result<T, ModelError> {
    // Nothing that the closure changes is used after a panic.
    catch_unwind(AssertUnwindSafe(work)).map_err(|panic| {
        let text = panic
            .downcast_ref::<String>()
            .cloned()
            .or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        ModelError::Run(format!("internal error in rten: {}", one_line(&text.unwrap_or_default())))
    })
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(300).collect()
}
