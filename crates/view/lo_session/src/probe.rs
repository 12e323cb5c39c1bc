use std::sync::Arc;

use lightoctree::cone::Rendering;
use lightoctree::geometry::{Vec3, pixel_direction};
use lightoctree::imaging::{self, EnvironmentLayout, ExrOptions, Image, RadianceImage, ToneCurve};
use lightoctree::{LitScene, SceneRenderer};
use rayon::prelude::*;

use crate::lit::LitScenes;
use crate::overlay::{origin_color, origin_of};
use crate::renderer::at_side;
use crate::{OpenScene, RESTING_SIDE, SessionError, State};

/// The light at places of one scene.
pub struct Probe {
    scenes: Arc<LitScenes>,
    ready: Option<(Arc<LitScene>, SceneRenderer)>,
}

/// What a probe shows, for a screen.
pub struct ProbePictures {
    /// The panorama, equirectangular, in the photo's orientation: its middle looks along the camera's axis.
    pub panorama: Image<[u8; 3]>,
    /// A mirror ball at the place as the camera would see it, from far away; black around.
    pub ball: Image<[u8; 3]>,
    /// Who says what each pixel of the panorama shows.
    pub origins: Image<[u8; 3]>,
}

/// A place off the surface that is seen at a pixel; `None` where there is no surface.
pub fn probe_place(open: &OpenScene, [u, v]: [f64; 2], lift_m: f32) -> Option<Vec3> {
    let (position_m, normal) = open.surfaces.at_pixel(u, v)?;
    Some(position_m + normal * lift_m)
}

impl Probe {
    /// For one scene.
    pub fn new(scenes: Arc<LitScenes>) -> Self {
        Self { scenes, ready: None }
    }

    fn viewers(&mut self, state: &State) -> Result<&(Arc<LitScene>, SceneRenderer), SessionError> {
        let lit = self.scenes.of(state)?;
        let ready = match self.ready.take() {
            Some(ready) if Arc::ptr_eq(&ready.0, &lit) => ready,
            // A photo of this size is sharper than any panorama that is shown.
            _ => (lit.clone(), SceneRenderer::new(&at_side(&lit, RESTING_SIDE))),
        };
        Ok(self.ready.insert(ready))
    }

    /// Pictures of the light at a place, `2 × height` pixels wide; radiance times 2^`exposure_ev`, clipped at white.
    ///
    /// # Errors
    /// Edits that do not fit the scene.
    pub fn pictures(
        &mut self,
        state: &State,
        at: Vec3,
        height: usize,
        exposure_ev: f32,
    ) -> Result<ProbePictures, SessionError> {
        let (scene, viewers) = self.viewers(state)?;
        let Rendering { radiance, distance_m, .. } = viewers.panorama(at, 2 * height, height);
        let origins = Image::from_fn(2 * height, height, |x, y| {
            let direction = pixel_direction(x, y, 2 * height, height);
            origin_color(origin_of(scene, at, direction, distance_m[(x, y)]))
        });
        Ok(ProbePictures {
            panorama: ToneCurve::Clip.map(&radiance, exposure_ev),
            ball: ToneCurve::Clip.map(&ball(&radiance, at, height), exposure_ev),
            origins,
        })
    }

    /// The HDR panorama at a place as an OpenEXR file, as `lightoctree envmap --lamp` writes one.
    ///
    /// # Errors
    /// Edits that do not fit the scene.
    pub fn exr(scenes: &LitScenes, state: &State, at: Vec3, height: usize) -> Result<Vec<u8>, SessionError> {
        let panorama = SceneRenderer::new(&*scenes.of(state)?).panorama(at, 2 * height, height);
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

/// A mirror ball in a panorama, seen from the camera at the origin as if from far away; black around.
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
        // Half-way to the right, at 45°, it mirrors what lies to the right.
        let side = ball[(32 + 23, 32)];
        assert!(side[2] > 0.95, "{side:?}");
        assert_eq!(ball[(0, 0)], [0.0; 3]);
    }
}
