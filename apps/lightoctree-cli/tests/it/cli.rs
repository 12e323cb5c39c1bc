//! Runs every command as a user does, and checks outputs and errors.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use assert_cmd::Command;
use lightoctree::Document;
use lo_geometry::{Camera, Plane, Quat, Ray, Vec3};
use lo_imaging as imaging;
use lo_imaging::{DepthMap, ExrOptions, Image, RadianceImage};
use lo_nets::checkpoint::{Checkpoint, Precision};
use lo_scene::{Completion, ExpectedLight};
use tempfile::TempDir;

use crate::support::weights::write_weights;
use crate::support::{done, json, refused};

const SIZE: (usize, usize) = (144, 96);

/// Creates a folder with photo.png and depth.png of a floor 1.2 m below the camera and a wall 3 m in front of it.
pub fn room() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let (width, height) = SIZE;
    let camera = Camera::from_hfov_deg(65.0, width as u32, height as u32).unwrap();
    let floor = Plane::through(Vec3::new(0.0, -1.2, 0.0), Vec3::Y);
    let wall = Plane::through(Vec3::new(0.0, 0.0, -3.0), Vec3::Z);
    let seen = |x: usize, y: usize| {
        let ray = Ray { origin: Vec3::ZERO, direction: camera.direction(x as f64 + 0.5, y as f64 + 0.5) };
        let to_floor = floor.intersect(&ray).unwrap_or(f32::INFINITY);
        let to_wall = wall.intersect(&ray).unwrap_or(f32::INFINITY);
        (-ray.at(to_floor.min(to_wall)).z, to_floor < to_wall)
    };
    let photo = Image::from_fn(width, height, |x, y| if seen(x, y).1 { [90, 85, 80] } else { [150, 160, 170] });
    let depth_m = DepthMap::from_fn(width, height, |x, y| seen(x, y).0);
    imaging::write_srgb8(folder.path().join("photo.png"), &photo, 95, imaging::GENERATOR).unwrap();
    imaging::write_depth(folder.path().join("depth.png"), &depth_m, imaging::GENERATOR).unwrap();
    folder
}

/// Creates [`room`] with its estimate in room.scene.
pub fn room_with_scene() -> TempDir {
    let folder = room();
    let estimate = ["estimate", "photo.png", "--depth", "depth.png", "--hfov-deg", "65", "--completion", "shell"];
    done(folder.path(), &[&estimate[..], &["-o", "room.scene"]].concat());
    folder
}

/// Creates [`room_with_scene`] as if completed by a network that expects light from the upper right.
pub fn room_with_expected_light() -> TempDir {
    let folder = room_with_scene();
    let path = folder.path().join("room.scene");
    let mut document = Document::read(&path).unwrap();
    let radiance = imaging::RadianceImage::from_fn(64, 32, |x, y| {
        let near = (-0.02 * ((x as f32 - 44.0).powi(2) + (y as f32 - 8.0).powi(2))).exp();
        [0.2 + 6.0 * near, 0.2 + 5.0 * near, 0.2 + 3.5 * near]
    });
    let expected = Some(ExpectedLight::new(&radiance, Quat::IDENTITY, 3.0));
    let estimate = Arc::make_mut(&mut document.estimate);
    (estimate.origin.completion, estimate.expected) = (Completion::Network, expected);
    document.write(&path, "lightoctree estimate").unwrap();
    folder
}

/// Writes a tetrahedron of about unit size to object.obj.
pub fn write_mesh(folder: &Path) -> PathBuf {
    let path = folder.join("object.obj");
    let text = "v 0 0 0.6\nv 0.5 0 -0.3\nv -0.5 0 -0.3\nv 0 0.8 0\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn inspect_prints_what_the_specification_says() {
    let folder = room_with_scene();
    let text = done(folder.path(), &["inspect", "room.scene", "--json"]);
    assert!(text.starts_with(r#"{"format_version":1,"octree":{"depth":7,"full_depth":4,"origin_m":["#), "{text}");
    let summary = json(&text);
    let levels = summary["octree"]["levels"].as_array().unwrap();
    assert_eq!(levels.len(), 8);
    assert_eq!(levels[4]["total"], 4096);
    assert_eq!(levels[7]["split"], 0);
    assert_eq!(summary["camera"]["width"], SIZE.0);
    let shares = summary["seen_share"].as_f64().unwrap() + summary["inferred_share"].as_f64().unwrap();
    assert!((shares - 1.0).abs() < 1e-9);
    let tables = done(folder.path(), &["inspect", "room.scene"]);
    assert!(tables.contains("depth") && tables.contains("plane    floor"), "{tables}");
}

#[test]
fn the_same_input_gives_the_same_scene_on_any_thread_count() {
    let folder = room_with_scene();
    let args = ["estimate", "photo.png", "--depth", "depth.png", "--hfov-deg", "65", "--completion", "shell"];
    let args = [&args[..], &["-o", "again.scene"]].concat();
    let mut command = Command::cargo_bin("lightoctree").unwrap();
    command.current_dir(folder.path()).args(["--threads", "1", "--quiet"]).args(args).assert().success();
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read("room.scene"), read("again.scene"));
}

#[test]
fn envmap_writes_panorama_depth_and_light() {
    let folder = room_with_scene();
    let path = |name: &str| folder.path().join(name);
    done(
        folder.path(),
        &[
            "envmap",
            "room.scene",
            "--at",
            "0,-0.4,-1.5",
            "--size",
            "128x64",
            "--depth-out",
            "distance.exr",
            "--sh9",
            "sh.json",
            "--main-light",
            "light.json",
            "--preview",
            "-o",
            "light.exr",
        ],
    );
    let panorama = imaging::read_radiance(path("light.exr")).unwrap();
    assert_eq!((panorama.width(), panorama.height()), (128, 64));
    // The middle shows the wall: 160 of 255 is 0.3515 in linear light.
    assert!((panorama[(64, 30)][1] - 0.3515).abs() < 0.02, "{:?}", panorama[(64, 30)]);
    // The floor is 0.8 m below, the wall 1.5 m away. A leaf is about 5 cm.
    let distance_m = imaging::read_depth(path("distance.exr"), None).unwrap();
    assert!((distance_m[(64, 63)] - 0.8).abs() < 0.1, "{}", distance_m[(64, 63)]);
    assert!((distance_m[(64, 32)] - 1.5).abs() < 0.1, "{}", distance_m[(64, 32)]);
    assert!(path("light.png").is_file());
    let sh = json(&std::fs::read_to_string(path("sh.json")).unwrap());
    assert_eq!(sh["generator"], "lightoctree envmap");
    assert!(json(&std::fs::read_to_string(path("light.json")).unwrap()).get("main_light").is_some());
    // The command overwrites its own result, but not another command's.
    done(
        folder.path(),
        &["envmap", "room.scene", "--pixel", "72,80", "--size", "64x32", "--cubemap", "-o", "light.exr"],
    );
    let cube = imaging::read_radiance(path("light.exr")).unwrap();
    assert_eq!((cube.width(), cube.height()), (16, 96));
    let message = refused(folder.path(), 2, &["envmap", "room.scene", "--at", "0,0,-1", "-o", "room.scene"]);
    assert!(message.contains("--force"), "{message}");
}

#[test]
fn probes_come_with_a_manifest() {
    let folder = room_with_scene();
    let text =
        done(folder.path(), &["probes", "room.scene", "--grid", "2,1,2", "--size", "32x16", "-o", "probes", "--json"]);
    let probes = json(&text)["probes"].as_array().unwrap().clone();
    assert_eq!(probes.len(), 4);
    for probe in &probes {
        assert_eq!(probe["place"], "free", "{probe}");
        let file = folder.path().join("probes").join(probe["file"].as_str().unwrap());
        assert_eq!(imaging::read_radiance(file).unwrap().width(), 32);
    }
    std::fs::write(folder.path().join("points.csv"), "x,y,z,name\n0,-0.5,-1,near\n0,-0.5,-40,far\n").unwrap();
    let args = [
        "probes",
        "room.scene",
        "--points",
        "points.csv",
        "--size",
        "32x16",
        "--format",
        "hdr",
        "-o",
        "named",
        "--json",
    ];
    let manifest = json(&done(folder.path(), &args));
    assert_eq!(manifest["probes"][1]["place"], "outside of the octree's cube");
    assert!(folder.path().join("named/near.hdr").is_file());
}

#[test]
fn detail_is_for_the_eye() {
    let folder = room_with_scene();
    let at = folder.path();
    let read = |name: &str| std::fs::read(at.join(name)).unwrap();
    let panorama = |name: &str, more: &[&str]| {
        let (map, figures) = (format!("{name}.pfm"), format!("{name}.json"));
        let envmap = ["envmap", "room.scene", "--at", "0,-0.4,-1", "--size", "64x32", "-o", &map, "--sh9", &figures];
        done(at, &[&envmap[..], more].concat());
        (read(&map), read(&figures))
    };
    let (plain, detailed) = (panorama("plain", &[]), panorama("detailed", &["--detail"]));
    assert!(plain.0 != detailed.0 && plain.1 == detailed.1);

    let insert = |name: &str, more: &[&str]| {
        let insert = ["insert", "room.scene", "--mesh", "builtin:sphere", "--height", "0.4", "--pixel", "72,95"];
        done(at, &[&insert[..], &["--material", "chrome", "-o", name], more].concat());
        read(name)
    };
    assert!(insert("with.png", &[]) != insert("without.png", &["--no-detail"]));
    let draft = |name: &str, more: &[&str]| insert(name, &[&["--quality", "draft"][..], more].concat());
    assert!(draft("draft.png", &[]) == draft("draft_without.png", &["--no-detail"]));
}

#[test]
fn lights_are_listed_changed_and_reset() {
    let folder = room_with_scene();
    let at = folder.path();
    let read = |name: &str| std::fs::read(at.join(name)).unwrap();
    let panorama = |scene: &str, file: &str, more: &[&str]| {
        let envmap = ["envmap", scene, "--at", "0,-0.4,-1", "--size", "64x32", "--force", "-o", file];
        done(at, &[&envmap[..], more].concat());
        read(file)
    };
    let (before, plain) = (read("room.scene"), panorama("room.scene", "plain.pfm", &[]));

    // An added light, from adding to removing it.
    let add = ["lights", "add", "area", "room.scene", "--at", "0.3,0.4,-1.5", "--radius", "0.1", "--radiance", "50"];
    let listed = json(&done(at, &[&add[..], &["--color", "3000K", "-o", "lit.scene", "--json"]].concat()));
    let light = listed["lights"].as_array().unwrap().last().unwrap();
    assert_eq!((&light["id"], &light["kind"], &light["origin"]), (&"A1".into(), &"area".into(), &"added".into()));
    assert!((light["color_temperature_k"].as_f64().unwrap() / 3000.0 - 1.0).abs() < 0.02);
    assert!(read("room.scene") == before, "--output does not change the input");
    let lit = panorama("lit.scene", "lit.pfm", &[]);
    assert!(lit != plain && panorama("lit.scene", "none.pfm", &["--without-emitters"]) != lit);
    assert!(done(at, &["inspect", "lit.scene"]).contains("lights   edited: none; added: A1"));
    done(at, &["lights", "set", "lit.scene", "A1", "--off"]);
    assert!(panorama("lit.scene", "off.pfm", &[]) == plain);
    done(at, &["lights", "set", "lit.scene", "A1", "--on", "--scale", "0.5"]);
    assert!(done(at, &["lights", "lit.scene"]).contains("x 0.5"));
    done(at, &["lights", "reset", "lit.scene", "A1"]);
    assert!(panorama("lit.scene", "again.pfm", &[]) == lit);
    let sun = ["lights", "add", "sun", "lit.scene", "--azimuth", "-30", "--elevation", "50", "--strength", "4"];
    let text = done(at, &sun);
    assert!(text.contains("strength 4.00"), "{text}");
    done(at, &["lights", "remove", "lit.scene", "A1"]);
    done(at, &["lights", "reset", "lit.scene"]);
    assert!(read("lit.scene") == before, "without edits the bytes are the estimate's");

    // Errors.
    let message = refused(at, 1, &["lights", "set", "room.scene", "L99", "--off"]);
    assert!(message.contains("the scene has no light L99; it has"), "{message}");
    let message = refused(at, 2, &["lights", "set", "room.scene", "A1"]);
    assert!(message.contains("--scale"), "{message}");
    let message = refused(at, 2, &["lights", "set", "room.scene", "A1", "--color", "warm"]);
    assert!(message.contains("3000K"), "{message}");
    let message = refused(at, 2, &[&add[..5], &["0,0,0", "--size", "1,1", "--radiance", "1"]].concat());
    assert!(message.contains("--direction"), "{message}");
    let sun = |direction: &[&'static str]| [&["lights", "add", "sun", "room.scene"][..], direction].concat();
    let message = refused(at, 2, &sun(&["--shadow", "72,10,72,9000"]));
    assert!(message.contains("72,9000 is outside the photo"), "{message}");
    let message = refused(at, 2, &sun(&["--shadow", "72,90,72,10"]));
    assert!(message.contains("give the occluder's pixel first"), "{message}");
    let message = refused(at, 2, &sun(&["--shadow", "72,10,72,90"]));
    assert!(message.contains("no edge of a sun patch") && message.contains("--strength"), "{message}");
    let message = refused(at, 2, &sun(&["--azimuth", "10", "--elevation", "40"]));
    assert!(message.contains("no sun patches") && message.contains("--strength"), "{message}");
    let message = refused(at, 2, &sun(&["--azimuth", "10"]));
    assert!(message.contains("--elevation"), "{message}");
    write_mesh(at);
    let message = refused(at, 2, &["lights", "reset", "room.scene", "-o", "object.obj"]);
    assert!(message.contains("was not written by"), "{message}");
}

#[test]
fn insert_changes_the_photo_only_where_the_object_acts() {
    let folder = room_with_scene();
    write_mesh(folder.path());
    let args =
        ["insert", "room.scene", "--mesh", "object.obj", "--height", "0.4", "--pixel", "72,95", "--quality", "draft"];
    done(
        folder.path(),
        &[&args[..], &["--material", "gold", "--layers", "layers.exr", "-o", "composite.png"]].concat(),
    );
    let before = imaging::read_rgba8(folder.path().join("photo.png")).unwrap();
    let after = imaging::read_rgba8(folder.path().join("composite.png")).unwrap();
    let changed = before.pixels().iter().zip(after.pixels()).filter(|(a, b)| a != b).count();
    assert!((50..SIZE.0 * SIZE.1 / 2).contains(&changed), "{changed} pixels changed");
    assert_eq!(before[(2, 2)], after[(2, 2)]);
    let layers = imaging::read_exr_channels(folder.path().join("layers.exr")).unwrap();
    let names: Vec<&str> = layers.channels.iter().map(|channel| channel.0.as_str()).collect();
    for wanted in ["object.R", "object.A", "shadow_ratio.G", "occlusion.A"] {
        assert!(names.contains(&wanted), "{wanted} is missing in {names:?}");
    }
    let path = r#"{"keyframes":[{"time_s":0,"pixel":[50,95]},{"time_s":1,"pixel":[90,95]}]}"#;
    std::fs::write(folder.path().join("path.json"), path).unwrap();
    let sequence = ["insert", "room.scene", "--mesh", "object.obj", "--height", "0.3", "--quality", "draft"];
    done(folder.path(), &[&sequence[..], &["--path", "path.json", "--frames", "3", "-o", "frame_%02d.png"]].concat());
    assert!((0..3).all(|i| folder.path().join(format!("frame_0{i}.png")).is_file()));
    let message = refused(
        folder.path(),
        2,
        &[&sequence[..], &["--path", "path.json", "--frames", "3", "-o", "frame.png"]].concat(),
    );
    assert!(message.contains("%04d"), "{message}");
    // The frames as video: a header, then a line and three planes for each frame.
    done(
        folder.path(),
        &[&sequence[..], &["--path", "path.json", "--frames", "3", "--fps", "12", "-o", "clip.y4m"]].concat(),
    );
    let video = std::fs::read(folder.path().join("clip.y4m")).unwrap();
    let frame = imaging::read_rgba8(folder.path().join("frame_01.png")).unwrap();
    let header_end = video.iter().position(|&byte| byte == b'\n').unwrap() + 1;
    let header = String::from_utf8(video[..header_end].to_vec()).unwrap();
    assert!(header.starts_with(&format!("YUV4MPEG2 W{} H{} F12:1", SIZE.0, SIZE.1)), "{header}");
    let pixels = SIZE.0 * SIZE.1;
    assert_eq!(video.len(), header_end + 3 * (6 + 3 * pixels));
    let second = &video[header_end + 6 + 3 * pixels + 6..];
    let luma =
        |[r, g, b, _]: [u8; 4]| 16.0 + (46.559 * f32::from(r) + 156.629 * f32::from(g) + 15.812 * f32::from(b)) / 255.0;
    assert!(frame.pixels().iter().zip(second).all(|(&pixel, &y)| (luma(pixel) - f32::from(y)).abs() < 0.51));
    let message = refused(folder.path(), 2, &[&sequence[..], &["--pixel", "72,95", "-o", "clip2.y4m"]].concat());
    assert!(message.contains("--path"), "{message}");
}

#[test]
fn several_objects_come_from_the_command_line_or_a_layout() {
    let folder = room_with_scene();
    let at = folder.path();
    write_mesh(at);
    let quick = ["--quality", "draft", "--json"];
    let first = ["--mesh", "object.obj", "--pixel", "50,95", "--height", "0.3", "--material", "gold"];
    let second = ["--mesh", "object.obj", "--pixel", "90,95", "--height", "0.2", "--yaw-deg", "30"];
    let insert = |objects: &[&str], file: &str| {
        json(&done(at, &[&["insert", "room.scene"], objects, &quick, &["-o", file]].concat()))
    };
    let flags = insert(&[&first[..], &second].concat(), "flags.png");
    let names: Vec<&str> = flags["objects"].as_array().unwrap().iter().map(|o| o["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["object", "object 2"]);
    assert!((flags["objects"][1]["yaws_deg"][0].as_f64().unwrap() - 30.0).abs() < 1e-3, "{flags}");
    // Paths in a layout are relative to its folder.
    std::fs::create_dir(at.join("layouts")).unwrap();
    let layout = r#"{"objects": [
        {"mesh": "../object.obj", "pixel": [50, 95], "height_m": 0.3, "material": "gold"},
        {"mesh": "../object.obj", "name": "small", "pixel": [90, 95], "height_m": 0.2, "yaw_deg": 30}]}"#;
    std::fs::write(at.join("layouts/two.json"), layout).unwrap();
    let file = insert(&["--layout", "layouts/two.json"], "file.png");
    assert_eq!(file["objects"][1]["name"], "small");
    let pixels = |file: &str| imaging::read_rgba8(at.join(file)).unwrap();
    assert_eq!(pixels("flags.png"), pixels("file.png"));
    // Pixels affected by only one object are as with this object alone.
    insert(&first, "first.png");
    insert(&second, "second.png");
    let [photo, both, first_alone, second_alone] = ["photo.png", "flags.png", "first.png", "second.png"].map(pixels);
    let alike = |a: [u8; 4], b: [u8; 4]| (0..3).all(|c| a[c].abs_diff(b[c]) <= 3);
    let (mut of_first, mut of_second) = (0, 0);
    for ((photo, both), (a, b)) in
        photo.pixels().iter().zip(both.pixels()).zip(first_alone.pixels().iter().zip(second_alone.pixels()))
    {
        match (a == photo, b == photo) {
            (true, true) => assert!(alike(*both, *photo), "{both:?} {photo:?}"),
            (false, true) if !alike(*a, *photo) => of_first += usize::from(alike(*both, *a)),
            (true, false) if !alike(*b, *photo) => of_second += usize::from(alike(*both, *b)),
            _ => {}
        }
    }
    assert!(of_first > 50 && of_second > 20, "{of_first} {of_second}");
    // One object moves and carries the other.
    let path = r#"{"keyframes": [{"time_s": 0, "pixel": [50, 95]}, {"time_s": 1, "pixel": [90, 95]}]}"#;
    std::fs::write(at.join("layouts/path.json"), path).unwrap();
    let moving = r#"[{"mesh": "../object.obj", "name": "car", "path": "path.json", "height_m": 0.3},
        {"mesh": "../object.obj", "on": "car", "height_m": 0.1}]"#;
    std::fs::write(at.join("layouts/moving.json"), moving).unwrap();
    let moved = insert(&["--layout", "layouts/moving.json", "--frames", "3"], "frame_%02d.png");
    let x = |object: usize, frame: usize| moved["objects"][object]["positions_m"][frame][0].as_f64().unwrap();
    assert!(x(0, 2) > x(0, 0) + 0.2 && ((x(1, 2) - x(1, 0)) - (x(0, 2) - x(0, 0))).abs() < 1e-4, "{moved}");
    assert!((0..3).all(|i| at.join(format!("frame_0{i}.png")).is_file()));
    for (objects, code, words) in [
        (&["--layout", "layouts/moving.json"][..], 2, "car moves: give the number of frames"),
        (&["--layout", "layouts/two.json", "--frames", "3"], 2, "no object moves"),
        (&["--layout", "layouts/none.json"], 1, "none.json"),
        (&["--layout", "photo.png"], 1, "photo.png"),
        (&["--layout", "layouts/two.json", "--mesh", "object.obj"], 2, "--layout"),
        (&["--mesh", "object.obj", "--pixel", "50,95", "--mesh", "object.obj"], 2, "object.obj has no position"),
        (&["--mesh", "object.obj", "--pixel", "50,95", "--mesh", "object.obj", "--pixel", "500,95"], 1, "object 2"),
        (&["--mesh", "object.obj", "--pixel", "50,95", "--orientation", "blender"], 2, "--lighting envmap"),
    ] {
        let message = refused(at, code, &[&["insert", "room.scene"], objects, &["-o", "none.png"]].concat());
        assert!(message.contains(words), "{objects:?}: {message}");
    }
}

#[test]
fn a_panorama_in_another_programs_axes_lights_as_in_ours() {
    let folder = room_with_scene();
    let at = folder.path();
    write_mesh(at);
    for orientation in ["lightoctree", "blender", "openexr"] {
        let file = format!("{orientation}.exr");
        done(
            at,
            &[
                "envmap",
                "room.scene",
                "--at",
                "0,-0.4,-1",
                "--size",
                "64x32",
                "--orientation",
                orientation,
                "-o",
                &file,
            ],
        );
        let lighting = format!("envmap:{file}");
        let insert = [
            "insert",
            "room.scene",
            "--mesh",
            "object.obj",
            "--height",
            "0.4",
            "--pixel",
            "72,95",
            "--quality",
            "draft",
        ];
        let picture = format!("{orientation}.png");
        done(at, &[&insert[..], &["--lighting", &lighting, "--orientation", orientation, "-o", &picture]].concat());
    }
    let [ours, blender, openexr] =
        ["lightoctree.png", "blender.png", "openexr.png"].map(|file| std::fs::read(at.join(file)).unwrap());
    assert!(ours == blender && ours == openexr);

    // four times as bright a map gives the same image, unless its own level is asked for
    let map = imaging::read_radiance(at.join("lightoctree.exr")).unwrap();
    let bright = map.map(|rgb| rgb.map(|v| 4.0 * v));
    imaging::write_radiance(at.join("bright.exr"), &bright, &imaging::ExrOptions::default()).unwrap();
    let insert = |map: &str, file: &str, more: &[&str]| {
        let args = ["insert", "room.scene", "--mesh", "object.obj", "--height", "0.4", "--pixel", "72,95"];
        let light = ["--quality", "draft", "--lighting", map, "-o", file];
        done(at, &[&args[..], &light, more].concat());
        imaging::read_rgba8(at.join(file)).unwrap()
    };
    let plain = insert("envmap:lightoctree.exr", "plain.png", &[]);
    let levelled = insert("envmap:bright.exr", "levelled.png", &[]);
    assert!(plain.pixels().iter().flatten().zip(levelled.pixels().iter().flatten()).all(|(a, b)| a.abs_diff(*b) <= 1));
    let own = insert("envmap:lightoctree.exr", "own.png", &["--lighting-level", "file"]);
    let darker = ["--lighting-level", "file", "--lighting-ev", "-2"];
    assert_eq!(insert("envmap:bright.exr", "darker.png", &darker).pixels(), own.pixels());
    assert_ne!(insert("envmap:bright.exr", "brighter.png", &darker[..2]).pixels(), own.pixels());
    // a full turn changes nothing, half a turn does
    let turned = |deg: &str, file: &str| insert("envmap:lightoctree.exr", file, &["--lighting-yaw-deg", deg]);
    assert_eq!(turned("-360", "round.png").pixels(), plain.pixels());
    assert_ne!(turned("180", "half.png").pixels(), plain.pixels());
}

#[test]
fn an_image_stopped_by_the_time_limit_is_of_normal_quality() {
    let folder = room_with_scene();
    let at = folder.path();
    write_mesh(at);
    let insert = |more: &[&str]| {
        let args = ["insert", "room.scene", "--mesh", "object.obj", "--height", "0.4", "--pixel", "72,95"];
        done(at, &[&args[..], more].concat())
    };
    insert(&["-o", "normal.png"]);
    insert(&["--quality", "high", "--time-limit", "0.001", "-o", "cut.png"]);
    insert(&["--quality", "high", "--time-limit", "600", "-o", "high.png"]);
    let pixels = |file: &str| imaging::read_rgba8(at.join(file)).unwrap();
    assert_eq!(pixels("cut.png"), pixels("normal.png"));
    assert_ne!(pixels("high.png"), pixels("normal.png"));
    let message = refused(
        at,
        2,
        &["insert", "room.scene", "--mesh", "object.obj", "--pixel", "72,95", "--time-limit", "3", "-o", "a.png"],
    );
    assert!(message.contains("--quality high"), "{message}");
}

#[test]
fn objects_stand_upright_and_panoramas_are_level_where_the_camera_is_tilted() {
    let folder = room();
    let at = folder.path();
    write_mesh(at);
    // Pitched down by 20°: the up direction leans towards the viewer.
    let (sin, cos) = 20f32.to_radians().sin_cos();
    let up = format!("0,{cos},{sin}");
    let estimate = ["estimate", "photo.png", "--depth", "depth.png", "--hfov-deg", "65", "--completion", "shell"];
    done(at, &[&estimate[..], &["--up", &up, "-o", "tilted.scene"]].concat());
    let envmap = ["envmap", "tilted.scene", "--at", "0,-0.4,-1", "--size", "64x32", "--json"];
    let own = json(&done(at, &[&envmap[..], &["-o", "own.exr"]].concat()));
    let files = ["--level", "--main-light", "light.json", "-o", "level.exr"];
    let level = json(&done(at, &[&envmap[..], &files].concat()));
    assert_eq!((own["camera"]["frame"].as_str(), own["camera"]["pitch_deg"].as_f64()), (Some("camera"), Some(0.0)));
    assert_eq!(level["camera"]["frame"], "level");
    assert!((level["camera"]["pitch_deg"].as_f64().unwrap() + 20.0).abs() < 0.1, "{level}");
    let height = level["position_m"][1].as_f64().unwrap();
    assert!((height - f64::from(-0.4 * cos - sin)).abs() < 1e-4, "{level}");
    let light = json(&std::fs::read_to_string(at.join("light.json")).unwrap());
    assert_eq!(light["camera"], level["camera"]);
    // The pixel straight ahead moves down by 20°: 20 / 180 of the rows.
    let [own, level] = ["own.exr", "level.exr"].map(|file| imaging::read_radiance(at.join(file)).unwrap());
    let (ahead, lower) = (own[(32, 16)], level[(32, 19)]);
    let near = |a: f32, b: f32| (a - b).abs() < 0.1 * a.max(b);
    assert!((0..3).all(|c| near(ahead[c], lower[c])), "{ahead:?} {lower:?}");
    let manifest = done(
        at,
        &["probes", "tilted.scene", "--grid", "1,1,1", "--size", "32x16", "--level", "-o", "probes", "--json"],
    );
    assert_eq!(json(&manifest)["camera"]["frame"], "level");
    for align in ["gravity", "surface", "none"] {
        let insert = ["insert", "tilted.scene", "--mesh", "object.obj", "--height", "0.4", "--pixel", "72,95"];
        let file = format!("{align}.png");
        done(at, &[&insert[..], &["--quality", "draft", "--align", align, "-o", &file]].concat());
    }
    let [gravity, none] = ["gravity.png", "none.png"].map(|file| std::fs::read(at.join(file)).unwrap());
    assert_ne!(gravity, none);
    // Without an up direction, --level fails.
    done(at, &[&estimate[..6], &["--completion", "none", "-o", "seen.scene"]].concat());
    let message = refused(at, 2, &["envmap", "seen.scene", "--at", "0,0,-1", "--level", "-o", "none.exr"]);
    assert!(message.contains("no up direction"), "{message}");
}

#[test]
fn a_map_at_a_pixel_is_outside_of_leaves() {
    let folder = room_with_scene();
    let at = folder.path();
    let envmap = |place: &[&str]| {
        let mut command = Command::cargo_bin("lightoctree").unwrap();
        let args = ["envmap", "room.scene", "--size", "32x16", "-o", "light.exr", "--force", "--json"];
        let output = command.current_dir(at).args([&args[..], place].concat()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let summary = json(&String::from_utf8(output.stdout).unwrap());
        let y = summary["position_m"][1].as_f64().unwrap();
        (y + 1.2, String::from_utf8(output.stderr).unwrap())
    };
    let (height, notes) = envmap(&["--pixel", "72,95"]);
    assert!((0.09..0.5).contains(&height) && !notes.contains("inside of a surface"), "{height} {notes}");
    assert_eq!(height > 0.11, notes.contains("set the distance with --lift"), "{height} {notes}");
    let (height, notes) = envmap(&["--pixel", "72,95", "--lift", "0.01"]);
    assert!(height < 0.03 && notes.contains("inside of a surface"), "{height} {notes}");
}

#[test]
fn export_writes_all_three_formats() {
    let folder = room_with_scene();
    for format in ["ply", "glb", "usda"] {
        let file = format!("room.{format}");
        let text = done(
            folder.path(),
            &["export", "room.scene", "--to", format, "--probe-at", "0,-0.4,-1", "-o", &file, "--json"],
        );
        assert!(json(&text)["points"].as_u64().unwrap() > 100, "{text}");
        assert!(folder.path().join(&file).is_file());
        done(folder.path(), &["export", "room.scene", "--to", format, "-o", &file]); // overwrites its own result
    }
}

#[test]
fn networks_make_scenes_with_depth_and_without() {
    let folder = room();
    let at = folder.path();
    write_weights(at);
    let network = ["--completion", "network", "--weights", "weights.safetensors"];
    let estimate = |photo: &str, more: &[&str]| done(at, &[&["estimate", photo][..], &network, more].concat());
    let measured = json(&estimate("photo.png", &["--depth", "depth.png", "-o", "measured.scene", "--json"]));
    assert!(
        measured["leaves"].as_u64().unwrap() > 100 && measured["seconds"]["light network"].is_number(),
        "{measured}"
    );
    let summary = json(&done(at, &["inspect", "measured.scene", "--json"]));
    assert_eq!((&summary["completion"], &summary["octree"]["depth"]), (&"network".into(), &7.into()));
    assert_eq!(summary["predicted_depth"], false);
    assert!(summary["mean_confidence"].as_f64().unwrap() > 0.0);
    assert!(summary["seen_share"].as_f64().unwrap() > 0.02);
    done(at, &["envmap", "measured.scene", "--at", "0,-0.4,-1.5", "--size", "64x32", "-o", "light.exr"]);
    // 160 of 255 is 0.3515 in linear light: the wall straight ahead.
    assert!((imaging::read_radiance(at.join("light.exr")).unwrap()[(32, 15)][1] - 0.3515).abs() < 0.02);

    let large = Image::from_fn(4000, 3000, |x, y| [(x / 16) as u8, (y / 12) as u8, 120]);
    imaging::write_srgb8(at.join("large.jpg"), &large, 90, imaging::GENERATOR).unwrap();
    estimate("large.jpg", &["--hfov-deg", "70", "-o", "alone.scene"]);
    let summary = json(&done(at, &["inspect", "alone.scene", "--json"]));
    assert_eq!((&summary["photo"]["width"], &summary["photo"]["depth_width"]), (&4000.into(), &240.into()));
    assert_eq!(summary["predicted_depth"], true);
    assert!(done(at, &["inspect", "alone.scene"]).contains("depth    predicted"));
}

#[test]
fn a_photo_alone_is_enough() {
    let folder = room();
    let at = folder.path();
    done(at, &["estimate", "photo.png", "-o", "alone.scene"]);
    let summary = json(&done(at, &["inspect", "alone.scene", "--json"]));
    assert_eq!((&summary["completion"], &summary["predicted_depth"]), (&"network".into(), &true.into()));
    done(at, &["envmap", "alone.scene", "--at", "0,0,-1", "--size", "64x32", "--lamp", "-o", "lamp.exr"]);
    let light = |name: &str, options: &[&str]| {
        done(at, &[&["envmap", "alone.scene", "--at", "0,0,-1", "--size", "64x32", "-o", name], options].concat());
        imaging::read_radiance(at.join(name)).unwrap()
    };
    let former = imaging::read_radiance(at.join("lamp.exr")).unwrap();
    assert!(former == light("plausible.exr", &["--light", "plausible"]));
    let (even, expected) = (light("even.exr", &["--light", "even"]), light("expected.exr", &[]));
    assert!(even != expected && expected != former && expected == light("same.exr", &["--light", "expected"]));
    let ratio = |image: &imaging::RadianceImage| {
        let sum = image.pixels().iter().fold([0.0f32; 3], |sum, rgb| [0, 1, 2].map(|c| sum[c] + rgb[c]));
        sum[0] / sum[2]
    };
    let warm = light("warm.exr", &["--warmth", "1"]);
    assert!(ratio(&warm) > 1.5 * ratio(&expected), "{} {}", ratio(&warm), ratio(&expected));
    light("white.exr", &["--white", "30,20"]);
    let with =
        |option: &[&'static str]| [&["envmap", "alone.scene", "--at", "0,0,-1", "-o", "no.exr"], option].concat();
    let error = refused(at, 2, &with(&["--contrast", "2"]));
    assert!(error.contains("--light plausible"), "{error}");
    let error = refused(at, 1, &with(&["--white", "9999,1"]));
    assert!(error.contains("white"), "{error}");
    done(at, &["estimate", "photo.png", "--depth", "depth.png", "-o", "measured.scene"]);
    let summary = json(&done(at, &["inspect", "measured.scene", "--json"]));
    assert_eq!((&summary["completion"], &summary["predicted_depth"]), (&"network".into(), &false.into()));
    done(at, &["estimate", "photo.png", "--completion", "shell", "-o", "closed.scene"]);
    let summary = json(&done(at, &["inspect", "closed.scene", "--json"]));
    assert_eq!((&summary["completion"], &summary["predicted_depth"]), (&"shell".into(), &true.into()));
    assert_eq!(summary["octree"]["depth"], 7);
}

/// The library's defaults are those of the command line, for the bundled photo with and without LiDAR depth.
#[cfg(feature = "weights")]
#[test]
fn library_and_program_write_the_same_bytes() {
    use lightoctree::{EstimateOptions, Estimator, Input};
    use lo_events as events;
    use lo_scene::Frame;

    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("assets");
    let [photo_path, depth_path] = ["library_color.jpg", "library_lidar_depth.png"].map(|name| assets.join(name));
    let [photo_name, depth_name] = [&photo_path, &depth_path].map(|path| path.to_str().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let depth = |is| ["--depth", depth_name, "--depth-is", is];
    let program = |name: &str, more: &[&str]| {
        done(folder.path(), &[&["estimate", photo_name, "-o", name], more].concat());
        std::fs::read(folder.path().join(name)).unwrap()
    };

    let photo = imaging::read_photo(&photo_path).unwrap();
    let estimator = Estimator::shipped().unwrap();
    let (camera, source) = estimator.camera_of(&photo).unwrap();
    let frame = Frame::new(photo.photo.clone(), imaging::read_depth(&depth_path, None).unwrap(), camera, 1.0).unwrap();
    let library = |input: Input, sources: &[&str]| {
        let sources = sources.iter().map(|&name| name.to_owned()).collect();
        let options = EstimateOptions { sources, camera_source: Some(source), ..EstimateOptions::default() };
        let estimate = estimator.estimate(input, &options, &mut events::ignore).unwrap();
        Document::new(estimate).to_bytes("lightoctree estimate").unwrap()
    };
    let both = ["library_color.jpg", "library_lidar_depth.png"];
    let alone = library(Input::Photo { photo: photo.photo, camera }, &both[..1]);
    let measured = library(Input::MeasuredDepth(frame.clone()), &both);
    let predicted = library(Input::PredictedDepth(frame.into()), &both);
    assert!(program("alone.scene", &[]) == alone);
    assert!(program("measured.scene", &depth("measured")[..2]) == measured);
    assert!(program("predicted.scene", &depth("predicted")) == predicted);
    assert!(measured != predicted);
    let summary = json(&done(folder.path(), &["inspect", "predicted.scene", "--json"]));
    assert_eq!(summary["predicted_depth"], true);
    let refusal = refused(folder.path(), 2, &["estimate", photo_name, "--depth-is", "measured", "-o", "a.scene"]);
    assert!(refusal.contains("--depth <FILE>"), "{refusal}");
}

#[test]
fn wrong_weights_are_named() {
    let folder = room();
    let at = folder.path();
    write_weights(at);
    let refusal =
        |code, more: &[&str]| refused(at, code, &[&["estimate", "photo.png", "-o", "a.scene"], more].concat());
    let network = |file| ["--completion", "network", "--weights", file];
    let closed = ["--depth", "depth.png", "--completion", "shell", "--weights", "weights.safetensors"];
    let message = refusal(2, &closed);
    assert!(message.contains("--completion network"), "{message}");
    let message = refusal(2, &[&network("weights.safetensors")[..], &["--octree-depth", "5"]].concat());
    assert!(message.contains("depth 6 or more, not 5"), "{message}");
    let message = refusal(1, &network("none.safetensors"));
    assert!(message.contains("none.safetensors"), "{message}");
    let message = refusal(1, &network("photo.png"));
    assert!(message.contains("photo.png"), "{message}");
    let bytes = std::fs::read(at.join("weights.safetensors")).unwrap();
    std::fs::write(at.join("half.safetensors"), &bytes[..bytes.len() / 2]).unwrap();
    let message = refusal(1, &network("half.safetensors"));
    assert!(message.contains("half.safetensors"), "{message}");
    let mut other = Checkpoint::read(at.join("weights.safetensors")).unwrap();
    other.insert("light_net.global.weights", &[3, 2], vec![0.0; 6]);
    other.insert("depth_net.tail", &[1], vec![0.0]);
    other.write(at.join("other.safetensors"), Precision::Full).unwrap();
    let message = refusal(1, &network("other.safetensors"));
    assert!(
        message.contains("other.safetensors") && message.contains("has the shape [3, 2], not [64, 8]"),
        "{message}"
    );
    assert!(!at.join("a.scene").exists());
}

#[test]
fn errors_have_a_message_and_the_right_exit_code() {
    let folder = room_with_scene();
    let at = folder.path();
    let message = refused(
        at,
        2,
        &["estimate", "photo.png", "--depth", "depth.png", "--intrinsics", "100,100,900,50", "-o", "a.scene"],
    );
    assert!(message.contains("principal point"), "{message}");
    let message = refused(at, 1, &["estimate", "missing.png", "--depth", "depth.png", "-o", "a.scene"]);
    assert!(message.contains("missing.png"), "{message}");
    std::fs::write(at.join("text.png"), "no picture").unwrap();
    let message = refused(at, 1, &["estimate", "text.png", "--depth", "depth.png", "-o", "a.scene"]);
    assert!(message.contains("text.png"), "{message}");
    let message = refused(at, 1, &["inspect", "photo.png"]);
    assert!(message.contains("photo.png"), "{message}");
    let message = refused(at, 2, &["envmap", "room.scene", "--at", "0,0,-1", "--size", "100x100", "-o", "a.exr"]);
    assert!(message.contains("must be twice its height"), "{message}");
    let envmap = ["envmap", "room.scene", "--at", "0,0,-1", "-o"];
    let message = refused(at, 2, &[&envmap[..], &["a.gif"]].concat());
    assert!(message.contains(".exr"), "{message}");
    let message = refused(at, 2, &[&envmap[..], &["a.exr", "--sh9", "a.json", "--main-light", "a.json"]].concat());
    assert!(message.contains("a.json is the name of two outputs"), "{message}");
    let insert = ["insert", "room.scene", "--mesh", "builtin:sphere", "--pixel", "72,95", "-o"];
    let message = refused(at, 2, &[&insert[..], &["a_%04d.png"]].concat());
    assert!(message.contains("one image needs no frame number"), "{message}");
    let message = refused(at, 2, &[&insert[..], &["a.png", "--layers", "layers.png"]].concat());
    assert!(message.contains("layers.png: the extension must be one of .exr"), "{message}");
    imaging::write_radiance(
        at.join("map.exr"),
        &RadianceImage::from_fn(16, 8, |_, _| [1.0; 3]),
        &ExrOptions::default(),
    )
    .unwrap();
    let message =
        refused(at, 2, &[&insert[..], &["a.png", "--lighting", "envmap:map.exr", "--contrast", "2"]].concat());
    assert!(message.contains("--lighting replaces it"), "{message}");
    let message = refused(at, 1, &["envmap", "room.scene", "--pixel", "9999,3", "-o", "a.exr"]);
    assert!(message.contains("outside"), "{message}");
    write_mesh(at);
    let message = refused(
        at,
        2,
        &[
            "insert",
            "room.scene",
            "--mesh",
            "object.obj",
            "--pixel",
            "70,95",
            "--material",
            "unobtainium",
            "-o",
            "a.png",
        ],
    );
    assert!(message.contains("gold"), "{message}");
    std::fs::write(at.join("empty.obj"), "v 0 0 0\n").unwrap();
    let message = refused(at, 1, &["insert", "room.scene", "--mesh", "empty.obj", "--pixel", "70,95", "-o", "a.png"]);
    assert!(message.contains("empty.obj"), "{message}");
    assert!(!at.join("a.scene").exists() && !at.join("a.exr").exists() && !at.join("a.png").exists());
}

#[test]
fn hard_photos_give_a_scene_or_a_clear_error() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let photo = |name: &str, width, height| {
        imaging::write_srgb8(
            at.join(name),
            &Image::new(width, height, vec![[120u8; 3]; width * height]),
            95,
            imaging::GENERATOR,
        )
        .unwrap();
    };
    let depth = |name: &str, width, height, value: fn(usize, usize) -> f32| {
        imaging::write_depth(at.join(name), &DepthMap::from_fn(width, height, value), imaging::GENERATOR).unwrap();
    };
    photo("one.png", 1, 1);
    depth("one.pfm", 1, 1, |_, _| 2.0);
    let message = refused(at, 1, &["estimate", "one.png", "--depth", "one.pfm", "-o", "one.scene"]);
    assert!(message.contains("one.pfm") && message.contains("readings"), "{message}");
    photo("strip.png", 2000, 2);
    depth("strip.pfm", 2000, 2, |_, _| 2.0);
    let strip = ["estimate", "strip.png", "--depth", "strip.pfm", "-o", "strip.scene"];
    assert!(refused(at, 1, &strip).contains("is a panorama"));
    done(at, &[&strip[..], &["--hfov-deg", "65"]].concat());
    photo("photo.png", 60, 40);
    depth("holes.pfm", 60, 40, |_, _| f32::NAN);
    let message = refused(at, 1, &["estimate", "photo.png", "--depth", "holes.pfm", "-o", "a.scene"]);
    assert!(message.contains("holes.pfm"), "{message}");
    depth("square.pfm", 40, 40, |_, _| 2.0);
    let message = refused(at, 1, &["estimate", "photo.png", "--depth", "square.pfm", "-o", "a.scene"]);
    assert!(message.contains("40 × 40") && message.contains("60 × 40"), "{message}");
    depth("mixed.pfm", 60, 40, |x, y| [2.0, f32::NAN, -1.0, f32::INFINITY, 0.0, 2.0, 2.0][(x + 3 * y) % 7]);
    done(at, &["estimate", "photo.png", "--depth", "mixed.pfm", "-o", "mixed.scene"]);
}
