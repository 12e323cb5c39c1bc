//! Transfers weights between light networks of different octree depths.

use burn::tensor::Device;
use lo_nets::checkpoint::Checkpoint;
use lo_nets::light::{LightConfigError, LightNet, LightNetConfig};

const OLD: &str = "old";
const NEW: &str = "new";

/// Returns a network of shape `to` with the weights of `old`, of shape `from`, in all stages that both have.
///
/// New stages get random weights from `seed`.
///
/// # Errors
/// An invalid shape.
pub(crate) fn transfer_stages(
    old: &LightNet,
    from: &LightNetConfig,
    to: &LightNetConfig,
    seed: u64,
    device: &Device,
) -> Result<LightNet, LightConfigError> {
    let new = LightNet::new(to, seed, device)?;
    let mut both = Checkpoint::default();
    both.add_module(OLD, old);
    both.add_module(NEW, &new);
    let shapes: std::collections::BTreeMap<String, Vec<usize>> =
        both.shapes().map(|(name, shape)| (name.to_owned(), shape.to_vec())).collect();
    let shift = to.depth as i64 - from.depth as i64;
    let source = |name: &str| {
        let (old, new) = (format!("{OLD}.{}", old_name(name, shift)), format!("{NEW}.{name}"));
        if shapes.contains_key(&old) && shapes.get(&old) == shapes.get(&new) { old } else { new }
    };
    Ok(both
        .load_renamed("light_net", new, source)
        .expect("every name is in one of the two networks, with the same shape"))
}

/// Returns the name of a parameter in the old network.
///
/// Encoder stages are numbered from the finest, all others from the coarsest.
fn old_name(name: &str, shift: i64) -> String {
    let parts: Vec<&str> = name.splitn(3, '.').collect();
    match parts[..] {
        [list @ ("encoder" | "down"), number, rest] => {
            let number = number.parse::<i64>().map(|number| (number - shift).to_string());
            format!("{list}.{}.{rest}", number.unwrap_or_default())
        }
        _ => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn common_stages_keep_their_weights() {
        let finest =
            LightNetConfig { depth: 6, channels: 8, blocks: 1, bottleneck: 2, head_channels: 8, ..Default::default() };
        let coarse = LightNetConfig { depth: 5, channels: finest.stage_channels(5), ..finest.clone() };
        let device = Device::flex();
        let old = LightNet::new(&coarse, 1, &device).unwrap();
        let new = transfer_stages(&old, &coarse, &finest, 2, &device).unwrap();
        let same = |a: &burn::tensor::Tensor<2>, b: &burn::tensor::Tensor<2>| a.to_data() == b.to_data();
        let first = |stage: &lo_nets::light::BlockStage| stage.blocks[0].first.weights.val();
        // The encoder stage of depth 5 is the second of the new network and the first of the old one.
        assert!(same(&first(&new.encoder[1]), &first(&old.encoder[0])));
        assert!(same(&first(&new.encoder[2]), &first(&old.encoder[1])));
        assert!(same(&new.down[1].weights.val(), &old.down[0].weights.val()));
        assert!(same(&first(&new.decoder[0]), &first(&old.decoder[0])));
        assert!(same(&new.global.weights.val(), &old.global.weights.val()));
        let fresh = LightNet::new(&finest, 2, &device).unwrap();
        assert!(same(&first(&new.encoder[0]), &first(&fresh.encoder[0])));
        assert!(same(&new.up[1].weights.val(), &fresh.up[1].weights.val()));
    }
}
