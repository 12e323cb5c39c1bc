use std::f32::consts::TAU;

use lo_geometry::{Quat, Vec2, Vec3};

use super::{Paint, Shape};

/// Cosine of the crease angle (40°): profiles that turn by more keep a sharp edge.
const CREASE: f32 = 0.77;

impl Shape {
    /// Adds a surface of revolution of a profile (radius, height) about the vertical through `base`.
    ///
    /// The profile runs upwards on the outside. Ends off the axis are closed by discs.
    pub(crate) fn lathe(&mut self, base: Vec3, profile: &[[f32; 2]], segments: usize, paint: Paint) {
        let first = self.triangles.len();
        let mut points: Vec<Vec2> = profile.iter().map(|&p| Vec2::from(p)).collect();
        if points[0].x > 0.0 {
            points.insert(0, Vec2::new(0.0, points[0].y));
        }
        if let Some(&last) = points.last().filter(|p| p.x > 0.0) {
            points.push(Vec2::new(0.0, last.y));
        }
        points.dedup_by(|a, b| a.distance(*b) < 1e-6);
        let outward = |a: Vec2, b: Vec2| Vec2::new(b.y - a.y, a.x - b.x).normalize_or_zero();
        let mut length = 0.0;
        for k in 0..points.len() - 1 {
            let (a, b) = (points[k], points[k + 1]);
            let flat = outward(a, b);
            let joined = |other: Option<Vec2>| match other {
                Some(other) if other.dot(flat) > CREASE => (flat + other).normalize(),
                _ => flat,
            };
            let before = (k > 0).then(|| outward(points[k - 1], a));
            let after = points.get(k + 2).map(|&c| outward(b, c));
            let (normal_a, normal_b) = (joined(before), joined(after));
            let next = length + a.distance(b);
            self.band(base, [(a, normal_a, length), (b, normal_b, next)], segments, paint);
            length = next;
        }
        self.close_part(first);
    }

    /// Adds a ring, such as a shade or a tyre, with sharp edges.
    ///
    /// A closed profile (radius, height; counter-clockwise) is revolved about the vertical through `base`.
    pub(crate) fn ring(&mut self, base: Vec3, profile: &[[f32; 2]], segments: usize, paint: Paint) {
        let first = self.triangles.len();
        for (k, &a) in profile.iter().enumerate() {
            let (a, b) = (Vec2::from(a), Vec2::from(profile[(k + 1) % profile.len()]));
            let normal = Vec2::new(b.y - a.y, a.x - b.x).normalize_or_zero();
            self.band(base, [(a, normal, 0.0), (b, normal, a.distance(b))], segments, paint);
        }
        self.close_part(first);
    }

    /// Adds the band between two points of a profile, each with its normal and arc length.
    fn band(&mut self, base: Vec3, ends: [(Vec2, Vec2, f32); 2], segments: usize, paint: Paint) {
        let start = self.positions.len() as u32;
        let around = TAU * ends[0].0.x.max(ends[1].0.x);
        for k in 0..=segments {
            let share = k as f32 / segments as f32;
            // Bit-identical at both ends, so that the band is closed.
            let (sin, cos) = if k == segments { (0.0, 1.0) } else { (share * TAU).sin_cos() };
            for (point, normal, length) in ends {
                let position = base + Vec3::new(point.x * cos, point.y, -point.x * sin);
                let normal = Vec3::new(normal.x * cos, normal.y, -normal.x * sin);
                self.vertex(position, normal, [share * around, -length], paint);
            }
        }
        for k in 0..segments as u32 {
            let a = start + 2 * k;
            self.quad([a, a + 2, a + 3, a + 1], paint);
        }
    }

    /// Adds a round bar from `a` to `b` with a radius at each end and flat caps.
    pub(crate) fn bar(&mut self, a: Vec3, b: Vec3, radii: [f32; 2], segments: usize, paint: Paint) {
        let mut upright = Self::default();
        upright.lathe(Vec3::ZERO, &[[radii[0], 0.0], [radii[1], a.distance(b)]], segments, paint);
        self.add(&upright, Quat::from_rotation_arc(Vec3::Y, (b - a).normalize_or(Vec3::Y)), a);
    }

    /// Adds an ellipsoid with `radii` (horizontal, vertical).
    pub(crate) fn ball(&mut self, center: Vec3, radii: [f32; 2], segments: usize, paint: Paint) {
        let rings = segments / 2;
        let profile: Vec<[f32; 2]> = (0..=rings)
            .map(|k| {
                let angle = std::f32::consts::PI * k as f32 / rings as f32;
                let radius = if k == 0 || k == rings { 0.0 } else { radii[0] * angle.sin() };
                [radius, -radii[1] * angle.cos()]
            })
            .collect();
        self.lathe(center, &profile, segments, paint);
    }

    /// Adds a pipe of constant thickness through `points`.
    pub(crate) fn pipe(&mut self, points: &[Vec3], radius: f32, segments: usize, paint: Paint) {
        for pair in points.windows(2) {
            self.bar(pair[0], pair[1], [radius; 2], segments, paint);
        }
        for &joint in &points[1..points.len() - 1] {
            self.ball(joint, [radius; 2], segments, paint);
        }
    }
}
