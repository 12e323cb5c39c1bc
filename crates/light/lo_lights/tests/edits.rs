//! Edits of arbitrary octrees change what they should, by the right amount, and nothing else.
#![allow(clippy::unwrap_used)]

use lo_geometry::{Camera, Cube, Vec3};
use lo_imaging::{Image, Photo};
use lo_lights::{apply_edits, emitters, list, remove_emitters};
use lo_octree::{LightOctree, key_from_xyz};
use lo_scene::{EmitterEdit, Frame, LightChange, LightColor, LightEdits, LitScene};
use proptest::prelude::*;

/// A scene with these cells of a cube of 16³ and their radiances; cells with an even x are observed.
fn scene(cells: &[([u32; 3], [f32; 3])]) -> LitScene {
    let seen = |xyz: [u32; 3]| if xyz[0].is_multiple_of(2) { 255 } else { 0 };
    let mut rows: Vec<(u32, [f32; 4], u8)> =
        cells.iter().map(|&(xyz, [r, g, b])| (key_from_xyz(xyz), [r, g, b, 0.95], seen(xyz))).collect();
    rows.sort_by_key(|row| row.0);
    rows.dedup_by_key(|row| row.0);
    let keys = rows.iter().map(|row| row.0).collect();
    let rgba = rows.iter().map(|row| row.1).collect();
    let seen = rows.iter().map(|row| row.2).collect();
    let light = LightOctree::from_leaves(keys, rgba, seen, Cube::centred(Vec3::ZERO, 4.0), 4, 2).unwrap();
    let camera = Camera::from_hfov_deg(70.0, 8, 6).unwrap();
    let photo = Photo::Srgb8(Image::from_fn(8, 6, |x, y| [(x * 30) as u8, (y * 40) as u8, 128]));
    LitScene::observed_only(light, Frame::new(photo, Image::new(8, 6, vec![1.5; 48]), camera, 1.0).unwrap())
}

/// The shell of the cube, with this radiance, and a lamp of four leaves in the ceiling.
fn room(wall: f32, lamp: [f32; 3]) -> LitScene {
    let shell = (0..16u32.pow(3)).map(|i| [i / 256, i / 16 % 16, i % 16]);
    let shell = shell.filter(|xyz| xyz.iter().any(|c| *c == 0 || *c == 15));
    let radiance = |xyz: [u32; 3]| if matches!(xyz, [7..=8, 15, 7..=8]) { lamp } else { [wall; 3] };
    scene(&shell.map(|xyz| (xyz, radiance(xyz))).collect::<Vec<_>>())
}

fn edited(scene: &LitScene, id: &str, change: LightChange) -> LitScene {
    let mut scene = scene.clone();
    let found = emitters(&scene);
    let found_at_m = found.iter().find(|emitter| emitter.id == id).unwrap().surface.centre_m;
    let emitters = vec![EmitterEdit { id: id.to_owned(), found_at_m, change }];
    apply_edits(&mut scene, &LightEdits { emitters, ..LightEdits::default() }, &found).unwrap();
    scene
}

#[test]
fn a_lamp_is_split_into_wall_and_light() {
    let scene = room(0.5, [10.0, 8.0, 6.0]);
    let lights = list(&scene, &LightEdits::default());
    assert_eq!(lights.len(), 1);
    assert!((lights[0].area_m2.unwrap() - 0.25).abs() < 1e-5);
    assert_eq!(lights[0].position_m.unwrap(), Vec3::new(0.0, 1.875, 0.0));
    assert_eq!(lights[0].direction.unwrap(), Vec3::NEG_Y);
    // Its excess over the walls' 0.5, as a share of the light of the inner faces: six of 3.5 m.
    let given = 0.25 * (lo_imaging::luminance([10.0, 8.0, 6.0]) - 0.5);
    let all = 6.0 * 3.5 * 3.5 * 0.5 + given;
    assert!((lights[0].flux_share.unwrap() / (given / all) - 1.0).abs() < 1e-3, "{:?}", lights[0].flux_share);
    let off = edited(&scene, "L1", LightChange { on: false, ..LightChange::NONE });
    for row in off.light.rgba.iter().flatten() {
        assert!(row[..3].iter().all(|c| (c - 0.5).abs() < 1e-4), "{row:?}");
    }
    let two = edited(&scene, "L1", LightChange { scale: 2.0, ..LightChange::NONE });
    let brightest = two.light.rgba[4].iter().map(|row| row[0]).fold(0.0, f32::max);
    assert!((brightest - 19.5).abs() < 1e-3, "{brightest}");
    assert_eq!(two.light.octree, scene.light.octree);
}

#[test]
fn nothing_is_an_emitter_in_a_room_of_one_radiance() {
    let mut scene = room(0.5, [0.5; 3]);
    assert!(list(&scene, &LightEdits::default()).is_empty());
    let before = scene.clone();
    remove_emitters(&mut scene, &[]);
    apply_edits(&mut scene, &LightEdits::default(), &[]).unwrap();
    assert!(scene == before);
}

fn cells() -> impl Strategy<Value = Vec<([u32; 3], [f32; 3])>> {
    let bright = prop_oneof![4 => 0.0f32..1.0, 1 => 1.0f32..100.0];
    prop::collection::vec((prop::array::uniform3(0u32..16), prop::array::uniform3(bright)), 1..200)
}

fn change() -> impl Strategy<Value = LightChange> {
    let color = prop::option::of(prop_oneof![
        (2000.0f32..10_000.0).prop_map(LightColor::Kelvin),
        prop::array::uniform3(0.01f32..5.0).prop_map(LightColor::Rgb),
    ]);
    (any::<bool>(), 0.0f32..10.0, color, any::<bool>()).prop_map(|(on, scale, color, moved)| LightChange {
        on,
        scale,
        color,
        at_m: moved.then_some(Vec3::new(0.1, 0.2, 0.3)),
    })
}

/// Emitters are found in one light and edited in another: `envmap` without `--lamp`.
#[test]
fn emitters_of_brighter_light_are_edited_by_their_share() {
    let mut dim = room(0.5, [1.0, 0.8, 0.6]);
    let bright = room(0.5, [10.0, 8.0, 6.0]);
    let found = emitters(&bright);
    assert!(emitters(&dim).is_empty() && found.len() == 1);
    let found_at_m = found[0].surface.centre_m;
    let change = LightChange { on: false, ..LightChange::NONE };
    let emitters = vec![EmitterEdit { id: "L1".to_owned(), found_at_m, change }];
    apply_edits(&mut dim, &LightEdits { emitters, ..LightEdits::default() }, &found).unwrap();
    // A twentieth of it is the wall's.
    let darkest = dim.light.rgba[4].iter().map(|row| row[0]).fold(f32::INFINITY, f32::min);
    assert!((darkest - 0.05).abs() < 1e-4, "{darkest}");
}

proptest! {
    #[test]
    fn any_edit_of_any_octree_is_finite_and_keeps_its_nodes(cells in cells(), change in change()) {
        let scene = scene(&cells);
        for light in list(&scene, &LightEdits::default()) {
            let after = edited(&scene, &light.id, change);
            prop_assert!(after.light.octree == scene.light.octree && after.light.seen == scene.light.seen);
            for (now, before) in after.light.rgba.iter().flatten().zip(scene.light.rgba.iter().flatten()) {
                prop_assert!(now.iter().all(|c| c.is_finite() && *c >= 0.0) && now[3] == before[3], "{now:?}");
            }
            let beside = after.edited.as_ref().map_or(0, |edited| edited.lights.len());
            prop_assert_eq!(beside, usize::from(change.on && change.scale > 0.0 && change.at_m.is_some()));
        }
    }

    /// Every leaf is linear in the scale, and the identity edit changes nothing.
    #[test]
    fn leaves_are_linear_in_the_scale(cells in cells(), scale in 0.0f32..8.0) {
        let scene = scene(&cells);
        let scaled = |id: &str, scale| edited(&scene, id, LightChange { scale, ..LightChange::NONE }).light.rgba;
        for light in list(&scene, &LightEdits::default()) {
            let (off, after) = (scaled(&light.id, 0.0), scaled(&light.id, scale));
            prop_assert!(scaled(&light.id, 1.0) == scene.light.rgba);
            for ((off, one), after) in off[4].iter().zip(&scene.light.rgba[4]).zip(&after[4]) {
                for c in 0..3 {
                    let expected = off[c] + scale * (one[c] - off[c]);
                    prop_assert!((after[c] - expected).abs() <= 1e-4 * (1.0 + expected), "{off:?} {one:?} {after:?}");
                }
            }
        }
    }

    /// Without emitters no leaf is brighter than before.
    #[test]
    fn without_emitters_nothing_is_brighter(cells in cells()) {
        let mut scene = scene(&cells);
        let (before, found) = (scene.light.clone(), emitters(&scene));
        remove_emitters(&mut scene, &found);
        let mut dimmed = false;
        for (now, before) in scene.light.rgba[4].iter().zip(&before.rgba[4]) {
            prop_assert!((0..3).all(|c| now[c] <= before[c] + 1e-5));
            dimmed |= now != before;
        }
        prop_assert_eq!(dimmed, !found.is_empty());
    }
}
