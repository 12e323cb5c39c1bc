//! Weights of untrained networks.

use std::path::Path;

use lightoctree::Networks;
use lo_nets::Device;
use lo_nets::checkpoint::Precision;
use lo_nets::depth::EncoderKind;
use lo_nets::light::LightNetConfig;

/// Writes weights.safetensors of untrained networks of depth 6 that do not predict the camera.
pub fn write_weights(folder: &Path) {
    let small = LightNetConfig { depth: 6, channels: 8, max_channels: 16, blocks: 1, ..LightNetConfig::default() };
    let config = LightNetConfig { bottleneck: 2, head_channels: 8, ..small };
    let mut networks = Networks::new(EncoderKind::EfficientNetLite0, &config, 1, &Device::flex()).unwrap();
    // An untrained network would predict cameras that are upside down.
    networks.depth.perspective = None;
    networks.write(folder.join("weights.safetensors"), Precision::Half).unwrap();
}
