//! What a picture's places say of gravity and lens: the perspective field of Jin et al. (CVPR 2023), and the camera that explains one best, as
//! GeoCalib (Veicht et al., ECCV 2024) fits it.

use crate::{DMat3, DVec3, Vec3};

/// What is known at one place of a picture. Places are in half lengths of the picture's longer side, from its middle: `[right, up]`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldCell {
    /// Where.
    pub at: [f64; 2],
    /// Unit direction in the picture, `[right, up]`, in which what is there moves when it is lifted.
    pub up: [f64; 2],
    /// Sine of the angle of the line of sight above the horizon.
    pub latitude_sin: f64,
    /// How much the direction and the latitude count: the inverse of the difference that is expected of them.
    pub certainty: [f64; 2],
}

impl FieldCell {
    /// Of the picture with left and right exchanged.
    pub fn mirrored(&self) -> Self {
        let other = |[right, up]: [f64; 2]| [-right, up];
        Self { at: other(self.at), up: other(self.up), ..*self }
    }
}

/// Estimate of the lens from the photo as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensGuess {
    /// Logarithm of [`Camera::half_extent`](crate::Camera::half_extent).
    pub log_half_extent: f64,
    /// Its standard deviation.
    pub deviation: f64,
}

/// Evidence of a photo's camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PerspectiveField {
    /// Perspective field, cell by cell.
    pub cells: Vec<FieldCell>,
    /// Estimate from the whole photo, if the network makes one.
    pub lens: Option<LensGuess>,
}

impl PerspectiveField {
    /// This field and that of the mirrored photo as one: the same witness twice.
    #[must_use]
    pub fn with_mirrored(mut self, mirrored: &Self) -> Self {
        self.cells.extend(mirrored.cells.iter().map(FieldCell::mirrored));
        self.lens = self.lens.zip(mirrored.lens).map(|(a, b)| LensGuess {
            log_half_extent: 0.5 * (a.log_half_extent + b.log_half_extent),
            deviation: 0.5 * (a.deviation + b.deviation),
        });
        self
    }
}

/// How a camera is held, and its lens.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Perspective {
    /// Unit direction in the camera's frame that is up.
    pub up: Vec3,
    /// [`Camera::half_extent`](crate::Camera::half_extent): tangent of half the field of view along the longer side.
    pub half_extent: f64,
}

/// The camera that explains a field best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerspectiveFit {
    /// It.
    pub camera: Perspective,
    /// How far off the direction of up is expected to be, degrees.
    pub up_deviation_deg: f64,
    /// How far off the field of view along the longer side is expected to be, degrees; 0 where the lens is known.
    pub fov_deviation_deg: f64,
}

/// Fields of view along the longer side at which the search begins, degrees.
const FIRST_FOV_DEG: [f64; 4] = [45.0, 60.0, 75.0, 95.0];
/// Fields of view that are believed, degrees.
const FOV_RANGE_DEG: [f64; 2] = [15.0, 140.0];
/// Multiples of the expected difference from which a cell counts linearly (Huber 1964).
const HUBER: f64 = 2.0;
const STEPS: usize = 30;
/// As many cells of a field as are wrong independently of each other: the others are wrong as their neighbours are.
const INDEPENDENT_CELLS: f64 = 4.0;
/// Fields of photos from places that no network has seen are also wrong as a whole: within so many times what independent parts would make of it are two thirds of
/// the directions of up and fields of view of 90 photos of the panoramas of `hdr_extra`, 45 to 110° wide.
const AS_A_WHOLE: f64 = 4.3;

impl Perspective {
    /// From the camera's turn to the right about its axis, its pitch upwards, and its lens.
    fn new(roll: f64, pitch: f64, half_extent: f64) -> Self {
        let up = DVec3::new(pitch.cos() * roll.sin(), pitch.cos() * roll.cos(), -pitch.sin());
        Self { up: up.as_vec3(), half_extent }
    }

    /// What it makes of a place: the direction of up there and the sine of the latitude.
    pub fn at(&self, [x, y]: [f64; 2]) -> ([f64; 2], f64) {
        field(self.up.as_dvec3(), self.half_extent, [x, y])
    }

    /// The camera that explains a field best, with the lens that is known, if one is; `None` without cells.
    pub fn fit(field: &PerspectiveField, half_extent: Option<f64>) -> Option<PerspectiveFit> {
        let cells = &field.cells;
        let lens = match (half_extent, field.lens) {
            (Some(_), _) => Lens::Known,
            (None, None) => Lens::Unknown,
            (None, Some(guess)) => Lens::Guessed(guess, witness(cells)),
        };
        let middle = cells.iter().min_by(|a, b| length(a.at).total_cmp(&length(b.at)))?;
        // In the middle the field is the camera's own roll and pitch.
        let (roll, pitch) = (middle.up[0].atan2(middle.up[1]), middle.latitude_sin.clamp(-1.0, 1.0).asin());
        let starts = match half_extent {
            Some(known) => vec![known],
            None => FIRST_FOV_DEG.map(|deg| (0.5 * deg).to_radians().tan()).to_vec(),
        };
        let fits = starts.into_iter().map(|start| descend(cells, [roll, pitch, start.ln()], lens));
        let (_, at) = fits.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let [roll, pitch, log_extent] = at;
        let camera = Self::new(roll, pitch, half_extent.unwrap_or(log_extent.exp()));
        let (_, normal) = slope(cells, at, lens);
        let variance = normal.inverse() * witness(cells);
        let variance = [variance.x_axis.x * pitch.cos().powi(2), variance.y_axis.y, variance.z_axis.z];
        let [roll, pitch, log_extent] = variance.map(|value| if value.is_finite() { value.max(0.0) } else { f64::MAX });
        // The angle is twice the arc tangent of the extent.
        let fov = 2.0 * camera.half_extent / (1.0 + camera.half_extent.powi(2)) * log_extent.sqrt();
        let within = |angle: f64| angle.to_degrees().min(180.0);
        Some(PerspectiveFit {
            camera,
            up_deviation_deg: within((roll + pitch).sqrt()),
            fov_deviation_deg: if half_extent.is_some() { 0.0 } else { within(fov) },
        })
    }
}

/// Knowledge of the lens in addition to the cells.
#[derive(Clone, Copy)]
enum Lens {
    Known,
    Unknown,
    /// With the number of equally certain cells that it counts as.
    Guessed(LensGuess, f64),
}

/// How many cells count as much as one that errs independently of all else.
fn witness(cells: &[FieldCell]) -> f64 {
    (cells.len() as f64 / INDEPENDENT_CELLS).max(1.0) * AS_A_WHOLE.powi(2)
}

fn length([x, y]: [f64; 2]) -> f64 {
    x.hypot(y)
}

fn field(up: DVec3, half_extent: f64, at: [f64; 2]) -> ([f64; 2], f64) {
    let [x, y] = at.map(|side| side * half_extent);
    // The derivative of a point's projection when the point moves up.
    let lifted = [up.x + x * up.z, up.y + y * up.z];
    let norm = length(lifted).max(1e-9);
    (lifted.map(|side| side / norm), DVec3::new(x, y, -1.0).normalize().dot(up))
}

/// Differences of a cell from what a camera says there, in multiples of those that are expected.
fn differences(cell: &FieldCell, [roll, pitch, log_extent]: [f64; 3]) -> [f64; 3] {
    let up = DVec3::new(pitch.cos() * roll.sin(), pitch.cos() * roll.cos(), -pitch.sin());
    let (direction, latitude_sin) = field(up, log_extent.exp(), cell.at);
    let [of_up, of_latitude] = cell.certainty;
    [
        of_up * (cell.up[0] - direction[0]),
        of_up * (cell.up[1] - direction[1]),
        of_latitude * (cell.latitude_sin - latitude_sin),
    ]
}

/// Huber's cost and the weight of the squares that has the same gradient.
fn robust(difference: f64) -> (f64, f64) {
    let size = difference.abs();
    if size <= HUBER { (0.5 * size * size, 1.0) } else { (HUBER * (size - 0.5 * HUBER), HUBER / size) }
}

fn cost(cells: &[FieldCell], parameters: [f64; 3], lens: Lens) -> f64 {
    let of_lens = match lens {
        Lens::Guessed(guess, weight) => {
            0.5 * weight * ((parameters[2] - guess.log_half_extent) / guess.deviation).powi(2)
        }
        Lens::Known | Lens::Unknown => 0.0,
    };
    let differences = cells.iter().flat_map(|cell| differences(cell, parameters));
    of_lens + differences.map(|difference| robust(difference).0).sum::<f64>()
}

/// Gradient of the cost and the matrix of the normal equations.
fn slope(cells: &[FieldCell], at: [f64; 3], lens: Lens) -> (DVec3, DMat3) {
    /// Of central differences.
    const STEP: f64 = 1e-5;
    let mut normal = DMat3::ZERO;
    let mut gradient = DVec3::ZERO;
    for cell in cells {
        let now = differences(cell, at);
        let slopes: [[f64; 3]; 3] = std::array::from_fn(|parameter| {
            let moved = |by: f64| {
                let mut moved = at;
                moved[parameter] += by;
                differences(cell, moved)
            };
            let (before, after) = (moved(-STEP), moved(STEP));
            std::array::from_fn(|i| (after[i] - before[i]) / (2.0 * STEP))
        });
        for i in 0..3 {
            let weight = robust(now[i]).1;
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
        Lens::Guessed(guess, weight) => {
            let certainty = weight / guess.deviation.powi(2);
            gradient.z += certainty * (at[2] - guess.log_half_extent);
            normal.z_axis.z += certainty;
        }
        Lens::Unknown => {}
    }
    (gradient, normal)
}

/// Levenberg and Marquardt's descent; gives the cost and the parameters.
fn descend(cells: &[FieldCell], first: [f64; 3], lens: Lens) -> (f64, [f64; 3]) {
    let [least, most] = FOV_RANGE_DEG.map(|deg| (0.5 * deg).to_radians().tan().ln());
    let mut at = first;
    let (mut value, mut damping) = (cost(cells, at, lens), 1e-3);
    for _ in 0..STEPS {
        let (gradient, normal) = slope(cells, at, lens);
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

    /// 30 × 20 cells of a camera's field.
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
    fn fields_are_what_lifted_points_do() {
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
            "saying it twice is no second witness"
        );
    }

    #[test]
    fn cameras_are_found_from_their_fields() {
        for (roll, pitch, fov_deg) in [(0.0, 0.0, 60.0), (0.14, 0.7, 40.0), (-0.1, -0.65, 95.0), (1.6, 0.1, 70.0f64)] {
            let of = Perspective::new(roll, pitch, (0.5 * fov_deg).to_radians().tan());
            let found = fit(&cells(of), None).unwrap().camera;
            assert!(angle_deg(found.up, of.up) < 0.05, "{of:?} {found:?}");
            // A level camera's field hardly changes with the lens, but it does.
            assert!((found.half_extent / of.half_extent - 1.0).abs() < 0.01, "{of:?} {found:?}");
            let known = fit(&cells(of), Some(of.half_extent)).unwrap().camera;
            assert!(angle_deg(known.up, of.up) < 0.05 && known.half_extent == of.half_extent, "{of:?} {known:?}");
        }
        assert_eq!(fit(&[], None), None);
    }

    #[test]
    fn a_guess_of_the_lens_counts_as_much_as_it_is_certain() {
        let of = Perspective::new(0.0, 0.2, 0.7);
        let with = |log_half_extent: f64, deviation: f64| {
            let field = PerspectiveField { cells: cells(of), lens: Some(LensGuess { log_half_extent, deviation }) };
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
        // As certain as the field is: about half way, and the deviation a √2 smaller.
        let both = with(0.7f64.ln() + 0.1, own);
        let moved = both.camera.half_extent.ln() - 0.7f64.ln();
        assert!((0.03..0.07).contains(&moved), "{moved}");
        assert!((log_deviation(both) / own - 0.5f64.sqrt()).abs() < 0.1, "{both:?} {alone:?}");
        let sure = with(1.0f64.ln(), 1e-4);
        assert!((sure.camera.half_extent - 1.0).abs() < 0.01, "{sure:?}");
        let twice =
            PerspectiveField { cells: cells(of), lens: Some(LensGuess { log_half_extent: 0.2, deviation: 0.1 }) }
                .with_mirrored(&PerspectiveField {
                    cells: cells(of),
                    lens: Some(LensGuess { log_half_extent: 0.4, deviation: 0.3 }),
                });
        let lens = twice.lens.unwrap();
        assert!((lens.log_half_extent - 0.3).abs() < 1e-12 && (lens.deviation - 0.2).abs() < 1e-12);
        assert_eq!(twice.cells[600], cells(of)[0].mirrored());
    }

    #[test]
    fn wrong_cells_cost_little_and_uncertain_ones_nothing() {
        let of = Perspective::new(0.05, 0.3, 0.6);
        let mut wrong = cells(of);
        // A tenth lies, as where a picture on the wall is tilted; a third of them says so.
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

    /// Cells of which one in so many is independent, and that are as wrong as they say.
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
        let (mut up, mut fov, mut said) = (0.0, 0.0, [0.0; 2]);
        for _ in 0..40 {
            let mut noisy = cells(of);
            noisy.truncate(600);
            // Blocks of 150 cells, a quarter of the field, are wrong alike.
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
            let apart = [found.up_deviation_deg, found.fov_deviation_deg].map(|deg| deg / AS_A_WHOLE);
            said = [said[0] + apart[0].powi(2) / 40.0, said[1] + apart[1].powi(2) / 40.0];
        }
        for (what, error, said) in [("up", up, said[0]), ("field of view", fov, said[1])] {
            let ratio = (error / said).sqrt();
            assert!((0.6..1.7).contains(&ratio), "{what}: {:.2}° off, {:.2}° said", error.sqrt(), said.sqrt());
        }
        let known = fit(&cells(of), Some(of.half_extent)).unwrap();
        assert!(known.fov_deviation_deg == 0.0 && known.up_deviation_deg < 5.0 * AS_A_WHOLE, "{known:?}");
    }
}
