//! The room behind an object as seen from real surfaces.
//!
//! An object hides the room behind it from real surfaces. One image of the room from the object's centre serves all
//! of them. It is interpolated and corrected for parallax: it changes smoothly with position, and receivers need no
//! cones of their own.

use lo_cone::{Cone, ConeSample};
use lo_geometry::{Vec2, Vec3};
use lo_imaging::Image;
use rayon::prelude::*;

use crate::light::environment::Environment;
use crate::light::room_light::LightPart;
use crate::surface::observed_surfaces::bilinear;

/// Largest distance, metres; also used for a map at infinity.
const FARTHEST_M: f32 = 1e4;

/// Texels per task.
const TEXELS_PER_TASK: usize = 256;

/// An octahedral map (Cigolle et al. 2014) of radiance and distance around one point.
pub(crate) struct Backdrop {
    centre_m: Vec3,
    /// Texels, with a border of one that repeats those beyond the fold.
    texels: Image<(Vec3, f32)>,
}

impl Backdrop {
    /// Renders the light without the light samples from `centre_m`, in `side` × `side` texels.
    pub fn new(environment: &Environment, centre_m: Vec3, side: usize) -> Self {
        let tan_half_angle = (4.0 / (side * side) as f32).sqrt();
        let cones: Vec<Cone> = (0..side * side)
            .map(|i| {
                let texel = Vec2::new((i % side) as f32 + 0.5, (i / side) as f32 + 0.5);
                Cone { origin: centre_m, direction: unfolded(2.0 * texel / side as f32 - 1.0), tan_half_angle }
            })
            .collect();
        let samples: Vec<ConeSample> = cones
            .par_chunks(TEXELS_PER_TASK)
            .flat_map_iter(|cones| {
                let mut samples = Vec::new();
                environment.gather(LightPart::Rest, cones, &mut samples);
                samples
            })
            .collect();
        // Across an edge of the square, the map continues mirrored about the middle of that edge.
        let folded = |at: usize| match at {
            0 => (0, true),
            at if at > side => (side - 1, true),
            at => (at - 1, false),
        };
        let texels = Image::from_fn(side + 2, side + 2, |x, y| {
            let ((column, over_x), (row, over_y)) = (folded(x), folded(y));
            let column = if over_y { side - 1 - column } else { column };
            let row = if over_x { side - 1 - row } else { row };
            let sample = samples[row * side + column];
            (Vec3::from(sample.radiance), sample.distance_m.clamp(1e-3, FARTHEST_M))
        });
        Self { centre_m, texels }
    }

    /// Returns the room's radiance that arrives at `origin` from `direction`, as if only the object were between it
    /// and the surface seen from the object's centre.
    pub fn radiance(&self, origin: Vec3, direction: Vec3) -> Vec3 {
        let offset = origin - self.centre_m;
        let along_m = -offset.dot(direction);
        let beside_squared = (offset.length_squared() - along_m * along_m).max(0.0);
        // The ray meets the room where its distance from the centre equals the room's in that direction (fixed-point
        // steps).
        let mut seen = direction;
        for _ in 0..2 {
            let distance_m = self.at(seen).1;
            let behind_m = (distance_m * distance_m - beside_squared).max(0.0).sqrt();
            seen = (offset + direction * (along_m + behind_m)).normalize_or(direction);
        }
        self.at(seen).0
    }

    fn at(&self, direction: Vec3) -> (Vec3, f32) {
        let side = self.texels.width() - 2;
        // Texel centres of the bordered image are shifted by one.
        let place = (folded(direction) * 0.5 + 0.5) * side as f32 + 0.5;
        let taps = bilinear(place.x, place.y, side + 2, side + 2);
        taps.iter().fold((Vec3::ZERO, 0.0), |sum, &(x, y, weight)| {
            let (radiance, distance_m) = self.texels[(x, y)];
            (sum.0 + radiance * weight, sum.1 + distance_m * weight)
        })
    }
}

/// Maps a direction to the octahedral square [-1, 1]².
fn folded(direction: Vec3) -> Vec2 {
    let d = direction / direction.abs().element_sum();
    if d.z >= 0.0 { Vec2::new(d.x, d.y) } else { (1.0 - Vec2::new(d.y, d.x).abs()) * sign(Vec2::new(d.x, d.y)) }
}

/// Maps a position in the octahedral square to a unit direction.
fn unfolded(place: Vec2) -> Vec3 {
    let z = 1.0 - place.abs().element_sum();
    let xy = if z >= 0.0 { place } else { (1.0 - Vec2::new(place.y, place.x).abs()) * sign(place) };
    Vec3::new(xy.x, xy.y, z).normalize()
}

/// Returns 1 or −1 for each component.
fn sign(v: Vec2) -> Vec2 {
    Vec2::ONE.copysign(v)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn octahedral_map_keeps_directions() {
        for direction in lo_geometry::fibonacci_sphere(500) {
            let place = folded(direction);
            assert!(place.abs().max_element() <= 1.0);
            assert!((unfolded(place) - direction).length() < 1e-5, "{direction}");
        }
    }

    /// Creates a backdrop from a closed form instead of an octree.
    fn of(centre_m: Vec3, side: usize, seen: impl Fn(Vec3) -> (Vec3, f32)) -> Backdrop {
        let texels = Image::from_fn(side + 2, side + 2, |x, y| {
            // The fold's formula also holds beyond the border: mirrored positions are equal directions.
            let place = Vec2::new(x as f32 - 0.5, y as f32 - 0.5) / side as f32 * 2.0 - 1.0;
            let mirrored = |a: f32, b: f32| match a {
                a if a > 1.0 => (2.0 - a, -b),
                a if a < -1.0 => (-2.0 - a, -b),
                a => (a, b),
            };
            let (px, py) = mirrored(place.x, place.y);
            let (py, px) = mirrored(py, px);
            seen(unfolded(Vec2::new(px, py)))
        });
        Backdrop { centre_m, texels }
    }

    #[test]
    fn rays_see_the_room_at_their_own_place() {
        // A spherical room of radius 3 about the world's origin whose radiance is 1 + its position.
        let centre_m = Vec3::new(0.5, -0.8, 0.2);
        let meet = |origin: Vec3, direction: Vec3| {
            let along = origin.dot(direction);
            -along + (along * along - origin.length_squared() + 9.0).sqrt()
        };
        let backdrop = of(centre_m, 64, |direction| {
            let distance_m = meet(centre_m, direction);
            (Vec3::splat(4.0) + centre_m + direction * distance_m, distance_m)
        });
        let mut worst = 0.0f32;
        for (i, direction) in lo_geometry::fibonacci_sphere(300).into_iter().enumerate() {
            let side = lo_geometry::fibonacci_sphere(300)[(i * 71) % 300];
            let origin = centre_m + 0.4 * side;
            let expected = Vec3::splat(4.0) + origin + direction * meet(origin, direction);
            worst = worst.max((backdrop.radiance(origin, direction) - expected).abs().max_element());
        }
        // Without parallax the error would be up to 0.4.
        assert!(worst < 0.06, "{worst}");
    }
}
