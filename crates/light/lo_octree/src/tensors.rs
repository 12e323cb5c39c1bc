//! The octree's part of a scene file: little-endian tensors for each depth and a small JSON header.
//!
//! For each depth `d` with `n` nodes, `m` of them non-empty:
//!
//! | tensor | type, shape | |
//! | --- | --- | --- |
//! | `octree.d.keys` | U32 `[n]` | shuffled keys, strictly increasing |
//! | `octree.d.children` | I32 `[n]` | index of the first of eight children in the next depth, −1 where not split |
//! | `octree.d.nonempty` | BOOL `[n]` | whether a node has a feature row |
//! | `octree.d.rgba` | F32 `[m, 4]` | linear radiance, opacity of one crossing |
//! | `octree.d.seen` | U8 `[m]` | observed share, 255 for all |
//! | `octree.d.lobes` | F32 `[m, 3]` | optional, for all depths or none: axis × sharpness of a spherical Gaussian |
//!
//! See [`lobe_gain`](crate::lobe_gain) for the lobes.
//!
//! Row numbers are not stored; they are the running count of `nonempty`. In Python:
//!
//! ```python
//! from safetensors.numpy import load_file
//! t = load_file("room.safetensors")
//! keys, rgba = t["octree.7.keys"][t["octree.7.nonempty"]], t["octree.7.rgba"]
//! ```

use std::borrow::Cow;

use lo_geometry::Cube;
use safetensors::{Dtype, SafeTensors, View};
use serde::{Deserialize, Serialize};

use crate::{
    FORMAT_VERSION, Level, LightOctree, MAX_RADIANCE, Octree, OctreeError,
    light::{check_cube, is_feature},
    topology::check_depths,
};

/// The only optional tensor.
const LOBES: &str = "lobes";

/// Sharper lobes are rejected as errors; their gains would overflow in products.
const MAX_SHARPNESS: f32 = 1000.0;

/// Properties that the tensors themselves do not contain; stored as JSON.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct OctreeHeader {
    /// Format version of the writer ([`FORMAT_VERSION`]).
    pub format_version: u32,
    /// Depth of the finest level.
    pub depth: u32,
    /// Depth down to which every node exists.
    pub full_depth: u32,
    /// World-space cube of the root.
    pub cube: Cube,
}

/// A tensor to be written; `safetensors::serialize` accepts it directly.
#[derive(Clone, Debug, PartialEq)]
pub struct NamedTensor {
    /// Name in the file.
    pub name: String,
    /// Element type.
    pub dtype: Dtype,
    /// Extent along each axis.
    pub shape: Vec<usize>,
    /// Elements, little-endian, last axis fastest.
    pub bytes: Vec<u8>,
}

impl View for NamedTensor {
    fn dtype(&self) -> Dtype {
        self.dtype
    }

    fn shape(&self) -> &[usize] {
        &self.shape
    }

    fn data(&self) -> Cow<'_, [u8]> {
        Cow::Borrowed(&self.bytes)
    }

    fn data_len(&self) -> usize {
        self.bytes.len()
    }
}

/// Returns the header and the tensors of an octree, coarsest depth first. Radiance above [`MAX_RADIANCE`] is stored as
/// that, so that [`read_tensors`] accepts it.
pub fn write_tensors(light: &LightOctree) -> (OctreeHeader, Vec<NamedTensor>) {
    let header = OctreeHeader {
        format_version: FORMAT_VERSION,
        depth: light.octree.depth(),
        full_depth: light.octree.full_depth(),
        cube: light.cube,
    };
    let mut tensors = Vec::new();
    for (depth, level) in light.octree.levels().iter().enumerate() {
        let (nodes, rows) = (level.len(), level.nonempty);
        let mut push = |part: &str, dtype, shape: &[usize], bytes| {
            tensors.push(NamedTensor { name: tensor_name(depth, part), dtype, shape: shape.to_vec(), bytes });
        };
        push("keys", Dtype::U32, &[nodes], level.keys.iter().flat_map(|key| key.to_le_bytes()).collect());
        push("children", Dtype::I32, &[nodes], level.children.iter().flat_map(|child| child.to_le_bytes()).collect());
        push("nonempty", Dtype::BOOL, &[nodes], level.rows.iter().map(|&row| u8::from(row >= 0)).collect());
        let rgba = light.rgba[depth].as_flattened();
        push(
            "rgba",
            Dtype::F32,
            &[rows, 4],
            rgba.iter().flat_map(|value| value.min(MAX_RADIANCE).to_le_bytes()).collect(),
        );
        push("seen", Dtype::U8, &[rows], light.seen[depth].clone());
        if let Some(lobes) = &light.lobes {
            let lobes = lobes[depth].as_flattened();
            push(LOBES, Dtype::F32, &[rows, 3], lobes.iter().flat_map(|value| value.to_le_bytes()).collect());
        }
    }
    (header, tensors)
}

/// Reads the output of [`write_tensors`]; other tensors in the file are ignored.
///
/// Everything is checked, so that the result fulfils the invariants of [`Octree`] and all features are in range.
/// Allocates less than three times the tensors' bytes.
///
/// # Errors
/// The first invalid item: version, header, a missing tensor, its type or shape, or a value with its index.
pub fn read_tensors(tensors: &SafeTensors<'_>, header: &OctreeHeader) -> Result<LightOctree, OctreeError> {
    if header.format_version != FORMAT_VERSION {
        return Err(OctreeError::Version { got: header.format_version });
    }
    let OctreeHeader { depth, full_depth, cube, .. } = *header;
    check_depths(depth, full_depth)?;
    check_cube(cube)?;
    let mut levels: Vec<Level> = Vec::new();
    let (mut rgba, mut seen) = (Vec::new(), Vec::new());
    let mut lobes = tensors.tensor(&tensor_name(0, LOBES)).is_ok().then(Vec::new);
    for d in 0..=depth {
        let level = read_level(tensors, levels.last(), d, header)?;
        rgba.push(read_rgba(tensors, d, level.nonempty)?);
        seen.push(tensor(tensors, d, "seen", Dtype::U8, &[level.nonempty])?.1.to_vec());
        if let Some(lobes) = &mut lobes {
            lobes.push(read_lobes(tensors, d, level.nonempty)?);
        }
        levels.push(level);
    }
    Ok(LightOctree { octree: Octree::from_valid_levels(levels, full_depth), cube, rgba, seen, lobes })
}

fn read_level(
    tensors: &SafeTensors<'_>,
    above: Option<&Level>,
    depth: u32,
    header: &OctreeHeader,
) -> Result<Level, OctreeError> {
    let value_error = |part, index, what| OctreeError::Value { tensor: tensor_name(depth as usize, part), index, what };

    // The nodes of a level are the children of those above. Types and shapes are checked first: nothing is allocated
    // for a size that the file does not have.
    let nodes = above.map_or(1, |above| 8 * above.children.iter().filter(|&&child| child >= 0).count());
    let keys = words(tensor(tensors, depth, "keys", Dtype::U32, &[nodes])?.1, u32::from_le_bytes);
    let children = words(tensor(tensors, depth, "children", Dtype::I32, &[nodes])?.1, i32::from_le_bytes);
    let nonempty = tensor(tensors, depth, "nonempty", Dtype::BOOL, &[nodes])?.1;

    // Required key of each node, and whether its parent is non-empty.
    let expected: Vec<(u32, bool)> = match above {
        None => vec![(0, true)],
        Some(above) => (0..above.len())
            .filter(|&node| above.children[node] >= 0)
            .flat_map(|node| (0..8).map(move |child| (above.keys[node] << 3 | child, above.rows[node] >= 0)))
            .collect(),
    };
    if let Some(index) = (0..nodes).find(|&node| keys[node] != expected[node].0) {
        return Err(value_error("keys", index, "is not the key of the next child of a split node above"));
    }

    if let Some(index) = nonempty.iter().position(|&label| label > 1) {
        return Err(value_error("nonempty", index, "is neither 0 nor 1"));
    }
    if let Some(index) = (0..nodes).find(|&node| nonempty[node] == 1 && !expected[node].1) {
        return Err(value_error("nonempty", index, "marks a non-empty node under an empty one"));
    }

    let mut next_child = 0;
    for (index, &child) in children.iter().enumerate() {
        let what = match child {
            -1 if depth < header.full_depth => "leaves a node above the full depth unsplit",
            -1 => continue,
            _ if depth == header.depth => "splits a node of the finest depth",
            _ if child != next_child => "is neither -1 nor the index after the children of the split node before it",
            _ if depth >= header.full_depth && nonempty[index] == 0 => "splits an empty node below the full depth",
            _ => {
                next_child += 8;
                continue;
            }
        };
        return Err(value_error("children", index, what));
    }

    let mut level = Level { rows: vec![-1; nodes], keys, children, nonempty: 0 };
    level.number_rows(nonempty.iter().map(|&label| label == 1));
    Ok(level)
}

fn read_rgba(tensors: &SafeTensors<'_>, depth: u32, rows: usize) -> Result<Vec<[f32; 4]>, OctreeError> {
    let (tensor, bytes) = tensor(tensors, depth, "rgba", Dtype::F32, &[rows, 4])?;
    let rgba = words(bytes, f32::from_le_bytes).as_chunks().0.to_vec();
    match rgba.iter().position(|row| !is_feature(row)) {
        Some(index) => {
            Err(OctreeError::Value { tensor, index, what: "is not radiance from 0 to 1e14 with opacity in [0, 1]" })
        }
        None => Ok(rgba),
    }
}

fn read_lobes(tensors: &SafeTensors<'_>, depth: u32, rows: usize) -> Result<Vec<[f32; 3]>, OctreeError> {
    let (tensor, bytes) = tensor(tensors, depth, LOBES, Dtype::F32, &[rows, 3])?;
    let lobes: Vec<[f32; 3]> = words(bytes, f32::from_le_bytes).as_chunks().0.to_vec();
    match lobes.iter().position(|lobe| !lobe.iter().all(|v| v.abs() <= MAX_SHARPNESS)) {
        Some(index) => {
            Err(OctreeError::Value { tensor, index, what: "has a lobe component that is NaN or beyond 1000" })
        }
        None => Ok(lobes),
    }
}

/// Returns the name and bytes of a tensor that must have this type and shape.
fn tensor<'data>(
    tensors: &SafeTensors<'data>,
    depth: u32,
    part: &str,
    dtype: Dtype,
    shape: &[usize],
) -> Result<(String, &'data [u8]), OctreeError> {
    let name = tensor_name(depth as usize, part);
    let Ok(view) = tensors.tensor(&name) else {
        return Err(OctreeError::MissingTensor { tensor: name });
    };
    if view.dtype() != dtype || view.shape() != shape {
        return Err(OctreeError::Layout {
            tensor: name,
            expected: format!("{dtype} {shape:?}"),
            got: format!("{} {:?}", view.dtype(), view.shape()),
        });
    }
    Ok((name, view.data()))
}

fn tensor_name(depth: usize, part: &str) -> String {
    format!("octree.{depth}.{part}")
}

fn words<T>(bytes: &[u8], from_le_bytes: impl Fn([u8; 4]) -> T) -> Vec<T> {
    bytes.as_chunks().0.iter().map(|&word| from_le_bytes(word)).collect()
}
