use std::sync::Arc;

use lightoctree::Estimate;
use lightoctree::geometry::{Cube, Vec3};
use lightoctree::octree::{LightOctree, Provenance, RadiancePoint, node_middle_m};
use numpy::{PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyType;

use crate::arrays;
use crate::errors::Failure;
use crate::inputs::inputs;
use crate::job::{self, Handler};

/// A sparse voxel octree of radiance: a scene's, or one of surface points. Its arrays share its memory and are
/// read-only.
#[pyclass(frozen, module = "lightoctree")]
pub struct Octree(Arc<Holder>);

/// Least edge of a cube about points, in metres.
const LEAST_EDGE_M: f32 = 0.01;

/// Owner of an octree.
pub enum Holder {
    /// A scene.
    Estimate(Arc<Estimate>),
    /// An octree of its own.
    Light(LightOctree),
}

impl Holder {
    /// Returns the octree.
    pub fn light(&self) -> &LightOctree {
        match self {
            Self::Estimate(estimate) => &estimate.light,
            Self::Light(light) => light,
        }
    }
}

impl Octree {
    /// Returns the octree of an estimate.
    pub fn new(estimate: Arc<Estimate>) -> Self {
        Self(Arc::new(Holder::Estimate(estimate)))
    }

    /// Returns the owner of the octree.
    pub fn holder(&self) -> Arc<Holder> {
        self.0.clone()
    }
}

#[pymethods]
impl Octree {
    /// Builds an octree from surface points: positions in metres [N, 3] and their linear radiance [N, 3].
    ///
    /// Leaves of level `depth` hold the mean radiance of their points and are nearly opaque. Every node exists down to
    /// `full_depth`. `cube` is (x, y, z, edge): its lowest corner and its edge in metres; by default it encloses all
    /// points, with a margin of a twentieth.
    #[classmethod]
    #[pyo3(signature = (positions_m, radiance, *, depth = 7, full_depth = 3, cube = None))]
    fn from_points(
        _: &Bound<'_, PyType>,
        py: Python<'_>,
        positions_m: &Bound<'_, PyAny>,
        radiance: &Bound<'_, PyAny>,
        depth: u32,
        full_depth: u32,
        cube: Option<(f32, f32, f32, f32)>,
    ) -> PyResult<Self> {
        let of_argument = |argument: &str, values: &Bound<'_, PyAny>| {
            let values = inputs(py)?.call_method1("floats", (argument, values, false))?;
            rows::<3>(argument, &values.extract()?)
        };
        let positions_m = of_argument("positions_m", positions_m)?;
        let radiance = of_argument("radiance", radiance)?;
        if positions_m.len() != radiance.len() {
            let counts = format!("{} positions and {} values of radiance", positions_m.len(), radiance.len());
            return Err(PyValueError::new_err(format!("one radiance for each position is needed, not {counts}")));
        }
        let points: Vec<RadiancePoint> = positions_m
            .into_iter()
            .zip(radiance)
            .map(|(position_m, radiance)| RadiancePoint {
                position_m: position_m.into(),
                radiance,
                provenance: Provenance::Observed,
            })
            .collect();
        let cube = match cube {
            Some((x, y, z, edge_m)) => Cube { origin_m: Vec3::new(x, y, z), edge_m },
            None => enclosing(&points).ok_or_else(|| PyValueError::new_err("positions_m has no finite position"))?,
        };
        job::run(py, Handler::Silent, move |reporter| {
            let built = LightOctree::from_points(&points, cube, depth, full_depth);
            let (light, report) = built.map_err(|error| Failure::new("SceneError", error))?;
            if report.outside + report.not_finite > 0 {
                reporter.warn(format!(
                    "{} points are outside of the cube, {} are NaN or infinite: left out",
                    report.outside, report.not_finite
                ));
            }
            Ok(Self(Arc::new(Holder::Light(light))))
        })
    }

    /// Copies the radiance and opacity of all rows of all levels, the root's first: float32 [rows, 4].
    #[getter]
    fn rgba<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::of_rows(py, self.0.light().rgba.concat())
    }

    /// Depth of the finest level; the root's is 0.
    #[getter]
    fn depth(&self) -> u32 {
        self.0.light().octree.depth()
    }

    /// Depth down to which every node exists.
    #[getter]
    fn full_depth(&self) -> u32 {
        self.0.light().octree.full_depth()
    }

    /// Corner of the root's cube with the lowest coordinates, in metres.
    #[getter]
    fn origin_m(&self) -> (f32, f32, f32) {
        self.0.light().cube.origin_m.into()
    }

    /// Edge length of the root's cube, in metres.
    #[getter]
    fn edge_m(&self) -> f32 {
        self.0.light().cube.edge_m
    }

    /// The levels, from the root to the finest.
    #[getter]
    fn levels(&self) -> Vec<OctreeLevel> {
        (0..=self.depth()).map(|depth| OctreeLevel { holder: self.0.clone(), depth: depth as usize }).collect()
    }

    /// Returns the leaves as arrays: centres in metres float32 [N, 3], edge lengths float32 [N], and RGBα float32
    /// [N, 4], coarse levels first.
    #[allow(clippy::type_complexity)]
    fn leaves<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let light = self.0.light();
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
        format!("<lightoctree.Octree: depth {}, {} leaves>", self.depth(), self.0.light().octree.leaf_nodes().count())
    }
}

/// The nodes of one depth, in the order of their shuffled keys. Non-empty nodes have a row of features.
#[pyclass(frozen, module = "lightoctree")]
pub struct OctreeLevel {
    holder: Arc<Holder>,
    depth: usize,
}

#[pymethods]
impl OctreeLevel {
    /// Shuffled key of each node, uint32 [N]: bits of x, y, z interleaved, x highest.
    #[getter]
    fn keys<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.holder, |holder| of_nodes(&holder.light().octree.levels()[self.depth].keys))
    }

    /// Index of each node's first child in the next level, int32 [N]; −1 where it is not split.
    #[getter]
    fn children<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.holder, |holder| of_nodes(&holder.light().octree.levels()[self.depth].children))
    }

    /// Feature row of each node, int32 [N]; −1 where it is empty.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.holder, |holder| of_nodes(&holder.light().octree.levels()[self.depth].rows))
    }

    /// Linear radiance, and the opacity of one crossing, of each row, float32 [M, 4].
    #[getter]
    fn rgba<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.holder, |holder| of_features(&holder.light().rgba[self.depth]))
    }

    /// Observed share of each row, uint8 [M], from 0 to 255.
    #[getter]
    fn seen<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        arrays::view(py, &self.holder, |holder| of_nodes(&holder.light().seen[self.depth]))
    }

    /// Axis × sharpness of each row's spherical Gaussian, float32 [M, 3]; None if radiance does not depend on
    /// direction.
    #[getter]
    fn lobes<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        if self.holder.light().lobes.is_none() {
            return Ok(None);
        }
        let lobes = arrays::view(py, &self.holder, |holder| match &holder.light().lobes {
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

/// Copies the rows of an array of shape [N, W].
///
/// # Errors
/// `ValueError` if it has another shape.
pub fn rows<const W: usize>(argument: &str, array: &PyReadonlyArray2<'_, f32>) -> PyResult<Vec<[f32; W]>> {
    match (array.shape(), array.as_slice()) {
        (&[_, width], Ok(values)) if width == W => Ok(values.as_chunks::<W>().0.to_vec()),
        (shape, _) => {
            Err(PyValueError::new_err(format!("{argument} has the shape {shape:?}; expected [N, {W}] in C order")))
        }
    }
}

/// Returns a cube about all finite points, with a margin.
fn enclosing(points: &[RadiancePoint]) -> Option<Cube> {
    let finite = || points.iter().map(|point| point.position_m).filter(|position| position.is_finite());
    let least = finite().reduce(Vec3::min)?;
    let most = finite().reduce(Vec3::max)?;
    let edge_m = (1.05 * (most - least).max_element()).max(LEAST_EDGE_M);
    Some(Cube::centred(0.5 * (least + most), edge_m))
}
