use pulp::{Arch, Simd, WithSimd};

use crate::conv::activation::Affine;
use crate::conv::amx::{BLOCK, STEP, bf16};
use crate::cpu_ops::Number;
use crate::gemm::LANES;

/// Numbers in a band over all channels: half a megabyte in f32, which fits the L2 cache.
const BAND: usize = 1 << 17;

/// Maximum number of columns in a band.
const BAND_COLUMNS: usize = 2048;

/// Geometry of a convolution: which input pixels each output pixel reads.
///
/// The image is read in bands of output rows. A band holds all channels of the input that its rows read, padded with
/// zeros, sorted by pixel position modulo stride. In this layout, the pixels that one weight multiplies are contiguous.
/// Rows of a band are slightly wider than those of the output; values in columns past the output's width are unused.
///
/// Several images are read as one tall image with rows of zeros between them. Some of its output rows are unused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Number of images. The images of a channel are contiguous.
    pub images: usize,
    /// Height and width of an input image.
    pub input: [usize; 2],
    /// Height and width of an output image.
    pub output: [usize; 2],
    /// Side of the square kernel.
    pub kernel: usize,
    /// Input pixels between neighbouring output pixels.
    pub stride: usize,
    /// Zero rows and columns before the image.
    pub padding: usize,
    /// Distance of the input's pixels, with zeros between them. Above 1 in gradients, where it is the stride of the
    /// forward convolution.
    pub spread: usize,
}

impl Window {
    /// Window for one image of height and width `input`, with zeros `before` and `after` it.
    ///
    /// # Panics
    /// Where the image is smaller than the kernel.
    pub fn new(input: [usize; 2], kernel: usize, stride: usize, [before, after]: [usize; 2]) -> Self {
        let output = input.map(|side| {
            let padded = before + side + after;
            assert!(kernel > 0 && padded >= kernel, "an image of side {side} for a kernel of side {kernel}");
            (padded - kernel) / stride + 1
        });
        Self { images: 1, input, output, kernel, stride, padding: before, spread: 1 }
    }

    /// Returns the window that maps the output's gradient to the input's.
    pub fn transposed(&self) -> Self {
        // Padding beyond the kernel's side is not supported.
        assert!(self.padding < self.kernel, "padding below the kernel's side");
        Self {
            input: self.output,
            output: self.input,
            stride: 1,
            padding: self.kernel - 1 - self.padding,
            spread: self.stride,
            ..*self
        }
    }

    /// Returns the pixels of an output image.
    pub fn area(&self) -> usize {
        self.output[0] * self.output[1]
    }

    /// Returns the pixels of all input images.
    pub fn input_area(&self) -> usize {
        self.images * self.input[0] * self.input[1]
    }

    /// Returns the rows from one image to the next in the tall image, with enough zeros that no window reaches two
    /// images.
    fn period(&self) -> usize {
        let last_row = |side: usize, step: usize| side.saturating_sub(1) * step;
        let read = (last_row(self.output[0], self.stride) + self.kernel).saturating_sub(self.padding);
        let least = read.max(last_row(self.input[0], self.spread) + 1 + self.padding).max(self.output[0] * self.stride);
        least.next_multiple_of(self.stride)
    }

    /// Returns the output rows of the tall image.
    pub fn rows(&self) -> usize {
        (self.images - 1) * (self.period() / self.stride) + self.output[0]
    }

    /// Reports whether an output row of the tall image is used.
    pub fn is_row(&self, row: usize) -> bool {
        row % (self.period() / self.stride) < self.output[0]
    }

    /// Counts the used output rows before this one.
    pub fn rows_before(&self, row: usize) -> usize {
        let period = self.period() / self.stride;
        row / period * self.output[0] + (row % period).min(self.output[0])
    }

    /// Returns the rows or columns of a band beyond those of the output.
    fn extra(&self) -> usize {
        (self.kernel - 1) / self.stride
    }

    /// Returns the width of a band's rows.
    pub fn pitch(&self) -> usize {
        self.output[1] + self.extra()
    }

    /// Returns the number of distinct pixel positions modulo stride that are read.
    fn phases(&self) -> usize {
        self.stride.min(self.kernel)
    }

    /// Reports whether every row and column of the tall output is used.
    pub fn is_dense(&self) -> bool {
        self.pitch() == self.output[1] && self.rows() == self.rows_before(self.rows())
    }

    /// Returns the output rows of a band of this many channels.
    pub fn band_rows(&self, channels: usize) -> usize {
        let columns = (BAND / (channels * self.phases().pow(2)).max(1)).clamp(4 * LANES, BAND_COLUMNS);
        let all = self.rows().max(1);
        let rows = (columns / self.pitch()).clamp(1, all);
        // Bands of equal size, as far as possible.
        all.div_ceil(all.div_ceil(rows))
    }

    /// Returns the numbers of one channel in a band.
    pub fn plane(&self, rows: usize) -> usize {
        self.phases().pow(2) * (rows + self.extra()) * self.pitch()
    }

    /// Returns the offset in a band of `rows` output rows for each weight: `[channels, kernel, kernel]`.
    pub fn offsets(&self, channels: usize, rows: usize) -> Vec<usize> {
        let (pitch, phases, stride) = (self.pitch(), self.phases(), self.stride);
        let phase_size = (rows + self.extra()) * pitch;
        let offset = |channel: usize, ky: usize, kx: usize| {
            let phase = (ky % stride) * phases + kx % stride;
            channel * self.plane(rows) + phase * phase_size + (ky / stride) * pitch + kx / stride
        };
        let side = self.kernel;
        let kernel = move |channel| (0..side).flat_map(move |ky| (0..side).map(move |kx| (channel, ky, kx)));
        (0..channels).flat_map(kernel).map(|(channel, ky, kx)| offset(channel, ky, kx)).collect()
    }

    /// Fills `band` with the input that `rows` output rows from `first` read, for the channels in `x`, optionally
    /// activated.
    pub(super) fn read<T: Number, P: BandElement<T>>(
        &self,
        band: &mut Vec<P>,
        [first, rows]: [usize; 2],
        x: &[T],
        activation: Option<Affine<T>>,
    ) {
        let (plane, channels) = (self.plane(rows), (x.len() / self.input_area()).next_multiple_of(P::PADDED_TO));
        // Reads past the last plane only serve unused columns.
        let length = channels / P::CHANNELS * plane + self.extra() + LANES.max(BLOCK + STEP);
        if band.len() < length {
            *band = vec![P::default(); length];
        }
        Arch::new().dispatch(FillBand { window: self, band, first, channels, plane, x, activation });
    }
}

/// Element of a band for numbers `T`.
pub(super) trait BandElement<T>: Copy + Default {
    /// Channels packed into a plane.
    const CHANNELS: usize;

    /// The number of channels is padded with zeros to a multiple of this.
    const PADDED_TO: usize;

    /// Inserts the number of the plane's channel `index`. Channels are inserted in order.
    fn with(self, index: usize, value: T) -> Self;
}

impl<T: Number> BandElement<T> for T {
    const CHANNELS: usize = 1;
    const PADDED_TO: usize = 1;

    #[inline(always)]
    fn with(self, _: usize, value: T) -> Self {
        value
    }
}

/// A bf16 number.
impl BandElement<f32> for u16 {
    const CHANNELS: usize = 1;
    const PADDED_TO: usize = BLOCK;

    #[inline(always)]
    fn with(self, _: usize, value: f32) -> Self {
        bf16(value)
    }
}

/// The bf16 numbers of two channels.
impl BandElement<f32> for u32 {
    const CHANNELS: usize = 2;
    const PADDED_TO: usize = STEP;

    #[inline(always)]
    fn with(self, index: usize, value: f32) -> Self {
        let value = Self::from(bf16(value));
        if index == 0 { value } else { self | value << 16 }
    }
}

struct FillBand<'a, T, P> {
    window: &'a Window,
    band: &'a mut [P],
    first: usize,
    channels: usize,
    plane: usize,
    x: &'a [T],
    activation: Option<Affine<'a, T>>,
}

impl<T: Number, P: BandElement<T>> WithSimd for FillBand<'_, T, P> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let mut channels = self.x.chunks_exact(self.window.input_area());
        for channel in 0..self.channels {
            let (plane, index) = (channel / P::CHANNELS, channel % P::CHANNELS);
            let plane = &mut self.band[plane * self.plane..][..self.plane];
            let store = |out: &mut P, value: T| *out = out.with(index, value);
            match (channels.next(), self.activation) {
                (None, _) => plane.iter_mut().for_each(|out| store(out, T::default())),
                (Some(x), None) => read_plane(self.window, plane, self.first, x, store, |x| x),
                (Some(x), Some(affine)) => {
                    let affine = affine.channel(channel);
                    read_plane(self.window, plane, self.first, x, store, |x| affine.rectified(x));
                }
            }
        }
    }
}

/// Fills one channel of a band that begins with output row `first`. Calls `store` with `value` of each pixel, or with
/// zero.
#[inline(always)]
fn read_plane<T: Number, P>(
    window: &Window,
    plane: &mut [P],
    first: usize,
    x: &[T],
    store: impl Fn(&mut P, T),
    value: impl Fn(T) -> T,
) {
    let Window { input: [height, width], stride, padding, spread, .. } = *window;
    let clear = |row: &mut [P]| row.iter_mut().for_each(|out| store(out, T::default()));
    let (phases, pitch) = (window.phases(), window.pitch());
    let period = window.period();
    if pitch == width && stride == 1 && spread == 1 && period == height {
        // Rows are contiguous.
        plane.iter_mut().zip(&x[first * width..]).for_each(|(out, &x)| store(out, value(x)));
        return;
    }
    let rows = plane.len() / (phases * phases * pitch);
    for (index, row) in plane.chunks_exact_mut(pitch).enumerate() {
        let (phase, row_index) = (index / rows, index % rows);
        // Row in the tall image.
        let y = (first + row_index) * stride + phase / phases;
        let position = y.checked_sub(padding).map(|y| (y / period, y % period));
        let is_pixel = |&(image, y): &(usize, usize)| image < window.images && y % spread == 0 && y / spread < height;
        let Some((image, y)) = position.filter(is_pixel) else {
            clear(row);
            continue;
        };
        let x = &x[(image * height + y / spread) * width..][..width];
        if stride == 1 && spread == 1 {
            let (left, rest) = row.split_at_mut(padding.min(pitch));
            let (middle, right) = rest.split_at_mut(width.min(rest.len()));
            clear(left);
            middle.iter_mut().zip(x).for_each(|(out, &x)| store(out, value(x)));
            clear(right);
        } else if spread > 1 {
            clear(row);
            let row = &mut row[padding.min(pitch)..];
            if spread == 2 {
                // Pairs are vectorisable.
                let (pairs, last) = row.as_chunks_mut::<2>();
                let firsts = pairs.iter_mut().map(|pair| &mut pair[0]).chain(last);
                firsts.zip(x).for_each(|(out, &x)| store(out, value(x)));
            } else {
                row.iter_mut().step_by(spread).zip(x).for_each(|(out, &x)| store(out, value(x)));
            }
        } else {
            // First column of the row within the image, and its position there.
            let column = phase % phases;
            let first = padding.saturating_sub(column).div_ceil(stride).min(pitch);
            let x = x.get((first * stride + column).saturating_sub(padding)..).unwrap_or_default();
            let (left, rest) = row.split_at_mut(first);
            let (middle, right) = rest.split_at_mut(x.len().div_ceil(stride).min(rest.len()));
            clear(left);
            if stride == 2 {
                let (pairs, last) = x.as_chunks::<2>();
                let firsts = pairs.iter().map(|pair| &pair[0]).chain(last);
                middle.iter_mut().zip(firsts).for_each(|(out, &x)| store(out, value(x)));
            } else {
                middle.iter_mut().zip(x.iter().step_by(stride)).for_each(|(out, &x)| store(out, value(x)));
            }
            clear(right);
        }
    }
}
