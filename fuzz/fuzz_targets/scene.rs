//! Scene files: the bytes give an error or a scene that can be traced, with its light edits applied.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree::cone::Viewers;
use lightoctree::geometry::Vec3;
use lightoctree::imaging::RadianceImage;
use lightoctree::lo_lights::AnalyticLights;
use lightoctree::scene::Scene;

fuzz_target!(|bytes: &[u8]| {
    let Ok(scene) = Scene::from_bytes(bytes) else { return };
    let again =
        Scene::from_bytes(&scene.to_bytes("fuzz").expect("a valid scene can be written")).expect("and read back");
    assert_eq!(scene, again);
    // Its objects are a valid layout with meshes, or give an error.
    if let Ok(Some(layout)) = lightoctree::scene_layout(&scene) {
        let _ = lightoctree::Models::of_scene(&layout, &scene);
    }
    let finite = |radiance: &RadianceImage| radiance.pixels().iter().flatten().all(|value| value.is_finite());
    let viewers = Viewers::new(&scene.light);
    assert!(finite(&viewers.at(Vec3::ZERO).panorama(Vec3::ZERO, 8, 4).radiance));
    // Edits are applied or give an error.
    let mut edited = scene;
    let lit = !edited.light_edits.is_empty() || edited.expected.is_some();
    let tuning = lightoctree::LightTuning::default();
    if lit && lightoctree::light_up(&mut edited, lightoctree::LightMode::Expected, &tuning).is_ok() {
        assert!(edited.light.rgba.iter().flatten().flatten().all(|value| value.is_finite() && *value >= 0.0));
        if let Some(lights) = AnalyticLights::of(&edited) {
            let mut panorama = viewers.at(Vec3::ZERO).panorama(Vec3::ZERO, 8, 4);
            lights.add_to_panorama(Vec3::ZERO, &mut panorama);
            assert!(finite(&panorama.radiance));
        }
    }
});
