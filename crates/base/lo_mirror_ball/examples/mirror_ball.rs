//! Renders a bracket of photos of a mirror ball in a real panorama and unwraps it: the image of `docs/gallery.md`.
//!
//! `cargo run -p lo_mirror_ball --example mirror_ball -- panorama.hdr picture.jpg [folder for the photos]`

#[path = "../tests/it/render.rs"]
mod render;

use std::error::Error;
use std::path::Path;

use lo_imaging::{
    GENERATOR, JPEG_QUALITY, Photo, ToneCurve, contact_sheet, photo_tile, read_radiance, resize_equirectangular,
    write_srgb8,
};
use lo_mirror_ball::{BallLens, UnwrapOptions, estimate_stops, find_ball, merge_exposures, unwrap_ball};
use render::{BallScene, expose, map_radiance};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let (Some(panorama), Some(picture)) = (args.next(), args.next()) else {
        return Err("panorama.hdr picture.jpg [folder]".into());
    };
    let map = read_radiance(&panorama)?;
    let mut levels: Vec<f32> = map.pixels().iter().map(|rgb| rgb[1]).collect();
    let middle = levels.len() / 2;
    let gain = 0.25 / levels.select_nth_unstable_by(middle, f32::total_cmp).1.max(1e-6);
    let map = map.map(|rgb| rgb.map(|v| v * gain));

    // a field of view of 43 degrees, the ball slightly off the axis
    let shot = BallScene { size: [960, 720], middle: [494.0, 372.0], radius_px: 290.0, focal_px: Some(1220.0) };
    let light = shot.render(&map_radiance(&map), &|ray, _| map_radiance(&map)(ray), 3);
    let photos: Vec<Photo> =
        [0.0, -3.0, -6.0].iter().enumerate().map(|(i, &stop)| expose(&light, stop, 8000.0, i as u32)).collect();

    let merged = merge_exposures(&photos, &estimate_stops(&photos)?)?;
    let found = find_ball(&merged.radiance, BallLens::Focal { focal_px: 1220.0 })?.ok_or("no ball")?;
    let unwrapped = unwrap_ball(&merged, &found.view, &UnwrapOptions::default())?;
    println!("{:?}, confidence {:.2}", found.view.circle(), found.confidence);

    let tile = |photo: &Photo| match photo {
        Photo::Linear(image) => ToneCurve::Clip.map(image, 0.0),
        photo => photo_tile(&photo.srgb8(), 400, 300),
    };
    let shown = |map: &lo_imaging::RadianceImage| ToneCurve::Aces.map(&resize_equirectangular(map, 600, 300), 0.0);
    let sheet = [tile(&photos[0]), shown(&unwrapped.radiance), shown(&map)];
    write_srgb8(&picture, &contact_sheet(&[&sheet], 4), 88, GENERATOR)?;
    if let Some(folder) = args.next() {
        for (index, photo) in photos.iter().enumerate() {
            let Photo::Srgb8(image) = photo else { continue };
            write_srgb8(Path::new(&folder).join(format!("ball_{index}.jpg")), image, JPEG_QUALITY, GENERATOR)?;
        }
    }
    Ok(())
}
