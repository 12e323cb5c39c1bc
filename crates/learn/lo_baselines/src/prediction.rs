//! The light that a baseline predicts, as asked for at points of the room.

use lo_geometry::Vec3;
use lo_imaging::{RadianceImage, sample_equirectangular};

use crate::gaussians::Gaussian;
use crate::harmonics::Harmonics;
use crate::volume::Volume;

/// Predicted light of a photo's room.
#[derive(Clone, Debug, PartialEq)]
pub enum Prediction {
    /// One panorama in the photo's frame, for all points.
    Map(RadianceImage),
    /// Light at the surfaces that the photo shows.
    Surface(SurfaceLight),
    /// A dense volume of radiance and opacity.
    Volume(Volume),
}

/// Light at points of seen surfaces.
#[derive(Clone, Debug, PartialEq)]
pub struct SurfaceLight {
    /// Positions in the photo's frame, metres; at least one.
    pub points: Vec<Vec3>,
    /// Light of each point.
    pub light: Vec<CellLight>,
}

/// Light at one point, in directions of the photo's frame.
#[derive(Clone, Debug, PartialEq)]
pub enum CellLight {
    /// Spherical harmonics.
    Harmonics(Box<Harmonics>),
    /// Spherical Gaussians.
    Gaussians(Vec<Gaussian>),
}

impl CellLight {
    /// Returns the radiance from a unit direction.
    pub fn radiance(&self, direction: Vec3) -> [f32; 3] {
        match self {
            Self::Harmonics(harmonics) => harmonics.radiance(direction),
            Self::Gaussians(lobes) => {
                let mut sum = [0.0; 3];
                for lobe in lobes {
                    let radiance = lobe.radiance(direction);
                    (0..3).for_each(|c| sum[c] += radiance[c]);
                }
                sum
            }
        }
    }
}

impl SurfaceLight {
    /// Returns the light of the surface point nearest to a position.
    pub fn at(&self, position_m: Vec3) -> &CellLight {
        let distance = |point: &Vec3| (*point - position_m).length_squared();
        let points = self.points.iter().enumerate();
        let nearest = points.min_by(|a, b| distance(a.1).total_cmp(&distance(b.1))).map_or(0, |(index, _)| index);
        &self.light[nearest]
    }
}

impl Prediction {
    /// Returns the radiance that arrives at a position from unit directions, both in the photo's frame.
    pub fn radiance(&self, position_m: Vec3, directions: &[Vec3]) -> Vec<[f32; 3]> {
        match self {
            Self::Map(map) => directions.iter().map(|&direction| sample_equirectangular(map, direction)).collect(),
            Self::Surface(surface) => {
                let light = surface.at(position_m);
                directions.iter().map(|&direction| light.radiance(direction)).collect()
            }
            Self::Volume(volume) => volume.radiance(position_m, directions),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_surface_answers() {
        let lobe = |intensity| {
            CellLight::Gaussians(vec![Gaussian { axis: Vec3::X, sharpness: 1.0, intensity: [intensity; 3] }])
        };
        let surface = SurfaceLight {
            points: vec![Vec3::new(0.0, 0.0, -1.0), Vec3::new(0.0, 0.0, -3.0)],
            light: vec![lobe(1.0), lobe(5.0)],
        };
        let prediction = Prediction::Surface(surface);
        let at = |z: f32| prediction.radiance(Vec3::new(0.5, 0.0, z), &[Vec3::X, Vec3::NEG_X]);
        assert_eq!((at(1.0)[0][0], at(-1.9)[0][0], at(-2.1)[0][0]), (1.0, 1.0, 5.0));
        assert!((at(-9.0)[1][2] - 5.0 * (-2.0f32).exp()).abs() < 1e-6);
        let map = RadianceImage::from_fn(8, 4, |x, _| [x as f32; 3]);
        let prediction = Prediction::Map(map.clone());
        let directions = [Vec3::new(0.3, 0.2, -0.9).normalize()];
        for position in [Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0)] {
            assert_eq!(prediction.radiance(position, &directions)[0], sample_equirectangular(&map, directions[0]));
        }
    }
}
