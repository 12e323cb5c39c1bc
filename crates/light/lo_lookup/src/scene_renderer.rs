use lo_cone::{Cone, ConeSample, OctreeRenderer, Rendering};
use lo_geometry::Vec3;
use lo_imaging::Image;
use lo_lights::AnalyticLights;
use lo_scene::LitScene;

use crate::{Detail, PanoramaLookup, PhotoLookup};

/// Renders a scene from any viewpoint: its octree, sharpened by the photo and a panorama of the room where those show
/// the surface, and added lights.
pub struct SceneRenderer {
    octree: OctreeRenderer,
    photo: PhotoLookup,
    panorama: Option<PanoramaLookup>,
    detail: Option<Detail>,
    /// Lights that are not in the octree.
    lights: Option<AnalyticLights>,
}

impl SceneRenderer {
    /// Prepares a scene, which may be dropped afterwards. Takes some tenths of a second for large photos.
    pub fn new(scene: &LitScene) -> Self {
        let octree = OctreeRenderer::new(&scene.light);
        let photo = PhotoLookup::new(scene, &octree.at(Vec3::ZERO));
        let eye_m = scene.panorama.as_ref().map_or(Vec3::ZERO, |laid| laid.source.position_m);
        let panorama = PanoramaLookup::new(scene, &octree.at(eye_m));
        Self { octree, photo, panorama, detail: None, lights: AnalyticLights::of(scene) }
    }

    /// Adds [`Detail`] where neither the photo nor a panorama of the room shows anything.
    #[must_use]
    pub fn with_detail(self, scene: &LitScene) -> Self {
        Self { detail: Detail::new(scene, &self.photo), ..self }
    }

    /// Replaces sample values by those of the panorama of the room, and then by those of the photo.
    fn sharpen(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        if let Some(detail) = &self.detail {
            detail.add(cones, samples);
        }
        if let Some(panorama) = &self.panorama {
            panorama.sharpen(cones, samples);
        }
        self.photo.sharpen(cones, samples);
    }

    /// Renders the equirectangular panorama at a position, as [`lo_cone::ConeTracer::panorama`] does.
    pub fn panorama(&self, eye_m: Vec3, width: usize, height: usize) -> Rendering {
        let Rendering { radiance, distance_m, opacity } = self.octree.at(eye_m).panorama(eye_m, width, height);
        let tan_half_angle = (std::f32::consts::PI / width as f32).tan();
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let cone = |(x, y)| {
            let direction = lo_geometry::pixel_direction(x, y, width, height);
            Cone { origin: eye_m, direction, tan_half_angle }
        };
        let cones: Vec<Cone> = pixels.map(cone).collect();
        let parts = radiance.pixels().iter().zip(distance_m.pixels()).zip(opacity.pixels());
        let sample = |((&radiance, &distance_m), &opacity)| ConeSample { radiance, distance_m, opacity };
        let mut samples: Vec<ConeSample> = parts.map(sample).collect();
        self.sharpen(&cones, &mut samples);
        let mut rendering = Rendering {
            radiance: Image::new(width, height, samples.iter().map(|sample| sample.radiance).collect()),
            distance_m: Image::new(width, height, samples.iter().map(|sample| sample.distance_m).collect()),
            opacity: Image::new(width, height, samples.iter().map(|sample| sample.opacity).collect()),
        };
        if let Some(lights) = &self.lights {
            lights.add_to_panorama(eye_m, &mut rendering);
        }
        rendering
    }

    /// Traces cones that start at one position, on all threads of the pool.
    ///
    /// # Panics
    /// If there are not as many samples as cones.
    pub fn trace_batch(&self, eye_m: Vec3, cones: &[Cone], samples: &mut [ConeSample]) {
        self.octree.at(eye_m).trace_batch(cones, samples);
        self.sharpen(cones, samples);
        if let Some(lights) = &self.lights {
            lights.add(cones, samples);
        }
    }
}
