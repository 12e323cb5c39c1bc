//! Settings on which results depend. Results of different settings are never mixed in a folder.

use std::io::Write;
use std::path::Path;

use anyhow::Context;
use serde_json::{Value, json};

use super::args::{Args, COMMAND};
use crate::args::Global;
use crate::choice::name_of;
use crate::commands::environment::{ORIENTATIONS, signed};
use crate::commands::estimate::COMPLETIONS;
use crate::usage::Usage;

/// Longest manifest, bytes.
const MAX_MANIFEST_BYTES: u64 = 1 << 20;

/// Returns everything that the results of a photo depend on.
pub fn of(global: &Global, args: &Args) -> Value {
    #[cfg(feature = "weights")]
    let shipped = Some(lo_estimate::WEIGHTS_SHA256);
    #[cfg(not(feature = "weights"))]
    let shipped: Option<&str> = None;
    #[cfg(feature = "depth-models")]
    let depth_model = args.depth_model.settings();
    #[cfg(not(feature = "depth-models"))]
    let depth_model = Value::Null;
    let envmap = args.envmap_at.map(|at| {
        json!({
            "at_m": at.to_array(),
            "size": args.panorama.size,
            "level": args.panorama.frame.is_level(),
            "orientation": name_of(&ORIENTATIONS, args.panorama.file.orientation),
            "half": args.panorama.file.half,
        })
    });
    let settings = json!({
        "program_version": env!("CARGO_PKG_VERSION"),
        "weights": args.method.weights.as_ref().map_or(json!(shipped), |file| json!(file)),
        "seed": global.seed,
        "octree_depth": args.method.octree_depth,
        "completion": args.method.completion.map(|completion| name_of(&COMPLETIONS, completion)),
        "lens": args.lens.settings(),
        "depth_model": depth_model,
        "scenes": !args.no_scenes,
        "envmap": envmap,
    });
    signed(COMMAND, settings)
}

/// Writes the manifest, or compares it with that of an earlier run or of another part.
///
/// # Errors
/// [`Usage`] if the settings differ; a manifest that cannot be written or read.
pub fn agree(manifest: &Path, settings: &Value) -> anyhow::Result<()> {
    let failed = || format!("cannot write {}", manifest.display());
    let text = format!("{settings:#}\n");
    if !manifest.exists() {
        let mut file = lo_imaging::temporary_beside(manifest).with_context(failed)?;
        file.write_all(text.as_bytes()).with_context(failed)?;
        match file.persist_noclobber(manifest) {
            Ok(_) => return Ok(()),
            // Another part was faster.
            Err(error) if error.error.kind() == std::io::ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error.error).with_context(failed),
        }
    }
    let unreadable = || format!("cannot read {}", manifest.display());
    let existing = lo_imaging::read_regular_text(manifest, MAX_MANIFEST_BYTES).with_context(unreadable)?;
    let existing: Value = serde_json::from_str(&existing).with_context(unreadable)?;
    // Numbers as they are after reading.
    let settings: Value = serde_json::from_str(&text)?;
    let differs = settings.as_object().into_iter().flatten().find(|(key, value)| existing.get(key) != Some(value));
    let Some((key, value)) = differs else { return Ok(()) };
    let folder = manifest.parent().unwrap_or(manifest);
    Err(Usage(format!(
        "{} has results of other settings: {key} was {}, now it is {value}; choose another folder",
        folder.display(),
        existing.get(key).unwrap_or(&Value::Null)
    ))
    .into())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn settings_are_not_mixed() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = folder.path().join("batch.json");
        let settings = |seed: u32| json!({ "generator": "lightoctree batch", "seed": seed });
        agree(&manifest, &settings(1)).unwrap();
        agree(&manifest, &settings(1)).unwrap();
        let error = agree(&manifest, &settings(2)).unwrap_err();
        assert!(error.is::<Usage>() && error.to_string().contains("seed was 1, now it is 2"), "{error}");
        std::fs::write(&manifest, "{").unwrap();
        assert!(agree(&manifest, &settings(1)).unwrap_err().to_string().contains("batch.json"));
    }

    #[test]
    fn parts_that_begin_together_agree() {
        let folder = tempfile::tempdir().unwrap();
        let manifest = folder.path().join("batch.json");
        let begin = |seed: u32| agree(&manifest, &json!({ "seed": seed, "at_m": [0.1_f32] })).is_ok();
        let agreed: Vec<bool> = std::thread::scope(|scope| {
            let parts: Vec<_> = (0..16).map(|part| scope.spawn(move || begin(part % 2))).collect();
            parts.into_iter().map(|part| part.join().unwrap()).collect()
        });
        // All of one seed, none of the other.
        assert_eq!(agreed.iter().filter(|agreed| **agreed).count(), 8, "{agreed:?}");
        assert!((2..16).all(|part| agreed[part] == agreed[part % 2]));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "temporary files are removed");
    }
}
