//! Trained weights of lightoctree's image encoder; no code.

/// A `.safetensors` file of 16-bit weights that `lightoctree-lab weights split` wrote.
pub static ENCODER: &[u8] = include_bytes!("../encoder.safetensors");
