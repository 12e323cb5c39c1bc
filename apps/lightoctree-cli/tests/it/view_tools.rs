//! Lights, scale and groups of objects in the viewer, in a real browser without WebGL.

use serde_json::Value;

use crate::cli::room_with_scene;
use crate::support::browser::Browser;
use crate::support::done;
use crate::support::view::Viewer;
use crate::view_in_browser::{FINAL, STILL, click, middle, object, on_page, press, shot};

/// Windows in which the page must fit.
const WINDOWS: [[u32; 2]; 3] = [[1280, 720], [1920, 1080], [3840, 2160]];

fn open(browser: &mut Browser, viewer: &Viewer) {
    browser.open(&viewer.address, [1280, 720]);
    browser.wait("document.body.dataset.at === 'scene'");
    browser.wait(FINAL);
}

fn pair(value: &Value) -> [f64; 2] {
    [0, 1].map(|i| value[i].as_f64().unwrap())
}

/// Evaluates an expression for a photo position, and returns its place on the page.
fn place_of(browser: &mut Browser, expression: &str) -> [f64; 2] {
    let pixel = browser.value(expression);
    on_page(browser, pair(&pixel))
}

/// Takes screenshots in all windows, and checks that nothing overflows.
fn shots(browser: &mut Browser, name: &str) {
    for [width, height] in WINDOWS {
        browser.resize([width, height]);
        browser.wait(&format!("innerWidth === {width}"));
        browser.value("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => done(true))))");
        shot(browser, &format!("{name}_{width}.png"));
        let is_wide = browser.value(
            "document.documentElement.scrollWidth > innerWidth || document.documentElement.scrollHeight > innerHeight",
        );
        assert_eq!(is_wide, false, "{width}");
    }
    browser.resize([1280, 720]);
    browser.wait("innerWidth === 1280");
}

#[test]
fn a_person_drags_lamps_and_aims_the_sun() {
    let Some(mut browser) = Browser::start("the lights in the viewer") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    open(&mut browser, &viewer);
    press(&mut browser, "Matte sphere");
    browser.wait("viewer.page.selectedId === 1");
    press(&mut browser, "Add sun");
    // The object stays selected, because its shadow aims the sun.
    browser.wait("viewer.page.view.objects[0].shadows.length === 1 && viewer.page.selectedId === 1");
    let sun = "JSON.stringify(viewer.page.view.lights.at(-1).sun_deg)";
    let before = browser.value(sun);
    let tip = "viewer.page.photoLights().shadows[0].tip";
    let from = place_of(&mut browser, tip);
    let to = place_of(&mut browser, "[110, 88]");
    browser.drag(from, to, 0);
    browser.wait(&format!("{sun} !== '{}'", before.as_str().unwrap()));
    browser.wait(&format!("{tip}.every((along, i) => Math.abs(along - [110, 88][i]) < 4)"));
    browser.wait(FINAL);
    shots(&mut browser, "sun_shadow");
    browser.key("z", 2);
    browser.wait(&format!("{sun} === '{}'", before.as_str().unwrap()));

    // A lamp: across the view, along surfaces, along an arrow.
    press(&mut browser, "Add lamp");
    browser.wait("viewer.page.selectedLight === 'A2' && viewer.page.selectedId === null");
    browser.wait("document.querySelector('.light.selected .name').textContent.startsWith('A2')");
    let place = "JSON.stringify(viewer.page.view.lights.at(-1).changed.at_m ?? null)";
    let mark = "viewer.page.photoLights().marks.find(({ light }) => light.id === 'A2').at";
    let from = place_of(&mut browser, mark);
    browser.mouse("mouseMoved", from);
    browser.wait("document.getElementById('stage-hint').textContent.startsWith('A2: drag')");
    browser.drag(from, [from[0] - 60.0, from[1] + 30.0], 0);
    browser.wait(&format!("{place} !== 'null'"));
    let moved: Vec<f64> = serde_json::from_str(browser.value(place).as_str().unwrap()).unwrap();
    assert!((moved[2] + 1.5).abs() < 1e-3 && moved[0] < -0.01, "{moved:?}");
    let from = place_of(&mut browser, mark);
    let floor = place_of(&mut browser, "[72, 92]");
    browser.drag(from, floor, 8);
    browser.wait(&format!("JSON.parse({place})[1] < -0.5"));
    browser.key("z", 2);
    browser.wait(&format!("JSON.parse({place})[1] > -0.5"));
    let arrow =
        "(() => { const { from, to } = viewer.page.photoLights().selected.arrows.find(({ name }) => name === 'up');
       return [0.5 * (from[0] + to[0]), 0.5 * (from[1] + to[1])]; })()";
    let from = place_of(&mut browser, arrow);
    browser.drag(from, [from[0], from[1] - 40.0], 0);
    browser.wait(&format!("JSON.parse({place})[1] > {}", moved[1] + 0.01));
    browser.wait(FINAL);
    shots(&mut browser, "lamp");

    // In the room: at its height, with Shift up and down; the sun around the room.
    click(&mut browser, "#view-room");
    browser.wait(STILL);
    shots(&mut browser, "room_lights");
    browser.wait(STILL);
    browser.value(
        "Promise.all(['camera', 'orbit', 'outside_lights'].map((name) => import(`./page/${name}.js`)))
           .then(([{ project }, { cameraOf, inFrame }, { shownAt }]) => {
             globalThis.lightOnPage = (id) => {
               const { view } = viewer.outside.shown; const { up, extent } = viewer.page.scene;
               const camera = cameraOf(view, up);
               const light = viewer.page.view.lights.find((other) => other.id === id);
               const [u, v] = project(camera, inFrame(camera, shownAt(light, extent)));
               const box = document.getElementById('outside').getBoundingClientRect();
               return [box.left + (u * box.width) / view.width, box.top + (v * box.height) / view.height];
             };
           })",
    );
    let orbit = browser.value("JSON.stringify(viewer.outside.orbit())");
    let at =
        |browser: &mut Browser| -> Vec<f64> { serde_json::from_str(browser.value(place).as_str().unwrap()).unwrap() };
    let before = at(&mut browser);
    let from = pair(&browser.value("lightOnPage('A2')"));
    browser.drag(from, [from[0] + 50.0, from[1] + 10.0], 0);
    browser.wait(&format!("{place} !== '{}'", serde_json::to_string(&before).unwrap()));
    browser.wait(STILL);
    let level = at(&mut browser);
    assert!(
        (level[1] - before[1]).abs() < 2e-3 && (level[0] - before[0]).hypot(level[2] - before[2]) > 0.05,
        "{level:?}"
    );
    let from = pair(&browser.value("lightOnPage('A2')"));
    browser.drag(from, [from[0], from[1] + 30.0], 8);
    browser.wait(&format!("JSON.parse({place})[1] < {}", level[1] - 0.02));
    browser.wait(STILL);
    let lower = at(&mut browser);
    assert!((lower[0] - level[0]).hypot(lower[2] - level[2]) < 2e-3, "{lower:?}");
    let sun = "JSON.stringify(viewer.page.view.lights.find(({ id }) => id === 'A1').sun_deg)";
    let before = browser.value(sun);
    let from = pair(&browser.value("lightOnPage('A1')"));
    browser.drag(from, [from[0] + 40.0, from[1] + 15.0], 0);
    browser.wait(&format!("{sun} !== '{}'", before.as_str().unwrap()));
    assert_eq!(browser.value("JSON.stringify(viewer.outside.orbit())"), orbit, "the view stays");
    browser.key("Delete", 0);
    browser.wait("!viewer.page.view.lights.some(({ id }) => id === 'A1') && viewer.page.selectedLight === null");
    assert_eq!(browser.faults, Vec::<String>::new());
}

#[test]
fn a_person_gives_a_known_length() {
    let Some(mut browser) = Browser::start("the scale of the room") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    open(&mut browser, &viewer);
    press(&mut browser, "Gold sphere");
    browser.wait("viewer.page.selectedId === 1");
    let before = object(&mut browser, 0);
    // Esc cancels; a second try measures.
    click(&mut browser, "#measure");
    browser.key("Escape", 0);
    assert_eq!(browser.value("document.getElementById('pick-hint').hidden"), true);
    click(&mut browser, "#measure");
    for pixel in ["[30, 88]", "[110, 92]"] {
        let place = place_of(&mut browser, pixel);
        for kind in ["mouseMoved", "mousePressed", "mouseReleased"] {
            browser.mouse(kind, place);
        }
    }
    browser.wait("document.activeElement?.id === 'known-length' && Number(document.activeElement.value) > 0");
    shots(&mut browser, "known_length");
    let estimated = browser.value("Number(document.getElementById('known-length').value)").as_f64().unwrap();
    browser.value(&format!(
        "(() => {{ document.getElementById('known-length').value = '{}'; document.getElementById('scale-room').click(); }})()",
        (estimated * 1.5).round()
    ));
    browser.wait(
        "viewer.page.view.known_length && document.getElementById('scale-note').textContent.includes('as large')",
    );
    browser.wait(FINAL);
    let factor = browser.value("viewer.page.view.room_scale").as_f64().unwrap();
    let after = object(&mut browser, 0);
    let depth = |object: &Value| object["position_m"][2].as_f64().unwrap();
    assert!((depth(&after) / depth(&before) / factor - 1.0).abs() < 0.02, "{factor} {before} {after}");
    assert_eq!(after["size_m"], before["size_m"]);
    // The copied command renders the same image from the file.
    let command = browser.value("viewer.page.view.command").as_str().unwrap().replace('\'', "");
    assert!(command.contains(" --known-length "), "{command}");
    done(folder.path(), &command.split(' ').skip(1).collect::<Vec<_>>());
    let (_, shown) = viewer.get("download/picture.png");
    assert!(shown == std::fs::read(folder.path().join("picture.png")).unwrap(), "{command}");
    // A saved scene has the scale; `estimate` and `lights` see it as any other.
    let (_, scene) = viewer.get("download/room.scene");
    std::fs::write(folder.path().join("scaled.scene"), scene).unwrap();
    done(folder.path(), &["insert", "scaled.scene", "--quality", "high", "-o", "again.png"]);
    assert!(shown == std::fs::read(folder.path().join("again.png")).unwrap());
    browser.key("z", 2);
    browser.wait("viewer.page.view.known_length === null && viewer.page.view.room_scale === 1");
    assert_eq!(object(&mut browser, 0)["position_m"], before["position_m"]);
    browser.wait(FINAL);
    assert_eq!(browser.faults, Vec::<String>::new());
}

#[test]
fn a_person_moves_several_objects_together() {
    let Some(mut browser) = Browser::start("several selected objects") else { return };
    let folder = room_with_scene();
    let viewer = Viewer::start(folder.path(), &["room.scene"]);
    open(&mut browser, &viewer);
    press(&mut browser, "Matte sphere");
    browser.wait("viewer.page.view.objects.length === 1");
    press(&mut browser, "Gold sphere");
    browser.wait("viewer.page.view.objects.length === 2 && viewer.page.selectedId === 2");
    browser.wait(FINAL);
    let first = middle(&mut browser);
    let first = on_page(&mut browser, first);
    browser.drag(first, first, 8);
    browser.wait("viewer.page.group().length === 2");
    browser.wait("!document.getElementById('properties-group').hidden");
    shots(&mut browser, "group");
    let places = "JSON.stringify(viewer.page.view.objects.map(({ place }) => place))";
    let before = browser.value(places);
    browser.drag(first, [first[0] + 25.0, first[1]], 0);
    browser.wait(&format!(
        "JSON.parse({places}).every((place, i) => JSON.stringify(place) !== JSON.stringify(JSON.parse('{}')[i]))",
        before.as_str().unwrap()
    ));
    browser.key("d", 2);
    browser.wait("viewer.page.view.objects.length === 4 && viewer.page.group().length === 2");
    browser.key("Delete", 0);
    browser.wait("viewer.page.view.objects.length === 2");
    for _ in 0..3 {
        browser.key("z", 2);
    }
    browser.wait(&format!("{places} === '{}'", before.as_str().unwrap()));
    // Hidden and locked objects stay so in the scene.
    browser.value("viewer.page.select(1)");
    browser.key("h", 0);
    browser.key("l", 0);
    browser.wait("viewer.page.view.objects[0].is_hidden && viewer.page.view.objects[0].is_locked");
    browser.wait(FINAL);
    let (_, shown) = viewer.get("download/picture.png");
    let (_, scene) = viewer.get("download/room.scene");
    std::fs::write(folder.path().join("kept.scene"), scene).unwrap();
    done(folder.path(), &["insert", "kept.scene", "--quality", "high", "-o", "kept.png"]);
    assert!(shown == std::fs::read(folder.path().join("kept.png")).unwrap());
    let again = Viewer::start(folder.path(), &["kept.scene"]);
    let (state, _) = again.page().receive("the objects", |message| message["type"] == "state");
    let object = &state["view"]["objects"][0];
    assert_eq!((&object["is_hidden"], &object["is_locked"]), (&Value::Bool(true), &Value::Bool(true)));
    assert_eq!(browser.faults, Vec::<String>::new());
}
