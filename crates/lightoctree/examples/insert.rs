//! Inserts an object into the photo.
//!
//! `cargo run --release -p lightoctree --example insert [SCENE [MESH [IMAGE]]]`
//!
//! The example `estimate` writes SCENE.

use std::error::Error;
use std::path::Path;

use lightoctree::insert::{Align, Base, Inserter, Instance, Lighting, Placement, Quality};
use lightoctree::mesh::{LoadOptions, Model, PreparedModel};
use lightoctree::{Document, LightPurpose, events, imaging};

const MESH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/suzanne.glb");

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = |default: &str| args.next().unwrap_or_else(|| default.to_owned());
    run(next("room.scene").as_ref(), next(MESH).as_ref(), next("inserted.png").as_ref())
}

/// Reads the scene, inserts the mesh and writes the image.
pub fn run(scene: &Path, mesh: &Path, image: &Path) -> Result<(), Box<dyn Error>> {
    let document = Document::read(scene)?;
    let estimate = &*document.estimate;
    let model = PreparedModel::new(Model::load(mesh, &LoadOptions::default())?);
    // Half a metre high, resting on the surface in the lower middle of the photo.
    let (width, height) = (estimate.frame.photo.width() as f64, estimate.frame.photo.height() as f64);
    let placement = Placement::rest_on_pixel(estimate, 0.53 * width, 0.79 * height, Align::Gravity)?
        .scaled(0.5 / model.bounds().size().y)
        .settled(estimate, &Base::new(&model));
    // Plausible light: lamps outside the photo are inferred from its shading.
    let lit = document.lit(LightPurpose::Objects { at_m: placement.position_m })?;
    let inserter = Inserter::new(&lit, Lighting::Octree, Quality::Draft)?;
    let composite = inserter.render(&[Instance::new(&model, placement)], &mut events::ignore)?;
    Ok(imaging::write_photo(image, &composite.image, "example insert")?)
}
