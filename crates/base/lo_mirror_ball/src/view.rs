//! Geometry of a mirror ball in a photo: the image position of a reflected direction (`docs/method.md` §14).

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use lo_geometry::{DVec3, Vec3};

use super::ball::{BallCircle, BallLens, MIN_RADIUS_PX};
use super::error::BallError;

/// A mirror ball in front of a camera that looks along −Z with +Y up. The room is assumed far away relative to the
/// ball.
///
/// Let `k` be the ball's radius over the distance of its centre. A ray at angle ψ to the line to the centre hits the
/// ball where the normal has the angle γ to that line, with `tan ψ = k sin γ / (1 − k cos γ)`. It is reflected to the
/// angle θ = π − 2γ − ψ from the line. In an orthographic view k = 0, and a point of the photo at `r` radii from the
/// centre shows `r = sin((π − θ) / 2)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BallView {
    circle: BallCircle,
    pinhole: Option<Pinhole>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Pinhole {
    focal_px: f64,
    principal: [f64; 2],
    /// Unit vector to the ball's centre.
    axis: DVec3,
    /// Half of the ball's angular diameter.
    half_angle_rad: f64,
}

/// Image position of a reflected direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PhotoPoint {
    /// Position in pixels.
    pub position: [f64; 2],
    /// Pixels per radian of direction, along the better and the worse resolved axis.
    pub pixels_per_rad: [f64; 2],
}

impl BallView {
    /// Creates a ball from its outline in a photo of `width` × `height` pixels.
    ///
    /// # Errors
    /// [`BallError`] for an invalid outline or lens, and if they do not fit each other.
    pub fn new(circle: BallCircle, lens: BallLens, [width, height]: [usize; 2]) -> Result<Self, BallError> {
        let BallCircle { x, y, radius_px } = circle;
        if ![x, y, radius_px].iter().all(|v| v.is_finite()) || radius_px < MIN_RADIUS_PX {
            return Err(BallError::Circle { circle });
        }
        if x < 0.0 || y < 0.0 || x > width as f64 || y > height as f64 || radius_px > (width.max(height)) as f64 {
            return Err(BallError::CircleOutside { circle, width, height });
        }
        let principal = [0.5 * width as f64, 0.5 * height as f64];
        let (dx, dy) = (x - principal[0], y - principal[1]);
        let off_px = dx.hypot(dy);
        let (focal_px, angles) = match lens {
            BallLens::Orthographic => return Ok(Self { circle, pinhole: None }),
            BallLens::Focal { focal_px } if focal_px.is_finite() && focal_px > 0.0 => {
                (focal_px, cone_of_outline(off_px / focal_px, radius_px / focal_px))
            }
            BallLens::Distance { radii } if radii.is_finite() && radii > 1.0 => {
                let half_angle = (1.0 / radii).asin();
                let (focal_px, off_axis) = focal_of_outline(off_px, radius_px, half_angle);
                (focal_px, Some([off_axis, half_angle]))
            }
            _ => return Err(BallError::Lens { lens }),
        };
        let [off_axis, half_angle_rad] = angles
            .filter(|[off_axis, half_angle]| off_axis + half_angle < MAX_ANGLE_RAD && *half_angle > 0.0)
            .ok_or(BallError::Lens { lens })?;
        let (sin, cos) = off_axis.sin_cos();
        let side = if off_px > 0.0 { [dx / off_px, dy / off_px] } else { [0.0; 2] };
        let axis = DVec3::new(sin * side[0], -sin * side[1], -cos);
        Ok(Self { circle, pinhole: Some(Pinhole { focal_px, principal, axis, half_angle_rad }) })
    }

    /// Outline in the photo.
    pub fn circle(&self) -> BallCircle {
        self.circle
    }

    /// Focal length in pixels; `None` for an orthographic view.
    pub fn focal_px(&self) -> Option<f64> {
        self.pinhole.map(|pinhole| pinhole.focal_px)
    }

    /// Half-angle, in radians, of the cone of directions that the ball itself hides; 0 for an orthographic view.
    pub fn hidden_half_angle_rad(&self) -> f64 {
        self.pinhole.map_or(0.0, |pinhole| pinhole.half_angle_rad)
    }

    /// Unit vector from the camera to the ball's centre.
    pub fn axis(&self) -> Vec3 {
        self.axis_f64().as_vec3()
    }

    /// Returns the image position that shows a unit direction; `None` within the cone that the ball hides.
    pub fn image_position(&self, direction: Vec3) -> Option<[f64; 2]> {
        self.photo_point(direction.as_dvec3(), 1.0).map(|point| point.position)
    }

    /// Like [`BallView::image_position`], with the resolution there; `None` also beyond `usable` of the outline's
    /// radius.
    pub(super) fn photo_point(&self, direction: DVec3, usable: f64) -> Option<PhotoPoint> {
        let axis = self.axis_f64();
        let along = axis.dot(direction);
        let across = direction - along * axis;
        let sin_theta = across.length();
        let turned = PI - sin_theta.atan2(along);
        let k = self.k();
        let gamma = normal_angle(turned, k)?;
        let (sin, cos) = gamma.sin_cos();
        let s = (1.0 - 2.0 * k * cos + k * k).sqrt();
        // radius in the photo over that of the outline, exact on the axis
        let share = sin / s;
        if share > usable {
            return None;
        }
        let outward = if sin_theta > 1e-12 { across / sin_theta } else { DVec3::ZERO };
        let position = match &self.pinhole {
            None => {
                let offset = self.circle.radius_px * share * outward;
                [self.circle.x + offset.x, self.circle.y - offset.y]
            }
            Some(pinhole) => {
                let psi = (k * share).asin();
                pinhole.project(psi.cos() * axis + psi.sin() * outward)?
            }
        };
        let turn = 2.0 + k * (cos - k) / (s * s);
        let radial = self.circle.radius_px * ((cos - k) * (1.0 - k * cos)).max(0.0) / (s * s * s * turn);
        // at the centre, share / sin θ tends to the radial resolution
        let tangential = if sin_theta > 1e-6 { self.circle.radius_px * share / sin_theta } else { radial };
        Some(PhotoPoint { position, pixels_per_rad: [radial.max(tangential), radial.min(tangential)] })
    }

    /// Returns the point of the outline at `turn` radians around it.
    pub(super) fn outline(&self, turn: f64) -> Option<[f64; 2]> {
        let (sin, cos) = turn.sin_cos();
        match &self.pinhole {
            None => {
                let BallCircle { x, y, radius_px } = self.circle;
                Some([x + radius_px * cos, y + radius_px * sin])
            }
            Some(pinhole) => {
                let right = DVec3::Y.cross(-pinhole.axis).normalize_or(DVec3::X);
                let up = (-pinhole.axis).cross(right);
                let (s, c) = pinhole.half_angle_rad.sin_cos();
                pinhole.project(c * pinhole.axis + s * (cos * right - sin * up))
            }
        }
    }

    /// Fits the outline to weighted points; `None` if they do not determine one.
    ///
    /// Uses Gauss–Newton on the distances to a circle, or for a pinhole a plane through the rays of a cone, `w · ray =
    /// 1`.
    pub(super) fn fitted(&self, points: &[([f64; 2], f64)]) -> Option<Self> {
        let Some(pinhole) = &self.pinhole else {
            let circle = fit_circle(points, self.circle)?;
            return Some(Self { circle, pinhole: None });
        };
        let (mut columns, mut sum) = ([DVec3::ZERO; 3], DVec3::ZERO);
        for &(point, weight) in points {
            let ray = pinhole.ray(point);
            columns = [0, 1, 2].map(|i| columns[i] + weight * ray[i] * ray);
            sum += weight * ray;
        }
        let normal = solve(columns, sum)?;
        let cos = 1.0 / normal.length();
        let axis = normal * cos;
        if !(cos > 0.05 && cos < 1.0) || axis.z >= 0.0 {
            return None;
        }
        let fitted = Pinhole { axis, half_angle_rad: cos.acos(), ..*pinhole };
        let circle = fitted.circle()?;
        Some(Self { circle, pinhole: Some(fitted) })
    }

    fn axis_f64(&self) -> DVec3 {
        self.pinhole.map_or(DVec3::NEG_Z, |pinhole| pinhole.axis)
    }

    /// The ball's radius over the distance of its centre.
    fn k(&self) -> f64 {
        self.pinhole.map_or(0.0, |pinhole| pinhole.half_angle_rad.sin())
    }
}

impl Pinhole {
    fn project(&self, ray: DVec3) -> Option<[f64; 2]> {
        let depth = -ray.z;
        (depth > 1e-9).then(|| {
            [self.principal[0] + self.focal_px * ray.x / depth, self.principal[1] - self.focal_px * ray.y / depth]
        })
    }

    fn ray(&self, [u, v]: [f64; 2]) -> DVec3 {
        let (x, y) = ((u - self.principal[0]) / self.focal_px, (v - self.principal[1]) / self.focal_px);
        DVec3::new(x, -y, -1.0).normalize()
    }

    /// Returns the centre and the mean semi-axis of the outline.
    fn circle(&self) -> Option<BallCircle> {
        let off_axis = self.axis.truncate().length().atan2(-self.axis.z);
        let [off, radius] = outline_of_cone(off_axis, self.half_angle_rad)?;
        let side = self.axis.truncate().normalize_or_zero();
        let (off_px, radius_px) = (off * self.focal_px, radius * self.focal_px);
        Some(BallCircle { x: self.principal[0] + off_px * side.x, y: self.principal[1] - off_px * side.y, radius_px })
    }
}

/// Largest angle of the outline from the optical axis.
const MAX_ANGLE_RAD: f64 = FRAC_PI_2 - 0.02;

/// Solves `2γ + ψ(γ) = turned` for γ; `None` beyond the outline, where cos γ = k.
fn normal_angle(turned: f64, k: f64) -> Option<f64> {
    let last = k.acos();
    if turned > 2.0 * last + k.asin() {
        return None;
    }
    let mut gamma = (turned / (2.0 + k / (1.0 - k).max(1e-3))).clamp(0.0, last);
    // the slope falls from 2 + k / (1 − k) to 2: Newton's method from the left hardly overshoots
    for _ in 0..24 {
        let (sin, cos) = gamma.sin_cos();
        let value = 2.0 * gamma + (k * sin).atan2(1.0 - k * cos) - turned;
        let slope = 2.0 + k * (cos - k) / (1.0 - 2.0 * k * cos + k * k);
        let next = (gamma - value / slope).clamp(0.0, last);
        if (next - gamma).abs() < 1e-13 {
            return Some(next);
        }
        gamma = next;
    }
    Some(gamma)
}

/// Projects a cone of `half_angle` whose axis is at the angle `off_axis` from the camera's.
///
/// The image is an ellipse of eccentricity sin `off_axis` / cos `half_angle`. Returns the distance of its centre from
/// the principal point and its mean semi-axis, both over the focal length.
fn outline_of_cone(off_axis: f64, half_angle: f64) -> Option<[f64; 2]> {
    if off_axis + half_angle >= MAX_ANGLE_RAD {
        return None;
    }
    let (far, near) = ((off_axis + half_angle).tan(), (off_axis - half_angle).tan());
    let long = 0.5 * (far - near);
    let eccentricity = off_axis.sin() / half_angle.cos();
    Some([0.5 * (far + near), 0.5 * long * (1.0 + (1.0 - eccentricity * eccentricity).max(0.0).sqrt())])
}

/// Inverse of [`outline_of_cone`]; returns `[off_axis, half_angle]`.
fn cone_of_outline(off: f64, radius: f64) -> Option<[f64; 2]> {
    let mut off_axis = off.atan();
    let mut half_angle = (radius / (1.0 + off * off)).atan();
    for _ in 0..200 {
        let [got_off, got_radius] = outline_of_cone(off_axis, half_angle)?;
        let slope = 1.0 / (1.0 + off * off);
        let step = [slope * (off - got_off), slope * (radius - got_radius)];
        if step.iter().all(|v| v.abs() < 1e-13) {
            return Some([off_axis, half_angle]);
        }
        off_axis = (off_axis + step[0]).max(0.0);
        half_angle = (half_angle + step[1]).max(1e-9);
    }
    None
}

/// Returns the focal length with which a ball of angular radius `half_angle` has the given outline, and its angle from
/// the optical axis.
fn focal_of_outline(off_px: f64, radius_px: f64, half_angle: f64) -> (f64, f64) {
    let mut focal_px = radius_px / half_angle.tan();
    let mut off_axis = 0.0;
    for _ in 0..200 {
        let off = off_px / focal_px;
        off_axis = off.atan();
        // for a given half-angle, solve for the second-order difference between off and the centre's angle
        for _ in 0..50 {
            let Some([got, _]) = outline_of_cone(off_axis, half_angle) else { break };
            off_axis = (off_axis + (off - got) / (1.0 + off * off)).max(0.0);
        }
        let Some([_, radius]) = outline_of_cone(off_axis, half_angle) else { break };
        let next = radius_px / radius;
        if (next / focal_px - 1.0).abs() < 1e-13 {
            break;
        }
        focal_px = next;
    }
    (focal_px, off_axis)
}

fn fit_circle(points: &[([f64; 2], f64)], start: BallCircle) -> Option<BallCircle> {
    let mut circle = start;
    for _ in 0..8 {
        let (mut columns, mut right) = ([DVec3::ZERO; 3], DVec3::ZERO);
        for &([x, y], weight) in points {
            let (dx, dy) = (x - circle.x, y - circle.y);
            let distance = dx.hypot(dy);
            if distance < 1e-9 {
                continue;
            }
            let row = DVec3::new(dx / distance, dy / distance, 1.0);
            columns = [0, 1, 2].map(|i| columns[i] + weight * row[i] * row);
            right += weight * (distance - circle.radius_px) * row;
        }
        let step = solve(columns, right)?;
        circle = BallCircle { x: circle.x + step.x, y: circle.y + step.y, radius_px: circle.radius_px + step.z };
        if step.length() < 1e-7 {
            break;
        }
    }
    (circle.radius_px >= MIN_RADIUS_PX && circle.x.is_finite() && circle.y.is_finite()).then_some(circle)
}

/// Solves three linear equations by Cramer's rule.
fn solve([a, b, c]: [DVec3; 3], right: DVec3) -> Option<DVec3> {
    let det = a.dot(b.cross(c));
    let solution = DVec3::new(right.dot(b.cross(c)), a.dot(right.cross(c)), a.dot(b.cross(right))) / det;
    (det.abs() > 1e-12 * (a.length() * b.length() * c.length()) && solution.is_finite()).then_some(solution)
}

/// Returns `count` evenly spaced angles around an outline, in radians.
pub(super) fn turns(count: usize) -> impl Iterator<Item = f64> {
    (0..count).map(move |index| TAU * index as f64 / count as f64)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    const SIZE: [usize; 2] = [1000, 800];

    fn circle(x: f64, y: f64, radius_px: f64) -> BallCircle {
        BallCircle { x, y, radius_px }
    }

    /// Reflects a ray at a sphere of radius 1, with vectors.
    fn reflected(ray: DVec3, centre: DVec3) -> Option<DVec3> {
        let along = ray.dot(centre);
        let root = along * along - centre.length_squared() + 1.0;
        let normal = (root >= 0.0).then(|| (along - root.sqrt()) * ray - centre)?;
        Some(ray - 2.0 * ray.dot(normal) * normal)
    }

    #[test]
    fn orthographic_is_the_published_formula() {
        let view = BallView::new(circle(500.0, 400.0, 300.0), BallLens::Orthographic, SIZE).unwrap();
        // Debevec 1998: r = sin(θ / 2), θ from the direction back to the camera
        for degrees in [0.0f64, 30.0, 90.0, 150.0, 179.0] {
            let theta = degrees.to_radians();
            let back = DVec3::new(theta.sin(), 0.0, theta.cos()).as_vec3();
            let [u, v] = view.image_position(back).unwrap();
            assert!((u - 500.0 - 300.0 * (theta / 2.0).sin()).abs() < 1e-4 && (v - 400.0).abs() < 1e-4, "{degrees}");
        }
        let [u, v] = view.image_position(Vec3::Y).unwrap();
        assert!((u - 500.0).abs() < 1e-4 && (v - (400.0 - 300.0 * 0.5f64.sqrt())).abs() < 1e-4);
    }

    #[test]
    fn perspective_inverts_rays_mirrored_by_vectors() {
        for (x, y, radius, lens) in [
            (500.0, 400.0, 300.0, BallLens::Focal { focal_px: 800.0 }),
            (300.0, 600.0, 150.0, BallLens::Focal { focal_px: 1200.0 }),
            (420.0, 380.0, 250.0, BallLens::Distance { radii: 3.0 }),
            (500.0, 400.0, 20.0, BallLens::Focal { focal_px: 9000.0 }),
        ] {
            let view = BallView::new(circle(x, y, radius), lens, SIZE).unwrap();
            let pinhole = view.pinhole.unwrap();
            let centre = pinhole.axis / view.k();
            let mut met = 0;
            for (u, v) in (0..100).flat_map(|u| (0..80).map(move |v| (10.0 * f64::from(u), 10.0 * f64::from(v)))) {
                let Some(direction) = reflected(pinhole.ray([u, v]), centre) else { continue };
                let [back_u, back_v] = view.photo_point(direction, 1.0).unwrap().position;
                assert!((back_u - u).abs() < 1e-5 && (back_v - v).abs() < 1e-5, "{u} {v} → {back_u} {back_v}");
                met += 1;
            }
            let area = PI * radius * radius / 100.0;
            // counted on a grid of 10 pixels
            assert!((f64::from(met) / area - 1.0).abs() < 0.05 + 8.0 / radius, "{met} {area}");
            if let BallLens::Distance { radii } = lens {
                assert!((1.0 / view.k() - radii).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn what_the_ball_hides_shows_nowhere() {
        let view = BallView::new(circle(500.0, 400.0, 300.0), BallLens::Focal { focal_px: 800.0 }, SIZE).unwrap();
        let hidden = view.hidden_half_angle_rad();
        assert!((hidden - (300.0f64 / 800.0).atan()).abs() < 1e-9);
        let at = |angle: f64| view.photo_point(DVec3::new(angle.sin(), 0.0, -angle.cos()), 1.0);
        assert!(at(hidden - 1e-6).is_none());
        // the outline shows the background right beside the ball
        let [u, _] = at(hidden + 1e-9).unwrap().position;
        assert!((u - 800.0).abs() < 0.1, "{u}");
    }

    #[test]
    fn resolution_is_that_of_neighbouring_directions() {
        for lens in [BallLens::Orthographic, BallLens::Focal { focal_px: 700.0 }] {
            let view = BallView::new(circle(500.0, 400.0, 200.0), lens, SIZE).unwrap();
            for degrees in [0.0f64, 20.0, 90.0, 140.0] {
                let direction =
                    |theta: f64, phi: f64| DVec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let theta = degrees.to_radians();
                let step = 1e-4;
                let here = view.photo_point(direction(theta, 0.0), 1.0).unwrap();
                let moved = |other: DVec3| {
                    let there = view.photo_point(other, 1.0).unwrap().position;
                    (there[0] - here.position[0]).hypot(there[1] - here.position[1]) / step
                };
                let radial = moved(direction(theta + step, 0.0));
                let tangential = if theta > 0.0 { moved(direction(theta, step / theta.sin())) } else { radial };
                let expected = [radial.max(tangential), radial.min(tangential)];
                for (got, expected) in here.pixels_per_rad.iter().zip(expected) {
                    // the image plane stretches off the axis by up to 1 / cos²
                    assert!((got / expected - 1.0).abs() < 0.12, "{degrees}: {got} {expected}");
                }
            }
        }
    }

    #[test]
    fn outlines_are_fitted_from_their_points() {
        for (lens, x) in [(BallLens::Orthographic, 380.0), (BallLens::Focal { focal_px: 900.0 }, 250.0)] {
            let view = BallView::new(circle(x, 420.0, 180.0), lens, SIZE).unwrap();
            let points: Vec<_> = turns(90).filter_map(|turn| Some((view.outline(turn)?, 1.0))).collect();
            let start = BallView::new(circle(x + 9.0, 410.0, 170.0), lens, SIZE).unwrap();
            let fitted = start.fitted(&points).unwrap().circle();
            for (got, expected) in [(fitted.x, x), (fitted.y, 420.0), (fitted.radius_px, 180.0)] {
                assert!((got - expected).abs() < 1e-3, "{fitted:?}");
            }
        }
    }

    #[test]
    fn invalid_outlines_and_lenses_never_panic() {
        let values = [f64::NAN, -1.0, 0.0, 3.0, 100.0, 799.0, 1e9, f64::INFINITY];
        for (x, y, r) in values.iter().flat_map(|x| values.iter().flat_map(move |y| values.map(|r| (*x, *y, r)))) {
            for lens in values.iter().flat_map(|&v| {
                [BallLens::Orthographic, BallLens::Focal { focal_px: v }, BallLens::Distance { radii: v }]
            }) {
                let Ok(view) = BallView::new(circle(x, y, r), lens, SIZE) else { continue };
                for direction in [Vec3::X, Vec3::Y, Vec3::Z, Vec3::NEG_Z, Vec3::new(0.6, 0.0, -0.8)] {
                    let shown = view.photo_point(direction.as_dvec3(), 1.0);
                    assert!(
                        shown.is_none_or(|point| point.position.iter().all(|v| v.is_finite())),
                        "{x} {y} {r} {lens:?}"
                    );
                }
            }
        }
    }
}
