//! The room under construction: placement of furniture without collisions.

use std::f32::consts::PI;
use std::ops::Range;

use lo_geometry::{Quat, Vec2, Vec3};
use lo_random::Stream;

use crate::chance::{between, count, weighted};
use crate::occupancy::{Footprint, Occupancy, rotated_yaw};
use crate::palette::Palette;
use crate::plan::Plan;
use crate::solids::Shape;

/// The surface that carries an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Support {
    /// Standing or lying on the floor.
    Floor,
    /// Fixed to a wall.
    Wall,
    /// Hanging from the ceiling.
    Ceiling,
    /// Standing or lying on the object with this index.
    Object(usize),
    /// Part of the building.
    Building,
}

/// An object of the room under construction.
#[derive(Clone, Debug)]
pub(crate) struct PlacedObject {
    pub name: &'static str,
    pub support: Support,
    /// Indices into [`Shape::parts`] of the room's shape.
    pub parts: Range<usize>,
}

/// A level surface that can carry small objects, in the frame of its piece.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SupportSurface {
    pub center: Vec3,
    pub half: Vec2,
    /// Free height above the surface.
    pub headroom_m: f32,
}

/// An object that stands on a floor or a surface: x to the right, y up, front towards +z.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub name: &'static str,
    pub shape: Shape,
    /// Depth of the floor that must stay free in front of it.
    pub front_m: f32,
    pub surfaces: Vec<SupportSurface>,
}

impl Piece {
    pub(crate) fn new(name: &'static str, shape: Shape) -> Self {
        Self { name, shape, front_m: 0.0, surfaces: Vec::new() }
    }

    pub(crate) fn with_front(self, front_m: f32) -> Self {
        Self { front_m, ..self }
    }

    pub(crate) fn with_surface(mut self, center: Vec3, half: Vec2, headroom_m: f32) -> Self {
        self.surfaces.push(SupportSurface { center, half, headroom_m });
        self
    }
}

/// Pieces placed together, each with its position (x, z) and yaw in radians.
pub(crate) type Group = Vec<(Piece, Vec2, f32)>;

/// Preferred position along a wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum WallPosition {
    Anywhere,
    /// Near the ends of a wall.
    Corner,
    /// Near the middle of a wall.
    Middle,
}

/// A support surface at its position in the room.
#[derive(Clone, Debug)]
pub(crate) struct PlacedSurface {
    pub object: usize,
    pub name: &'static str,
    pub center: Vec3,
    pub half: Vec2,
    pub yaw_rad: f32,
    pub headroom_m: f32,
    pub taken: Vec<Footprint>,
}

/// Places objects in a room and keeps doors and passages free.
#[derive(Debug)]
pub(crate) struct RoomBuilder {
    pub plan: Plan,
    pub palette: Palette,
    pub random: Stream,
    pub occupancy: Occupancy,
    pub shape: Shape,
    pub objects: Vec<PlacedObject>,
    pub surfaces: Vec<PlacedSurface>,
    /// Number of lamps, on or off.
    pub lamps: usize,
    pub lamps_on: usize,
    pub flux_lm: f32,
    /// Factor on the luminous flux of every lamp.
    pub dimming: f32,
    /// Random stream for colour temperatures, if lamps differ in colour.
    pub mixed_light: Option<Stream>,
}

impl RoomBuilder {
    pub(crate) fn new(plan: Plan, palette: Palette, random: Stream) -> Self {
        let occupancy = Occupancy::new(&plan);
        Self {
            plan,
            palette,
            random,
            occupancy,
            shape: Shape::default(),
            objects: Vec::new(),
            surfaces: Vec::new(),
            lamps: 0,
            lamps_on: 0,
            flux_lm: 0.0,
            dimming: 1.0,
            mixed_light: None,
        }
    }

    /// Draws the colour temperature of the next lamp; returns `usual` if all lamps have one colour.
    pub(crate) fn lamp_kelvin(&mut self, usual: f32) -> f32 {
        match &mut self.mixed_light {
            None => usual,
            Some(own) => {
                let kinds =
                    [(usual, 0.3), (2100.0, 0.12), (2700.0, 0.2), (4000.0, 0.16), (5500.0, 0.12), (8000.0, 0.1)];
                weighted(own, &kinds) * between(own, 0.95, 1.05)
            }
        }
    }

    /// Adds a shape at a position in the room, without a collision test.
    pub(crate) fn add_shape(
        &mut self,
        name: &'static str,
        support: Support,
        shape: &Shape,
        rotation: Quat,
        offset: Vec3,
    ) {
        let first = self.shape.parts.len();
        self.shape.add(shape, rotation, offset);
        self.objects.push(PlacedObject { name, support, parts: first..self.shape.parts.len() });
    }

    /// Adds a shape given in the frame of a wall: x along it, y up, z into the room.
    pub(crate) fn add_to_wall(&mut self, name: &'static str, support: Support, shape: &Shape, wall: usize) {
        let wall = &self.plan.walls[wall];
        let (rotation, offset) = (Quat::from_rotation_y(wall.yaw_rad()), wall.point(0.0, 0.0, 0.0));
        self.add_shape(name, support, shape, rotation, offset);
    }

    /// Adds a piece and its support surfaces, without a collision test. Returns the object's index.
    pub(crate) fn add_piece(&mut self, piece: &Piece, support: Support, yaw_rad: f32, offset: Vec3) -> usize {
        self.add_shape(piece.name, support, &piece.shape, Quat::from_rotation_y(yaw_rad), offset);
        let object = self.objects.len() - 1;
        let rotation = Quat::from_rotation_y(yaw_rad);
        self.surfaces.extend(piece.surfaces.iter().map(|surface| PlacedSurface {
            object,
            name: piece.name,
            center: rotation * surface.center + offset,
            half: surface.half,
            yaw_rad,
            headroom_m: surface.headroom_m,
            taken: Vec::new(),
        }));
        object
    }

    /// Places a group with its back to a random wall. Returns the indices of its objects, or `None` if nothing fits.
    pub(crate) fn place_against_wall(&mut self, group: &Group, along: WallPosition) -> Option<Vec<usize>> {
        let (min, max) = group_bounds(group);
        let front_m = group.iter().map(|(piece, ..)| piece.front_m).fold(0.0, f32::max);
        // Clears the skirting boards.
        const GAP_M: f32 = 0.022;
        for _ in 0..28 {
            let wall_index = count(&mut self.random, 0, self.plan.walls.len() - 1);
            let wall = self.plan.walls[wall_index].clone();
            let width = max.x - min.x;
            let room = wall.length_m - width - 2.0 * GAP_M;
            if room < 0.0 {
                continue;
            }
            let from = match along {
                WallPosition::Anywhere => between(&mut self.random, 0.0, room),
                WallPosition::Corner => weighted(&mut self.random, &[(0.0, 0.4), (room, 0.4), (room * 0.15, 0.2)]),
                WallPosition::Middle => room * between(&mut self.random, 0.3, 0.7),
            } + GAP_M;
            let hides_window = wall.openings.iter().any(|o| {
                o.is_window() && from < o.s[1] + 0.05 && from + width > o.s[0] - 0.05 && max.y > o.h[0] + 0.02
            });
            if hides_window {
                continue;
            }
            let origin = wall.point(from - min.x, 0.0, GAP_M - min.z);
            if let Some(placed) = self.try_place(group, wall.yaw_rad(), origin, front_m) {
                return Some(placed);
            }
        }
        None
    }

    /// Places a group at a free position parallel to the walls, close to `near` if given.
    pub(crate) fn place_freely(&mut self, group: &Group, near: Option<Vec2>, margin_m: f32) -> Option<Vec<usize>> {
        let (min, max) = self.plan.extent();
        for attempt in 0..28 {
            let spread = 0.15 + 0.08 * attempt as f32;
            let p = match near {
                Some(near) => {
                    near + Vec2::new(
                        between(&mut self.random, -spread, spread),
                        between(&mut self.random, -spread, spread),
                    )
                }
                None => Vec2::new(between(&mut self.random, min.x, max.x), between(&mut self.random, min.y, max.y)),
            };
            let yaw = 0.5 * PI * count(&mut self.random, 0, 3) as f32;
            let (low, high) = group_bounds(group);
            let footprint = Footprint::of_box(low, high, yaw, p).expanded(margin_m);
            if !self.occupancy.fits(&self.plan, &footprint, [low.y.max(0.0), high.y]) {
                continue;
            }
            if let Some(placed) = self.try_place(group, yaw, Vec3::new(p.x, 0.0, p.y), 0.0) {
                return Some(placed);
            }
        }
        None
    }

    /// Places a group at `origin` if it fits there.
    pub(crate) fn try_place(&mut self, group: &Group, yaw_rad: f32, origin: Vec3, front_m: f32) -> Option<Vec<usize>> {
        let (min, max) = group_bounds(group);
        let at = Vec2::new(origin.x, origin.z);
        let footprint = Footprint::of_box(min, max, yaw_rad, at);
        let y = [min.y.max(0.0), max.y];
        if !self.occupancy.fits(&self.plan, &footprint, y) || !self.occupancy.leaves_passages(&footprint, y) {
            return None;
        }
        if front_m > 0.0 {
            let before = Vec3::new(min.x, 0.0, max.z);
            let front = Footprint::of_box(before, Vec3::new(max.x, 0.0, max.z + front_m), yaw_rad, at);
            if !self.occupancy.is_clear(&self.plan, &front, [0.02, 1.6]) {
                return None;
            }
            self.occupancy.keep_free(front, [0.02, 1.6]);
        }
        let mut placed = Vec::with_capacity(group.len());
        for (piece, offset, yaw) in group {
            let moved = at + rotated_yaw(*offset, yaw_rad);
            let object = self.add_piece(piece, Support::Floor, yaw_rad + yaw, Vec3::new(moved.x, 0.0, moved.y));
            let (min, max) = piece.shape.bounds();
            let own = Footprint::of_box(min, max, yaw_rad + yaw, moved);
            self.occupancy.occupy_for(own, [min.y.max(0.0), max.y], Some(object));
            placed.push(object);
        }
        // Keeps later objects out of the gaps inside the group.
        self.occupancy.keep_free(footprint, y);
        Some(placed)
    }

    /// Axis-aligned bounds of an object: minimum and maximum corner.
    pub(crate) fn object_bounds(&self, object: usize) -> (Vec3, Vec3) {
        let mut bounds = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for part in &self.shape.parts[self.objects[object].parts.clone()] {
            for t in &self.shape.triangles[part.triangles.clone()] {
                for &v in t {
                    let p = self.shape.positions[v as usize];
                    bounds = (bounds.0.min(p), bounds.1.max(p));
                }
            }
        }
        bounds
    }
}

/// Bounds of a group in its own frame: minimum and maximum corner.
pub(crate) fn group_bounds(group: &Group) -> (Vec3, Vec3) {
    group.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(min, max), (piece, offset, yaw)| {
        let (low, high) = piece.shape.bounds();
        let corners = Footprint::of_box(low, high, *yaw, *offset).corners();
        let flat = |p: Vec2, y: f32| Vec3::new(p.x, y, p.y);
        corners.into_iter().fold((min, max), |(a, b), p| (a.min(flat(p, low.y)), b.max(flat(p, high.y))))
    })
}
