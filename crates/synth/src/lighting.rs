//! Lamps.

use geometry::{Quat, Vec2, Vec3};

use crate::chance::between;
use crate::description::{Lighting, RoomKind};
use crate::palette::Finish;
use crate::photometry::{self, Glow};
use crate::solids::Shape;
use crate::stage::{Stage, Support};

/// Hangs lamps and switches on those that the lighting asks for.
pub(crate) fn light(stage: &mut Stage, _kind: RoomKind, lighting: Lighting) {
    let [a, b] = stage.plan.rectangles[0];
    let center = (a + b) * 0.5;
    let top = stage.plan.ceiling(center);
    let metal = stage.palette.paint(Finish::Metal);
    let mut shape = Shape::default();
    let first = shape.triangles.len();
    shape.lathe(Vec3::new(0.0, -0.05, 0.0), &[[0.18, 0.0], [0.2, 0.01], [0.2, 0.03]], 24, metal);
    stage.lamps += 1;
    if lighting != Lighting::Daylight {
        let glow = Glow { flux_lm: between(&mut stage.random, 1500.0, 4000.0), kelvin: 3000.0 };
        photometry::light(&mut stage.palette, &mut shape, first, &glow);
        stage.lamps_on += 1;
        stage.flux_lm += glow.flux_lm;
    }
    shape.lathe(Vec3::new(0.0, -0.02, 0.0), &[[0.21, 0.0], [0.21, 0.0195]], 24, metal);
    let _ = Vec2::ZERO;
    stage.fix("ceiling lamp", Support::Ceiling, &shape, Quat::IDENTITY, Vec3::new(center.x, top, center.y));
}
