//! Depth models: the bytes of an ONNX file give an error or a prediction of finite numbers.
#![no_main]

use libfuzzer_sys::fuzz_target;
use lightoctree_fuzz::let_decoders_panic;
use lo_depth_models::{DepthModel, Geometry, ModelConfig, ModelError};
use lo_events as events;
use lo_geometry::Camera;
use lo_imaging::Image;

const CONFIG: &str = "kind = \"metric\"\nsize = { rule = \"fixed\", width = 28, height = 14 }";

fuzz_target!(init: let_decoders_panic(), |bytes: &[u8]| {
    let config = ModelConfig::parse(CONFIG).expect("a valid config");
    let model = match DepthModel::from_bytes(bytes, None) {
        Err(ModelError::Unknown { .. }) => DepthModel::from_bytes(bytes, Some(&config)),
        known => known,
    };
    let Ok(model) = model else { return };
    let photo = Image::from_fn(32, 24, |x, y| [8 * x as u8, 8 * y as u8, 100]);
    let camera = Camera::from_hfov_deg(60.0, 32, 24).expect("a valid camera");
    let Ok(told) = model.predict(&photo, Some(&camera), &mut events::ignore) else { return };
    if let Geometry::Metric(depth_m) = told.geometry {
        assert!(depth_m.pixels().iter().all(|z| z.is_finite() && *z >= 0.0));
    }
    if let Some(normals) = told.normals {
        assert!(normals.pixels().iter().all(|normal| normal.is_finite()));
    }
});
