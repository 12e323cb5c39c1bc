use std::ops::RangeInclusive;
use std::sync::Arc;

use lo_completion::irradiance_at;
use lo_geometry::Vec3;
use lo_imaging::luminance;
use lo_lights::{ShadowSupport, SunEdge, Sunlit, color_temperature_k, rgb_from_color, shadow_support, sun_from_shadow};
use lo_scene::{AnalyticLight, Estimate, LightColor, LightShape};

use crate::lighting::plausible;

/// Share of the edges of sun patches that must not be clipped in a channel for the photo to tell how much of it the sun has.
const MIN_UNCLIPPED: f32 = 0.3;

/// Colour temperatures of sunlight in a photo whose white is the room's.
const DAYLIGHT_K: RangeInclusive<f32> = 2500.0..=10_000.0;

/// Least cosine between the sun and a surface whose shade tells how bright it is.
const MIN_COSINE: f32 = 0.2;

/// The sun that a photo shows by its patches.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotoSun {
    /// As a light to add to the scene: [`lo_scene::LightShape::Sun`] `of_photo`, as bright as the patches are beside the shade.
    pub light: AnalyticLight,
    /// Share of the photo that is in the sun.
    pub lit_share: f32,
    /// Whether patches are clipped in the photo, so that the sun is at least as bright as this.
    pub clipped: bool,
}

/// Why a thing and its shadow give no sun.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ShadowError {
    /// Depth is missing at one of the two pixels, or the shadow does not lie below the thing.
    #[error("by the scene's depth the shadow does not lie below the thing")]
    NotBelow,
    /// The photo's edges around the shadow do not support it.
    #[error("no edge of a sun patch supports the shadow: of {} sharp edges {} are sunny", support.edges, support.sunny)]
    Unsupported {
        /// Unit vector towards the sun that the two pixels give.
        direction: Vec3,
        /// The edges around the shadow.
        support: ShadowSupport,
    },
}

/// Unit vector towards the sun in which the thing at one pixel of the photo casts its shadow on another one.
///
/// # Errors
/// Where depth gives no direction, or the photo's edges do not support it ([`ShadowSupport::is_enough`]).
pub fn supported_sun(estimate: &Estimate, thing: [f64; 2], shadow: [f64; 2]) -> Result<Vec3, ShadowError> {
    let direction = sun_from_shadow(estimate, thing, shadow).ok_or(ShadowError::NotBelow)?;
    let support = shadow_support(estimate, direction, shadow);
    if support.is_enough() { Ok(direction) } else { Err(ShadowError::Unsupported { direction, support }) }
}

/// How bright the sun is that makes the patches of a scene's photo, by the light that the room gives to the shade beside them
/// in plausible light. `None` where no surface that faces it has any.
///
/// At an edge of a patch the radiances in the sun and in the shade have the ratio (E + S cos θ) / E, on any diffuse surface.
pub fn sun_of_photo(estimate: &Arc<Estimate>, direction: Vec3, angular_radius_deg: f32) -> Option<PhotoSun> {
    let sunlit = Sunlit::new(estimate.surface(), direction)?;
    let (lit, _) = plausible(estimate);
    let faces = |edge: &&SunEdge| edge.normal.dot(direction) > MIN_COSINE;
    let edges: Vec<&SunEdge> = sunlit.edges().iter().filter(faces).collect();
    let places: Vec<(Vec3, Vec3)> = edges.iter().map(|edge| (edge.shaded_m, edge.normal)).collect();
    let shade = irradiance_at(&lit.light, &places);
    let of_edge = |(edge, shade): (&&SunEdge, &Vec3)| (edge.ratio - 1.0) * *shade / edge.normal.dot(direction);
    let strengths: Vec<Vec3> = edges.iter().zip(&shade).map(of_edge).collect();
    let channel = |c: usize| {
        let unclipped = edges.iter().filter(|edge| !edge.clipped[c]).count() as f32;
        let clipped = unclipped < MIN_UNCLIPPED * edges.len() as f32;
        let told = edges.iter().zip(&strengths).filter(|(edge, _)| clipped || !edge.clipped[c]);
        Some((median(told.map(|(_, strength)| strength[c].max(0.0)).collect())?, clipped))
    };
    let channels = [channel(0)?, channel(1)?, channel(2)?];
    // Of a clipped channel there is more than the photo says: as much as of the strongest.
    let strongest = channels.iter().map(|(strength, _)| *strength).fold(0.0, f32::max);
    let strength = Vec3::from(channels.map(|(strength, clipped)| if clipped { strongest } else { strength }));
    let clipped = channels.iter().any(|(_, clipped)| *clipped);
    let shape = LightShape::Sun { direction, angular_radius_deg, of_photo: true };
    let dark = AnalyticLight { shape, radiance: [0.0; 3] };
    // Of the colours that daylight has, the nearest: what is told of three channels by three sets of edges may be green.
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

    /// A room whose surfaces all give off 0.2, so that each place gets 0.2 π. Its floor of albedo 0.5 has a patch that a sun of this strength makes, by
    /// channel; the camera looks down at it.
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
        let found = sun_of_photo(&room(strength), SUN, 0.27).unwrap();
        let own = Vec3::from(found.light.radiance) * found.light.extent();
        assert!((own / strength - 1.0).abs().max_element() < 0.1, "{own}");
        // 1.0 by 0.5 m of the floor, seen from 0.8 m above and 2 m away.
        assert!(!found.clipped && (0.02..0.1).contains(&found.lit_share), "{found:?}");
        assert!(matches!(found.light.shape, LightShape::Sun { direction: SUN, of_photo: true, .. }));
    }

    #[test]
    fn a_shadow_without_an_edge_is_refused() {
        let scene = room(Vec3::splat(4.0));
        // The wall above, and the floor: no edge lies around the second pixel.
        assert!(matches!(
            supported_sun(&scene, [120.0, 40.0], [20.0, 150.0]),
            Err(ShadowError::Unsupported { support: ShadowSupport { edges: 0, .. }, .. })
        ));
        assert_eq!(supported_sun(&scene, [20.0, 150.0], [120.0, 40.0]), Err(ShadowError::NotBelow));
    }

    #[test]
    fn a_photo_without_patches_shows_no_sun() {
        assert_eq!(sun_of_photo(&room(Vec3::ZERO), SUN, 0.27), None);
    }
}
