//! Depthwise convolution: each channel has its own weights.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::conv::activation::{Affine, ChannelAffine, Rectifier, activation_backward};
use crate::conv::window::Window;
use crate::cpu_ops::{Kernel, Number, zeros};
use crate::gemm::{LANES, MAX_COLUMN, Rows};

/// Convolves `x[channels, images · height · width]`, each channel by its row of `weights[channels, kernel²]`. Returns
/// `[channels, images · height · width]` of the output.
#[derive(Clone, Copy, Debug)]
pub struct DepthwiseKernel {
    /// Geometry of the convolution.
    pub window: Window,
    /// With a rectifier, a third input `[3, channels]` holds scale, centre and shift. The convolved values are then
    /// scale · (x − centre) + shift, rectified; they are never stored.
    pub rectifier: Option<Rectifier>,
}

impl DepthwiseKernel {
    fn activation<'a, T: Number>(&self, inputs: &[&'a [T]]) -> Option<Affine<'a, T>> {
        self.rectifier.map(|rectifier| Affine::new(inputs[2], rectifier))
    }
}

impl Kernel for DepthwiseKernel {
    fn output_size(&self, sizes: &[[usize; 2]]) -> [usize; 2] {
        let [channels, area] = sizes[0];
        assert_eq!(area, self.window.input_area(), "the images have the window's size");
        assert_eq!(sizes[1], [channels, self.window.kernel.pow(2)], "weights for each channel");
        let affine = self.rectifier.map(|_| [3, channels]);
        assert_eq!(sizes.get(2), affine.as_ref(), "a scale, a centre and a shift for each channel, or none");
        [channels, self.window.images * self.window.area()]
    }

    fn forward<T: Number>(&self, inputs: &[&[T]], sizes: &[[usize; 2]]) -> Vec<T> {
        self.output_size(sizes);
        convolve(&self.window, inputs[0], self.activation(inputs), inputs[1])
    }

    fn backward<T: Number>(&self, inputs: &[&[T]], _: &[[usize; 2]], gradient: &[T], wanted: &[bool]) -> Vec<Vec<T>> {
        let activation = self.activation(inputs);
        let mut derivatives = vec![Vec::new(); inputs.len()];
        if wanted[0] || (activation.is_some() && wanted[2]) {
            derivatives[0] = input_gradient(&self.window, gradient, inputs[1]);
            if let Some(activation) = activation {
                derivatives[2] = activation_backward(&mut derivatives[0], inputs[0], activation, true);
            }
        }
        if wanted[1] {
            derivatives[1] = weight_gradient(&self.window, inputs[0], activation, gradient);
        }
        derivatives
    }
}

/// An image in the kernel's layout: the pixels of every `step`-th row and column form a plane.
///
/// In this layout, the pixels that one weight multiplies are contiguous. Planes are padded with zeros. Values in
/// columns past the output's width are unused.
struct Planes {
    /// Height and width of the image.
    image: [usize; 2],
    step: usize,
    /// Zero rows and columns before each plane.
    margin: usize,
    rows: usize,
    pitch: usize,
}

/// Plane and shift that a row or column of weights multiplies.
#[derive(Clone, Copy)]
struct Tap {
    /// Index of the row or column in the weights.
    index: usize,
    plane: usize,
    shift: isize,
}

/// Columns of weights with their offsets in the planes.
struct WeightColumns {
    /// Weights in each column.
    count: usize,
    /// Indices of the weights, column by column; `None` where a column is shorter.
    indices: Vec<Option<usize>>,
    /// Offset of each column in the planes.
    offsets: Vec<usize>,
}

impl WeightColumns {
    /// Arranges the weights of the rows `down` and columns `across` of `side × side`.
    fn new(planes: &Planes, side: usize, down: &[Tap], across: &[Tap]) -> Self {
        // A column's weights that share a plane multiply consecutive rows of it.
        let rows: Vec<Vec<Tap>> = (0..planes.step)
            .map(|plane| {
                let mut rows: Vec<Tap> = down.iter().copied().filter(|tap| tap.plane == plane).collect();
                rows.sort_by_key(|tap| tap.shift);
                rows
            })
            .collect();
        let count = rows.iter().map(Vec::len).max().unwrap_or(0).clamp(1, MAX_COLUMN);
        let column_taps =
            || across.iter().flat_map(|across| rows.iter().flat_map(|r| r.chunks(count)).map(move |r| (r, across)));
        let index = |row: Option<&Tap>, across: &Tap| row.map(|row| row.index * side + across.index);
        Self {
            count,
            indices: column_taps().flat_map(|(r, across)| (0..count).map(move |i| index(r.get(i), across))).collect(),
            offsets: column_taps().map(|(r, across)| planes.offset(r[0], *across)).collect(),
        }
    }

    /// Reorders a channel's weights by column.
    fn order<T: Number>(&self, weights: &[T]) -> Vec<T> {
        self.indices.iter().map(|index| index.map_or(T::default(), |index| weights[index])).collect()
    }

    /// Computes output rows from weights in column order.
    fn filter<T: Number>(&self, planes: &Planes, weights: &[T], data: &[T], rows: Rows<T>) {
        T::filter(weights, self.count, data, &self.offsets, planes.pitch, rows);
    }
}

impl Planes {
    /// Lays out planes in which every pixel of `output` (height and width) can be shifted by each of the `taps`.
    fn new(image: [usize; 2], step: usize, output: [usize; 2], taps: &[Tap]) -> Self {
        let shifts = || taps.iter().map(|tap| tap.shift);
        let margin = (-shifts().min().unwrap_or(0)).max(0) as usize;
        let after = shifts().max().unwrap_or(0).max(0) as usize;
        let side = |i: usize| margin + image[i].div_ceil(step).max(output[i] + after);
        Self { image, step, margin, rows: side(0), pitch: side(1) }
    }

    /// Allocates all planes, with zeros behind them for vectors that read past the end.
    fn scratch<T: Number>(&self) -> Vec<T> {
        vec![T::default(); (self.step.pow(2) * self.rows + MAX_COLUMN) * self.pitch + LANES]
    }

    /// Returns the offset of the value that the weight of two taps multiplies for the output's first pixel.
    fn offset(&self, down: Tap, across: Tap) -> usize {
        let plane = down.plane * self.step + across.plane;
        let place = |tap: Tap| self.margin.wrapping_add_signed(tap.shift);
        (plane * self.rows + place(down)) * self.pitch + place(across)
    }

    /// Fills the planes with an image, optionally activated. Margins must already be zero.
    fn fill<T: Number>(&self, planes: &mut [T], x: &[T], activation: Option<ChannelAffine<T>>) {
        Arch::new().dispatch(FillPlanes { planes: self, out: planes, x, activation });
    }
}

/// [`Planes::fill`].
struct FillPlanes<'a, T> {
    planes: &'a Planes,
    out: &'a mut [T],
    x: &'a [T],
    activation: Option<ChannelAffine<T>>,
}

impl<T: Number> WithSimd for FillPlanes<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { planes, out, x, activation } = self;
        match activation {
            None => fill(planes, out, x, |x| x),
            Some(affine) => fill(planes, out, x, |x| affine.rectified(x)),
        }
    }
}

#[inline(always)]
fn fill<T: Number>(planes: &Planes, out: &mut [T], x: &[T], value: impl Fn(T) -> T) {
    let Planes { image: [_, width], step, margin, rows, pitch } = *planes;
    for (y, x) in x.chunks_exact(width).enumerate() {
        let (phase, row) = if step == 1 { (0, y) } else { (y % step, y / step) };
        // Planes with the same row phase are contiguous.
        let place = |column: usize| ((phase * step + column) * rows + margin + row) * pitch + margin;
        match step {
            1 => out[place(0)..].iter_mut().zip(x).for_each(|(out, &x)| *out = value(x)),
            2 => {
                let (pairs, last) = x.as_chunks::<2>();
                let (evens, odds) = out.split_at_mut(place(1));
                let (evens, odds) = (&mut evens[place(0)..], &mut odds[..pairs.len()]);
                for ((even, odd), pair) in evens.iter_mut().zip(odds).zip(pairs) {
                    (*even, *odd) = (value(pair[0]), value(pair[1]));
                }
                evens[pairs.len()..].iter_mut().zip(last).for_each(|(out, &x)| *out = value(x));
            }
            _ => {
                for column in 0..step.min(width) {
                    let x = x[column..].iter().step_by(step);
                    out[place(column)..].iter_mut().zip(x).for_each(|(out, &x)| *out = value(x));
                }
            }
        }
    }
}

/// Returns the tap of each row or column of weights.
fn taps(window: &Window) -> Vec<Tap> {
    let step = window.stride as isize;
    let place = |k: usize| k as isize - window.padding as isize;
    (0..window.kernel)
        .map(|k| Tap { index: k, plane: place(k).rem_euclid(step) as usize, shift: place(k).div_euclid(step) })
        .collect()
}

fn convolve<T: Number>(window: &Window, x: &[T], activation: Option<Affine<T>>, weights: &[T]) -> Vec<T> {
    let taps = taps(window);
    let planes = Planes::new(window.input, window.stride, window.output, &taps);
    let columns = WeightColumns::new(&planes, window.kernel, &taps, &taps);
    let area = window.area();
    let mut out = zeros(x.len() / window.input_area() * window.images * area);
    let channels = out.par_chunks_mut(window.images * area).zip(x.par_chunks(window.input_area()));
    let channels = channels.zip(weights.par_chunks(window.kernel.pow(2))).enumerate();
    channels.for_each_init(
        || planes.scratch(),
        |scratch, (channel, ((out, x), weights))| {
            let (activation, weights) = (activation.map(|affine| affine.channel(channel)), columns.order(weights));
            let images = out.chunks_exact_mut(area).zip(x.chunks_exact(window.input[0] * window.input[1]));
            for (out, x) in images {
                planes.fill(scratch, x, activation);
                columns.filter(&planes, &weights, scratch, Rows { out, width: window.output[1] });
            }
        },
    );
    out
}

/// Returns the gradient of the convolved values. For each phase of rows and columns, this is a convolution of the
/// output's gradient with some of the weights.
fn input_gradient<T: Number>(window: &Window, gradient: &[T], weights: &[T]) -> Vec<T> {
    let Window { input: [height, width], output, stride, padding, kernel, images, .. } = *window;
    // For each phase of rows or columns, the weights that contribute and their shifts.
    let phases: Vec<Vec<Tap>> = (0..stride)
        .map(|phase| {
            let reach = |k: usize| (phase + padding) as isize - k as isize;
            let reaching = (0..kernel).filter(|&k| reach(k).rem_euclid(stride as isize) == 0);
            reaching.map(|k| Tap { index: k, plane: 0, shift: reach(k).div_euclid(stride as isize) }).collect()
        })
        .collect();
    let parts = [height, width].map(|side| side.div_ceil(stride));
    let planes = Planes::new(output, 1, parts, &phases.concat());
    // One for each phase of rows and columns.
    let columns: Vec<WeightColumns> = (0..stride * stride)
        .map(|index| WeightColumns::new(&planes, kernel, &phases[index / stride], &phases[index % stride]))
        .collect();
    let (area, part) = (window.area(), parts[0] * parts[1]);
    let mut out = zeros(gradient.len() / (images * area) * window.input_area());
    let channels = out.par_chunks_mut(window.input_area()).zip(gradient.par_chunks(images * area));
    let channels = channels.zip(weights.par_chunks(kernel * kernel));
    let scratch = || (planes.scratch(), vec![T::default(); stride * stride * part]);
    channels.for_each_init(scratch, |(scratch, sums), ((out, gradient), weights)| {
        let weights: Vec<Vec<T>> = columns.iter().map(|columns| columns.order(weights)).collect();
        for (out, gradient) in out.chunks_exact_mut(height * width).zip(gradient.chunks_exact(area)) {
            planes.fill(scratch, gradient, None);
            if stride == 1 {
                columns[0].filter(&planes, &weights[0], scratch, Rows { out, width });
                continue;
            }
            for ((columns, weights), sums) in columns.iter().zip(&weights).zip(sums.chunks_exact_mut(part)) {
                columns.filter(&planes, weights, scratch, Rows { out: sums, width: parts[1] });
            }
            for (y, out) in out.chunks_exact_mut(width).enumerate() {
                let place = |column: usize| (y % stride * stride + column) * part + y / stride * parts[1];
                let sums = |column: usize| &sums[place(column)..][..parts[1]];
                if stride == 2 {
                    // Pairs are vectorisable.
                    let (pairs, last) = out.as_chunks_mut::<2>();
                    let (evens, odds) = (sums(0), sums(1));
                    last.iter_mut().for_each(|last| *last = evens[pairs.len()]);
                    for (pair, (&even, &odd)) in pairs.iter_mut().zip(evens.iter().zip(odds)) {
                        *pair = [even, odd];
                    }
                } else {
                    for column in 0..stride.min(width) {
                        let out = out[column..].iter_mut().step_by(stride);
                        out.zip(sums(column)).for_each(|(out, &sum)| *out = sum);
                    }
                }
            }
        }
    });
    out
}

/// Returns the gradient of the weights, `[channels, kernel²]`.
fn weight_gradient<T: Number>(window: &Window, x: &[T], activation: Option<Affine<T>>, gradient: &[T]) -> Vec<T> {
    let taps = taps(window);
    let planes = Planes::new(window.input, window.stride, window.output, &taps);
    let offsets: Vec<usize> = taps
        .iter()
        .flat_map(|&down| taps.iter().map(move |&across| (down, across)))
        .map(|(down, across)| planes.offset(down, across))
        .collect();
    let ([height, width], area) = (window.output, window.area());
    let mut out = zeros(x.len() / window.input_area() * offsets.len());
    let channels = out.par_chunks_mut(offsets.len()).zip(x.par_chunks(window.input_area()));
    let channels = channels.zip(gradient.par_chunks(window.images * area)).enumerate();
    // The gradient with rows as wide as the planes', zeros in unused columns.
    let scratch = || (planes.scratch(), vec![T::default(); height * planes.pitch]);
    channels.for_each_init(scratch, |(scratch, padded), (channel, ((out, x), gradient))| {
        let activation = activation.map(|affine| affine.channel(channel));
        let images = x.chunks_exact(window.input[0] * window.input[1]).zip(gradient.chunks_exact(area));
        for (x, gradient) in images {
            planes.fill(scratch, x, activation);
            for (out, gradient) in padded.chunks_exact_mut(planes.pitch).zip(gradient.chunks_exact(width)) {
                out[..width].copy_from_slice(gradient);
            }
            T::inner(&[padded], scratch, &offsets, out);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use burn::tensor::Tensor;
    use burn::tensor::module;
    use burn::tensor::ops::{ConvOptions, PadMode};

    use super::*;
    use crate::conv::activation;
    use crate::cpu_ops::{binary, ternary};
    use crate::testing::{assert_gradients, assert_same_function};

    /// Channels; images, height and width; kernel, stride, padding before and after.
    type ConvCase = (usize, [usize; 3], [usize; 4]);

    const CONV_CASES: [ConvCase; 9] = [
        (5, [1, 6, 7], [3, 1, 1, 1]),
        (3, [2, 9, 4], [5, 1, 2, 2]),
        (4, [1, 8, 10], [3, 2, 0, 1]),
        (4, [2, 8, 6], [5, 2, 1, 2]),
        (2, [3, 7, 9], [3, 2, 1, 1]),
        (2, [1, 5, 4], [1, 1, 0, 0]),
        (2, [2, 7, 8], [3, 3, 1, 1]),
        (3, [1, 1, 1], [5, 2, 2, 2]),
        (2, [2, 130, 150], [5, 1, 2, 2]),
    ];

    fn kernel(
        (_, [images, height, width], [side, stride, before, after]): ConvCase,
        activated: bool,
    ) -> DepthwiseKernel {
        let window = Window { images, ..Window::new([height, width], side, stride, [before, after]) };
        DepthwiseKernel { window, rectifier: activated.then_some(Rectifier::Relu6) }
    }

    fn sizes((channels, [images, height, width], [side, ..]): ConvCase) -> [[usize; 2]; 3] {
        [[channels, images * height * width], [channels, side * side], [3, channels]]
    }

    fn run(case: ConvCase, [x, weights]: [Tensor<2>; 2], affine: Option<Tensor<2>>) -> Tensor<2> {
        // Scales so that some activated values exceed 6.
        match affine {
            Some(affine) => ternary(x, weights, 4.0 * affine, kernel(case, true)),
            None => binary(x, weights, kernel(case, false)),
        }
    }

    /// Reference implementation with burn's operations.
    fn composed(case: ConvCase, [x, weights]: [Tensor<2>; 2], affine: Option<Tensor<2>>) -> Tensor<2> {
        let (channels, [images, height, width], [side, stride, before, after]) = case;
        let mut x = x.reshape([channels, images, height, width]);
        if let Some(affine) = affine {
            x = activation::composed(x, 4.0 * affine, activation::Epilogue::Rectify(Rectifier::Relu6));
        }
        let x = x.swap_dims(0, 1).pad((before, after, before, after), PadMode::Constant(0.0));
        let options = ConvOptions::new([stride; 2], [0; 2], [1; 2], channels);
        let y = module::conv2d(x, weights.reshape([channels, 1, side, side]), None, options);
        y.swap_dims(0, 1).reshape([channels as i32, -1])
    }

    #[test]
    fn kernel_equals_reference() {
        for case in CONV_CASES {
            let [x, weights, affine] = sizes(case);
            assert_same_function(&[x, weights], |i| run(case, i, None), |i| composed(case, i, None));
            assert_same_function(
                &[x, weights, affine],
                |[x, w, a]| run(case, [x, w], Some(a)),
                |[x, w, a]| composed(case, [x, w], Some(a)),
            );
        }
    }

    #[test]
    fn gradients_equal_finite_differences() {
        for case in &CONV_CASES[..8] {
            let [x, weights, affine] = sizes(*case);
            assert_gradients(&[x, weights], |i| run(*case, i, None));
            assert_gradients(&[x, weights, affine], |[x, w, a]| run(*case, [x, w], Some(a)));
        }
    }

    #[test]
    fn results_do_not_depend_on_thread_count() {
        let case = CONV_CASES[8];
        let sizes = sizes(case);
        let values = |i: usize| -> Vec<f32> {
            crate::testing::values(sizes[i][0] * sizes[i][1], i).iter().map(|&v| v as f32).collect()
        };
        let inputs = [values(0), values(1), values(2)];
        let inputs: Vec<&[f32]> = inputs.iter().map(Vec::as_slice).collect();
        let kernel = kernel(case, true);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| {
                let output = kernel.forward(&inputs, &sizes);
                (kernel.backward(&inputs, &sizes, &output, &[true; 3]), output)
            })
        };
        assert!(on(1) == on(3));
    }
}
