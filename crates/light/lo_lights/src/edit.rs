//! Application of light edits: changed rows of the octree, and lights beside it.

use lo_geometry::Vec3;
use lo_octree::{Ancestor, LeafRows, LightOctree};
use lo_scene::{
    AnalyticLight, EditedLight, EmitterEdit, LightChange, LightEdits, LightShape, LitScene, MAX_LIGHT_RADIANCE,
    MAX_LIGHT_SIZE_M, MIN_LIGHT_SIZE_M, OctreeChange,
};

use crate::colour::gain_to_color;
use crate::emitters::Emitter;
use crate::shape::ClusterShape;

/// Distance in metres, beyond half its size, from which an emitter is a different one than was edited.
const SAME_M: f32 = 0.5;

/// Reasons why edits cannot be applied.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LightsError {
    /// There is no light of this name.
    #[error("the scene has no light {id}; it has {}", if known.is_empty() { "none".to_owned() } else { known.join(", ") })]
    Unknown {
        /// Requested name.
        id: String,
        /// Names of the lights in the scene.
        known: Vec<String>,
    },
    /// The emitter of this name is a different one than was edited.
    #[error(
        "light {id} is {distance_m:.1} m from its position when it was edited: the edit was made with another version of the program or the scene; reset it"
    )]
    Elsewhere {
        /// Name of the light.
        id: String,
        /// Distance in metres.
        distance_m: f32,
    },
}

/// Applies a scene's edits: [`LitScene::light`] becomes the edited light, and [`LitScene::edited`] the difference.
///
/// `found` are the [`emitters`](crate::emitters) of the scene, computed from this light or from one with other
/// radiances in the same nodes. A scene without light edits stays bit-identical.
///
/// An edit changes the direct light of an emitter. Light reflected by the room stays that of the estimate.
///
/// # Errors
/// If an edited emitter does not exist.
pub fn apply_edits(scene: &mut LitScene, edits: &LightEdits, found: &[Emitter]) -> Result<(), LightsError> {
    if !edits.has_lights() {
        return Ok(());
    }
    let mut edited = Vec::new();
    for edit in &edits.emitters {
        let emitter = edited_emitter(edit, found)?;
        edited.push((emitter, edit.change));
    }
    let moved = edited.iter().filter_map(|(emitter, change)| moved(&scene.light, emitter, change));
    let added = edits.added.iter().filter_map(|added| changed(&added.light, &added.change));
    let lights: Vec<AnalyticLight> = moved.chain(added).collect();
    let octree = change_octree(scene, &edited);
    let sun = lights.iter().any(|light| matches!(light.shape, LightShape::Sun { .. }));
    let sun_occluders = sun.then(|| sun_occluders(&scene.light, found)).flatten();
    scene.edited = Some(Box::new(EditedLight { octree, lights, sun_occluders }));
    Ok(())
}

/// Returns the emitter that an edit changes.
///
/// Names are ranks by flux. The emitter of the edit's name counts if it is at the edited position, else the nearest one
/// there.
///
/// # Errors
/// If there is no emitter at the edited position.
pub(crate) fn edited_emitter<'a>(edit: &EmitterEdit, found: &'a [Emitter]) -> Result<&'a Emitter, LightsError> {
    let away_m = |emitter: &Emitter| (emitter.surface.centre_m - edit.found_at_m).length();
    let is_there = |emitter: &&Emitter| away_m(emitter) <= SAME_M + 0.5 * emitter.surface.area_m2.sqrt();
    let named = found.iter().find(|emitter| emitter.id == edit.id);
    let near = || found.iter().filter(is_there).min_by(|a, b| away_m(a).total_cmp(&away_m(b)));
    named.filter(is_there).or_else(near).ok_or_else(|| match named {
        Some(emitter) => LightsError::Elsewhere { id: edit.id.clone(), distance_m: away_m(emitter) },
        None => LightsError::Unknown {
            id: edit.id.clone(),
            known: found.iter().map(|emitter| emitter.id.clone()).collect(),
        },
    })
}

/// Returns the edits of lights that do not exist: [`apply_edits`] fails because of them.
pub fn lost_edits(edits: &LightEdits, found: &[Emitter]) -> Vec<EmitterEdit> {
    edits.emitters.iter().filter(|edit| edited_emitter(edit, found).is_err()).cloned().collect()
}

/// Turns off all emitters of a scene, so that only reflected light remains. `found` is as in [`apply_edits`]; the
/// scene's own edits are ignored.
pub fn remove_emitters(scene: &mut LitScene, found: &[Emitter]) {
    let off = LightChange { on: false, ..LightChange::NONE };
    let edited: Vec<(&Emitter, LightChange)> = found.iter().map(|emitter| (emitter, off)).collect();
    let octree = change_octree(scene, &edited);
    scene.edited =
        octree.map(|octree| Box::new(EditedLight { octree: Some(octree), lights: Vec::new(), sun_occluders: None }));
}

/// Returns the gain of an emitter's light per channel.
fn gain(emitter: &Emitter, change: &LightChange) -> Vec3 {
    if !change.on {
        return Vec3::ZERO;
    }
    let colour = change.color.map_or(Vec3::ONE, |color| gain_to_color(emitter.excess, color));
    colour * change.scale
}

/// Changes the rows of the scene's light; returns `None` if nothing changes.
fn change_octree(scene: &mut LitScene, edited: &[(&Emitter, LightChange)]) -> Option<OctreeChange> {
    let in_place: Vec<(&Emitter, Vec3)> = edited
        .iter()
        .filter(|(_, change)| *change != LightChange::NONE)
        .map(|(emitter, change)| (*emitter, if change.at_m.is_some() { Vec3::ZERO } else { gain(emitter, change) }))
        .collect();
    if in_place.is_empty() {
        return None;
    }
    let light = &scene.light;
    // Per leaf: excess of edited emitters, radiance to add, and gain for images.
    let rows = |value: Vec3| -> Vec<Vec<Vec3>> { light.rgba.iter().map(|rows| vec![value; rows.len()]).collect() };
    let (mut given, mut added, mut gains) = (rows(Vec3::ZERO), rows(Vec3::ZERO), rows(Vec3::ONE));
    for (emitter, gain) in in_place {
        for part in &emitter.parts {
            let excess = part.excess(light);
            given[part.depth][part.row] += excess;
            added[part.depth][part.row] += excess * (gain - 1.0);
            gains[part.depth][part.row] = gain;
        }
    }
    let [given, added, gains] =
        [given, added, gains].map(|values| light.merged(|leaf| values[leaf.depth as usize][leaf.row]));
    let after = light.rows_with(|depth, row, radiance| radiance + added[depth][row]);
    let base = light.rows_with(|depth, row, radiance| radiance - given[depth][row]);
    let gain = light.rows_with(|depth, row, _| gains[depth][row]);
    let before = std::mem::replace(&mut scene.light.rgba, after);
    Some(OctreeChange { before, base, gain })
}

/// Converts a moved emitter to a light of its shape and flux; `None` if it was not moved or is off.
fn moved(light: &LightOctree, emitter: &Emitter, change: &LightChange) -> Option<AnalyticLight> {
    let centre_m = change.at_m?;
    let size = |m: f32| m.clamp(MIN_LIGHT_SIZE_M, MAX_LIGHT_SIZE_M);
    let shape = match emitter.surface.shape {
        ClusterShape::Panel { direction, across, size_m } => {
            LightShape::Rectangle { centre_m, direction, across, size_m: size_m.map(size), two_sided: false }
        }
        ClusterShape::Ball { radius_m } => LightShape::Sphere { centre_m, radius_m: size(radius_m) },
        ClusterShape::Concave => LightShape::Sphere {
            centre_m,
            radius_m: size(0.5 * (emitter.surface.area_m2 / std::f32::consts::PI).sqrt()),
        },
    };
    let given = emitter.parts.iter().map(|part| part.excess(light) * part.area_m2).sum::<Vec3>();
    let light = AnalyticLight { shape, radiance: (given / emitter.surface.area_m2).to_array() };
    changed(&light, &LightChange { at_m: None, ..*change })
}

/// Returns a light after a change; `None` if it is off.
fn changed(light: &AnalyticLight, change: &LightChange) -> Option<AnalyticLight> {
    let own = Vec3::from(light.radiance);
    let colour = change.color.map_or(Vec3::ONE, |color| gain_to_color(own, color));
    let radiance = (own * colour * change.scale).min(Vec3::splat(MAX_LIGHT_RADIANCE)).to_array();
    let mut shape = light.shape;
    if let (Some(at_m), LightShape::Rectangle { centre_m, .. } | LightShape::Sphere { centre_m, .. }) =
        (change.at_m, &mut shape)
    {
        *centre_m = at_m;
    }
    (change.on && radiance != [0.0; 3]).then_some(AnalyticLight { shape, radiance })
}

/// Returns the occluders of suns: observed leaves that are not emitters. Suns shine through windows and through
/// unobserved walls. `None` if there are no occluders.
fn sun_occluders(light: &LightOctree, emitters: &[Emitter]) -> Option<LightOctree> {
    let mut is_emitter: Vec<Vec<bool>> = light.rgba.iter().map(|rows| vec![false; rows.len()]).collect();
    for part in emitters.iter().flat_map(|emitter| &emitter.parts) {
        is_emitter[part.depth][part.row] = true;
    }
    let mut leaves: Vec<LeafRows> = light.octree.levels().iter().map(|_| LeafRows::default()).collect();
    for leaf in light.octree.leaf_nodes() {
        let depth = leaf.depth as usize;
        if light.seen[depth][leaf.row] > 0 && !is_emitter[depth][leaf.row] {
            leaves[depth].keys.push(light.octree.key(leaf));
            leaves[depth].rgba.push([0.0, 0.0, 0.0, light.rgba[depth][leaf.row][3]]);
            leaves[depth].seen.push(255);
        }
    }
    if leaves.iter().all(|leaves| leaves.keys.is_empty()) {
        return None;
    }
    LightOctree::from_leaves_by_depth(leaves, light.cube, light.octree.full_depth(), |_, _| Ancestor::Merged).ok()
}
