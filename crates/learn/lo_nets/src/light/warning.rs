use std::fmt;

use lo_events::Warning;

/// Warnings of the light network: deviations from its prediction.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum NetworkWarning {
    /// No occupied node was predicted at a depth; the most probable one was used.
    NothingOccupied {
        /// Depth of the nodes.
        depth: u32,
    },
    /// More nodes were predicted than fit the budget; the most probable ones were split.
    NodeBudget {
        /// Depth of the nodes.
        depth: u32,
        /// Number of nodes predicted to be split.
        predicted: usize,
        /// Number of nodes split.
        kept: usize,
    },
}

impl Warning for NetworkWarning {}

impl fmt::Display for NetworkWarning {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::NothingOccupied { depth } => {
                write!(f, "no node of depth {depth} was predicted to be occupied; the most probable one is used")
            }
            Self::NodeBudget { depth, predicted, kept } => write!(
                f,
                "{predicted} nodes of depth {depth} were predicted to be split; only the {kept} most probable fit the \
                 node budget"
            ),
        }
    }
}
