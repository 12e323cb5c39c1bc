//! Integer products in single precision, for processors on which rten's 8-bit products saturate.
//!
//! x86-64 without AVX-512 VNNI adds pairs of 8-bit products in 16 bits, which overflow with weights of the full range
//! (oneDNN, "Nuances of int8 computations"). Products in single precision are exact below 2^24.

use rten_gemm::GemmExecutor;

use crate::facts::Fact;
use crate::onnx::{AttributeValue, Node, Tensor};

/// ONNX number types of `Cast`.
const FLOAT: i64 = 1;
const INT32: i64 = 6;

/// Returns whether 8-bit products saturate on this processor.
pub(crate) fn saturate() -> bool {
    GemmExecutor::<u8, i8, i32>::default().may_saturate()
}

/// Returns the nodes and constants that replace a `MatMulInteger` or `ConvInteger`; `None` for other nodes.
pub(crate) fn in_floats(node: &Node, inputs: &[Option<&Fact>]) -> Option<(Vec<Node>, Vec<Tensor>)> {
    let is_convolution = match node.op.as_str() {
        "MatMulInteger" => false,
        "ConvInteger" => true,
        _ => return None,
    };
    let output = node.outputs.first()?;
    let (mut nodes, mut tensors, mut factors) = (Vec::new(), Vec::new(), Vec::new());
    let mut cast = |from: &str, to: &str| {
        nodes.push(Node::new("Cast", &[from], to).with("to", AttributeValue::Int(FLOAT)));
        to.to_owned()
    };
    let mut differences = Vec::new();
    for (side, name) in node.inputs.iter().take(2).enumerate() {
        let mut factor = cast(name, &format!("{output}#factor{side}"));
        if let Some(zero) = node.inputs.get(2 + side).filter(|name| !name.is_empty()) {
            let mut zero_point = cast(zero, &format!("{output}#zero{side}"));
            // one value a row of a matrix, or a channel of a kernel
            let of_zero = inputs.get(2 + side).copied().flatten()?.dims.as_slice();
            let trailing = match (of_zero, is_convolution, side) {
                (&[length], true, 1) if length > 1 => inputs.get(1).copied().flatten()?.dims.len().checked_sub(1)?,
                (&[length], false, 0) if length > 1 => 1,
                _ => 0,
            };
            if trailing > 0 {
                let shape: Vec<i32> = std::iter::once(-1).chain(std::iter::repeat_n(1, trailing)).collect();
                let (by, shaped) = (format!("{output}#shape{side}"), format!("{output}#column{side}"));
                tensors.push(Tensor::ints(by.clone(), vec![shape.len()], &shape));
                differences.push(Node::new("Reshape", &[&zero_point, &by], &shaped));
                zero_point = shaped;
            }
            let difference = format!("{output}#difference{side}");
            differences.push(Node::new("Sub", &[&factor, &zero_point], &difference));
            factor = difference;
        }
        factors.push(factor);
    }
    let [a, b] = factors.as_slice() else { return None };
    nodes.append(&mut differences);
    let product = format!("{output}#product");
    let mut multiply = Node::new(if is_convolution { "Conv" } else { "MatMul" }, &[a, b], &product);
    multiply.attributes.clone_from(&node.attributes);
    nodes.push(multiply);
    nodes.push(Node::new("Cast", &[&product], output).with("to", AttributeValue::Int(INT32)));
    Some((nodes, tensors))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn fact(dims: &[usize]) -> Fact {
        Fact { dims: dims.to_vec(), known: None, constant: false }
    }

    fn operators(op: &str, dims: [&[usize]; 4]) -> String {
        let facts = dims.map(fact);
        let node = Node::new(op, &["a", "b", "za", "zb"], "y");
        let (nodes, tensors) = in_floats(&node, &facts.each_ref().map(Some)).unwrap();
        assert_eq!(nodes.last().unwrap().outputs, ["y"]);
        let shapes: Vec<_> = tensors.iter().map(|tensor| tensor.dims.clone()).collect();
        format!("{} {shapes:?}", nodes.iter().map(|node| node.op.as_str()).collect::<Vec<_>>().join(" "))
    }

    #[test]
    fn zero_points_are_subtracted_before_the_product() {
        let plain = "Cast Cast Cast Cast Sub Sub MatMul Cast []";
        assert_eq!(operators("MatMulInteger", [&[2, 8], &[8, 3], &[], &[3]]), plain);
        let by_row = "Cast Cast Cast Cast Reshape Sub Sub MatMul Cast [[2]]";
        assert_eq!(operators("MatMulInteger", [&[2, 8], &[8, 3], &[2], &[]]), by_row);
        let by_channel = "Cast Cast Cast Cast Sub Reshape Sub Conv Cast [[4]]";
        assert_eq!(operators("ConvInteger", [&[1, 2, 5, 5], &[4, 2, 3, 3], &[], &[4]]), by_channel);
        assert!(in_floats(&Node::new("MatMul", &["a", "b"], "y"), &[]).is_none());
    }
}
