use std::sync::Arc;

use lightoctree::{LitScene, SceneRenderer};
use lo_cone::Rendering;
use lo_geometry::{Vec3, pixel_direction};
use lo_imaging as imaging;
use lo_imaging::{EnvironmentLayout, ExrOptions, Image, RadianceImage, ToneCurve};
use rayon::prelude::*;

use crate::lit::LitSceneCache;
use crate::overlay::{origin_color, origin_of};
use crate::renderer::at_side;
use crate::{OpenScene, RESTING_SIDE, SessionError, State};

/// Renders the light at points of one scene.
pub struct Probe {
    scenes: Arc<LitSceneCache>,
    cached: Option<(Arc<LitScene>, SceneRenderer)>,
}

/// Images of a probe for display.
pub struct ProbeImages {
    /// Equirectangular panorama in the photo's orientation: the centre is the camera's axis.
    pub panorama: Image<[u8; 3]>,
    /// Mirror ball as seen from the camera's direction, orthographic; black background.
    pub ball: Image<[u8; 3]>,
    /// Provenance of each pixel of the panorama, by colour.
    pub provenance: Image<[u8; 3]>,
}

/// Returns the point at a distance above the surface seen at a pixel; `None` if there is no surface.
pub fn probe_position(open: &OpenScene, [u, v]: [f64; 2], lift_m: f32) -> Option<Vec3> {
    let (position_m, normal) = open.surfaces.at_pixel(u, v)?;
    Some(position_m + normal * lift_m)
}

impl Probe {
    /// Creates a probe for one scene.
    pub fn new(scenes: Arc<LitSceneCache>) -> Self {
        Self { scenes, cached: None }
    }

    fn renderer(&mut self, state: &State) -> Result<&(Arc<LitScene>, SceneRenderer), SessionError> {
        let lit = self.scenes.lit(state)?;
        let cached = match self.cached.take() {
            Some(cached) if Arc::ptr_eq(&cached.0, &lit) => cached,
            // A photo of this size is sharper than any displayed panorama.
            _ => (lit.clone(), SceneRenderer::new(&at_side(&lit, RESTING_SIDE))),
        };
        Ok(self.cached.insert(cached))
    }

    /// Renders the light at a point: a panorama of `2 × height` by `height` pixels and a ball of `height` pixels.
    /// Radiance is scaled by 2^`exposure_ev` and clipped at white.
    ///
    /// # Errors
    /// Those of [`LitSceneCache::lit`].
    pub fn images(
        &mut self,
        state: &State,
        at: Vec3,
        height: usize,
        exposure_ev: f32,
    ) -> Result<ProbeImages, SessionError> {
        let (scene, renderer) = self.renderer(state)?;
        let Rendering { radiance, distance_m, .. } = renderer.panorama(at, 2 * height, height);
        let provenance = Image::from_fn(2 * height, height, |x, y| {
            let direction = pixel_direction(x, y, 2 * height, height);
            origin_color(origin_of(scene, at, direction, distance_m[(x, y)]))
        });
        Ok(ProbeImages {
            panorama: ToneCurve::Clip.map(&radiance, exposure_ev),
            ball: ToneCurve::Clip.map(&ball(&radiance, at, height), exposure_ev),
            provenance,
        })
    }

    /// Encodes the HDR panorama at a point as OpenEXR, as `lightoctree envmap --lamp` writes it.
    ///
    /// # Errors
    /// Those of [`LitSceneCache::lit`].
    pub fn exr(scenes: &LitSceneCache, state: &State, at: Vec3, height: usize) -> Result<Vec<u8>, SessionError> {
        let panorama = SceneRenderer::new(&*scenes.lit(state)?).panorama(at, 2 * height, height);
        let options = ExrOptions {
            generator: "lightoctree envmap".to_owned(),
            environment: Some(EnvironmentLayout::LatitudeLongitude),
            metadata: vec![
                ("lightoctree.position_m".into(), format!("{} {} {}", at.x, at.y, at.z)),
                ("lightoctree.orientation".into(), "lightoctree".into()),
                ("lightoctree.units".into(), "linear Rec. 709; 1 is the photo's white".into()),
            ],
            ..ExrOptions::default()
        };
        let groups = [imaging::ChannelGroup::rgb("", &panorama.radiance)];
        Ok(imaging::encode_exr("panorama.exr", (2 * height, height), &groups, &options)?)
    }
}

/// Renders a mirror ball lit by a panorama, in orthographic view from the camera's direction; black background.
fn ball(panorama: &RadianceImage, at: Vec3, side: usize) -> RadianceImage {
    let view = at.normalize_or(Vec3::NEG_Z);
    let right = view.cross(Vec3::Y).normalize_or(Vec3::X);
    let up = right.cross(view);
    let of = |pixel: usize| (2.0 * (pixel as f32 + 0.5) / side as f32) - 1.0;
    let pixel = |index: usize| {
        let (x, y) = (of(index % side), -of(index / side));
        let squared = x * x + y * y;
        if squared >= 1.0 {
            return [0.0; 3];
        }
        let normal = right * x + up * y - view * (1.0 - squared).sqrt();
        let reflected = view - normal * (2.0 * view.dot(normal));
        imaging::sample_equirectangular(panorama, reflected)
    };
    RadianceImage::new(side, side, (0..side * side).into_par_iter().map(pixel).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mirror_ball_shows_behind_the_camera_in_its_middle_and_ahead_at_its_rim() {
        // Red ahead, green behind, blue to the right.
        let map = RadianceImage::from_fn(64, 32, |x, y| {
            let direction = pixel_direction(x, y, 64, 32);
            [-direction.z, direction.z, direction.x].map(|value| value.max(0.0))
        });
        let ball = ball(&map, Vec3::new(0.0, 0.0, -2.0), 65);
        let middle = ball[(32, 32)];
        assert!(middle[1] > 0.99 && middle[0] < 0.01, "{middle:?}");
        let rim = ball[(64, 32)];
        assert!(rim[0] > 0.8 && rim[1] < 0.05, "{rim:?}");
        // At 45°, it mirrors what is to the right.
        let side = ball[(32 + 23, 32)];
        assert!(side[2] > 0.95, "{side:?}");
        assert_eq!(ball[(0, 0)], [0.0; 3]);
    }
}
