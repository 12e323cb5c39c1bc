//! Own operations on the CPU: a [`Kernel`] on slices becomes a differentiable operation on burn's tensors.
//!
//! Everything that burn must know of a kernel is here, once: reading contiguous tensors of the Flex backend without a copy,
//! and recording the backward pass. Kernels themselves know nothing of burn.

use std::fmt::Debug;
use std::mem::MaybeUninit;
use std::ops::{Add, MulAssign, Sub};

use burn::backend::autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy};
use burn::backend::autodiff::grads::Gradients;
use burn::backend::autodiff::ops::{Backward, Ops, OpsKind};
use burn::backend::tensor::FloatTensor;
use burn::backend::{Autodiff, Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::tensor::{DType, Element, Tensor, TensorData};
use rayon::prelude::*;

use crate::sums::Sums;

/// Numbers that kernels compute with: `f32` to use, `f64` to check gradients.
pub trait Number:
    lo_dual::Real + Sums + Add<Output = Self> + Sub<Output = Self> + MulAssign + PartialOrd + Element + bytemuck::Pod
{
    /// The nearest number.
    fn of(value: f64) -> Self;

    /// The same value.
    fn wide(self) -> f64;
}

impl Number for f32 {
    fn of(value: f64) -> Self {
        value as Self
    }

    fn wide(self) -> f64 {
        f64::from(self)
    }
}

impl Number for f64 {
    fn of(value: f64) -> Self {
        value
    }

    fn wide(self) -> f64 {
        self
    }
}

/// A function of one to three matrices and its derivative, on slices in row-major order.
pub trait Kernel: Clone + Debug + Send + Sync + 'static {
    /// Rows and columns of the output for inputs of these sizes.
    ///
    /// # Panics
    /// Where the sizes do not fit each other.
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2];

    /// The output.
    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T>;

    /// Derivatives of a sum by the inputs, from the one by the output, `gradient`. Those not `wanted` may be left empty.
    fn backward<T: Number>(
        &self,
        inputs: &[&[T]],
        sizes: &[[usize; 2]],
        gradient: &[T],
        wanted: &[bool],
    ) -> Vec<Vec<T>>;
}

/// `kernel` of one matrix.
pub fn unary<K: Kernel>(x: Tensor<2>, kernel: K) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_unary(x.into_dispatch(), kernel))
}

/// `kernel` of two matrices.
pub fn binary<K: Kernel>(x: Tensor<2>, y: Tensor<2>, kernel: K) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_binary(x.into_dispatch(), y.into_dispatch(), kernel))
}

/// `kernel` of three matrices.
pub fn ternary<K: Kernel>(x: Tensor<2>, y: Tensor<2>, z: Tensor<2>, kernel: K) -> Tensor<2> {
    let (x, y, z) = (x.into_dispatch(), y.into_dispatch(), z.into_dispatch());
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_ternary(x, y, z, kernel))
}

/// Zeros, written by all threads: of large outputs that is what the first touch costs, and one thread alone would make the others wait.
#[expect(unsafe_code)]
pub(crate) fn zeros<T: Copy + Default + Send>(count: usize) -> Vec<T> {
    const CHUNK: usize = 1 << 16;
    let mut out = Vec::with_capacity(count);
    let chunks = out.spare_capacity_mut()[..count].par_chunks_mut(CHUNK);
    chunks.for_each(|chunk| chunk.fill(MaybeUninit::new(T::default())));
    // SAFETY: the first `count` places have just been filled.
    unsafe { out.set_len(count) };
    out
}

/// burn's view of kernels: one method for each number of inputs, because the macro that dispatches at run time knows no lists.
#[backend_extension(Flex, Autodiff)]
pub trait KernelOps: Backend {
    /// See [`unary`].
    fn kernel_unary<K: Kernel>(x: FloatTensor<Self>, kernel: K) -> FloatTensor<Self>;
    /// See [`binary`].
    fn kernel_binary<K: Kernel>(x: FloatTensor<Self>, y: FloatTensor<Self>, kernel: K) -> FloatTensor<Self>;
    /// See [`ternary`].
    fn kernel_ternary<K: Kernel>(
        x: FloatTensor<Self>,
        y: FloatTensor<Self>,
        z: FloatTensor<Self>,
        kernel: K,
    ) -> FloatTensor<Self>;
}

impl KernelOps for Flex {
    fn kernel_unary<K: Kernel>(x: FloatTensor<Self>, kernel: K) -> FloatTensor<Self> {
        Self::run([x], &kernel)
    }

    fn kernel_binary<K: Kernel>(x: FloatTensor<Self>, y: FloatTensor<Self>, kernel: K) -> FloatTensor<Self> {
        Self::run([x, y], &kernel)
    }

    fn kernel_ternary<K: Kernel>(
        x: FloatTensor<Self>,
        y: FloatTensor<Self>,
        z: FloatTensor<Self>,
        kernel: K,
    ) -> FloatTensor<Self> {
        Self::run([x, y, z], &kernel)
    }
}

impl<B: HostMemory, C: CheckpointStrategy> KernelOps for Autodiff<B, C> {
    fn kernel_unary<K: Kernel>(x: FloatTensor<Self>, kernel: K) -> FloatTensor<Self> {
        recorded::<B, C, K, 1>([x], kernel)
    }

    fn kernel_binary<K: Kernel>(x: FloatTensor<Self>, y: FloatTensor<Self>, kernel: K) -> FloatTensor<Self> {
        recorded::<B, C, K, 2>([x, y], kernel)
    }

    fn kernel_ternary<K: Kernel>(
        x: FloatTensor<Self>,
        y: FloatTensor<Self>,
        z: FloatTensor<Self>,
        kernel: K,
    ) -> FloatTensor<Self> {
        recorded::<B, C, K, 3>([x, y, z], kernel)
    }
}

/// A backend whose tensors kernels can read.
pub trait HostMemory: Backend {
    /// The kernel's output.
    fn run<K: Kernel, const N: usize>(inputs: [FloatTensor<Self>; N], kernel: &K) -> FloatTensor<Self>;

    /// Its derivatives by the inputs; `None` where not wanted.
    fn run_backward<K: Kernel, const N: usize>(
        inputs: &[FloatTensor<Self>; N],
        gradient: FloatTensor<Self>,
        wanted: [bool; N],
        kernel: &K,
    ) -> [Option<FloatTensor<Self>>; N];
}

impl HostMemory for Flex {
    fn run<K: Kernel, const N: usize>(inputs: [FloatTensor<Self>; N], kernel: &K) -> FloatTensor<Self> {
        match inputs[0].dtype() {
            DType::F32 => forward_on::<f32, K, N>(&inputs, kernel),
            DType::F64 => forward_on::<f64, K, N>(&inputs, kernel),
            other => panic!("kernels compute with F32 and F64, not {other:?}"),
        }
    }

    fn run_backward<K: Kernel, const N: usize>(
        inputs: &[FloatTensor<Self>; N],
        gradient: FloatTensor<Self>,
        wanted: [bool; N],
        kernel: &K,
    ) -> [Option<FloatTensor<Self>>; N] {
        match inputs[0].dtype() {
            DType::F32 => backward_on::<f32, K, N>(inputs, gradient, wanted, kernel),
            DType::F64 => backward_on::<f64, K, N>(inputs, gradient, wanted, kernel),
            other => panic!("kernels compute with F32 and F64, not {other:?}"),
        }
    }
}

type FlexFloat = FloatTensor<Flex>;

fn size(tensor: &FlexFloat) -> [usize; 2] {
    let shape = tensor.shape();
    [shape[0], shape[1]]
}

/// The values of a contiguous tensor.
fn values<T: Number>(tensor: &FlexFloat) -> &[T] {
    let [rows, columns] = size(tensor);
    &tensor.storage::<T>()[tensor.layout().start_offset()..][..rows * columns]
}

fn matrix<T: Number>(values: Vec<T>, size: [usize; 2]) -> FlexFloat {
    FlexFloat::from_data(TensorData::new(values, size))
}

fn forward_on<T: Number, K: Kernel, const N: usize>(inputs: &[FlexFloat; N], kernel: &K) -> FlexFloat {
    let inputs = inputs.each_ref().map(FlexFloat::to_contiguous);
    let sizes = inputs.each_ref().map(size);
    let output = kernel.forward::<T>(&inputs.each_ref().map(values), &sizes);
    matrix(output, kernel.output_size(&sizes))
}

fn backward_on<T: Number, K: Kernel, const N: usize>(
    inputs: &[FlexFloat; N],
    gradient: FlexFloat,
    wanted: [bool; N],
    kernel: &K,
) -> [Option<FlexFloat>; N] {
    let gradient = gradient.to_contiguous();
    let inputs = inputs.each_ref().map(FlexFloat::to_contiguous);
    let sizes = inputs.each_ref().map(size);
    let derivatives = kernel.backward::<T>(&inputs.each_ref().map(values), &sizes, values(&gradient), &wanted);
    let mut derivatives = derivatives.into_iter();
    std::array::from_fn(|i| derivatives.next().filter(|_| wanted[i]).map(|values| matrix(values, sizes[i])))
}

/// A kernel's place in the record of what was computed.
#[derive(Debug)]
struct Recorded<K>(K);

impl<B: HostMemory, K: Kernel, const N: usize> Backward<B, N> for Recorded<K> {
    type State = [FloatTensor<B>; N];

    fn backward(self, ops: Ops<Self::State, N>, grads: &mut Gradients, _: &mut Checkpointer) {
        let gradient = grads.consume::<B>(&ops.node);
        let wanted = ops.parents.each_ref().map(Option::is_some);
        let derivatives = B::run_backward(&ops.state, gradient, wanted, &self.0);
        for (parent, derivative) in ops.parents.into_iter().zip(derivatives) {
            if let (Some(parent), Some(derivative)) = (parent, derivative) {
                grads.register::<B>(parent.id, derivative);
            }
        }
    }
}

fn recorded<B: HostMemory, C: CheckpointStrategy, K: Kernel, const N: usize>(
    inputs: [FloatTensor<Autodiff<B, C>>; N],
    kernel: K,
) -> FloatTensor<Autodiff<B, C>> {
    let nodes = inputs.each_ref().map(|input| input.node());
    let inputs = inputs.map(|input| input.into_primitive());
    let output = B::run(inputs.clone(), &kernel);
    match Backward::<B, N>::prepare::<C>(Recorded(kernel), nodes).compute_bound().stateful() {
        OpsKind::Tracked(preparation) => preparation.finish(inputs, output),
        OpsKind::UnTracked(preparation) => preparation.finish(output),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zeros_fill_all_chunks() {
        for count in [0, 1, 65_535, 65_536, 65_537, 200_000] {
            let zeros: Vec<f32> = zeros(count);
            assert!(zeros.len() == count && zeros.iter().all(|&zero| zero.to_bits() == 0), "{count}");
        }
    }
}
