//! The page of `export --to web`, opened as a file in a real browser with WebGL.

use std::path::Path;

use base64::Engine;
use lo_imaging as imaging;
use lo_imaging::RadianceImage;

use crate::cli::room_with_scene;
use crate::support::browser::Browser;
use crate::support::{done, json, refused};

/// Opens the page of a folder with a state, and returns what its canvas shows in linear light.
fn shown(browser: &mut Browser, page: &Path, state: &str, window: [u32; 2]) -> RadianceImage {
    browser.call("Page.navigate", serde_json::json!({ "url": "about:blank" }));
    browser.open(&format!("file://{}/index.html#{state}", page.display()), window);
    browser.wait("page.isReady");
    canvas(browser, page)
}

/// Returns what the canvas shows, in linear light.
fn canvas(browser: &mut Browser, page: &Path) -> RadianceImage {
    let url = browser.value("document.getElementById('view').toDataURL()");
    let (_, base64) = url.as_str().unwrap().split_once(',').unwrap();
    let file = page.join("canvas.png");
    std::fs::write(&file, base64::engine::general_purpose::STANDARD.decode(base64).unwrap()).unwrap();
    imaging::read_photo(&file).unwrap().photo.radiance()
}

/// Returns the mean over a disc.
fn mean(image: &RadianceImage, centre: [f32; 2], radius: f32) -> [f32; 3] {
    let inside = |x: usize, y: usize| (x as f32 + 0.5 - centre[0]).hypot(y as f32 + 0.5 - centre[1]) < radius;
    let pixels: Vec<[f32; 3]> = (0..image.height())
        .flat_map(|y| (0..image.width()).map(move |x| (x, y)))
        .filter(|&(x, y)| inside(x, y))
        .map(|at| image[at])
        .collect();
    assert!(pixels.len() > 20, "{} pixels", pixels.len());
    std::array::from_fn(|c| pixels.iter().map(|rgb| rgb[c]).sum::<f32>() / pixels.len() as f32)
}

#[test]
fn the_page_shows_the_object_as_insert_does() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let [photo, depth] = ["library_color.jpg", "library_lidar_depth.png"].map(lo_testdata::asset);
    let [photo, depth] = [&photo, &depth].map(|path| path.to_str().unwrap());
    let estimate = ["estimate", photo, "--depth", depth, "--intrinsics", "1330,1330,960,720", "--completion", "shell"];
    done(at, &[&estimate[..], &["-o", "room.scene"]].concat());
    let report = json(&done(at, &["export", "room.scene", "--to", "web", "-o", "page", "--json"]));
    assert_eq!(report["files"].as_array().unwrap().len(), 4);
    assert!(report["bytes"].as_u64().unwrap() < 13_000_000, "{report}");
    // Its own page is replaced.
    done(at, &["export", "room.scene", "--to", "web", "-o", "page"]);
    let Some(mut browser) = Browser::start_with_webgl("the exported page") else { return };
    let page = at.join("page");
    // The footer needs the rest of the window.
    let of_page = shown(&mut browser, &page, "object=matte&x=800&y=1150&height=0.4", [960, 820]);
    let scale = of_page.width() as f32 / 1920.0;
    assert!(scale > 0.4 && (of_page.height() as f32 - 1440.0 * scale).abs() <= 1.0, "{scale}");
    let insert = ["insert", "room.scene", "--mesh", "builtin:sphere", "--height", "0.4", "--pixel", "800,1150"];
    let insert = [&insert[..], &["--match-look", "off", "--json", "-o", "insert.png"]].concat();
    let told = json(&done(at, &insert));
    // Where the ball is: its middle is 20 cm above its foot.
    let estimate = lightoctree::Document::read(at.join("room.scene")).unwrap().estimate;
    let foot: [f32; 3] = serde_json::from_value(told["objects"][0]["positions_m"][0].clone()).unwrap();
    let centre = lo_geometry::Vec3::from(foot) + 0.2 * estimate.up();
    let (x, y, _) = estimate.frame.camera.project(centre).unwrap();
    let radius = estimate.frame.camera.fx as f32 * 0.2 / -centre.z;
    // The same light: the panorama there. Without it, `insert` gathers diffuse light by wide cones.
    let place = format!("--at={},{},{}", centre.x, centre.y, centre.z);
    done(at, &["envmap", "room.scene", &place, "--light", "plausible", "-o", "light.exr"]);
    done(at, &[&insert[..], &["--force", "--lighting", "envmap:light.exr", "--lighting-level", "file"]].concat());
    let of_insert = imaging::read_photo(at.join("insert.png")).unwrap().photo.radiance();
    let disc = |image: &RadianceImage, scale: f32, share: f32| {
        mean(image, [x as f32 * scale, y as f32 * scale], share * radius * scale)
    };
    let (ours, theirs) = (disc(&of_page, scale, 0.8), disc(&of_insert, 1.0, 0.8));
    for channel in 0..3 {
        assert!((ours[channel] / theirs[channel] - 1.0).abs() < 0.05, "{ours:?} {theirs:?}");
    }
    // Far from the object it is the photo.
    let photo = imaging::read_photo(photo).unwrap().photo.radiance();
    for place in [[300.0, 300.0], [1600.0, 300.0], [1500.0, 1300.0]] {
        let ours = mean(&of_page, place.map(|v| v * scale), 50.0 * scale);
        let theirs = mean(&photo, place, 50.0);
        assert!((0..3).all(|c| (ours[c] / theirs[c] - 1.0).abs() < 0.03), "{place:?}: {ours:?} {theirs:?}");
    }
    // Under the ball it is darker, as in the other picture.
    let under = [x as f32, y as f32 + 1.05 * radius];
    let [ours, theirs, bare] = [
        mean(&of_page, under.map(|v| v * scale), 10.0 * scale),
        mean(&of_insert, under, 10.0),
        mean(&photo, under, 10.0),
    ];
    assert!(ours[1] < 0.85 * bare[1] && theirs[1] < 0.85 * bare[1], "{ours:?} {theirs:?} {bare:?}");

    // A plain address, and nonsense, find a place by themselves.
    for state in ["", "x=NaN&y=3&height=-1&turn=1e400&object=glass", "x=99999&y=-4&height=1e9&turn=725"] {
        shown(&mut browser, &page, state, [960, 820]);
        let found = browser.value("[page.state.x, page.state.y, page.state.height, page.state.turn]");
        let numbers = found.as_array().unwrap().iter().map(|value| value.as_f64().unwrap_or(f64::NAN));
        let [x, y, height, turn]: [f64; 4] = numbers.collect::<Vec<_>>().try_into().unwrap();
        assert!((0.0..1920.0).contains(&x) && (0.0..1440.0).contains(&y), "{state}: {found}");
        assert!((0.02..=3.0).contains(&height) && (-180.0..180.0).contains(&turn), "{state}: {found}");
        browser.wait("document.getElementById('status').textContent === ''");
    }
    browser.value("location.hash = '#object=matte&x=800&y=1150&height=0.4'");
    browser.wait("page.state.x === 800 && page.state.height === 0.4 && page.state.turn === 0");

    // It is dragged, changes to chrome, and gives way to a model.
    let point = browser.value(
        "(() => { const box = document.getElementById('view').getBoundingClientRect();
           return [box.left, box.top, box.width / 1920]; })()",
    );
    let [left, top, per_pixel] = [0, 1, 2].map(|i| point[i].as_f64().unwrap());
    let on_page = |x: f64, y: f64| [left + x * per_pixel, top + y * per_pixel];
    browser.mouse("mousePressed", on_page(x, y));
    browser.mouse("mouseMoved", on_page(x + 100.0, y));
    browser.mouse("mouseReleased", on_page(x + 100.0, y));
    browser.wait("Math.abs(page.state.x - 900) < 2 && Math.abs(page.state.y - 1150) < 2");
    browser.value("document.getElementById('chrome').click()");
    browser.wait("location.hash.includes('object=chrome')");
    let chrome = canvas(&mut browser, &page);
    let place = [(x as f32 + 100.0) * scale, y as f32 * scale];
    assert_ne!(mean(&chrome, place, 0.5 * radius * scale), mean(&of_page, place, 0.5 * radius * scale));
    let suzanne = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../crates/lightoctree/models/suzanne.glb");
    browser.drop_file("broken.glb", b"no model");
    browser.wait("document.getElementById('status').textContent === 'broken.glb: this is no glTF binary (.glb)'");
    browser.drop_file("suzanne.glb", &std::fs::read(suzanne).unwrap());
    browser.wait("page.state.object === 'suzanne.glb'");
    assert!(browser.faults.is_empty(), "{:?}", browser.faults);
}

#[test]
fn a_folder_with_other_files_is_not_touched() {
    let folder = room_with_scene();
    let at = folder.path();
    std::fs::create_dir(at.join("site")).unwrap();
    std::fs::write(at.join("site/index.html"), "<p>mine</p>").unwrap();
    let message = refused(at, 2, &["export", "room.scene", "--to", "web", "-o", "site"]);
    assert!(message.contains("was not written by `lightoctree export`"), "{message}");
    let message = refused(at, 2, &["export", "room.scene", "--to", "web", "--level", "-o", "new"]);
    assert!(message.contains("--level has no effect with --to web") && !at.join("new").exists(), "{message}");
}
