//! Text by users: command lines, materials, keyframe paths, object layouts, tables of points.
#![no_main]

use clap::Parser;
use libfuzzer_sys::fuzz_target;
use lo_insert::{Layout, Path, PathSource};
use lo_mesh::MaterialSpec;

fuzz_target!(|text: &str| {
    let words = || std::iter::once("lightoctree").chain(text.split('\n'));
    let _ = lightoctree_cli::cli::Cli::try_parse_from(words());
    let _ = lightoctree_lab::cli::Cli::try_parse_from(words());
    let _ = MaterialSpec::parse(text);
    if let Ok(path) = Path::from_json(text) {
        assert!(!path.keyframes.is_empty());
    }
    if let Ok(layout) = Layout::from_json(text) {
        assert!((1..=Layout::MAX_OBJECTS).contains(&layout.objects().len()));
        let names: std::collections::HashSet<&str> = layout.objects().iter().map(|object| object.name()).collect();
        assert_eq!(names.len(), layout.objects().len());
        // Path files have the layout's own text, or keyframes.
        let is_file = |object: &lo_insert::LayoutObject| matches!(object.path, Some(PathSource::File(_)));
        let files = layout.objects().iter().any(is_file);
        assert!(layout.clone().with_paths(|_| Ok(text.to_owned())).is_err() == files);
        let way = r#"{"keyframes":[{"time_s":0,"pixel":[1,2]}]}"#;
        assert!(layout.with_paths(|_| Ok(way.to_owned())).is_ok());
    }
    let _ = lightoctree_cli::commands::probes::points_from_csv(text);
});
