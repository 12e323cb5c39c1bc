//! Scene files: whatever the bytes, an error or a scene that can be traced.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree::cone::{ConeTracer, Settings};
use lightoctree::geometry::Vec3;
use lightoctree::scene::Scene;

fuzz_target!(|bytes: &[u8]| {
    let Ok(scene) = Scene::from_bytes(bytes) else { return };
    let again = Scene::from_bytes(&scene.to_bytes().expect("a valid scene can be written")).expect("and read back");
    assert_eq!(scene, again);
    let tracer = ConeTracer::new(&scene.light, Settings::default()).expect("the default settings are valid");
    let panorama = tracer.panorama(Vec3::ZERO, 8, 4);
    assert!(panorama.radiance.pixels().iter().flatten().all(|value| value.is_finite()));
});
