//! Renders the light at a point as an HDR panorama.
//!
//! `cargo run --release -p lightoctree --example envmap [SCENE [PANORAMA]]`
//!
//! The example `estimate` writes SCENE.

use std::error::Error;
use std::path::Path;

use lightoctree::geometry::Vec3;
use lightoctree::imaging::{self, EnvironmentLayout, ExrOptions};
use lightoctree::{Document, LightPurpose, SceneRenderer};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = |default: &str| args.next().unwrap_or_else(|| default.to_owned());
    run(next("room.scene").as_ref(), next("panorama.exr").as_ref())
}

/// Reads the scene, renders the panorama and writes it.
pub fn run(scene: &Path, panorama: &Path) -> Result<(), Box<dyn Error>> {
    let document = Document::read(scene)?;
    // Expected light, with the user's edits.
    let lit = document.lit(LightPurpose::Panorama)?;
    // Metres: +X right, +Y up. The camera is at the origin and looks along −Z; this is 1.5 m in front of it.
    let point = Vec3::new(0.0, 0.0, -1.5);
    let rendering = SceneRenderer::new(&lit).panorama(point, 512, 256);
    let options = ExrOptions {
        generator: "example envmap".to_owned(),
        environment: Some(EnvironmentLayout::LatitudeLongitude),
        ..ExrOptions::default()
    };
    Ok(imaging::write_radiance(panorama, &rendering.radiance, &options)?)
}
