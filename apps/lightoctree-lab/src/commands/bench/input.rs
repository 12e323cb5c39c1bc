//! Reads the input of the peers' kit.

use std::path::{Path, PathBuf};

use anyhow::Context;
use lightoctree_cli::usage::Usage;

/// Returns the folder of the kit's input, `PEERS_INPUT`.
pub fn folder() -> anyhow::Result<PathBuf> {
    let folder = std::env::var_os("PEERS_INPUT").map(PathBuf::from).ok_or_else(|| {
        Usage("set PEERS_INPUT to the folder written by the kit's make_input.py (it contains input.json)".into())
    })?;
    if !folder.join("input.json").is_file() {
        return Err(Usage(format!(
            "{} (PEERS_INPUT) has no input.json: run the kit's make_input.py",
            folder.display()
        ))
        .into());
    }
    Ok(folder)
}

/// Loads a float array written by make_input.py, with its shape.
pub fn load(folder: &Path, name: &str) -> anyhow::Result<(Vec<f32>, Vec<u64>)> {
    let path = folder.join(format!("{name}.npy"));
    let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let array = npyz::NpyFile::new(&bytes[..]).with_context(|| format!("{} is not an NPY file", path.display()))?;
    let shape = array.shape().to_vec();
    Ok((array.into_vec::<f32>().with_context(|| format!("{} does not hold float32", path.display()))?, shape))
}
