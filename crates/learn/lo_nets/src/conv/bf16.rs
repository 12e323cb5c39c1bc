//! Convolution and its weight gradient with bf16 products.

use std::cell::Cell;

use rayon::prelude::*;

use crate::conv::activation::Affine;
use crate::conv::amx::{self, BLOCK, BlockProduct, STEP, bf16, bf16_pair};
use crate::conv::bands::{MIN_TASKS, by_bands};
use crate::conv::window::Window;
use crate::cpu_ops::zeros;

thread_local! {
    static ENABLED: Cell<bool> = const { Cell::new(false) };
}

/// Runs `work`. Where `enabled` and AMX is available, convolutions started on this thread and their gradients multiply
/// in bf16 and sum in f32.
///
/// Tensors stay f32, as in `torch.autocast`. Without AMX, or without the cargo feature `amx`, results do not change.
/// While `work` waits, rayon may run foreign jobs on its thread; [`in_pool`] isolates those.
pub fn in_bf16<R>(enabled: bool, work: impl FnOnce() -> R) -> R {
    /// Restores the former value, also after a panic.
    struct RestoreOnDrop(bool);
    impl Drop for RestoreOnDrop {
        fn drop(&mut self) {
            ENABLED.set(self.0);
        }
    }
    let _restore = RestoreOnDrop(ENABLED.replace(enabled));
    work()
}

/// Runs `work` on a thread of rayon's pool, in f32 unless it calls [`in_bf16`] itself.
///
/// From other threads, each of some thousand small parallel loops would wait for a pool thread to wake up.
pub fn in_pool<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    rayon::scope(|_| in_bf16(false, work))
}

/// Reports whether [`in_bf16`] is active on this thread and AMX is available.
pub(super) fn is_enabled() -> bool {
    ENABLED.get() && amx::available()
}

/// Convolves with the weights `weight(output, channel, tap)`.
pub(super) fn convolve(
    window: &Window,
    x: &[f32],
    activation: Option<Affine<f32>>,
    weight: &(impl Fn(usize, usize, usize) -> f32 + Sync),
    outputs: usize,
    bias: Option<&[f32]>,
) -> Vec<f32> {
    let channels = x.len() / window.input_area();
    let rows = window.band_rows(channels);
    let plane = window.plane(rows);
    // Each step multiplies 32 channels by the weights of one tap.
    let taps = window.offsets(1, rows);
    let steps = (0..channels.div_ceil(STEP)).flat_map(|part| taps.iter().map(move |tap| part * STEP / 2 * plane + tap));
    let steps: Vec<usize> = steps.collect();
    let mut weights = vec![0; outputs.div_ceil(BLOCK) * steps.len() * BLOCK * STEP];
    weights.par_chunks_mut(BLOCK * STEP).enumerate().for_each(|(block, out)| {
        let (group, part, tap) = (block / steps.len(), block % steps.len() / taps.len(), block % taps.len());
        let (first, first_channel) = (group * BLOCK, part * STEP);
        for (output, out) in (first..outputs.min(first + BLOCK)).zip(out.chunks_exact_mut(STEP)) {
            let part = first_channel..channels.min(first_channel + STEP);
            out.iter_mut().zip(part).for_each(|(out, channel)| *out = bf16(weight(output, channel, tap)));
        }
    });
    let read = |band: &mut Vec<u32>, first| window.read(band, [first, rows], x, activation);
    let sums = |band: &Vec<u32>, group: usize, out: &mut [&mut [f32]]| {
        let columns = out.first().map_or(0, |row| row.len());
        let mut block = [[0.0; BLOCK]; BLOCK];
        for first in (0..columns).step_by(BLOCK) {
            let product = BlockProduct {
                left: &weights[group * steps.len() * BLOCK * STEP..][..steps.len() * BLOCK * STEP],
                halves: [0, BLOCK / 2 * STEP],
                left_stride: STEP,
                left_step: BLOCK * STEP,
                right: band,
                offsets: &steps,
                first,
                right_stride: plane,
            };
            product.block(&mut block);
            let end = columns.min(first + BLOCK);
            for (out, row) in out.iter_mut().zip(&block) {
                out[first..end].copy_from_slice(&row[..end - first]);
            }
        }
    };
    by_bands(window, rows, [outputs, BLOCK], bias, read, sums)
}

/// Returns the gradient of the weights, `[outputs, channels · kernel²]`.
pub(super) fn weight_gradient(
    window: &Window,
    x: &[f32],
    activation: Option<Affine<f32>>,
    gradient: &[f32],
    outputs: usize,
) -> Vec<f32> {
    let (rows, area) = (window.band_rows(BLOCK), window.input_area());
    let gradient = PackedGradient::new(window, rows, gradient, outputs);
    let (taps, plane) = (window.offsets(1, rows), window.plane(rows));
    // Sums are [tap, channel, output] for 32 channels. With few channels, bands are split between tasks and summed
    // afterwards.
    let groups: Vec<&[f32]> = x.chunks(BLOCK * area).collect();
    let bands: Vec<(usize, &[u32])> = (0..).step_by(rows).zip(gradient.bands()).collect();
    let shares = MIN_TASKS.div_ceil(groups.len()).min(bands.len());
    let parts: Vec<Vec<f32>> = (0..groups.len() * shares)
        .into_par_iter()
        .map(|i| {
            let (group, share) = (i / shares, i % shares);
            let x = groups[group];
            let channels = group * BLOCK..group * BLOCK + x.len() / area;
            let activation = activation.map(|affine| affine.part(channels));
            let some = bands.len() * share / shares..bands.len() * (share + 1) / shares;
            let mut sums = vec![0.0; taps.len() * BLOCK * gradient.outputs];
            let mut band: Vec<u16> = Vec::new();
            let mut block = [[0.0; BLOCK]; BLOCK];
            for &(first, gradients) in &bands[some] {
                window.read(&mut band, [first, rows], x, activation);
                for (tap, sums) in taps.iter().zip(sums.chunks_exact_mut(BLOCK * gradient.outputs)) {
                    for first in (0..gradient.outputs).step_by(BLOCK) {
                        let product = BlockProduct {
                            left: &band,
                            halves: [*tap, tap + BLOCK / 2 * plane],
                            left_stride: plane,
                            left_step: STEP,
                            right: gradients,
                            offsets: &gradient.steps,
                            first,
                            right_stride: gradient.outputs,
                        };
                        product.block(&mut block);
                        for (sums, row) in sums.chunks_exact_mut(gradient.outputs).zip(&block) {
                            sums[first..].iter_mut().zip(row).for_each(|(sum, new)| *sum += new);
                        }
                    }
                }
            }
            sums
        })
        .collect();
    let all = x.len() / area;
    let mut out = zeros(outputs * all * taps.len());
    out.par_chunks_mut((all * taps.len()).max(1)).enumerate().for_each(|(output, out)| {
        for (channel, out) in out.chunks_exact_mut(taps.len()).enumerate() {
            let place = channel % BLOCK * gradient.outputs + output;
            for part in &parts[channel / BLOCK * shares..][..shares] {
                let sums = part.chunks_exact(BLOCK * gradient.outputs);
                out.iter_mut().zip(sums).for_each(|(out, sums)| *out += sums[place]);
            }
        }
    });
    out
}

/// The output's gradient as right operand of a product: a band's columns in pairs for each output, zeros in unused
/// columns.
struct PackedGradient {
    pairs: Vec<u32>,
    /// Number of outputs, rounded up to a multiple of [`BLOCK`].
    outputs: usize,
    /// Offset of each step's columns in a band.
    steps: Vec<usize>,
}

impl PackedGradient {
    fn new(window: &Window, rows: usize, gradient: &[f32], outputs: usize) -> Self {
        let (height, width, pitch) = (window.rows(), window.output[1], window.pitch());
        let padded = outputs.next_multiple_of(BLOCK);
        let steps: Vec<usize> = (0..(rows * pitch).div_ceil(STEP)).map(|step| step * STEP / 2 * padded).collect();
        let band = steps.len() * STEP / 2 * padded;
        let mut pairs = zeros(height.div_ceil(rows) * band);
        let area = window.images * window.area();
        pairs.par_chunks_mut(band.max(1)).enumerate().for_each(|(index, out)| {
            let mut columns = vec![0.0; steps.len() * STEP];
            let first = index * rows;
            for (output, gradient) in gradient.chunks_exact(area).enumerate() {
                let mut gradient = gradient[window.rows_before(first) * width..].chunks_exact(width);
                // Columns past the width stay 0, as do rows past the height in the last band.
                let lines = (first..height.min(first + rows)).zip(columns.chunks_exact_mut(pitch));
                for (_, line) in lines.filter(|(row, _)| window.is_row(*row)) {
                    line[..width].copy_from_slice(gradient.next().expect("a row of the output"));
                }
                let pairs = out.chunks_exact_mut(padded).zip(columns.as_chunks::<2>().0);
                pairs.for_each(|(out, &[even, odd])| out[output] = bf16_pair(even, odd));
            }
        });
        Self { pairs, outputs: padded, steps }
    }

    /// Iterates over the bands.
    fn bands(&self) -> impl Iterator<Item = &[u32]> {
        self.pairs.chunks_exact((self.steps.len() * STEP / 2 * self.outputs).max(1))
    }
}
