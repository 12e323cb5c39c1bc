//! The tracer against the f64 reference, and the reference against central differences.

use crate::common::Reference;
use lo_cone::{Cone, ConeSample, ConeTracer, SampleGradient, SampleWeight, Sampling, Settings, StepRule};
use lo_geometry::{Cube, Vec3};
use lo_octree::{LightOctree, Octree, key_from_xyz};

const CUBE: Cube = Cube { origin_m: Vec3::new(-1.5, 0.25, -4.0), edge_m: 3.0 };

/// Uniform numbers of a fixed sequence (SplitMix64).
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    fn vector(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit())
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = self.vector() * 2.0 - 1.0;
            if (0.01..1.0).contains(&v.length()) {
                return v.normalize();
            }
        }
    }
}

/// Creates clusters of leaves with unrelated features on every level; α from 0 to `max_alpha`.
fn random_octree(random: &mut Random, depth: u32, full_depth: u32, max_alpha: f32) -> LightOctree {
    let side = (1 << depth) as f32;
    let mut keys: Vec<u32> = (0..60)
        .flat_map(|_| {
            let (centre, size) = (random.vector() * side, 1.0 + random.unit() * side / 5.0);
            let mut blob = Vec::new();
            for _ in 0..400 {
                let p = (centre + random.direction() * size).clamp(Vec3::ZERO, Vec3::splat(side - 1.0));
                blob.push(key_from_xyz([p.x as u32, p.y as u32, p.z as u32]));
            }
            blob
        })
        .collect();
    keys.sort_unstable();
    keys.dedup();
    let count = keys.len();
    let mut light =
        LightOctree::from_leaves(keys, vec![[0.0; 4]; count], vec![0; count], CUBE, depth, full_depth).unwrap();
    fill(random, &mut light, max_alpha);
    light
}

fn fill(random: &mut Random, light: &mut LightOctree, max_alpha: f32) {
    for rgba in light.rgba.iter_mut().flatten() {
        let alpha = random.unit();
        *rgba = [4.0 * random.unit(), random.unit(), random.unit(), if alpha < 0.1 { 0.0 } else { alpha * max_alpha }];
    }
}

/// Creates an octree as a network grows it: nodes with features end at several depths.
fn grown_octree(random: &mut Random) -> LightOctree {
    let mut octree = Octree::full(2).unwrap();
    for _ in 0..3 {
        let finest = octree.levels().last().unwrap();
        let nonempty: Vec<bool> = (0..finest.len()).map(|_| random.unit() < 0.4).collect();
        let split: Vec<bool> = nonempty.iter().map(|&full| full && random.unit() < 0.7).collect();
        octree.set_nonempty(&nonempty).unwrap();
        octree.grow(&split).unwrap();
    }
    let finest = octree.levels().last().unwrap();
    let nonempty: Vec<bool> = (0..finest.len()).map(|_| random.unit() < 0.4).collect();
    octree.set_nonempty(&nonempty).unwrap();
    let rgba: Vec<Vec<[f32; 4]>> = octree.levels().iter().map(|level| vec![[0.0; 4]; level.nonempty]).collect();
    let seen = rgba.iter().map(|rows| vec![0; rows.len()]).collect();
    let mut light = LightOctree { octree, cube: CUBE, rgba, seen, lobes: None };
    fill(random, &mut light, 0.9);
    light
}

fn octrees(random: &mut Random) -> Vec<LightOctree> {
    vec![
        random_octree(random, 7, 4, 1.0),
        random_octree(random, 8, 2, 0.5),
        random_octree(random, 5, 5, 0.9),
        grown_octree(random),
    ]
}

fn all_settings() -> Vec<Settings> {
    let mut all = Vec::new();
    for step in [StepRule::Floored(0.5), StepRule::Literal] {
        for weight in [SampleWeight::One, SampleWeight::Paper] {
            for sampling in [Sampling::Nearest, Sampling::Blended, Sampling::Interpolated] {
                all.push(Settings { step, weight, sampling, ..Settings::default() });
            }
        }
    }
    all.push(Settings { first_step: 3.0, min_transmittance: 0.0, ..Settings::default() });
    all
}

/// Cones from inside and from outside, narrow and wide.
fn cones(random: &mut Random, count: usize) -> Vec<Cone> {
    let apertures = [0.0245, 0.0245, 0.1, 0.6, 0.004];
    (0..count)
        .map(|i| {
            let inside = CUBE.world_from_unit(random.vector());
            let direction = random.direction();
            let back = if i % 4 == 0 { 6.0 * random.unit() } else { 0.0 };
            Cone { origin: inside - direction * back, direction, tan_half_angle: apertures[i / 16 % apertures.len()] }
        })
        .collect()
}

#[test]
fn fast_agrees_with_reference() {
    let mut random = Random(1);
    for light in octrees(&mut random) {
        for settings in all_settings() {
            let (tracer, reference) = (ConeTracer::new(&light, settings).unwrap(), Reference::new(&light, settings));
            let cones = cones(&mut random, 400);
            let mut samples = vec![ConeSample::default(); cones.len()];
            tracer.trace_batch(&cones, &mut samples);
            let (mut compared, mut met) = (0, 0);
            for (cone, sample) in cones.iter().zip(&samples) {
                assert_eq!(*sample, tracer.trace(cone), "a batch gives what single cones give");
                let expected = reference.trace(cone);
                // f32 positions in the cube have errors up to 1e-5 leaf edges (1e-4 for an apex far outside), so a
                // sample nearer than that to a face may be on its other side.
                if expected.margin < 2e-4 {
                    continue;
                }
                compared += 1;
                met += usize::from(expected.opacity > 0.01);
                let got =
                    [sample.radiance[0], sample.radiance[1], sample.radiance[2], sample.distance_m, sample.opacity];
                let [r, g, b] = expected.radiance;
                for (got, expected) in got.into_iter().zip([r, g, b, expected.distance_m, expected.opacity]) {
                    let error = (f64::from(got) - expected).abs();
                    assert!(error <= 1e-4 * expected.abs() + 4e-5, "{got} for {expected}: {cone:?} {settings:?}");
                }
            }
            assert!(compared > 150 && met > 80, "{compared} compared, {met} met something: {settings:?}");
        }
    }
}

#[test]
fn gradients_agree_with_reference_and_central_differences() {
    let mut random = Random(2);
    for light in [random_octree(&mut random, 6, 3, 0.9), grown_octree(&mut random)] {
        for settings in all_settings() {
            // Early termination makes the result jump as features change; the derivative is that between the jumps.
            let settings = Settings { min_transmittance: 0.0, ..settings };
            let tracer = ConeTracer::new(&light, settings).unwrap();
            let mut reference = Reference::new(&light, settings);
            let cones: Vec<Cone> =
                cones(&mut random, 300).into_iter().filter(|cone| reference.trace(cone).margin > 2e-4).collect();
            let d_samples: Vec<SampleGradient> = cones
                .iter()
                .map(|_| SampleGradient {
                    radiance: (random.vector() - 0.5).to_array(),
                    distance_m: random.unit() - 0.5,
                    opacity: random.unit() - 0.5,
                })
                .collect();
            let mut expected: Vec<Vec<[f64; 4]>> = light.rgba.iter().map(|rows| vec![[0.0; 4]; rows.len()]).collect();
            for (cone, d_sample) in cones.iter().zip(&d_samples) {
                reference.add_gradient(cone, d_sample, &mut expected);
            }
            let largest =
                |channel: usize| expected.iter().flatten().fold(0.0f64, |most, row| most.max(row[channel].abs()));
            let scale: [f64; 4] = std::array::from_fn(largest);

            let fast = tracer.trace_backward(&cones, &d_samples).rgba;
            let mut strongest = Vec::new();
            for (depth, (fast, expected)) in fast.iter().zip(&expected).enumerate() {
                assert_eq!(fast.len(), expected.len());
                for (row, (fast, expected)) in fast.iter().zip(expected).enumerate() {
                    for channel in 0..4 {
                        let error = (f64::from(fast[channel]) - expected[channel]).abs() / scale[channel];
                        assert!(error < 1e-4, "{error} {channel} {settings:?}");
                        strongest.push(((expected[channel] / scale[channel]).abs(), depth, row, channel));
                    }
                }
            }

            strongest.sort_by(|a, b| b.0.total_cmp(&a.0));
            let loss = |reference: &Reference| -> f64 {
                let mut loss = 0.0;
                for (cone, d_sample) in cones.iter().zip(&d_samples) {
                    let sample = reference.trace(cone);
                    loss += (0..3).map(|c| f64::from(d_sample.radiance[c]) * sample.radiance[c]).sum::<f64>();
                    loss += f64::from(d_sample.distance_m) * sample.distance_m;
                    loss += f64::from(d_sample.opacity) * sample.opacity;
                }
                loss
            };
            let with_alpha = strongest.iter().filter(|s| s.3 == 3).take(6);
            for &(_, depth, row, channel) in strongest.iter().filter(|s| s.3 < 3).take(3).chain(with_alpha) {
                let stored = reference.rgba[depth][row][channel];
                // Fourth order (five points): the error of second order, h², is above 1e-6 where rounding is not.
                // Radiance averaged by small extinctions is strongly non-linear: 5e-4 gives 5e-5.
                let h = 1e-4 * if channel == 3 { 1.0 - stored } else { 1.0 };
                let mut at = |offset: f64| {
                    reference.rgba[depth][row][channel] = stored + offset * h;
                    loss(&reference)
                };
                let slope = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
                reference.rgba[depth][row][channel] = stored;
                let error = (slope - expected[depth][row][channel]).abs() / scale[channel];
                assert!(error < 1e-6, "{error} {channel} {settings:?}");
            }
        }
    }
}

#[test]
fn results_do_not_depend_on_threads() {
    let mut random = Random(3);
    let light = random_octree(&mut random, 7, 4, 0.9);
    let cones = cones(&mut random, 5000);
    for sampling in [Sampling::Nearest, Sampling::Blended, Sampling::Interpolated] {
        let tracer = ConeTracer::new(&light, Settings { sampling, ..Settings::default() }).unwrap();
        let run = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut samples = vec![ConeSample::default(); cones.len()];
            let gradients = pool.install(|| {
                tracer.trace_with_gradients(&cones, &mut samples, &|index, sample| SampleGradient {
                    radiance: sample.radiance,
                    distance_m: index as f32,
                    opacity: sample.opacity,
                })
            });
            (samples, gradients)
        };
        let one = run(1);
        let mut alone = vec![ConeSample::default(); cones.len()];
        tracer.trace_batch(&cones, &mut alone);
        assert_eq!(one.0, alone);
        assert!(one == run(2) && one == run(5));
    }
}

#[test]
fn invalid_cones_see_nothing() {
    let mut random = Random(4);
    let light = random_octree(&mut random, 6, 2, 0.9);
    let settings = [StepRule::Literal, StepRule::Floored(0.5)].map(|step| Settings { step, ..Settings::default() });
    for settings in settings {
        let tracer = ConeTracer::new(&light, settings).unwrap();
        let inside = CUBE.centre_m();
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -1.0, 1e-30, 1e30, f32::MAX];
        for value in odd {
            for cone in [
                Cone { origin: Vec3::splat(value), direction: Vec3::X, tan_half_angle: 0.1 },
                Cone { origin: inside, direction: Vec3::splat(value), tan_half_angle: 0.1 },
                Cone { origin: inside, direction: Vec3::X, tan_half_angle: value },
                Cone { origin: inside + Vec3::X * value, direction: Vec3::NEG_X, tan_half_angle: 0.0 },
            ] {
                let sample = tracer.trace(&cone);
                assert!((0.0..=1.0).contains(&sample.opacity), "{cone:?} {sample:?}");
                assert!(sample.distance_m.is_finite() && sample.radiance.iter().all(|c| c.is_finite()), "{cone:?}");
            }
        }
        let away = Cone { origin: CUBE.origin_m - Vec3::ONE, direction: Vec3::NEG_X, tan_half_angle: 0.1 };
        assert_eq!(tracer.trace(&away), ConeSample::default());
        assert_eq!(tracer.panorama(inside, 1, 1).opacity.pixels().len(), 1);
    }
    for settings in [
        Settings { growth: f32::NAN, ..Settings::default() },
        Settings { first_step: 0.0, ..Settings::default() },
        Settings { step: StepRule::Floored(0.0), ..Settings::default() },
        Settings { min_transmittance: -1.0, ..Settings::default() },
    ] {
        assert!(ConeTracer::new(&light, settings).is_err());
    }
}
