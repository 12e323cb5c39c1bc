//! Shape inference: sizes of an operator's outputs from the sizes and, where needed, the values of its inputs.
//!
//! The public crate `rten-shape-inference` 0.27 is not used: it has no mapping from ONNX nodes to its operators, holds
//! values in unchecked 32-bit integers (no fractional scales of `Resize`) and reports errors without sizes.

use crate::facts::{Fact, Inputs};
use crate::onnx::{MAX_RANK, Node, product};

type Shapes = Result<Vec<Vec<usize>>, String>;

/// Sizes of a node's outputs; for `NonZero`, an upper bound.
///
/// # Errors
/// An operator that is not supported, sizes that do not match, values that are not known before the run.
pub(crate) fn shapes(node: &Node, inputs: &[Option<&Fact>], opset: i64) -> Shapes {
    let x = Inputs { node, inputs, opset };
    let one = |dims: Vec<usize>| Ok(vec![dims]);
    match (node.domain.as_str(), node.op.as_str()) {
        (
            "",
            "Abs"
            | "Acos"
            | "Acosh"
            | "Asin"
            | "Asinh"
            | "Atan"
            | "Atanh"
            | "BatchNormalization"
            | "BitCast"
            | "Cast"
            | "CastLike"
            | "Ceil"
            | "Clip"
            | "Cos"
            | "Cosh"
            | "CumSum"
            | "DequantizeLinear"
            | "Dropout"
            | "Elu"
            | "Erf"
            | "Exp"
            | "EyeLike"
            | "Floor"
            | "Gelu"
            | "HardSigmoid"
            | "HardSwish"
            | "Identity"
            | "InstanceNormalization"
            | "IsInf"
            | "IsNaN"
            | "LeakyRelu"
            | "Log"
            | "LogSoftmax"
            | "LpNormalization"
            | "Neg"
            | "Not"
            | "QuantizeLinear"
            | "RMSNormalization"
            | "Reciprocal"
            | "Relu"
            | "RotaryEmbedding"
            | "Round"
            | "Scatter"
            | "ScatterElements"
            | "ScatterND"
            | "Sigmoid"
            | "Sign"
            | "Sin"
            | "Softmax"
            | "Softplus"
            | "Softsign"
            | "Sqrt"
            | "Swish"
            | "Tan"
            | "Tanh"
            | "Trilu",
        )
        | ("com.microsoft", "BiasGelu" | "FastGelu" | "Gelu" | "QuickGelu" | "RotaryEmbedding") => {
            one(x.dims(0)?.to_vec())
        }
        ("com.microsoft", "SkipLayerNormalization" | "SkipSimplifiedLayerNormalization")
        | ("ai.onnx", "SimplifiedLayerNormalization")
        | ("", "SimplifiedLayerNormalization" | "LayerNormalization") => {
            Ok(vec![x.dims(0)?.to_vec(); node.outputs.len()])
        }
        ("", "DynamicQuantizeLinear") => Ok(vec![x.dims(0)?.to_vec(), Vec::new(), Vec::new()]),
        (
            "",
            "Add" | "And" | "Div" | "Equal" | "Greater" | "GreaterOrEqual" | "Less" | "LessOrEqual" | "Max" | "Mean"
            | "Min" | "Mod" | "Mul" | "Or" | "PRelu" | "Pow" | "Sub" | "Sum" | "Where" | "Xor",
        ) => {
            let all: Result<Vec<&[usize]>, String> = (0..inputs.len()).map(|index| x.dims(index)).collect();
            one(all?.into_iter().try_fold(Vec::new(), |sum, dims| broadcast(&sum, dims))?)
        }
        ("", "MatMul" | "MatMulInteger") => one(matmul(x.dims(0)?, x.dims(1)?)?),
        ("com.microsoft", "MatMulNBits") => {
            let mut dims = x.dims(0)?.to_vec();
            *dims.last_mut().ok_or("the input is a scalar")? = x.size(node.int("N"), "N")?;
            one(dims)
        }
        ("com.microsoft", "MultiHeadAttention") => {
            let mut dims = x.dims(0)?.to_vec();
            if let (3, [.., width]) = (dims.len(), x.dims(2)?) {
                dims[2] = *width;
            }
            Ok(vec![dims; node.outputs.len()])
        }
        ("", "Attention") => {
            let mut dims = x.dims(0)?.to_vec();
            if let (4, [.., width]) = (dims.len(), x.dims(2)?) {
                dims[3] = *width;
            }
            one(dims)
        }
        ("", "Gemm") => {
            let side = |index: usize, turned: &str| match (x.dims(index)?, node.int(turned).unwrap_or(0) != 0) {
                (&[rows, columns], false) | (&[columns, rows], true) => Ok((rows, columns)),
                (dims, _) => Err(format!("the input has the shape {dims:?}, expected a matrix")),
            };
            let ((rows, inner), (other, columns)) = (side(0, "transA")?, side(1, "transB")?);
            fits(inner == other, || {
                format!("a matrix with {inner} columns cannot be multiplied by one with {other} rows")
            })?;
            one(vec![rows, columns])
        }
        ("", "Einsum") => one(einsum(&x)?),
        ("", "Conv" | "ConvInteger") => one(conv(&x)?),
        ("", "ConvTranspose") => one(conv_transpose(&x)?),
        ("", "AveragePool" | "MaxPool") => Ok(vec![pool(&x)?; node.outputs.len()]),
        ("", "GlobalAveragePool" | "GlobalMaxPool") => {
            let mut dims = x.dims(0)?.to_vec();
            dims.iter_mut().skip(2).for_each(|dim| *dim = 1);
            one(dims)
        }
        ("", "Concat") => concat(&x).map(|dims| vec![dims]),
        ("", "Split") => split(&x),
        ("", "Slice") => one(slice(&x)?),
        ("", "Gather") => {
            let (data, at) = (x.dims(0)?, x.dims(1)?);
            let axis = x.axis(node.int("axis").unwrap_or(0), data.len())?;
            one([&data[..axis], at, &data[axis + 1..]].concat())
        }
        ("", "GatherElements") => one(x.dims(1)?.to_vec()),
        ("", "GridSample") => {
            let (data, grid) = (x.dims(0)?, x.dims(1)?);
            fits(data.len() >= 3 && grid.len() == data.len(), || {
                format!("the shapes {data:?} of the image and {grid:?} of the grid do not match")
            })?;
            one([&data[..2], &grid[1..grid.len() - 1]].concat())
        }
        ("", "GatherND") => {
            let (data, at) = (x.dims(0)?, x.dims(1)?);
            let batch = x.size(Some(node.int("batch_dims").unwrap_or(0)), "batch_dims")?;
            let last = at.last().copied().unwrap_or(0);
            fits(batch + last <= data.len() && !at.is_empty(), || {
                format!("the shapes {data:?} of the data and {at:?} of the indices do not match")
            })?;
            one([&at[..at.len() - 1], &data[batch + last..]].concat())
        }
        ("", "Pad") => one(pad(&x)?),
        ("", "Expand") => one(broadcast(x.dims(0)?, &x.size_list(1)?)?),
        ("", "Tile") => {
            let (data, repeats) = (x.dims(0)?, x.size_list(1)?);
            fits(data.len() == repeats.len(), || {
                format!("the shape {data:?} and the repeats {repeats:?} do not match")
            })?;
            one(data.iter().zip(&repeats).map(|(&a, &b)| times(a, b)).collect::<Result<_, _>>()?)
        }
        ("", "Reshape") => one(reshape(&x)?),
        ("", "Flatten") => {
            let dims = x.dims(0)?;
            let axis = x.edge(node.int("axis").unwrap_or(1), dims.len())?;
            let count = |dims: &[usize]| product(dims).ok_or("a size is too large");
            one(vec![count(&dims[..axis])?, count(&dims[axis..])?])
        }
        ("", "Squeeze") => {
            let dims = x.dims(0)?;
            let axes = match x.axes(1)? {
                None => (0..dims.len()).filter(|&axis| dims[axis] == 1).collect(),
                Some(axes) => axes.iter().map(|&axis| x.axis(axis, dims.len())).collect::<Result<Vec<_>, _>>()?,
            };
            fits(axes.iter().all(|&axis| dims[axis] == 1), || {
                format!("axes {axes:?} of the shape {dims:?} are not all 1")
            })?;
            one((0..dims.len()).filter(|axis| !axes.contains(axis)).map(|axis| dims[axis]).collect())
        }
        ("", "Unsqueeze") => {
            let dims = x.dims(0)?;
            let axes = x.axes(1)?.ok_or("the axes are missing")?;
            let rank = dims.len() + axes.len();
            fits(rank <= MAX_RANK, || format!("the output has {rank} axes, the limit is {MAX_RANK}"))?;
            let axes = axes.iter().map(|&axis| x.axis(axis, rank)).collect::<Result<Vec<_>, _>>()?;
            let mut rest = dims.iter().copied();
            let dims: Vec<usize> =
                (0..rank).map(|axis| if axes.contains(&axis) { 1 } else { rest.next().unwrap_or(1) }).collect();
            one(dims)
        }
        ("", "Transpose") => {
            let dims = x.dims(0)?;
            let Some(perm) = node.ints("perm") else { return one(dims.iter().rev().copied().collect()) };
            let perm = perm.iter().map(|&axis| x.axis(axis, dims.len())).collect::<Result<Vec<_>, _>>()?;
            let mut sorted = perm.clone();
            sorted.sort_unstable();
            fits(sorted.iter().copied().eq(0..dims.len()), || {
                format!("{perm:?} is not a permutation of the axes of {dims:?}")
            })?;
            one(perm.iter().map(|&axis| dims[axis]).collect())
        }
        ("", "DepthToSpace") => {
            let block = x.size(node.int("blocksize"), "blocksize")?;
            match x.dims(0)? {
                &[n, c, h, w] if block > 0 && c % times(block, block)? == 0 => {
                    one(vec![n, c / (block * block), times(h, block)?, times(w, block)?])
                }
                dims => Err(format!("the shape {dims:?} does not hold blocks of {block}")),
            }
        }
        ("", "Shape") => {
            let rank = x.dims(0)?.len();
            let (start, end) = shape_range(node, rank);
            one(vec![end.saturating_sub(start)])
        }
        ("", "Size") => one(Vec::new()),
        ("", "ConstantOfShape") => one(x.size_list(0)?),
        ("", "Range") => {
            let number = |index: usize| Ok::<f64, String>(*x.numbers(index)?.first().ok_or("an input is empty")?);
            let count = ((number(1)? - number(0)?) / number(2)?).ceil().max(0.0);
            fits(count.is_finite() && count < 1e9, || "the range is too long or infinite".to_owned())?;
            one(vec![count as usize])
        }
        ("", "OneHot") => {
            let (dims, depth) = (x.dims(0)?, *x.size_list(1)?.first().ok_or("the depth is missing")?);
            let axis = x.axis(node.int("axis").unwrap_or(-1), dims.len() + 1)?;
            one([&dims[..axis], &[depth], &dims[axis..]].concat())
        }
        ("", "NonZero") => {
            let dims = x.dims(0)?;
            one(vec![dims.len(), product(dims).ok_or("a size is too large")?])
        }
        ("", "TopK") => {
            let mut dims = x.dims(0)?.to_vec();
            let axis = x.axis(node.int("axis").unwrap_or(-1), dims.len())?;
            dims[axis] = dims[axis].min(*x.size_list(1)?.first().ok_or("the count is missing")?);
            Ok(vec![dims; 2])
        }
        ("", "ArgMax" | "ArgMin") => one(reduced(&x, Some(vec![node.int("axis").unwrap_or(0)]))?),
        (
            "",
            "ReduceL1" | "ReduceL2" | "ReduceLogSum" | "ReduceLogSumExp" | "ReduceMax" | "ReduceMean" | "ReduceMin"
            | "ReduceProd" | "ReduceSum" | "ReduceSumSquare",
        ) => one(reduced(&x, x.axes(1)?)?),
        ("", "Resize" | "Upsample") => crate::resize::output_dims(&x).map(|dims| vec![dims]),
        _ => Err("the operator is not supported".to_owned()),
    }
}

/// Range of axes that `Shape` returns: all, or from `start` to `end`.
pub(crate) fn shape_range(node: &Node, rank: usize) -> (usize, usize) {
    let rank = rank as i64;
    let at = |value: i64| (if value < 0 { value + rank } else { value }).clamp(0, rank) as usize;
    (at(node.int("start").unwrap_or(0)), at(node.int("end").unwrap_or(rank)))
}

fn fits(holds: bool, why: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(why()) }
}

fn times(a: usize, b: usize) -> Result<usize, String> {
    a.checked_mul(b).ok_or_else(|| "a size is too large".to_owned())
}

/// Shape of two shapes broadcast together, by NumPy's rules.
pub(crate) fn broadcast(a: &[usize], b: &[usize]) -> Result<Vec<usize>, String> {
    let rank = a.len().max(b.len());
    let at = |dims: &[usize], axis: usize| (axis + dims.len()).checked_sub(rank).map_or(1, |axis| dims[axis]);
    let pair = |axis: usize| match (at(a, axis), at(b, axis)) {
        (x, y) if x == y => Ok(x),
        (1, x) | (x, 1) => Ok(x),
        _ => Err(format!("the shapes {a:?} and {b:?} cannot be broadcast together")),
    };
    (0..rank).map(pair).collect()
}

fn matmul(a: &[usize], b: &[usize]) -> Result<Vec<usize>, String> {
    let misfit = || format!("the shapes {a:?} and {b:?} cannot be multiplied");
    let (&inner, &before) =
        (a.last().ok_or_else(misfit)?, b.get(b.len().wrapping_sub(2)).or(b.last()).ok_or_else(misfit)?);
    fits(inner == before, misfit)?;
    let batch = |dims: &[usize]| dims[..dims.len().saturating_sub(2)].to_vec();
    let mut dims = broadcast(&batch(a), &batch(b))?;
    dims.extend(a.len().checked_sub(2).map(|axis| a[axis]));
    dims.extend((b.len() > 1).then(|| b[b.len() - 1]));
    Ok(dims)
}

fn einsum(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let equation: String =
        x.node.text("equation").ok_or("the equation is missing")?.chars().filter(|c| !c.is_whitespace()).collect();
    let (left, right) = equation.split_once("->").ok_or("the equation has no output")?;
    let mut sizes: Vec<(char, usize)> = Vec::new();
    for (index, letters) in left.split(',').enumerate() {
        let dims = x.dims(index)?;
        fits(letters.chars().all(char::is_alphabetic), || format!("the equation {equation} is invalid"))?;
        fits(letters.chars().count() == dims.len(), || format!("the shape {dims:?} does not match {letters}"))?;
        sizes.extend(letters.chars().zip(dims.iter().copied()));
    }
    let size = |letter: char| sizes.iter().filter(|(known, _)| *known == letter).map(|(_, size)| *size).max();
    right.chars().map(|letter| size(letter).ok_or_else(|| format!("the equation {equation} is invalid"))).collect()
}

/// Attributes of sliding windows along the axes after the first two.
struct Windows {
    strides: Vec<usize>,
    dilations: Vec<usize>,
    /// Padding before each axis, then after each axis.
    pads: Vec<usize>,
    auto_pad: String,
}

impl Windows {
    fn of(x: &Inputs<'_>, axes: usize) -> Result<Self, String> {
        let list = |name: &str, count: usize, usual: usize| {
            let Some(values) = x.node.ints(name) else { return Ok(vec![usual; count]) };
            fits(values.len() == count, || format!("there are {} {name} for {axes} axes", values.len()))?;
            values.iter().map(|&value| x.size(Some(value), name)).collect::<Result<Vec<_>, _>>()
        };
        let (strides, dilations) = (list("strides", axes, 1)?, list("dilations", axes, 1)?);
        fits(strides.iter().chain(&dilations).all(|&step| step > 0), || "a stride or dilation is 0".to_owned())?;
        let auto_pad = x.node.text("auto_pad").unwrap_or("NOTSET").to_owned();
        Ok(Self { strides, dilations, pads: list("pads", 2 * axes, 0)?, auto_pad })
    }

    /// Number of positions of a window along an axis of `size`.
    fn positions(&self, axis: usize, size: usize, kernel: usize, ceil: bool) -> Result<usize, String> {
        let (stride, axes) = (self.strides[axis], self.strides.len());
        if self.auto_pad.starts_with("SAME") {
            return Ok(size.div_ceil(stride));
        }
        let reach = times(kernel.checked_sub(1).ok_or("the kernel is empty")?, self.dilations[axis])? + 1;
        let [start, end] = if self.auto_pad == "VALID" { [0; 2] } else { [self.pads[axis], self.pads[axis + axes]] };
        let padded = size.saturating_add(start).saturating_add(end);
        let count = match padded.checked_sub(reach) {
            Some(free) => (if ceil { free.div_ceil(stride) } else { free / stride }) + 1,
            // A single window that is cut off at the end.
            None if ceil && reach - padded < stride => 1,
            None => return Err(format!("the kernel is larger than the input of {size}")),
        };
        // No window lies entirely in the padding at the end (github.com/onnx/onnx/issues/5711).
        let is_outside = ceil && times(count - 1, stride)? >= size.saturating_add(start);
        Ok(count - usize::from(is_outside))
    }
}

fn conv(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let (data, kernel) = (x.dims(0)?, x.dims(1)?);
    let group = x.size(Some(x.node.int("group").unwrap_or(1)), "group")?;
    let right = data.len() == kernel.len() && data.len() > 2 && times(kernel[1], group)? == data[1];
    fits(right, || format!("the shapes {data:?} and {kernel:?} do not match in {group} groups"))?;
    let windows = Windows::of(x, data.len() - 2)?;
    let positions = (2..data.len()).map(|axis| windows.positions(axis - 2, data[axis], kernel[axis], false));
    [Ok(data[0]), Ok(kernel[0])].into_iter().chain(positions).collect()
}

fn conv_transpose(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let (data, kernel) = (x.dims(0)?, x.dims(1)?);
    let group = x.size(Some(x.node.int("group").unwrap_or(1)), "group")?;
    let right = data.len() == kernel.len() && data.len() > 2 && kernel[0] == data[1];
    fits(right, || format!("the shapes {data:?} and {kernel:?} do not match"))?;
    let axes = data.len() - 2;
    let windows = Windows::of(x, axes)?;
    let extra = x.node.ints("output_padding").unwrap_or_default();
    let asked = x.node.ints("output_shape").unwrap_or_default();
    let size = |axis: usize| {
        if let Some(&asked) = asked.get(axis) {
            return x.size(Some(asked), "output_shape");
        }
        let stride = windows.strides[axis];
        if windows.auto_pad.starts_with("SAME") {
            return times(data[axis + 2], stride);
        }
        let reach = times(kernel[axis + 2].checked_sub(1).ok_or("the kernel is empty")?, windows.dilations[axis])? + 1;
        let pads =
            if windows.auto_pad == "VALID" { 0 } else { windows.pads[axis].saturating_add(windows.pads[axis + axes]) };
        let extra = x.size(Some(extra.get(axis).copied().unwrap_or(0)), "output_padding")?;
        let whole = times(data[axis + 2].saturating_sub(1), stride)?.saturating_add(reach).saturating_add(extra);
        whole.checked_sub(pads).ok_or_else(|| "the padding is larger than the output".to_owned())
    };
    [Ok(data[0]), times(kernel[1], group)].into_iter().chain((0..axes).map(size)).collect()
}

fn pool(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let (data, kernel) = (x.dims(0)?, x.node.ints("kernel_shape").unwrap_or_default());
    fits(data.len() == kernel.len() + 2, || format!("the shape {data:?} and the kernel {kernel:?} do not match"))?;
    let windows = Windows::of(x, kernel.len())?;
    let ceil = x.node.int("ceil_mode").unwrap_or(0) != 0;
    let positions = kernel
        .iter()
        .enumerate()
        .map(|(axis, &kernel)| windows.positions(axis, data[axis + 2], x.size(Some(kernel), "kernel_shape")?, ceil));
    [Ok(data[0]), Ok(data[1])].into_iter().chain(positions).collect()
}

fn concat(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let mut dims = x.dims(0)?.to_vec();
    let axis = x.axis(x.node.int("axis").unwrap_or(0), dims.len())?;
    for index in 1..x.inputs.len() {
        let other = x.dims(index)?;
        let right = other.len() == dims.len() && (0..dims.len()).all(|at| at == axis || other[at] == dims[at]);
        fits(right, || format!("the shapes {dims:?} and {other:?} cannot be concatenated"))?;
        dims[axis] = dims[axis].checked_add(other[axis]).ok_or("a size is too large")?;
    }
    Ok(dims)
}

fn split(x: &Inputs<'_>) -> Shapes {
    let dims = x.dims(0)?;
    let axis = x.axis(x.node.int("axis").unwrap_or(0), dims.len())?;
    let count = x.node.outputs.len().max(1);
    let parts = match (x.node.ints("split"), x.get(1)) {
        (Some(parts), _) => parts.iter().map(|&part| x.size(Some(part), "split")).collect::<Result<Vec<_>, _>>()?,
        (None, Some(_)) => x.size_list(1)?,
        (None, None) => {
            let part = dims[axis].div_ceil(count);
            (0..count).map(|index| part.min(dims[axis].saturating_sub(index * part))).collect()
        }
    };
    let sum = parts.iter().try_fold(0usize, |sum, &part| sum.checked_add(part));
    fits(parts.len() == count && sum == Some(dims[axis]), || format!("{} cannot be split into {parts:?}", dims[axis]))?;
    let part = |size: usize| [&dims[..axis], &[size], &dims[axis + 1..]].concat();
    Ok(parts.into_iter().map(part).collect())
}

fn slice(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let mut dims = x.dims(0)?.to_vec();
    let (starts, ends, axes, steps) = match (x.node.ints("starts"), x.node.ints("ends")) {
        (Some(starts), Some(ends)) => (starts.to_vec(), ends.to_vec(), x.node.ints("axes").map(<[i64]>::to_vec), None),
        _ => {
            let list = |index: usize| x.get(index).map(|_| x.int_list(index)).transpose();
            (x.int_list(1)?, x.int_list(2)?, list(3)?, list(4)?)
        }
    };
    let axes = axes.unwrap_or_else(|| (0..starts.len() as i64).collect());
    let steps = steps.unwrap_or_else(|| vec![1; starts.len()]);
    let right = [ends.len(), axes.len(), steps.len()].iter().all(|&count| count == starts.len());
    fits(right, || "starts, ends, axes and steps differ in length".to_owned())?;
    for (((&start, &end), &axis), &step) in starts.iter().zip(&ends).zip(&axes).zip(&steps) {
        let axis = x.axis(axis, dims.len())?;
        let size = dims[axis] as i64;
        let inside = |value: i64| if value < 0 { value.saturating_add(size) } else { value };
        dims[axis] = match step {
            0 => return Err("a step is 0".to_owned()),
            1.. => {
                let (start, end) = (inside(start).clamp(0, size), inside(end).clamp(0, size));
                (end - start).max(0).unsigned_abs().div_ceil(step.unsigned_abs()) as usize
            }
            _ => {
                // The runtime stores 32-bit integers, so an open start or end is their smallest value.
                let (start, end) = (inside(start).clamp(-1, size - 1), inside(end).clamp(-1, size - 1));
                (start - end).max(0).unsigned_abs().div_ceil(step.unsigned_abs()) as usize
            }
        };
    }
    Ok(dims)
}

fn pad(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let mut dims = x.dims(0)?.to_vec();
    let pads = match x.node.ints("pads") {
        Some(pads) => pads.to_vec(),
        None => x.int_list(1)?,
    };
    let axes: Vec<usize> = match x.get(3) {
        Some(_) => x.int_list(3)?.into_iter().map(|axis| x.axis(axis, dims.len())).collect::<Result<_, _>>()?,
        None => (0..dims.len()).collect(),
    };
    fits(pads.len() == 2 * axes.len(), || format!("the padding {pads:?} does not match {} axes", axes.len()))?;
    for (index, &axis) in axes.iter().enumerate() {
        let size = (dims[axis] as i64).saturating_add(pads[index]).saturating_add(pads[index + axes.len()]);
        dims[axis] = x.size(Some(size), "a padded size")?;
    }
    Ok(dims)
}

fn reshape(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    let dims = x.dims(0)?;
    let asked = match x.node.ints("shape") {
        Some(shape) => shape.to_vec(),
        None => x.int_list(1)?,
    };
    let total = product(dims).ok_or("a size is too large")?;
    let zero_is_zero = x.node.int("allowzero").unwrap_or(0) != 0;
    let misfit = || format!("the shape {dims:?} cannot be reshaped to {asked:?}");
    let mut shaped = Vec::with_capacity(asked.len());
    for (axis, &size) in asked.iter().enumerate() {
        shaped.push(match size {
            0 if !zero_is_zero => *dims.get(axis).ok_or_else(misfit)?,
            -1 => 1,
            size => usize::try_from(size).map_err(|_| misfit())?,
        });
    }
    let others = product(&shaped).ok_or_else(misfit)?;
    if let Some(axis) = asked.iter().position(|&size| size == -1) {
        shaped[axis] = total.checked_div(others).unwrap_or(0);
    }
    fits(product(&shaped) == Some(total), misfit)?;
    Ok(shaped)
}

fn reduced(x: &Inputs<'_>, axes: Option<Vec<i64>>) -> Result<Vec<usize>, String> {
    let dims = x.dims(0)?;
    let keep = x.node.int("keepdims").unwrap_or(1) != 0;
    let nothing = x.node.int("noop_with_empty_axes").unwrap_or(0) != 0;
    let axes = match axes.filter(|axes| !axes.is_empty()) {
        None if nothing => return Ok(dims.to_vec()),
        None => (0..dims.len()).collect(),
        Some(axes) => axes.iter().map(|&axis| x.axis(axis, dims.len())).collect::<Result<Vec<_>, _>>()?,
    };
    let size = |axis: usize| match axes.contains(&axis) {
        true if keep => Some(1),
        true => None,
        false => Some(dims[axis]),
    };
    Ok((0..dims.len()).filter_map(size).collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Counted by hand: in ceil mode a window may be cut off at the end, but starts in the input or in the padding
    /// before it, as documented for PyTorch's `nn.MaxPool1d`.
    #[test]
    fn windows_of_pooling_are_counted() {
        let count = |size, kernel, stride, padding, ceil| {
            let windows = Windows {
                strides: vec![stride],
                dilations: vec![1],
                pads: vec![padding; 2],
                auto_pad: "NOTSET".into(),
            };
            windows.positions(0, size, kernel, ceil)
        };
        for (size, kernel, stride, padding, floor, ceil) in
            [(5, 2, 2, 0, 2, 3), (4, 2, 3, 1, 2, 2), (6, 3, 2, 1, 3, 4), (7, 2, 5, 1, 2, 2), (8, 3, 4, 1, 2, 3)]
        {
            let counts = [false, true].map(|mode| count(size, kernel, stride, padding, mode).unwrap());
            assert_eq!(counts, [floor, ceil], "{size} {kernel} {stride} {padding}");
        }
        assert!(count(1, 2, 2, 0, false).is_err());
        assert!(count(1, 4, 2, 0, true).is_err());
    }
}
