//! `--depth-model`: predicts depth with a third-party network.

use std::path::{Path, PathBuf};

use anyhow::Context;
use lo_depth_models::{DepthModel, ModelConfig, ModelError};

use crate::progress::Stages;
use crate::usage::Usage;

/// Options of a third-party depth model.
#[derive(Clone, Debug, clap::Args)]
pub struct DepthModelArgs {
    /// Depth network in an ONNX file: MoGe-2, Depth Anything V2 or Metric3D v2 as published, others with
    /// --depth-model-config
    ///
    /// MoGe-2 also predicts the field of view, used unless EXIF or an option gives it; MoGe-2 and Metric3D v2 predict
    /// normals. Relative depth (Depth Anything V2 small, base and large) is fitted to the metric depth of the built-in
    /// network.
    #[arg(long, value_name = "FILE")]
    depth_model: Option<PathBuf>,

    /// TOML file that describes the network's input and output; without it, an error prints a template for unknown
    /// networks
    #[arg(long, value_name = "FILE", requires = "depth_model")]
    depth_model_config: Option<PathBuf>,
}

impl DepthModelArgs {
    /// Returns the given options, for comparison with those of another run.
    pub fn settings(&self) -> serde_json::Value {
        serde_json::json!({ "file": self.depth_model, "config": self.depth_model_config })
    }

    /// Path of the ONNX file, if one is given.
    pub fn path(&self) -> Option<&Path> {
        self.depth_model.as_deref()
    }

    /// Reads the model, if one is given, and reports its name.
    pub fn read(&self, stages: &mut Stages) -> anyhow::Result<Option<DepthModel>> {
        let Some(path) = self.path() else { return Ok(None) };
        let model = stages.stage("read depth model", || self.model(path))?;
        stages.note(&format!("depth model: {}", model.name()));
        Ok(Some(model))
    }

    /// Reads the model of a file.
    pub fn model(&self, path: &Path) -> anyhow::Result<DepthModel> {
        let config = self.depth_model_config.as_deref();
        let read = |config: &Path| {
            ModelConfig::read(config).with_context(|| format!("--depth-model-config {}", config.display()))
        };
        let config = config.map(read).transpose()?;
        DepthModel::read(path, config.as_ref()).map_err(|error| match error {
            ModelError::Unknown { .. } => Usage(format!(
                "--depth-model {}: {error}\nand give it as --depth-model-config FILE.toml",
                path.display()
            ))
            .into(),
            error @ ModelError::Read { .. } => anyhow::Error::from(error),
            error => anyhow::Error::from(error).context(format!("--depth-model {}", path.display())),
        })
    }
}
