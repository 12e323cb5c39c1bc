//! `lightoctree view` in a real browser, without WebGL. `LIGHTOCTREE_SHOTS=FOLDER` keeps pictures of the page.

use std::path::PathBuf;

use serde_json::Value;

use crate::cli::room_with_scene;
use crate::support::browser::Browser;
use crate::support::done;
use crate::support::view::Viewer;

/// Where on the page a photo position is seen.
fn on_page(browser: &mut Browser, [u, v]: [f64; 2]) -> [f64; 2] {
    let place = browser.value(&format!(
        "(() => {{ const box = document.getElementById('handles').getBoundingClientRect(); const camera = viewer.page.scene.camera;
           return [box.left + {u} * box.width / camera.width, box.top + {v} * box.height / camera.height]; }})()"
    ));
    [place[0].as_f64().unwrap(), place[1].as_f64().unwrap()]
}

fn click(browser: &mut Browser, selector: &str) {
    browser.value(&format!("document.querySelector(`{selector}`).click()"));
}

/// Clicks the button with this text.
fn press(browser: &mut Browser, text: &str) {
    browser.value(&format!("[...document.querySelectorAll('button')].find((b) => b.textContent === '{text}').click()"));
}

fn shot(browser: &mut Browser, name: &str) {
    if let Some(folder) = std::env::var_os("LIGHTOCTREE_SHOTS") {
        browser.screenshot(&PathBuf::from(folder).join(name));
    }
}

fn object(browser: &mut Browser, index: usize) -> Value {
    browser.value(&format!("viewer.page.view.objects[{index}]"))
}

const FINAL: &str = "viewer.figures.shown?.step === 'final' && viewer.figures.shown.change === viewer.page.change";

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

    // Add, drag, undo, redo.
    press(&mut browser, "Chrome sphere");
    browser.wait("viewer.page.view.objects.length === 1 && viewer.page.selectedId === 1");
    browser.wait(FINAL);
    shot(&mut browser, "sphere.png");
    let before = object(&mut browser, 0);
    let seen = browser.value(
        "import('./page/camera.js').then(({ project }) => { const o = viewer.page.view.objects[0];
           return project(viewer.page.scene.camera, [o.position_m[0], o.position_m[1] + o.size_m[1] / 2, o.position_m[2]]); })",
    );
    let from = [seen[0].as_f64().unwrap(), seen[1].as_f64().unwrap()];
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
    // Every movement has arrived once it rests.
    browser.wait(FINAL);
    let moved = object(&mut browser, 0);
    assert_ne!(before["place"], moved["place"]);
    browser.key("z", 2);
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) === '{}'", before["place"]));
    browser.key("z", 2 | 8);
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) === '{}'", moved["place"]));

    // Esc drops a movement.
    let seen = [from[0] + 20.0, from[1]];
    let place = on_page(&mut browser, seen);
    browser.mouse("mouseMoved", place);
    browser.mouse("mousePressed", place);
    let away = on_page(&mut browser, [seen[0] - 30.0, seen[1]]);
    browser.mouse("mouseMoved", away);
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) !== '{}'", moved["place"]));
    browser.key("Escape", 0);
    browser.wait(&format!("JSON.stringify(viewer.page.view.objects[0].place) === '{}'", moved["place"]));
    browser.mouse("mouseReleased", away);

    // Keys and fields.
    browser.key("]", 0);
    browser.wait("viewer.page.view.objects[0].yaw_deg === -5");
    browser.key("PageUp", 0);
    browser.wait("viewer.page.view.objects[0].place.position");
    browser.key("g", 0);
    browser.wait("viewer.page.view.objects[0].place.pixel");
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

    // Meshes: a good one, and a broken one that says so.
    let suzanne = std::fs::read(lo_testdata::asset("suzanne.glb")).unwrap();
    browser.drop_file("suzanne.glb", &suzanne);
    browser.wait("viewer.page.view.objects.length === 2 && viewer.page.selectedId === 2");
    browser.drop_file("broken.glb", &suzanne[..suzanne.len() / 2]);
    browser.wait("document.getElementById('messages').textContent.includes('broken.glb')");
    browser.key("d", 2);
    browser.wait("viewer.page.view.objects.length === 3");
    browser.key("Delete", 0);
    browser.wait("viewer.page.view.objects.length === 2");

    // Exposure and false colour are the page's alone.
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
        browser.value("(() => { const field = document.getElementById('overlay'); field.value = ''; field.onchange({ target: field }); })()");
    }
    press(&mut browser, "Add sun");
    browser.wait("viewer.page.view.lights.some((light) => light.id === 'A1')");
    browser.key("?", 0);
    browser.wait("document.getElementById('help').open");
    shot(&mut browser, "help.png");
    click(&mut browser, "#help button");

    // After a reload all is as it was.
    browser.call("Page.reload", serde_json::json!({}));
    browser.wait("globalThis.viewer?.page.view?.objects.length === 2");
    browser.wait(FINAL);
    browser.resize([3840, 2160]);
    browser.wait("document.getElementById('picture').width > 1500");
    shot(&mut browser, "large.png");
    let faults = std::mem::take(&mut browser.faults);
    // The broken mesh's answer is an error of the network's to the browser.
    let faults: Vec<_> = faults.into_iter().filter(|fault| !fault.contains("/upload/mesh")).collect();
    assert_eq!(faults, Vec::<String>::new());
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
    // The playhead goes to another time, the object to another place: a keyframe there.
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
    // A keyframe is dragged to another time, and back by undo.
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
    // It plays: times pass, and pictures of them come.
    browser.value("document.getElementById('stage').focus()");
    browser.key(" ", 0);
    browser.wait("document.getElementById('play').textContent === 'Stop'");
    let before = browser.value("viewer.page.view.timeline.time_s");
    browser.wait(&format!("Math.abs(viewer.page.view.timeline.time_s - {before}) > 0.3"));
    browser.key(" ", 0);
    browser.wait("document.getElementById('play').textContent === 'Play'");
    assert_eq!(browser.value("viewer.page.view.can_redo"), true, "looking at another time changes nothing");
    // Click and Delete, and back.
    click(&mut browser, "#timeline .key:nth-child(2)");
    browser.value("document.querySelectorAll('#timeline .key')[1].focus()");
    browser.key("Delete", 0);
    browser.wait("viewer.page.view.objects[0].path.keyframes.length === 1");
    browser.key("z", 2);
    browser.wait("viewer.page.view.objects[0].path.keyframes.length === 2");
    // A short video is the command line's.
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
    browser.wait("document.getElementById('film').hidden");
    // All that is seen of it can be read and reached, in a small window and in a large one.
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
    press(&mut browser, "Gold sphere");
    press(&mut browser, "Add lamp");
    browser.wait("viewer.page.view.lights.some((light) => light.id === 'A1') && viewer.page.selectedId");
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
    // All that can be done with the pointer is within reach of Tab.
    let unreachable =
        browser.value("[...document.querySelectorAll('button, input, select')].filter((c) => c.tabIndex < 0).length");
    assert_eq!(unreachable, 0);
    // Nothing hangs out of the window.
    let wide = browser.value(
        "document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight",
    );
    assert_eq!(wide, false);
}

/// Pictures a second and latency while an object is dragged, in the browser.
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
    let numbers = |browser: &mut Browser, list: &str| -> Vec<f64> {
        let list = browser.value(&format!("viewer.figures.{list}"));
        list.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect()
    };
    let at = numbers(browser, "frames_at_ms");
    let mut latencies = numbers(browser, "latencies_ms");
    browser.mouse("mouseReleased", place);
    latencies.sort_by(f64::total_cmp);
    let rate = 1e3 * (at.len() - 1) as f64 / (at[at.len() - 1] - at[0]);
    (rate, latencies[latencies.len() / 2], latencies[latencies.len() * 9 / 10])
}

#[test]
#[ignore = "figures, on a machine that does nothing else: cargo test --release -p lightoctree-cli --test it view_figures -- --ignored --nocapture"]
fn view_figures() {
    let Some(mut browser) = Browser::start("the viewer's figures") else { return };
    let folder = tempfile::tempdir().unwrap();
    let photo = lightoctree::imaging::read_photo(lo_testdata::asset("library_color.jpg")).unwrap().photo.radiance();
    let photo = lightoctree::imaging::resize(&photo, 960, 720);
    let photo = lightoctree::imaging::Photo::Srgb8(photo.map(|rgb| rgb.map(lightoctree::imaging::srgb8_from_linear)));
    lightoctree::imaging::write_photo(folder.path().join("photo.jpg"), &photo, "test").unwrap();
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
            "{what}: first picture with an object after {first_s:.2} s, the final one after {:.2} s",
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
                "{what}, {name}: {rate:.1} pictures/s, {median_ms:.0} ms median from pointer to picture, {ninth_ms:.0} ms in nine of ten; server {:.0} MB",
                viewer.memory_mb()
            );
            shot(&mut browser, &format!("figures_{}.png", name.replace(' ', "_")));
            browser.wait(FINAL);
            shot(&mut browser, &format!("figures_{}_final.png", name.replace(' ', "_")));
        }
    }
}
