use std::f32::consts::TAU;

use lo_geometry::{Quat, Vec2, Vec3};

use super::{Paint, Shape};

/// Meeting lines of a profile that turn by more than this keep a sharp edge (cosine of 40°).
const CREASE: f32 = 0.77;

impl Shape {
    /// A profile (radius, height; upwards on the outside) turned about the vertical through `base`. Ends that are not on the
    /// axis are closed by discs.
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

    /// A closed profile (radius, height; counter-clockwise) turned about the vertical through `base`: a shade, a tyre. Edges are sharp.
    pub(crate) fn ring(&mut self, base: Vec3, profile: &[[f32; 2]], segments: usize, paint: Paint) {
        let first = self.triangles.len();
        for (k, &a) in profile.iter().enumerate() {
            let (a, b) = (Vec2::from(a), Vec2::from(profile[(k + 1) % profile.len()]));
            let normal = Vec2::new(b.y - a.y, a.x - b.x).normalize_or_zero();
            self.band(base, [(a, normal, 0.0), (b, normal, a.distance(b))], segments, paint);
        }
        self.close_part(first);
    }

    /// The ring of a lathe between two points of its profile (with normals and distances along it).
    fn band(&mut self, base: Vec3, ends: [(Vec2, Vec2, f32); 2], segments: usize, paint: Paint) {
        let start = self.positions.len() as u32;
        let around = TAU * ends[0].0.x.max(ends[1].0.x);
        for k in 0..=segments {
            let share = k as f32 / segments as f32;
            // The same bits at both ends of the ring, so that it is closed.
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

    /// A round bar from `a` to `b`, as thick as told at each end, with flat ends.
    pub(crate) fn bar(&mut self, a: Vec3, b: Vec3, radii: [f32; 2], segments: usize, paint: Paint) {
        let mut upright = Self::default();
        upright.lathe(Vec3::ZERO, &[[radii[0], 0.0], [radii[1], a.distance(b)]], segments, paint);
        self.add(&upright, Quat::from_rotation_arc(Vec3::Y, (b - a).normalize_or(Vec3::Y)), a);
    }

    /// A ball, flattened to `radii` (horizontal, vertical).
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

    /// A pipe of constant thickness through `points`.
    pub(crate) fn pipe(&mut self, points: &[Vec3], radius: f32, segments: usize, paint: Paint) {
        for pair in points.windows(2) {
            self.bar(pair[0], pair[1], [radius; 2], segments, paint);
        }
        for &joint in &points[1..points.len() - 1] {
            self.ball(joint, [radius; 2], segments, paint);
        }
    }
}
