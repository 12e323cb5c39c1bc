//! Surface points, from which octrees are built, hold the light seen in the room.

use crate::support::{Builder, RoomLight, living_room};
use lo_geometry::Vec3;
use lo_octree::RadiancePoint;
use lo_transport::{BakeSettings, BakedWorld, Portal};

const LEAF_M: f32 = 0.05;

fn mean(points: &[RadiancePoint], inside: impl Fn(Vec3) -> bool) -> Option<f32> {
    let found: Vec<f32> = points.iter().filter(|p| inside(p.position_m)).map(|p| p.radiance[1]).collect();
    (!found.is_empty()).then(|| found.iter().sum::<f32>() / found.len() as f32)
}

/// A room of 4 × 2.5 × 4 m under one bright ceiling panel, with a closed cupboard of thin boards.
fn with_cupboard() -> Vec<RadiancePoint> {
    let mut b = Builder::new();
    let grey = b.matte([0.5; 3]);
    let lamp = b.lamp([10.0; 3]);
    b.room(Vec3::new(4.0, 2.5, 4.0), 2, grey);
    b.sheet(Vec3::new(-0.5, 2.49, -0.5), Vec3::X, Vec3::Z, [2, 2], lamp);
    // Six boards of 2 cm around an unlit 1 × 1 × 0.5 m. Their edges overlap.
    let (center, size, t) = (Vec3::new(0.0, 0.52, -1.7), Vec3::new(1.0, 1.0, 0.5), 0.02);
    for axis in 0..3 {
        for side in [-1.0, 1.0] {
            let mut board = size + Vec3::splat(2.0 * t);
            board[axis] = t;
            let offset = Vec3::AXES[axis] * (side * 0.5 * (size[axis] + t));
            b.solid(center + offset, board, 0.0, 1, grey);
        }
    }
    BakedWorld::bake(b.world([0.0; 3], None, Vec::new()), &BakeSettings::default())
        .unwrap()
        .radiance_points(LEAF_M)
        .points
}

#[test]
fn insides_of_boards_and_cupboards_do_not_darken_their_outsides() {
    let points = with_cupboard();
    assert!(mean(&points, |p| p.x.abs() < 0.45 && (0.1..0.9).contains(&p.y) && (p.z + 1.7).abs() < 0.2).is_none());
    // The cupboard's top is as bright as light from above makes it, although it is only 2 cm thick. The point below the
    // lamp's centre, 1.45 m away, receives an irradiance above 2.4 by the corner formula of rectangles.
    let top = |p: Vec3| p.x.abs() < 0.4 && (p.y - 1.03).abs() < 0.02 && (p.z + 1.7).abs() < 0.2;
    let faces: Vec<&RadiancePoint> = points.iter().filter(|p| top(p.position_m)).collect();
    assert!(!faces.is_empty());
    let least = faces.iter().map(|p| p.radiance[1]).fold(f32::INFINITY, f32::min);
    let most = faces.iter().map(|p| p.radiance[1]).fold(0.0, f32::max);
    assert!(least > 0.4 * most, "{least} to {most}");
}

#[test]
fn a_window_shows_the_sky_that_the_room_sees() {
    let mut b = Builder::new();
    let grey = b.matte([0.5; 3]);
    // A room open at z = −2, with a portal there.
    let (w, h, d) = (Vec3::X * 4.0, Vec3::Y * 2.5, Vec3::Z * 4.0);
    let corner = Vec3::new(-2.0, 0.0, -2.0);
    b.sheet(corner, d, w, [2, 2], grey);
    b.sheet(corner + h, w, d, [2, 2], grey);
    b.sheet(corner, h, d, [2, 2], grey);
    b.sheet(corner + w, d, h, [2, 2], grey);
    b.sheet(corner + d, h, w, [2, 2], grey);
    let portal = Portal { corner, edges: [w, h] };
    let world = b.world([3.0, 2.0, 1.0], None, vec![portal]);
    let points = BakedWorld::bake(world, &BakeSettings::default()).unwrap().radiance_points(LEAF_M).points;
    let window: Vec<&RadiancePoint> =
        points.iter().filter(|p| p.position_m.z < -1.999 && p.position_m.x.abs() < 1.9).collect();
    // Eight points per leaf face, and only the sky's radiance on them.
    assert!(window.len() > (7.5 * 3.8 * 2.5 / (LEAF_M * LEAF_M)) as usize, "{}", window.len());
    assert!(
        window
            .iter()
            .filter(|p| (0.1..2.4).contains(&p.position_m.y))
            .all(|p| { p.radiance.iter().zip([3.0, 2.0, 1.0]).all(|(found, sky)| (found - sky).abs() < 1e-3) })
    );
}

#[test]
fn points_are_where_the_walls_are() {
    let light = RoomLight { sky: [1.0; 3], sun: None, lamps: true };
    let baked =
        BakedWorld::bake(living_room(&light), &BakeSettings { spacing_m: 0.3, ..BakeSettings::default() }).unwrap();
    let points = baked.radiance_points(0.1).points;
    let model = baked.prepared().model();
    let (low, high) =
        model.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(l, h), &p| (l.min(p), h.max(p)));
    assert!(points.iter().all(|p| p.position_m.cmpge(low - 1e-4).all() && p.position_m.cmple(high + 1e-4).all()));
}
