//! `lightoctree view` without a browser: access control, the protocol, and equality of its images with `insert`.

use serde_json::json;

use crate::cli::{room, room_with_expected_light, room_with_scene, write_mesh};
use crate::support::view::{Page, Viewer};
use crate::support::{done, refused};

#[test]
fn the_final_picture_is_that_of_the_command_line_that_is_shown() {
    let folder = room_with_scene();
    write_mesh(folder.path());
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", |message| message["type"] == "scene");
    page.act(
        &json!({ "do": "add", "mesh": "builtin:sphere", "pixel": [70.25, 94.125], "material": { "preset": "chrome" } }),
    );
    let object = std::fs::read(folder.path().join("object.obj")).unwrap();
    assert_eq!(viewer.upload("mesh", "object.obj", &object), (204, String::new()));
    page.receive("two objects", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 2));
    page.act(&json!({ "do": "place", "object": 2, "place": { "pixel": [35, 94] } }));
    page.act(&json!({ "do": "size", "object": 2, "size": { "height": 0.35 } }));
    page.act(&json!({ "do": "turn", "object": 2, "yaw_deg": 33.3 }));
    page.act(&json!({ "do": "material", "object": 2, "material": { "preset": "gold", "roughness": 0.31 } }));
    page.act(&json!({ "do": "place", "object": 1, "place": { "position": [0.3, -1.0, -2.123_45] } }));
    page.act(&json!({ "do": "floor-gloss", "gloss": 0.25 }));
    // A gesture.
    for u in [40.0, 45.0, 50.3] {
        let drag = json!({ "do": "drag", "object": 2, "to": [u, 94.7] });
        page.send(&json!({ "type": "preview", "sequence": u as u64, "command": drag }));
    }
    page.send(&json!({ "type": "commit" }));
    let is_dragged = |message: &serde_json::Value| message["view"]["objects"][1]["place"]["pixel"][0] == 50.3;
    let (state, _) = page.receive("the end of the gesture", is_dragged);
    let command = state["view"]["command"].as_str().unwrap().to_owned();
    let is_final = |message: &serde_json::Value| {
        message["type"] == "frame"
            && message["step"] == "final"
            && message["change"].as_u64() >= state["change"].as_u64()
    };
    let (frame, shown) = page.receive("the final picture", is_final);
    let words = words(&command);
    done(folder.path(), &words.iter().map(String::as_str).collect::<Vec<_>>());
    let written = std::fs::read(folder.path().join("picture.png")).unwrap();
    let (status, downloaded) = viewer.get("download/picture.png");
    assert_eq!(status, 200, "{}", String::from_utf8_lossy(&downloaded));
    assert!(downloaded == written, "{command}");
    assert!(shown == written, "{frame}");
    // The layers, too.
    let layers = [&words[..], &["--layers".into(), "layers.exr".into(), "--force".into()]].concat();
    done(folder.path(), &layers.iter().map(String::as_str).collect::<Vec<_>>());
    // The page names objects otherwise than the command line, so that their numbers in the matte differ.
    let is_number = |name: &str| name.starts_with("CryptoObject") && (name.ends_with('R') || name.ends_with('B'));
    let read = |bytes: &[u8]| {
        let mut channels = lo_imaging::exr_channels_from_bytes(bytes, "layers.exr").unwrap().channels;
        channels.retain(|(name, _)| !is_number(name));
        channels
    };
    let (_, downloaded) = viewer.get("download/layers.exr");
    let (found, expected) = (read(&downloaded), read(&std::fs::read(folder.path().join("layers.exr")).unwrap()));
    let names = |channels: &[(String, Vec<f32>)]| -> Vec<String> { channels.iter().map(|c| c.0.clone()).collect() };
    assert_eq!(names(&found), names(&expected));
    let differs = found.iter().zip(&expected).find(|(a, b)| a != b).map(|(a, _)| &a.0);
    assert_eq!(differs, None);
}

/// Splits a command line into arguments as a shell does, without the program's name.
fn words(command: &str) -> Vec<String> {
    // Words are separated by spaces, except in quotes.
    let all: Vec<String> = command
        .split('\'')
        .enumerate()
        .flat_map(|(i, part)| match i % 2 {
            0 => part.split_whitespace().map(str::to_owned).collect(),
            _ => vec![part.to_owned()],
        })
        .collect();
    assert_eq!(all[0], "lightoctree");
    all[1..].to_vec()
}

#[test]
fn the_inferred_light_is_that_of_the_command_line() {
    let folder = room_with_expected_light();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let (mut page, mut other) = (viewer.page(), viewer.page());
    for page in [&mut page, &mut other] {
        page.receive("the scene", |message| message["type"] == "scene");
    }
    page.act(&json!({ "do": "add", "mesh": "builtin:sphere", "pixel": [70.25, 94.125] }));
    let (plain, _) =
        page.receive("an object", |message| message["view"]["objects"].as_array().is_some_and(|a| a.len() == 1));
    assert_eq!(plain["view"]["inferred_light"]["effect"], "expected");
    assert!(!plain["view"]["command"].to_string().contains("--light"), "{plain}");
    let is_final = |change: u64| {
        move |message: &serde_json::Value| {
            message["type"] == "frame" && message["step"] == "final" && message["change"].as_u64() >= Some(change)
        }
    };
    let change_of = |state: &serde_json::Value| state["change"].as_u64().unwrap();
    let (_, usual) = page.receive("the picture in the usual light", is_final(change_of(&plain)));
    // A drag of the contrast, then a pixel and a number.
    for (sequence, factor) in [0.5, 1.75, 2.5].into_iter().enumerate() {
        let command = json!({ "do": "contrast", "factor": factor });
        page.send(&json!({ "type": "preview", "sequence": sequence, "command": command }));
    }
    page.send(&json!({ "type": "commit" }));
    page.act(&json!({ "do": "white", "pixel": [40.5, 70.5] }));
    page.act(&json!({ "do": "warmth", "ev": -0.75 }));
    // A refusal is sent to the page that asked, and changes nothing.
    for (wrong, why) in [
        (json!({ "do": "contrast", "factor": 4 }), "from 0 to 3"),
        (json!({ "do": "warmth", "ev": 1e39 }), "from -4 to 4"),
        (json!({ "do": "white", "pixel": [144, 3] }), "outside"),
    ] {
        page.act(&wrong);
        page.receive("a refusal", |message| {
            message["type"] == "refused" && message["why"].as_str().unwrap().contains(why)
        });
    }
    page.act(&json!({ "do": "floor-gloss", "gloss": 0.25 }));
    let is_tuned = |message: &serde_json::Value| message["view"]["floor_gloss"] == 0.25;
    let (state, _) = page.receive("the light", is_tuned);
    let tuned = json!({ "light": "plausible", "contrast": 2.5, "warmth_ev": -0.75, "white": [40.5, 70.5], "effect": "expected" });
    assert_eq!(state["view"]["inferred_light"], tuned);
    assert_eq!(other.receive("the light", is_tuned).0["view"]["inferred_light"], tuned);
    let (_, shown) = page.receive("the final picture", is_final(change_of(&state)));
    let command = state["view"]["command"].as_str().unwrap();
    assert!(command.contains(" --light plausible --contrast 2.5 --warmth -0.75 --white 40.5,70.5 "), "{command}");
    let command = words(command);
    done(folder.path(), &command.iter().map(String::as_str).collect::<Vec<_>>());
    let written = std::fs::read(folder.path().join("picture.png")).unwrap();
    assert!(shown == written && viewer.get("download/picture.png").1 == written && usual != written);

    // The saved scene contains it: for `insert`, other commands and the viewer.
    let (_, kept) = viewer.get("download/room.scene");
    std::fs::write(folder.path().join("kept.scene"), &kept).unwrap();
    done(folder.path(), &["insert", "kept.scene", "--quality", "high", "-o", "own.png"]);
    assert!(std::fs::read(folder.path().join("own.png")).unwrap() == written);
    done(
        folder.path(),
        &["insert", "kept.scene", "--light", "plausible", "--floor-gloss", "0", "--quality", "high", "-o", "usual.png"],
    );
    assert!(std::fs::read(folder.path().join("usual.png")).unwrap() == usual, "an option replaces all of it");
    let told = done(folder.path(), &["inspect", "kept.scene"]);
    let words = "light    plausible, contrast 2.5, warmth -0.75 EV, white at 40.5,70.5";
    assert!(told.contains(words), "{told}");
    let (_, light) = viewer.get("download/light.exr?u=70&v=80&lift=0.1");
    std::fs::write(folder.path().join("light.exr"), light).unwrap();
    let envmap = ["envmap", "kept.scene", "--pixel", "70,80", "--lift", "0.1", "--size", "1024x512", "-o", "b.exr"];
    done(folder.path(), &envmap);
    let read = |name: &str| lo_imaging::read_radiance(folder.path().join(name)).unwrap();
    assert!(read("light.exr") == read("b.exr"));
    done(folder.path(), &["lights", "reset", "kept.scene", "-o", "reset.scene"]);
    assert!(!done(folder.path(), &["inspect", "reset.scene"]).contains("contrast"));
    let again = Viewer::start(folder.path(), &["kept.scene"]);
    let (reopened, _) = again.page().receive("the light", |message| message["type"] == "state");
    assert_eq!(reopened["view"]["inferred_light"], tuned);
    // Undo reverts all of it.
    for _ in 0..4 {
        page.send(&json!({ "type": "undo" }));
    }
    let is_usual = |message: &serde_json::Value| message["view"]["inferred_light"]["contrast"] == 1.0;
    let (undone, _) = page.receive("the usual light", is_usual);
    assert_eq!(undone["view"]["command"], plain["view"]["command"]);
    let (_, back) = page.receive("its picture", is_final(change_of(&undone)));
    assert!(back == usual);
}

#[test]
fn downloads_open_again() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", |message| message["type"] == "scene");
    assert_eq!(viewer.get("download/picture.png").0, 409, "there are no objects in the photo");
    page.act(&json!({ "do": "add", "mesh": "builtin:suzanne" }));
    page.act(&json!({ "do": "add-light", "new": { "sun":
        { "azimuth_deg": 20, "elevation_deg": 45, "strength": 2, "angle_deg": 1, "kelvin": 5500 } } }));
    page.receive("a sun", |message| message["view"]["lights"].to_string().contains("\"A1\""));
    let files =
        ["room.scene", "objects.json", "light.exr?u=70&v=80&lift=0.1", "room.glb", "room_usd.zip?u=70&v=80&lift=0.1"];
    for file in files {
        let (status, bytes) = viewer.get(&format!("download/{file}"));
        assert_eq!(status, 200, "{file}: {}", String::from_utf8_lossy(&bytes));
        std::fs::write(folder.path().join(format!("new_{}", file.split('?').next().unwrap())), bytes).unwrap();
    }
    let lights = done(folder.path(), &["lights", "new_room.scene", "--json"]);
    assert!(lights.contains("\"A1\"") && lights.contains("\"sun\""), "{lights}");
    done(
        folder.path(),
        &["insert", "new_room.scene", "--layout", "new_objects.json", "--quality", "draft", "-o", "a.png"],
    );
    let panorama = lo_imaging::read_radiance(folder.path().join("new_light.exr")).unwrap();
    assert_eq!((panorama.width(), panorama.height()), (1024, 512));
    // `envmap` renders the same light.
    let envmap = [
        "envmap",
        "new_room.scene",
        "--pixel",
        "70,80",
        "--lift",
        "0.1",
        "--lamp",
        "--size",
        "1024x512",
        "-o",
        "b.exr",
    ];
    done(folder.path(), &envmap);
    assert_eq!(panorama, lo_imaging::read_radiance(folder.path().join("b.exr")).unwrap());
    let glb = std::fs::read(folder.path().join("new_room.glb")).unwrap();
    assert!(glb.starts_with(b"glTF"));
    let usd = std::fs::read(folder.path().join("new_room_usd.zip")).unwrap();
    let names: Vec<String> = unzipped(&usd).into_iter().map(|(name, _)| name).collect();
    assert!(names.contains(&"room.usda".to_owned()) && names.len() >= 4, "{names:?}");
}

/// Returns names and contents of the files of a ZIP archive.
fn unzipped(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut files = Vec::new();
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).unwrap();
        let mut content = Vec::new();
        std::io::Read::read_to_end(&mut file, &mut content).unwrap();
        files.push((file.name().unwrap().into_owned(), content));
    }
    files
}

#[test]
fn photos_are_estimated_and_errors_are_reported() {
    let folder = room();
    let mut viewer = Viewer::start(folder.path(), &[]);
    let mut page = viewer.page();
    let (hello, _) = page.receive("the greeting", |message| message["type"] == "hello");
    let can_estimate = hello["can_estimate"] == true;
    let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(viewer.upload("mesh", "a.obj", b"v 0 0 0").0, 400);
    assert_eq!(viewer.upload("photo", "photo.png", b"no picture").0, if can_estimate { 204 } else { 400 });
    if can_estimate {
        let failed = |message: &serde_json::Value| message["type"] == "empty" && message["error"].is_string();
        let (failed, _) = page.receive("why not", failed);
        assert!(failed["error"].as_str().unwrap().contains("photo.png"), "{failed}");
        // A PNG header that claims 20,000 × 20,000 pixels.
        let huge = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\x4e\x20\0\0\x4e\x20\x08\x02\0\0\0\x6c\x12\xd1\x6e\0\0\0\x01IDAT\x78\0\0\0\0\0\0\0\0";
        assert_eq!(viewer.upload("photo", "huge.png", huge).0, 204);
        let (failed, _) =
            page.receive("why not", |message| message["error"].as_str().is_some_and(|e| e.contains("huge")));
        assert!(failed["error"].as_str().unwrap().contains("20000"), "{failed}");
        assert_eq!(viewer.upload("depth", "depth.png", &read("depth.png")).0, 204);
        assert_eq!(viewer.upload("photo", "photo.png", &read("photo.png")).0, 204);
        page.receive("progress", |message| message["type"] == "opening" && message["done"].is_number());
        let (scene, _) = page.receive("the scene", |message| message["type"] == "scene");
        assert_eq!(scene["predicted_depth"], false);
        let (state, _) = page.receive("the state", |message| message["type"] == "state");
        let view = &state["view"];
        assert_eq!((&view["file"], &view["has_file"]), (&json!("photo.scene"), &json!(false)));
        for (name, bytes) in
            [("broken.glb", &b"glTF but no more"[..]), ("none.stl", b"solid x\nendsolid x\n"), ("a.txt", b"x")]
        {
            let (status, why) = viewer.upload("mesh", name, bytes);
            assert!(status == 400 && why.contains(name), "{status} {why}");
        }
    }
    // A truncated scene. An open one stays.
    assert_eq!(viewer.upload("scene", "cut.scene", &[8, 0, 0, 0, 0, 0, 0, 0, b'{']).0, 204);
    let why = if can_estimate { "why" } else { "error" };
    page.receive("why not", |message| message[why].as_str().is_some_and(|why| why.contains("cut.scene")));
    assert_eq!(viewer.get("download/room.scene").0, if can_estimate { 200 } else { 409 });
    page.send(&json!({ "type": "nonsense" }));
    page.receive("a refusal", |message| {
        message["type"] == "refused" && message["why"].as_str().unwrap().contains("nonsense")
    });
    assert!(viewer.is_alive());
}

#[test]
fn a_mesh_is_uploaded_with_its_files() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", |message| message["type"] == "scene");
    let obj =
        b"mtllib a.mtl\nusemtl red\nv 0 0 0\nv 0.3 0 0\nv 0 0.3 0\nv 0 0 0.3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    let (status, _) = viewer.upload("part", "a.mtl", b"newmtl red\nKd 1 0 0\n");
    assert_eq!(status, 204);
    assert_eq!(viewer.upload("mesh", "folder%2Fa.obj", obj).0, 204);
    let (state, _) =
        page.receive("the object", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 1));
    assert_eq!(state["view"]["objects"][0]["mesh"], "a.obj");
    // Without its material file it is added with a warning.
    assert_eq!(viewer.upload("mesh", "a.obj", obj).0, 204);
    page.receive("a note", |message| {
        message["type"] == "refused" && message["why"].as_str().unwrap().contains("a.mtl")
    });
}

#[test]
fn two_pages_show_the_same() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut pages = [viewer.page(), viewer.page()];
    let scenes = pages.each_mut().map(|page| page.receive("the scene", |message| message["type"] == "scene").0);
    assert_eq!(scenes[0], scenes[1]);
    pages[0].act(&json!({ "do": "add", "mesh": "builtin:sphere" }));
    let added = shown_at_rest(&mut pages, |view| view["objects"].as_array().is_some_and(|all| all.len() == 1));
    // Each page edits what the other one added.
    pages[1].act(&json!({ "do": "turn", "object": 1, "yaw_deg": 40 }));
    pages[1].act(&json!({ "do": "material", "object": 1, "material": { "preset": "gold" } }));
    let gold = shown_at_rest(&mut pages, |view| view["objects"][0]["material"]["preset"] == "gold");
    assert_eq!(gold.state["view"]["objects"][0]["yaw_deg"], 40.0);
    assert_ne!(gold.image, added.image);
    // A page that connects later, as after a reload, receives the same.
    let mut late = [viewer.page()];
    let (scene, _) = late[0].receive("the scene", |message| message["type"] == "scene");
    assert_eq!(scene, scenes[0]);
    assert_eq!(shown_at_rest(&mut late, |view| !view["objects"].is_null()), gold);
}

/// A page after a finished change.
#[derive(Debug, PartialEq)]
struct Shown {
    /// The session.
    state: serde_json::Value,
    /// The message of the final image.
    frame: serde_json::Value,
    /// The final image.
    image: Vec<u8>,
}

/// Waits until all pages have a wanted state and its final image. Returns them, equal on all pages.
fn shown_at_rest(pages: &mut [Page], is_wanted: impl Fn(&serde_json::Value) -> bool) -> Shown {
    let mut shown = pages.iter_mut().map(|page| {
        let (state, _) = page.receive("the state", |message| message["type"] == "state" && is_wanted(&message["view"]));
        let (frame, image) = page.receive("its final image", |message| {
            message["type"] == "frame" && message["step"] == "final" && message["change"] == state["change"]
        });
        assert!(image.starts_with(b"\x89PNG"), "{frame}");
        Shown { state, frame, image }
    });
    let first = shown.next().unwrap();
    shown.for_each(|other| assert!(other == first, "{} {}, {} {}", first.state, first.frame, other.state, other.frame));
    first
}

#[test]
fn each_page_has_its_own_view_of_the_room() {
    let folder = room_with_scene();
    let mut viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut pages = [viewer.page(), viewer.page()];
    let view = json!({ "eye_m": [2.0, 1.5, 2.0], "target_m": [0, -0.5, -1.5], "fov_deg": 40, "width": 120, "height": 90,
        "exposure_ev": 0, "show": null, "still": false });
    let changed = |changes: serde_json::Value| {
        let mut view = view.clone();
        changes.as_object().unwrap().iter().for_each(|(name, value)| view[name] = value.clone());
        json!({ "type": "outside", "sequence": 7, "view": view })
    };
    let is_seen = |message: &serde_json::Value| message["type"] == "outside";
    let shown = |page: &mut crate::support::view::Page, asked: &serde_json::Value| {
        page.send(asked);
        let (told, bytes) = page.receive("the room", is_seen);
        assert_eq!(told["sequence"], 7);
        let photo = lo_imaging::photo_from_bytes(&bytes, "outside").unwrap().photo;
        (told["mime"].as_str().unwrap().to_owned(), photo.width(), photo.height())
    };
    pages.iter_mut().for_each(|page| drop(page.receive("the scene", |message| message["type"] == "scene")));
    // Concurrent requests are both answered.
    let [first, second] = &mut pages;
    first.send(&changed(json!({ "width": 100, "still": true })));
    assert_eq!(shown(second, &changed(json!({ "width": 64 }))), ("image/jpeg".to_owned(), 64, 90));
    let (_, bytes) = first.receive("the room", is_seen);
    assert!(bytes.starts_with(b"\x89PNG"));
    assert_eq!(lo_imaging::photo_from_bytes(&bytes, "outside").unwrap().photo.width(), 100);
    for wrong in [
        json!({ "width": 4_000_000_000_u32 }),
        json!({ "height": 0 }),
        json!({ "eye_m": [1e39, 0, 0] }),
        json!({ "target_m": [2.0, 1.5, 2.0] }),
        json!({ "fov_deg": 180 }),
        json!({ "exposure_ev": -1e30 }),
    ] {
        first.send(&changed(wrong.clone()));
        let (refused, _) = first.receive("a refusal", |message| message["type"] == "refused");
        assert!(refused["why"].as_str().unwrap().contains("the view's"), "{wrong}: {refused}");
    }
    assert_eq!(shown(first, &changed(json!({ "show": "origins" }))), ("image/jpeg".to_owned(), 120, 90));
    assert!(viewer.is_alive());
}

#[test]
fn others_are_refused_with_a_reason() {
    let folder = room_with_scene();
    let mut viewer = Viewer::start(folder.path(), &["room.scene"]);
    viewer.page().receive("the scene", |message| message["type"] == "scene");
    let (host, path) = viewer.host_and_path();
    let port = host.rsplit_once(':').unwrap().1;
    let own = format!("Host: {host}");
    let ask = |path: &str, lines: &[&str]| {
        let (status, body) = viewer.request("GET", path, lines, b"");
        (status, String::from_utf8_lossy(&body).into_owned())
    };
    let (status, index) = ask(path, &[&own]);
    assert!(status == 200 && index.contains("<!doctype html>"));
    assert_eq!(ask(&format!("{path}page/main.js"), &[&own]).0, 200);
    for (path, lines, why) in [
        ("/", vec![own.as_str()], "token"),
        ("/0123456789abcdef0123456789abcdef/", vec![&own], "token"),
        (path, vec!["Host: evil.example"], "Host"),
        (path, vec![&format!("Host: evil.example:{port}")], "Host"),
        (path, vec![&own, "Origin: http://evil.example"], "Origin"),
        (&format!("{path}socket"), vec![&own, "Origin: null", "Upgrade: websocket", "Connection: Upgrade"], "Origin"),
    ] {
        let (status, said) = ask(path, &lines);
        assert!(status == 403 && said.contains(why), "{path} {lines:?}: {status} {said}");
    }
    // No file of the disk is served.
    for wrong in
        ["page/../../Cargo.toml", "page/%2e%2e%2f%2e%2e%2fetc%2fpasswd", "download/%2fetc%2fpasswd", "room.scene"]
    {
        assert_eq!(ask(&format!("{path}{wrong}"), &[&own]).0, 404, "{wrong}");
    }
    let upload = format!("{path}upload/photo");
    let lines = [own.as_str(), "X-File-Name: a.jpg", "Content-Length: 1073741824"];
    assert_eq!(viewer.request("POST", &upload, &lines, b"").0, 413);
    // Without the header, which other sites' forms cannot set.
    assert_eq!(viewer.request("POST", &upload, &[&own, "Content-Length: 1"], b"x").0, 400);
    assert!(viewer.is_alive());
    let bind = ["view", "room.scene", "--bind", "0.0.0.0"];
    assert!(refused(folder.path(), 2, &[&bind[..], &["--token", "short"]].concat()).contains("16"));
    assert!(refused(folder.path(), 2, &[&bind[..], &["--token", "12345678901234567890"]].concat()).contains("easy"));
    assert!(refused(folder.path(), 1, &["view", "no.scene"]).contains("no.scene"));
}

/// Minutes of dragging before the first and the last measurement of memory.
const LOAD_MIN: [f64; 2] = [1.0, 10.0];

#[test]
#[ignore = "ten minutes: cargo test --release -p lightoctree-cli --test it view_load -- --ignored --nocapture"]
fn view_load() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::copy(lo_testdata::asset("library_color.jpg"), folder.path().join("photo.jpg")).unwrap();
    let mut viewer = Viewer::start(folder.path(), &["photo.jpg"]);
    let (mut lazy, mut page) = (viewer.page(), viewer.page());
    let (scene, _) = page.receive("the scene", |message| message["type"] == "scene");
    let side = |name: &str| scene["camera"][name].as_f64().unwrap();
    let (width, height) = (side("width"), side("height"));
    for mesh in ["builtin:sphere", "builtin:tea-set"] {
        page.act(&json!({ "do": "add", "mesh": mesh }));
    }
    page.receive("two objects", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 2));
    let mut random = lo_random::stream(30, "load", 0);
    let mut uniform = move || -> f64 { lo_random::RngExt::random(&mut random) };
    let begun = std::time::Instant::now();
    let (mut pictures, mut refusals, mut memory_mb) = (0u64, 0u64, Vec::new());
    let mut at = [0.5 * width, 0.7 * height];
    while begun.elapsed().as_secs_f64() < 60.0 * LOAD_MIN[1] {
        let object = 1 + u32::from(uniform() < 0.5);
        // A gesture of some images, committed, cancelled or undone.
        for _ in 0..1 + (20.0 * uniform()) as usize {
            at = [at[0] + 60.0 * (uniform() - 0.5), at[1] + 60.0 * (uniform() - 0.5)];
            at = [at[0].clamp(0.0, width - 1.0), at[1].clamp(0.5 * height, height - 1.0)];
            pictures += 1;
            let command = json!({ "do": "drag", "object": object, "to": at });
            page.send(&json!({ "type": "preview", "sequence": pictures, "command": command }));
            page.send(&json!({ "type": "probe", "pixel": at, "lift_m": 0.1, "exposure_ev": 0.0 }));
            let (heard, _) = page.receive("its picture", |message| {
                message["type"] == "refused" || (message["type"] == "frame" && message["sequence"] == pictures)
            });
            refusals += u64::from(heard["type"] == "refused");
        }
        page.send(&json!({ "type": (["commit", "cancel", "undo"])[(3.0 * uniform()) as usize] }));
        // Rests now and then, for refined images.
        if uniform() < 0.1 {
            std::thread::sleep(std::time::Duration::from_millis((3000.0 * uniform()) as u64));
        }
        // The lazy page rarely reads a message and never keeps up.
        if uniform() < 0.3 {
            lazy.receive("anything", |_| true);
        }
        let minutes = begun.elapsed().as_secs_f64() / 60.0;
        if memory_mb.len() as f64 + LOAD_MIN[0] < minutes {
            memory_mb.push(viewer.memory_mb());
            println!("{minutes:.1} min: {pictures} pictures, {refusals} refusals, {:.0} MB", viewer.memory_mb());
        }
    }
    memory_mb.push(viewer.memory_mb());
    println!("{pictures} pictures in ten minutes; memory from {:.0} to {:.0} MB", memory_mb[0], viewer.memory_mb());
    assert_eq!(refusals, 0);
    assert!(viewer.memory_mb() < memory_mb[0] + 50.0, "{memory_mb:?}");
    assert!(viewer.is_alive());
}

#[test]
fn sequences_and_scenes_with_objects_are_those_of_the_command_line() {
    let folder = room_with_scene();
    write_mesh(folder.path());
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", |message| message["type"] == "scene");
    assert_eq!(viewer.get("download/video.y4m").0, 409, "there are no objects in the photo");
    page.act(&json!({ "do": "add", "mesh": "builtin:sphere", "pixel": [40, 95] }));
    let object = std::fs::read(folder.path().join("object.obj")).unwrap();
    assert_eq!(viewer.upload("mesh", "object.obj", &object), (204, String::new()));
    page.receive("two objects", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 2));
    assert_eq!(viewer.get("download/video.y4m").0, 409, "nothing is animated");
    page.act(&json!({ "do": "size", "object": 2, "size": { "height": 0.3 } }));
    page.act(&json!({ "do": "set-key", "object": 1, "time_s": 0 }));
    page.send(&json!({ "type": "seek", "time_s": 1.5, "sequence": 1 }));
    page.act(&json!({ "do": "place", "object": 1, "place": { "pixel": [90, 95] } }));
    page.act(&json!({ "do": "turn", "object": 1, "yaw_deg": 95.5 }));
    page.act(&json!({ "do": "interpolate", "object": 1, "interpolation": "catmull-rom" }));
    page.act(&json!({ "do": "floor-gloss", "gloss": 0.5 }));
    page.act(&json!({ "do": "frames", "frames": null, "fps": 2 }));
    let (state, _) = page.receive("the frames", |message| message["view"]["timeline"]["fps"] == 2);
    assert_eq!(state["view"]["timeline"]["frames"], 4);
    let command = state["view"]["command"].as_str().unwrap().to_owned();
    assert_eq!(
        command,
        "lightoctree insert room.scene --layout objects.json --frames 4 --fps 2 --floor-gloss 0.5 -o video.y4m"
    );
    let taken = |file: &str| {
        let (status, bytes) = viewer.get(&format!("download/{file}"));
        assert_eq!(status, 200, "{file}: {}", String::from_utf8_lossy(&bytes));
        bytes
    };
    std::fs::write(folder.path().join("objects.json"), taken("objects.json")).unwrap();
    let words: Vec<&str> = command.split(' ').skip(1).collect();
    done(folder.path(), &words);
    let video = std::fs::read(folder.path().join("video.y4m")).unwrap();
    assert!(taken("video.y4m") == video);
    page.receive("how far it is", |message| {
        message["type"] == "film" && message["done"] == 4 && message["frames"] == 4
    });
    let frames = [&words[..words.len() - 1], &["frame_%04d.png"]].concat();
    done(folder.path(), &frames);
    let mut names = Vec::new();
    for (name, bytes) in unzipped(&taken("frames.zip")) {
        assert!(bytes == std::fs::read(folder.path().join(&name)).unwrap(), "{name}");
        names.push(name);
    }
    assert_eq!(names, ["frame_0000.png", "frame_0001.png", "frame_0002.png", "frame_0003.png"]);
    // With layers, too.
    let layers = [&frames[..], &["--layers", "layers_%04d.exr", "--force"]].concat();
    done(folder.path(), &layers);
    let files = unzipped(&taken("layers.zip"));
    assert_eq!(files.iter().filter(|(name, _)| name.ends_with(".exr")).count(), 4);
    for (name, bytes) in files {
        assert!(bytes == std::fs::read(folder.path().join(&name)).unwrap(), "{name}");
    }

    // The scene file contains everything.
    std::fs::write(folder.path().join("kept.scene"), taken("room.scene")).unwrap();
    std::fs::remove_file(folder.path().join("object.obj")).unwrap();
    done(folder.path(), &["insert", "kept.scene", "-o", "own.y4m"]);
    assert!(std::fs::read(folder.path().join("own.y4m")).unwrap() == video);
    let told = done(folder.path(), &["inspect", "kept.scene", "--json"]);
    assert!(told.contains(r#""objects":{"names":["sphere","object"],"files":["object.obj"]"#), "{told}");
    let message = refused(folder.path(), 2, &["insert", "room.scene", "-o", "none.png"]);
    assert!(message.contains("--mesh or --layout"), "{message}");
    let again = Viewer::start(folder.path(), &["kept.scene"]);
    let mut page = again.page();
    let (reopened, _) = page.receive("the objects", |message| message["type"] == "state");
    assert_eq!(reopened["view"]["timeline"], state["view"]["timeline"]);
    assert_eq!(reopened["view"]["can_undo"], false);
    let (status, saved) = again.get("download/room.scene");
    assert!(status == 200 && saved == std::fs::read(folder.path().join("kept.scene")).unwrap());

    // A long download can be cancelled.
    page.act(&json!({ "do": "frames", "frames": 100_000, "fps": 24 }));
    page.receive("the frames", |message| message["view"]["timeline"]["frames"] == 100_000);
    std::thread::scope(|scope| {
        let taking = scope.spawn(|| again.get("download/frames.zip"));
        page.receive("progress", |message| message["type"] == "film" && message["done"].as_u64() > Some(0));
        assert_eq!(again.get("download/frames.zip").0, 409, "one at a time");
        page.send(&json!({ "type": "stop-film" }));
        page.receive("the end", |message| message["type"] == "film" && message["ended"] == "stopped");
        taking.join().unwrap();
    });
}
