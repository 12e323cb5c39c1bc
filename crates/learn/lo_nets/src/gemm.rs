//! GEMM microkernels: the inner loops of convolutions and their gradients, in vector registers.

use pulp::{Arch, Simd, WithSimd};

/// Output channels that [`GemmKernels::outer`] computes together.
pub const GROUP: usize = 8;

/// Numbers in the widest supported vector.
pub const LANES: usize = 16;

/// Rows and windows that [`GemmKernels::inner`] computes together, with sums in registers.
const ROWS: usize = 4;
const WINDOWS: usize = 6;

/// Windows of a tile with a single row: 3 × 3 weights need one tile, 5 × 5 weights three.
const WINDOWS_OF_ROW: usize = 9;

/// Maximum number of weights in a column of [`GemmKernels::filter`].
pub const MAX_COLUMN: usize = 5;

/// Contiguous rows of equal width.
#[derive(Debug)]
pub struct Rows<'a, T> {
    pub out: &'a mut [T],
    pub width: usize,
}

/// Sums of products of weights or rows with data at given offsets.
pub trait GemmKernels: Sized {
    /// Computes `out[channel][column] = Σ_k weights[k][channel] · data[offsets[k] + column]`, with weights
    /// `[windows, GROUP]` and at most `GROUP` channels of equal length.
    ///
    /// # Panics
    /// Where a window, extended to whole vectors of `LANES`, exceeds `data`.
    fn outer(weights: &[Self], data: &[Self], offsets: &[usize], out: &mut [&mut [Self]]);

    /// Computes `out[row][column] = Σ_i Σ_k weights[i · count + k] · data[offsets[i] + (row + k) · pitch + column]` for
    /// rows of `width` numbers.
    ///
    /// # Panics
    /// Where a row, extended to whole vectors of `LANES`, exceeds `data`, or `count` is not in 1..=[`MAX_COLUMN`].
    fn filter(weights: &[Self], count: usize, data: &[Self], offsets: &[usize], pitch: usize, rows: Rows<Self>);

    /// Computes `out[row][k] += Σ_p rows[row][p] · data[offsets[k] + p]` for rows of equal length.
    ///
    /// # Panics
    /// Where a window exceeds `data`.
    fn inner(rows: &[&[Self]], data: &[Self], offsets: &[usize], out: &mut [Self]);
}

/// Reference implementation for gradient checks; not optimised.
impl GemmKernels for f64 {
    fn outer(weights: &[Self], data: &[Self], offsets: &[usize], out: &mut [&mut [Self]]) {
        for (channel, out) in out.iter_mut().enumerate() {
            for (column, out) in out.iter_mut().enumerate() {
                let factors = weights.iter().skip(channel).step_by(GROUP);
                *out = factors.zip(offsets).map(|(weight, offset)| weight * data[offset + column]).sum();
            }
        }
    }

    fn filter(weights: &[Self], count: usize, data: &[Self], offsets: &[usize], pitch: usize, rows: Rows<Self>) {
        for (row, out) in rows.out.chunks_exact_mut(rows.width).enumerate() {
            for (column, out) in out.iter_mut().enumerate() {
                let product = |(i, weight)| weight * data[offsets[i / count] + (row + i % count) * pitch + column];
                *out = weights.iter().enumerate().map(product).sum();
            }
        }
    }

    fn inner(rows: &[&[Self]], data: &[Self], offsets: &[usize], out: &mut [Self]) {
        for (row, out) in rows.iter().zip(out.chunks_exact_mut(offsets.len())) {
            for (&offset, out) in offsets.iter().zip(out) {
                *out += row.iter().zip(&data[offset..][..row.len()]).map(|(a, b)| a * b).sum::<f64>();
            }
        }
    }
}

impl GemmKernels for f32 {
    fn outer(weights: &[Self], data: &[Self], offsets: &[usize], out: &mut [&mut [Self]]) {
        assert_eq!(weights.len(), offsets.len() * GROUP, "weights of a group for each window");
        assert!(out.len() <= GROUP && out.iter().all(|row| row.len() == out[0].len()), "a group of channels");
        Arch::new().dispatch(Outer { weights, data, offsets, out });
    }

    fn filter(weights: &[Self], count: usize, data: &[Self], offsets: &[usize], pitch: usize, rows: Rows<Self>) {
        assert_eq!(weights.len(), count * offsets.len(), "weights for each column");
        assert!((1..=MAX_COLUMN).contains(&count), "columns have 1 to MAX_COLUMN weights");
        let Rows { out, width } = rows;
        Arch::new().dispatch(Filter { weights, count, data, offsets, pitch, out, width });
    }

    fn inner(rows: &[&[Self]], data: &[Self], offsets: &[usize], out: &mut [Self]) {
        assert_eq!(out.len(), rows.len() * offsets.len(), "a sum for each row and window");
        Arch::new().dispatch(Inner { rows, data, offsets, out });
    }
}

struct Outer<'a, 'b> {
    weights: &'a [f32],
    data: &'a [f32],
    offsets: &'a [usize],
    out: &'a mut [&'b mut [f32]],
}

impl WithSimd for Outer<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let columns = self.out.first().map_or(0, |row| row.len());
        let mut start = 0;
        while start < columns {
            let vectors = (columns - start).div_ceil(S::F32_LANES);
            // Four vectors run faster as two tiles of two.
            let vectors = if vectors == 4 { 2 } else { vectors.min(3) };
            if S::REGISTER_COUNT >= 32 {
                match vectors {
                    1 => self.tile::<S, GROUP, 1>(simd, 0, start),
                    2 => self.tile::<S, GROUP, 2>(simd, 0, start),
                    _ => self.tile::<S, GROUP, 3>(simd, 0, start),
                }
            } else {
                for first in [0, GROUP / 2] {
                    match vectors {
                        1 => self.tile::<S, { GROUP / 2 }, 1>(simd, first, start),
                        2 => self.tile::<S, { GROUP / 2 }, 2>(simd, first, start),
                        _ => self.tile::<S, { GROUP / 2 }, 3>(simd, first, start),
                    }
                }
            }
            start += vectors * S::F32_LANES;
        }
    }
}

impl Outer<'_, '_> {
    /// Computes `CHANNELS` channels from `first` and `VECTORS` vectors of columns from `start`.
    #[inline(always)]
    fn tile<S: Simd, const CHANNELS: usize, const VECTORS: usize>(&mut self, simd: S, first: usize, start: usize) {
        let width = VECTORS * S::F32_LANES;
        let mut sums = [[simd.splat_f32s(0.0); VECTORS]; CHANNELS];
        for (&offset, weights) in self.offsets.iter().zip(self.weights.as_chunks::<GROUP>().0) {
            let (values, _) = S::as_simd_f32s(&self.data[offset + start..][..width]);
            for channel in 0..CHANNELS {
                let weight = simd.splat_f32s(weights[first + channel]);
                for vector in 0..VECTORS {
                    sums[channel][vector] = simd.mul_add_e_f32s(weight, values[vector], sums[channel][vector]);
                }
            }
        }
        // Copies by way of a tile of fixed size: with slices of variable size, the compiler spills the sums to memory.
        let mut tile = [0.0; GROUP * 3 * LANES];
        for (tile, sums) in tile.chunks_exact_mut(3 * LANES).zip(&sums) {
            S::as_mut_simd_f32s(tile).0[..VECTORS].copy_from_slice(sums);
        }
        for (out, tile) in self.out.iter_mut().skip(first).zip(tile.chunks_exact(3 * LANES)).take(CHANNELS) {
            let end = out.len().min(start + width);
            out[start..end].copy_from_slice(&tile[..end - start]);
        }
    }
}

struct Filter<'a> {
    weights: &'a [f32],
    count: usize,
    data: &'a [f32],
    offsets: &'a [usize],
    pitch: usize,
    out: &'a mut [f32],
    width: usize,
}

impl WithSimd for Filter<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match self.count {
            1 => self.all::<S, 1>(simd),
            2 => self.all::<S, 2>(simd),
            3 => self.all::<S, 3>(simd),
            4 => self.all::<S, 4>(simd),
            _ => self.all::<S, MAX_COLUMN>(simd),
        }
    }
}

impl Filter<'_> {
    #[inline(always)]
    fn all<S: Simd, const COUNT: usize>(mut self, simd: S) {
        let rows = self.out.len() / self.width;
        let mut row = 0;
        while row < rows {
            row += match rows - row {
                // Half the registers hold half the rows.
                8.. if S::REGISTER_COUNT >= 32 => self.rows::<S, COUNT, 8>(simd, row),
                4.. => self.rows::<S, COUNT, 4>(simd, row),
                2.. => self.rows::<S, COUNT, 2>(simd, row),
                _ => self.rows::<S, COUNT, 1>(simd, row),
            };
        }
    }

    /// Computes `ROWS` rows from `row`. Returns their number.
    #[inline(always)]
    fn rows<S: Simd, const COUNT: usize, const ROWS: usize>(&mut self, simd: S, row: usize) -> usize {
        for start in (0..self.width).step_by(S::F32_LANES) {
            let mut sums = [simd.splat_f32s(0.0); ROWS];
            for (&offset, weights) in self.offsets.iter().zip(self.weights.as_chunks::<COUNT>().0) {
                let data = &self.data[offset + row * self.pitch + start..];
                // Loaded values are reused for all weights of the column.
                let values: [S::f32s; 8 + MAX_COLUMN - 1] = std::array::from_fn(|i| {
                    let is_read = i < ROWS + COUNT - 1;
                    if is_read { S::as_simd_f32s(&data[i * self.pitch..][..S::F32_LANES]).0[0] } else { sums[0] }
                });
                for k in 0..COUNT {
                    let weight = simd.splat_f32s(weights[k]);
                    for row in 0..ROWS {
                        sums[row] = simd.mul_add_e_f32s(weight, values[row + k], sums[row]);
                    }
                }
            }
            let end = start + S::F32_LANES;
            for (out, sum) in self.out[row * self.width..].chunks_exact_mut(self.width).zip(sums) {
                if end <= self.width {
                    S::as_mut_simd_f32s(&mut out[start..end]).0[0] = sum;
                } else {
                    simd.partial_store_f32s(&mut out[start..], sum);
                }
            }
        }
        ROWS
    }
}

struct Inner<'a> {
    rows: &'a [&'a [f32]],
    data: &'a [f32],
    offsets: &'a [usize],
    out: &'a mut [f32],
}

impl WithSimd for Inner<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        if self.rows.len() == 1 {
            for k in (0..self.offsets.len()).step_by(WINDOWS_OF_ROW) {
                self.tile::<S, 1, WINDOWS_OF_ROW>(simd, 0, k);
            }
            return;
        }
        // A tile's windows stay in the L1 cache while all rows pass.
        for k in (0..self.offsets.len()).step_by(WINDOWS) {
            for row in (0..self.rows.len()).step_by(ROWS) {
                if S::REGISTER_COUNT >= 32 {
                    self.tile::<S, ROWS, WINDOWS>(simd, row, k);
                } else {
                    for row in [row, row + ROWS / 2] {
                        for k in [k, k + WINDOWS / 2] {
                            self.tile::<S, { ROWS / 2 }, { WINDOWS / 2 }>(simd, row, k);
                        }
                    }
                }
            }
        }
    }
}

impl Inner<'_> {
    /// Computes `R` rows and `W` windows from the given ones. Past the end, the last ones are repeated and their sums
    /// dropped.
    #[inline(always)]
    fn tile<S: Simd, const R: usize, const W: usize>(&mut self, simd: S, first_row: usize, first_window: usize) {
        let (last_row, last_window) = (self.rows.len() - 1, self.offsets.len() - 1);
        let length = self.rows[0].len();
        let vectors = length / S::F32_LANES;
        let empty: (&[S::f32s], &[f32]) = (&[], &[]);
        let (mut rows, mut windows) = ([empty; R], [empty; W]);
        for (i, row) in rows.iter_mut().enumerate() {
            let (head, tail) = S::as_simd_f32s(&self.rows[(first_row + i).min(last_row)][..length]);
            *row = (&head[..vectors], tail);
        }
        for (i, window) in windows.iter_mut().enumerate() {
            let offset = self.offsets[(first_window + i).min(last_window)];
            let (head, tail) = S::as_simd_f32s(&self.data[offset..][..length]);
            *window = (&head[..vectors], tail);
        }
        let mut sums = [[simd.splat_f32s(0.0); W]; R];
        for p in 0..vectors {
            for window in 0..W {
                let value = windows[window].0[p];
                for row in 0..R {
                    sums[row][window] = simd.mul_add_e_f32s(rows[row].0[p], value, sums[row][window]);
                }
            }
        }
        for window in 0..W {
            let value = simd.partial_load_f32s(windows[window].1);
            for row in 0..R {
                let factor = simd.partial_load_f32s(rows[row].1);
                sums[row][window] = simd.mul_add_e_f32s(factor, value, sums[row][window]);
            }
        }
        for (row, sums) in (first_row..=last_row).zip(&sums) {
            for (k, &sum) in (first_window..=last_window).zip(sums) {
                self.out[row * self.offsets.len() + k] += simd.reduce_sum_f32s(sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{difference, values};

    fn narrow(values: &[f64]) -> Vec<f32> {
        values.iter().map(|&value| value as f32).collect()
    }

    #[test]
    fn f32_sums_are_the_f64_sums() {
        for (windows, columns, rows) in [(1, 16, 1), (5, 37, 3), (27, 48, 4), (40, 61, 9), (13, 175, 7)] {
            let data = values(3 * windows + 2 * columns + LANES, 1);
            let offsets: Vec<usize> = (0..windows).map(|k| (7 * k) % (3 * windows)).collect();
            let weights = values(GROUP * windows, 2);
            let channels = GROUP.min(rows);
            let (mut expected, mut got) = (vec![0.0; channels * columns], vec![0.0; channels * columns]);
            f64::outer(&weights, &data, &offsets, &mut expected.chunks_mut(columns).collect::<Vec<_>>());
            let (weights, narrow_data) = (narrow(&weights), narrow(&data));
            f32::outer(&weights, &narrow_data, &offsets, &mut got.chunks_mut(columns).collect::<Vec<_>>());
            let got: Vec<f64> = got.into_iter().map(f64::from).collect();
            let (error, largest) = difference(&got, &expected);
            assert!(error <= 2e-6 * largest, "outer {windows} {columns}: {error} of {largest}");

            // Lengths that are not a multiple of any vector length.
            let length = columns + 5;
            let left = values(rows * length, 3);
            let (mut expected, mut got) = (vec![1.0; rows * windows], vec![1.0; rows * windows]);
            f64::inner(&left.chunks(length).collect::<Vec<_>>(), &data, &offsets, &mut expected);
            let left = narrow(&left);
            f32::inner(&left.chunks(length).collect::<Vec<_>>(), &narrow_data, &offsets, &mut got);
            let got: Vec<f64> = got.into_iter().map(f64::from).collect();
            let (error, largest) = difference(&got, &expected);
            assert!(error <= 2e-6 * largest, "inner {windows} {rows}: {error} of {largest}");
        }
    }

    #[test]
    fn f32_filters_are_the_f64_filters() {
        for (rows, width, count, columns) in [(1, 3, 1, 1), (7, 16, 5, 2), (23, 40, 3, 4), (6, 9, 2, 3), (9, 17, 4, 1)]
        {
            let pitch = width + 3;
            let data = values((rows + 8) * pitch + LANES, 1);
            let offsets: Vec<usize> = (0..columns).map(|i| 2 * pitch + 5 * i % 4).collect();
            let weights = values(count * columns, 2);
            let (mut expected, mut got) = (vec![1.0; rows * width], vec![1.0; rows * width]);
            f64::filter(&weights, count, &data, &offsets, pitch, Rows { out: &mut expected, width });
            f32::filter(&narrow(&weights), count, &narrow(&data), &offsets, pitch, Rows { out: &mut got, width });
            let got: Vec<f64> = got.into_iter().map(f64::from).collect();
            let (error, largest) = difference(&got, &expected);
            assert!(error <= 2e-6 * largest, "{rows} {width}: {error} of {largest}");
        }
    }
}
