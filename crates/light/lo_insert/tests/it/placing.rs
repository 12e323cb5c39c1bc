//! Placements and materials that are probably wrong, and glass.

use std::ops::ControlFlow;

use crate::box_room::*;
use lo_events::Event;
use lo_geometry::{Plane, Vec3};
use lo_imaging::Photo;
use lo_insert::{
    Align, InsertError, InsertWarning, Inserter, Instance, Layout, LayoutObject, Lighting, Placement, Quality, Unit,
};
use lo_mesh::{AlphaMode, Material, PreparedModel};
use lo_scene::{LitScene, Room, RoomPlane, Side};

/// The box room with planes of floor and ceiling, 2.5 m apart.
fn room_with_planes() -> LitScene {
    let mut scene = linear_scene();
    let plane = |side, normal: Vec3, at: Vec3| RoomPlane { side, plane: Plane::through(at, normal), measured: true };
    let planes = vec![plane(Side::Floor, Vec3::Y, LOW), plane(Side::Ceiling, Vec3::NEG_Y, HIGH)];
    scene.estimate_mut().room = Some(Room { up: Vec3::Y, planes });
    scene
}

fn warnings(inserter: &Inserter, model: &PreparedModel, placement: Placement) -> Vec<InsertWarning> {
    let mut warnings = Vec::new();
    let hear = &mut |event: Event| {
        warnings.extend(event.warning().cloned());
        ControlFlow::Continue(())
    };
    inserter.render(&[Instance::new(model, placement)], hear).unwrap();
    warnings
}

#[test]
fn clear_panes_in_uniform_light_are_invisible() {
    let grey = |_: Vec3| [0.5; 3];
    let scene = room(Photo::Linear, grey, grey);
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Normal).unwrap();
    let glass = Material {
        base_color: [1.0; 4],
        roughness: 0.05,
        transmission: 1.0,
        double_sided: false,
        ..Material::default()
    };
    let composite = alone(&inserter, &sphere(glass), in_air(Vec3::new(0.0, 0.0, -2.0), 0.4));
    // What it reflects replaces what it hides. At normal incidence glass reflects 4 %.
    let Photo::Linear(image) = &composite.image else { panic!("the photo is linear") };
    let furthest = image.pixels().iter().flatten().map(|c| (c - 0.5).abs()).fold(0.0, f32::max);
    assert!(furthest < 0.03, "{furthest}");
    let middle = composite.alpha[(WIDTH / 2, HEIGHT / 2)];
    assert!((middle - 0.04).abs() < 0.01, "{middle}");
    assert!(composite.alpha.pixels().iter().any(|alpha| *alpha > 0.3), "its rim is a mirror");
    // Only its rim, which reflects most of the light, casts a faint shadow.
    let darkest = composite.shadow_ratio.pixels().iter().flatten().copied().fold(1.0, f32::min);
    assert!(darkest > 0.9, "{darkest}");
}

#[test]
fn tinted_and_half_transmissive_glass_covers_the_photo() {
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Draft).unwrap();
    let alpha = |base_color, transmission| {
        let glass = Material { base_color, transmission, roughness: 0.05, double_sided: false, ..matte() };
        alone(&inserter, &sphere(glass), in_air(Vec3::new(0.0, 0.0, -2.0), 0.4)).alpha[(WIDTH / 2, HEIGHT / 2)]
    };
    // 1 − transmission × (1 − 0.04) × the luminance of the base colour.
    assert!((alpha([1.0; 4], 0.5) - 0.52).abs() < 0.01);
    assert!((alpha([0.25, 0.25, 0.25, 1.0], 1.0) - 0.76).abs() < 0.01);
}

#[test]
fn a_transparent_object_is_told_as_that() {
    let inserter = Inserter::new(&linear_scene(), Lighting::Octree, Quality::Draft).unwrap();
    let material = Material { base_color: [1.0, 1.0, 1.0, 0.0], alpha_mode: AlphaMode::Blend, ..matte() };
    let told = warnings(&inserter, &sphere(material), on_floor(0.0, -2.5, 0.2));
    assert!(told.contains(&InsertWarning::ObjectTransparent { object: 0 }), "{told:?}");
    assert!(!told.contains(&InsertWarning::ObjectOutsidePicture { object: 0 }), "{told:?}");
}

#[test]
fn sizes_out_of_the_rooms_are_told_with_the_likely_unit() {
    let scene = room_with_planes();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Draft).unwrap();
    let model = sphere(matte());
    let told = |scale: f32| warnings(&inserter, &model, on_floor(0.0, -2.5, scale));
    let high = told(15.0);
    let found = high.iter().find_map(|warning| match *warning {
        InsertWarning::ObjectTooHigh { object: 0, height_m, room_m, likely } => Some((height_m, room_m, likely)),
        _ => None,
    });
    let (height_m, room_m, likely) = found.unwrap_or_else(|| panic!("{high:?}"));
    assert!((height_m - 30.0).abs() < 1e-3 && (room_m - 2.5).abs() < 1e-3);
    assert_eq!(likely, Some(Unit::Centimetre));
    let wide = warnings(&inserter, &slab(7.0, 1.0), on_floor(0.0, -2.5, 1.0));
    assert!(wide.iter().any(|warning| matches!(warning, InsertWarning::ObjectTooWide { .. })), "{wide:?}");
    let small = told(0.0005);
    assert!(small.iter().any(|warning| matches!(warning, InsertWarning::ObjectTooSmall { .. })), "{small:?}");
    for scale in [0.002, 0.3, 1.2] {
        let about_size = |warning: &InsertWarning| {
            matches!(
                warning,
                InsertWarning::ObjectTooHigh { .. }
                    | InsertWarning::ObjectTooWide { .. }
                    | InsertWarning::ObjectTooSmall { .. }
            )
        };
        assert!(!told(scale).iter().any(about_size), "{scale}");
    }
}

#[test]
fn bases_off_the_surface_are_told() {
    let scene = room_with_planes();
    let inserter = Inserter::new(&scene, Lighting::Octree, Quality::Draft).unwrap();
    let model = slab(0.4, 0.3);
    let at = |rise_m: f32, scale: f32| {
        let placement = on_floor(0.1, -2.5, scale);
        let position_m = placement.position_m + Vec3::Y * rise_m;
        let support = (rise_m.abs() < 0.05).then_some(placement.support).flatten();
        warnings(&inserter, &model, Placement { position_m, support, ..placement })
    };
    // Objects of 20 cm: 3 % are 6 mm, but readings at 2.5 m may be wrong by more.
    assert_eq!((at(0.0, 2.0), at(0.005, 2.0), at(-0.005, 2.0)), (vec![], vec![], vec![]));
    for rise_m in [0.02, 0.1, 0.8] {
        let told = at(rise_m, 2.0);
        let [InsertWarning::ObjectFloats { object: 0, gap_m }] = told[..] else { panic!("{rise_m}: {told:?}") };
        assert!((gap_m - rise_m).abs() < 0.005, "{gap_m} against {rise_m}");
    }
    for sunk_m in [0.02, 0.1] {
        let told = at(-sunk_m, 2.0);
        let [InsertWarning::ObjectSunk { object: 0, depth_m }] = told[..] else { panic!("{sunk_m}: {told:?}") };
        assert!((depth_m - sunk_m).abs() < 0.005, "{depth_m} against {sunk_m}");
    }
}

fn object(pixel: [f64; 2], align: Option<Align>) -> Layout {
    Layout::new(vec![LayoutObject {
        mesh: "a.glb".into(),
        pixel: Some(pixel),
        height_m: Some(0.1),
        align,
        ..LayoutObject::default()
    }])
    .unwrap()
}

#[test]
fn a_wall_is_refused_with_the_floor_below() {
    let scene = room_with_planes();
    let model = slab(0.4, 0.3);
    let place = |layout: Layout| layout.placements(&scene, &[&model], 1).map(|mut placements| placements.remove(0)[0]);
    // The back wall at z = −4, and the right wall at x = 2 near the image's side.
    let camera = scene.frame.camera;
    for (wall, normal) in [(Vec3::new(0.3, 0.2, LOW.z), Vec3::Z), (Vec3::new(HIGH.x, 0.1, -3.5), Vec3::NEG_X)] {
        let (u, v, _) = camera.project(wall).unwrap();
        let error = place(object([u, v], None)).unwrap_err();
        let InsertError::Object { object: 0, source } = error else { panic!("{error}") };
        let InsertError::Steep { tilt_deg, below_pixel: Some([u, v]), below_m: Some(below_m), .. } = *source else {
            panic!("{source}")
        };
        assert!((tilt_deg - 90.0).abs() < 3.0, "{tilt_deg}");
        assert!((below_m.y - LOW.y).abs() < 0.05 && (below_m - wall).with_y(0.0).length() < 0.4, "{below_m}");
        let standing = place(object([u, v], None)).unwrap();
        assert!((standing.position_m.y - LOW.y).abs() < 0.03 && standing.support.is_some(), "{standing:?}");
        // The way out: the base on the wall.
        let (u, v, _) = camera.project(wall).unwrap();
        let attached = place(object([u, v], Some(Align::Surface))).unwrap();
        assert!(attached.up.dot(normal) > 0.99 && (attached.position_m - wall).length() < 0.1, "{attached:?}");
    }
}

#[test]
fn the_unit_of_a_file_scales_it() {
    let layout = |text: &str| Layout::from_json(&format!(r#"[{{"mesh": "a.obj", "position_m": [0, 0, -2], {text}}}]"#));
    let scale = |text: &str| {
        let placements = layout(text).unwrap().placements(&room_with_planes(), &[&slab(0.4, 0.3)], 1).unwrap();
        placements[0][0].scale
    };
    for (unit, metres) in [("m", 1.0), ("cm", 0.01), ("mm", 0.001), ("in", 0.0254), ("ft", 0.3048)] {
        assert!((scale(&format!(r#""unit": "{unit}""#)) - metres).abs() < 1e-6 * metres, "{unit}");
    }
    let error = layout(r#""unit": "cm", "height_m": 1"#).unwrap_err().to_string();
    assert!(error.ends_with("\"height_m\" and \"unit\" cannot both be given"), "{error}");
    assert!(layout(r#""unit": "furlong""#).is_err());
}
