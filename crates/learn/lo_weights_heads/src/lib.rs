//! Trained weights of all networks of lightoctree but the image encoder; no code.

/// A `.safetensors` file of 16-bit weights that `lightoctree-lab weights split` wrote.
pub static HEADS: &[u8] = include_bytes!("../heads.safetensors");
