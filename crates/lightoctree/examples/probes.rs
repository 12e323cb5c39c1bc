//! Renders panoramas at a grid of points, with progress and cancellation.
//!
//! `cargo run --release -p lightoctree --example probes [SCENE [FOLDER]]`
//!
//! The example `estimate` writes SCENE.

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

use lightoctree::imaging::{self, ExrOptions};
use lightoctree::{Document, Event, LightPurpose, probe_grid, render_probes};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = |default: &str| args.next().unwrap_or_else(|| default.to_owned());
    run(next("room.scene").as_ref(), next("probes").as_ref())
}

/// Reads the scene, renders the panoramas and writes one file for each.
pub fn run(scene: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    let document = Document::read(scene)?;
    std::fs::create_dir_all(folder)?;
    let points = probe_grid(&document.estimate, [2, 1, 2]);
    let write = |index: usize, rendering: lightoctree::cone::Rendering| -> Result<(), Box<dyn Error>> {
        let options = ExrOptions { generator: "example probes".to_owned(), ..ExrOptions::default() };
        let file = folder.join(format!("probe_{index}.exr"));
        Ok(imaging::write_radiance(file, &rendering.radiance, &options)?)
    };
    // `ControlFlow::Break(())` would cancel between two panoramas.
    let mut on_event = |event: Event| {
        if let Some(fraction) = event.fraction() {
            eprintln!("{:.0} %", 100.0 * fraction);
        }
        ControlFlow::Continue(())
    };
    let lit = document.lit(LightPurpose::Panorama)?;
    render_probes(&lit, &points, 64, write, &mut on_event)
}
