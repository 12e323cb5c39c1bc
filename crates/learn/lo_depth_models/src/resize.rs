//! ONNX' `Resize` and `Upsample` as matrices: along each axis, what comes out is a matrix times what goes in.
//!
//! rten 0.27 computes `cubic` as `linear`, refuses `antialias`, and lets nobody put an operator in the place of its own. With sizes known before the run,
//! every mode of the standard is two products that it does well. Definition: <https://onnx.ai/onnx/operators/onnx__Resize.html>.

use crate::facts::{Fact, Inputs};
use crate::onnx::{AttributeValue, Node, Tensor, product};

/// Largest matrix along an axis.
const MAX_MATRIX: usize = 1 << 24;

/// Sizes that a `Resize` or `Upsample` gives.
pub(crate) fn output_dims(x: &Inputs<'_>) -> Result<Vec<usize>, String> {
    Ok(axes_of(x)?.into_iter().map(|axis| axis.new).collect())
}

/// Nodes and their constants.
pub(crate) type Products = (Vec<Node>, Vec<Tensor>);

/// Nodes and constants that do the work of a node, where the run time would do it otherwise than the standard says; `None` where it does it right.
pub(crate) fn as_products(x: &Inputs<'_>) -> Result<Option<Products>, String> {
    let axes = axes_of(x)?;
    let how = How::of(x)?;
    if how.native(x, &axes) {
        return Ok(None);
    }
    // As onnxruntime has it: where no size changes, nothing is resized, whatever the scales.
    let unchanged = how.coordinates != "tf_crop_and_resize" && axes.iter().all(|axis| axis.old == axis.new);
    let mut matrices = Vec::new();
    for (index, axis) in axes.iter().enumerate().filter(|_| !unchanged) {
        let rows = axis.rows(&how);
        if rows.iter().enumerate().any(|(at, row)| axis.old != axis.new || row[..] != [(at, 1.0)]) {
            if product(&[axis.old, axis.new]).is_none_or(|size| size > MAX_MATRIX) {
                return Err(format!("resizes {} to {}, which is too large", axis.old, axis.new));
            }
            matrices.push((index, axis, rows));
        }
    }
    // What shrinks most comes first: less is left to do.
    matrices.sort_by(|(_, a, _), (_, b, _)| (a.new * b.old).cmp(&(b.new * a.old)));
    let output = x.node.outputs.first().ok_or("gives nothing")?;
    let rank = axes.len();
    let (mut nodes, mut tensors): (Vec<Node>, Vec<Tensor>) = (Vec::new(), Vec::new());
    let mut at = x.node.inputs.first().cloned().ok_or("takes nothing")?;
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
    /// New over old, as the node says it.
    scale: f64,
    /// Part of the old axis that is looked at, where `tf_crop_and_resize` says it.
    crop: (f64, f64),
}

#[derive(PartialEq)]
enum Mode {
    Nearest,
    Linear,
    Cubic,
}

/// What holds for all axes.
struct How {
    mode: Mode,
    coordinates: String,
    nearest: String,
    antialias: bool,
    cubic_coeff_a: f64,
    exclude_outside: bool,
}

impl How {
    fn of(x: &Inputs<'_>) -> Result<Self, String> {
        let text = |name: &str, usual: &str| x.node.text(name).unwrap_or(usual).to_owned();
        let mode = match text("mode", "nearest").as_str() {
            "nearest" => Mode::Nearest,
            "linear" => Mode::Linear,
            "cubic" => Mode::Cubic,
            other => return Err(format!("resizes by the mode {other}, which the standard does not have")),
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
            return Err(format!("resizes by the coordinates {coordinates}, which the standard does not have"));
        }
        if !["round_prefer_floor", "round_prefer_ceil", "floor", "ceil"].contains(&nearest.as_str()) {
            return Err(format!("resizes to the nearest by {nearest}, which the standard does not have"));
        }
        if coordinates == "tf_crop_and_resize" && x.node.float("extrapolation_value").unwrap_or(0.0) != 0.0 {
            return Err("fills what lies outside with another value than 0".to_owned());
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

    /// Whether rten 0.27 computes it as the standard says. Of nearest ones only scales of 2ⁿ: it multiplies where others divide, and what lies just
    /// between two pixels falls to the other side.
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
    let misfit = || format!("resizes {dims:?} by lists of another length");
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
        (None, None) => return Err("says neither sizes nor scales".to_owned()),
    }
    let usable = |axis: &Axis| axis.old > 0 && axis.new > 0 && axis.scale.is_finite() && axis.scale > 0.0;
    if !all.iter().all(usable) {
        return Err(format!("resizes {dims:?} to nothing"));
    }
    Ok(all)
}

fn whole(size: f64) -> Result<usize, String> {
    if (0.0..1e9).contains(&size) { Ok(size as usize) } else { Err(format!("resizes to {size}")) }
}

impl Axis {
    /// Of each new place the old places with their weights.
    fn rows(&self, how: &How) -> Vec<Vec<(usize, f64)>> {
        (0..self.new).map(|new| self.row(how, self.coordinate(&how.coordinates, new), new)).collect()
    }

    /// The old place of a new one. In single precision and in onnxruntime's order of operations: `floor` and `ceil` depend on the last bit.
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

    fn row(&self, how: &How, at: f64, new: usize) -> Vec<(usize, f64)> {
        let last = (self.old - 1) as f64;
        if how.coordinates == "tf_crop_and_resize" && !(0.0..=last).contains(&at) {
            return Vec::new();
        }
        // Nothing is resized along an axis that keeps its length and scale.
        if how.coordinates != "tf_crop_and_resize" && self.old == self.new && self.scale == 1.0 {
            return vec![(new, 1.0)];
        }
        if how.mode == Mode::Nearest {
            let nearest = match how.nearest.as_str() {
                "round_prefer_floor" => (at - 0.5).ceil(),
                "round_prefer_ceil" => (at + 0.5).floor(),
                "floor" => at.floor(),
                _ => at.ceil(),
            };
            return vec![(nearest.clamp(0.0, last) as usize, 1.0)];
        }
        let kernel = |x: f64| match how.mode {
            Mode::Cubic => cubic(x, how.cubic_coeff_a),
            _ => (1.0 - x.abs()).max(0.0),
        };
        let stretch = if how.antialias { self.scale.min(1.0) } else { 1.0 };
        let reach = if how.mode == Mode::Cubic { 2.0 } else { 1.0 } / stretch;
        let (first, end) = ((at - reach).ceil() as i64, (at + reach).floor() as i64);
        let taps = (first..=end).map(|tap| (tap, kernel(stretch * (tap as f64 - at))));
        let inside = |tap: i64| (0..self.old as i64).contains(&tap);
        let mut row: Vec<(usize, f64)> = taps
            .filter(|&(tap, weight)| weight != 0.0 && (inside(tap) || !how.exclude_outside))
            .map(|(tap, weight)| (tap.clamp(0, self.old as i64 - 1) as usize, weight))
            .collect();
        let sum: f64 = row.iter().map(|(_, weight)| weight).sum();
        row.iter_mut().for_each(|(_, weight)| *weight /= sum);
        merged(row)
    }
}

/// One entry for each old place.
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

/// What is known of a matrix that [`as_products`] made.
pub(crate) fn matrix_fact(matrix: &Tensor) -> Fact {
    Fact { dims: matrix.dims.clone(), known: None, constant: true }
}
