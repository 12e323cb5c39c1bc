//! Sizes that are probably wrong: of models in other units than assumed.

use lo_geometry::Cube;
use lo_scene::{Estimate, Side};

use crate::{InsertWarning, Instance, Unit};

/// Longest edge of an object's bounding box below which it is too small, metres.
const SMALLEST_M: f32 = 0.002;

/// Smallest plausible longest edge of an object in a suggested unit, metres.
const PLAUSIBLE_M: f64 = 0.03;

/// Extent of a room, which limits objects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoomSize {
    height_m: f32,
    cube: Cube,
}

impl RoomSize {
    /// Measures the room of an estimate; without planes of floor and ceiling, its cube.
    pub fn new(scene: &Estimate) -> Self {
        let cube = scene.light.cube;
        let plane = |side: Side| scene.room.as_ref()?.planes.iter().find(|plane| plane.side == side);
        let height_m = plane(Side::Floor)
            .zip(plane(Side::Ceiling))
            // The camera, at the origin, is between them.
            .map(|(floor, ceiling)| -(floor.plane.offset_m + ceiling.plane.offset_m))
            .filter(|height_m| *height_m > 0.0 && *height_m < cube.edge_m);
        Self { height_m: height_m.unwrap_or(cube.edge_m), cube }
    }

    /// Returns the warning about object number `object` if it is higher or wider than the room, or a speck.
    pub fn warning(&self, object: usize, instance: &Instance) -> Option<InsertWarning> {
        let size_m = instance.model.bounds().size() * instance.placement.scale;
        let (height_m, longest_m) = (size_m.y, size_m.max_element());
        if height_m > self.height_m {
            let likely = self.likely_unit(size_m.y, size_m.max_element());
            Some(InsertWarning::ObjectTooHigh { object, height_m, room_m: self.height_m, likely })
        } else if longest_m > self.cube.edge_m {
            let likely = self.likely_unit(size_m.y, longest_m);
            Some(InsertWarning::ObjectTooWide { object, width_m: longest_m, room_m: self.cube.edge_m, likely })
        } else if longest_m < SMALLEST_M {
            Some(InsertWarning::ObjectTooSmall { object, size_m: longest_m })
        } else {
            None
        }
    }

    /// Returns the unit that makes a size in metres plausible in this room.
    fn likely_unit(&self, height_m: f32, longest_m: f32) -> Option<Unit> {
        let fits = |unit: &Unit| {
            let metres = unit.metres();
            f64::from(height_m) * metres <= f64::from(self.height_m)
                && f64::from(longest_m) * metres <= f64::from(self.cube.edge_m)
                && f64::from(longest_m) * metres >= PLAUSIBLE_M
        };
        Unit::ALL.into_iter().filter(|unit| *unit != Unit::Metre).find(fits)
    }
}

#[cfg(test)]
mod tests {
    use lo_geometry::Vec3;

    use super::*;

    #[test]
    fn the_likely_unit_fits_into_the_room() {
        let room = RoomSize { height_m: 2.6, cube: Cube::centred(Vec3::ZERO, 6.0) };
        // A head of 30 cm, a cupboard of 1.8 m, a city block, in the number of units that the file has.
        assert_eq!(room.likely_unit(30.0, 35.0), Some(Unit::Centimetre));
        assert_eq!(room.likely_unit(60.0, 60.0), Some(Unit::Centimetre));
        assert_eq!(room.likely_unit(1800.0, 1800.0), Some(Unit::Millimetre));
        assert_eq!(room.likely_unit(8000.0, 8000.0), None);
        // 2.9 units: too high in metres; as centimetres it would be a pebble.
        assert_eq!(room.likely_unit(2.9, 2.9), Some(Unit::Inch));
    }
}
