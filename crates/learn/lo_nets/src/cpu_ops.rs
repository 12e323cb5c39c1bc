//! CPU ops: turns a [`Kernel`] on slices into a differentiable operation on burn's tensors.
//!
//! This module alone adapts kernels to burn: it reads contiguous tensors of the Flex backend without copying, and
//! records the backward pass. Kernels do not depend on burn.

use std::fmt::Debug;
use std::mem::MaybeUninit;
use std::ops::{Add, MulAssign, Sub};

use burn::backend::tensor::FloatTensor;
#[cfg(feature = "training")]
use burn::backend::{
    Autodiff,
    autodiff::checkpoint::{base::Checkpointer, strategy::CheckpointStrategy},
    autodiff::grads::Gradients,
    autodiff::ops::{Backward, Ops, OpsKind},
};
use burn::backend::{Backend, Dispatch, Flex, TensorMetadata, backend_extension};
use burn::tensor::{DType, Element, Tensor, TensorData};
use rayon::prelude::*;

use crate::gemm::GemmKernels;

/// Number types of kernels: `f32` in use, `f64` in gradient checks.
pub trait Number:
    lo_dual::Real + GemmKernels + Add<Output = Self> + Sub<Output = Self> + MulAssign + PartialOrd + Element + bytemuck::Pod
{
    /// Rounds to the nearest value of this type.
    fn from_f64(value: f64) -> Self;

    /// Converts without loss.
    fn as_f64(self) -> f64;
}

impl Number for f32 {
    fn from_f64(value: f64) -> Self {
        value as Self
    }

    fn as_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Number for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }

    fn as_f64(self) -> f64 {
        self
    }
}

/// A differentiable function of one to three matrices, on slices in row-major order.
pub trait Kernel: Clone + Debug + Send + Sync + 'static {
    /// Returns rows and columns of the output for inputs of these sizes.
    ///
    /// # Panics
    /// Where the sizes do not match.
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2];

    /// Computes the output.
    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T>;

    /// Computes the inputs' gradients from the output's `gradient`. Those that are not `wanted` may be left empty.
    fn backward<T: Number>(
        &self,
        inputs: &[&[T]],
        sizes: &[[usize; 2]],
        gradient: &[T],
        wanted: &[bool],
    ) -> Vec<Vec<T>>;
}

/// Applies `kernel` to one matrix.
pub fn unary<K: Kernel>(x: Tensor<2>, kernel: K) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_unary(x.into_dispatch(), kernel))
}

/// Applies `kernel` to two matrices.
pub fn binary<K: Kernel>(x: Tensor<2>, y: Tensor<2>, kernel: K) -> Tensor<2> {
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_binary(x.into_dispatch(), y.into_dispatch(), kernel))
}

/// Applies `kernel` to three matrices.
pub fn ternary<K: Kernel>(x: Tensor<2>, y: Tensor<2>, z: Tensor<2>, kernel: K) -> Tensor<2> {
    let (x, y, z) = (x.into_dispatch(), y.into_dispatch(), z.into_dispatch());
    Tensor::from_dispatch(<Dispatch as KernelOps>::kernel_ternary(x, y, z, kernel))
}

/// Allocates zeros and writes them from all threads: the first touch of large outputs is slow on a single thread.
#[expect(unsafe_code)]
pub(crate) fn zeros<T: Copy + Default + Send>(count: usize) -> Vec<T> {
    const CHUNK: usize = 1 << 16;
    let mut out = Vec::with_capacity(count);
    let chunks = out.spare_capacity_mut()[..count].par_chunks_mut(CHUNK);
    chunks.for_each(|chunk| chunk.fill(MaybeUninit::new(T::default())));
    // SAFETY: the loop above has initialised the first `count` elements.
    unsafe { out.set_len(count) };
    out
}

/// Backend extension for kernels. One method for each number of inputs, as burn's dispatch macro does not support
/// lists.
#[cfg_attr(feature = "training", backend_extension(Flex, Autodiff))]
#[cfg_attr(not(feature = "training"), backend_extension(Flex))]
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

#[cfg(feature = "training")]
impl<B: KernelBackend, C: CheckpointStrategy> KernelOps for Autodiff<B, C> {
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

/// A backend whose tensors are readable by kernels.
pub trait KernelBackend: Backend {
    /// Runs the kernel forward.
    fn run<K: Kernel, const N: usize>(inputs: [FloatTensor<Self>; N], kernel: &K) -> FloatTensor<Self>;

    /// Runs the kernel backward. Returns `None` for gradients that are not wanted.
    fn run_backward<K: Kernel, const N: usize>(
        inputs: &[FloatTensor<Self>; N],
        gradient: FloatTensor<Self>,
        wanted: [bool; N],
        kernel: &K,
    ) -> [Option<FloatTensor<Self>>; N];
}

impl KernelBackend for Flex {
    fn run<K: Kernel, const N: usize>(inputs: [FloatTensor<Self>; N], kernel: &K) -> FloatTensor<Self> {
        match inputs[0].dtype() {
            DType::F32 => forward_on::<f32, K, N>(&inputs, kernel),
            #[cfg(feature = "training")]
            DType::F64 => forward_on::<f64, K, N>(&inputs, kernel),
            other => panic!("kernels compute with F32, and with F64 in gradient checks, not {other:?}"),
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
            other => panic!("kernels compute with F32, and with F64 in gradient checks, not {other:?}"),
        }
    }
}

type FlexFloat = FloatTensor<Flex>;

fn size(tensor: &FlexFloat) -> [usize; 2] {
    let shape = tensor.shape();
    [shape[0], shape[1]]
}

/// Borrows the values of a contiguous tensor.
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

/// A kernel as recorded for the backward pass.
#[cfg(feature = "training")]
#[derive(Debug)]
struct Recorded<K>(K);

#[cfg(feature = "training")]
impl<B: KernelBackend, K: Kernel, const N: usize> Backward<B, N> for Recorded<K> {
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

#[cfg(feature = "training")]
fn recorded<B: KernelBackend, C: CheckpointStrategy, K: Kernel, const N: usize>(
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
