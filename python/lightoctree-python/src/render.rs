//! Cone tracing of octrees with given features, and its gradient.

use std::sync::Arc;

use lightoctree::cone::{Cone, ConeSample, ConeTracer, SampleGradient, Settings};
use lightoctree::octree::LightOctree;
use numpy::{PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::arrays;
use crate::errors::Failure;
use crate::job::{self, Handler};
use crate::octree::{Holder, Octree, rows};

/// Values of a sample: radiance, expected distance in metres, opacity.
const SAMPLE: usize = 5;

/// Traces cones through an octree whose rows have these features. `lightoctree.render` checks and documents this.
#[pyfunction]
pub fn trace<'py>(
    py: Python<'py>,
    octree: &Octree,
    origins: PyReadonlyArray2<'_, f32>,
    directions: PyReadonlyArray2<'_, f32>,
    tan_half_angles: PyReadonlyArray1<'_, f32>,
    rgba: Option<PyReadonlyArray2<'_, f32>>,
) -> PyResult<Bound<'py, PyAny>> {
    let job = Job::new(octree, &origins, &directions, &tan_half_angles, rgba.as_ref())?;
    let samples = job::run(py, Handler::Silent, move |_| {
        let mut samples = vec![ConeSample::default(); job.cones.len()];
        job.tracer()?.trace_batch(&job.cones, &mut samples);
        Ok(samples.into_iter().map(values).collect())
    })?;
    arrays::of_rows(py, samples)
}

/// Computes the derivative of a loss by the features of all rows, from its derivatives by the samples.
#[pyfunction]
pub fn trace_backward<'py>(
    py: Python<'py>,
    octree: &Octree,
    origins: PyReadonlyArray2<'_, f32>,
    directions: PyReadonlyArray2<'_, f32>,
    tan_half_angles: PyReadonlyArray1<'_, f32>,
    d_samples: PyReadonlyArray2<'_, f32>,
    rgba: Option<PyReadonlyArray2<'_, f32>>,
) -> PyResult<Bound<'py, PyAny>> {
    let job = Job::new(octree, &origins, &directions, &tan_half_angles, rgba.as_ref())?;
    let d_samples: Vec<SampleGradient> = rows::<SAMPLE>("d_samples", &d_samples)?
        .into_iter()
        .map(|[r, g, b, distance_m, opacity]| SampleGradient { radiance: [r, g, b], distance_m, opacity })
        .collect();
    if d_samples.len() != job.cones.len() {
        let counts = format!("{} derivatives for {} cones", d_samples.len(), job.cones.len());
        return Err(PyValueError::new_err(format!("d_samples: {counts}")));
    }
    let gradient =
        job::run(py, Handler::Silent, move |_| Ok(job.tracer()?.trace_backward(&job.cones, &d_samples).rgba.concat()))?;
    arrays::of_rows(py, gradient)
}

/// Cones and the octree that they are traced through.
struct Job {
    octree: Arc<Holder>,
    /// Features of all rows, instead of the octree's own.
    rgba: Option<Vec<[f32; 4]>>,
    cones: Vec<Cone>,
}

impl Job {
    fn new(
        octree: &Octree,
        origins: &PyReadonlyArray2<'_, f32>,
        directions: &PyReadonlyArray2<'_, f32>,
        tan_half_angles: &PyReadonlyArray1<'_, f32>,
        rgba: Option<&PyReadonlyArray2<'_, f32>>,
    ) -> PyResult<Self> {
        let origins = rows::<3>("origins", origins)?;
        let directions = rows::<3>("directions", directions)?;
        let angles = tan_half_angles.as_slice()?;
        if origins.len() != directions.len() || origins.len() != tan_half_angles.len() {
            return Err(PyValueError::new_err("origins, directions and half-angles must be as many"));
        }
        let cones = origins.iter().zip(&directions).zip(angles).map(|((&origin, &direction), &tan_half_angle)| Cone {
            origin: origin.into(),
            direction: direction.into(),
            tan_half_angle,
        });
        let cones = cones.collect();
        let octree = octree.holder();
        let rgba = rgba.map(|rgba| rows::<4>("rgba", rgba)).transpose()?;
        let expected: usize = octree.light().rgba.iter().map(Vec::len).sum();
        if let Some(rgba) = rgba.as_ref().filter(|rgba| rgba.len() != expected) {
            let counts = format!("rgba has {} rows, the octree has {expected}", rgba.len());
            return Err(PyValueError::new_err(counts));
        }
        Ok(Self { octree, rgba, cones })
    }

    fn tracer(&self) -> Result<ConeTracer, Failure> {
        let own = self.octree.light();
        let tracer = match &self.rgba {
            None => ConeTracer::new(own, Settings::default()),
            Some(rgba) => {
                let mut rest = rgba.iter().copied();
                let rgba = own.rgba.iter().map(|level| rest.by_ref().take(level.len()).collect()).collect();
                let (octree, lobes) = (own.octree.clone(), own.lobes.clone());
                let light = LightOctree { octree, cube: own.cube, rgba, seen: Vec::new(), lobes };
                ConeTracer::new(&light, Settings::default())
            }
        };
        tracer.map_err(|error| Failure::new("SceneError", error))
    }
}

fn values(sample: ConeSample) -> [f32; SAMPLE] {
    let [r, g, b] = sample.radiance;
    [r, g, b, sample.distance_m, sample.opacity]
}
