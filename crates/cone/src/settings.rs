use geometry::Vec3;
use serde::{Deserialize, Serialize};

/// A ray with an aperture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Apex in metres, world frame.
    pub origin: Vec3,
    /// Unit direction of the axis.
    pub direction: Vec3,
    /// Tangent of the half-angle; 0 for a single ray.
    pub tan_half_angle: f32,
}

/// What a cone sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Linear RGB radiance, already weighted by opacity (nothing is added for what is left over).
    pub radiance: [f32; 3],
    /// Expected distance in metres; the exit distance from the cube counts for what is left over.
    pub distance_m: f32,
    /// Share of the cone that met something, in [0, 1].
    pub opacity: f32,
}

/// How sample distances grow (SPEC §3).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum StepRule {
    /// `δₙ = c · sₙ₋₁ · tan θ`, as the paper writes it.
    Literal,
    /// The same, but never below this fraction of a leaf's edge.
    Floored(f32),
}

/// Weight `wₙ` of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SampleWeight {
    /// `wₙ = 1`: stored values are radiance.
    One,
    /// `wₙ = δₙ / sₙ`, as the paper writes it.
    Paper,
}

/// How the octree is read between node centres.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Sampling {
    /// The node that contains the sample.
    Nearest,
    /// Trilinear within a level and linear between levels.
    Interpolated,
}

/// All choices of the cone tracer; the default is what every command uses.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Growth of the distances.
    pub step: StepRule,
    /// The paper's `c`, the growth rate.
    pub growth: f32,
    /// The paper's `c₀`, the first distance, in leaf edges.
    pub first_step: f32,
    /// Weight of a sample.
    pub weight: SampleWeight,
    /// Reading between node centres.
    pub sampling: Sampling,
    /// A ray ends when its transmittance falls below this.
    pub min_transmittance: f32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            step: StepRule::Floored(0.5),
            growth: 1.0,
            first_step: 1.0,
            weight: SampleWeight::One,
            sampling: Sampling::Nearest,
            min_transmittance: 1e-4,
        }
    }
}
