//! Scene files: whatever the bytes, an error or a scene that can be traced, with its lights as they were edited.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree::{Document, LightPurpose};
use lo_cone::OctreeRenderer;
use lo_geometry::Vec3;
use lo_imaging::RadianceImage;
use lo_lights::AnalyticLights;

fuzz_target!(|bytes: &[u8]| {
    let Ok(document) = Document::from_bytes(bytes) else { return };
    let written = document.to_bytes("fuzz").expect("a valid document can be written");
    assert_eq!(document, Document::from_bytes(&written).expect("and read back"));
    // Its meshes can be read, or the error says what is wrong.
    if let Some(layout) = &document.layout {
        let _ = document.models(layout);
    }
    let finite = |radiance: &RadianceImage| radiance.pixels().iter().flatten().all(|value| value.is_finite());
    let viewers = OctreeRenderer::new(&document.estimate.light);
    assert!(finite(&viewers.at(Vec3::ZERO).panorama(Vec3::ZERO, 8, 4).radiance));
    // Edits are applied, or the error says why not.
    let is_changed = !document.light_edits.is_empty() || document.estimate.expected.is_some();
    if is_changed && let Ok(edited) = document.lit(LightPurpose::Panorama) {
        assert!(edited.light.rgba.iter().flatten().flatten().all(|value| value.is_finite() && *value >= 0.0));
        if let Some(lights) = AnalyticLights::of(&edited) {
            let mut panorama = viewers.at(Vec3::ZERO).panorama(Vec3::ZERO, 8, 4);
            lights.add_to_panorama(Vec3::ZERO, &mut panorama);
            assert!(finite(&panorama.radiance));
        }
    }
});
