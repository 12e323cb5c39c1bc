//! Training loop of the tests: rays of one scene per step, along the true octree.

use std::time::{Duration, Instant};

use burn::tensor::Device;
use lo_cone::Settings;
use lo_nets::Adam;
use lo_nets::light::{Growth, LightLossConfig, LightLosses, LightNet, LightNetConfig};

use super::scene::{Scene, numbers};

/// Duration of training.
#[derive(Clone, Copy)]
pub enum Until {
    Steps(u64),
    Minutes(f64),
}

/// Options of the training loop.
#[derive(Clone, Copy)]
pub struct Training {
    pub until: Until,
    /// Initial learning rate, without warm-up.
    pub rate: f64,
    /// Steps until the learning rate has halved. In the last fifth it decays to 0.
    pub halved_after: f64,
    /// Rays per step, a quarter of them of the photo.
    pub rays: usize,
}

impl Training {
    /// Trains a network from scratch.
    ///
    /// `scene_of` returns the scene of a step. `report` is called twenty times with the network and the progress,
    /// 0 to 1.
    pub fn run<S: std::ops::Deref<Target = Scene>>(
        &self,
        config: &LightNetConfig,
        mut scene_of: impl FnMut(u64) -> S,
        mut report: impl FnMut(&LightNet, f64),
    ) -> LightNet {
        let mut net = LightNet::new(config, 5, &Device::flex().autodiff()).unwrap();
        let weights = LightLossConfig::default();
        let mut adam = Adam::default();
        let (start, mut step, mut reports) = (Instant::now(), 0, 1.0);
        loop {
            let done = self.done(step, start.elapsed());
            if done >= reports / 20.0 || done >= 1.0 {
                println!("step {step}, {:.0} s", start.elapsed().as_secs_f64());
                report(&net, done);
                reports += 1.0;
            }
            if done >= 1.0 {
                return net;
            }
            let scene = scene_of(step);
            let (novel, visible) = scene.rays(self.rays, step);
            let output = net.forward(&scene.input, None, Growth::Truth(&scene.truth.octree)).unwrap();
            let losses = LightLosses::new(&output, &scene.truth, &novel, &visible, Settings::default()).unwrap();
            let total = losses.total(&weights);
            assert!(numbers(&total)[0].is_finite(), "step {step}");
            let gradients = total.backward();
            let cooled = ((1.0 - done) / 0.2).min(1.0);
            net = adam.step(net, &gradients, cooled * self.rate / (1.0 + step as f64 / self.halved_after));
            step += 1;
        }
    }

    fn done(&self, step: u64, elapsed: Duration) -> f64 {
        match self.until {
            Until::Steps(steps) => step as f64 / steps as f64,
            Until::Minutes(minutes) => elapsed.as_secs_f64() / (60.0 * minutes),
        }
    }
}
