use lo_nets::Networks;
use lo_nets::checkpoint::CheckpointError;
use lo_weights_encoder::ENCODER;
use lo_weights_heads::HEADS;

/// The embedded weights with their names in messages.
const PARTS: [(&str, &[u8]); 2] = [("encoder.safetensors", ENCODER), ("heads.safetensors", HEADS)];

/// SHA-256 of the embedded weights as one file, as in `docs/model_card.md` (feature `weights`).
pub const WEIGHTS_SHA256: &str = "86026583af6496c34ff67130287efa502a47dbfe893eeacd4239dc44045e4d53";

/// Loads the trained networks that are embedded in this library (feature `weights`, on by default).
///
/// `docs/model_card.md` describes them.
///
/// # Errors
/// Only if the embedded weights are corrupt.
pub(crate) fn shipped_networks() -> Result<Networks, CheckpointError> {
    Networks::from_parts(&PARTS)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_nets::checkpoint::{Checkpoint, Precision};
    use sha2::{Digest, Sha256};

    use super::*;

    #[test]
    fn the_weights_are_those_of_the_model_card() {
        assert!(shipped_networks().unwrap().config.depth >= 6);
        let parts = PARTS.map(|(name, bytes)| Checkpoint::from_bytes(bytes, name).unwrap());
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("joined.safetensors");
        Checkpoint::joined(parts).unwrap().write(&file, Precision::Half).unwrap();
        let digest = Sha256::digest(std::fs::read(file).unwrap());
        let sum: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(sum, WEIGHTS_SHA256);
        assert!(include_str!("../../../../docs/model_card.md").contains(&sum), "{sum}");
    }
}
