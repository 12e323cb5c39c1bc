use geometry::{Camera, Cube, Vec3};
use imaging::Image;
use octree::LightOctree;
use rayon::prelude::*;

use crate::{
    Cone, Rendering, Sample, Sampling, Settings, SettingsError,
    grid::Grid,
    march::{Hit, LocalCone, march},
    reconstruction::{Interpolated, Nearest, Reconstruction},
    steps::{Step, StepTable},
};

/// Cones that one task traces; the result does not depend on it.
pub(crate) const CONES_PER_TASK: usize = 1024;

/// Traces cones through one lighting octree.
///
/// It holds the octree in a form of its own, which takes some milliseconds to make; the octree itself is not needed after.
pub struct ConeTracer {
    pub(crate) grid: Grid,
    pub(crate) cube: Cube,
    pub(crate) settings: Settings,
    /// Feature rows of each depth.
    pub(crate) rows: Vec<usize>,
}

impl ConeTracer {
    /// Prepares an octree for tracing.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(light: &LightOctree, settings: Settings) -> Result<Self, SettingsError> {
        settings.check()?;
        Ok(Self { grid: Grid::new(light), cube: light.cube, settings, rows: light.rgba.iter().map(Vec::len).collect() })
    }

    /// What one cone sees. Many cones are faster as a batch.
    pub fn trace(&self, cone: &Cone) -> Sample {
        let mut sample = [Sample::default()];
        self.trace_chunk(&[*cone], &mut sample);
        sample[0]
    }

    /// What each cone sees, on all threads of the pool.
    ///
    /// # Panics
    /// Where there are not as many samples as cones.
    pub fn trace_batch(&self, cones: &[Cone], samples: &mut [Sample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        cones
            .par_chunks(CONES_PER_TASK)
            .zip(samples.par_chunks_mut(CONES_PER_TASK))
            .for_each(|(cones, samples)| self.trace_chunk(cones, samples));
    }

    /// The equirectangular panorama at `origin`; the half-angle of a pixel's cone is its pitch, 2π / `width`.
    pub fn panorama(&self, origin: Vec3, width: usize, height: usize) -> Rendering {
        let tan_half_angle = (std::f32::consts::TAU / width as f32).tan();
        self.render(width, height, |x, y| Cone {
            origin,
            direction: geometry::pixel_direction(x, y, width, height),
            tan_half_angle,
        })
    }

    /// The panoramas at many places.
    pub fn panoramas(&self, origins: &[Vec3], width: usize, height: usize) -> Vec<Rendering> {
        origins.par_iter().map(|&origin| self.panorama(origin, width, height)).collect()
    }

    /// What a camera at the world's origin sees; the half-angle of a pixel's cone is the angle between neighbours.
    /// Distances are along the ray, not along the optical axis.
    pub fn perspective(&self, camera: &Camera) -> Rendering {
        let tan_half_angle = camera.pixel_angle_rad().tan();
        self.render(camera.width as usize, camera.height as usize, |x, y| Cone {
            origin: Vec3::ZERO,
            direction: camera.direction(x as f64 + 0.5, y as f64 + 0.5),
            tan_half_angle,
        })
    }

    fn render(&self, width: usize, height: usize, cone: impl Fn(usize, usize) -> Cone + Sync) -> Rendering {
        let cones: Vec<Cone> =
            (0..width * height).into_par_iter().map(|pixel| cone(pixel % width, pixel / width)).collect();
        let mut samples = vec![Sample::default(); cones.len()];
        self.trace_batch(&cones, &mut samples);
        let image = Image::new(width, height, samples);
        Rendering {
            radiance: image.map(|sample| sample.radiance),
            distance_m: image.map(|sample| sample.distance_m),
            opacity: image.map(|sample| sample.opacity),
        }
    }

    fn trace_chunk(&self, cones: &[Cone], samples: &mut [Sample]) {
        match self.settings.sampling {
            Sampling::Nearest => self.trace_chunk_as::<Nearest>(cones, samples),
            Sampling::Interpolated => self.trace_chunk_as::<Interpolated>(cones, samples),
        }
    }

    fn trace_chunk_as<R: Reconstruction>(&self, cones: &[Cone], samples: &mut [Sample]) {
        let mut table: Option<StepTable> = None;
        for (cone, sample) in cones.iter().zip(samples) {
            *sample = match LocalCone::new(cone, &self.cube, self.grid.side()) {
                Some(local) => self.trace_local::<R>(&local, self.table(&mut table, cone.tan_half_angle, &local)),
                None => Sample::default(),
            };
        }
    }

    /// The steps of a cone; neighbours in a batch mostly have the same.
    pub(crate) fn table<'a>(
        &self,
        table: &'a mut Option<StepTable>,
        tan_half_angle: f32,
        cone: &LocalCone,
    ) -> &'a StepTable {
        let covers = |table: &StepTable| table.covers(&self.settings, tan_half_angle, cone.near, cone.far);
        if !table.as_ref().is_some_and(covers) {
            let side = self.grid.side() as f32;
            let near = (cone.near - side).max(0.0);
            let reach = if cone.near > 0.0 { 4.0 * side } else { 1.74 * side };
            *table = Some(StepTable::new(&self.settings, tan_half_angle, self.grid.max_level(), near, near + reach));
        }
        table.as_ref().expect("it was just made")
    }

    fn trace_local<R: Reconstruction>(&self, cone: &LocalCone, table: &StepTable) -> Sample {
        let mut pixel = Composite::default();
        let transmittance = march::<R>(&self.grid, table, cone, self.settings.min_transmittance, |hit| {
            pixel.add(&table.steps()[hit.step as usize], &hit);
        });
        pixel.finish(transmittance, cone.far, self.leaf_edge_m())
    }

    pub(crate) fn leaf_edge_m(&self) -> f32 {
        self.cube.edge_m / self.grid.side() as f32
    }
}

/// Front-to-back sum over the hits of a cone.
#[derive(Default)]
pub(crate) struct Composite {
    radiance: [f32; 3],
    distance: f32,
}

impl Composite {
    #[inline(always)]
    pub fn add(&mut self, step: &Step, hit: &Hit) {
        let share = hit.transmittance * hit.opacity;
        for channel in 0..3 {
            self.radiance[channel] += step.weight * share * hit.value[channel];
        }
        self.distance += step.distance * share;
    }

    /// What is left over counts with the distance of the exit, `far`.
    #[inline(always)]
    pub fn finish(self, transmittance: f32, far: f32, leaf_edge_m: f32) -> Sample {
        Sample {
            radiance: self.radiance,
            distance_m: (self.distance + transmittance * far) * leaf_edge_m,
            opacity: 1.0 - transmittance,
        }
    }
}
