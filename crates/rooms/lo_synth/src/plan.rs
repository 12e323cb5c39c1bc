//! The floor plan: outline, ceiling and openings of a room.

mod openings;

use lo_geometry::{Vec2, Vec3};
use lo_random::Stream;

use crate::chance::{between, chance, weighted};
use crate::config::SynthConfig;
use crate::description::{Outline, RoomKind};

/// Floor plan in the (x, z) plane, x to the right and z towards the viewer, with ceiling and openings.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    pub outline: Outline,
    /// Rectangles (minimum and maximum corner) that tile the floor; they share edges only.
    pub rectangles: Vec<[Vec2; 2]>,
    pub walls: Vec<Wall>,
    pub height_m: f32,
    /// Factor on the usual length and width of rooms of this kind.
    pub size_factor: f32,
    pub slope: Option<Slope>,
}

/// A ceiling that slopes down to one or both ends of an axis of a rectangular room.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Slope {
    /// Axis of the slope: 0 for x, 1 for z.
    pub axis: usize,
    /// Height at the low end, metres.
    pub knee_m: f32,
    /// Rise per metre.
    pub rise: f32,
    pub both_ends: bool,
}

/// A straight wall: `start + along · s` for s in [0, length], with the room on the side of `inward()`.
#[derive(Clone, Debug)]
pub(crate) struct Wall {
    pub start: Vec2,
    pub along: Vec2,
    pub length_m: f32,
    pub thickness_m: f32,
    /// Whether no other wing of the room is behind it, so that it can have windows and doors.
    pub can_have_openings: bool,
    pub openings: Vec<Opening>,
}

/// An opening in a wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Opening {
    pub kind: OpeningKind,
    /// Extent along the wall, metres.
    pub s: [f32; 2],
    /// Extent above the floor, metres.
    pub h: [f32; 2],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum OpeningKind {
    Window,
    ClosedDoor,
    /// A door with an open leaf, or without a leaf.
    OpenDoor {
        leaf: bool,
        lit: bool,
    },
}

impl Wall {
    pub(crate) fn inward(&self) -> Vec2 {
        // along × up in the (x, z) plane.
        Vec2::new(-self.along.y, self.along.x)
    }

    /// Point at `s` along the wall, `h` above the floor and `out` into the room, metres.
    pub(crate) fn point(&self, s: f32, h: f32, out: f32) -> Vec3 {
        let p = self.start + self.along * s + self.inward() * out;
        Vec3::new(p.x, h, p.y)
    }

    /// Rotation about +Y that maps x to `along` and z to `inward`.
    pub(crate) fn yaw_rad(&self) -> f32 {
        (-self.along.y).atan2(self.along.x)
    }
}

impl Opening {
    pub(crate) fn width_m(&self) -> f32 {
        self.s[1] - self.s[0]
    }

    pub(crate) fn is_window(&self) -> bool {
        self.kind == OpeningKind::Window
    }
}

impl Plan {
    /// Draws the plan of a kind of room, `size_factor` times as long and wide as usual.
    ///
    /// With the stream `glazed`, walls of glass replace the windows.
    pub(crate) fn draw(
        random: &mut Stream,
        kind: RoomKind,
        config: &SynthConfig,
        size_factor: f32,
        glazed: Option<Stream>,
    ) -> Self {
        let [narrow, wide, deep] = size_range(kind);
        let (a, b) = (between(random, narrow, wide), between(random, narrow.max(deep * 0.55), deep));
        let (a, b) = (size_factor * a, size_factor * b);
        let (width, depth) = if chance(random, 0.5) { (a, b) } else { (b, a) };
        let height_m = height(random, kind) * size_factor.sqrt();
        let outline = match kind {
            RoomKind::OpenPlan => Outline::OpenPlan,
            RoomKind::Corridor | RoomKind::Bathroom | RoomKind::Classroom => Outline::Rectangle,
            _ if chance(random, config.l_shape_share) && width.min(depth) > 3.2 => Outline::LShape,
            _ => Outline::Rectangle,
        };
        let cut = outline == Outline::LShape || outline == Outline::OpenPlan && chance(random, 0.5);
        let mut plan = if cut { l_shape(random, width, depth) } else { rectangle(width, depth) };
        plan.outline = outline;
        plan.size_factor = size_factor;
        plan.height_m = height_m;
        let may_slope = outline == Outline::Rectangle
            && matches!(kind, RoomKind::Bedroom | RoomKind::Living | RoomKind::Office | RoomKind::Studio);
        if may_slope && chance(random, config.sloped_ceiling_share) {
            let axis = usize::from(width < depth);
            let across = if axis == 0 { width } else { depth };
            let both_ends = chance(random, 0.3) && across > 4.0;
            let knee_m = between(random, 1.0, 1.7);
            let rise = between(random, 30.0_f32, 50.0).to_radians().tan();
            plan.slope = Some(Slope { axis, knee_m, rise, both_ends });
        }
        for wall in &mut plan.walls {
            wall.thickness_m = between(random, 0.12, 0.42);
        }
        plan.open_doors(random, kind);
        match glazed {
            Some(mut random) => plan.glaze(&mut random),
            None => plan.open_windows(random, kind, config),
        }
        plan
    }

    /// Height of the ceiling above a point of the floor, metres.
    pub(crate) fn ceiling(&self, p: Vec2) -> f32 {
        let Some(slope) = self.slope else {
            return self.height_m;
        };
        let (min, max) = self.extent();
        let from_low = p[slope.axis] - min[slope.axis];
        let from_high = max[slope.axis] - p[slope.axis];
        let distance = if slope.both_ends { from_low.min(from_high) } else { from_low };
        (slope.knee_m + slope.rise * distance.max(0.0)).min(self.height_m)
    }

    /// Coordinates on the slope's axis at which the ceiling bends.
    pub(crate) fn bends(&self) -> Vec<f32> {
        let Some(slope) = self.slope else {
            return Vec::new();
        };
        let (min, max) = self.extent();
        let (low, high) = (min[slope.axis], max[slope.axis]);
        let reach = (self.height_m - slope.knee_m) / slope.rise;
        let mut bends = Vec::new();
        if slope.both_ends {
            let middle = 0.5 * (low + high);
            bends.extend(if low + reach < middle { vec![low + reach, high - reach] } else { vec![middle] });
        } else if low + reach < high {
            bends.push(low + reach);
        }
        bends
    }

    /// Minimum and maximum corner of the outline.
    pub(crate) fn extent(&self) -> (Vec2, Vec2) {
        self.rectangles
            .iter()
            .fold((Vec2::INFINITY, Vec2::NEG_INFINITY), |(min, max), [a, b]| (min.min(*a), max.max(*b)))
    }

    pub(crate) fn area_m2(&self) -> f32 {
        self.rectangles.iter().map(|[a, b]| (b.x - a.x) * (b.y - a.y)).sum()
    }

    /// Whether a point is inside and at least `margin` from every wall.
    pub(crate) fn contains(&self, p: Vec2, margin: f32) -> bool {
        let inside = self.rectangles.iter().any(|[a, b]| p.cmpge(*a).all() && p.cmple(*b).all());
        inside
            && self.walls.iter().all(|wall| {
                let s = (p - wall.start).dot(wall.along).clamp(0.0, wall.length_m);
                (wall.start + wall.along * s).distance(p) >= margin
            })
    }
}

/// Minimum width, maximum width and maximum depth of a kind of room, metres.
fn size_range(kind: RoomKind) -> [f32; 3] {
    match kind {
        RoomKind::Bedroom => [2.8, 4.2, 5.2],
        RoomKind::Living => [3.4, 5.5, 7.0],
        RoomKind::Kitchen => [2.5, 3.8, 5.0],
        RoomKind::Office => [2.8, 6.0, 7.0],
        RoomKind::Dining => [3.0, 4.2, 5.5],
        RoomKind::Bathroom => [1.9, 2.8, 3.6],
        RoomKind::Corridor => [1.4, 2.2, 7.5],
        RoomKind::Studio => [4.0, 6.5, 8.5],
        RoomKind::Classroom => [5.5, 7.5, 9.5],
        RoomKind::OpenPlan => [5.0, 7.0, 9.5],
        RoomKind::Laboratory => [3.6, 6.5, 8.5],
        RoomKind::Cellar => [2.4, 4.2, 6.0],
        RoomKind::Workshop => [3.4, 6.0, 8.0],
        RoomKind::Hall => [7.0, 10.0, 14.0],
        RoomKind::Empty => [2.6, 4.5, 6.5],
    }
}

fn height(random: &mut Stream, kind: RoomKind) -> f32 {
    let range = match kind {
        RoomKind::Studio | RoomKind::OpenPlan => [(2.4, 2.8), (2.8, 3.4), (3.4, 4.0)],
        RoomKind::Hall => [(3.8, 4.5), (4.5, 5.5), (5.5, 7.0)],
        RoomKind::Cellar => [(2.2, 2.35), (2.35, 2.5), (2.5, 2.9)],
        RoomKind::Workshop => [(2.5, 2.8), (2.8, 3.4), (3.4, 4.2)],
        RoomKind::Classroom | RoomKind::Office | RoomKind::Laboratory => [(2.5, 2.8), (2.8, 3.2), (3.2, 3.8)],
        _ => [(2.2, 2.6), (2.6, 2.9), (2.9, 3.7)],
    };
    let (low, high) = weighted(random, &[(range[0], 0.55), (range[1], 0.3), (range[2], 0.15)]);
    between(random, low, high)
}

fn rectangle(width: f32, depth: f32) -> Plan {
    let corners = [Vec2::ZERO, Vec2::new(width, 0.0), Vec2::new(width, depth), Vec2::new(0.0, depth)];
    from_corners(&corners, vec![[Vec2::ZERO, Vec2::new(width, depth)]], &[])
}

/// Builds a rectangle with one corner cut out.
fn l_shape(random: &mut Stream, width: f32, depth: f32) -> Plan {
    let (x, z) = (width * between(random, 0.4, 0.68), depth * between(random, 0.4, 0.68));
    let corners = [
        Vec2::ZERO,
        Vec2::new(width, 0.0),
        Vec2::new(width, z),
        Vec2::new(x, z),
        Vec2::new(x, depth),
        Vec2::new(0.0, depth),
    ];
    let rectangles = vec![[Vec2::ZERO, Vec2::new(width, z)], [Vec2::new(0.0, z), Vec2::new(x, depth)]];
    // The other wing is behind the two walls of the cut-out corner.
    from_corners(&corners, rectangles, &[2, 3])
}

fn from_corners(corners: &[Vec2], rectangles: Vec<[Vec2; 2]>, inner: &[usize]) -> Plan {
    let walls = (0..corners.len())
        .map(|k| {
            let (a, b) = (corners[k], corners[(k + 1) % corners.len()]);
            Wall {
                start: a,
                along: (b - a).normalize(),
                length_m: a.distance(b),
                thickness_m: 0.2,
                can_have_openings: !inner.contains(&k),
                openings: Vec::new(),
            }
        })
        .collect();
    Plan { outline: Outline::Rectangle, rectangles, walls, height_m: 2.5, size_factor: 1.0, slope: None }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn walls_run_around_with_the_room_on_their_inner_side() {
        let mut random = lo_random::stream(1, "plan", 0);
        for plan in [rectangle(4.0, 3.0), l_shape(&mut random, 6.0, 5.0)] {
            // The enclosed area by Green's theorem must match the rectangles.
            let area: f32 = plan
                .walls
                .iter()
                .map(|w| {
                    let end = w.start + w.along * w.length_m;
                    0.5 * (w.start.x * end.y - end.x * w.start.y)
                })
                .sum();
            assert!((area - plan.area_m2()).abs() < 1e-4);
            for wall in &plan.walls {
                let middle = wall.start + wall.along * 0.5 * wall.length_m;
                assert!(plan.contains(middle + wall.inward() * 0.3, 0.2));
                assert!(!plan.contains(middle - wall.inward() * 0.3, 0.0));
                let turned = lo_geometry::Quat::from_rotation_y(wall.yaw_rad()) * Vec3::X;
                assert!((turned - Vec3::new(wall.along.x, 0.0, wall.along.y)).length() < 1e-5);
                let front = lo_geometry::Quat::from_rotation_y(wall.yaw_rad()) * Vec3::Z;
                assert!((front - Vec3::new(wall.inward().x, 0.0, wall.inward().y)).length() < 1e-5);
            }
        }
    }
}
