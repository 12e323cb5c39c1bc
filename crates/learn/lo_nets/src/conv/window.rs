use pulp::{Arch, Simd, WithSimd};

use crate::conv::activation::Affine;
use crate::conv::amx::{BLOCK, STEP, bf16};
use crate::cpu_ops::Number;
use crate::gemm::LANES;

/// Numbers of a band of all channels together: half a megabyte in f32, so that it stays in the second cache.
const BAND: usize = 1 << 17;

/// Most columns of a band.
const BAND_COLUMNS: usize = 2048;

/// Which pixels of an image a convolution reads for which of its output.
///
/// The image is read in bands of output rows. A band holds what its rows read, all channels, with zeros around the image, sorted
/// by the remainder of the pixel's place divided by the stride: then what one weight is multiplied by, for all pixels of the band,
/// is a run of neighbouring numbers. Rows of a band are a little wider than those of the output; what is computed for
/// columns past the output's width means nothing.
///
/// Several images are read as one tall one, with rows of zeros between them; some of its output rows mean nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Pictures, of each channel one after the other.
    pub images: usize,
    /// Height and width of an image that is read.
    pub input: [usize; 2],
    /// Height and width of an image of the output.
    pub output: [usize; 2],
    /// Height and width of the weights.
    pub kernel: usize,
    /// Steps between neighbouring pixels of the output.
    pub stride: usize,
    /// Rows and columns of zeros before the image.
    pub padding: usize,
    /// Steps between neighbouring pixels of what is read, zeros between them: the stride of the convolution of which this is the
    /// gradient.
    pub spread: usize,
}

impl Window {
    /// The window of a convolution of one image of height and width `input`, with zeros `before` and `after` it.
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

    /// The window by which the gradient of the input follows from that of the output.
    pub fn transposed(&self) -> Self {
        // More zeros than the kernel is wide change nothing.
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

    /// Pixels of an image of the output.
    pub fn area(&self) -> usize {
        self.output[0] * self.output[1]
    }

    /// Pixels of all images that are read.
    pub fn input_area(&self) -> usize {
        self.images * self.input[0] * self.input[1]
    }

    /// Rows from one image to the next as they are read, zeros included: no window of one reaches another.
    fn period(&self) -> usize {
        let last_row = |side: usize, step: usize| side.saturating_sub(1) * step;
        let read = (last_row(self.output[0], self.stride) + self.kernel).saturating_sub(self.padding);
        let least = read.max(last_row(self.input[0], self.spread) + 1 + self.padding).max(self.output[0] * self.stride);
        least.next_multiple_of(self.stride)
    }

    /// Output rows of the tall image.
    pub fn rows(&self) -> usize {
        (self.images - 1) * (self.period() / self.stride) + self.output[0]
    }

    /// Whether an output row of the tall image is one of an image.
    pub fn is_row(&self, row: usize) -> bool {
        row % (self.period() / self.stride) < self.output[0]
    }

    /// How many output rows before this one are such.
    pub fn rows_before(&self, row: usize) -> usize {
        let period = self.period() / self.stride;
        row / period * self.output[0] + (row % period).min(self.output[0])
    }

    /// Rows or columns of a band beyond those of the output.
    fn extra(&self) -> usize {
        (self.kernel - 1) / self.stride
    }

    /// Width of a band's rows.
    pub fn pitch(&self) -> usize {
        self.output[1] + self.extra()
    }

    /// Remainders of places divided by the stride that are read.
    fn phases(&self) -> usize {
        self.stride.min(self.kernel)
    }

    /// Whether every row and column of the tall output means something.
    pub fn is_dense(&self) -> bool {
        self.pitch() == self.output[1] && self.rows() == self.rows_before(self.rows())
    }

    /// Output rows of a band of so many channels.
    pub fn band_rows(&self, channels: usize) -> usize {
        let columns = (BAND / (channels * self.phases().pow(2)).max(1)).clamp(4 * LANES, BAND_COLUMNS);
        let all = self.rows().max(1);
        let rows = (columns / self.pitch()).clamp(1, all);
        // Bands of the same size, as far as possible.
        all.div_ceil(all.div_ceil(rows))
    }

    /// Numbers of one channel in a band.
    pub fn plane(&self, rows: usize) -> usize {
        self.phases().pow(2) * (rows + self.extra()) * self.pitch()
    }

    /// Where a band of `rows` output rows holds what each weight is multiplied by: `[channels, kernel, kernel]`.
    pub fn offsets(&self, channels: usize, rows: usize) -> Vec<usize> {
        let (pitch, phases, stride) = (self.pitch(), self.phases(), self.stride);
        let phase_size = (rows + self.extra()) * pitch;
        let place = |channel: usize, ky: usize, kx: usize| {
            let phase = (ky % stride) * phases + kx % stride;
            channel * self.plane(rows) + phase * phase_size + (ky / stride) * pitch + kx / stride
        };
        let side = self.kernel;
        let kernel = move |channel| (0..side).flat_map(move |ky| (0..side).map(move |kx| (channel, ky, kx)));
        (0..channels).flat_map(kernel).map(|(channel, ky, kx)| place(channel, ky, kx)).collect()
    }

    /// Fills `band` with what `rows` output rows from `first` read of the channels in `x`, where wanted
    /// activated.
    pub(super) fn read<T: Number, P: BandElement<T>>(
        &self,
        band: &mut Vec<P>,
        [first, rows]: [usize; 2],
        x: &[T],
        activation: Option<Affine<T>>,
    ) {
        let (plane, channels) = (self.plane(rows), (x.len() / self.input_area()).next_multiple_of(P::PADDED_TO));
        // Past the last plane nothing is read but by columns that mean nothing.
        let length = channels / P::CHANNELS * plane + self.extra() + LANES.max(BLOCK + STEP);
        if band.len() < length {
            *band = vec![P::default(); length];
        }
        Arch::new().dispatch(FillBand { window: self, band, first, channels, plane, x, activation });
    }
}

/// What a band of numbers `T` is made of.
pub(super) trait BandElement<T>: Copy + Default {
    /// Channels of a plane.
    const CHANNELS: usize;

    /// Planes hold a multiple of so many channels, zeros where they lack.
    const PADDED_TO: usize;

    /// With this number of the plane's channel `index`, after those of the channels before it.
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

/// As bf16.
impl BandElement<f32> for u16 {
    const CHANNELS: usize = 1;
    const PADDED_TO: usize = BLOCK;

    #[inline(always)]
    fn with(self, _: usize, value: f32) -> Self {
        bf16(value)
    }
}

/// Two channels' numbers as bf16.
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
            let put = |out: &mut P, value: T| *out = out.with(index, value);
            match (channels.next(), self.activation) {
                (None, _) => plane.iter_mut().for_each(|out| put(out, T::default())),
                (Some(x), None) => read_plane(self.window, plane, self.first, x, put, |x| x),
                (Some(x), Some(affine)) => {
                    let affine = affine.channel(channel);
                    read_plane(self.window, plane, self.first, x, put, |x| affine.rectified(x));
                }
            }
        }
    }
}

/// One channel of a band that begins with output row `first`: `put` where it belongs, the `value` of what is there or zero.
#[inline(always)]
fn read_plane<T: Number, P>(
    window: &Window,
    plane: &mut [P],
    first: usize,
    x: &[T],
    put: impl Fn(&mut P, T),
    value: impl Fn(T) -> T,
) {
    let Window { input: [height, width], stride, padding, spread, .. } = *window;
    let clear = |row: &mut [P]| row.iter_mut().for_each(|out| put(out, T::default()));
    let (phases, pitch) = (window.phases(), window.pitch());
    let period = window.period();
    if pitch == width && stride == 1 && spread == 1 && period == height {
        // Nothing between the rows.
        plane.iter_mut().zip(&x[first * width..]).for_each(|(out, &x)| put(out, value(x)));
        return;
    }
    let rows = plane.len() / (phases * phases * pitch);
    for (index, row) in plane.chunks_exact_mut(pitch).enumerate() {
        let (phase, row_index) = (index / rows, index % rows);
        // The image's row.
        let y = (first + row_index) * stride + phase / phases;
        let place = y.checked_sub(padding).map(|y| (y / period, y % period));
        let is_pixel = |&(image, y): &(usize, usize)| image < window.images && y % spread == 0 && y / spread < height;
        let Some((image, y)) = place.filter(is_pixel) else {
            clear(row);
            continue;
        };
        let x = &x[(image * height + y / spread) * width..][..width];
        if stride == 1 && spread == 1 {
            let (left, rest) = row.split_at_mut(padding.min(pitch));
            let (middle, right) = rest.split_at_mut(width.min(rest.len()));
            clear(left);
            middle.iter_mut().zip(x).for_each(|(out, &x)| put(out, value(x)));
            clear(right);
        } else if spread > 1 {
            clear(row);
            let row = &mut row[padding.min(pitch)..];
            if spread == 2 {
                // Pairs, of which vectors can be made.
                let (pairs, last) = row.as_chunks_mut::<2>();
                let firsts = pairs.iter_mut().map(|pair| &mut pair[0]).chain(last);
                firsts.zip(x).for_each(|(out, &x)| put(out, value(x)));
            } else {
                row.iter_mut().step_by(spread).zip(x).for_each(|(out, &x)| put(out, value(x)));
            }
        } else {
            // The first column of the row that is in the image, and where it is there.
            let column = phase % phases;
            let first = padding.saturating_sub(column).div_ceil(stride).min(pitch);
            let x = x.get((first * stride + column).saturating_sub(padding)..).unwrap_or_default();
            let (left, rest) = row.split_at_mut(first);
            let (middle, right) = rest.split_at_mut(x.len().div_ceil(stride).min(rest.len()));
            clear(left);
            if stride == 2 {
                let (pairs, last) = x.as_chunks::<2>();
                let firsts = pairs.iter().map(|pair| &pair[0]).chain(last);
                middle.iter_mut().zip(firsts).for_each(|(out, &x)| put(out, value(x)));
            } else {
                middle.iter_mut().zip(x.iter().step_by(stride)).for_each(|(out, &x)| put(out, value(x)));
            }
            clear(right);
        }
    }
}
