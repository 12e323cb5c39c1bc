//! `lightoctree view` among hostile and slow clients, and the ways in that `docs/viewer.md` promises.

use std::io::{ErrorKind, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Stdio;
use std::time::Duration;

use lo_imaging::Image;
use serde_json::{Value, json};

use crate::cli::{room, room_with_scene, write_mesh};
use crate::support::view::{Page, Viewer};
use crate::support::{done, refused};

fn is_scene(message: &Value) -> bool {
    message["type"] == "scene"
}

#[test]
fn idle_strangers_make_way() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let (host, _) = viewer.host_and_path();
    let mut page = viewer.page();
    page.receive("the scene", is_scene);
    let mut strangers: Vec<TcpStream> = (0..160)
        .map(|index| {
            let mut stranger = TcpStream::connect(host).unwrap();
            if index % 2 == 1 {
                stranger.write_all(b"GET /no-token/ HTTP/1.1\r\nX-Slow: ").unwrap();
            }
            stranger
        })
        .collect();
    assert_eq!(viewer.get("").0, 200);
    // All of them are closed: the first when others arrive, the last after the time in which a request has to arrive.
    for stranger in [0, 1, 158, 159] {
        let stranger = &mut strangers[stranger];
        stranger.set_read_timeout(Some(Duration::from_secs(120))).unwrap();
        let closed = match stranger.read(&mut [0; 512]) {
            Ok(bytes) => bytes == 0,
            Err(error) => error.kind() == ErrorKind::ConnectionReset,
        };
        assert!(closed);
    }
    // The page is still connected.
    page.act(&json!({ "do": "add", "mesh": "builtin:sphere" }));
    page.receive("an object", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 1));
}

#[test]
fn silent_pages_make_way_and_others_are_told_why_they_wait() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let (host, path) = viewer.host_and_path();
    let mut page = viewer.page();
    page.receive("the scene", is_scene);
    // Sockets that neither read nor answer pings.
    let silent: Vec<_> = (0..15)
        .map(|_| tungstenite::client(format!("ws://{host}{path}socket"), TcpStream::connect(host).unwrap()).unwrap().0)
        .collect();
    let mut closing = None;
    // The sockets are counted a moment after their handshake.
    for _ in 0..100 {
        closing = viewer.page().closing();
        if closing.is_some() {
            break;
        }
    }
    assert_eq!(closing, Some((4001, "too many pages are open".to_owned())));
    let mut tries = 0;
    let mut late = loop {
        let mut late = viewer.page();
        if late.closing().is_none() {
            break late;
        }
        tries += 1;
        assert!(tries < 600, "silent pages are still there");
        std::thread::sleep(Duration::from_millis(200));
    };
    drop(silent);
    late.act(&json!({ "do": "add", "mesh": "builtin:sphere" }));
    let is_added = |message: &Value| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 1);
    late.receive("an object", is_added);
    // A page that answers stays.
    page.receive("an object", is_added);
}

#[test]
fn a_stalled_download_is_stopped() {
    let folder = room();
    // Frames of 2 MB fill the buffers soon.
    let photo = Image::from_fn(1440, 960, |_, y| if y > 500 { [90, 85, 80] } else { [150, 160, 170] });
    let path = folder.path().join("photo.png");
    lo_imaging::write_srgb8(path, &photo, 95, lo_imaging::GENERATOR).unwrap();
    let estimate = ["estimate", "photo.png", "--depth", "depth.png", "--hfov-deg", "65", "--completion", "shell"];
    done(folder.path(), &[&estimate[..], &["-o", "room.scene"]].concat());
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", is_scene);
    page.act(&json!({ "do": "add", "mesh": "builtin:sphere", "pixel": [400, 900] }));
    page.act(&json!({ "do": "set-key", "object": 1, "time_s": 0 }));
    page.act(&json!({ "do": "frames", "frames": 100_000, "fps": 24 }));
    page.receive("the frames", |message| message["view"]["timeline"]["frames"] == 100_000);
    let (host, path) = viewer.host_and_path();
    let begin = || {
        let mut download = TcpStream::connect(host).unwrap();
        write!(download, "GET {path}download/video.y4m HTTP/1.1\r\nHost: {host}\r\n\r\n").unwrap();
        download
    };
    // Nothing of it is read, so it stalls when all buffers are full.
    let stalled = begin();
    page.receive("progress", |message| message["type"] == "film" && message["done"].as_u64() > Some(0));
    let said = page.until_quiet(Duration::from_secs(6));
    assert!(said.iter().all(|message| message["ended"].is_null()), "{said:?}");
    page.send(&json!({ "type": "stop-film" }));
    page.receive("the end", |message| message["type"] == "film" && message["ended"] == "stopped");
    let mut next = begin();
    let mut status = [0; 12];
    next.read_exact(&mut status).unwrap();
    assert_eq!(&status, b"HTTP/1.1 200");
    drop(stalled);
}

#[cfg(unix)]
#[test]
fn a_flood_of_overlay_requests_delays_nobody() {
    const REQUESTS: usize = 3000;
    let folder = room_with_scene();
    let mut viewer = Viewer::start(folder.path(), &["room.scene"]);
    let [mut page, mut other] = [viewer.page(), viewer.page()];
    for page in [&mut page, &mut other] {
        page.receive("the scene", is_scene);
    }
    let flood = |page: &mut Page| {
        for index in 0..REQUESTS {
            let what = ["depth", "normals", "levels", "origins"][index % 4];
            page.send(&json!({ "type": "overlay", "what": what }));
        }
    };
    flood(&mut page);
    page.act(&json!({ "do": "contrast", "factor": 99 }));
    other.act(&json!({ "do": "add", "mesh": "builtin:sphere" }));
    other.receive("an object", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 1));
    let overlays = std::cell::Cell::new(0);
    page.receive("a refusal", |message| {
        overlays.set(overlays.get() + usize::from(message["type"] == "overlay"));
        message["type"] == "refused"
    });
    // The refusal does not wait for all overlays.
    assert!(overlays.get() < REQUESTS / 2, "{}", overlays.get());
    flood(&mut page);
    assert!(viewer.interrupt().success());
}

#[test]
fn names_of_uploads_are_plain() {
    let folder = room_with_scene();
    write_mesh(folder.path());
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", is_scene);
    let object = std::fs::read(folder.path().join("object.obj")).unwrap();
    for name in ["%E2%80%AE%E2%80%8B", "", "..", "%0A", "a%2F"] {
        let (status, why) = viewer.upload("mesh", name, &object);
        assert_eq!((status, why.as_str()), (400, "the file has no usable name"), "{name}");
    }
    // A right-to-left override would show "sofajbo.gpj"; a leading hyphen would be an option.
    for (name, mesh, object_name) in [("sofa%E2%80%AE.obj", "sofa.obj", "sofa"), ("-o.obj", "-o.obj", "-o")] {
        assert_eq!(viewer.upload("mesh", name, &object), (204, String::new()));
        let (state, _) = page.receive("the object", |message| {
            let objects = message["view"]["objects"].as_array();
            objects.and_then(|all| all.last()).is_some_and(|last| last["mesh"] == mesh)
        });
        assert_eq!(state["view"]["objects"].as_array().unwrap().last().unwrap()["name"], object_name);
    }
    page.act(&json!({ "do": "rename", "object": 1, "name": "\u{200b}" }));
    page.receive("a refusal", |message| message["type"] == "refused" && message["why"].to_string().contains("visible"));
    page.act(&json!({ "do": "rename", "object": 1, "name": "red\u{202e} sofa" }));
    let (state, _) =
        page.receive("the name", |message| message["view"]["objects"][0]["name"].as_str() == Some("red sofa"));
    let command = state["view"]["command"].as_str().unwrap();
    assert!(command.contains("--mesh sofa.obj ") && command.contains("--mesh ./-o.obj "), "{command}");
}

#[test]
fn numbers_of_messages_out_of_range_are_refused() {
    let folder = room_with_scene();
    let mut viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", is_scene);
    page.act(&json!({ "do": "add", "mesh": "builtin:sphere", "pixel": [40, 90] }));
    page.receive("an object", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 1));
    let command = |command: Value| json!({ "type": "command", "command": command });
    for (message, why) in [
        (command(json!({ "do": "place", "object": 1, "place": { "position": [0, 1e30, 0] } })), "position_m"),
        (command(json!({ "do": "place", "object": 1, "place": { "pixel": [1e30, 2] } })), "pixel"),
        (command(json!({ "do": "size", "object": 1, "size": { "scale": 1e30 } })), "scale"),
        (command(json!({ "do": "size", "object": 1, "size": { "height": 0 } })), "height_m"),
        (command(json!({ "do": "turn", "object": 1, "yaw_deg": 1e30 })), "yaw_deg"),
        (command(json!({ "do": "set-key", "object": 1, "time_s": 1e30 })), "time"),
        (command(json!({ "do": "frames", "frames": 4_000_000_000_u32, "fps": 24 })), "frames"),
        (command(json!({ "do": "frames", "frames": null, "fps": 0 })), "frames per second"),
        (command(json!({ "do": "floor-gloss", "gloss": -1 })), "gloss"),
        (command(json!({ "do": "set-light", "light": "L1", "change": { "scale": 1e30 } })), "scale"),
        (
            command(json!({ "do": "add-light", "new": { "sun": { "azimuth_deg": 1e30, "elevation_deg": 45,
                "strength": 1, "angle_deg": 1, "kelvin": 5500 } } })),
            "direction",
        ),
        (
            command(json!({ "do": "add-light", "new": { "sphere": { "at_m": [1e30, 0, 0], "radius_m": 0.1,
                "radiance": 1, "kelvin": 5500 } } })),
            "position",
        ),
        (json!({ "type": "seek", "time_s": -1, "sequence": 1 }), "time"),
        (json!({ "type": "probe", "pixel": [40, 90], "lift_m": 1e30, "exposure_ev": 0 }), "distance"),
        (json!({ "type": "probe", "pixel": [40, 90], "lift_m": 0.1, "exposure_ev": 99 }), "exposure"),
    ] {
        page.send(&message);
        let (refused, _) = page.receive("a refusal", |message| message["type"] == "refused");
        assert!(refused["why"].as_str().unwrap().contains(why), "{message}: {refused}");
    }
    assert!(viewer.get("download/light.exr?u=40&v=90&lift=1e30").0 == 409 && viewer.is_alive());
}

/// Forwards connections from a free port to a host, as `ssh -L` does. Returns the port.
fn tunnel_to(host: &str) -> u16 {
    let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let (port, host) = (listener.local_addr().unwrap().port(), host.to_owned());
    std::thread::spawn(move || {
        for near in listener.incoming() {
            let (Ok(near), Ok(far)) = (near, TcpStream::connect(&host)) else { return };
            for (mut from, mut to) in [(near.try_clone().unwrap(), far.try_clone().unwrap()), (far, near)] {
                std::thread::spawn(move || {
                    let _ = std::io::copy(&mut from, &mut to);
                    let _ = to.shutdown(std::net::Shutdown::Write);
                });
            }
        }
    });
    port
}

#[test]
fn a_tunnel_may_end_at_another_port() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let (host, path) = viewer.host_and_path();
    for name in ["127.0.0.1", "localhost"] {
        let near = format!("{name}:{}", tunnel_to(host));
        let mut page = Page::connect(&near, path);
        page.receive("the scene", is_scene);
        let lines = [format!("Host: {near}"), format!("Origin: http://{near}"), "X-File-Name: no.obj".into()];
        let lines: Vec<&str> = lines.iter().map(String::as_str).chain(["Content-Length: 1"]).collect();
        // Past the guard, and read as a mesh.
        assert_eq!(viewer.request("POST", &format!("{path}upload/mesh"), &lines, b"x").0, 400);
    }
}

#[test]
fn other_machines_get_an_address_with_a_token_and_a_warning() {
    let folder = room_with_scene();
    let bind = ["room.scene", "--bind", "0.0.0.0"];
    let mut viewer = Viewer::start_with(folder.path(), &bind, |command| command.stderr(Stdio::piped()));
    let (host, path) = viewer.host_and_path();
    // 128 bits in hexadecimal.
    let token = path.trim_matches('/').to_owned();
    assert!(token.len() == 32 && token.chars().all(|c| c.is_ascii_hexdigit()), "{token}");
    assert!(!host.starts_with("0.0.0.0"), "{host}");
    assert_eq!(viewer.get("").0, 200);
    assert!(viewer.warnings("docs/viewer.md").contains("nothing is encrypted"));
    // A host name, as other machines use it.
    let public = ["room.scene", "--bind", "0.0.0.0", "--public-origin", "http://studio:8080"];
    let viewer = Viewer::start_with(folder.path(), &[&public[..], &["--port", "0"]].concat(), |command| command);
    assert!(viewer.address.starts_with("http://studio:8080/"), "{}", viewer.address);
}

#[test]
fn tokens_come_from_a_file_or_the_environment() {
    let folder = room_with_scene();
    let token = "kV8-zu3-pQ7-mX2-wR9";
    std::fs::write(folder.path().join("token"), format!("{token}\n")).unwrap();
    let by_file = Viewer::start(folder.path(), &["room.scene", "--token-file", "token"]);
    let by_variable =
        Viewer::start_with(folder.path(), &["room.scene"], |command| command.env("LIGHTOCTREE_TOKEN", token));
    for viewer in [by_file, by_variable] {
        assert_eq!(viewer.host_and_path().1, format!("/{token}/"));
        assert_eq!(viewer.get("").0, 200);
        #[cfg(target_os = "linux")]
        assert!(!viewer.command_line().contains(token), "{}", viewer.command_line());
    }
    std::fs::write(folder.path().join("token"), "aaaaaaaaaaaaaaaaaaaaaaaa").unwrap();
    let message = refused(folder.path(), 1, &["view", "room.scene", "--token-file", "token"]);
    assert!(message.contains("--token-file token") && message.contains("easy to guess"), "{message}");
    let message = refused(folder.path(), 1, &["view", "room.scene", "--token-file", "no-such-file"]);
    assert!(message.contains("no-such-file"), "{message}");
}
