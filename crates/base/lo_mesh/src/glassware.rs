//! Solid glass objects of everyday size.

use crate::{Material, MeshError, Model};

/// Segments around the axis.
const SEGMENTS: u32 = 96;

/// Points per curve between two given points of a profile.
const CURVE_STEPS: usize = 6;

impl Model {
    /// Creates an empty bottle of green glass, 30 cm high, with walls of 3 mm.
    ///
    /// # Errors
    /// Never, in practice.
    pub fn bottle() -> Result<Self, MeshError> {
        let outside = [
            [0.0, 0.004],
            [0.030, 0.0],
            [0.0365, 0.006],
            [0.0375, 0.03],
            [0.0375, 0.175],
            [0.033, 0.2],
            [0.0185, 0.225],
            [0.0145, 0.25],
            [0.014, 0.288],
        ];
        let lip = [[0.0155, 0.29], [0.0155, 0.298], [0.013, 0.3], [0.0105, 0.298]];
        let inside = [
            [0.0105, 0.25],
            [0.0145, 0.225],
            [0.0295, 0.2],
            [0.0343, 0.174],
            [0.0345, 0.03],
            [0.032, 0.012],
            [0.0, 0.018],
        ];
        let glass = Material::preset("green-glass").expect("it is a preset");
        Self::lathe(&[smooth(&outside), lip.to_vec(), smooth(&inside)].concat(), SEGMENTS, glass)
    }

    /// Creates an empty wine glass, 21 cm high, with walls of 1.2 mm.
    ///
    /// # Errors
    /// Never, in practice.
    pub fn wine_glass() -> Result<Self, MeshError> {
        let foot = [[0.0, 0.0], [0.035, 0.0], [0.036, 0.0012], [0.035, 0.0024]];
        let stem = [[0.012, 0.006], [0.0045, 0.02], [0.004, 0.06], [0.0055, 0.095]];
        let bowl = [[0.02, 0.107], [0.036, 0.128], [0.041, 0.15], [0.0385, 0.18], [0.0345, 0.209]];
        let lip = [[0.034, 0.21]];
        let inside =
            [[0.0334, 0.209], [0.0373, 0.18], [0.0398, 0.15], [0.0348, 0.1285], [0.0195, 0.109], [0.0, 0.1025]];
        let glass = Material::preset("glass").expect("it is a preset");
        let walls = [stem.as_slice(), &bowl].concat();
        Self::lathe(&[foot.to_vec(), smooth(&walls), lip.to_vec(), smooth(&inside)].concat(), SEGMENTS, glass)
    }
}

/// Interpolates between the points of an open curve (Catmull and Rom 1974).
fn smooth(points: &[[f32; 2]]) -> Vec<[f32; 2]> {
    let at = |i: usize| points[i.min(points.len() - 1)];
    let mut curve = Vec::new();
    for i in 0..points.len() - 1 {
        let [before, from, to, after] = [at(i.saturating_sub(1)), at(i), at(i + 1), at(i + 2)];
        for step in 0..CURVE_STEPS {
            let t = step as f32 / CURVE_STEPS as f32;
            curve.push([0, 1].map(|k| {
                let slope = |a: [f32; 2], b: [f32; 2]| 0.5 * (b[k] - a[k]);
                let (m0, m1) = (slope(before, to), slope(from, after));
                let (t2, t3) = (t * t, t * t * t);
                let value = (2.0 * t3 - 3.0 * t2 + 1.0) * from[k]
                    + (t3 - 2.0 * t2 + t) * m0
                    + (3.0 * t2 - 2.0 * t3) * to[k]
                    + (t3 - t2) * m1;
                value.max(0.0)
            }));
        }
    }
    curve.push(at(points.len() - 1));
    curve
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn glassware_is_as_large_and_as_heavy_as_real_one() {
        // A wine bottle of 0.75 l weighs 400 to 600 g, a wine glass 120 to 200 g; glass has 2.5 g/cm³.
        for (model, height, grams) in
            [(Model::bottle().unwrap(), 0.3, 250.0..600.0), (Model::wine_glass().unwrap(), 0.21, 60.0..220.0)]
        {
            let bounds = model.bounds();
            assert!((bounds.size().y - height).abs() < 1e-3, "{}", bounds.size());
            let mass = model.volume() * 2.5e6;
            assert!(grams.contains(&mass), "{mass} g");
            assert!(model.warnings.is_empty());
        }
    }
}
