use lo_nets::Networks;
use lo_nets::checkpoint::CheckpointError;

/// Name of the embedded weights in messages.
const NAME: &str = "lightoctree.safetensors";

static BYTES: &[u8] = include_bytes!("../weights/lightoctree.safetensors");

/// Loads the trained networks that are embedded in this library (feature `weights`, on by default).
///
/// `weights/README.md` is their model card.
///
/// # Errors
/// Only if the embedded weights are corrupt.
pub(crate) fn shipped_networks() -> Result<Networks, CheckpointError> {
    Networks::from_bytes(BYTES, NAME)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use sha2::{Digest, Sha256};

    use super::*;

    #[test]
    fn the_weights_are_those_of_the_model_card() {
        let sum: String = Sha256::digest(BYTES).iter().map(|byte| format!("{byte:02x}")).collect();
        assert!(include_str!("../weights/README.md").contains(&sum), "{sum}");
        assert!(shipped_networks().unwrap().config.depth >= 6);
    }
}
