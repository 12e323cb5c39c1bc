//! Tables.

use geometry::{Vec2, Vec3};

use crate::chance::between;
use crate::palette::Finish;
use crate::solids::Shape;
use crate::stage::{Piece, Stage};

/// 75 cm high.
pub(crate) fn dining_table(stage: &mut Stage) -> Piece {
    let wood = stage.palette.paint(Finish::Wood);
    let half = Vec2::new(between(&mut stage.random, 0.6, 1.0), between(&mut stage.random, 0.38, 0.48));
    let mut shape = Shape::default();
    shape.rounded(Vec3::new(-half.x, 0.71, -half.y), Vec3::new(half.x, 0.75, half.y), 0.006, 1, wood);
    for (x, z) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let p = Vec3::new(x * (half.x - 0.06), 0.0, z * (half.y - 0.06));
        shape.board(p - Vec3::new(0.03, 0.0, 0.03), p + Vec3::new(0.03, 0.711, 0.03), wood);
    }
    Piece::new("dining table", shape).with_top(Vec3::new(0.0, 0.75, 0.0), half - Vec2::splat(0.05), 1.0)
}

/// A small one.
pub(crate) fn side_table(stage: &mut Stage) -> Piece {
    let wood = stage.palette.paint(Finish::Wood);
    let mut shape = Shape::default();
    shape.lathe(
        Vec3::ZERO,
        &[[0.18, 0.0], [0.18, 0.02], [0.02, 0.03], [0.02, 0.47], [0.25, 0.48], [0.25, 0.5]],
        24,
        wood,
    );
    Piece::new("side table", shape).with_top(Vec3::new(0.0, 0.5, 0.0), Vec2::splat(0.15), 1.0)
}
