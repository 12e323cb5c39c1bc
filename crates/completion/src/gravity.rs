//! Which way is up.

use geometry::{Mat3, Vec3, fibonacci_sphere};

/// The camera may be pitched and rolled by this much: cos 50°, five degrees of slack over the stated ±45°.
const MIN_COS_TILT: f32 = 0.643;

/// Most normals that vote.
const VOTES: usize = 3000;

/// A normal with the area it stands for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Facet {
    pub normal: Vec3,
    pub area: f32,
}

/// The unit vector against gravity that explains most surfaces as horizontal or vertical, at most 50° from the camera's own
/// up; camera up where nothing votes.
///
/// Coarse search over directions 3° apart, then a few steps of least squares: the smallest eigenvector of
/// `Σ_vertical n nᵀ − Σ_horizontal n nᵀ`. Upward surfaces (floors, tables) count most, then walls, then downward ones.
pub(crate) fn up_from_facets(facets: &[Facet]) -> Vec3 {
    let stride = facets.len().div_ceil(VOTES).max(1);
    let votes: Vec<Facet> = facets.iter().copied().step_by(stride).collect();
    let score = |up: Vec3| {
        let sum: f32 = votes.iter().map(|f| f.area * vote(f.normal.dot(up), 0.10)).sum();
        // Photos are held roughly level: at 45° a direction must be half as well supported again to win.
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
    for width in [0.10, 0.07, 0.05, 0.05] {
        up = refined(&votes, up, width);
    }
    if up.y >= MIN_COS_TILT { up } else { best.1 }
}

/// Support of a normal at `cosine` from the candidate, for a tolerance of `width` in sine.
fn vote(cosine: f32, width: f32) -> f32 {
    let near = |sine: f32| (1.0 - (sine / width).powi(2)).max(0.0);
    if cosine.abs() < width {
        0.5 * near(cosine)
    } else {
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        near(sine) * if cosine > 0.0 { 1.0 } else { 0.4 }
    }
}

/// One step of least squares: the direction most parallel to the horizontal surfaces' normals and square to the vertical ones'.
fn refined(votes: &[Facet], up: Vec3, width: f32) -> Vec3 {
    let mut scatter = Mat3::ZERO;
    let mut total = 0.0;
    for facet in votes {
        let cosine = facet.normal.dot(up);
        let weight = facet.area * vote(cosine, width);
        let sign = if cosine.abs() < width { 1.0 } else { -1.0 };
        let n = facet.normal;
        scatter += Mat3::from_cols(n * n.x, n * n.y, n * n.z) * (sign * weight);
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

    #[test]
    fn walls_alone_are_enough_and_nothing_means_camera_up() {
        let turn = Mat3::from_rotation_z(0.2);
        let found = up_from_facets(&facets(&[(turn * Vec3::X, 1.0), (turn * Vec3::Z, 1.0)]));
        assert!(found.dot(turn * Vec3::Y) > 0.999, "{found}");
        assert_eq!(up_from_facets(&[]), Vec3::Y);
    }
}
