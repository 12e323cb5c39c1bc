//! Estimation of the up direction.

use lo_geometry::{Mat3, Vec3, fibonacci_sphere};
use lo_imaging::Image;
use lo_scene::{Frame, Surfel};

use crate::layout::{area, area_of};

/// Greatest tilt of the camera: cos 50°, five degrees of slack over the stated ±45°.
const MIN_COS_TILT: f32 = 0.643;

/// Greatest number of normals that vote.
const VOTES: usize = 3000;

/// Least standard deviation of a hint for up: predictors are overconfident.
const MIN_DEVIATION_DEG: f32 = 6.0;

/// Greatest deviation of up from the hint, in standard deviations.
const MAX_DEVIATIONS: f32 = 3.0;

/// Weight of the hint, as a horizontal surface with this share of all observed area.
const HINT_SHARE: f32 = 0.01;

/// Sines within which surfaces count as horizontal or vertical, per refinement step.
const WIDTHS: [f32; 4] = [0.10, 0.07, 0.05, 0.05];

/// Number of search directions near a hint, over the whole sphere: 1.6° apart.
const NEAR_DIRECTIONS: usize = 16_000;

/// A normal with the area that it represents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet {
    pub normal: Vec3,
    pub area: f32,
}

impl From<&Surfel> for Facet {
    fn from(surfel: &Surfel) -> Self {
        Self { normal: surfel.normal, area: area(surfel) }
    }
}

/// Returns the unit vector against gravity that explains most surfaces as horizontal or vertical, at most 50° from the
/// camera's up. Without votes, returns the camera's up.
///
/// A coarse search over directions 3° apart is followed by a few steps of least squares: the smallest eigenvector of
/// `Σ_vertical n nᵀ − Σ_horizontal n nᵀ`. Upward surfaces (floors, tables) count most, then walls, then downward ones.
pub(crate) fn up_from_facets(facets: &[Facet]) -> Vec3 {
    let votes = subsampled(facets);
    let score = |up: Vec3| {
        let sum: f32 = votes.iter().map(|f| f.area * vote(f.normal.dot(up), 0.10)).sum();
        // Photos are held roughly level: at 45° a direction needs half as much support again to win.
        sum * (0.3 + 0.7 * up.y)
    };
    let candidates = fibonacci_sphere(4000).into_iter().filter(|d| d.y >= MIN_COS_TILT).chain([Vec3::Y]);
    let mut best = (0.0, Vec3::Y);
    for candidate in candidates {
        let score = score(candidate);
        if score > best.0 {
            best = (score, candidate);
        }
    }
    let mut up = best.1;
    for width in WIDTHS {
        up = refined(&votes, up, width, Facet { normal: up, area: 0.0 });
    }
    if up.y >= MIN_COS_TILT { up } else { best.1 }
}

/// Returns the unit vector against gravity that explains the observed surfaces, near the hint `hint` with this standard
/// deviation.
///
/// Directions are searched within three standard deviations of `hint`, weighted by a Gaussian. The least squares
/// include a horizontal surface perpendicular to `hint` with a hundredth of the observed area; where only one wall is
/// observed, it determines the rest.
pub fn up_near(seen: &[Surfel], hint: Vec3, deviation_deg: f32) -> Vec3 {
    let facets: Vec<Facet> = seen.iter().map(Facet::from).collect();
    let votes = subsampled(&facets);
    let total: f32 = votes.iter().map(|f| f.area).sum();
    let deviation_deg = deviation_deg.max(MIN_DEVIATION_DEG);
    let off = |up: Vec3| up.dot(hint).clamp(-1.0, 1.0).acos().to_degrees() / deviation_deg;
    let score = |up: Vec3| {
        let sum: f32 = votes.iter().map(|f| f.area * vote(f.normal.dot(up), WIDTHS[0])).sum();
        sum * (-0.5 * off(up).powi(2)).exp()
    };
    let near = fibonacci_sphere(NEAR_DIRECTIONS).into_iter().filter(|&direction| off(direction) <= MAX_DEVIATIONS);
    let scored = near.map(|candidate| (score(candidate), candidate));
    let best = scored.fold((score(hint), hint), |best, next| if next.0 > best.0 { next } else { best }).1;
    let facet = Facet { normal: hint, area: HINT_SHARE * total };
    let up = WIDTHS.into_iter().fold(best, |up, width| refined(&votes, up, width, facet));
    if off(up) <= MAX_DEVIATIONS { up } else { hint }
}

/// Returns the unit vector against gravity for a frame whose depth was predicted and is wavy: the likeliest camera
/// orientation.
///
/// Prior: cameras are pitched by 20° or so, but hardly rolled (3°). Normals are used within 30°, and the fourth power
/// of their support is weighed against the prior. Pitch is resolved to 1.5°, up to 45°, roll to 2°, up to 6°.
///
/// `normals`, of the depth map's size, override the normals of the depth map.
///
/// # Panics
/// If `normals` have a different size.
pub fn up_from_predicted_depth(frame: &Frame, normals: Option<&Image<Option<Vec3>>>) -> Vec3 {
    const WIDTH: f32 = 0.5;
    const STRENGTH: f32 = 4.0;
    const SPREAD_DEG: [f32; 2] = [20.0, 3.0];
    const STEPS_DEG: [f32; 2] = [1.5, 2.0];
    let (camera, depth_m) = (frame.depth_camera(), &frame.depth_m);
    let normals = normals.cloned().unwrap_or_else(|| frame.normals());
    assert_eq!(
        (normals.width(), normals.height()),
        (depth_m.width(), depth_m.height()),
        "one normal for each depth pixel"
    );
    let facets: Vec<Facet> = (0..normals.height())
        .flat_map(|y| (0..normals.width()).map(move |x| (x, y)))
        .filter_map(|at| {
            let normal = normals[at].filter(|_| depth_m[at] > 0.0)?;
            let position_m = camera.unproject(at.0 as f64 + 0.5, at.1 as f64 + 0.5, f64::from(depth_m[at]));
            Some(Facet { normal, area: area_of(position_m, depth_m[at], normal) })
        })
        .collect();
    let votes = subsampled(&facets);
    let total: f32 = votes.iter().map(|facet| facet.area).sum();
    let mut best = (f32::NEG_INFINITY, Vec3::Y);
    for (pitch, roll) in (-30..=30).flat_map(|pitch| (-3..=3).map(move |roll| (pitch, roll))) {
        let held_deg = [pitch as f32 * STEPS_DEG[0], roll as f32 * STEPS_DEG[1]];
        let [(sin_pitch, cos_pitch), (sin_roll, cos_roll)] = held_deg.map(|angle| angle.to_radians().sin_cos());
        let up = Vec3::new(sin_roll * cos_pitch, cos_roll * cos_pitch, sin_pitch);
        let support: f32 = votes.iter().map(|facet| facet.area * vote(facet.normal.dot(up), WIDTH)).sum();
        let unlikely: f32 = held_deg.iter().zip(SPREAD_DEG).map(|(angle, spread)| 0.5 * (angle / spread).powi(2)).sum();
        let score = STRENGTH * (support / total.max(f32::MIN_POSITIVE) + 1e-3).ln() - unlikely;
        if score > best.0 {
            best = (score, up);
        }
    }
    best.1
}

/// Returns at most [`VOTES`] facets, evenly spaced.
fn subsampled(facets: &[Facet]) -> Vec<Facet> {
    facets.iter().copied().step_by(facets.len().div_ceil(VOTES).max(1)).collect()
}

/// Returns the support of a normal at `cosine` from the candidate, for a tolerance of `width` in sine.
fn vote(cosine: f32, width: f32) -> f32 {
    let near = |sine: f32| (1.0 - (sine / width).powi(2)).max(0.0);
    if cosine.abs() < width {
        0.5 * near(cosine)
    } else {
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        near(sine) * if cosine > 0.0 { 1.0 } else { 0.4 }
    }
}

/// Performs one step of least squares: finds the direction most parallel to the normals of horizontal surfaces,
/// including `hint`, and perpendicular to those of vertical ones.
fn refined(votes: &[Facet], up: Vec3, width: f32, hint: Facet) -> Vec3 {
    let outer = |n: Vec3| Mat3::from_cols(n * n.x, n * n.y, n * n.z);
    let mut scatter = outer(hint.normal) * -hint.area;
    let mut total = hint.area;
    for facet in votes {
        let cosine = facet.normal.dot(up);
        let weight = facet.area * vote(cosine, width);
        let sign = if cosine.abs() < width { 1.0 } else { -1.0 };
        scatter += outer(facet.normal) * (sign * weight);
        total += weight;
    }
    if total <= 0.0 {
        return up;
    }
    // Power iteration on (shift − scatter): its greatest eigenvector is the smallest of the scatter.
    let shifted = Mat3::IDENTITY * 1.01 - scatter * (1.0 / total);
    let mut direction = up;
    for _ in 0..32 {
        direction = (shifted * direction).normalize_or(up);
    }
    direction
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_geometry::{Camera, Plane, Ray};
    use lo_imaging::{Image, Photo};

    use super::*;

    fn facets(directions: &[(Vec3, f32)]) -> Vec<Facet> {
        let mut state = 7u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 23) as f32 - 1.0
        };
        let mut all = Vec::new();
        for &(direction, area) in directions {
            for _ in 0..500 {
                let jitter = Vec3::new(noise(), noise(), noise()) * 0.05;
                all.push(Facet { normal: (direction + jitter).normalize(), area });
            }
        }
        all
    }

    #[test]
    fn tilted_rooms_stand_up() {
        for (pitch, roll) in [(0.0f32, 0.0f32), (0.6, 0.1), (-0.5, -0.2), (0.75, 0.0)] {
            let turn = Mat3::from_rotation_x(pitch) * Mat3::from_rotation_z(roll);
            let room = [(Vec3::Y, 1.0), (Vec3::Z, 0.8), (Vec3::X, 0.6), (Vec3::new(0.5, 0.5, 0.7).normalize(), 0.5)];
            let found = up_from_facets(&facets(&room.map(|(d, a)| (turn * d, a))));
            let angle_deg = found.dot(turn * Vec3::Y).min(1.0).acos().to_degrees();
            assert!(angle_deg < 0.7, "pitch {pitch} roll {roll}: {angle_deg}°");
        }
    }

    fn surfels(directions: &[(Vec3, f32)]) -> Vec<Surfel> {
        let of = |facet: Facet| {
            let (position_m, depth_m) = (facet.normal * -facet.area.sqrt(), facet.area.sqrt());
            let (radiance, provenance, eye_m) = ([0.5; 3], lo_octree::Provenance::Observed, Vec3::ZERO);
            Surfel { position_m, normal: facet.normal, radiance, provenance, eye_m, depth_m }
        };
        facets(directions).into_iter().map(of).collect()
    }

    #[test]
    fn surfaces_decide_near_a_hint() {
        let off_deg = |a: Vec3, b: Vec3| a.angle_between(b).to_degrees();
        let hint = Mat3::from_rotation_x(5f32.to_radians()) * Vec3::Y;
        // A floor, and a steep desk of more area, which alone would be taken for the floor.
        let desk = Mat3::from_rotation_x(0.6) * Vec3::Y;
        let floor = surfels(&[(Vec3::Y, 1.0), (desk, 2.0)]);
        assert!(off_deg(up_near(&floor, hint, 3.0), Vec3::Y) < 1.0);
        assert!(off_deg(up_from_facets(&facets(&[(Vec3::Y, 1.0), (desk, 2.0)])), Vec3::Y) > 20.0);
        // A single wall: up is perpendicular to it, and the hint determines the rest.
        let wall = surfels(&[(Vec3::Z, 1.0)]);
        let skew = Mat3::from_rotation_z(0.1) * hint;
        let expected = skew.with_z(0.0).normalize();
        assert!(off_deg(up_near(&wall, skew, 3.0), expected) < 1.5);
        // No surface near the hint: the hint is returned.
        let slope = surfels(&[(Mat3::from_rotation_x(0.8) * Vec3::Y, 1.0)]);
        assert!(off_deg(up_near(&slope, hint, 3.0), hint) < 1.0);
        assert!(off_deg(up_near(&[], hint, 3.0), hint) < 0.1);
    }

    /// A room of 4 × 3 m, 2.6 m high, seen by a pitched and rolled camera in its centre; depth waves by a tenth,
    /// normals by about 20°.
    fn wavy_frame(turn: Mat3) -> Frame {
        let camera = Camera::from_hfov_deg(65.0, 96, 72).unwrap();
        let planes = [
            (Vec3::Y, -1.4),
            (Vec3::NEG_Y, -1.2),
            (Vec3::X, -2.0),
            (Vec3::NEG_X, -2.0),
            (Vec3::Z, -1.5),
            (Vec3::NEG_Z, -1.5),
        ];
        let depth_m = Image::from_fn(96, 72, |x, y| {
            let direction = camera.direction(x as f64 + 0.5, y as f64 + 0.5);
            let hit = |&(normal, offset_m): &(Vec3, f32)| {
                Plane { normal: turn * normal, offset_m }.intersect(&Ray { origin: Vec3::ZERO, direction })
            };
            let distance = planes.iter().filter_map(hit).fold(f32::INFINITY, f32::min);
            -distance * direction.z * (1.0 + 0.05 * (0.12 * x as f32).sin() * (0.1 * y as f32).cos())
        });
        Frame::new(Photo::Linear(Image::from_fn(96, 72, |_, _| [0.5; 3])), depth_m, camera, 1.0).unwrap()
    }

    #[test]
    fn wavy_rooms_stand_up_too() {
        for (pitch_deg, roll_deg) in [(0.0f32, 0.0f32), (25.0, 2.0), (-20.0, -3.0), (12.0, 4.0)] {
            // Pitched down, the camera sees up behind it.
            let turn = Mat3::from_rotation_x(pitch_deg.to_radians()) * Mat3::from_rotation_z(roll_deg.to_radians());
            let found = up_from_predicted_depth(&wavy_frame(turn), None);
            let angle_deg = found.dot(turn * Vec3::Y).min(1.0).acos().to_degrees();
            assert!(angle_deg < 6.0, "pitch {pitch_deg} roll {roll_deg}: {angle_deg}°");
        }
    }

    #[test]
    fn walls_alone_are_enough_and_nothing_means_camera_up() {
        let turn = Mat3::from_rotation_z(0.2);
        let found = up_from_facets(&facets(&[(turn * Vec3::X, 1.0), (turn * Vec3::Z, 1.0)]));
        assert!(found.dot(turn * Vec3::Y) > 0.999, "{found}");
        assert_eq!(up_from_facets(&[]), Vec3::Y);
    }
}
