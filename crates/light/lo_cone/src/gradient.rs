use std::sync::{Mutex, PoisonError};

use multiversion::multiversion;
use rayon::prelude::*;

use crate::{
    Cone, ConeSample, Sampling,
    local_cone::LocalCone,
    march::{Hit, LANES, Marcher},
    packets::Packets,
    reconstruction::{Blended, Interpolated, MediumSample, Nearest, Reconstruction},
    steps::StepTable,
    trace::{CONES_PER_TASK, Composite},
    tracer::ConeTracer,
};

/// Number of tasks whose gradients are held before they are summed.
const TASKS_PER_MERGE: usize = 64;

/// Derivative of a loss by each part of a [`ConeSample`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SampleGradient {
    /// By radiance.
    pub radiance: [f32; 3],
    /// By expected distance, per metre.
    pub distance_m: f32,
    /// By opacity.
    pub opacity: f32,
}

/// Derivative of a loss by every feature of the octree.
#[derive(Clone, Debug, PartialEq)]
pub struct Gradients {
    /// `rgba[d][row]`: derivative by radiance and opacity of the node, in the order of
    /// [`LightOctree::rgba`](lo_octree::LightOctree::rgba). It is 0 for an opacity outside [0,
    /// [`MAX_ALPHA`](lo_octree::MAX_ALPHA)], where tracing clamps it.
    pub rgba: Vec<Vec<[f32; 4]>>,
}

impl ConeTracer {
    /// Computes exact gradients of a loss whose derivatives by the samples of `cones` are `d_samples`.
    ///
    /// The result is bit-identical for every number of threads.
    ///
    /// # Panics
    /// If there are not as many derivatives as cones.
    pub fn trace_backward(&self, cones: &[Cone], d_samples: &[SampleGradient]) -> Gradients {
        assert_eq!(cones.len(), d_samples.len(), "one derivative for each cone");
        let mut samples = vec![ConeSample::default(); cones.len()];
        self.trace_with_gradients(cones, &mut samples, &|index, _| d_samples[index])
    }

    /// Combines [`ConeTracer::trace_batch`] and [`ConeTracer::trace_backward`]; each cone is traced once.
    ///
    /// `loss` returns the derivative of the loss by the sample of the cone with this index. It is not called for cones
    /// that miss the cube, which depend on nothing.
    ///
    /// # Panics
    /// If there are not as many samples as cones.
    pub fn trace_with_gradients(
        &self,
        cones: &[Cone],
        samples: &mut [ConeSample],
        loss: &(dyn Fn(usize, &ConeSample) -> SampleGradient + Sync),
    ) -> Gradients {
        assert_eq!(cones.len(), samples.len(), "one sample for each cone");
        let mut total = vec![[0.0f32; 4]; self.grid.nodes().len()];
        let idle = Mutex::new(Vec::<Accumulator>::new());
        let per_merge = CONES_PER_TASK * TASKS_PER_MERGE;
        for (group, (cones, samples)) in cones.chunks(per_merge).zip(samples.chunks_mut(per_merge)).enumerate() {
            let parts: Vec<Vec<(u32, [f32; 4])>> = cones
                .par_chunks(CONES_PER_TASK)
                .zip(samples.par_chunks_mut(CONES_PER_TASK))
                .enumerate()
                .map(|(task, (cones, samples))| {
                    let first = group * per_merge + task * CONES_PER_TASK;
                    let loss = |index: usize, sample: &ConeSample| loss(first + index, sample);
                    let lock = || idle.lock().unwrap_or_else(PoisonError::into_inner);
                    let mut sum = lock().pop().unwrap_or_else(|| Accumulator::new(total.len()));
                    gradients_of_task(self, cones, samples, &loss, &mut sum);
                    let part = sum.take();
                    lock().push(sum);
                    part
                })
                .collect();
            // In the order of the cones, regardless of thread scheduling.
            for (slot, gradient) in parts.iter().flatten() {
                add(&mut total[*slot as usize], gradient);
            }
        }
        self.by_rows(&total)
    }

    /// Goes from the last hit to the first; `behind` accumulates the derivative-weighted light behind each hit.
    #[inline(always)]
    fn sweep_back<'a, R: Reconstruction>(
        &self,
        table: &StepTable,
        cone: &LocalCone,
        hits_from_the_last: impl Iterator<Item = &'a Hit>,
        transmittance: f32,
        d_sample: &SampleGradient,
        sum: &mut Accumulator,
    ) {
        let d_radiance = d_sample.radiance;
        let d_distance = d_sample.distance_m * self.leaf_edge_m();
        let mut behind = transmittance * (d_distance * cone.far - d_sample.opacity);
        for hit in hits_from_the_last {
            let step = &table.steps()[hit.step as usize];
            let MediumSample { radiance: [r, g, b], radiance_weight, .. } = hit.medium;
            let shade = step.weight * dot(d_radiance, [r, g, b]) + d_distance * step.distance;
            let share = hit.transmittance * hit.opacity;
            let d_extinction = ((hit.transmittance - share) * shade - behind) * step.length;
            behind += share * shade;
            // NodeWeight of the light per extinction; the limit where extinction is zero.
            let rate = if radiance_weight > 0.0 { hit.opacity / radiance_weight } else { step.length };
            let rate = rate * hit.transmittance * step.weight;
            R::footprint(&self.grid, cone, step, |slot, weight| {
                let [slot_r, slot_g, slot_b, slot_extinction] = self.grid.value(slot);
                let d_colour = weight.radiance * slot_extinction * rate;
                let colour_change = dot(d_radiance, [slot_r - r, slot_g - g, slot_b - b]);
                sum.add(
                    slot,
                    &[
                        d_colour * d_radiance[0],
                        d_colour * d_radiance[1],
                        d_colour * d_radiance[2],
                        weight.extinction * d_extinction + weight.radiance * rate * colour_change,
                    ],
                );
            });
        }
    }

    /// Converts gradients by slot and extinction to gradients by row and opacity.
    fn by_rows(&self, total: &[[f32; 4]]) -> Gradients {
        let mut rgba: Vec<Vec<[f32; 4]>> = self.rows.iter().map(|&rows| vec![[0.0; 4]; rows]).collect();
        for (slot, &[r, g, b, d_extinction]) in total.iter().enumerate() {
            let node = self.grid.nodes()[slot];
            if let Ok(row) = usize::try_from(node.row) {
                rgba[usize::from(node.depth)][row] = [r, g, b, d_extinction * node.extinction_slope];
            }
        }
        Gradients { rgba }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl+avx2+bmi1+bmi2", "x86_64+avx2+bmi1+bmi2"))]
fn gradients_of_task(
    tracer: &ConeTracer,
    cones: &[Cone],
    samples: &mut [ConeSample],
    loss: &dyn Fn(usize, &ConeSample) -> SampleGradient,
    sum: &mut Accumulator,
) {
    match tracer.settings.sampling {
        Sampling::Nearest => gradients_of_cones::<Nearest>(tracer, cones, samples, loss, sum),
        Sampling::Blended => gradients_of_cones::<Blended>(tracer, cones, samples, loss, sum),
        Sampling::Interpolated => gradients_of_cones::<Interpolated>(tracer, cones, samples, loss, sum),
    }
}

#[inline(always)]
fn gradients_of_cones<R: Reconstruction>(
    tracer: &ConeTracer,
    cones: &[Cone],
    samples: &mut [ConeSample],
    loss: &dyn Fn(usize, &ConeSample) -> SampleGradient,
    sum: &mut Accumulator,
) {
    samples.fill(ConeSample::default());
    let (mut marcher, mut transmittances) = (Marcher::<LANES>::new(), [0.0; LANES]);
    let mut tape = Tape::default();
    let mut packets = Packets::new(tracer, cones);
    let mut pixels = [Composite::default(); LANES];
    while packets.next::<LANES>() {
        let (table, locals) = (packets.table(), packets.cones());
        pixels[..locals.len()].fill(Composite::default());
        tape.clear(locals.len());
        let least = tracer.settings.min_transmittance;
        marcher.march::<R>(&tracer.grid, table, locals, least, &mut transmittances, |cone, step, hit| {
            pixels[cone].add(step, &hit);
            tape.push(cone, hit);
        });
        for (cone, (index, local)) in packets.indices().zip(locals).enumerate() {
            samples[index] = pixels[cone].finish(transmittances[cone], local.far, tracer.leaf_edge_m());
            let d_sample = loss(index, &samples[index]);
            tracer.sweep_back::<R>(table, local, tape.hits_from_the_last(cone), transmittances[cone], &d_sample, sum);
        }
    }
}

/// Hits of the cones of the current packet, in the order in which they were found.
#[derive(Default)]
struct Tape {
    /// Each hit with the index of the previous hit of the same cone.
    hits: Vec<(Hit, Option<u32>)>,
    /// Index of the last hit of each cone.
    last: Vec<Option<u32>>,
}

impl Tape {
    fn clear(&mut self, cones: usize) {
        self.hits.clear();
        self.last.clear();
        self.last.resize(cones, None);
    }

    #[inline(always)]
    fn push(&mut self, cone: usize, hit: Hit) {
        self.hits.push((hit, self.last[cone]));
        self.last[cone] = Some(self.hits.len() as u32 - 1);
    }

    #[inline(always)]
    fn hits_from_the_last(&self, cone: usize) -> impl Iterator<Item = &Hit> {
        let mut next = self.last[cone];
        std::iter::from_fn(move || {
            let (hit, before) = &self.hits[next? as usize];
            next = *before;
            Some(hit)
        })
    }
}

/// Sparse gradients of the slots that a task touches.
struct Accumulator {
    /// Position of each slot in `touched` plus one, or 0.
    places: Vec<u32>,
    touched: Vec<(u32, [f32; 4])>,
}

impl Accumulator {
    fn new(slots: usize) -> Self {
        Self { places: vec![0; slots], touched: Vec::new() }
    }

    #[inline(always)]
    fn add(&mut self, slot: u32, gradient: &[f32; 4]) {
        let place = &mut self.places[slot as usize];
        if *place == 0 {
            self.touched.push((slot, *gradient));
            *place = self.touched.len() as u32;
        } else {
            add(&mut self.touched[*place as usize - 1].1, gradient);
        }
    }

    /// Returns the sums in the order of first touch and clears the accumulator.
    fn take(&mut self) -> Vec<(u32, [f32; 4])> {
        for (slot, _) in &self.touched {
            self.places[*slot as usize] = 0;
        }
        std::mem::take(&mut self.touched)
    }
}

#[inline(always)]
fn add(sum: &mut [f32; 4], term: &[f32; 4]) {
    for (sum, term) in sum.iter_mut().zip(term) {
        *sum += term;
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
