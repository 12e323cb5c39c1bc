//! A scene to overfit: its visible points, true octree and panoramas, some of which are held out.

use burn::tensor::Tensor;
use lo_cone::{ConeTracer, Settings};
use lo_dataset::{NovelView, Sample};
use lo_geometry::{Cube, Vec3};
use lo_imaging::{DepthMap, Image};
use lo_nets::light::{Growth, LightInput, LightNet, LightNetConfig, Rays, VisiblePoint};
use lo_octree::LightOctree;
use lo_train::{panorama_rays, sample_panorama_rays};

/// Linear values from here on count as clipped in a photo.
pub const WHITE: f32 = 0.99;

pub struct Scene {
    pub input: LightInput,
    pub truth: LightOctree,
    photo: Image<[f32; 3]>,
    sample: Sample,
    held_out: Vec<NovelView>,
}

/// Errors of an octree's panoramas.
#[derive(Clone, Copy, Debug)]
pub struct Figures {
    /// PSNR of values encoded as sRGB and clipped to [0, 1].
    pub psnr_db: f64,
    /// Root mean squared difference of log(1 + radiance).
    pub log_rmse: f64,
}

impl Scene {
    /// Prepares a scene in a cube around the whole room. Every `stride`th panorama is held out.
    pub fn new(mut sample: Sample, stride: usize, config: &LightNetConfig) -> Self {
        let positions = || sample.points.iter().map(|p| p.position_m);
        let (low, high) = (positions().reduce(Vec3::min).unwrap(), positions().reduce(Vec3::max).unwrap());
        let cube = Cube::centred(0.5 * (low + high), 1.02 * (high - low).max_element());
        let photo = linear(&sample.photo);
        let depth_m = sample.depth_m.as_ref().unwrap();
        let mut visible = VisiblePoint::from_photo(&photo, depth_m, sample.normal.as_ref(), &sample.camera, WHITE);
        visible.iter_mut().for_each(|point| point.position_m = cube.pulled_inside(point.position_m));
        let views = std::mem::take(&mut sample.views).into_iter().enumerate();
        let (held_out, views): (Vec<_>, Vec<_>) = views.partition(|(i, _)| i % stride == stride / 2);
        sample.views = views.into_iter().map(|(_, view)| view).collect();
        Self {
            input: LightInput::new(&visible, &sample.camera, cube, config, 7).unwrap(),
            truth: LightOctree::from_points(&sample.points, cube, config.depth, config.full_depth).unwrap().0,
            photo,
            sample,
            held_out: held_out.into_iter().map(|(_, view)| view).collect(),
        }
    }

    /// Draws rays of the training panoramas and of the photo.
    pub fn rays(&self, count: usize, step: u64) -> (Rays, Rays) {
        let mut stream = lo_random::stream(11, "rays", step);
        let depth_m: &DepthMap = self.sample.depth_m.as_ref().unwrap();
        let novel = sample_panorama_rays(&self.sample.views, count * 3 / 4, &mut stream);
        (novel, Rays::of_photo(&self.photo, depth_m, &self.sample.camera, WHITE, count / 4, &mut stream))
    }

    /// Measures an octree on the held-out panoramas.
    pub fn figures(&self, light: &LightOctree) -> Figures {
        let (mut squares, mut logs, mut count) = (0.0, 0.0, 0.0);
        for view in &self.held_out {
            let tracer = ConeTracer::new(&light.seen_from(view.position_m), Settings::default()).unwrap();
            let rays = panorama_rays(view);
            let mut samples = vec![lo_cone::ConeSample::default(); rays.len()];
            tracer.trace_batch(&rays.cones, &mut samples);
            let encoded = |c: f32| f64::from(lo_imaging::srgb_from_linear(c.clamp(0.0, 1.0)));
            for (got, expected) in samples.iter().zip(&rays.radiance).flat_map(|(s, t)| s.radiance.into_iter().zip(*t))
            {
                squares += (encoded(got) - encoded(expected)).powi(2);
                logs += f64::from(got.ln_1p() - expected.ln_1p()).powi(2);
                count += 1.0;
            }
        }
        Figures { psnr_db: -10.0 * (squares / count).log10(), log_rmse: (logs / count).sqrt() }
    }

    /// Returns the network's octree, grown by its own predictions.
    pub fn completed(&self, net: &LightNet) -> LightOctree {
        net.forward(&self.input, None, Growth::Predicted).unwrap().into_light().unwrap().0
    }

    /// Returns the share of correct split labels along the true octree.
    pub fn labels_right(&self, net: &LightNet) -> f64 {
        let output = net.forward(&self.input, None, Growth::Truth(&self.truth.octree)).unwrap();
        let levels = &self.truth.octree.levels()[self.truth.octree.full_depth() as usize..];
        let (mut right, mut all) = (0, 0);
        for (level, truth) in output.levels.iter().zip(levels) {
            let logits: Vec<f32> = numbers(&level.logits);
            right += logits.iter().zip(&truth.rows).filter(|(l, row)| (**l > 0.0) == (**row >= 0)).count();
            all += logits.len();
        }
        right as f64 / all as f64
    }

    /// Returns the training panoramas.
    pub fn views(&self) -> &[NovelView] {
        &self.sample.views
    }
}

fn linear(photo: &Image<[u8; 3]>) -> Image<[f32; 3]> {
    photo.map(|rgb| rgb.map(lo_imaging::linear_from_srgb8))
}

pub fn numbers<const D: usize>(tensor: &Tensor<D>) -> Vec<f32> {
    tensor.clone().inner().into_data().iter().collect()
}
