//! Views from outside of a closed, completely known room: 8³ leaves of 0.5 m around the camera, 3 m wide inside.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use lightoctree::Estimate;
use lo_export::RoomFaces;
use lo_geometry::{Camera, Cube, Vec3};
use lo_imaging::{Image, Photo, srgb8_from_linear};
use lo_octree::{LightOctree, key_from_xyz};
use lo_scene::{Frame, LightChange};
use lo_session::{
    Command, LitSceneCache, ObjectPosition, ObjectSize, OpenScene, OutsideRenderer, OutsideView, Overlay, Session,
    SessionError, State, overlay,
};

/// Radiance of the wall ahead (−z), which the photo shows, of the wall behind the camera, and of the rest.
const AHEAD: [f32; 3] = [0.2, 0.5, 0.1];
const BEHIND: [f32; 3] = [0.6, 0.1, 0.1];
const REST: [f32; 3] = [0.3; 3];
/// A leaf of the wall ahead, left of its centre and above it, and its radiance.
const MARK: [u32; 3] = [2, 5, 0];
const MARK_RADIANCE: [f32; 3] = [0.05, 0.05, 0.9];
/// Radiance of four leaves in the middle of the ceiling.
const LAMP: [f32; 3] = [10.0, 8.0, 6.0];

/// Builds a scene of leaves: shuffled key, radiance with opacity, and observed share.
fn scene(mut cells: Vec<(u32, [f32; 4], u8)>, cube: Cube, depth: u32) -> Arc<OpenScene> {
    cells.sort_by_key(|cell| cell.0);
    let keys = cells.iter().map(|cell| cell.0).collect();
    let rgba = cells.iter().map(|cell| cell.1).collect();
    let seen = cells.iter().map(|cell| cell.2).collect();
    let light = LightOctree::from_leaves(keys, rgba, seen, cube, depth, 1).unwrap();
    let photo = Photo::Srgb8(Image::new(8, 6, vec![[120; 3]; 48]));
    let camera = Camera::new(5.0, 5.0, 4.0, 3.0, 8, 6).unwrap();
    let frame = Frame::new(photo, Image::new(8, 6, vec![1.5; 48]), camera, 1.0).unwrap();
    Arc::new(OpenScene::new("room.scene", Estimate::observed_only(light, frame)))
}

fn room() -> Arc<OpenScene> {
    let cells = (0..512u32).map(|i| [i / 64, i / 8 % 8, i % 8]);
    let shell = cells.filter(|xyz| xyz.iter().any(|c| *c == 0 || *c == 7));
    let cells = shell
        .map(|xyz| {
            let [r, g, b] = match xyz {
                MARK => MARK_RADIANCE,
                [3..=4, 7, 3..=4] => LAMP,
                [.., 0] => AHEAD,
                [.., 7] => BEHIND,
                _ => REST,
            };
            (key_from_xyz(xyz), [r, g, b, 0.99], if xyz[2] == 0 { 255 } else { 0 })
        })
        .collect();
    scene(cells, Cube::centred(Vec3::ZERO, 4.0), 3)
}

fn view(eye_m: [f32; 3]) -> OutsideView {
    OutsideView {
        eye_m,
        target_m: [0.0; 3],
        fov_deg: 40.0,
        width: 161,
        height: 121,
        exposure_ev: 0.0,
        show: None,
        still: false,
    }
}

fn picture(open: &Arc<OpenScene>, state: &State, view: &OutsideView) -> Image<[u8; 3]> {
    OutsideRenderer::new(Arc::new(LitSceneCache::new(open.clone()))).render(state, view, &|| false).unwrap().unwrap()
}

const MIDDLE: (usize, usize) = (80, 60);

fn code(radiance: [f32; 3]) -> [u8; 3] {
    radiance.map(srgb8_from_linear)
}

/// Projects a point by its angles to the axis, in f64.
fn seen_at(view: &OutsideView, point: [f64; 3]) -> (usize, usize) {
    let minus = |a: [f64; 3], b: [f64; 3]| [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let unit = |a: [f64; 3]| a.map(|c| c / dot(a, a).sqrt());
    let eye = view.eye_m.map(f64::from);
    let ahead = unit(minus(view.target_m.map(f64::from), eye));
    // Horizontal right; up is the component of +Y orthogonal to the axis.
    let right = unit([-ahead[2], 0.0, ahead[0]]);
    let up = unit(minus([0.0, 1.0, 0.0], ahead.map(|c| c * ahead[1])));
    let offset = minus(point, eye);
    let half_height = (0.5 * f64::from(view.fov_deg).to_radians()).tan();
    let across = |axis| dot(offset, axis) / dot(offset, ahead) / half_height * 0.5 * f64::from(view.height);
    let (x, y) = (0.5 * f64::from(view.width) + across(right), 0.5 * f64::from(view.height) - across(up));
    (x as usize, y as usize)
}

#[test]
fn walls_are_seen_from_the_rooms_side_alone() {
    let open = room();
    let state = State::default();
    // The near wall is invisible: the wall behind the camera from behind, the wall ahead from in front.
    for (eye_m, far_wall) in [([0.0, 0.0, 6.0], AHEAD), ([0.0, 0.0, -6.0], BEHIND), ([0.5, 1.0, 6.0], AHEAD)] {
        assert_eq!(picture(&open, &state, &view(eye_m))[MIDDLE], code(far_wall), "{eye_m:?}");
    }
    // The same through the ceiling; next to the room is background.
    let above = OutsideView { fov_deg: 60.0, ..view([0.0, 6.0, 0.1]) };
    let image = picture(&open, &state, &above);
    assert_eq!((image[MIDDLE], image[(0, 0)]), (code(REST), [48; 3]));
    // A viewpoint inside works, too.
    assert_eq!(picture(&open, &state, &view([0.0, 0.0, 1.0]))[MIDDLE], code(AHEAD));
    let brighter = OutsideView { exposure_ev: 1.0, ..view([0.0, 0.0, 6.0]) };
    assert_eq!(picture(&open, &state, &brighter)[MIDDLE], code(AHEAD.map(|c| 2.0 * c)));
    // Four rays of one colour give that colour; at edges, a mixture.
    let still = picture(&open, &state, &OutsideView { still: true, ..view([0.0, 0.0, 6.0]) });
    assert_eq!(still[MIDDLE], code(AHEAD));
    let known = [[48; 3], code(AHEAD), code(REST), code(MARK_RADIANCE), [255; 3]];
    assert!(still.pixels().iter().any(|color| !known.contains(color)));
}

#[test]
fn inferred_surfaces_are_transparent_in_front_of_observed_ones() {
    // A leaf in the middle of the room, in front of the wall that the photo shows.
    let with_leaf = |seen: u8| {
        let shell =
            (0..512u32).map(|i| [i / 64, i / 8 % 8, i % 8]).filter(|xyz| xyz.iter().any(|c| [0, 7].contains(c)));
        let mut cells: Vec<(u32, [f32; 4], u8)> = shell
            .map(|xyz| {
                let ([r, g, b], seen) = if xyz[2] == 0 { (AHEAD, 255) } else { (REST, 0) };
                (key_from_xyz(xyz), [r, g, b, 0.99], seen)
            })
            .collect();
        let [r, g, b] = MARK_RADIANCE;
        cells.push((key_from_xyz([4, 4, 2]), [r, g, b, 0.99], seen));
        scene(cells, Cube::centred(Vec3::ZERO, 4.0), 3)
    };
    let onto = |x: f32| OutsideView { target_m: [x, 0.25, 0.0], ..view([x, 0.25, 6.0]) };
    let seen = picture(&with_leaf(255), &State::default(), &onto(0.25));
    assert_eq!(seen[MIDDLE], code(MARK_RADIANCE));
    let inferred = picture(&with_leaf(0), &State::default(), &onto(0.25));
    let expected =
        std::iter::zip(code(MARK_RADIANCE), code(AHEAD)).map(|(a, b)| 0.3 * f32::from(a) + 0.7 * f32::from(b));
    for (code, expected) in std::iter::zip(inferred[MIDDLE], expected) {
        assert!((f32::from(code) - expected).abs() <= 1.0, "{:?}", inferred[MIDDLE]);
    }
    assert_eq!(picture(&with_leaf(0), &State::default(), &onto(-0.8))[MIDDLE], code(AHEAD));
    // In front of other inferred surfaces it is opaque.
    let from_the_side = OutsideView { target_m: [0.0, 0.25, -0.7], ..view([6.0, 0.25, -0.7]) };
    assert_eq!(picture(&with_leaf(0), &State::default(), &from_the_side)[MIDDLE], code(MARK_RADIANCE));
}

#[test]
fn a_hole_in_a_wall_does_not_show_the_walls_from_behind() {
    // Walls of 0.25 m around 3.5 m of air, in a cube of 8 m, with a hole of 1 m in the right one.
    let cells = (0..32u32.pow(3)).map(|i| [i / 1024, i / 32 % 32, i % 32]);
    let shell = cells.filter(|xyz| xyz.iter().all(|c| (8..24).contains(c)) && xyz.iter().any(|c| *c == 8 || *c == 23));
    let shell = shell.filter(|xyz| !matches!(xyz, [23, 12..16, 12..16]));
    let color = |z: u32| match z {
        8 => AHEAD,
        23 => BEHIND,
        _ => REST,
    };
    let cells = shell.map(|xyz| {
        let [r, g, b] = color(xyz[2]);
        (key_from_xyz(xyz), [r, g, b, 0.99], 255)
    });
    let open = scene(cells.collect(), Cube::centred(Vec3::ZERO, 8.0), 5);
    // Air reaches the outer sides, too: 6 × 14² faces are inside.
    assert!(RoomFaces::of(&open.estimate().light).quads.len() > 2 * 6 * 14 * 14);
    for (eye_m, far_wall) in [([0.0, 0.0, 6.0], AHEAD), ([0.0, 0.0, -6.0], BEHIND), ([-6.0, -0.3, -0.9], REST)] {
        assert_eq!(picture(&open, &State::default(), &view(eye_m))[MIDDLE], code(far_wall), "{eye_m:?}");
    }
}

#[test]
fn points_are_seen_where_the_formula_says() {
    let open = room();
    for eye_m in [[0.3, 0.2, 6.0], [2.5, 1.5, 5.0], [-2.0, 3.0, 4.0]] {
        let view = view(eye_m);
        let image = picture(&open, &State::default(), &view);
        // The inner face of the marked leaf: its centre, and points just inside and outside its corners.
        let [x, y] = [-2.0 + 0.5 * f64::from(MARK[0]), -2.0 + 0.5 * f64::from(MARK[1])];
        let at = |dx: f64, dy: f64| image[seen_at(&view, [x + dx, y + dy, -1.5])];
        assert_eq!(at(0.25, 0.25), code(MARK_RADIANCE), "{eye_m:?}");
        for (dx, dy) in [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)] {
            // A pixel is about 3 cm of that wall.
            let inside = |side: f64| 0.05 + 0.4 * side;
            let outside = |side: f64| -0.05 + 0.6 * side;
            assert_eq!(at(inside(dx), inside(dy)), code(MARK_RADIANCE), "{eye_m:?} {dx} {dy}");
            assert_eq!(at(outside(dx), outside(dy)), code(AHEAD), "{eye_m:?} {dx} {dy}");
        }
    }
}

#[test]
fn overlays_colour_observed_and_inferred_leaves() {
    let open = room();
    let hue = |color: [u8; 3]| color.map(|c| f32::from(c) / f32::from(*color.iter().max().unwrap()));
    let near = |a: [u8; 3], b: [u8; 3]| hue(a).iter().zip(hue(b)).all(|(a, b)| (a - b).abs() < 0.02);
    let shown =
        |eye_m, what| picture(&open, &State::default(), &OutsideView { show: Some(what), ..view(eye_m) })[MIDDLE];
    let (from_behind, from_before) = ([0.0, 0.0, 6.0], [0.0, 0.0, -6.0]);
    let legend = |what| overlay(&open, what).unwrap().legend;
    let [(photo, _), (guess, _)] = legend(Overlay::Provenance)[..] else { panic!() };
    assert!(near(shown(from_behind, Overlay::Provenance), photo));
    assert!(near(shown(from_before, Overlay::Provenance), guess));
    // All leaves have the octree's depth. The wall ahead faces the camera and has the photo's only depth.
    assert!(near(shown(from_behind, Overlay::Levels), legend(Overlay::Levels)[0].0));
    assert_eq!(shown(from_behind, Overlay::Normals), legend(Overlay::Normals)[2].0);
    assert_eq!(shown(from_behind, Overlay::Depth), legend(Overlay::Depth)[0].0);
}

#[test]
fn objects_hide_what_is_behind_them() {
    let open = room();
    let mut session = Session::new(open.clone()).unwrap();
    session.apply(&Command::Add { mesh: "builtin:sphere".into(), pixel: None, material: None }).unwrap();
    session.apply(&Command::Size { object: 1, size: ObjectSize::Height(0.4) }).unwrap();
    let place = |session: &mut Session, at: [f64; 3]| {
        session.apply(&Command::Place { object: 1, place: ObjectPosition::Position(at) }).unwrap();
    };
    let view = view([1.0, 0.5, 5.0]);
    let empty = picture(&open, &State::default(), &view);
    // The position is the base: the centre is 0.2 m above.
    place(&mut session, [0.4, 0.0, -0.5]);
    let image = picture(&open, session.state(), &view);
    let at = |x: f64, y: f64| seen_at(&view, [x, y, -0.5]);
    for (x, y) in [(0.4, 0.2), (0.25, 0.2), (0.55, 0.2), (0.4, 0.05), (0.4, 0.35)] {
        let [r, g, b] = image[at(x, y)];
        assert!(r == g && g == b && r > 60 && image[at(x, y)] != empty[at(x, y)], "{x} {y}: {:?}", image[at(x, y)]);
    }
    for (x, y) in [(0.15, 0.2), (0.65, 0.2), (0.4, -0.05), (0.4, 0.45)] {
        assert_eq!(image[at(x, y)], empty[at(x, y)], "{x} {y}");
    }
    // Behind a wall's inner side it is hidden, and the former position shows the room.
    place(&mut session, [0.4, 0.0, -3.0]);
    assert_eq!(picture(&open, session.state(), &view), empty);
}

#[test]
fn edits_of_the_light_are_seen() {
    let open = room();
    let mut session = Session::new(open.clone()).unwrap();
    // The ceiling from below, through the floor.
    let view = OutsideView { fov_deg: 60.0, ..view([0.0, -6.0, 0.1]) };
    assert_eq!(picture(&open, session.state(), &view)[MIDDLE], [255; 3]);
    session
        .apply(&Command::SetLight { light: "L1".into(), change: LightChange { on: false, ..LightChange::NONE } })
        .unwrap();
    // One renderer for both, as in the running program.
    let mut outside = OutsideRenderer::new(Arc::new(LitSceneCache::new(open.clone())));
    let mut middle = |state: &State| outside.render(state, &view, &|| false).unwrap().unwrap()[MIDDLE];
    assert!(middle(session.state())[0] < 200);
    assert_eq!(middle(&State::default()), [255; 3]);
}

#[test]
fn views_out_of_range_are_refused() {
    let up = Vec3::Y;
    let good = view([0.0, 1.0, 6.0]);
    good.check(up).unwrap();
    OutsideView { width: 1920, height: 1440, fov_deg: 120.0, exposure_ev: -20.0, ..good }.check(up).unwrap();
    OutsideView { width: 1, height: 1, ..good }.check(up).unwrap();
    let wrong = [
        OutsideView { eye_m: [f32::NAN, 0.0, 0.0], ..good },
        OutsideView { eye_m: [0.0, f32::INFINITY, 0.0], ..good },
        OutsideView { eye_m: [0.0, 0.0, 1001.0], ..good },
        OutsideView { target_m: [0.0, -1e30, 0.0], ..good },
        OutsideView { target_m: good.eye_m, ..good },
        // Vertical direction.
        OutsideView { target_m: [0.0, 9.0, 6.0], ..good },
        OutsideView { fov_deg: 0.0, ..good },
        OutsideView { fov_deg: 180.0, ..good },
        OutsideView { fov_deg: f32::NAN, ..good },
        OutsideView { width: 0, ..good },
        OutsideView { width: 1921, ..good },
        OutsideView { height: 1441, ..good },
        OutsideView { height: u32::MAX, ..good },
        OutsideView { exposure_ev: f32::NAN, ..good },
        OutsideView { exposure_ev: 21.0, ..good },
    ];
    let open = room();
    let mut outside = OutsideRenderer::new(Arc::new(LitSceneCache::new(open)));
    for view in wrong {
        assert!(matches!(view.check(up), Err(SessionError::OutOfRange(_))), "{view:?}");
        assert!(outside.render(&State::default(), &view, &|| false).is_err(), "{view:?}");
    }
}

#[test]
fn superseded_images_are_cancelled() {
    let mut outside = OutsideRenderer::new(Arc::new(LitSceneCache::new(room())));
    let asked = AtomicUsize::new(0);
    let is_superseded = || asked.fetch_add(1, Ordering::Relaxed) > 20;
    let picture = outside.render(&State::default(), &view([0.0, 0.0, 6.0]), &is_superseded).unwrap();
    assert!(picture.is_none() && asked.into_inner() < 121);
}

#[test]
fn the_extent_covers_observed_leaves_and_camera() {
    // The photo shows the wall ahead, including the edges that belong to other walls. The camera is at the origin.
    let extent = room().extent();
    let [x, y, z] = extent.middle_m;
    assert!(x.abs() < 1e-6 && y.abs() < 1e-6 && (z + 0.875).abs() < 1e-6, "{extent:?}");
    // Leaf centres range from −1.75 to 1.75 across and from −1.75 to 0 ahead.
    let radius_m = (1.75f32 * 1.75 * 2.0 + 0.875 * 0.875).sqrt();
    assert!((extent.radius_m - radius_m).abs() < 1e-5 && (extent.floor_m + 1.75).abs() < 1e-6, "{extent:?}");
}
