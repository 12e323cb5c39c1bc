//! How do I put an object into the photo? `cargo run --release -p lightoctree --example insert [SCENE [MESH [PICTURE]]]`
//!
//! The example `estimate` makes the scene.

use std::error::Error;
use std::path::Path;

use lightoctree::insert::{Align, Base, Inserter, Instance, Lighting, Placement, Quality};
use lightoctree::mesh::{LoadOptions, Model, PreparedModel};
use lightoctree::scene::Scene;
use lightoctree::{events, fit_lamps, imaging};

const MESH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/models/suzanne.glb");

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let mut next = |default: &str| args.next().unwrap_or_else(|| default.to_owned());
    run(next("room.scene").as_ref(), next(MESH).as_ref(), next("inserted.png").as_ref())
}

/// Reads, renders, writes.
pub fn run(scene: &Path, mesh: &Path, picture: &Path) -> Result<(), Box<dyn Error>> {
    let mut scene = Scene::read(scene)?;
    // Lamps that the photo does not show, but that what it shows asks for.
    fit_lamps(&mut scene);
    let model = PreparedModel::new(Model::load(mesh, &LoadOptions::default())?);
    // Half a metre high, on what is seen in the lower middle of the photo.
    let (width, height) = (scene.frame.photo.width() as f64, scene.frame.photo.height() as f64);
    let place = Placement::rest_on_pixel(&scene, 0.53 * width, 0.79 * height, Align::Gravity)?
        .scaled(0.5 / model.bounds().size().y)
        .settled(&scene, &Base::new(&model));
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Draft)?;
    let composite = inserter.render(&[Instance::new(&model, place)], &mut events::ignore)?;
    Ok(imaging::write_photo(picture, &composite.image, "example insert")?)
}
