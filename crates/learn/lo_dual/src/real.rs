use std::fmt::Debug;
use std::ops::{AddAssign, Mul};

/// Number types of the kernels: `f32` in use, `f64` in gradient checks.
pub trait Real: Copy + Debug + Default + PartialEq + Send + Sync + AddAssign + Mul<Output = Self> + 'static {
    /// One.
    const ONE: Self;

    /// 1 / `count`.
    fn reciprocal(count: u32) -> Self;
}

impl Real for f32 {
    const ONE: Self = 1.0;

    fn reciprocal(count: u32) -> Self {
        1.0 / count as f32
    }
}

impl Real for f64 {
    const ONE: Self = 1.0;

    fn reciprocal(count: u32) -> Self {
        1.0 / f64::from(count)
    }
}

/// A matrix on a slice, in row-major order or, transposed, column-major.
#[derive(Clone, Copy)]
pub struct Matrix<'a, T> {
    values: &'a [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a, T> Matrix<'a, T> {
    /// Views `values` as a row-major matrix with `columns` columns.
    pub fn new(values: &'a [T], columns: usize) -> Self {
        Self { values, rows: values.len() / columns, columns, row_stride: columns, column_stride: 1 }
    }

    /// Transposes without copying.
    pub fn transposed(self) -> Self {
        Self {
            rows: self.columns,
            columns: self.rows,
            row_stride: self.column_stride,
            column_stride: self.row_stride,
            ..self
        }
    }
}

/// Computes `out = left · right`, or `out += left · right` with `add`, on the calling thread. `out` is row-major.
///
/// # Panics
/// Where the sizes do not match.
#[expect(unsafe_code)]
pub fn matmul<T: Real>(out: &mut [T], left: Matrix<T>, right: Matrix<T>, add: bool) {
    let (m, n, k) = (left.rows, right.columns, left.columns);
    assert_eq!(k, right.rows, "the inner sizes of a product agree");
    assert_eq!(out.len(), m * n, "the result has the outer sizes");
    assert!(left.values.len() == m * k && right.values.len() == k * n, "a matrix fills its slice");
    // SAFETY: sizes and strides address exactly the elements of the three slices, by the assertions above and the
    // constructors of `Matrix`; `out` is borrowed exclusively.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            out.as_mut_ptr(),
            1,
            n as isize,
            add,
            left.values.as_ptr(),
            left.column_stride as isize,
            left.row_stride as isize,
            right.values.as_ptr(),
            right.column_stride as isize,
            right.row_stride as isize,
            T::ONE,
            T::ONE,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn product_is_the_sum_over_the_inner_index() {
        let (m, n, k) = (5, 3, 7);
        let left: Vec<f64> = (0..m * k).map(|i| (i as f64).sin()).collect();
        let right: Vec<f64> = (0..n * k).map(|i| (i as f64).cos()).collect();
        let mut out = vec![1.0; m * n];
        matmul(&mut out, Matrix::new(&left, k), Matrix::new(&right, k).transposed(), true);
        for row in 0..m {
            for column in 0..n {
                let sum: f64 = (0..k).map(|i| left[row * k + i] * right[column * k + i]).sum();
                assert!((out[row * n + column] - 1.0 - sum).abs() < 1e-12);
            }
        }
    }
}
