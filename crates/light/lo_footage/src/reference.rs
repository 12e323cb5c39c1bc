use lo_imaging::{Photo, srgb_from_linear};
use lo_scene::resized_photo;

/// Size at which photos are compared.
const SIZE: (usize, usize) = (32, 24);

/// Returns how much a plate differs from a photo: root mean square in sRGB's range, of both reduced to 32 × 24 pixels.
/// One and the same image at two sizes or in two formats differs by less than 0.01.
pub fn likeness(plate: &Photo, photo: &Photo) -> f32 {
    let small = |photo: &Photo| resized_photo(photo, SIZE.0, SIZE.1).into_radiance();
    let (a, b) = (small(plate), small(photo));
    let values = a.pixels().as_flattened().iter().zip(b.pixels().as_flattened());
    let code = |value: f32| srgb_from_linear(value.clamp(0.0, 1.0));
    let sum: f32 = values.map(|(&a, &b)| (code(a) - code(b)).powi(2)).sum();
    (sum / (3 * SIZE.0 * SIZE.1) as f32).sqrt()
}
