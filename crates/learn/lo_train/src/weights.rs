//! Operations on all weights of a module: gradient norms, clipping, averaging.

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Gradients, Tensor, TensorData};
use rayon::prelude::*;

/// Returns the norm of a module's gradient.
///
/// # Errors
/// Name of the first parameter with a NaN or infinite gradient.
pub(crate) fn gradient_norm<M: Module>(module: &M, gradients: &Gradients) -> Result<f32, String> {
    let mut norm = NormVisitor { gradients, path: Vec::new(), squares: 0.0, culprit: None };
    module.visit(&mut norm);
    match norm.culprit {
        Some(name) => Err(name),
        None => Ok(norm.squares.sqrt() as f32),
    }
}

/// Multiplies a module's gradient by `factor`.
pub(crate) fn scale_gradient<M: Module>(module: &M, gradients: &mut Gradients, factor: f32) {
    module.visit(&mut ScaleVisitor { gradients, factor });
}

/// Returns the name of the first parameter that holds a NaN or infinite value.
pub(crate) fn first_non_finite<M: Module>(module: &M) -> Option<String> {
    let mut find = NonFiniteVisitor { path: Vec::new(), culprit: None };
    module.visit(&mut find);
    find.culprit
}

/// Returns `decay · average + (1 − decay) · module`, weight by weight.
///
/// Both modules have the same shape; `average` records no gradients.
pub(crate) fn averaged<M: Module>(average: M, module: &M, decay: f64) -> M {
    let mut collect = CollectVisitor(Vec::new());
    module.valid().visit(&mut collect);
    average.map(&mut BlendMapper { values: collect.0.into_iter(), decay: decay as f32 })
}

fn floats<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().convert::<f32>().try_into_vec().expect("just converted to f32")
}

struct NormVisitor<'a> {
    gradients: &'a Gradients,
    path: Vec<String>,
    squares: f64,
    culprit: Option<String>,
}

impl ModuleVisitor for NormVisitor<'_> {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let Some(gradient) = param.val().grad(self.gradients) else { return };
        // Chunks of a fixed size: the sum does not depend on the number of threads.
        let values = floats(gradient);
        let squares: Vec<f64> =
            values.par_chunks(1 << 14).map(|part| part.iter().map(|&g| f64::from(g) * f64::from(g)).sum()).collect();
        let squares: f64 = squares.iter().sum();
        if !squares.is_finite() && self.culprit.is_none() {
            self.culprit = Some(self.path.join("."));
        }
        self.squares += squares;
    }
}

struct ScaleVisitor<'a> {
    gradients: &'a mut Gradients,
    factor: f32,
}

impl ModuleVisitor for ScaleVisitor<'_> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = param.val();
        if let Some(gradient) = tensor.grad_remove(self.gradients) {
            tensor.grad_replace(self.gradients, gradient * self.factor);
        }
    }
}

struct NonFiniteVisitor {
    path: Vec<String>,
    culprit: Option<String>,
}

impl ModuleVisitor for NonFiniteVisitor {
    fn enter_module(&mut self, name: &str, _: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _: &str, _: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        if self.culprit.is_none() && !floats(param.val().inner()).iter().all(|value| value.is_finite()) {
            self.culprit = Some(self.path.join("."));
        }
    }
}

struct CollectVisitor(Vec<Vec<f32>>);

impl ModuleVisitor for CollectVisitor {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        self.0.push(floats(param.val()));
    }
}

struct BlendMapper {
    values: std::vec::IntoIter<Vec<f32>>,
    decay: f32,
}

impl ModuleMapper for BlendMapper {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (id, tensor, mapper) = param.consume();
        let (device, dims) = (tensor.device(), tensor.dims());
        let mut average = floats(tensor);
        let values = self.values.next().expect("both modules have the same parameters");
        let decay = self.decay;
        average.par_iter_mut().with_min_len(1 << 14).zip(values).for_each(|(average, value)| {
            *average = decay * *average + (1.0 - decay) * value;
        });
        Param::from_mapped_value(id, Tensor::from_data(TensorData::new(average, dims), &device), mapper)
    }
}
