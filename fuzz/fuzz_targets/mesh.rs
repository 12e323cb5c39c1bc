//! Every mesh reader; the first byte chooses the format. Rays are cast at valid meshes.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree_fuzz::let_decoders_panic;
use lo_geometry::{Ray, Vec3};
use lo_mesh::{LoadOptions, Model, PreparedModel};

// Textures are decoded by third-party code.
fuzz_target!(init: let_decoders_panic(), |bytes: &[u8]| {
    let Some((choice, bytes)) = bytes.split_first() else { return };
    let options = LoadOptions::default();
    // Every file that the mesh refers to has the mesh's own bytes.
    let resolve = |_: &str| Ok(bytes.to_vec());
    let model = match choice % 4 {
        0 => Model::from_gltf_bytes(bytes, &resolve),
        1 => Model::from_obj_bytes(bytes, &resolve, &options),
        2 => Model::from_ply_bytes(bytes, &options),
        _ => Model::from_stl_bytes(bytes, &options),
    };
    let Ok(model) = model else { return };
    let prepared = PreparedModel::new(model);
    let bounds = prepared.bounds();
    assert!(bounds.min.is_finite() && bounds.max.is_finite());
    let origin = bounds.max + Vec3::ONE;
    let Some(direction) = (bounds.center() - origin).try_normalize() else { return };
    if let Some(hit) = prepared.intersect_both_sides(&Ray { origin, direction }, f32::INFINITY) {
        let surface = prepared.model().surface(&hit, direction, 0.01);
        assert!(surface.shading_normal.is_finite() && surface.roughness.is_finite());
    }
});
