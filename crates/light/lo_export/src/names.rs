//! Names of lamps: those of the list of lights.

use std::collections::HashMap;

use lo_geometry::Vec3;
use lo_lights::{LightKind, LightOrigin, ListedLight};
use lo_scene::LightShape;

use crate::lamps::Lamp;

/// Largest distance in metres, beyond half its size, between a lamp of leaves and the light that it belongs to. Equal
/// to the tolerance for edits of lights.
const SAME_M: f32 = 0.5;

/// Largest distance between an added lamp and its light, in metres, or between the unit directions of suns.
const EQUAL: f32 = 1e-3;

/// Names lamps of leaves after the nearest emitter, and removes those that are not listed: their faces keep their
/// light.
pub(crate) fn name_emitters(lamps: &mut Vec<Lamp>, lights: &[ListedLight]) {
    lamps.retain_mut(|lamp| {
        let reach_m = |light: &ListedLight| SAME_M + 0.5 * light.area_m2.unwrap_or(0.0).max(lamp.light.extent()).sqrt();
        let found = lights.iter().filter(|light| light.origin != LightOrigin::Added);
        let distance_m = |light: &ListedLight| Some((centre_m(lamp)? - light.position_m?).length());
        let near = found.filter_map(|light| Some((distance_m(light).filter(|m| *m <= reach_m(light))?, light)));
        lamp.id = near.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, light)| light.id.clone());
        lamp.id.is_some()
    });
}

/// Names the lamps of added and moved lights after these.
pub(crate) fn name_added(lamps: &mut [Lamp], lights: &[ListedLight]) {
    for lamp in lamps {
        let is_same = |light: &&ListedLight| {
            let moved_to = light.change.and_then(|change| change.at_m);
            let is_outside_octree = light.origin == LightOrigin::Added || moved_to.is_some();
            is_outside_octree
                && match lamp.light.shape {
                    LightShape::Sun { direction, .. } => {
                        light.kind == LightKind::Sun
                            && light.direction.is_some_and(|of| (of - direction).length() < EQUAL)
                    }
                    _ => {
                        let at_m = moved_to.or(light.position_m);
                        at_m.zip(centre_m(lamp)).is_some_and(|(a, b)| (a - b).length() < EQUAL)
                    }
                }
        };
        lamp.id = lights.iter().find(is_same).map(|light| light.id.clone());
    }
}

/// Makes the names unique, such as `L1` and `L1 2`, and returns the number of lamps of each light.
pub(crate) fn number(lamps: &mut [Lamp], lights: &[ListedLight]) -> Vec<(String, usize)> {
    let mut counts: HashMap<String, usize> = HashMap::new();
    for id in lamps.iter_mut().filter_map(|lamp| lamp.id.as_mut()) {
        let count = counts.entry(id.clone()).or_default();
        *count += 1;
        if *count > 1 {
            *id = format!("{id} {count}");
        }
    }
    lights.iter().map(|light| (light.id.clone(), counts.get(&light.id).copied().unwrap_or(0))).collect()
}

fn centre_m(lamp: &Lamp) -> Option<Vec3> {
    lamp.light.centre_m()
}
