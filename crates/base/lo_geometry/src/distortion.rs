use serde::{Deserialize, Serialize};

/// Distortion of a lens, as OpenCV and COLMAP define it.
///
/// Coordinates are in focal lengths from the principal point, +x right and +y down: a point at depth 1 is at its own
/// `x, y` without distortion.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Distortion {
    /// Brown–Conrady: OpenCV's `k1 k2 p1 p2 k3 k4 k5 k6`.
    Brown {
        /// `k1` to `k6`; the last three are the denominator's.
        radial: [f64; 6],
        /// `p1 p2`.
        tangential: [f64; 2],
    },
    /// Fisheye (Kannala–Brandt): OpenCV's `k1` to `k4`, of the angle from the axis.
    Fisheye([f64; 4]),
}

/// Largest radius for which distortion is defined: 84° from the axis.
const MAX_RADIUS: f64 = 10.0;

/// Steps at which the radial function is checked.
const STEPS: u32 = 400;

impl Distortion {
    /// Creates a Brown distortion from its first coefficients in OpenCV's order, `k1 k2 p1 p2 k3 k4 k5 k6`.
    pub fn brown(coefficients: &[f64]) -> Self {
        let at = |index: usize| coefficients.get(index).copied().unwrap_or(0.0);
        Self::Brown { radial: [at(0), at(1), at(4), at(5), at(6), at(7)], tangential: [at(2), at(3)] }
    }

    /// Whether all coefficients are finite.
    pub fn is_finite(&self) -> bool {
        match self {
            Self::Brown { radial, tangential } => radial.iter().chain(tangential).all(|k| k.is_finite()),
            Self::Fisheye(k) => k.iter().all(|k| k.is_finite()),
        }
    }

    /// Whether every point stays where it is.
    pub fn is_identity(&self) -> bool {
        *self == Self::brown(&[])
    }

    /// Returns where the lens shows an ideal point.
    pub fn distorted(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let scale = self.radial_scale(x.hypot(y));
        match *self {
            Self::Brown { tangential: [p1, p2], .. } => {
                let r2 = x * x + y * y;
                [
                    x * scale + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                    y * scale + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
                ]
            }
            Self::Fisheye(_) => [x * scale, y * scale],
        }
    }

    /// Returns the ideal point that the lens shows at a point, by Newton's method; `None` if there is none.
    pub fn undistorted(&self, shown: [f64; 2]) -> Option<[f64; 2]> {
        const STEP: f64 = 1e-6;
        let max_radius = self.max_radius();
        let mut at = shown;
        for _ in 0..50 {
            let f = self.distorted(at);
            let error = [f[0] - shown[0], f[1] - shown[1]];
            if error[0].hypot(error[1]) < 1e-10 {
                return (at[0].hypot(at[1]) <= max_radius).then_some(at);
            }
            let right = self.distorted([at[0] + STEP, at[1]]);
            let down = self.distorted([at[0], at[1] + STEP]);
            let [a, c] = [(right[0] - f[0]) / STEP, (right[1] - f[1]) / STEP];
            let [b, d] = [(down[0] - f[0]) / STEP, (down[1] - f[1]) / STEP];
            let determinant = a * d - b * c;
            let move_by = [(d * error[0] - b * error[1]) / determinant, (a * error[1] - c * error[0]) / determinant];
            // A step of more than the distance to the axis would leave the function's increasing part.
            let limit = (0.5 * (1.0 + at[0].hypot(at[1])) / move_by[0].hypot(move_by[1])).min(1.0);
            at = [at[0] - limit * move_by[0], at[1] - limit * move_by[1]];
            if !(at[0].is_finite() && at[1].is_finite()) {
                return None;
            }
        }
        None
    }

    /// Largest radius of an ideal point up to which the distorted radius increases; beyond it the model folds over.
    pub fn max_radius(&self) -> f64 {
        let radius = |step: u32| MAX_RADIUS * f64::from(step) / f64::from(STEPS);
        let shown = |step: u32| radius(step) * self.radial_scale(radius(step));
        let folds = (1..=STEPS).find(|&step| shown(step) <= shown(step - 1) || !shown(step).is_finite());
        folds.map_or(MAX_RADIUS, |step| radius(step - 1))
    }

    fn radial_scale(&self, radius: f64) -> f64 {
        match *self {
            Self::Brown { radial: [k1, k2, k3, k4, k5, k6], .. } => {
                let r2 = radius * radius;
                (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
            }
            Self::Fisheye(_) if radius < 1e-9 => 1.0,
            Self::Fisheye([k1, k2, k3, k4]) => {
                let angle = radius.atan();
                let a2 = angle * angle;
                angle * (1.0 + a2 * (k1 + a2 * (k2 + a2 * (k3 + a2 * k4)))) / radius
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn points_are_where_opencv_puts_them() {
        // By OpenCV's formulas in Python, in double precision.
        let brown = Distortion::brown(&[-0.25, 0.05, 0.001, -0.002, 0.01]);
        let [x, y] = brown.distorted([0.4, -0.3]);
        // r² = 0.25: 1 − 0.0625 + 0.003125 + 0.00015625 = 0.94078125
        let expected =
            [0.4 * 0.94078125 - 0.00024 - 0.002 * 0.57, -0.3 * 0.94078125 + 0.001 * 0.43 + 2.0 * 0.002 * 0.12];
        assert!((x - expected[0]).abs() < 1e-12 && (y - expected[1]).abs() < 1e-12, "{x} {y}");
        // At 45° a fisheye without coefficients shows π/4.
        let [x, y] = Distortion::Fisheye([0.0; 4]).distorted([1.0, 0.0]);
        assert!((x - std::f64::consts::FRAC_PI_4).abs() < 1e-12 && y == 0.0);
        assert!(Distortion::brown(&[0.0; 5]).is_identity() && !Distortion::Fisheye([0.0; 4]).is_identity());
    }

    #[test]
    fn strong_barrels_end_where_they_fold() {
        // r − 0.25 r³ increases up to r = √(4 / 3).
        let limit = Distortion::brown(&[-0.25]).max_radius();
        assert!((limit - (4.0f64 / 3.0).sqrt()).abs() < 0.03, "{limit}");
        assert_eq!(Distortion::brown(&[0.1]).max_radius(), MAX_RADIUS);
        // Its largest distorted radius is 2 / 3 of that.
        assert_eq!(Distortion::brown(&[-0.25]).undistorted([0.9, 0.0]), None);
    }

    proptest! {
        #[test]
        fn undistorted_inverts_distorted(x in -0.8..0.8f64, y in -0.8..0.8f64, k1 in -0.2..0.3f64, p in -0.01..0.01f64) {
            for lens in [Distortion::brown(&[k1, 0.05, p, -p]), Distortion::Fisheye([0.2 * k1, 0.01, 0.0, 0.0])] {
                let back = lens.undistorted(lens.distorted([x, y])).unwrap();
                prop_assert!((back[0] - x).abs() < 1e-8 && (back[1] - y).abs() < 1e-8, "{lens:?}: {back:?}");
            }
        }
    }
}
