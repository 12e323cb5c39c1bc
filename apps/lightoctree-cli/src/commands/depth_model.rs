//! `--depth-model`: depth by a network that the user brings.

use std::path::{Path, PathBuf};

use anyhow::Context;
use lightoctree::depth_models::{DepthModel, ModelConfig, ModelError};

use crate::progress::Stages;
use crate::usage::Usage;

/// Options of a depth model.
#[derive(Clone, Debug, clap::Args)]
pub struct DepthModelArgs {
    /// Depth by this network, an ONNX file: MoGe-2, Depth Anything V2 or Metric3D v2 as published, others with --depth-model-config
    ///
    /// MoGe-2 tells the field of view too, where neither EXIF nor an option does, and MoGe-2 and Metric3D v2 tell normals. Relative depth (Depth Anything
    /// V2's small, base and large) is brought to the metres of the program's own depth network.
    #[arg(long, value_name = "FILE", conflicts_with = "depth")]
    depth_model: Option<PathBuf>,

    /// What the network takes and gives, a TOML file; a network that is not known says what belongs in it
    #[arg(long, value_name = "FILE", requires = "depth_model")]
    depth_model_config: Option<PathBuf>,
}

impl DepthModelArgs {
    /// The file.
    pub fn path(&self) -> Option<&Path> {
        self.depth_model.as_deref()
    }

    /// Reads the model, where there is one, and says which it is.
    pub fn read(&self, stages: &mut Stages) -> anyhow::Result<Option<DepthModel>> {
        let Some(path) = self.path() else { return Ok(None) };
        let model = stages.stage("read depth model", || self.model(path))?;
        stages.note(&format!("depth model: {}", model.name()));
        Ok(Some(model))
    }

    /// The model of a file.
    pub fn model(&self, path: &Path) -> anyhow::Result<DepthModel> {
        let config = self.depth_model_config.as_deref();
        let read = |config: &Path| {
            ModelConfig::read(config).with_context(|| format!("--depth-model-config {}", config.display()))
        };
        let config = config.map(read).transpose()?;
        DepthModel::read(path, config.as_ref()).map_err(|error| match error {
            ModelError::Unknown { .. } => {
                Usage(format!("--depth-model {}: {error}\nas --depth-model-config FILE.toml", path.display())).into()
            }
            error @ ModelError::Read { .. } => anyhow::Error::from(error),
            error => anyhow::Error::from(error).context(format!("--depth-model {}", path.display())),
        })
    }
}
