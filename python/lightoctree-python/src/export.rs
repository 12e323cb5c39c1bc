use std::path::{Path, PathBuf};

use lightoctree::export::{self, Content, Format, LightProbe, Options};
use lightoctree::geometry::Vec3;
use lightoctree::{Document, LightPurpose, SceneRenderer};
use lightoctree_cli::commands::environment::unusual_position;
use lightoctree_cli::commands::export::PROBE_WIDTH;

use crate::errors::Failure;
use crate::job::Reporter;

/// An export of a scene to a file.
pub struct Export {
    path: PathBuf,
    format: Format,
    level: bool,
    probes: Vec<Vec3>,
}

impl Export {
    /// Creates an export to `path`, whose extension determines the format.
    ///
    /// # Errors
    /// [`Failure::Argument`] if it is not that of a format.
    pub fn new(path: PathBuf, level: bool, probes: Vec<Vec3>) -> Result<Self, Failure> {
        let format = format(&path).ok_or_else(|| {
            Failure::Argument(format!(
                "{}: the extension must be one of .ply, .glb, .usda, .usd, .usdz",
                path.display()
            ))
        })?;
        Ok(Self { path, format, level, probes })
    }

    /// Writes the file, and those beside it, as the command `export` does. Returns their paths.
    pub fn write(&self, document: &Document, reporter: &mut Reporter) -> Result<Vec<PathBuf>, Failure> {
        let (scene, report) = document.lit_with_report(LightPurpose::Export)?;
        report.fit.warning().iter().for_each(|warning| reporter.warn(warning));
        let lights = if self.format.has_lamps() { document.lights() } else { Vec::new() };
        let mut panoramas = Vec::new();
        if !self.probes.is_empty() {
            let renderer = SceneRenderer::new(&scene);
            for &at in &self.probes {
                if let Some(unusual) = unusual_position(&scene, at) {
                    reporter.warn(format!("({}, {}, {}) is {unusual}", at.x, at.y, at.z));
                }
                panoramas.push((renderer.panorama(at, PROBE_WIDTH, PROBE_WIDTH / 2).radiance, at));
            }
        }
        let probes: Vec<LightProbe> =
            panoramas.iter().map(|(radiance, at)| LightProbe { radiance, position_m: *at }).collect();
        let options = Options {
            format: self.format,
            content: Content::Leaves,
            level: self.level,
            probes: &probes,
            lights: &lights,
        };
        Ok(export::write(&scene, &options, &self.path)?.files)
    }
}

/// Returns the format with this extension.
fn format(path: &Path) -> Option<Format> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "usd" => Some(Format::Usda),
        extension => extension.parse().ok(),
    }
}
