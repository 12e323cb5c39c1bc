use lo_nets::Networks;
use lo_nets::checkpoint::CheckpointError;

/// File name of the trained weights in messages.
const NAME: &str = "lightoctree.safetensors";

static BYTES: &[u8] = include_bytes!("../weights/lightoctree.safetensors");

/// The trained networks that this library carries (`weights/README.md` says how they were made and what they can do); the feature
/// `weights`, on by default, brings them.
///
/// # Errors
/// None, unless the library itself is damaged.
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
