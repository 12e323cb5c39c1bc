//! Directions in rings over the sphere, symmetric about the plane of up and view.

use std::f32::consts::{PI, TAU};

use lo_geometry::Vec3;

/// Returns directions in `rings` rings of constant latitude from +Y to −Y, evenly spaced. The mirror image (x → −x) of
/// each direction is also included.
pub(super) fn ring_directions(rings: usize) -> Vec<Vec3> {
    let ring = |ring: usize| {
        let polar_rad = (ring as f32 + 0.5) * PI / rings as f32;
        let count = (2.0 * rings as f32 * polar_rad.sin()).round() as usize;
        (0..count).map(move |i| {
            // Azimuths from −Z, symmetric about it.
            let azimuth_rad = ((i as f32 + 0.5) / count as f32 - 0.5) * TAU;
            let (sine, cosine) = polar_rad.sin_cos();
            Vec3::new(sine * azimuth_rad.sin(), cosine, -sine * azimuth_rad.cos())
        })
    };
    (0..rings).flat_map(ring).collect()
}

/// Returns the index of each direction's mirror image.
pub(super) fn mirrored(directions: &[Vec3]) -> Vec<usize> {
    let image = |direction: &Vec3| {
        let wanted = Vec3::new(-direction.x, direction.y, direction.z);
        let nearest = |&a: &usize, &b: &usize| directions[a].dot(wanted).total_cmp(&directions[b].dot(wanted));
        (0..directions.len()).max_by(nearest).expect("directions are not empty")
    };
    directions.iter().map(image).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_even_and_their_mirror_images_exact() {
        for (rings, count) in [(5, 32), (7, 64)] {
            let directions = ring_directions(rings);
            assert_eq!(directions.len(), count);
            let sum = directions.iter().sum::<Vec3>() / count as f32;
            assert!(sum.length() < 0.02, "{sum}");
            let images = mirrored(&directions);
            for (direction, image) in directions.iter().zip(&images) {
                let image = directions[*image];
                assert!((image - Vec3::new(-direction.x, direction.y, direction.z)).length() < 1e-5);
            }
            assert!(images.iter().enumerate().all(|(i, &image)| images[image] == i));
        }
    }
}
