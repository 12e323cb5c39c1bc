//! Perspective fields (Jin et al., CVPR 2023): per-pixel evidence of gravity and lens, and the camera fitted to one as
//! in GeoCalib (Veicht et al., ECCV 2024).

use crate::{DMat3, DVec3, Vec3};

/// One cell of a perspective field. Image positions are `[right, up]` from the image's centre, in units of half its
/// longer side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldCell {
    /// Image position.
    pub at: [f64; 2],
    /// Unit direction in the image, `[right, up]`: the projection of the world's up vector there.
    pub up: [f64; 2],
    /// Sine of the elevation of the viewing ray above the horizon.
    pub latitude_sin: f64,
    /// Weights of the up direction and of the latitude: the inverse of their expected errors.
    pub certainty: [f64; 2],
}

impl FieldCell {
    /// Returns the cell of the horizontally mirrored image.
    pub fn mirrored(&self) -> Self {
        let mirror = |[right, up]: [f64; 2]| [-right, up];
        Self { at: mirror(self.at), up: mirror(self.up), ..*self }
    }
}

/// Estimate of the lens from the whole photo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensEstimate {
    /// Logarithm of [`Camera::half_extent`](crate::Camera::half_extent).
    pub log_half_extent: f64,
    /// Standard deviation of the logarithm.
    pub deviation: f64,
}

/// Evidence of a photo's camera: its perspective field and, optionally, an estimate of its lens.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PerspectiveField {
    /// Cells of the perspective field.
    pub cells: Vec<FieldCell>,
    /// Estimate from the whole photo, if the network makes one.
    pub lens: Option<LensEstimate>,
}

impl PerspectiveField {
    /// Merges this field with that of the mirrored photo. The two count as one observation, not as independent ones.
    #[must_use]
    pub fn with_mirrored(mut self, mirrored: &Self) -> Self {
        self.cells.extend(mirrored.cells.iter().map(FieldCell::mirrored));
        self.lens = self.lens.zip(mirrored.lens).map(|(a, b)| LensEstimate {
            log_half_extent: 0.5 * (a.log_half_extent + b.log_half_extent),
            deviation: 0.5 * (a.deviation + b.deviation),
        });
        self
    }
}

/// Orientation against gravity, and lens, of a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perspective {
    /// Unit up vector in the camera's frame.
    pub up: Vec3,
    /// [`Camera::half_extent`](crate::Camera::half_extent): tangent of half the field of view along the longer side.
    pub half_extent: f64,
}

/// Result of [`Perspective::fit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerspectiveFit {
    /// The fitted camera.
    pub camera: Perspective,
    /// Expected error of the up vector, in degrees.
    pub up_deviation_deg: f64,
    /// Expected error of the field of view along the longer side, in degrees; 0 if the lens is known.
    pub fov_deviation_deg: f64,
}

/// Initial fields of view along the longer side, in degrees. The best of the fits is kept.
const INITIAL_FOV_DEG: [f64; 4] = [45.0, 60.0, 75.0, 95.0];
/// Range of plausible fields of view, in degrees.
const FOV_RANGE_DEG: [f64; 2] = [15.0, 140.0];
/// Multiples of the expected error beyond which the cost grows linearly (Huber 1964).
const HUBER: f64 = 2.0;
const MAX_STEPS: usize = 30;
/// Number of cells with independent errors; the errors of the others are correlated with their neighbours'.
const INDEPENDENT_CELLS: f64 = 4.0;
/// Ratio of actual errors to those expected of independent cells, since a field also errs as a whole.
///
/// Two thirds of the up vectors and fields of view are within this factor, on 90 photos (45° to 110° wide) of the
/// panoramas of `hdr_extra`, which no network was trained on.
const SYSTEMATIC_FACTOR: f64 = 4.3;

impl Perspective {
    /// Creates a perspective from the camera's roll (clockwise) and upward pitch, in radians, and its lens.
    fn new(roll: f64, pitch: f64, half_extent: f64) -> Self {
        let up = DVec3::new(pitch.cos() * roll.sin(), pitch.cos() * roll.cos(), -pitch.sin());
        Self { up: up.as_vec3(), half_extent }
    }

    /// Returns the up direction and the sine of the latitude at an image position.
    pub fn at(&self, [x, y]: [f64; 2]) -> ([f64; 2], f64) {
        field(self.up.as_dvec3(), self.half_extent, [x, y])
    }

    /// Fits a camera to a field, optionally with a known lens; `None` without cells.
    pub fn fit(field: &PerspectiveField, half_extent: Option<f64>) -> Option<PerspectiveFit> {
        let cells = &field.cells;
        let lens = match (half_extent, field.lens) {
            (Some(_), _) => Lens::Known,
            (None, None) => Lens::Unknown,
            (None, Some(guess)) => Lens::Estimated(guess, cell_correlation(cells)),
        };
        let middle = cells.iter().min_by(|a, b| length(a.at).total_cmp(&length(b.at)))?;
        // At the centre the field equals the camera's own roll and pitch.
        let (roll, pitch) = (middle.up[0].atan2(middle.up[1]), middle.latitude_sin.clamp(-1.0, 1.0).asin());
        let starts = match half_extent {
            Some(known) => vec![known],
            None => INITIAL_FOV_DEG.map(|deg| (0.5 * deg).to_radians().tan()).to_vec(),
        };
        let fits = starts.into_iter().map(|start| levenberg_marquardt(cells, [roll, pitch, start.ln()], lens));
        let (_, at) = fits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let [roll, pitch, log_extent] = at;
        let camera = Self::new(roll, pitch, half_extent.unwrap_or(log_extent.exp()));
        let (_, normal) = normal_equations(cells, at, lens);
        let variance = normal.inverse() * cell_correlation(cells);
        let variance = [variance.x_axis.x * pitch.cos().powi(2), variance.y_axis.y, variance.z_axis.z];
        let [roll, pitch, log_extent] = variance.map(|value| if value.is_finite() { value.max(0.0) } else { f64::MAX });
        // Derivative of the angle, twice the arctangent of the extent, by the logarithm of the extent.
        let fov = 2.0 * camera.half_extent / (1.0 + camera.half_extent.powi(2)) * log_extent.sqrt();
        let degrees = |angle: f64| angle.to_degrees().min(180.0);
        Some(PerspectiveFit {
            camera,
            up_deviation_deg: degrees((roll + pitch).sqrt()),
            fov_deviation_deg: if half_extent.is_some() { 0.0 } else { degrees(fov) },
        })
    }
}

/// Information about the lens in addition to the cells.
#[derive(Clone, Copy)]
enum Lens {
    Known,
    Unknown,
    /// An estimate with its weight: the number of equally certain cells that it counts as.
    Estimated(LensEstimate, f64),
}

/// Number of cells that together carry the weight of one with an independent error.
fn cell_correlation(cells: &[FieldCell]) -> f64 {
    (cells.len() as f64 / INDEPENDENT_CELLS).max(1.0) * SYSTEMATIC_FACTOR.powi(2)
}

fn length([x, y]: [f64; 2]) -> f64 {
    x.hypot(y)
}

fn field(up: DVec3, half_extent: f64, at: [f64; 2]) -> ([f64; 2], f64) {
    let [x, y] = at.map(|side| side * half_extent);
    // Derivative of a point's projection as the point moves up.
    let lifted = [up.x + x * up.z, up.y + y * up.z];
    let norm = length(lifted).max(1e-9);
    (lifted.map(|side| side / norm), DVec3::new(x, y, -1.0).normalize().dot(up))
}

/// Residuals of a cell against a camera, in multiples of the expected errors.
fn residuals(cell: &FieldCell, [roll, pitch, log_extent]: [f64; 3]) -> [f64; 3] {
    let up = DVec3::new(pitch.cos() * roll.sin(), pitch.cos() * roll.cos(), -pitch.sin());
    let (direction, latitude_sin) = field(up, log_extent.exp(), cell.at);
    let [of_up, of_latitude] = cell.certainty;
    [
        of_up * (cell.up[0] - direction[0]),
        of_up * (cell.up[1] - direction[1]),
        of_latitude * (cell.latitude_sin - latitude_sin),
    ]
}

/// Huber's cost, and the weight of a square with the same gradient.
fn huber(difference: f64) -> (f64, f64) {
    let size = difference.abs();
    if size <= HUBER { (0.5 * size * size, 1.0) } else { (HUBER * (size - 0.5 * HUBER), HUBER / size) }
}

fn cost(cells: &[FieldCell], parameters: [f64; 3], lens: Lens) -> f64 {
    let of_lens = match lens {
        Lens::Estimated(guess, weight) => {
            0.5 * weight * ((parameters[2] - guess.log_half_extent) / guess.deviation).powi(2)
        }
        Lens::Known | Lens::Unknown => 0.0,
    };
    let residuals = cells.iter().flat_map(|cell| residuals(cell, parameters));
    of_lens + residuals.map(|residual| huber(residual).0).sum::<f64>()
}

/// Gradient of the cost and the matrix of the normal equations.
fn normal_equations(cells: &[FieldCell], at: [f64; 3], lens: Lens) -> (DVec3, DMat3) {
    /// Step of the central differences.
    const STEP: f64 = 1e-5;
    let mut normal = DMat3::ZERO;
    let mut gradient = DVec3::ZERO;
    for cell in cells {
        let now = residuals(cell, at);
        let slopes: [[f64; 3]; 3] = std::array::from_fn(|parameter| {
            let moved = |by: f64| {
                let mut moved = at;
                moved[parameter] += by;
                residuals(cell, moved)
            };
            let (before, after) = (moved(-STEP), moved(STEP));
            std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * STEP))
        });
        for i in 0..3 {
            let weight = huber(now[i]).1;
            let slope = DVec3::new(slopes[0][i], slopes[1][i], slopes[2][i]);
            gradient += slope * (weight * now[i]);
            normal += DMat3::from_cols(slope * slope.x, slope * slope.y, slope * slope.z) * weight;
        }
    }
    match lens {
        Lens::Known => {
            gradient.z = 0.0;
            normal = DMat3::from_cols(
                DVec3::new(normal.x_axis.x, normal.x_axis.y, 0.0),
                DVec3::new(normal.y_axis.x, normal.y_axis.y, 0.0),
                DVec3::Z,
            );
        }
        Lens::Estimated(guess, weight) => {
            let certainty = weight / guess.deviation.powi(2);
            gradient.z += certainty * (at[2] - guess.log_half_extent);
            normal.z_axis.z += certainty;
        }
        Lens::Unknown => {}
    }
    (gradient, normal)
}

/// Minimises the cost by the Levenberg–Marquardt method. Returns the cost and the parameters.
fn levenberg_marquardt(cells: &[FieldCell], first: [f64; 3], lens: Lens) -> (f64, [f64; 3]) {
    let [least, most] = FOV_RANGE_DEG.map(|deg| (0.5 * deg).to_radians().tan().ln());
    let mut at = first;
    let (mut value, mut damping) = (cost(cells, at, lens), 1e-3);
    for _ in 0..MAX_STEPS {
        let (gradient, normal) = normal_equations(cells, at, lens);
        let diagonal = DVec3::new(normal.x_axis.x, normal.y_axis.y, normal.z_axis.z);
        let damped = normal + DMat3::from_diagonal(diagonal * damping + DVec3::splat(1e-9));
        let step = -(damped.inverse() * gradient);
        if !step.is_finite() {
            break;
        }
        let next =
            [at[0] + step.x, at[1] + step.y.clamp(-0.5, 0.5), (at[2] + step.z.clamp(-0.5, 0.5)).clamp(least, most)];
        let next = if matches!(lens, Lens::Known) { [next[0], next[1], at[2]] } else { next };
        let then = cost(cells, next, lens);
        if then < value {
            let settled = value - then < 1e-9 * value.max(1e-12);
            (at, value, damping) = (next, then, (0.3 * damping).max(1e-9));
            if settled {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e9 {
                break;
            }
        }
    }
    (value, at)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Camera;

    /// Field of a camera in 30 × 20 cells.
    fn cells(of: Perspective) -> Vec<FieldCell> {
        let places = (0..600).map(|i| [f64::from(i % 30) - 14.5, 9.5 - f64::from(i / 30)].map(|side| side / 15.0));
        let cell = |at| {
            let (up, latitude_sin) = of.at(at);
            FieldCell { at, up, latitude_sin, certainty: [20.0, 20.0] }
        };
        places.map(cell).collect()
    }

    fn fit(cells: &[FieldCell], half_extent: Option<f64>) -> Option<PerspectiveFit> {
        Perspective::fit(&PerspectiveField { cells: cells.to_vec(), lens: None }, half_extent)
    }

    fn angle_deg(a: Vec3, b: Vec3) -> f32 {
        a.angle_between(b).to_degrees()
    }

    #[test]
    fn fields_match_the_projection_of_lifted_points() {
        let camera = Camera::from_hfov_deg(70.0, 300, 200).unwrap();
        let of = Perspective::new(0.2, -0.35, camera.half_extent());
        for (u, v) in [(150.0, 100.0), (20.5, 180.5), (290.0, 11.0)] {
            let (up, latitude_sin) = of.at([(u - 150.0) / 150.0, (100.0 - v) / 150.0]);
            let point = camera.unproject(u, v, 2.0);
            let (u_lifted, v_lifted, _) = camera.project(point + of.up * 0.01).unwrap();
            let moved = [u_lifted - u, v - v_lifted];
            let norm = moved[0].hypot(moved[1]);
            assert!(
                (moved[0] / norm - up[0]).abs() < 0.01 && (moved[1] / norm - up[1]).abs() < 0.01,
                "{moved:?} {up:?}"
            );
            assert!((f64::from(point.normalize().dot(of.up)) - latitude_sin).abs() < 1e-6);
        }
    }

    #[test]
    fn a_mirrored_field_is_that_of_the_mirrored_camera() {
        let of = Perspective::new(0.3, 0.2, 0.7);
        let mirrored: Vec<_> = cells(of).iter().map(FieldCell::mirrored).collect();
        let found = fit(&mirrored, None).unwrap().camera;
        assert!(angle_deg(found.up, Vec3::new(-of.up.x, of.up.y, of.up.z)) < 0.05, "{found:?}");
        let both = [cells(of), mirrored.iter().map(FieldCell::mirrored).collect()].concat();
        let [once, twice] = [&cells(of), &both].map(|cells| fit(cells, None).unwrap());
        assert!(
            (twice.up_deviation_deg / once.up_deviation_deg - 1.0).abs() < 0.01,
            "the mirrored field is no independent observation"
        );
    }

    #[test]
    fn cameras_are_found_from_their_fields() {
        for (roll, pitch, fov_deg) in [(0.0, 0.0, 60.0), (0.14, 0.7, 40.0), (-0.1, -0.65, 95.0), (1.6, 0.1, 70.0f64)] {
            let of = Perspective::new(roll, pitch, (0.5 * fov_deg).to_radians().tan());
            let found = fit(&cells(of), None).unwrap().camera;
            assert!(angle_deg(found.up, of.up) < 0.05, "{of:?} {found:?}");
            // A level camera's field depends only weakly on the lens.
            assert!((found.half_extent / of.half_extent - 1.0).abs() < 0.01, "{of:?} {found:?}");
            let known = fit(&cells(of), Some(of.half_extent)).unwrap().camera;
            assert!(angle_deg(known.up, of.up) < 0.05 && known.half_extent == of.half_extent, "{of:?} {known:?}");
        }
        assert_eq!(fit(&[], None), None);
    }

    #[test]
    fn a_lens_estimate_is_weighted_by_its_certainty() {
        let of = Perspective::new(0.0, 0.2, 0.7);
        let with = |log_half_extent: f64, deviation: f64| {
            let field = PerspectiveField { cells: cells(of), lens: Some(LensEstimate { log_half_extent, deviation }) };
            Perspective::fit(&field, None).unwrap()
        };
        let alone = fit(&cells(of), None).unwrap();
        let log_deviation = |fit: PerspectiveFit| {
            let slope = 2.0 * fit.camera.half_extent / (1.0 + fit.camera.half_extent.powi(2));
            fit.fov_deviation_deg.to_radians() / slope
        };
        let own = log_deviation(alone);
        let unsure = with(1.0f64.ln(), 1e3);
        assert!((unsure.camera.half_extent - 0.7).abs() < 1e-3, "{unsure:?}");
        // An estimate as certain as the field: about half way, and a deviation smaller by √2.
        let both = with(0.7f64.ln() + 0.1, own);
        let moved = both.camera.half_extent.ln() - 0.7f64.ln();
        assert!((0.03..0.07).contains(&moved), "{moved}");
        assert!((log_deviation(both) / own - 0.5f64.sqrt()).abs() < 0.1, "{both:?} {alone:?}");
        let sure = with(1.0f64.ln(), 1e-4);
        assert!((sure.camera.half_extent - 1.0).abs() < 0.01, "{sure:?}");
        let twice =
            PerspectiveField { cells: cells(of), lens: Some(LensEstimate { log_half_extent: 0.2, deviation: 0.1 }) }
                .with_mirrored(&PerspectiveField {
                    cells: cells(of),
                    lens: Some(LensEstimate { log_half_extent: 0.4, deviation: 0.3 }),
                });
        let lens = twice.lens.unwrap();
        assert!((lens.log_half_extent - 0.3).abs() < 1e-12 && (lens.deviation - 0.2).abs() < 1e-12);
        assert_eq!(twice.cells[600], cells(of)[0].mirrored());
    }

    #[test]
    fn wrong_cells_cost_little_and_uncertain_ones_nothing() {
        let of = Perspective::new(0.05, 0.3, 0.6);
        let mut wrong = cells(of);
        // A tenth of the cells are outliers, as on a tilted picture on the wall; a third of these have a low weight.
        for (i, cell) in wrong.iter_mut().enumerate().filter(|(i, _)| i % 10 == 3) {
            (cell.up, cell.latitude_sin) = ([1.0, 0.0], 0.9);
            if i % 3 == 0 {
                cell.certainty = [1e-6; 2];
            }
        }
        let found = fit(&wrong, None).unwrap().camera;
        assert!(angle_deg(found.up, of.up) < 2.0, "{found:?}");
        assert!((found.half_extent / of.half_extent - 1.0).abs() < 0.08, "{found:?}");
    }

    /// Cells with correlated errors of the stated size.
    #[test]
    fn deviations_are_as_large_as_errors() {
        let (of, mut stream) = (Perspective::new(0.05, 0.3, 0.7), 7u32);
        let mut normal = || {
            let uniform = |state: &mut u32| {
                *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                f64::from(*state >> 8) / f64::from(1 << 24)
            };
            (0..12).map(|_| uniform(&mut stream)).sum::<f64>() - 6.0
        };
        let (mut up, mut fov, mut expected) = (0.0, 0.0, [0.0; 2]);
        for _ in 0..40 {
            let mut noisy = cells(of);
            noisy.truncate(600);
            // The cells of a block of 150, a quarter of the field, share their error.
            let wrong: [[f64; 2]; 4] = std::array::from_fn(|_| [normal(), normal()].map(|n| n / 20.0));
            for (i, cell) in noisy.iter_mut().enumerate() {
                let [turned, higher] = wrong[(i / 300) * 2 + usize::from(i % 30 >= 15)];
                let [x, y] = cell.up;
                cell.up = [x * turned.cos() + y * turned.sin(), y * turned.cos() - x * turned.sin()];
                cell.latitude_sin += higher;
            }
            let found = fit(&noisy, None).unwrap();
            up += f64::from(angle_deg(found.camera.up, of.up)).powi(2) / 40.0;
            let deg = |camera: Perspective| 2.0 * camera.half_extent.atan().to_degrees();
            fov += (deg(found.camera) - deg(of)).powi(2) / 40.0;
            let apart = [found.up_deviation_deg, found.fov_deviation_deg].map(|deg| deg / SYSTEMATIC_FACTOR);
            expected = [expected[0] + apart[0].powi(2) / 40.0, expected[1] + apart[1].powi(2) / 40.0];
        }
        for (what, error, expected) in [("up", up, expected[0]), ("field of view", fov, expected[1])] {
            let ratio = (error / expected).sqrt();
            assert!((0.6..1.7).contains(&ratio), "{what}: {:.2}° off, {:.2}° expected", error.sqrt(), expected.sqrt());
        }
        let known = fit(&cells(of), Some(of.half_extent)).unwrap();
        assert!(known.fov_deviation_deg == 0.0 && known.up_deviation_deg < 5.0 * SYSTEMATIC_FACTOR, "{known:?}");
    }
}
