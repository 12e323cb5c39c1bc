//! Estimates a scene file from a photo.
//!
//! `cargo run --release -p lightoctree --example estimate [PHOTO [SCENE]]`

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

use lightoctree::{Document, EstimateOptions, Estimator, Event, Input, imaging};

const PHOTO: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../apps/lightoctree-cli/assets/library_color.jpg");

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = |default: &str| args.next().unwrap_or_else(|| default.to_owned());
    run(next(PHOTO).as_ref(), next("room.scene").as_ref())
}

/// Reads the photo, estimates the room and writes the scene.
pub fn run(photo: &Path, scene: &Path) -> Result<(), Box<dyn Error>> {
    let photo = imaging::read_photo(photo)?;
    let estimator = Estimator::shipped()?;
    // The lens is from EXIF, or estimated by the network.
    let (camera, _source) = estimator.camera_of(&photo)?;
    let input = Input::Photo { photo: photo.photo, camera };
    // Receives progress and warnings; `ControlFlow::Break(())` would cancel the estimate.
    let mut on_event = |event| {
        match event {
            Event::Done { stage, took } => eprintln!("{stage}: {took:.1?}"),
            Event::Warning(warning) => eprintln!("{warning}"),
            _ => {}
        }
        ControlFlow::Continue(())
    };
    let estimate = estimator.estimate(input, &EstimateOptions::default(), &mut on_event)?;
    Ok(Document::new(estimate).write(scene, "example estimate")?)
}
