use std::ops::RangeInclusive;
use std::sync::Arc;

use lo_completion::irradiance_at;
use lo_geometry::Vec3;
use lo_imaging::luminance;
use lo_lights::{ShadowSupport, SunEdge, Sunlit, color_temperature_k, rgb_from_color, shadow_support, sun_from_shadow};
use lo_scene::{AnalyticLight, Estimate, LightColor, LightShape};

use crate::lighting::plausible_light;

/// Least share of sun-patch edges unclipped in a channel at which that channel of the sun is measured.
const MIN_UNCLIPPED: f32 = 0.3;

/// Colour temperatures of sunlight in a photo that is white-balanced for the room, in kelvin.
const DAYLIGHT_K: RangeInclusive<f32> = 2500.0..=10_000.0;

/// Least cosine between the sun and the normal of a surface that measures its brightness.
const MIN_COSINE: f32 = 0.2;

/// A sun estimated from the sun patches of a photo.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoSun {
    /// The light to add to the scene: a [`LightShape::Sun`](lo_scene::LightShape::Sun) with `of_photo`.
    ///
    /// Its radiance explains the contrast between the patches and the adjacent shade.
    pub light: AnalyticLight,
    /// Share of the photo that is sunlit, 0 to 1.
    pub lit_share: f32,
    /// Whether patches are clipped in the photo. The radiance is then a lower bound.
    pub clipped: bool,
}

/// An error of [`supported_sun`].
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ShadowError {
    /// Depth is missing at one of the two pixels, or the shadow is not below the object.
    #[error("by the scene's depth, the shadow is not below the object")]
    NotBelow,
    /// The photo's edges around the shadow do not support the direction.
    #[error("no edge of a sun patch supports the shadow: of {} sharp edges {} are sunny", support.edges, support.sunny)]
    Unsupported {
        /// Unit vector towards the sun, from the two pixels.
        direction: Vec3,
        /// Counts of edges around the shadow.
        support: ShadowSupport,
    },
}

/// Returns the unit vector towards the sun under which an object casts its shadow onto another pixel.
///
/// `object` and `shadow` are column and row in pixels of the photo.
///
/// # Errors
/// - [`ShadowError::NotBelow`] if depth gives no direction.
/// - [`ShadowError::Unsupported`] if too few edges of sun patches agree ([`ShadowSupport::is_enough`]).
pub fn supported_sun(estimate: &Estimate, object: [f64; 2], shadow: [f64; 2]) -> Result<Vec3, ShadowError> {
    let direction = sun_from_shadow(estimate, object, shadow).ok_or(ShadowError::NotBelow)?;
    let support = shadow_support(estimate, direction, shadow);
    if support.is_enough() { Ok(direction) } else { Err(ShadowError::Unsupported { direction, support }) }
}

/// Estimates the radiance of the sun from the sun patches in an estimate's photo.
///
/// `direction` is the unit vector towards the sun. `angular_radius_deg` is its angular radius in degrees, 0.27 for the
/// real sun. Returns `None` if no surface that faces the sun has a patch with sharp edges.
///
/// At an edge of a patch on any diffuse surface, the radiances in sun and shade have the ratio (E + S cos θ) / E. E is
/// the irradiance of the shade in plausible light, S the sun's irradiance at normal incidence.
pub fn sun_from_photo(estimate: &Arc<Estimate>, direction: Vec3, angular_radius_deg: f32) -> Option<PhotoSun> {
    let sunlit = Sunlit::new(estimate.surface(), estimate.surface_normals(), direction)?;
    let (lit, _) = plausible_light(estimate);
    let faces = |edge: &&SunEdge| edge.normal.dot(direction) > MIN_COSINE;
    let edges: Vec<&SunEdge> = sunlit.edges().iter().filter(faces).collect();
    let surfaces: Vec<(Vec3, Vec3)> = edges.iter().map(|edge| (edge.shaded_m, edge.normal)).collect();
    let shade = irradiance_at(&lit.light, &surfaces);
    let of_edge = |(edge, shade): (&&SunEdge, &Vec3)| (edge.ratio - 1.0) * *shade / edge.normal.dot(direction);
    let strengths: Vec<Vec3> = edges.iter().zip(&shade).map(of_edge).collect();
    let channel = |c: usize| {
        let unclipped = edges.iter().filter(|edge| !edge.clipped[c]).count() as f32;
        let clipped = unclipped < MIN_UNCLIPPED * edges.len() as f32;
        let measured = edges.iter().zip(&strengths).filter(|(edge, _)| clipped || !edge.clipped[c]);
        Some((median(measured.map(|(_, strength)| strength[c].max(0.0)).collect())?, clipped))
    };
    let channels = [channel(0)?, channel(1)?, channel(2)?];
    // A clipped channel is underestimated, so it gets the value of the strongest channel.
    let strongest = channels.iter().map(|(strength, _)| *strength).fold(0.0, f32::max);
    let strength = Vec3::from(channels.map(|(strength, clipped)| if clipped { strongest } else { strength }));
    let clipped = channels.iter().any(|(_, clipped)| *clipped);
    let shape = LightShape::Sun { direction, angular_radius_deg, of_photo: true };
    let dark = AnalyticLight { shape, radiance: [0.0; 3] };
    // Snapped to daylight, because three channels from three sets of edges may combine to green.
    let kelvin = color_temperature_k(strength.to_array()).filter(|kelvin| DAYLIGHT_K.contains(kelvin));
    let colour = kelvin.map_or(Vec3::ONE, |kelvin| rgb_from_color(LightColor::Kelvin(kelvin)));
    let radiance = (colour * (luminance(strength.to_array()) / dark.extent())).to_array();
    let all = sunlit.lit().pixels();
    let lit_share = all.iter().sum::<f32>() / all.len() as f32;
    Some(PhotoSun { light: AnalyticLight { radiance, ..dark }, lit_share, clipped })
}

fn median(mut values: Vec<f32>) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f32::consts::PI;

    use lo_geometry::{Camera, Cube};
    use lo_imaging::{DepthMap, Image, Photo};
    use lo_octree::{LightOctree, Provenance, RadiancePoint};
    use lo_scene::Frame;

    use super::*;

    const FLOOR_M: f32 = -0.8;
    const SUN: Vec3 = Vec3::new(0.36, 0.8, 0.48);

    /// A room whose surfaces all have radiance 0.2, so that irradiance is 0.2 π everywhere.
    ///
    /// Its floor, of albedo 0.5, has a patch from a sun of irradiance `strength`. The camera looks down at it.
    fn room(strength: Vec3) -> Arc<Estimate> {
        let (width, height) = (240, 160);
        let points = lo_geometry::fibonacci_sphere(200_000).into_iter().map(|direction| {
            let far = (2.5 / direction.abs()).min_element();
            let position_m = direction * far.min(if direction.y < 0.0 { FLOOR_M / direction.y } else { f32::INFINITY });
            RadiancePoint { position_m, radiance: [0.2; 3], provenance: Provenance::Inferred }
        });
        let points: Vec<RadiancePoint> = points.collect();
        let light = LightOctree::from_points(&points, Cube::centred(Vec3::ZERO, 5.5), 6, 4).unwrap().0;
        let camera = Camera::from_hfov_deg(70.0, width as u32, height as u32).unwrap();
        let shown = |x: usize, y: usize| {
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let floor = if direction.y < 0.0 { FLOOR_M / direction.y } else { f32::INFINITY };
            direction * floor.min(-2.5 / direction.z)
        };
        let photo = Image::from_fn(width, height, |x, y| {
            let at = shown(x, y);
            let lit = at.y < FLOOR_M + 1e-3 && at.x.abs() < 0.5 && (-2.3..-1.8).contains(&at.z);
            let light = Vec3::splat(0.2 * PI) + if lit { strength * SUN.y } else { Vec3::ZERO };
            (light * (0.5 / PI)).to_array()
        });
        let depth_m = DepthMap::from_fn(width, height, |x, y| -shown(x, y).z);
        Arc::new(Estimate::observed_only(light, Frame::new(Photo::Linear(photo), depth_m, camera, 1.0).unwrap()))
    }

    #[test]
    fn the_sun_is_as_bright_as_its_patches_say() {
        let strength = rgb_from_color(LightColor::Kelvin(5000.0)) * 4.0;
        let found = sun_from_photo(&room(strength), SUN, 0.27).unwrap();
        let own = Vec3::from(found.light.radiance) * found.light.extent();
        assert!((own / strength - 1.0).abs().max_element() < 0.1, "{own}");
        // The patch is 1.0 m by 0.5 m, 2 m away and 0.8 m below the camera.
        assert!(!found.clipped && (0.02..0.1).contains(&found.lit_share), "{found:?}");
        assert!(matches!(found.light.shape, LightShape::Sun { direction: SUN, of_photo: true, .. }));
    }

    #[test]
    fn a_shadow_without_an_edge_is_refused() {
        let scene = room(Vec3::splat(4.0));
        // The wall above, and the floor: there is no edge around the second pixel.
        assert!(matches!(
            supported_sun(&scene, [120.0, 40.0], [20.0, 150.0]),
            Err(ShadowError::Unsupported { support: ShadowSupport { edges: 0, .. }, .. })
        ));
        assert_eq!(supported_sun(&scene, [20.0, 150.0], [120.0, 40.0]), Err(ShadowError::NotBelow));
    }

    #[test]
    fn a_photo_without_patches_shows_no_sun() {
        assert_eq!(sun_from_photo(&room(Vec3::ZERO), SUN, 0.27), None);
    }
}
