//! `lightoctree view` in a real browser, without WebGL. `LIGHTOCTREE_SHOTS=FOLDER` keeps screenshots of the page.

use std::path::PathBuf;

use serde_json::Value;

use crate::cli::{room_with_expected_light, room_with_scene};
use crate::support::browser::Browser;
use crate::support::done;
use crate::support::tls_proxy::{TlsProxy, free_port};
use crate::support::view::{Page, Viewer};

/// Returns the page position of a photo position.
pub fn on_page(browser: &mut Browser, [u, v]: [f64; 2]) -> [f64; 2] {
    let place = browser.value(&format!(
        "(() => {{ const box = document.getElementById('handles').getBoundingClientRect(); const camera = viewer.page.scene.camera;
           return [box.left + {u} * box.width / camera.width, box.top + {v} * box.height / camera.height]; }})()"
    ));
    [place[0].as_f64().unwrap(), place[1].as_f64().unwrap()]
}

pub fn click(browser: &mut Browser, selector: &str) {
    browser.value(&format!("document.querySelector(`{selector}`).click()"));
}

/// Clicks the button with a text.
pub fn press(browser: &mut Browser, text: &str) {
    browser.value(&format!("[...document.querySelectorAll('button')].find((b) => b.textContent === '{text}').click()"));
}

pub fn shot(browser: &mut Browser, name: &str) {
    if let Some(folder) = std::env::var_os("LIGHTOCTREE_SHOTS") {
        browser.screenshot(&PathBuf::from(folder).join(name));
    }
}

/// Compares the stage with all its layers, 240 pixels wide, with a snapshot. `UPDATE_SNAPSHOTS=1` writes it.
fn assert_looks_as(browser: &mut Browser, name: &str) {
    let address = browser.value(
        "(() => { const layers = [...document.querySelectorAll('#stage canvas')].filter((layer) => layer.checkVisibility());
           const small = document.createElement('canvas'); small.width = 240;
           small.height = Math.round(240 * layers[0].height / layers[0].width);
           const context = small.getContext('2d'); context.imageSmoothingQuality = 'high';
           for (const layer of layers) context.drawImage(layer, 0, 0, small.width, small.height);
           return small.toDataURL(); })()",
    );
    let bytes = base64::Engine::decode(
        &base64::engine::general_purpose::STANDARD,
        address.as_str().unwrap().strip_prefix("data:image/png;base64,").unwrap(),
    );
    let bytes = bytes.unwrap();
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/snapshots").join(name);
    if std::env::var_os("UPDATE_SNAPSHOTS").is_some() {
        std::fs::write(&file, &bytes).unwrap();
    }
    let shown = lo_imaging::photo_from_bytes(&bytes, name).unwrap().photo.radiance();
    let kept = lo_imaging::read_photo(&file).unwrap().photo.radiance();
    assert_eq!((shown.width(), shown.height()), (kept.width(), kept.height()), "{name}");
    let srgb = |value: f32| 255.0 * lo_imaging::srgb_from_linear(value);
    let off: Vec<f32> = std::iter::zip(shown.pixels().iter().flatten(), kept.pixels().iter().flatten())
        .map(|(&a, &b)| (srgb(a) - srgb(b)).abs())
        .collect();
    let mean = off.iter().sum::<f32>() / off.len() as f32;
    let far = off.iter().filter(|off| **off > 24.0).count() as f32 / off.len() as f32;
    if mean > 2.0 || far > 0.01 {
        let seen = std::env::temp_dir().join(name);
        std::fs::write(&seen, &bytes).unwrap();
        panic!(
            "{name}: codes off by {mean:.2} on average, {:.2} % of them by more than 24; see {}",
            100.0 * far,
            seen.display()
        );
    }
}

pub fn object(browser: &mut Browser, index: usize) -> Value {
    browser.value(&format!("viewer.page.view.objects[{index}]"))
}

/// The final image of the current change is shown, and no sent preview is still on its way.
pub const FINAL: &str = "viewer.figures.shown?.step === 'final' && viewer.figures.shown.change === viewer.page.change && \
                     viewer.figures.sent.size === 0";

/// Returns the photo position of the centre of the first object.
pub fn middle(browser: &mut Browser) -> [f64; 2] {
    let seen = browser.value(
        "import('./page/camera.js').then(({ project }) => { const o = viewer.page.view.objects[0];
           return project(viewer.page.scene.camera, [o.position_m[0], o.position_m[1] + o.size_m[1] / 2, o.position_m[2]]); })",
    );
    [0, 1].map(|axis| seen[axis].as_f64().unwrap())
}

#[test]
fn a_person_moves_objects_and_light() {
    let Some(mut browser) = Browser::start("the viewer's page") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    browser.open(&viewer.address, [1280, 720]);
    assert_eq!(browser.value("document.createElement('canvas').getContext('webgl')"), Value::Null);
    browser.wait("document.body.dataset.at === 'scene'");
    browser.wait(FINAL);
    shot(&mut browser, "empty_scene.png");
    assert_looks_as(&mut browser, "view_empty.png");

    // Add, drag, undo, redo.
    press(&mut browser, "Chrome sphere");
    browser.wait("viewer.page.view.objects.length === 1 && viewer.page.selectedId === 1");
    browser.wait(FINAL);
    shot(&mut browser, "sphere.png");
    assert_looks_as(&mut browser, "view_sphere.png");
    let before = object(&mut browser, 0);
    let from = middle(&mut browser);
    let place = on_page(&mut browser, from);
    browser.mouse("mouseMoved", place);
    browser.mouse("mousePressed", place);
    for step in 1..=10 {
        let place = on_page(&mut browser, [from[0] + 2.0 * f64::from(step), from[1]]);
        browser.mouse("mouseMoved", place);
    }
    browser.wait("viewer.figures.latencies_ms.length > 0");
    shot(&mut browser, "dragging.png");
    let place = on_page(&mut browser, [from[0] + 20.0, from[1]]);
    browser.mouse("mouseReleased", place);
    // At rest, every movement has arrived.
    browser.wait(FINAL);
    let moved = object(&mut browser, 0);
    assert_ne!(before["place"], moved["place"]);
    browser.key("z", 2);
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) === '{}'", before["place"]));
    browser.key("z", 2 | 8);
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) === '{}'", moved["place"]));

    // Esc cancels a drag. The intermediate positions depend on the machine's speed, but the original position is always
    // restored.
    let seen = middle(&mut browser);
    let place = on_page(&mut browser, seen);
    browser.mouse("mouseMoved", place);
    browser.mouse("mousePressed", place);
    let away = on_page(&mut browser, from);
    for share in 1..=5 {
        let step = [0, 1].map(|axis| place[axis] + f64::from(share) / 5.0 * (away[axis] - place[axis]));
        browser.mouse("mouseMoved", step);
    }
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) !== '{}'", moved["place"]));
    browser.key("Escape", 0);
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) === '{}'", moved["place"]));
    browser.mouse("mouseReleased", away);

    // Keys and fields.
    browser.key("]", 0);
    browser.wait("viewer.page.view.objects[0].yaw_deg === -5");
    let height = "viewer.page.view.objects[0].position_m[1]";
    let resting = browser.value(height);
    browser.key("PageUp", 0);
    browser.wait(&format!("viewer.page.view.objects[0].place.position && {height} > {resting} + 0.005"));
    browser.key("g", 0);
    browser.wait(&format!("{height} < {resting} + 0.005"));
    browser.value(
        "(() => { const field = document.querySelector('#properties input[aria-label=\"Height in metres\"]');
           field.value = '0.4'; field.dispatchEvent(new Event('change')); })()",
    );
    browser.wait("Math.abs(viewer.page.view.objects[0].size_m[1] - 0.4) < 1e-3");
    browser.value(
        "(() => { const field = document.querySelector('#properties input[type=range][aria-label=Roughness]'); field.value = '0.4';
           field.dispatchEvent(new Event('input')); field.dispatchEvent(new Event('change')); })()",
    );
    browser.wait("viewer.page.view.objects[0].material.roughness === 0.4");

    // Meshes: a valid one, and a broken one with an error message.
    let suzanne = std::fs::read(lo_testdata::asset("suzanne.glb")).unwrap();
    browser.drop_file("suzanne.glb", &suzanne);
    browser.wait("viewer.page.view.objects.length === 2 && viewer.page.selectedId === 2");
    browser.drop_file("broken.glb", &suzanne[..suzanne.len() / 2]);
    browser.wait("document.getElementById('messages').textContent.includes('broken.glb')");
    browser.key("d", 2);
    browser.wait("viewer.page.view.objects.length === 3");
    browser.key("Delete", 0);
    browser.wait("viewer.page.view.objects.length === 2");

    // Exposure and false colour only affect the display.
    let change = browser.value("viewer.page.change");
    let middle = "[...document.getElementById('picture').getContext('2d').getImageData(5, 5, 1, 1).data].slice(0, 3)";
    browser.wait(FINAL);
    let plain = browser.value(middle);
    browser.value("(() => { const field = document.getElementById('exposure'); field.value = '1'; field.oninput({ target: field }); })()");
    let bright = browser.value(middle);
    assert!(bright[0].as_u64() > plain[0].as_u64(), "{plain} {bright}");
    browser.key("0", 0);
    browser.key("f", 0);
    assert_ne!(browser.value(middle), plain);
    shot(&mut browser, "false_colour.png");
    browser.key("f", 0);
    assert_eq!((browser.value(middle), browser.value("viewer.page.change")), (plain, change));

    // The probe follows the pointer.
    let place = on_page(&mut browser, [20.0, 85.0]);
    browser.mouse("mouseMoved", place);
    browser.wait("document.querySelector('#probe canvas.panorama').width === 192");
    for what in ["depth", "normals", "levels", "origins"] {
        browser.value(&format!(
            "(() => {{ const field = document.getElementById('overlay'); field.value = '{what}'; field.onchange({{ target: field }}); }})()"
        ));
        browser.wait("!document.getElementById('legend').hidden");
        shot(&mut browser, &format!("overlay_{what}.png"));
        assert_looks_as(&mut browser, &format!("view_{what}.png"));
        browser.value("(() => { const field = document.getElementById('overlay'); field.value = ''; field.onchange({ target: field }); })()");
    }
    press(&mut browser, "Add sun");
    browser.wait("viewer.page.view.lights.some((light) => light.id === 'A1')");
    browser.key("?", 0);
    browser.wait("document.getElementById('help').open");
    shot(&mut browser, "help.png");
    click(&mut browser, "#help button");

    // A reload restores everything.
    browser.call("Page.reload", serde_json::json!({}));
    browser.wait("globalThis.viewer?.page.view?.objects.length === 2");
    browser.wait(FINAL);
    browser.resize([3840, 2160]);
    browser.wait("document.getElementById('picture').width > 1500");
    shot(&mut browser, "large.png");
    let faults = std::mem::take(&mut browser.faults);
    // The browser reports the refusal of the broken mesh as a network error.
    let faults: Vec<_> = faults.into_iter().filter(|fault| !fault.contains("/upload/mesh")).collect();
    assert_eq!(faults, Vec::<String>::new());
}

#[test]
fn a_person_chooses_the_inferred_light() {
    let Some(mut browser) = Browser::start("the viewer's choice of light") else { return };
    let folder = room_with_expected_light();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.body.dataset.at === 'scene'");
    press(&mut browser, "Chrome sphere");
    browser.wait("viewer.page.view.objects.length === 1 && viewer.page.selectedId === 1");
    browser.key("Escape", 0);
    browser.wait(FINAL);
    let chosen = "viewer.page.view.inferred_light";
    let is_off = |browser: &mut Browser| {
        browser.value(
            "['inferred-light', 'contrast', 'warmth', 'pick-white'].map((id) => document.getElementById(id).disabled)",
        )
    };
    assert_eq!(is_off(&mut browser), serde_json::json!([false, false, false, false]));
    // Dragging a slider renders drafts, updates its number, and is one step.
    let slide = |browser: &mut Browser, id: &str, values: &[f64]| {
        for value in values {
            set_field(browser, id, value, "input");
            browser.wait(&format!("Object.values({chosen}).includes({value})"));
        }
        browser.value(&format!("document.getElementById('{id}').dispatchEvent(new Event('change'))"));
    };
    browser.value("viewer.figures.latencies_ms.length = 0");
    slide(&mut browser, "contrast", &[1.3, 1.9, 2.5]);
    browser.wait("viewer.figures.latencies_ms.length > 0");
    browser.wait("document.getElementById('contrast').nextElementSibling.value === '2.5'");
    browser.key("z", 2);
    browser.wait(&format!("{chosen}.contrast === 1"));
    browser.key("z", 2 | 8);
    browser.wait(&format!("{chosen}.contrast === 2.5"));
    // A number is typed; an invalid one is reverted.
    let typed = |browser: &mut Browser, id: &str, value: &str| {
        browser.value(&format!(
            "(() => {{ const field = document.getElementById('{id}').nextElementSibling; field.focus(); field.value = '{value}';
               field.dispatchEvent(new Event('change')); }})()"
        ));
    };
    typed(&mut browser, "warmth", "0.73");
    browser.wait(&format!("{chosen}.warmth_ev === 0.73"));
    typed(&mut browser, "warmth", "7");
    browser.wait("document.getElementById('messages').textContent.includes('the warmth must be from -4 to 4')");
    browser.value("document.activeElement.blur()");
    browser.wait("document.getElementById('warmth').nextElementSibling.value === '0.73'");
    // White is picked with a click that selects nothing. Esc cancels.
    let place = on_page(&mut browser, [40.7, 70.2]);
    let hint = "document.getElementById('pick-hint').hidden";
    click(&mut browser, "#pick-white");
    assert_eq!(
        (browser.value(hint), browser.value("document.getElementById('pick-white').ariaPressed")),
        (false.into(), "true".into())
    );
    shot(&mut browser, "picking_white.png");
    browser.key("Escape", 0);
    assert_eq!(browser.value(hint), true);
    browser.mouse("mousePressed", place);
    browser.mouse("mouseReleased", place);
    click(&mut browser, "#view-room");
    click(&mut browser, "#pick-white");
    assert_eq!(browser.value("viewer.outside.isOn"), false);
    browser.mouse("mouseMoved", place);
    browser.mouse("mousePressed", place);
    browser.mouse("mouseReleased", place);
    browser.wait(&format!("{chosen}.white?.join() === '40.5,70.5'"));
    assert_eq!(browser.value(hint), true);
    browser.wait("document.getElementById('white-at').textContent === 'at 40, 70'");
    browser.wait(FINAL);
    shot(&mut browser, "inferred_light.png");
    let mark = "(() => { const canvas = document.getElementById('handles'); const scale = canvas.width / viewer.page.scene.camera.width;
       return [...canvas.getContext('2d').getImageData(40.5 * scale, 70.5 * scale, 1, 1).data]; })()";
    assert_eq!(browser.value(mark), serde_json::json!([255, 255, 255, 255]));
    click(&mut browser, "#clear-white");
    browser.wait(&format!("!{chosen}.white"));
    browser.wait("document.getElementById('clear-white').hidden");
    // Controls without effect are disabled.
    let choose = |browser: &mut Browser, light: &str| {
        set_field(browser, "inferred-light", light, "change");
        browser.wait(&format!("{chosen}.light === '{light}'"));
    };
    choose(&mut browser, "expected");
    browser.wait("document.getElementById('contrast').disabled");
    assert_eq!(is_off(&mut browser), serde_json::json!([false, true, false, false]));
    choose(&mut browser, "even");
    browser.wait("document.getElementById('warmth').disabled");
    assert_eq!(is_off(&mut browser), serde_json::json!([false, true, true, true]));
    assert_eq!(browser.faults, Vec::<String>::new());
    // A scene whose light was not inferred by a network has a note.
    let plain = room_with_scene();
    let viewer = Viewer::start(plain.path(), &["room.scene"]);
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.querySelector('.inferred > .note')?.textContent.includes('nothing to choose')");
    assert_eq!(is_off(&mut browser), serde_json::json!([true, true, true, true]));
    shot(&mut browser, "no_inferred_light.png");
}

/// The view from outside is at rest and its image is shown.
pub const STILL: &str = "viewer.outside.isStill()";

#[test]
fn a_person_looks_at_the_room_from_outside() {
    let Some(mut browser) = Browser::start("the viewer's room from outside") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.body.dataset.at === 'scene'");
    browser.wait(FINAL);
    click(&mut browser, "#view-room");
    browser.wait(STILL);
    shot(&mut browser, "room.png");
    let pressed = browser.value("['view-photo', 'view-room'].map((id) => document.getElementById(id).ariaPressed)");
    assert_eq!(pressed, serde_json::json!(["false", "true"]));
    browser.value(
        "Promise.all(['camera', 'orbit'].map((name) => import(`./page/${name}.js`))).then(([{ project }, { cameraOf, inFrame }]) => {
           const camera = () => cameraOf(viewer.outside.shown.view, viewer.page.scene.up);
           // Codes of the program's image, or of the canvas with its lines, around points of the room.
           globalThis.codes = (points, onCanvas, reach) => {
             const { bitmap, view } = viewer.outside.shown;
             const canvas = onCanvas ? document.getElementById('outside') : new OffscreenCanvas(bitmap.width, bitmap.height);
             if (!onCanvas) canvas.getContext('2d').drawImage(bitmap, 0, 0);
             return points.map((point) => {
               const [u, v] = project(camera(), inFrame(camera(), point));
               const [x, y] = [Math.floor((u * canvas.width) / view.width), Math.floor((v * canvas.height) / view.height)];
               const { data } = canvas.getContext('2d').getImageData(x - reach, y - reach, 2 * reach + 1, 2 * reach + 1);
               return Array.from({ length: data.length / 4 }, (_, i) => [...data.slice(4 * i, 4 * i + 3)]);
             });
           };
           globalThis.onPage = (point) => {
             const box = document.getElementById('outside').getBoundingClientRect();
             const [u, v] = project(camera(), inFrame(camera(), point));
             return [box.left + (u * box.width) / viewer.outside.shown.view.width, box.top + (v * box.height) / viewer.outside.shown.view.height];
           };
         })",
    );

    // The frustum's edges are drawn in the accent colour, which the program's image does not contain.
    let accents = |browser: &mut Browser, on_canvas: bool| {
        browser.value(&format!(
            "(() => {{ const {{ camera, extent }} = viewer.page.scene;
               const edge = (s, t) => [0.5, 0.7, 0.9].map((share) => share * 0.16 * extent.radius_m).map((depth) =>
                 [((s - camera.cx) / camera.fx) * depth, -((t - camera.cy) / camera.fy) * depth, -depth]);
               const points = [0, camera.width].flatMap((s) => [0, camera.height].flatMap((t) => edge(s, t)));
               const isAccent = ([r, g, b]) => Math.abs(r - 240) + Math.abs(g - 169) + Math.abs(b - 59) < 60;
               return codes(points, {on_canvas}, 2).filter((around) => around.some(isAccent)).length; }})()"
        ))
    };
    assert_eq!((accents(&mut browser, true), accents(&mut browser, false)), (12.into(), 0.into()));

    // An object is rendered where the page projects it, and nowhere else.
    press(&mut browser, "Chrome sphere");
    browser.wait("viewer.page.selectedId === 1");
    browser.wait(STILL);
    browser.value(
        "(() => { const { position_m: [x, y, z], size_m: [w, h] } = viewer.page.view.objects[0];
           globalThis.points = [[0, 0], [0.7, 0], [-0.7, 0], [0, 0.7], [1.5, 0], [-1.5, 0], [0, 1.5]].map(([a, b]) =>
             [x + 0.5 * a * w, y + 0.5 * h * (1 + b), z]); })()",
    );
    let with = browser.value("codes(points, false, 0)");
    shot(&mut browser, "room_with_object.png");

    // A click selects it; dragging rotates the view and moves nothing in the room.
    browser.key("Escape", 0);
    browser.wait("viewer.page.selectedId === null");
    let number = |browser: &mut Browser, expression: &str| browser.value(expression).as_f64().unwrap();
    let [x, y] = [0, 1].map(|axis| number(&mut browser, &format!("onPage(points[0])[{axis}]")));
    browser.mouse("mousePressed", [x, y]);
    browser.mouse("mouseReleased", [x, y]);
    browser.wait("viewer.page.selectedId === 1");
    let place = object(&mut browser, 0)["place"].clone();
    let before = browser.value("viewer.outside.orbit()");
    let empty = [x + 120.0, y - 60.0];
    browser.mouse("mousePressed", empty);
    for step in 1..=8 {
        browser.mouse("mouseMoved", [empty[0] + 10.0 * f64::from(step), empty[1] + 2.0 * f64::from(step)]);
    }
    browser.mouse("mouseReleased", [empty[0] + 80.0, empty[1] + 16.0]);
    browser.wait(STILL);
    let after = browser.value("viewer.outside.orbit()");
    assert!(after["yaw_deg"].as_f64() < before["yaw_deg"].as_f64(), "{before} {after}");
    assert!(after["pitch_deg"].as_f64() > before["pitch_deg"].as_f64(), "{before} {after}");
    assert_eq!(object(&mut browser, 0)["place"], place);
    assert_ne!(browser.value("codes(points, false, 0)"), with);
    shot(&mut browser, "room_turned.png");
    let wheel = serde_json::json!({ "type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": -300 });
    browser.call("Input.dispatchMouseEvent", wheel);
    browser.wait(&format!("viewer.outside.orbit().distance_m < {}", before["distance_m"]));

    // The keys do the same.
    browser.key("ArrowRight", 0);
    browser.wait(&format!("Math.abs(viewer.outside.orbit().yaw_deg - {} - 5) < 1e-9", after["yaw_deg"]));
    browser.key("ArrowUp", 8);
    browser.wait(&format!("viewer.outside.orbit().target_m.join() !== '{}'", before["target_m"]));
    browser.key("Home", 0);
    let expected = format!("({before})[name].toString() === viewer.outside.orbit()[name].toString()");
    browser.wait(&format!("['yaw_deg', 'pitch_deg', 'distance_m', 'target_m'].every((name) => {expected})"));
    browser.wait(STILL);
    assert_eq!(browser.value("codes(points, false, 0)"), with);
    browser.key("Delete", 0);
    browser.wait("viewer.page.view.objects.length === 0");
    browser.wait(STILL);
    let without = browser.value("codes(points, false, 0)");
    let differ: Vec<bool> = (0..7).map(|i| with[i] != without[i]).collect();
    assert_eq!(differ, [true, true, true, true, false, false, false], "{with} {without}");

    // Provenance has the overlay's colours and legend. The program applies the exposure here.
    browser.value("(() => { const field = document.getElementById('overlay'); field.value = 'origins'; field.onchange({ target: field }); })()");
    browser.wait(STILL);
    browser.wait("document.getElementById('legend').textContent.includes('inferred')");
    assert_ne!(browser.value("codes(points, false, 0)"), without);
    shot(&mut browser, "room_origins.png");
    browser.value("(() => { const field = document.getElementById('overlay'); field.value = ''; field.onchange({ target: field }); })()");
    browser.value("(() => { const field = document.getElementById('exposure'); field.value = '1'; field.oninput({ target: field }); })()");
    browser.wait(STILL);
    let bright = browser.value("codes(points, false, 0)[4][0][1]").as_u64();
    assert!(bright > without[4][0][1].as_u64(), "{bright:?} {without}");

    // Back in the photo.
    browser.key("v", 0);
    let is_photo = "document.getElementById('outside').hidden && getComputedStyle(document.getElementById('picture')).visibility === 'visible'";
    assert_eq!(browser.value(is_photo), true);
    assert_eq!(browser.faults, Vec::<String>::new());
}

#[test]
fn a_person_makes_an_object_move() {
    let Some(mut browser) = Browser::start("the viewer's timeline") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let downloads = tempfile::tempdir().unwrap();
    let behavior = serde_json::json!({ "behavior": "allow", "downloadPath": downloads.path() });
    browser.call("Page.setDownloadBehavior", behavior);
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.body.dataset.at === 'scene'");
    assert_eq!(browser.value("document.getElementById('timeline').hidden"), true);
    press(&mut browser, "Chrome sphere");
    browser.wait("viewer.page.view.objects.length === 1 && viewer.page.selectedId === 1");
    browser.key("k", 0);
    browser.wait("viewer.page.view.objects[0].path?.keyframes.length === 1");
    browser.wait("!document.getElementById('timeline').hidden");
    // Moving the object at another time adds a keyframe.
    let seek = |browser: &mut Browser, time: &str| {
        browser.value(&format!(
            "(() => {{ const field = document.getElementById('playhead'); field.value = '{time}'; field.oninput(); }})()"
        ));
        browser.wait(&format!("Math.abs(viewer.page.view.timeline.time_s - {time}) < 0.03"));
    };
    seek(&mut browser, "2");
    browser.value("document.getElementById('stage').focus()");
    for _ in 0..12 {
        browser.key("ArrowRight", 0);
    }
    browser.wait("viewer.page.view.objects[0].path.keyframes.length === 2");
    browser.wait(FINAL);
    shot(&mut browser, "timeline.png");
    let at_2 = object(&mut browser, 0)["position_m"].clone();
    seek(&mut browser, "1");
    let at_1 = object(&mut browser, 0)["position_m"].clone();
    assert_ne!(at_1, at_2);
    // A keyframe is dragged to another time; undo restores it.
    let key = browser.value(
        "(() => { const box = document.querySelectorAll('#timeline .key')[1].getBoundingClientRect();
           return [box.left + box.width / 2, box.top + box.height / 2]; })()",
    );
    let place = [key[0].as_f64().unwrap(), key[1].as_f64().unwrap()];
    browser.mouse("mouseMoved", place);
    browser.mouse("mousePressed", place);
    for step in 1..=5 {
        browser.mouse("mouseMoved", [place[0] - 20.0 * f64::from(step), place[1]]);
    }
    browser.wait("viewer.page.view.timeline.span_s[1] < 1.9");
    browser.mouse("mouseReleased", [place[0] - 100.0, place[1]]);
    browser.key("z", 2);
    browser.wait("viewer.page.view.timeline.span_s[1] === 2");
    // Playback advances the time.
    browser.value("document.getElementById('stage').focus()");
    browser.key(" ", 0);
    browser.wait("document.getElementById('play').textContent === 'Stop'");
    let before = browser.value("viewer.page.view.timeline.time_s");
    browser.wait(&format!("Math.abs(viewer.page.view.timeline.time_s - {before}) > 0.3"));
    browser.key(" ", 0);
    browser.wait("document.getElementById('play').textContent === 'Play'");
    assert_eq!(browser.value("viewer.page.view.can_redo"), true, "seeking is not a step");
    // Delete a keyframe, and undo.
    click(&mut browser, "#timeline .key:nth-child(2)");
    browser.value("document.querySelectorAll('#timeline .key')[1].focus()");
    browser.key("Delete", 0);
    browser.wait("viewer.page.view.objects[0].path.keyframes.length === 1");
    browser.key("z", 2);
    browser.wait("viewer.page.view.objects[0].path.keyframes.length === 2");
    // A short video equals that of the command line.
    browser.value("(() => { const field = document.getElementById('fps'); field.value = '2'; field.onchange(); })()");
    browser.wait("viewer.page.view.timeline.frames === 5");
    click(&mut browser, "[data-file=\"video.y4m\"]");
    let video = downloads.path().join("video.y4m");
    let begun = std::time::Instant::now();
    while !video.is_file() {
        assert!(begun.elapsed().as_secs() < 120, "no video");
        std::thread::sleep(std::time::Duration::from_millis(50));
    }
    let command = browser.value("viewer.page.view.command").as_str().unwrap().to_owned();
    let (_, layout) = viewer.get("download/objects.json");
    std::fs::write(folder.path().join("objects.json"), layout).unwrap();
    done(folder.path(), &command.split(' ').skip(1).collect::<Vec<_>>());
    assert!(std::fs::read(video).unwrap() == std::fs::read(folder.path().join("video.y4m")).unwrap());
    browser.wait("document.getElementById('sequence').hidden");
    // Everything is visible and reachable, in a small and a large window.
    let wide =
        "document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight";
    assert_eq!(browser.value(wide), false);
    let nameless = browser.value(
        "[...document.querySelectorAll('#timeline button, #timeline input, #timeline select')].filter((control) =>
           !(control.textContent.trim() || control.getAttribute('aria-label') || control.labels?.length) || control.tabIndex < 0).length",
    );
    assert_eq!(nameless, 0);
    browser.resize([3840, 2160]);
    browser.wait("document.getElementById('picture').width > 1500");
    shot(&mut browser, "timeline_large.png");
    assert_eq!(browser.faults, Vec::<String>::new());
}

#[test]
fn controls_have_names_and_texts_have_contrast() {
    let Some(mut browser) = Browser::start("names and contrast of the viewer's page") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.body.dataset.at === 'scene'");
    press(&mut browser, "Add lamp");
    browser.wait("viewer.page.selectedLight === 'A1'");
    press(&mut browser, "Gold sphere");
    browser.wait("viewer.page.selectedId");
    let nameless = browser.value(
        "[...document.querySelectorAll('button, input, select, summary')].filter((control) => control.type !== 'file' &&
           !(control.textContent.trim() || control.getAttribute('aria-label') || control.labels?.length)).map((c) => c.outerHTML)",
    );
    assert_eq!(nameless, serde_json::json!([]));
    // WCAG 2.2, 1.4.3: ratio of relative luminances.
    let faint = browser.value(
        "(() => {
           const linear = (c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4);
           const numbers = (color) => color.match(/[\\d.]+/g).map(Number);
           const luminance = ([r, g, b]) => 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b);
           const ground = (e) => { for (; e; e = e.parentElement) { const c = numbers(getComputedStyle(e).backgroundColor);
             if (c.length === 3 || c[3] > 0.5) return c; } return [0, 0, 0]; };
           const shown = (e) => e.checkVisibility() && [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
           return [...document.querySelectorAll('body *')].filter(shown).filter((e) => !e.disabled).map((e) => {
             const [a, b] = [luminance(numbers(getComputedStyle(e).color)), luminance(ground(e))];
             return [e.textContent.trim(), (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05)];
           }).filter(([, ratio]) => ratio < 4.5);
         })()",
    );
    assert_eq!(faint, serde_json::json!([]));
    // All controls are reachable with Tab.
    let unreachable =
        browser.value("[...document.querySelectorAll('button, input, select')].filter((c) => c.tabIndex < 0).length");
    assert_eq!(unreachable, 0);
    // Nothing overflows the window.
    let wide = browser.value(
        "document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight",
    );
    assert_eq!(wide, false);
}

/// Measures rate and latency of images while an object is dragged in the browser.
fn drag_for(browser: &mut Browser, seconds: f64) -> (f64, f64, f64) {
    let seen = browser.value(
        "import('./page/camera.js').then(({ project, corners }) => { const o = viewer.page.selected();
           const box = corners(o).map((c) => project(viewer.page.scene.camera, c)); const mean = (i) => box.reduce((s, p) => s + p[i] / 8, 0);
           return [mean(0), mean(1)]; })",
    );
    let from = [seen[0].as_f64().unwrap(), seen[1].as_f64().unwrap()];
    let place = on_page(browser, from);
    browser.mouse("mouseMoved", place);
    browser.mouse("mousePressed", place);
    let width = browser.value("viewer.page.scene.camera.width").as_f64().unwrap();
    browser.value("viewer.figures.latencies_ms.length = viewer.figures.frames_at_ms.length = 0");
    let begun = std::time::Instant::now();
    while begun.elapsed().as_secs_f64() < seconds {
        let angle = 2.0 * begun.elapsed().as_secs_f64();
        let place =
            on_page(browser, [from[0] + 0.12 * width * angle.sin(), from[1] + 0.02 * width * (2.0 * angle).sin()]);
        browser.mouse("mouseMoved", place);
        std::thread::sleep(std::time::Duration::from_millis(8));
    }
    let measured = measured(browser);
    browser.mouse("mouseReleased", place);
    measured
}

/// Returns images per second, and median and 90th percentile of the latency, ms, of the current movement.
fn measured(browser: &mut Browser) -> (f64, f64, f64) {
    let numbers = |browser: &mut Browser, list: &str| -> Vec<f64> {
        let list = browser.value(&format!("viewer.figures.{list}"));
        list.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let at = numbers(browser, "frames_at_ms");
    let mut latencies = numbers(browser, "latencies_ms");
    latencies.sort_by(f64::total_cmp);
    let rate = 1e3 * (at.len() - 1) as f64 / (at[at.len() - 1] - at[0]);
    (rate, latencies[latencies.len() / 2], latencies[latencies.len() * 9 / 10])
}

/// Sets a field of the page and dispatches an event.
pub fn set_field(browser: &mut Browser, id: &str, value: impl std::fmt::Display, event: &str) {
    browser.value(&format!(
        "(() => {{ const field = document.getElementById('{id}'); field.value = '{value}'; field.dispatchEvent(new Event('{event}')); }})()"
    ));
}

/// Measures rate and latency of images while a slider moves.
fn slide_for(browser: &mut Browser, id: &str, seconds: f64) -> (f64, f64, f64) {
    browser.value("viewer.figures.latencies_ms.length = viewer.figures.frames_at_ms.length = 0");
    let begun = std::time::Instant::now();
    while begun.elapsed().as_secs_f64() < seconds {
        let value = 1.0 + 0.8 * (2.0 * begun.elapsed().as_secs_f64()).sin();
        set_field(browser, id, value, "input");
        std::thread::sleep(std::time::Duration::from_millis(8));
    }
    let measured = measured(browser);
    browser.value(&format!("document.getElementById('{id}').dispatchEvent(new Event('change'))"));
    measured
}

/// Measures the view from outside: images per second during a rotation, median rendering time, and rendering time at
/// rest, ms.
fn turn_for(browser: &mut Browser, seconds: f64) -> (f64, f64, f64) {
    press(browser, "Room");
    browser.wait(STILL);
    let place = [460.0, 300.0];
    browser.mouse("mousePressed", place);
    let (mut shown, mut took_ms) = (browser.value("viewer.outside.shown.sequence").as_f64().unwrap(), Vec::new());
    let begun = std::time::Instant::now();
    while begun.elapsed().as_secs_f64() < seconds {
        let angle = 2.0 * begun.elapsed().as_secs_f64();
        browser.mouse("mouseMoved", [place[0] + 150.0 * angle.sin(), place[1] + 60.0 * (2.0 * angle).sin()]);
        std::thread::sleep(std::time::Duration::from_millis(8));
        let now = browser.value("[viewer.outside.shown.sequence, viewer.outside.shown.took_ms]");
        if now[0].as_f64().unwrap() > shown {
            shown = now[0].as_f64().unwrap();
            took_ms.push(now[1].as_f64().unwrap());
        }
    }
    let rate = took_ms.len() as f64 / begun.elapsed().as_secs_f64();
    browser.mouse("mouseReleased", place);
    took_ms.sort_by(f64::total_cmp);
    browser.wait(STILL);
    let still_ms = browser.value("viewer.outside.shown.took_ms").as_f64().unwrap();
    (rate, took_ms[took_ms.len() / 2], still_ms)
}

#[test]
#[ignore = "figures, on a machine that does nothing else: cargo test --release -p lightoctree-cli --test it view_figures -- --ignored --nocapture"]
fn view_figures() {
    let Some(mut browser) = Browser::start("the viewer's figures") else { return };
    let folder = tempfile::tempdir().unwrap();
    let photo = lo_imaging::read_photo(lo_testdata::asset("library_color.jpg")).unwrap().photo.radiance();
    let photo = lo_imaging::resize(&photo, 960, 720);
    let photo = lo_imaging::Photo::Srgb8(photo.map(|rgb| rgb.map(lo_imaging::srgb8_from_linear)));
    lo_imaging::write_photo(folder.path().join("photo.jpg"), &photo, "test").unwrap();
    let depth = lo_testdata::asset("library_lidar_depth.png").display().to_string();
    for (what, more) in
        [("photo alone", &[][..]), ("photo with LiDAR depth", &["--depth", &depth, "--intrinsics", "665,665,480,360"])]
    {
        let begun = std::time::Instant::now();
        let viewer = Viewer::start(folder.path(), &[&["photo.jpg"], more].concat());
        let started_s = begun.elapsed().as_secs_f64();
        browser.open(&viewer.address, [1280, 720]);
        browser.wait("viewer.figures.shown");
        println!(
            "{what}: address after {started_s:.2} s, photo in the page after {:.2} s",
            begun.elapsed().as_secs_f64()
        );
        let begun = std::time::Instant::now();
        press(&mut browser, "Chrome sphere");
        browser.wait("viewer.figures.shown?.change === viewer.page.change && viewer.page.view.objects.length === 1");
        let first_s = begun.elapsed().as_secs_f64();
        browser.wait(FINAL);
        println!(
            "{what}: first image with an object after {first_s:.2} s, the final one after {:.2} s",
            begun.elapsed().as_secs_f64()
        );
        for (name, add) in [("chrome sphere", None), ("tea set", Some("Tea set")), ("both", None)] {
            if name == "both" {
                press(&mut browser, "Chrome sphere");
                browser.wait("viewer.page.view.objects.length === 2");
            } else if let Some(add) = add {
                browser.key("Delete", 0);
                browser.wait("viewer.page.view.objects.length === 0");
                press(&mut browser, add);
                browser.wait("viewer.page.view.objects.length === 1");
            }
            browser.wait("viewer.page.selected() && viewer.figures.shown.change === viewer.page.change");
            let (rate, median_ms, ninth_ms) = drag_for(&mut browser, 8.0);
            println!(
                "{what}, {name}: {rate:.1} images/s, {median_ms:.0} ms median from pointer to image, {ninth_ms:.0} ms 90th percentile; server {:.0} MB",
                viewer.memory_mb()
            );
            shot(&mut browser, &format!("figures_{}.png", name.replace(' ', "_")));
            browser.wait(FINAL);
            shot(&mut browser, &format!("figures_{}_final.png", name.replace(' ', "_")));
        }
        for (name, id) in
            [("contrast", "contrast"), ("warmth", "warmth"), ("brightness of a lamp", "light-L1-Brightness")]
        {
            if browser.value(&format!("document.getElementById('{id}') === null")) == true {
                continue;
            }
            let (rate, median_ms, ninth_ms) = slide_for(&mut browser, id, 8.0);
            println!("{what}, {name}: {rate:.1} images/s, {median_ms:.0} ms median, {ninth_ms:.0} ms 90th percentile");
            browser.wait(FINAL);
            shot(&mut browser, &format!("figures_{id}.png"));
        }
        let (rate, median_ms, still_ms) = turn_for(&mut browser, 8.0);
        println!(
            "{what}, from outside: {rate:.1} images/s, {median_ms:.0} ms median rendering time; {still_ms:.0} ms at rest"
        );
        shot(&mut browser, "figures_outside.png");
        press(&mut browser, "Photo");
    }
}

#[test]
fn the_page_works_behind_a_tls_proxy() {
    let untested = "the viewer behind a TLS proxy";
    let Some(mut browser) = Browser::start(untested) else { return };
    let Some(proxy) = TlsProxy::start(untested) else { return };
    let folder = room_with_scene();
    let port = proxy.viewer_port.to_string();
    let args = ["room.scene", "--port", &port, "--public-origin", &proxy.origin];
    let viewer = Viewer::start(folder.path(), &args);
    assert!(viewer.address.starts_with(&proxy.origin), "{}", viewer.address);
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.body.dataset.at === 'scene'");
    press(&mut browser, "Chrome sphere");
    browser.wait("viewer.page.view.objects.length === 1");
    browser.wait(FINAL);
    assert_eq!(browser.value("location.protocol"), "https:");
}

#[test]
fn the_command_is_copied_over_plain_http() {
    let Some(mut browser) = Browser::start("copying over http") else { return };
    let folder = room_with_scene();
    let port = free_port().to_string();
    let origin = format!("http://studio.example:{port}");
    let args = ["room.scene", "--port", &port, "--public-origin", &origin];
    let viewer = Viewer::start_with(folder.path(), &args, |command| command);
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.body.dataset.at === 'scene'");
    // Without the clipboard's interface, as in pages of other machines.
    assert_eq!(browser.value("[isSecureContext, Boolean(navigator.clipboard)]"), serde_json::json!([false, false]));
    press(&mut browser, "Chrome sphere");
    browser.wait("!document.getElementById('copy').hidden");
    browser.value("document.addEventListener('copy', () => { globalThis.copied = getSelection().toString(); })");
    let at = browser.value(
        "(() => { const box = document.getElementById('copy').getBoundingClientRect();
           return [box.left + box.width / 2, box.top + box.height / 2]; })()",
    );
    let at = [at[0].as_f64().unwrap(), at[1].as_f64().unwrap()];
    for kind in ["mouseMoved", "mousePressed", "mouseReleased"] {
        browser.mouse(kind, at);
    }
    browser.wait("globalThis.copied === viewer.page.view.command");
    browser.wait("document.getElementById('messages').textContent.includes('copied')");
}

#[test]
fn a_page_too_many_says_so_and_opens_later() {
    let Some(mut browser) = Browser::start("too many pages") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    let mut pages: Vec<Page> = (0..16).map(|_| viewer.page()).collect();
    pages.iter_mut().for_each(|page| drop(page.receive("the scene", |message| message["type"] == "scene")));
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.getElementById('status').textContent.startsWith('too many pages are open')");
    pages.pop();
    browser.wait("document.body.dataset.at === 'scene'");
}
