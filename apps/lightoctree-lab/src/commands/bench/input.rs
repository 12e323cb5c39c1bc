//! The kit's input.

use std::path::{Path, PathBuf};

use anyhow::Context;
use lightoctree_cli::usage::Usage;

/// Folder of the kit's input.
pub fn folder() -> anyhow::Result<PathBuf> {
    let folder = std::env::var_os("PEERS_INPUT").map(PathBuf::from).ok_or_else(|| {
        Usage("set PEERS_INPUT to the folder that the peers' make_input.py wrote (it holds input.json)".into())
    })?;
    if !folder.join("input.json").is_file() {
        return Err(Usage(format!(
            "{} (PEERS_INPUT) holds no input.json: run the peers' make_input.py",
            folder.display()
        ))
        .into());
    }
    Ok(folder)
}

/// A float array that make_input.py wrote, with its shape.
pub fn load(folder: &Path, name: &str) -> anyhow::Result<(Vec<f32>, Vec<u64>)> {
    let path = folder.join(format!("{name}.npy"));
    let bytes = std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
    let array = npyz::NpyFile::new(&bytes[..]).with_context(|| format!("{} is no NPY file", path.display()))?;
    let shape = array.shape().to_vec();
    Ok((array.into_vec::<f32>().with_context(|| format!("{} does not hold float32", path.display()))?, shape))
}
