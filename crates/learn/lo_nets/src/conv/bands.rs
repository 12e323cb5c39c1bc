//! A convolution in bands of rows, each a task of work for one thread.

use rayon::prelude::*;

use crate::conv::window::Window;
use crate::cpu_ops::{Number, zeros};

/// Pieces of work at least: bands of rows, or where these are few, of channels too. Fixed, as is everything that sums depend on.
pub(super) const MIN_TASKS: usize = 8;

/// A convolution band by band of `rows` output rows. `read` makes what a band with this first row reads, `sums` computes from it the columns of a
/// group of `group` channels; the rows that it is given are those of the band, in the last one perhaps fewer.
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
    // Few bands: each is read several times, for some of the output's channels each.
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
