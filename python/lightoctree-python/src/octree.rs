use std::sync::Arc;

use lightoctree::Estimate;
use lightoctree::octree::node_middle_m;
use pyo3::prelude::*;

use crate::arrays;

/// The sparse voxel octree of a scene's radiance. Its arrays share the scene's memory and are read-only.
#[pyclass(frozen, module = "lightoctree")]
pub struct Octree(Arc<Estimate>);

impl Octree {
    /// Returns the octree of an estimate.
    pub fn new(estimate: Arc<Estimate>) -> Self {
        Self(estimate)
    }
}

#[pymethods]
impl Octree {
    /// Depth of the finest level; the root's is 0.
    #[getter]
    fn depth(&self) -> u32 {
        self.0.light.octree.depth()
    }

    /// Depth down to which every node exists.
    #[getter]
    fn full_depth(&self) -> u32 {
        self.0.light.octree.full_depth()
    }

    /// Corner of the root's cube with the lowest coordinates, in metres.
    #[getter]
    fn origin_m(&self) -> (f32, f32, f32) {
        self.0.light.cube.origin_m.into()
    }

    /// Edge length of the root's cube, in metres.
    #[getter]
    fn edge_m(&self) -> f32 {
        self.0.light.cube.edge_m
    }

    /// The levels, from the root to the finest.
    #[getter]
    fn levels(&self) -> Vec<OctreeLevel> {
        (0..=self.depth()).map(|depth| OctreeLevel { estimate: self.0.clone(), depth: depth as usize }).collect()
    }

    /// Returns the leaves as arrays: centres in metres float32 [N, 3], edge lengths float32 [N], and RGBα float32
    /// [N, 4], coarse levels first.
    #[allow(clippy::type_complexity)]
    fn leaves<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let light = &self.0.light;
        let (centres, edges, rgba) = py.detach(|| {
            let (mut centres, mut edges, mut rgba) = (Vec::new(), Vec::new(), Vec::new());
            for leaf in light.octree.leaf_nodes() {
                centres.push(node_middle_m(light.cube, leaf.depth, light.octree.key(leaf)).to_array());
                edges.push(light.cube.node_edge_m(leaf.depth));
                rgba.push(light.rgba[leaf.depth as usize][leaf.row]);
            }
            (centres, edges, rgba)
        });
        Ok((arrays::of_rows(py, centres)?, arrays::of_values(py, edges), arrays::of_rows(py, rgba)?))
    }

    fn __repr__(&self) -> String {
        format!("<lightoctree.Octree: depth {}, {} leaves>", self.depth(), self.0.light.octree.leaf_nodes().count())
    }
}

/// The nodes of one depth, in the order of their shuffled keys. Non-empty nodes have a row of features.
#[pyclass(frozen, module = "lightoctree")]
pub struct OctreeLevel {
    estimate: Arc<Estimate>,
    depth: usize,
}

#[pymethods]
impl OctreeLevel {
    /// Shuffled key of each node, uint32 [N]: bits of x, y, z interleaved, x highest.
    #[getter]
    fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.estimate, |estimate| of_nodes(&estimate.light.octree.levels()[self.depth].keys))
    }

    /// Index of each node's first child in the next level, int32 [N]; −1 where it is not split.
    #[getter]
    fn children<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.estimate, |estimate| of_nodes(&estimate.light.octree.levels()[self.depth].children))
    }

    /// Feature row of each node, int32 [N]; −1 where it is empty.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.estimate, |estimate| of_nodes(&estimate.light.octree.levels()[self.depth].rows))
    }

    /// Linear radiance, and the opacity of one crossing, of each row, float32 [M, 4].
    #[getter]
    fn rgba<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.estimate, |estimate| of_features(&estimate.light.rgba[self.depth]))
    }

    /// Observed share of each row, uint8 [M], from 0 to 255.
    #[getter]
    fn seen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.estimate, |estimate| of_nodes(&estimate.light.seen[self.depth]))
    }

    /// Axis × sharpness of each row's spherical Gaussian, float32 [M, 3]; None if radiance does not depend on
    /// direction.
    #[getter]
    fn lobes<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        if self.estimate.light.lobes.is_none() {
            return Ok(None);
        }
        let lobes = arrays::view(py, &self.estimate, |estimate| match &estimate.light.lobes {
            Some(lobes) => of_features(&lobes[self.depth]),
            None => (&[][..], vec![0, 3]),
        });
        lobes.map(Some)
    }
}

fn of_nodes<T>(values: &[T]) -> (&[T], Vec<usize>) {
    (values, vec![values.len()])
}

fn of_features<T, const N: usize>(rows: &[[T; N]]) -> (&[T], Vec<usize>) {
    (rows.as_flattened(), vec![rows.len(), N])
}
