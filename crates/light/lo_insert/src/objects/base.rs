use lo_geometry::{Quat, Vec2, Vec3};
use lo_mesh::PreparedModel;

/// Height of the base as a share of the model's height: vertices up to it belong to the base.
const LOW: f32 = 0.02;

/// Sample points along the longer side of the base.
const SAMPLES_PER_SIDE: usize = 9;

/// Contact area of a model on a level surface: the convex hull of its lowest vertices, since feet also support the
/// part between them.
#[derive(Clone, Debug)]
pub struct Base {
    /// Hull in the model's units, as (x, z) from the centre of the base of its bounding box; counter-clockwise, or
    /// one or two points.
    hull: Vec<Vec2>,
}

impl Base {
    /// Computes the base of a model.
    pub fn new(model: &PreparedModel) -> Self {
        let bounds = model.bounds();
        let top = bounds.min.y + LOW * bounds.size().y;
        let middle = bounds.center();
        let offset = |p: &Vec3| Vec2::new(p.x - middle.x, p.z - middle.z);
        Self { hull: convex_hull(model.model().positions.iter().filter(|p| p.y <= top).map(offset).collect()) }
    }

    /// Returns whether a point (x, z) in the model's units is in the base or within `margin` of it.
    pub(crate) fn contains(&self, point: Vec2, margin: f32) -> bool {
        let Some((&first, rest)) = self.hull.split_first() else { return false };
        if rest.is_empty() {
            return first.distance(point) <= margin;
        }
        let next = |i: usize| self.hull[(i + 1) % self.hull.len()];
        let inside =
            self.hull.len() > 2 && self.hull.iter().enumerate().all(|(i, &a)| (next(i) - a).perp_dot(point - a) >= 0.0);
        let distance = |(i, &a): (usize, &Vec2)| {
            let along = next(i) - a;
            let t = ((point - a).dot(along) / along.length_squared().max(f32::MIN_POSITIVE)).clamp(0.0, 1.0);
            point.distance(a + along * t)
        };
        inside || self.hull.iter().enumerate().map(distance).fold(f32::INFINITY, f32::min) <= margin
    }

    /// Returns sample points over the base, as offsets from its centre in metres and the world's axes.
    pub(crate) fn sample_points(&self, scale: f32, rotation: Quat) -> impl Iterator<Item = Vec3> {
        let low = self.hull.iter().fold(Vec2::INFINITY, |low, &p| low.min(p));
        let high = self.hull.iter().fold(Vec2::NEG_INFINITY, |high, &p| high.max(p));
        let pitch = (high - low).max_element() / SAMPLES_PER_SIDE as f32;
        let count =
            |length: f32| if pitch > 0.0 { ((length / pitch).round() as usize).clamp(1, SAMPLES_PER_SIDE) } else { 1 };
        let (columns, rows) = (count(high.x - low.x), count(high.y - low.y));
        let place = move |i: usize| {
            let share = Vec2::new((i % columns) as f32 + 0.5, (i / columns) as f32 + 0.5)
                / Vec2::new(columns as f32, rows as f32);
            low + (high - low) * share
        };
        (0..columns * rows)
            .map(place)
            .filter(move |&point| self.contains(point, 0.25 * pitch))
            .map(move |point| rotation * Vec3::new(point.x, 0.0, point.y) * scale)
    }
}

/// Returns the convex hull, counter-clockwise (monotone chain, Andrew 1979).
fn convex_hull(mut points: Vec<Vec2>) -> Vec<Vec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let chain = |points: &mut dyn Iterator<Item = Vec2>| {
        let mut hull: Vec<Vec2> = Vec::new();
        for point in points {
            while let [.., a, b] = hull[..] {
                if (b - a).perp_dot(point - b) > 0.0 {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut points.iter().copied());
    hull.extend(chain(&mut points.iter().rev().copied()));
    hull
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use lo_mesh::{LoadOptions, Material, Model};

    use super::*;

    /// A table of 2 × 1 units: a slab on four thin legs.
    fn table() -> PreparedModel {
        let mut positions = Vec::new();
        let mut triangles = Vec::new();
        let mut block = |low: Vec3, high: Vec3| {
            let first = positions.len() as u32;
            positions.extend((0..8).map(|i| {
                let pick = |axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
                Vec3::new(pick(0), pick(1), pick(2))
            }));
            triangles.extend([[0, 1, 5], [0, 5, 4], [2, 6, 7], [2, 7, 3]].map(|t: [u32; 3]| t.map(|v| first + v)));
        };
        block(Vec3::new(10.0, 0.9, 3.0), Vec3::new(12.0, 1.0, 4.0));
        for (x, z) in [(10.0, 3.0), (11.9, 3.0), (10.0, 3.9), (11.9, 3.9)] {
            block(Vec3::new(x, 0.0, z), Vec3::new(x + 0.1, 0.9, z + 0.1));
        }
        PreparedModel::new(
            Model::from_triangles(positions, triangles, Material::default(), &LoadOptions::default()).unwrap(),
        )
    }

    #[test]
    fn feet_carry_what_is_between_them() {
        let base = Base::new(&table());
        assert_eq!(base.hull.len(), 4);
        assert!(base.contains(Vec2::ZERO, 0.0) && base.contains(Vec2::new(0.99, 0.49), 0.0));
        assert!(!base.contains(Vec2::new(1.1, 0.0), 0.0) && base.contains(Vec2::new(1.1, 0.0), 0.11));
        // Rotated by a quarter turn and half as large; the rim of the hull is 1 × 0.5 m.
        let sample_points: Vec<Vec3> =
            base.sample_points(0.5, Quat::from_rotation_y(std::f32::consts::FRAC_PI_2)).collect();
        assert!(
            sample_points.len() > 30 && sample_points.iter().all(|s| s.x.abs() < 0.25 && s.z.abs() < 0.5 && s.y == 0.0)
        );
        assert!(sample_points.iter().any(|s| s.z.abs() > 0.4) && sample_points.iter().sum::<Vec3>().length() < 1e-3);
    }

    #[test]
    fn a_ball_stands_on_a_spot_and_a_line_on_a_line() {
        let line = Base { hull: convex_hull(vec![Vec2::new(-1.0, 0.0), Vec2::new(1.0, 0.0), Vec2::new(1.0, 0.0)]) };
        assert!(line.contains(Vec2::new(0.5, 0.1), 0.11) && !line.contains(Vec2::new(0.5, 0.2), 0.11));
        assert_eq!(line.sample_points(1.0, Quat::IDENTITY).count(), SAMPLES_PER_SIDE);
        let point = Base { hull: convex_hull(vec![Vec2::ONE]) };
        assert_eq!(point.sample_points(1.0, Quat::IDENTITY).collect::<Vec<_>>(), [Vec3::new(1.0, 0.0, 1.0)]);
        assert_eq!(Base { hull: Vec::new() }.sample_points(1.0, Quat::IDENTITY).count(), 0);
    }
}
