use std::fmt::Debug;
use std::ops::{AddAssign, Mul};

/// Numbers that the kernels compute with: `f32` to use, `f64` to check gradients.
pub trait Real: Copy + Debug + Default + PartialEq + Send + Sync + AddAssign + Mul<Output = Self> + 'static {
    /// One.
    const ONE: Self;

    /// 1 / `count`.
    fn share(count: u32) -> Self;
}

impl Real for f32 {
    const ONE: Self = 1.0;

    fn share(count: u32) -> Self {
        1.0 / count as f32
    }
}

impl Real for f64 {
    const ONE: Self = 1.0;

    fn share(count: u32) -> Self {
        1.0 / f64::from(count)
    }
}

/// A matrix in a slice, row by row or, transposed, column by column.
#[derive(Clone, Copy)]
pub struct Matrix<'a, T> {
    values: &'a [T],
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl<'a, T> Matrix<'a, T> {
    /// The matrix with so many columns that fills `values` row by row.
    pub fn new(values: &'a [T], columns: usize) -> Self {
        Self { values, rows: values.len() / columns, columns, row_stride: columns, column_stride: 1 }
    }

    /// Rows for columns, without moving a value.
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

/// `out = left · right`, or with `add` `out += left · right`, on the calling thread; `out` is row by row.
///
/// # Panics
/// Where the sizes do not fit.
#[expect(unsafe_code)]
pub fn product<T: Real>(out: &mut [T], left: Matrix<T>, right: Matrix<T>, add: bool) {
    let (m, n, k) = (left.rows, right.columns, left.columns);
    assert_eq!(k, right.rows, "the inner sizes of a product agree");
    assert_eq!(out.len(), m * n, "the result has the outer sizes");
    assert!(left.values.len() == m * k && right.values.len() == k * n, "a matrix fills its slice");
    // SAFETY: the sizes and strides address just the elements of the three slices, as asserted above and by the two
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
        product(&mut out, Matrix::new(&left, k), Matrix::new(&right, k).transposed(), true);
        for row in 0..m {
            for column in 0..n {
                let sum: f64 = (0..k).map(|i| left[row * k + i] * right[column * k + i]).sum();
                assert!((out[row * n + column] - 1.0 - sum).abs() < 1e-12);
            }
        }
    }
}
