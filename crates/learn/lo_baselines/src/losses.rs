//! Losses of baselines, and the order of probes in a batch.

use burn::tensor::Tensor;

use crate::dense::Cells;
use crate::example::{BaselineExample, Probe};

/// A term of a loss.
#[derive(Clone, Debug)]
pub(crate) struct Term {
    name: &'static str,
    value: Tensor<1>,
    weight: f32,
}

/// Terms of a loss with their weights.
#[derive(Clone, Debug)]
pub struct Losses(Vec<Term>);

impl Term {
    pub(crate) fn new(name: &'static str, value: Tensor<1>, weight: f32) -> Self {
        Self { name, value, weight }
    }
}

impl Losses {
    pub(crate) fn new<const N: usize>(terms: [Term; N]) -> Self {
        Self(terms.into())
    }

    /// Returns the weighted sum.
    ///
    /// # Panics
    /// Without terms.
    pub fn total(&self) -> Tensor<1> {
        let weighted = self.0.iter().map(|term| term.value.clone() * term.weight);
        weighted.reduce(|sum, term| sum + term).expect("every loss has terms")
    }

    /// Returns names and unweighted values.
    pub fn values(&self) -> Vec<(&'static str, f32)> {
        self.0.iter().map(|term| (term.name, term.value.clone().inner().into_scalar::<f32>())).collect()
    }
}

/// Returns the cells of all probes, ordered by photo.
pub(crate) fn probe_cells(examples: &[&BaselineExample]) -> Cells {
    let of_image = |(image, example): (usize, &&BaselineExample)| {
        example.probes.iter().map(|probe| [image, probe.cell[0], probe.cell[1]]).collect::<Vec<_>>()
    };
    Cells { at: examples.iter().enumerate().flat_map(of_image).collect() }
}

/// Returns the probes in the order of [`probe_cells`].
pub(crate) fn probes<'a>(examples: &'a [&BaselineExample]) -> impl Iterator<Item = &'a Probe> {
    examples.iter().flat_map(|example| &example.probes)
}
