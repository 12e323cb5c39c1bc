use std::sync::Arc;

use burn::tensor::Tensor;
use rayon::prelude::*;

use crate::cpu_ops::{Kernel, Number, unary};

/// Marks a row without a counterpart.
const NONE: u32 = u32::MAX;

/// Map from the rows of one matrix to those of another. Each row is used at most once.
#[derive(Debug)]
pub struct RowMap {
    /// For each output row, its input row.
    sources: Vec<u32>,
    /// For each input row, its output row.
    targets: Vec<u32>,
}

impl RowMap {
    /// Builds the map of `inputs` rows. `sources[row]` is the input row of each output row, or `None` for a row of
    /// zeros.
    ///
    /// # Panics
    /// Where an input row is used twice or does not exist.
    pub fn new(sources: impl IntoIterator<Item = Option<u32>>, inputs: usize) -> Arc<Self> {
        let sources: Vec<u32> = sources.into_iter().map(|source| source.unwrap_or(NONE)).collect();
        let mut targets = vec![NONE; inputs];
        for (target, &source) in sources.iter().enumerate().filter(|(_, source)| **source != NONE) {
            assert_eq!(targets[source as usize], NONE, "row {source} is used once");
            targets[source as usize] = target as u32;
        }
        Arc::new(Self { sources, targets })
    }

    /// Returns the number of output rows.
    pub fn len(&self) -> usize {
        self.sources.len()
    }

    /// Reports whether the output has no rows.
    pub fn is_empty(&self) -> bool {
        self.sources.is_empty()
    }
}

/// Selects the rows named by `map`, and zeros elsewhere: `x[inputs, channels]` → `[outputs, channels]`.
pub fn select_rows(x: Tensor<2>, map: &Arc<RowMap>) -> Tensor<2> {
    unary(x, SelectKernel(map.clone()))
}

/// Reference implementation with burn's operations.
#[cfg(test)]
fn composed(x: Tensor<2>, map: &RowMap) -> Tensor<2> {
    use burn::tensor::{Int, TensorData};

    let (device, dtype) = (x.device(), x.dtype());
    let [inputs, channels] = x.dims();
    // Rows without a source select a row of zeros behind the others.
    let rows = map.sources.iter().map(|&source| if source == NONE { inputs as i64 } else { i64::from(source) });
    let rows = Tensor::<1, Int>::from_data(TensorData::new(rows.collect(), [map.len()]), &device);
    Tensor::cat(vec![x, Tensor::zeros([1, channels], (&device, dtype))], 0).select(0, rows)
}

#[derive(Clone, Debug)]
struct SelectKernel(Arc<RowMap>);

impl Kernel for SelectKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        assert_eq!(sizes[0][0], self.0.targets.len(), "the input has the map's number of rows");
        [self.0.len(), sizes[0][1]]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        self.output_size(sizes);
        gather_rows(inputs[0], &self.0.sources, sizes[0][1])
    }

    fn backward<T: Number>(&self, _: &[&[T]], sizes: &[[usize; 2]], gradient: &[T], _: &[bool]) -> Vec<Vec<T>> {
        vec![gather_rows(gradient, &self.0.targets, sizes[0][1])]
    }
}

fn gather_rows<T: Number>(x: &[T], rows: &[u32], channels: usize) -> Vec<T> {
    let mut output = vec![T::default(); rows.len() * channels];
    output.par_chunks_exact_mut(channels).with_min_len(1 << 10).zip(rows).for_each(|(output, &row)| {
        if row != NONE {
            output.copy_from_slice(&x[row as usize * channels..][..channels]);
        }
    });
    output
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{assert_gradients, assert_same_function};

    #[test]
    fn kernel_equals_reference() {
        let map = RowMap::new([Some(3), None, Some(0), Some(4)], 6);
        assert_same_function(&[[6, 3]], |[x]| select_rows(x, &map), |[x]| composed(x, &map));
        assert_gradients(&[[6, 3]], |[x]| select_rows(x, &map));
    }
}
