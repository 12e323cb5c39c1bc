//! Scene files: whatever the bytes, an error or a scene that can be traced.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree::cone::Viewers;
use lightoctree::geometry::Vec3;
use lightoctree::scene::Scene;

fuzz_target!(|bytes: &[u8]| {
    let Ok(scene) = Scene::from_bytes(bytes) else { return };
    let again =
        Scene::from_bytes(&scene.to_bytes("fuzz").expect("a valid scene can be written")).expect("and read back");
    assert_eq!(scene, again);
    let viewers = Viewers::new(&scene.light);
    let panorama = viewers.at(Vec3::ZERO).panorama(Vec3::ZERO, 8, 4);
    assert!(panorama.radiance.pixels().iter().flatten().all(|value| value.is_finite()));
});
