//! `lightoctree view`: opening, saving and recovering rooms, and where meshes land.

use serde_json::json;

use crate::cli::room_with_scene;
use crate::support::view::Viewer;

#[test]
fn a_scene_that_cannot_be_opened_leaves_the_open_one() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", |message| message["type"] == "scene");
    page.act(&json!({ "do": "add", "mesh": "builtin:sphere" }));
    let has_one = |message: &serde_json::Value| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 1);
    let (state, _) = page.receive("an object", has_one);
    assert_eq!((&state["view"]["unsaved"], &state["view"]["has_file"]), (&json!(true), &json!(true)));
    assert_eq!(viewer.upload("scene", "cut.scene", &[8, 0, 0, 0, 0, 0, 0, 0, b'{']).0, 204);
    page.receive("the attempt", |message| message["type"] == "opening" && message["file"] == "cut.scene");
    page.receive("its end", |message| message["type"] == "opening-ended");
    page.receive("why not", |message| {
        message["type"] == "refused" && message["why"].as_str().unwrap().contains("cut.scene")
    });
    // Pages that join later see the scene, too, and it can still be edited.
    let mut late = viewer.page();
    late.receive("the object", has_one);
    late.act(&json!({ "do": "turn", "object": 1, "yaw_deg": 40 }));
    let (turned, _) = page.receive("the change", |message| message["view"]["objects"][0]["yaw_deg"] == 40.0);
    // A page that has written the scene to a file says so. An older change than the current one is not saved.
    let change = turned["change"].as_u64().unwrap();
    page.send(&json!({ "type": "saved", "change": change - 1, "file": "old.scene" }));
    page.send(&json!({ "type": "saved", "change": change, "file": "my room.scene" }));
    let (saved, _) = page.receive("the state", |message| message["view"]["unsaved"] == false);
    assert_eq!((&saved["view"]["file"], &saved["change"]), (&json!("my room.scene"), &json!(change)));
    assert!(saved["view"]["command"].as_str().unwrap().contains("insert 'my room.scene'"), "{saved}");
    // Another scene replaces it.
    let scene = std::fs::read(folder.path().join("room.scene")).unwrap();
    assert_eq!(viewer.upload("scene", "other.scene", &scene).0, 204);
    let (other, _) = page.receive("the other scene", |message| message["view"]["file"] == "other.scene");
    assert_eq!(other["view"]["objects"], json!([]));
}

#[test]
fn a_room_is_recovered_after_the_end_of_the_program() {
    let folder = room_with_scene();
    let start = |args: &[&str]| Viewer::start(folder.path(), &[args, &["--recent", "kept"]].concat());
    let mut viewer = start(&["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", |message| message["type"] == "scene");
    page.act(&json!({ "do": "add", "mesh": "builtin:sphere", "material": { "preset": "gold" } }));
    let (before, _) = page.receive("an object", |message| message["view"]["objects"][0]["id"] == 1);
    // Saved while the program runs, and at its end.
    let is_listed = |message: &serde_json::Value| message["type"] == "recent" && message["rooms"][0]["objects"] == 1;
    page.receive("the room among the recent ones", is_listed);
    page.act(&json!({ "do": "turn", "object": 1, "yaw_deg": 33 }));
    page.receive("the change", |message| message["view"]["objects"][0]["yaw_deg"] == 33.0);
    #[cfg(unix)]
    viewer.interrupt();
    drop(page);

    let viewer = start(&[]);
    let mut page = viewer.page();
    let (recent, _) = page.receive("the recent rooms", |message| message["type"] == "recent");
    let room = &recent["rooms"][0];
    assert_eq!((&room["file"], &room["unsaved"]), (&json!("room.scene"), &json!(true)));
    let path = format!("recent/{}", room["id"].as_str().unwrap());
    let (status, preview) = viewer.get(&path);
    assert!(status == 200 && preview.starts_with(b"\xff\xd8"), "{status}");
    let (host, token) = viewer.host_and_path();
    let ask = |method: &str, path: &str| {
        viewer.request(method, &format!("{token}{path}"), &[&format!("Host: {host}")], b"").0
    };
    assert_eq!(ask("POST", "recent/..%2froom"), 404);
    assert_eq!(ask("POST", &path), 204);
    let (after, _) = page.receive("the room", |message| message["type"] == "state");
    let object = &after["view"]["objects"][0];
    assert_eq!(object["material"], before["view"]["objects"][0]["material"]);
    #[cfg(unix)]
    assert_eq!(object["yaw_deg"], 33.0);
    assert_eq!((&after["view"]["unsaved"], &after["view"]["file"]), (&json!(true), &json!("room.scene")));
    assert_eq!(ask("DELETE", &path), 204);
    page.receive("no recent rooms", |message| message["type"] == "recent" && message["rooms"] == json!([]));
    assert_eq!(std::fs::read_dir(folder.path().join("kept")).unwrap().count(), 0);
}

#[test]
fn meshes_land_where_they_are_dropped_and_beside_each_other() {
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut page = viewer.page();
    page.receive("the scene", |message| message["type"] == "scene");
    let obj = b"v 0 0 0\nv 0.2 0 0\nv 0 0.2 0\nv 0 0 0.2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
    for name in ["a.obj", "b.obj"] {
        let (host, token) = viewer.host_and_path();
        let lines = [format!("Host: {host}"), format!("X-File-Name: {name}"), format!("Content-Length: {}", obj.len())];
        let lines: Vec<&str> = lines.iter().map(String::as_str).collect();
        let (status, why) = viewer.request("POST", &format!("{token}upload/mesh?u=70.25&v=94.5"), &lines, obj);
        assert_eq!(status, 204, "{}", String::from_utf8_lossy(&why));
    }
    let (state, _) =
        page.receive("two objects", |message| message["view"]["objects"].as_array().is_some_and(|all| all.len() == 2));
    let objects = &state["view"]["objects"];
    assert_eq!(objects[0]["place"], json!({ "pixel": [70.25, 94.5] }));
    let apart = |axis: usize| {
        let at = |index: usize| objects[index]["position_m"][axis].as_f64().unwrap();
        (at(0) - at(1)).abs()
    };
    assert!(apart(0).hypot(apart(2)) >= 0.2, "{objects}");
}
