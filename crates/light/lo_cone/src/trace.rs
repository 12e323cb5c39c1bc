//! Tracing of single cones, batches and images.

use lo_geometry::{Camera, Vec2, Vec3};
use lo_imaging::Image;
use multiversion::multiversion;
use rayon::prelude::*;

use crate::{
    Cone, ConeSample, ConeTracer, Rendering, Sampling,
    march::{Hit, LANES, Marcher},
    packets::Packets,
    reconstruction::{Blended, Interpolated, Nearest, Reconstruction},
    steps::Step,
};

/// Number of cones per task; the result does not depend on it.
pub(crate) const CONES_PER_TASK: usize = 1024;

/// Edge of the square tiles, in pixels, in which an image's cones are traced, for coherence.
const TILE: usize = 8;

impl ConeTracer {
    /// Traces one cone. Many cones are faster as a batch.
    pub fn trace(&self, cone: &Cone) -> ConeSample {
        let mut sample = [ConeSample::default()];
        match self.settings.sampling {
            Sampling::Nearest => trace_cones::<Nearest, 1>(self, &[*cone], &mut sample),
            Sampling::Blended => trace_cones::<Blended, 1>(self, &[*cone], &mut sample),
            Sampling::Interpolated => trace_cones::<Interpolated, 1>(self, &[*cone], &mut sample),
        }
        sample[0]
    }

    /// Traces cones on all threads of the pool. Cones that are close in space and in the list are traced faster.
    ///
    /// # Panics
    /// If there are not as many samples as cones.
    pub fn trace_batch(&self, cones: &[Cone], samples: &mut [ConeSample]) {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        cones
            .par_chunks(CONES_PER_TASK)
            .zip(samples.par_chunks_mut(CONES_PER_TASK))
            .for_each(|(cones, samples)| trace_task(self, cones, samples));
    }

    /// Renders the equirectangular panorama at `origin`. The half-angle of a pixel's cone is half of the pixel pitch, π
    /// / `width`.
    pub fn panorama(&self, origin: Vec3, width: usize, height: usize) -> Rendering {
        let tan_half_angle = (std::f32::consts::PI / width as f32).tan();
        // A direction is the product of its column's direction on the horizon and its row's direction on the meridian
        // of −Z.
        let columns: Vec<Vec3> = (0..width)
            .map(|x| lo_geometry::direction_from_uv(Vec2::new((x as f32 + 0.5) / width as f32, 0.5)))
            .collect();
        let rows: Vec<Vec3> = (0..height)
            .map(|y| lo_geometry::direction_from_uv(Vec2::new(0.5, (y as f32 + 0.5) / height as f32)))
            .collect();
        self.render(width, height, |x, y| {
            let (column, row) = (columns[x], rows[y]);
            let direction = Vec3::new(column.x * -row.z, row.y, column.z * -row.z);
            Cone { origin, direction, tan_half_angle }
        })
    }

    /// Renders panoramas at several positions.
    pub fn panoramas(&self, origins: &[Vec3], width: usize, height: usize) -> Vec<Rendering> {
        origins.par_iter().map(|&origin| self.panorama(origin, width, height)).collect()
    }

    /// Renders the view of a camera at the world's origin. The half-angle of a pixel's cone is half of the angle
    /// between adjacent pixels. Distances are along the ray, not along the optical axis.
    pub fn perspective(&self, camera: &Camera) -> Rendering {
        let tan_half_angle = (0.5 * camera.pixel_angle_rad()).tan();
        self.render(camera.width as usize, camera.height as usize, |x, y| Cone {
            origin: Vec3::ZERO,
            direction: camera.direction(x as f64 + 0.5, y as f64 + 0.5),
            tan_half_angle,
        })
    }

    fn render(&self, width: usize, height: usize, cone: impl Fn(usize, usize) -> Cone + Sync) -> Rendering {
        let mut radiance = vec![[0.0; 3]; width * height];
        let mut distance_m = vec![0.0; width * height];
        let mut opacity = vec![0.0; width * height];
        let band = (TILE * width).max(1);
        (radiance.par_chunks_mut(band), distance_m.par_chunks_mut(band), opacity.par_chunks_mut(band))
            .into_par_iter()
            .enumerate()
            .for_each(|(index, (radiance, distance_m, opacity))| {
                let rows = radiance.len() / width;
                let pixels: Vec<(usize, usize)> = (0..width)
                    .step_by(TILE)
                    .flat_map(|left| (0..rows).map(move |y| (left, y)))
                    .flat_map(|(left, y)| (left..width.min(left + TILE)).map(move |x| (x, y)))
                    .collect();
                let cones: Vec<Cone> = pixels.iter().map(|&(x, y)| cone(x, index * TILE + y)).collect();
                let mut samples = vec![ConeSample::default(); cones.len()];
                trace_task(self, &cones, &mut samples);
                for (&(x, y), sample) in pixels.iter().zip(&samples) {
                    let pixel = y * width + x;
                    radiance[pixel] = sample.radiance;
                    distance_m[pixel] = sample.distance_m;
                    opacity[pixel] = sample.opacity;
                }
            });
        Rendering {
            radiance: Image::new(width, height, radiance),
            distance_m: Image::new(width, height, distance_m),
            opacity: Image::new(width, height, opacity),
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx2+bmi1+bmi2", "x86_64+avx2+bmi1+bmi2"))]
fn trace_task(tracer: &ConeTracer, cones: &[Cone], samples: &mut [ConeSample]) {
    match tracer.settings.sampling {
        Sampling::Nearest => trace_cones::<Nearest, LANES>(tracer, cones, samples),
        Sampling::Blended => trace_cones::<Blended, LANES>(tracer, cones, samples),
        Sampling::Interpolated => trace_cones::<Interpolated, LANES>(tracer, cones, samples),
    }
}

#[inline(always)]
fn trace_cones<R: Reconstruction, const LANES: usize>(tracer: &ConeTracer, cones: &[Cone], samples: &mut [ConeSample]) {
    samples.fill(ConeSample::default());
    let (mut marcher, mut transmittances) = (Marcher::<LANES>::new(), [0.0; LANES]);
    let mut packets = Packets::new(tracer, cones);
    let mut pixels = [Composite::default(); LANES];
    while packets.next::<LANES>() {
        let (table, locals) = (packets.table(), packets.cones());
        pixels[..locals.len()].fill(Composite::default());
        let least = tracer.settings.min_transmittance;
        marcher.march::<R>(&tracer.grid, table, locals, least, &mut transmittances, |cone, step, hit| {
            pixels[cone].add(step, &hit);
        });
        for (cone, (index, local)) in packets.indices().zip(locals).enumerate() {
            samples[index] = pixels[cone].finish(transmittances[cone], local.far, tracer.leaf_edge_m());
        }
    }
}

/// Front-to-back compositing over the hits of a cone.
#[derive(Clone, Copy, Default)]
pub(crate) struct Composite {
    radiance: [f32; 3],
    distance: f32,
}

impl Composite {
    #[inline(always)]
    pub fn add(&mut self, step: &Step, hit: &Hit) {
        let share = hit.transmittance * hit.opacity;
        for channel in 0..3 {
            self.radiance[channel] += step.weight * share * hit.medium.radiance[channel];
        }
        self.distance += step.distance * share;
    }

    /// Returns the cone's sample; the remaining transmittance gets the exit distance `far`.
    #[inline(always)]
    pub fn finish(self, transmittance: f32, far: f32, leaf_edge_m: f32) -> ConeSample {
        ConeSample {
            radiance: self.radiance,
            distance_m: (self.distance + transmittance * far) * leaf_edge_m,
            opacity: 1.0 - transmittance,
        }
    }
}
