//! The outdoors and the portals through which they are visible.

use lo_geometry::{Ray, Vec3};
use lo_imaging::RadianceImage;

use crate::{Outdoors, Portal, Sun, TransportError};

/// Validated outdoors and portals.
pub(crate) struct Sky {
    map: RadianceImage,
    /// Whether the whole map is black.
    dark: bool,
    pub sun: Option<SunDisc>,
    pub portals: Vec<PreparedPortal>,
}

/// Sun with precomputed values for sampling.
pub(crate) struct SunDisc {
    pub sun: Sun,
    cos_radius: f32,
    pub solid_angle_sr: f32,
}

/// Portal with precomputed values for intersection tests.
pub(crate) struct PreparedPortal {
    pub portal: Portal,
    /// Unit normal, pointing into the room.
    pub normal: Vec3,
    /// Dual basis: `offset · duals[k]` is the coordinate along `edges[k]`.
    duals: [Vec3; 2],
}

/// Point where a ray leaves through a portal.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PortalCrossing {
    /// Coordinates along the edges, in [0, 1].
    pub along: [f32; 2],
    pub position: Vec3,
    /// Cosine between the ray and the outward normal.
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
        let open = |(index, &portal)| PreparedPortal::new(portal).ok_or(TransportError::Portal { index });
        let portals = portals.iter().enumerate().map(open).collect::<Result<_, _>>()?;
        Ok(Self { dark: map.pixels().iter().all(|p| *p == [0.0; 3]), map, sun, portals })
    }

    /// Returns the radiance from a direction, without the sun's disc.
    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        if self.dark { Vec3::ZERO } else { lo_imaging::sample_equirectangular(&self.map, direction).into() }
    }

    /// Returns the radiance from a direction, including the sun's disc.
    pub(crate) fn radiance_with_sun(&self, direction: Vec3) -> Vec3 {
        self.radiance(direction) + self.sun_radiance(direction)
    }

    /// Returns the radiance of the sun's disc in a direction.
    pub(crate) fn sun_radiance(&self, direction: Vec3) -> Vec3 {
        let disc = self.sun.as_ref().filter(|sun| sun.covers(direction));
        disc.map_or(Vec3::ZERO, |disc| disc.sun.radiance.into())
    }

    pub(crate) fn is_dark(&self) -> bool {
        self.dark
    }

    /// Whether a ray that hits nothing sees the outdoors: it leaves through a portal, or the world has none and is
    /// open.
    pub(crate) fn is_open(&self, ray: &Ray, most_m: f32) -> bool {
        self.portals.is_empty() || self.exits_by_portal(ray, most_m)
    }

    /// Whether the ray leaves through a portal within the distance.
    pub(crate) fn exits_by_portal(&self, ray: &Ray, most_m: f32) -> bool {
        self.portal_crossing(ray, most_m).is_some()
    }

    /// Returns the portal through which the ray leaves within the distance, with the crossing point.
    pub(crate) fn portal_crossing(&self, ray: &Ray, most_m: f32) -> Option<(usize, PortalCrossing)> {
        let crossing = |(at, opening): (usize, &PreparedPortal)| Some((at, opening.crossing(ray, most_m)?));
        self.portals.iter().enumerate().find_map(crossing)
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

    /// Maps two random numbers in [0, 1) to a direction, uniformly over the disc.
    pub(crate) fn direction(&self, [a, b]: [f32; 2]) -> Vec3 {
        let rise = (1.0 - self.cos_radius) * a;
        let radius = (rise * (2.0 - rise)).sqrt();
        let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
        lo_geometry::orthonormal_basis(self.sun.direction) * Vec3::new(radius * cos, radius * sin, 1.0 - rise)
    }
}

impl PreparedPortal {
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

    fn crossing(&self, ray: &Ray, most_m: f32) -> Option<PortalCrossing> {
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
        inside.then_some(PortalCrossing { along, position: ray.at(distance_m), cosine: -approach })
    }
}

/// Whether radiance is finite and not negative.
pub(crate) fn is_light(rgb: [f32; 3]) -> bool {
    rgb.iter().all(|v| v.is_finite() && *v >= 0.0)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn portals_are_left_from_inside_only() {
        // A skewed parallelogram in the plane z = −2 with normal +Z.
        let portal = Portal { corner: Vec3::new(0.0, 0.0, -2.0), edges: [Vec3::X, Vec3::new(0.5, 1.0, 0.0)] };
        let opening = PreparedPortal::new(portal).unwrap();
        let leaves = |x, y, z: f32| {
            opening.crossing(&Ray { origin: Vec3::new(x, y, 0.0), direction: Vec3::new(0.0, 0.0, z) }, 10.0).is_some()
        };
        assert!(leaves(0.5, 0.5, -1.0) && leaves(1.2, 0.9, -1.0) && !leaves(0.2, 0.9, -1.0));
        assert!(!leaves(0.5, 0.5, 1.0));
        let near = Ray { origin: Vec3::new(0.5, 0.5, 0.0), direction: Vec3::NEG_Z };
        assert!(opening.crossing(&near, 1.9).is_none());
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
