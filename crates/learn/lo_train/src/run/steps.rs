//! Steps of the phases that need more than a batch of examples: expected light, and both networks jointly.

use std::time::{Duration, Instant};

use lo_dataset::LoaderState;
use lo_dataset::stages::READ_SAMPLES;
use lo_events::{Cancelled, Event};
use lo_nets::conv::{in_bf16, in_pool};
use lo_nets::depth::panorama_image;
use lo_random::RngExt;

use super::Run;
use crate::augmentation::Variation;
use crate::error::{StepError, TrainError};
use crate::example::{DepthSource, ExpectedExample, LightExample, RayCounts};
use crate::learner::Progress;
use crate::phases::{ExpectedPhase, LightPhase, interpolated_share};
use crate::prefetch::{Prefetcher, SkippedSample};
use crate::prepare::{JointExample, expected_examples};
use crate::sources::{Sources, open_panoramas};

impl Run<'_> {
    /// Prepares the examples of an expected-light phase, then runs its steps. A resumed run prepares the same examples.
    pub(super) fn expected_steps(&mut self, phase: &ExpectedPhase) -> Result<(), TrainError> {
        let Some(examples) = self.expected_examples(phase)? else {
            self.save()?;
            return Err(Cancelled.into());
        };
        while self.state.step < phase.schedule.steps {
            if self.cancelled {
                self.save()?;
                return Err(Cancelled.into());
            }
            let mut stream = lo_random::stream(self.state.seed, "expected light", self.state.total_steps);
            let drawn: Vec<&ExpectedExample> =
                (0..phase.batch_size).map(|_| &examples[stream.random_range(0..examples.len())]).collect();
            let learning_rate = phase.schedule.learning_rate_at(self.state.step);
            let (learner, config) = (&mut self.learner, self.config);
            match in_pool(|| learner.expected_step(&drawn, &mut stream, learning_rate, config)) {
                Ok(progress) => self.finish_step(&progress, learning_rate, &mut Duration::default())?,
                Err(error) => self.roll_back(error)?,
            }
        }
        Ok(())
    }

    /// Prepares the examples of an expected-light phase; `None` if the run is cancelled.
    fn expected_examples(&mut self, phase: &ExpectedPhase) -> Result<Option<Vec<ExpectedExample>>, TrainError> {
        let Sources { all, panoramas, .. } = &self.sources;
        let own = open_panoramas(&phase.panoramas, self.state.seed)?;
        let dataset = [&own, panoramas, all].into_iter().find(|data| !data.is_empty()).unwrap_or(all).clone();
        let prepare = expected_examples(&phase.augmentation, &self.learner, self.state.seed);
        let prefetcher =
            Prefetcher::start(dataset, &self.config.data, self.state.seed, Vec::new(), LoaderState::default(), prepare);
        let mut prefetcher = prefetcher.map_err(TrainError::io(self.folder))?;
        let (mut examples, mut unusable, begun) = (Vec::with_capacity(phase.photos), 0, Instant::now());
        self.emit(Event::Begun(READ_SAMPLES));
        while examples.len() < phase.photos {
            if self.cancelled {
                return Ok(None);
            }
            match prefetcher.next().map_err(|_| TrainError::Empty)?.example {
                Ok(example) => {
                    unusable = 0;
                    examples.push(example);
                }
                Err(skipped) => self.skip(skipped, &mut unusable)?,
            }
            let done = examples.len() as u64;
            self.emit(Event::Progress { stage: READ_SAMPLES, done, total: phase.photos as u64 });
        }
        self.emit(Event::Done { stage: READ_SAMPLES, took: begun.elapsed() });
        Ok(Some(examples))
    }

    /// Takes one step of both networks on one photo.
    pub(super) fn joint_step(
        &mut self,
        phase: &LightPhase,
        example: JointExample,
        learning_rate: f64,
    ) -> Result<Result<Progress, SkippedSample>, StepError> {
        let predicted_growth = self.uses_predicted_growth(phase);
        let seed = self.state.seed;
        let bf16 = self.config.bf16;
        in_pool(|| {
            let JointExample { sample, variation, epoch, depth, light } = example;
            let output = in_bf16(bf16, || self.learner.depth.net.forward(&[&depth.photo]));
            let mut light = match light {
                Some(light) => light,
                None => {
                    let predicted_m = output.depth_m(&depth.camera);
                    if !predicted_m.pixels().iter().all(|z| z.is_finite()) {
                        return Err(StepError::Depth);
                    }
                    let rays = RayCounts { novel: phase.novel_rays, visible: phase.visible_rays };
                    let known = DepthSource::Predicted(&predicted_m);
                    let mut stream = Variation::stream(seed, "predicted example", &sample, epoch);
                    let network = &self.learner.network;
                    match LightExample::new(&sample, &variation, known, network, rays, &mut stream) {
                        Ok(example) => example,
                        Err(error) => return Ok(Err(SkippedSample { sample: sample.id, error: error.to_string() })),
                    }
                }
            };
            // Detached: no gradient flows from the light network into the single map.
            let map = panorama_image(self.learner.depth.net.panorama.forward(output.global.clone()));
            light.input = light.input.with_up(light.up).with_map(map);
            let step = || self.learner.joint_step(output, &depth, &light, predicted_growth, learning_rate, self.config);
            in_bf16(bf16, step).map(Ok)
        })
    }

    /// Draws whether this step's octree grows by the network's own predictions (scheduled sampling).
    pub(super) fn uses_predicted_growth(&self, phase: &LightPhase) -> bool {
        let share = interpolated_share(phase.scheduled_sampling, self.state.step, phase.schedule.steps);
        let index = self.state.total_steps ^ (self.state.setbacks << 48);
        lo_random::stream(self.state.seed, "growth", index).random::<f32>() < share
    }
}
