//! ONNX' `Resize` and `Upsample` as matrix products: along each axis, the output is a matrix times the input.
//!
//! rten 0.27 computes `cubic` as `linear`, rejects `antialias`, and does not let callers replace its operators. With
//! sizes known before the run, every mode of the standard becomes two matrix products. Definition:
//! <https://onnx.ai/onnx/operators/onnx__Resize.html>.

use crate::facts::{Fact, Inputs};
use crate::onnx::{AttributeValue, Node, Tensor, product};

/// Largest number of elements of a matrix.
const MAX_MATRIX: usize = 1 << 24;

/// Output sizes of a `Resize` or `Upsample` node.
pub(crate) fn output_dims(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    Ok(axes_of(x)?.into_iter().map(|axis| axis.new).collect())
}

/// Nodes and their constants.
pub(crate) type Products = (Vec<Node>, Vec<Tensor>);

/// Nodes and constants that replace a node; `None` if the runtime computes it by the standard.
pub(crate) fn as_products(x: &Inputs<'_>) -> Result<Option<Products>, String> {
    let axes = axes_of(x)?;
    let attributes = Attributes::of(x)?;
    if attributes.native(x, &axes) {
        return Ok(None);
    }
    // onnxruntime resizes nothing if no size changes, whatever the scales.
    let unchanged = attributes.coordinates != "tf_crop_and_resize" && axes.iter().all(|axis| axis.old == axis.new);
    let mut matrices = Vec::new();
    for (index, axis) in axes.iter().enumerate().filter(|_| !unchanged) {
        let rows = axis.rows(&attributes);
        if rows.iter().enumerate().any(|(at, row)| axis.old != axis.new || row[..] != [(at, 1.0)]) {
            if product(&[axis.old, axis.new]).is_none_or(|size| size > MAX_MATRIX) {
                return Err(format!("resizing {} to {} takes too large a matrix", axis.old, axis.new));
            }
            matrices.push((index, axis, rows));
        }
    }
    // The axis that shrinks most comes first, to reduce the work for the others.
    matrices.sort_by(|(_, a, _), (_, b, _)| (a.new * b.old).cmp(&(b.new * a.old)));
    let output = x.node.outputs.first().ok_or("there is no output")?;
    let rank = axes.len();
    let (mut nodes, mut tensors): (Vec<Node>, Vec<Tensor>) = (Vec::new(), Vec::new());
    let mut at = x.node.inputs.first().cloned().ok_or("there is no input")?;
    for (index, axis, rows) in matrices {
        let name = |what: &str| format!("{output}#{index}{what}");
        let turned = index + 2 != rank;
        let mut values = vec![0.0f32; axis.old * axis.new];
        for (new, row) in rows.iter().enumerate() {
            for &(old, weight) in row {
                values[if turned { old * axis.new + new } else { new * axis.old + old }] += weight as f32;
            }
        }
        let dims = if turned { vec![axis.old, axis.new] } else { vec![axis.new, axis.old] };
        tensors.push(Tensor::floats(name("matrix"), dims, &values));
        let mut swap: Vec<i64> = (0..rank as i64).collect();
        swap.swap(index, rank - 1);
        let turn =
            |from: &str, to: &str| Node::new("Transpose", &[from], to).with("perm", AttributeValue::Ints(swap.clone()));
        if index + 1 == rank {
            nodes.push(Node::new("MatMul", &[&at, &name("matrix")], &name("")));
        } else if !turned {
            nodes.push(Node::new("MatMul", &[&name("matrix"), &at], &name("")));
        } else {
            nodes.push(turn(&at, &name("there")));
            nodes.push(Node::new("MatMul", &[&name("there"), &name("matrix")], &name("product")));
            nodes.push(turn(&name("product"), &name("")));
        }
        at = name("");
    }
    match nodes.last_mut() {
        Some(last) => last.outputs = vec![output.clone()],
        None => nodes.push(Node::new("Identity", &[&at], output)),
    }
    Ok(Some((nodes, tensors)))
}

/// One axis of a resize.
struct Axis {
    old: usize,
    new: usize,
    /// Ratio of new to old length, as given by the node.
    scale: f64,
    /// Cropped range of the old axis, for `tf_crop_and_resize`.
    crop: (f64, f64),
}

#[derive(PartialEq)]
enum Mode {
    Nearest,
    Linear,
    Cubic,
}

/// Attributes for all axes.
struct Attributes {
    mode: Mode,
    coordinates: String,
    nearest: String,
    antialias: bool,
    cubic_coeff_a: f64,
    exclude_outside: bool,
}

impl Attributes {
    fn of(x: &Inputs<'_>) -> Result<Self, String> {
        let text = |name: &str, usual: &str| x.node.text(name).unwrap_or(usual).to_owned();
        let mode = match text("mode", "nearest").as_str() {
            "nearest" => Mode::Nearest,
            "linear" => Mode::Linear,
            "cubic" => Mode::Cubic,
            other => return Err(format!("the mode {other} is not in the standard")),
        };
        // Before version 11, `Resize` was `Upsample`.
        let old = x.opset < 11 || x.node.op == "Upsample";
        let coordinates = text("coordinate_transformation_mode", if old { "asymmetric" } else { "half_pixel" });
        let nearest = text("nearest_mode", if old { "floor" } else { "round_prefer_floor" });
        const COORDINATES: [&str; 7] = [
            "half_pixel",
            "half_pixel_symmetric",
            "pytorch_half_pixel",
            "align_corners",
            "asymmetric",
            "tf_half_pixel_for_nn",
            "tf_crop_and_resize",
        ];
        if !COORDINATES.contains(&coordinates.as_str()) {
            return Err(format!("the coordinate transformation {coordinates} is not in the standard"));
        }
        if !["round_prefer_floor", "round_prefer_ceil", "floor", "ceil"].contains(&nearest.as_str()) {
            return Err(format!("the nearest mode {nearest} is not in the standard"));
        }
        if coordinates == "tf_crop_and_resize" && x.node.float("extrapolation_value").unwrap_or(0.0) != 0.0 {
            return Err("extrapolation values other than 0 are not supported".to_owned());
        }
        Ok(Self {
            antialias: mode != Mode::Nearest && x.node.int("antialias").unwrap_or(0) != 0,
            mode,
            coordinates,
            nearest,
            cubic_coeff_a: x.node.float("cubic_coeff_a").map_or(-0.75, f64::from),
            exclude_outside: x.node.int("exclude_outside").unwrap_or(0) != 0,
        })
    }

    /// Whether rten 0.27 computes the node by the standard.
    ///
    /// The mode `nearest` needs scales of 2ⁿ: rten multiplies where others divide, which rounds positions halfway
    /// between two pixels to the other one.
    fn native(&self, x: &Inputs<'_>, axes: &[Axis]) -> bool {
        const COORDINATES: [&str; 4] = ["half_pixel", "asymmetric", "align_corners", "pytorch_half_pixel"];
        let node = x.node;
        let usual = !self.antialias && !self.exclude_outside && self.mode != Mode::Cubic;
        let resized_last = axes.len() == 4 && axes[..2].iter().all(|axis| axis.old == axis.new && axis.scale == 1.0);
        node.op == "Resize"
            && x.opset >= 11
            && usual
            && resized_last
            && COORDINATES.contains(&self.coordinates.as_str())
            && node.int("antialias").unwrap_or(0) == 0
            && (self.mode == Mode::Linear || axes.iter().all(|axis| axis.scale.log2().fract() == 0.0))
            && self.cubic_coeff_a == -0.75
            && node.float("extrapolation_value").unwrap_or(0.0) == 0.0
            && node.text("keep_aspect_ratio_policy").unwrap_or("stretch") == "stretch"
            && node.ints("axes").is_none()
    }
}

fn axes_of(x: &Inputs<'_>) -> Result<Vec<Axis>, String> {
    let dims = x.dims(0)?;
    let rank = dims.len();
    let old = x.opset < 11 || x.node.op == "Upsample";
    let of = |index: usize| x.get(index).filter(|fact| !fact.dims.contains(&0)).is_some();
    let (roi, scales, sizes) = if old { (None, Some(1), None) } else { (Some(1), Some(2), Some(3)) };
    let listed = |index: Option<usize>| index.filter(|&index| of(index)).map(|index| x.numbers(index)).transpose();
    let (roi, mut scales, sizes) = (listed(roi)?, listed(scales)?, listed(sizes)?);
    if let Some(AttributeValue::Floats(values)) = x.node.value("scales") {
        scales = Some(values.iter().map(|&value| f64::from(value)).collect());
    }
    let named: Vec<usize> = match x.node.ints("axes") {
        Some(axes) => axes.iter().map(|&axis| x.axis(axis, rank)).collect::<Result<_, _>>()?,
        None => (0..rank).collect(),
    };
    let all: Vec<Axis> = dims.iter().map(|&old| Axis { old, new: old, scale: 1.0, crop: (0.0, 1.0) }).collect();
    let mut all = all;
    let right = |list: &[f64], each: usize| list.len() == each * named.len();
    if let Some(roi) = roi.filter(|roi| right(roi, 2)) {
        for (index, &axis) in named.iter().enumerate() {
            all[axis].crop = (roi[index], roi[index + named.len()]);
        }
    }
    let misfit = || format!("the sizes or scales do not match the shape {dims:?}");
    match (sizes, scales) {
        (Some(sizes), _) => {
            if !right(&sizes, 1) {
                return Err(misfit());
            }
            let policy = x.node.text("keep_aspect_ratio_policy").unwrap_or("stretch");
            let ratios = named.iter().zip(&sizes).map(|(&axis, size)| size / dims[axis].max(1) as f64);
            let common = match policy {
                "not_larger" => Some(ratios.fold(f64::INFINITY, f64::min)),
                "not_smaller" => Some(ratios.fold(0.0, f64::max)),
                _ => None,
            };
            for (&axis, &size) in named.iter().zip(&sizes) {
                let old = all[axis].old as f64;
                let size = common.map_or(size, |scale| (scale * old + 0.5).floor());
                all[axis].new = whole(size)?;
                all[axis].scale = common.unwrap_or(size / old.max(1.0));
            }
        }
        (None, Some(scales)) => {
            if !right(&scales, 1) {
                return Err(misfit());
            }
            for (&axis, &scale) in named.iter().zip(&scales) {
                all[axis].new = whole((all[axis].old as f64 * scale).floor())?;
                all[axis].scale = scale;
            }
        }
        (None, None) => return Err("sizes and scales are missing".to_owned()),
    }
    let usable = |axis: &Axis| axis.old > 0 && axis.new > 0 && axis.scale.is_finite() && axis.scale > 0.0;
    if !all.iter().all(usable) {
        return Err(format!("the shape {dims:?} cannot be resized to an empty one"));
    }
    Ok(all)
}

fn whole(size: f64) -> Result<usize, String> {
    if (0.0..1e9).contains(&size) { Ok(size as usize) } else { Err(format!("the new size is {size}")) }
}

impl Axis {
    /// Old positions with their weights, for each new position.
    fn rows(&self, attributes: &Attributes) -> Vec<Vec<(usize, f64)>> {
        (0..self.new).map(|new| self.row(attributes, self.coordinate(&attributes.coordinates, new), new)).collect()
    }

    /// Old coordinate of a new position, in single precision and in onnxruntime's order of operations, since `floor`
    /// and `ceil` depend on the last bit.
    fn coordinate(&self, coordinates: &str, new: usize) -> f64 {
        let (new, scale) = (new as f32, self.scale as f32);
        let (old_length, new_length) = (self.old as f32, self.new as f32);
        let half_pixel = (new + 0.5) / scale - 0.5;
        let at = match coordinates {
            "half_pixel_symmetric" => {
                let adjustment = new_length / (scale * old_length);
                0.5 * old_length * (1.0 - adjustment) + half_pixel
            }
            "pytorch_half_pixel" | "align_corners" if self.new == 1 => 0.0,
            "align_corners" => new * (old_length - 1.0) / (new_length - 1.0),
            "asymmetric" => new / scale,
            "tf_half_pixel_for_nn" => (new + 0.5) / scale,
            "tf_crop_and_resize" => {
                let (start, end) = (self.crop.0 as f32, self.crop.1 as f32);
                if self.new > 1 {
                    start * (old_length - 1.0) + new * (end - start) * (old_length - 1.0) / (new_length - 1.0)
                } else {
                    0.5 * (start + end) * (old_length - 1.0)
                }
            }
            _ => half_pixel,
        };
        f64::from(at)
    }

    fn row(&self, attributes: &Attributes, at: f64, new: usize) -> Vec<(usize, f64)> {
        let last = (self.old - 1) as f64;
        if attributes.coordinates == "tf_crop_and_resize" && !(0.0..=last).contains(&at) {
            return Vec::new();
        }
        // An axis that keeps its length and scale is not resized.
        if attributes.coordinates != "tf_crop_and_resize" && self.old == self.new && self.scale == 1.0 {
            return vec![(new, 1.0)];
        }
        if attributes.mode == Mode::Nearest {
            let nearest = match attributes.nearest.as_str() {
                "round_prefer_floor" => (at - 0.5).ceil(),
                "round_prefer_ceil" => (at + 0.5).floor(),
                "floor" => at.floor(),
                _ => at.ceil(),
            };
            return vec![(nearest.clamp(0.0, last) as usize, 1.0)];
        }
        let kernel = |x: f64| match attributes.mode {
            Mode::Cubic => cubic(x, attributes.cubic_coeff_a),
            _ => (1.0 - x.abs()).max(0.0),
        };
        let stretch = if attributes.antialias { self.scale.min(1.0) } else { 1.0 };
        let reach = if attributes.mode == Mode::Cubic { 2.0 } else { 1.0 } / stretch;
        let (first, end) = ((at - reach).ceil() as i64, (at + reach).floor() as i64);
        let taps = (first..=end).map(|tap| (tap, kernel(stretch * (tap as f64 - at))));
        let inside = |tap: i64| (0..self.old as i64).contains(&tap);
        let mut row: Vec<(usize, f64)> = taps
            .filter(|&(tap, weight)| weight != 0.0 && (inside(tap) || !attributes.exclude_outside))
            .map(|(tap, weight)| (tap.clamp(0, self.old as i64 - 1) as usize, weight))
            .collect();
        let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
        row.iter_mut().for_each(|(_, weight)| *weight /= sum);
        merged(row)
    }
}

/// Merges adjacent entries for the same old position.
fn merged(row: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    let mut merged: Vec<(usize, f64)> = Vec::with_capacity(row.len());
    for (tap, weight) in row {
        match merged.last_mut() {
            Some((last, sum)) if *last == tap => *sum += weight,
            _ => merged.push((tap, weight)),
        }
    }
    merged
}

/// Keys' cubic convolution kernel.
fn cubic(x: f64, a: f64) -> f64 {
    let x = x.abs();
    if x <= 1.0 {
        ((a + 2.0) * x - (a + 3.0)) * x * x + 1.0
    } else if x < 2.0 {
        ((a * x - 5.0 * a) * x + 8.0 * a) * x - 4.0 * a
    } else {
        0.0
    }
}

/// Properties of a matrix from [`as_products`].
pub(crate) fn matrix_fact(matrix: &Tensor) -> Fact {
    Fact { dims: matrix.dims.clone(), known: None, constant: true }
}
