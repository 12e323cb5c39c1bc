//! What lies beyond the windows, and the openings through which it is seen.

use lo_geometry::{Ray, Vec3};
use lo_imaging::RadianceImage;

use crate::{Outdoors, Portal, Sun, TransportError};

/// Outdoors and portals, checked.
pub(crate) struct Sky {
    map: RadianceImage,
    /// No texel gives any light.
    dark: bool,
    pub sun: Option<SunDisc>,
    pub portals: Vec<Opening>,
}

/// The sun with what sampling it needs.
pub(crate) struct SunDisc {
    pub sun: Sun,
    cos_radius: f32,
    pub solid_angle_sr: f32,
}

/// A portal with what tests against it need.
pub(crate) struct Opening {
    pub portal: Portal,
    /// Into the room.
    pub normal: Vec3,
    /// Dual basis: `offset · duals[k]` is the coordinate along `edges[k]`.
    duals: [Vec3; 2],
}

/// Where a ray leaves by a portal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlaceInPortal {
    /// Shares of the edges.
    pub along: [f32; 2],
    pub position: Vec3,
    /// Between the ray and the way out.
    pub cosine: f32,
}

impl Sky {
    pub(crate) fn new(outdoors: Outdoors, portals: &[Portal]) -> Result<Self, TransportError> {
        let map = outdoors.radiance;
        if map.pixels().is_empty() {
            return Err(TransportError::EmptyOutdoors);
        }
        if let Some(pixel) = map.pixels().iter().position(|&p| !is_light(p)) {
            return Err(TransportError::OutdoorsRadiance { pixel, radiance: map.pixels()[pixel] });
        }
        let sun = outdoors.sun.map(SunDisc::new).transpose()?;
        let open = |(index, &portal)| Opening::new(portal).ok_or(TransportError::Portal { index });
        let portals = portals.iter().enumerate().map(open).collect::<Result<_, _>>()?;
        Ok(Self { dark: map.pixels().iter().all(|p| *p == [0.0; 3]), map, sun, portals })
    }

    /// Radiance from a direction without the sun's disc.
    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        if self.dark { Vec3::ZERO } else { lo_imaging::sample_equirectangular(&self.map, direction).into() }
    }

    /// Radiance from a direction, the sun's disc included.
    pub(crate) fn radiance_with_sun(&self, direction: Vec3) -> Vec3 {
        self.radiance(direction) + self.sun_radiance(direction)
    }

    /// Radiance of the sun's disc in a direction.
    pub(crate) fn sun_radiance(&self, direction: Vec3) -> Vec3 {
        let disc = self.sun.as_ref().filter(|sun| sun.covers(direction));
        disc.map_or(Vec3::ZERO, |disc| disc.sun.radiance.into())
    }

    pub(crate) fn is_dark(&self) -> bool {
        self.dark
    }

    /// Whether a ray that meets nothing sees the outdoors: it leaves by a portal, or the world has none and is open.
    pub(crate) fn is_open(&self, ray: &Ray, most_m: f32) -> bool {
        self.portals.is_empty() || self.leaves_by_portal(ray, most_m)
    }

    /// Whether the ray leaves the room through a portal within the distance.
    pub(crate) fn leaves_by_portal(&self, ray: &Ray, most_m: f32) -> bool {
        self.portal_left(ray, most_m).is_some()
    }

    /// The portal by which the ray leaves the room within the distance, with the place in it.
    pub(crate) fn portal_left(&self, ray: &Ray, most_m: f32) -> Option<(usize, PlaceInPortal)> {
        let place = |(at, opening): (usize, &Opening)| Some((at, opening.leaves_by(ray, most_m)?));
        self.portals.iter().enumerate().find_map(place)
    }
}

impl SunDisc {
    fn new(sun: Sun) -> Result<Self, TransportError> {
        let angle = sun.angular_radius_rad;
        let unit = (sun.direction.length() - 1.0).abs() < 1e-3;
        if !(unit && angle > 0.0 && angle <= 0.5 && is_light(sun.radiance)) {
            return Err(TransportError::Sun(sun));
        }
        // 1 − cos without cancellation.
        let rise = 2.0 * (0.5 * angle).sin().powi(2);
        let sun = Sun { direction: sun.direction.normalize(), ..sun };
        Ok(Self { sun, cos_radius: 1.0 - rise, solid_angle_sr: std::f32::consts::TAU * rise })
    }

    fn covers(&self, direction: Vec3) -> bool {
        direction.dot(self.sun.direction) >= self.cos_radius
    }

    /// Direction of the point of the disc that belongs to two random numbers in [0, 1), all with equal density.
    pub(crate) fn direction(&self, [a, b]: [f32; 2]) -> Vec3 {
        let rise = (1.0 - self.cos_radius) * a;
        let radius = (rise * (2.0 - rise)).sqrt();
        let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
        lo_geometry::orthonormal_basis(self.sun.direction) * Vec3::new(radius * cos, radius * sin, 1.0 - rise)
    }
}

impl Opening {
    fn new(portal: Portal) -> Option<Self> {
        let [a, b] = portal.edges;
        let cross = a.cross(b);
        let area2 = cross.length_squared();
        if !(portal.corner.is_finite() && area2.is_finite() && area2 > 0.0) {
            return None;
        }
        let duals = [b.cross(cross) / area2, cross.cross(a) / area2];
        let normal = cross / area2.sqrt();
        (duals.iter().all(|d| d.is_finite()) && normal.is_finite()).then_some(Self { portal, normal, duals })
    }

    fn leaves_by(&self, ray: &Ray, most_m: f32) -> Option<PlaceInPortal> {
        let approach = ray.direction.dot(self.normal);
        if approach >= 0.0 {
            return None;
        }
        let distance_m = (self.portal.corner - ray.origin).dot(self.normal) / approach;
        if !(distance_m > 0.0 && distance_m < most_m) {
            return None;
        }
        let offset = ray.at(distance_m) - self.portal.corner;
        let along = self.duals.map(|dual| offset.dot(dual));
        let inside = along.iter().all(|share| (0.0..=1.0).contains(share));
        inside.then_some(PlaceInPortal { along, position: ray.at(distance_m), cosine: -approach })
    }
}

/// Finite and not negative.
pub(crate) fn is_light(rgb: [f32; 3]) -> bool {
    rgb.iter().all(|v| v.is_finite() && *v >= 0.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn portals_are_left_from_inside_only() {
        // A skewed parallelogram in the plane z = −2 whose normal is +Z.
        let portal = Portal { corner: Vec3::new(0.0, 0.0, -2.0), edges: [Vec3::X, Vec3::new(0.5, 1.0, 0.0)] };
        let opening = Opening::new(portal).unwrap();
        let leaves = |x, y, z: f32| {
            opening.leaves_by(&Ray { origin: Vec3::new(x, y, 0.0), direction: Vec3::new(0.0, 0.0, z) }, 10.0).is_some()
        };
        assert!(leaves(0.5, 0.5, -1.0) && leaves(1.2, 0.9, -1.0) && !leaves(0.2, 0.9, -1.0));
        assert!(!leaves(0.5, 0.5, 1.0));
        let near = Ray { origin: Vec3::new(0.5, 0.5, 0.0), direction: Vec3::NEG_Z };
        assert!(opening.leaves_by(&near, 1.9).is_none());
    }

    #[test]
    fn the_disc_is_sampled_inside_itself() {
        let sun = Sun { direction: Vec3::new(0.6, 0.8, 0.0), angular_radius_rad: 0.1, radiance: [1.0; 3] };
        let disc = SunDisc::new(sun).unwrap();
        // 2π(1 − cos 0.1)
        assert!((disc.solid_angle_sr - 0.031_389_8).abs() < 1e-6);
        let angles: Vec<f32> =
            (0..64).map(|i| disc.direction(crate::pattern::r2(i).into()).dot(sun.direction)).collect();
        assert!(angles.iter().all(|c| c.acos() < 0.1001) && angles.iter().any(|c| c.acos() > 0.09));
    }
}
