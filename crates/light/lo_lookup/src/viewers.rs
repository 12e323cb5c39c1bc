use lo_cone::{Cone, ConeSample, Rendering, Viewers};
use lo_geometry::Vec3;
use lo_imaging::Image;
use lo_lights::AnalyticLights;
use lo_scene::LitScene;

use crate::{Detail, PanoramaLookup, PhotoLookup};

/// What there is to see in a scene from any place: its octree, its photo or a panorama of the room where those show it, and lights that were added.
pub struct SharpViewers {
    viewers: Viewers,
    photo: PhotoLookup,
    panorama: Option<PanoramaLookup>,
    detail: Option<Detail>,
    /// Lights that no octree holds.
    lights: Option<AnalyticLights>,
}

impl SharpViewers {
    /// Prepares a scene, which is not needed after. Takes some tenths of a second for large photos.
    pub fn new(scene: &LitScene) -> Self {
        let viewers = Viewers::new(&scene.light);
        let photo = PhotoLookup::new(scene, &viewers.at(Vec3::ZERO));
        let eye_m = scene.panorama.as_ref().map_or(Vec3::ZERO, |laid| laid.source.position_m);
        let panorama = PanoramaLookup::new(scene, &viewers.at(eye_m));
        Self { viewers, photo, panorama, detail: None, lights: AnalyticLights::of(scene) }
    }

    /// Adds [`Detail`] to what neither the photo nor a panorama of the room shows.
    #[must_use]
    pub fn with_detail(self, scene: &LitScene) -> Self {
        Self { detail: Detail::new(scene, &self.photo), ..self }
    }

    /// Puts what the panorama of the room shows, and before it what the photo does, into samples.
    fn sharpen(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        if let Some(detail) = &self.detail {
            detail.add(cones, samples);
        }
        if let Some(panorama) = &self.panorama {
            panorama.sharpen(cones, samples);
        }
        self.photo.sharpen(cones, samples);
    }

    /// The equirectangular panorama at a place, as of [`lo_cone::ConeTracer::panorama`].
    pub fn panorama(&self, eye_m: Vec3, width: usize, height: usize) -> Rendering {
        let Rendering { radiance, distance_m, opacity } = self.viewers.at(eye_m).panorama(eye_m, width, height);
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

    /// What cones from one place see, on all threads of the pool.
    ///
    /// # Panics
    /// Where there are not as many samples as cones.
    pub fn trace_batch(&self, eye_m: Vec3, cones: &[Cone], samples: &mut [ConeSample]) {
        self.viewers.at(eye_m).trace_batch(cones, samples);
        self.sharpen(cones, samples);
        if let Some(lights) = &self.lights {
            lights.add(cones, samples);
        }
    }
}
