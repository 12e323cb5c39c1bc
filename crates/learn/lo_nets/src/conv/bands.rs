//! Convolution in bands of rows, each a task for one thread.

use rayon::prelude::*;

use crate::conv::window::Window;
use crate::cpu_ops::{Number, zeros};

/// Minimum number of tasks: bands of rows, split by channels where bands are few. Fixed, as results depend on it.
pub(super) const MIN_TASKS: usize = 8;

/// Convolves band by band, with `rows` output rows in a band.
///
/// `read` fills a band from its first row. `sums` computes the columns of a group of `group` channels from it, for the
/// rows of the band (fewer in the last one).
pub(super) fn by_bands<T: Number, B: Default>(
    window: &Window,
    rows: usize,
    [outputs, group]: [usize; 2],
    bias: Option<&[T]>,
    read: impl Fn(&mut B, usize) + Sync,
    sums: impl Fn(&B, usize, &mut [&mut [T]]) + Sync,
) -> Vec<T> {
    let (height, width) = (window.rows(), window.output[1]);
    let area = window.images * window.area();
    let mut out = zeros(outputs * area);
    // With few bands, each is read several times, for part of the output's channels each.
    let (groups, bands) = (outputs.div_ceil(group), height.div_ceil(rows));
    let groups = groups.div_ceil(MIN_TASKS.div_ceil(bands));
    let mut tasks = Vec::new();
    for (i, channels) in out.chunks_mut(groups * group * area).enumerate() {
        let first_task = tasks.len();
        tasks.extend((0..bands).map(|band| BandTask {
            first_row: band * rows,
            first_group: i * groups,
            channels: Vec::with_capacity(groups * group),
        }));
        for channel in channels.chunks_mut(area) {
            let mut rest = channel;
            for task in &mut tasks[first_task..] {
                let ends = [task.first_row, height.min(task.first_row + rows)];
                let [begin, end] = ends.map(|row| window.rows_before(row));
                task.channels.push(rest.split_off_mut(..(end - begin) * width).expect("rows of the output"));
            }
        }
    }
    let columns = rows * window.pitch();
    let scratch = || (B::default(), vec![T::default(); group * columns]);
    tasks.into_par_iter().for_each_init(scratch, |(band, scratch), mut task| {
        read(band, task.first_row);
        for (index, channels) in (task.first_group..).zip(task.channels.chunks_mut(group)) {
            if window.is_dense() {
                sums(band, index, channels);
            } else {
                let mut rows: Vec<&mut [T]> = scratch.chunks_exact_mut(columns).take(channels.len()).collect();
                sums(band, index, &mut rows);
                for (channel, sums) in channels.iter_mut().zip(rows) {
                    let sums = (task.first_row..height).zip(sums.chunks_exact(window.pitch()));
                    let sums = sums.filter(|(row, _)| window.is_row(*row));
                    for (out, (_, sums)) in channel.chunks_exact_mut(width).zip(sums) {
                        out.copy_from_slice(&sums[..width]);
                    }
                }
            }
            if let Some(bias) = bias {
                for (channel, &bias) in channels.iter_mut().zip(&bias[index * group..]) {
                    channel.iter_mut().for_each(|out| *out += bias);
                }
            }
        }
    });
    out
}

/// Part of the output: a band of rows of some channels.
struct BandTask<'a, T> {
    first_row: usize,
    first_group: usize,
    channels: Vec<&'a mut [T]>,
}
