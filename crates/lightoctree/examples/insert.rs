//! How do I put an object into the photo? `cargo run --release -p lightoctree --example insert [SCENE [MESH
//! [PICTURE]]]`
//!
//! The example `estimate` makes the scene.

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

/// Reads, renders, writes.
pub fn run(scene: &Path, mesh: &Path, picture: &Path) -> Result<(), Box<dyn Error>> {
    let document = Document::read(scene)?;
    let estimate = &*document.estimate;
    let model = PreparedModel::new(Model::load(mesh, &LoadOptions::default())?);
    // Half a metre high, on what is seen in the lower middle of the photo.
    let (width, height) = (estimate.frame.photo.width() as f64, estimate.frame.photo.height() as f64);
    let place = Placement::rest_on_pixel(estimate, 0.53 * width, 0.79 * height, Align::Gravity)?
        .scaled(0.5 / model.bounds().size().y)
        .settled(estimate, &Base::new(&model));
    // Plausible light, with lamps that the photo does not show but whose shading it does.
    let lit = document.lit(LightPurpose::Objects { at_m: place.position_m })?;
    let inserter = Inserter::new(&lit, Lighting::Octree, Quality::Draft)?;
    let composite = inserter.render(&[Instance::new(&model, place)], &mut events::ignore)?;
    Ok(imaging::write_photo(picture, &composite.image, "example insert")?)
}
